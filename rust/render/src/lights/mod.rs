// SPDX-License-Identifier: Apache-2.0
//! The lights in the form that the passes need.
//!
//! [`LightTable`] has them all: local lights under a light tree (`local`, `tree`), lights at infinity, pictures
//! (`picture`), measured profiles and meshes that emit light (`mesh`, `emitter`). `upload` lays them out on the device.
//!
//! Pure but for the reading of files, which goes through [`crate::job::light_files::LightFiles`]. Render thread only.

mod brightness;
mod dome_layout;
mod emission;
mod emission_map;
mod emitter;
mod files;
mod kept;
mod local;
mod mesh;
mod mesh_motion;
mod picture;
mod placed_bounds;
mod program;
mod read;
mod table;
#[cfg(test)]
mod tests;
mod tree;
mod upload;

pub(crate) use files::FileCache;
pub(crate) use kept::{KeptLights, LightSource};
pub(crate) use mesh::{MeshLightCache, MeshLights};
pub(crate) use table::LightTable;
pub(crate) use upload::LightTables;

/// Share of a group's shadow rays that goes to all of its lights alike, so that dim lights get some.
const EVEN_SHARE: f64 = 0.02;

/// Rec. 709 luminance.
fn luminance(rgb: [f32; 3]) -> f64 {
    0.2126 * f64::from(rgb[0]) + 0.7152 * f64::from(rgb[1]) + 0.0722 * f64::from(rgb[2])
}

/// The weight of an emission in choosing: `emission_weight` of the shaders.
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
