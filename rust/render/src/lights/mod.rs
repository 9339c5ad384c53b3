// SPDX-License-Identifier: Apache-2.0
//! The lights as the passes need them.
//!
//! Scenes of constant domes and distant lights take [`LightTable`]'s sums and its table of distant lights (`plain`).
//! All others, and all with materials, take [`GeneralLights`]: local lights under a light tree (`local`, `tree`),
//! lights at infinity (`infinite`), pictures (`picture`), measured profiles and meshes that emit light (`mesh`,
//! `emitter`). What belongs to the device is laid out by `upload`.
//!
//! Pure but for the reading of files, which goes through [`LightFiles`]. Render thread only.

mod emission;
mod emission_map;
mod emitter;
mod files;
mod general;
mod local;
mod mesh;
#[cfg(test)]
mod mesh_tests;
mod picture;
mod plain;
mod program;
mod read;
#[cfg(test)]
mod tests;
mod tree;
mod upload;

pub(crate) use files::FileCache;
pub(crate) use general::GeneralLights;
pub(crate) use mesh::{MeshLightCache, MeshLights};
pub(crate) use upload::LightTables;

use crate::light_files::LightFiles;
use oocpt_core::scene::{Emitter, Light, Snapshot};
use oocpt_shader_abi::{Features, GpuDistantLight};
use plain::PlainLights;
use std::sync::Arc;

/// Share of a group's shadow rays that goes to all of its lights alike: dim lights do not starve.
const EVEN_SHARE: f64 = 0.02;

/// All lights of a snapshot.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct LightTable {
    /// Used without [`LightTable::general`], but for what the camera sees of domes.
    pub(crate) plain: PlainLights,
    /// Some light is more than a constant dome or a distant light, or there are materials.
    pub(crate) general: Option<GeneralLights>,
}

impl LightTable {
    /// Sorts the lights. `camera_visible` is the setting that hides every dome from the camera when false;
    /// `has_materials` asks for the general table whatever the lights are. Gives warnings about files.
    pub(crate) fn new(
        snapshot: &Snapshot,
        lights: &[Light],
        camera_visible: bool,
        has_materials: bool,
        files: &dyn LightFiles,
        cache: &mut FileCache,
    ) -> (Self, Vec<String>) {
        let simple = |light: &Light| {
            light.is_plain() && !matches!(&light.emitter, Emitter::Local(_) | Emitter::Dome { texture: Some(_) })
        };
        let is_general = has_materials || !lights.iter().all(simple);
        let mut warnings = Vec::new();
        let general = is_general.then(|| {
            let (general, messages) = GeneralLights::new(snapshot, lights, camera_visible, files, cache);
            warnings = messages;
            general
        });
        (Self { plain: PlainLights::new(lights, camera_visible), general }, warnings)
    }

    /// Adds the meshes that emit light to the general table, which a scene with materials has.
    pub(crate) fn add_meshes(&mut self, meshes: &Arc<MeshLights>) {
        if let Some(general) = &mut self.general {
            general.add_meshes(meshes);
        }
    }

    /// Whether the camera sees a dome.
    pub(crate) fn background_visible(&self) -> bool {
        self.general.as_ref().map_or(self.plain.background_visible, GeneralLights::background_visible)
    }

    /// The table of distant lights for passes without the light table.
    pub(crate) fn distant(&self) -> &[GpuDistantLight] {
        if self.general.is_some() { &[] } else { &self.plain.distant }
    }

    /// What the passes need for these lights.
    pub(crate) fn features(&self) -> Features {
        if let Some(general) = &self.general {
            return general.features;
        }
        let mut features = Features::empty();
        features.set(Features::DOME, self.plain.has_dome);
        features.set(Features::DOME_SHADOW_RAYS, self.plain.has_dome);
        features.set(Features::DISTANT, !self.plain.distant.is_empty());
        features
    }
}

/// Rec. 709 luminance.
fn luminance(rgb: [f32; 3]) -> f64 {
    0.2126 * f64::from(rgb[0]) + 0.7152 * f64::from(rgb[1]) + 0.0722 * f64::from(rgb[2])
}

/// What an emission counts for in choosing: `emission_weight` of the shaders.
fn emission_weight(rgb: [f64; 3]) -> f64 {
    let [r, g, b] = rgb;
    (0.2126 * r + 0.7152 * g + 0.0722 * b).max(0.01 * (r + g + b))
}

/// A number of lights, at least 1.
#[expect(clippy::cast_precision_loss, reason = "numbers of lights fit f64")]
fn count(n: usize) -> f64 {
    n.max(1) as f64
}

/// Rounded to single precision.
#[expect(clippy::cast_possible_truncation, reason = "rounding to single precision is what is wanted")]
fn narrow(value: f64) -> f32 {
    value as f32
}
