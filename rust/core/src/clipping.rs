// SPDX-License-Identifier: Apache-2.0
//! Clipping planes of a camera, as functions of the image point that a ray passes. Pure; any thread.

use crate::camera::{Camera, CameraError};
use glam::{DMat4, DVec3, DVec4};
use oocpt_abi::ClipPlane;

/// Largest number of clipping planes; further ones are ignored.
pub const MAX_CLIP_PLANES: usize = 16;

impl Camera {
    /// The planes of the camera along its rays, whether it moves or not. Planes that are not finite, and those that cut
    /// nothing, are left out.
    ///
    /// # Errors
    /// Those of [`Camera::rays`].
    pub fn planes_along_rays(&self) -> Result<Vec<ClipPlane>, CameraError> {
        let usable = self.clip_planes.iter().filter_map(|plane| unit(*plane)).take(MAX_CLIP_PLANES);
        let planes: Vec<DVec4> = usable.collect();
        if planes.is_empty() {
            return Ok(Vec::new());
        }
        // The camera looks from the origin of the world, so its rays are those of the view.
        let view = Self { world_from_view: DMat4::IDENTITY, motion: Vec::new(), ..self.clone() }.rays(DVec3::ZERO)?;
        let along = |plane: DVec4| {
            let dot = |v: [f32; 3]| narrow(plane.truncate().dot(DVec3::from_array(v.map(f64::from))));
            let origin = DVec3::from_array(view.o.map(f64::from)) + DVec3::from_array(view.o_lo.map(f64::from));
            ClipPlane {
                begins: [narrow(plane.truncate().dot(origin) + plane.w), dot(view.o_x), dot(view.o_y)],
                slope: [dot(view.d), dot(view.d_x), dot(view.d_y)],
                lens_x: dot(view.lens_u),
                lens_y: dot(view.lens_v),
            }
        };
        Ok(planes.into_iter().map(along).collect())
    }
}

/// The plane with a normal of length 1, so that single precision can represent it at any scale. A plane without a
/// normal keeps everything and gives `None`, or keeps nothing.
fn unit(plane: DVec4) -> Option<DVec4> {
    let largest = plane.truncate().abs().max_element();
    if !plane.is_finite() {
        return None;
    }
    if largest == 0.0 {
        return (plane.w < 0.0).then_some(-DVec4::W);
    }
    let normal = plane.truncate() / largest;
    let length = normal.length();
    Some((normal / length).extend(plane.w / largest / length))
}

/// Rounds to single precision, clamped to finite values.
#[expect(clippy::cast_possible_truncation, reason = "rounding to single precision is what is wanted")]
fn narrow(value: f64) -> f32 {
    value.clamp(f64::from(-f32::MAX), f64::from(f32::MAX)) as f32
}
