// SPDX-License-Identifier: Apache-2.0
//! The sizes that a streamed scene needs of the buffers of its frames. Pure.

/// The properties of a scene that decide the amount of memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct StreamingNeeds {
    pub(crate) levels: u32,
    pub(crate) chunks: u32,
    /// Number of chunks and meshes.
    pub(crate) geometry: u32,
    /// Number of chunks, meshes and tiles of textures.
    pub(crate) units: u32,
    /// True if paths wait for tiles.
    pub(crate) textures: bool,
    /// Most lookups of textures that a material makes.
    pub(crate) lookups: u32,
    /// True if rays wait for tiles, because of cutouts.
    pub(crate) cutouts: bool,
    /// True if rays wait for tiles in programs.
    pub(crate) cutout_programs: bool,
    /// True if some mesh has a material.
    pub(crate) materials: bool,
    /// True if lights need data of the surface that a ray left.
    pub(crate) light_paths: bool,
    /// True if some light needs shadow rays.
    pub(crate) shadows: bool,
    /// True if roulette on loads is played.
    pub(crate) roulette: bool,
    /// True if the rays that enter each chunk and mesh are counted.
    pub(crate) visits: bool,
    /// True if some kind of bounce has a limit of its own.
    pub(crate) bounce_kinds: bool,
    /// Values that a sample has for filtered images.
    pub(crate) plane_words: u32,
    /// Of these, values of light path expressions, shadows and waits.
    pub(crate) light_words: u32,
    /// True if there are light path expressions.
    pub(crate) path_states: bool,
}

impl StreamingNeeds {
    /// These needs with at least one unit of each kind, so that no buffer is empty.
    pub(super) fn at_least_one(self) -> Self {
        let [chunks, geometry, units] = [self.chunks, self.geometry, self.units].map(|count| count.max(1));
        Self { chunks, geometry, units, ..self }
    }
}
