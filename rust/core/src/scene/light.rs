// SPDX-License-Identifier: Apache-2.0
//! Lights: the `UsdLux` inputs worked out to radiance. Pure.

/// A light that shines.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Light {
    /// Constant radiance from everywhere.
    Dome {
        /// Linear Rec. 709.
        radiance: [f32; 3],
        /// Seen directly by camera rays.
        camera_visible: bool,
    },
    /// Light from a cone of directions.
    Distant {
        /// Unit, world space, from the scene towards the light.
        direction: [f32; 3],
        /// Radiance inside the cone; irradiance on a facing surface when `cos_half_angle` is 1.
        radiance: [f32; 3],
        /// Cosine of half the opening angle; exactly 1 = a single direction.
        cos_half_angle: f32,
    },
}
