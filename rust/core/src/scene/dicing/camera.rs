// SPDX-License-Identifier: Apache-2.0
//! The camera, as far as the size of things in the picture goes. Pure.

use glam::{DAffine3, DMat4, DVec3, DVec4, Vec4Swizzles as _};

use crate::camera::Camera;
use crate::mesh::OUT_OF_PICTURE;

/// Pixels of a unit of length.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct DicingDensity {
    /// What is needed.
    pub(super) needed: f64,
    /// What were needed if all were in the picture.
    pub(super) in_picture: f64,
}

impl DicingDensity {
    pub(super) fn max(self, other: Self) -> Self {
        Self { needed: self.needed.max(other.needed), in_picture: self.in_picture.max(other.in_picture) }
    }

    /// In a frame whose units are so many times as long.
    pub(super) fn stretched(self, by: f64) -> Self {
        Self { needed: self.needed * by, in_picture: self.in_picture * by }
    }

    /// Whether nothing of `other` is more.
    pub(super) fn covers(self, other: Self) -> bool {
        other.needed <= self.needed && other.in_picture <= self.in_picture
    }
}

/// How large a thing is in the picture, in pixels.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DicingCamera {
    /// Longest piece of an edge, in pixels; 0 = surfaces are cut as their refine level says.
    pub(super) pixels: f64,
    pub(super) position: DVec3,
    /// Pixels of a unit of length at distance 1; 0 for an orthographic camera.
    pub(super) focal: f64,
    /// Pixels of a unit of length everywhere.
    pub(super) density: f64,
    /// Inner sides of the view, in the world: `dot(normal, p) + w` is negative outside.
    planes: Vec<DVec4>,
    /// The view is a live one: what was cut for the one before stays as long as it is fine enough.
    pub(super) is_live: bool,
}

impl DicingCamera {
    /// Edges of at most `pixels` pixels in the picture of `camera`. A camera without a usable matrix cuts nothing.
    #[must_use]
    pub fn new(camera: &Camera, pixels: f32) -> Self {
        let window = camera.display_window.map(f64::from);
        let size = [(window[2] - window[0]).abs(), (window[3] - window[1]).abs()];
        let projection = camera.projection;
        let scale = [projection.x_axis.x, projection.y_axis.y].map(f64::abs);
        let per_unit = f64::max(scale[0] * size[0], scale[1] * size[1]) / 2.0;
        let view_from_world = camera.world_from_view.inverse();
        let is_perspective = projection.x_axis.w != 0.0 || projection.y_axis.w != 0.0 || projection.z_axis.w != 0.0;
        let units = camera.world_from_view.x_axis.xyz().length();
        let out = Self {
            pixels: f64::from(pixels),
            position: camera.world_from_view.w_axis.xyz(),
            focal: if is_perspective { per_unit } else { 0.0 },
            density: if is_perspective { 0.0 } else { per_unit / units },
            planes: planes(&(projection * view_from_world), is_perspective),
            is_live: false,
        };
        let numbers = [out.pixels, out.focal, out.density, out.position.length()];
        let is_usable = numbers.iter().all(|v| v.is_finite()) && out.planes.iter().all(|plane| plane.is_finite());
        if is_usable && out.pixels > 0.0 { out } else { Self::default() }
    }

    /// The same camera, for a view that artists move: rates change in steps of two and stay as long as they are fine
    /// enough, so that few steps of the camera rebuild anything. They may be finer than asked for, and close to the
    /// camera coarser.
    #[must_use]
    pub fn live(self, is_live: bool) -> Self {
        Self { is_live: is_live && self.pixels > 0.0, ..self }
    }

    /// Longest piece of an edge, in pixels; 0 = surfaces are cut as their refine level says.
    pub(crate) fn pixels(&self) -> f64 {
        self.pixels
    }

    /// Pixels of a unit of length in a ball that is at least `distance` away.
    pub(super) fn density_in(&self, center: DVec3, radius: f64, distance: f64) -> DicingDensity {
        let in_picture = self.density + self.focal / distance;
        let needed = if self.is_in_picture(center, radius) { in_picture } else { in_picture / OUT_OF_PICTURE };
        DicingDensity { needed, in_picture }
    }

