// SPDX-License-Identifier: Apache-2.0
//! The film and the size of the AOV planes.
//!
//! Guarantees: plain data with the offsets of `shaders/include/abi.glsl`. Any thread.

use super::AovTargets;
use bytemuck::{Pod, Zeroable};

/// What the film knows of a pixel, 48 B. All zero = no sample yet.
/// Sums are compensated (Kahan 1965) and taken in ascending sample order, so they do not depend on the size of the waves.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
pub struct FilmPixel {
    /// Sum of (rgb, alpha) over the samples, premultiplied.
    pub sum: [f32; 4],
    /// What rounding has kept out of `sum` so far (to be subtracted).
    pub compensation: [f32; 4],
    /// Sum of squared deviations from the mean, per channel (Welford 1962): the variance of a sample is
    /// `m2 / (samples - 1)`, of the pixel `m2 / (samples - 1) / samples`.
    pub m2: [f32; 3],
    /// Samples.
    pub samples: u32,
}

/// Bytes per pixel of each plane of [`AovTargets`], same members.
#[must_use]
pub const fn aov_bytes() -> AovTargets {
    AovTargets {
        depth: 4,
        camera_depth: 4,
        prim_id: 4,
        instance_id: 4,
        element_id: 4,
        normal: 12,
        neye: 12,
        albedo: 12,
    }
}
