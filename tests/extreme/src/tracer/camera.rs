// SPDX-License-Identifier: Apache-2.0
//! The cameras of the cases: one description, from which the renderer gets matrices and the f64 tracer gets rays by
//! trigonometry.

use glam::{DMat4, DVec3, DVec4};
use oocpt_core::camera::Camera;

use super::bvh::Ray;

/// What a camera sees.
#[derive(Clone, Copy, Debug)]
pub(crate) enum View {
    /// Vertical angle in radians.
    Angle(f64),
    /// Parallel rays; height of the picture.
    Height(f64),
}

/// A camera that looks from `eye` to `target`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Eye {
    pub(crate) eye: DVec3,
    pub(crate) target: DVec3,
    pub(crate) up: DVec3,
    pub(crate) view: View,
    pub(crate) size: [u32; 2],
    /// Width over height of what is seen; none: of the picture.
    pub(crate) aspect: Option<f64>,
    /// Planes of the projection.
    pub(crate) planes: [f64; 2],
}

impl Eye {
    /// A perspective camera, upright.
    pub(crate) fn at(eye: DVec3, target: DVec3, angle: f64, size: [u32; 2]) -> Self {
        Self { eye, target, up: DVec3::Y, view: View::Angle(angle), size, aspect: None, planes: [0.1, 1000.0] }
    }

    /// A parallel camera, upright, that sees this height.
    pub(crate) fn parallel(eye: DVec3, target: DVec3, height: f64, size: [u32; 2]) -> Self {
        Self { view: View::Height(height), ..Self::at(eye, target, 1.0, size) }
    }

    fn axes(&self) -> [DVec3; 3] {
        let back = (self.eye - self.target).normalize();
        let right = self.up.cross(back).normalize();
        [right, back.cross(right), back]
    }

    fn half(&self) -> (f64, f64) {
        let y = match self.view {
            View::Angle(angle) => (0.5 * angle).tan(),
            View::Height(height) => 0.5 * height,
        };
        let aspect = self.aspect.unwrap_or(f64::from(self.size[0]) / f64::from(self.size[1]));
        (y * aspect, y)
    }

    /// Height of a pixel at distance 1; of a parallel camera anywhere.
    pub(crate) fn pixel(&self) -> f64 {
        2.0 * self.half().1 / f64::from(self.size[1])
    }

    /// The camera as the renderer takes it.
    #[expect(clippy::cast_precision_loss, clippy::cast_possible_wrap, reason = "sides of images")]
    pub(crate) fn camera(&self) -> Camera {
        let [right, up, back] = self.axes();
        let (x, y) = self.half();
        let [near, far] = self.planes;
        let column = |k: usize, value: f64| DVec4::from_array([0, 1, 2, 3].map(|i| if i == k { value } else { 0.0 }));
        let projection = match self.view {
            View::Angle(_) => DMat4::from_cols(
                column(0, 1.0 / x),
                column(1, 1.0 / y),
                DVec4::new(0.0, 0.0, (far + near) / (near - far), -1.0),
                column(2, 2.0 * far * near / (near - far)),
            ),
            View::Height(_) => DMat4::from_cols(
                column(0, 1.0 / x),
                column(1, 1.0 / y),
                column(2, 2.0 / (near - far)),
                DVec4::new(0.0, 0.0, (far + near) / (near - far), 1.0),
            ),
        };
        let place = |v: DVec3, w: f64| v.extend(w);
        Camera {
            world_from_view: DMat4::from_cols(
                place(right, 0.0),
                place(up, 0.0),
                place(back, 0.0),
                place(self.eye, 1.0),
            ),
            projection,
            display_window: [0.0, 0.0, self.size[0] as f32, self.size[1] as f32],
            data_window: [0, 0, self.size[0] as i32, self.size[1] as i32],
            lens_radius: 0.0,
            focus_distance: 0.0,
            clip_planes: Vec::new(),
            motion: Vec::new(),
            exposure_scale: 1.0,
        }
    }

    /// The ray through a point of the picture, pixels from the lower left; the parameter is the distance along the
    /// axis.
    pub(crate) fn ray(&self, px: f64, py: f64) -> Ray {
        let [right, up, back] = self.axes();
        let (x, y) = self.half();
        let u = (2.0 * px / f64::from(self.size[0]) - 1.0) * x;
        let v = (2.0 * py / f64::from(self.size[1]) - 1.0) * y;
        match self.view {
            View::Angle(_) => Ray { o: self.eye, d: right * u + up * v - back },
            View::Height(_) => Ray { o: self.eye + right * u + up * v, d: -back },
        }
    }
}