    /// The inner sides of the picture in the frame that `map` places, if the camera is a perspective one.
    pub(super) fn sides_in(&self, map: &DAffine3) -> Option<[DVec4; 5]> {
        let inside = |plane: &DVec4| {
            let normal = map.matrix3.transpose() * plane.xyz();
            normal.extend(plane.xyz().dot(map.translation) + plane.w) / normal.length()
        };
        let sides: Vec<DVec4> = self.planes.iter().map(inside).collect();
        sides.try_into().ok().filter(|sides: &[DVec4; 5]| sides.iter().all(|side| side.is_finite()))
    }

    /// True when some of a ball may be in the picture.
    pub(super) fn is_in_picture(&self, center: DVec3, radius: f64) -> bool {
        self.planes.iter().all(|plane| plane.xyz().dot(center) + plane.w >= -radius)
    }
}

/// The sides of the picture, and what is behind a perspective camera.
fn planes(clip_from_world: &DMat4, is_perspective: bool) -> Vec<DVec4> {
    let [x, y, w] = [0, 1, 3].map(|row| clip_from_world.row(row));
    let sides = [w + x, w - x, w + y, w - y];
    let front = is_perspective.then_some(w);
    let normalized = |plane: DVec4| plane / plane.xyz().length();
    sides.into_iter().chain(front).map(normalized).collect()
}

#[cfg(test)]
mod tests {
    use glam::DMat4;

    use super::*;

    fn camera(projection: DMat4) -> Camera {
        Camera {
            world_from_view: DMat4::from_translation(DVec3::new(0.0, 0.0, 10.0)),
            projection,
            display_window: [0.0, 0.0, 200.0, 100.0],
            data_window: [0, 0, 200, 100],
            lens_radius: 0.0,
            focus_distance: 1.0,
            clip_planes: Vec::new(),
            motion: Vec::new(),
            exposure_scale: 1.0,
        }
    }

    #[test]
    fn projected_size_of_a_unit_length_matches_the_projection() {
        // 90 degrees from side to side: 100 pixels from the axis to the side at distance 1.
        let columns = |x: f64, y: f64, z: DVec4, w: DVec4| DMat4::from_cols(DVec4::X * x, DVec4::Y * y, z, w);
        let perspective = columns(1.0, 1.0, DVec4::new(0.0, 0.0, -1.0, -1.0), DVec4::Z * -0.2);
        let seen = DicingCamera::new(&camera(perspective), 2.0);
        assert!((seen.density_in(DVec3::ZERO, 1.0, 10.0).needed - 10.0).abs() < 1e-9, "10 pixels a unit");
        let right = DVec3::new(20.0, 0.0, 0.0);
        assert!((seen.density_in(right, 1.0, 10.0).needed - 2.5).abs() < 1e-9, "out of the picture a quarter of it");
        assert!((seen.density_in(right, 1.0, 10.0).in_picture - 10.0).abs() < 1e-9, "if it were in the picture");
        assert!(seen.is_in_picture(DVec3::new(10.5, 0.0, 0.0), 1.0), "the edge of the picture cuts the ball");
        assert!(!seen.is_in_picture(DVec3::new(0.0, 0.0, 12.0), 1.0), "behind the camera");
        // 8 units wide.
        let parallel = columns(0.25, 0.5, DVec4::Z * -0.02, DVec4::W);
        let seen = DicingCamera::new(&camera(parallel), 2.0);
        assert!(
            (seen.density_in(DVec3::ZERO, 1.0, 1e9).needed - 25.0).abs() < 1e-9,
            "200 pixels for 8 units, at any distance"
        );
    }

    #[test]
    fn a_non_finite_camera_disables_dicing() {
        let nowhere = Camera { world_from_view: DMat4::ZERO, ..camera(DMat4::IDENTITY) };
        assert_eq!(DicingCamera::new(&nowhere, 2.0), DicingCamera::default());
        assert_eq!(DicingCamera::new(&camera(DMat4::IDENTITY), 0.0), DicingCamera::default(), "switched off");
    }
}
