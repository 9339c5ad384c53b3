// SPDX-License-Identifier: Apache-2.0
//! What a scene that streams needs of the buffers of its frames. Pure.

/// What of a scene decides how much memory there has to be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct StreamingNeeds {
    pub(crate) levels: u32,
    pub(crate) chunks: u32,
    /// Chunks, then meshes.
    pub(crate) geometry: u32,
    /// These, then tiles of textures.
    pub(crate) units: u32,
    /// Paths wait for tiles.
    pub(crate) textures: bool,
    /// Most lookups of textures that a material makes.
    pub(crate) lookups: u32,
    /// Rays do.
    pub(crate) cutouts: bool,
    /// They do in programs.
    pub(crate) cutout_programs: bool,
    /// Some mesh has a material.
    pub(crate) materials: bool,
    /// Lights ask something of paths.
    pub(crate) light_paths: bool,
    /// Some light asks for shadow rays.
    pub(crate) shadows: bool,
    /// Roulette on loads is played.
    pub(crate) roulette: bool,
    /// The rays that enter each chunk and mesh are counted.
    pub(crate) visits: bool,
}

impl StreamingNeeds {
    /// The same with one unit of each kind, where there is none: buffers have some bytes.
    pub(super) fn at_least_one(self) -> Self {
        let [chunks, geometry, units] = [self.chunks, self.geometry, self.units].map(|count| count.max(1));
        Self { chunks, geometry, units, ..self }
    }
}
