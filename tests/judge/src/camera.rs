// SPDX-License-Identifier: Apache-2.0
//! Camera rays in f64 from the inverse of the projection, independent of `oocpt_core::camera`'s affine ray form.

use glam::{DMat4, DVec2, DVec3, DVec4};
use oocpt_core::camera::Camera;

use crate::JudgeError;

/// A ray; `direction` need not be of unit length.
#[derive(Debug, Clone, Copy)]
pub struct Ray {
    /// Start, relative to the snapshot's origin.
    pub origin: DVec3,
    /// Direction; distances along the ray count in its length.
    pub direction: DVec3,
}

/// Makes the rays of one camera, relative to `origin` (the snapshot's).
#[derive(Debug)]
pub struct PixelRays {
    view_from_clip: DMat4,
    clip_from_view: DMat4,
    world_from_view: DMat4,
    view_from_world: DMat4,
    display_window: [f64; 4],
    data_window: [i32; 4],
    lens_radius: f64,
    focus_distance: f64,
}

impl PixelRays {
    /// # Errors
    /// [`JudgeError::Singular`] when the camera's matrices have no inverse.
    pub fn new(camera: &Camera, origin: DVec3) -> Result<Self, JudgeError> {
        let world_from_view = DMat4::from_translation(-origin) * camera.world_from_view;
        for (matrix, name) in [(camera.projection, "the projection"), (world_from_view, "the camera transform")] {
            if matrix.determinant() == 0.0 || !matrix.is_finite() {
                return Err(JudgeError::Singular(name));
            }
        }
        Ok(Self {
            view_from_clip: camera.projection.inverse(),
            clip_from_view: camera.projection,
            world_from_view,
            view_from_world: world_from_view.inverse(),
            display_window: camera.display_window.map(f64::from),
            data_window: camera.data_window,
            lens_radius: camera.lens_radius,
            focus_distance: camera.focus_distance,
        })
    }

    /// Width and height of the image in pixels.
    #[must_use]
    pub fn size(&self) -> (usize, usize) {
        let [x0, y0, x1, y1] = self.data_window;
        let extent = |low: i32, high: i32| usize::try_from(high - low).unwrap_or(0);
        (extent(x0, x1), extent(y0, y1))
    }

    /// The pinhole ray through `pixel` (in pixels, (0.5, 0.5) = centre of the lower left pixel), in view space.
    fn view_ray(&self, pixel: DVec2) -> Ray {
        let [x0, y0, x1, y1] = self.display_window;
        let [data_x0, _, _, data_y1] = self.data_window.map(f64::from);
        // Windows are y-down as in CameraUtilFraming, buffers bottom-up: row 0 is the last line of the data window.
        let window = DVec2::new(data_x0 + pixel.x, data_y1 - pixel.y);
        let ndc = DVec2::new(2.0 * (window.x - x0) / (x1 - x0) - 1.0, 1.0 - 2.0 * (window.y - y0) / (y1 - y0));
        let near = self.view_from_clip.project_point3(DVec3::new(ndc.x, ndc.y, -1.0));
        let far = self.view_from_clip.project_point3(DVec3::new(ndc.x, ndc.y, 1.0));
        let direction = (far - near) / (near.z - far.z);
        let origin = if self.is_perspective() { DVec3::ZERO } else { near + direction * near.z };
        Ray { origin, direction }
    }

    fn is_perspective(&self) -> bool {
        self.clip_from_view.row(3) != DVec4::W
    }

    fn to_world(&self, ray: Ray) -> Ray {
        Ray {
            origin: self.world_from_view.transform_point3(ray.origin),
            direction: self.world_from_view.transform_vector3(ray.direction),
        }
    }

    /// The pinhole ray through a position of the image in pixels, bottom-up. Its unit of distance is camera depth.
    #[must_use]
    pub fn pinhole(&self, pixel: DVec2) -> Ray {
        self.to_world(self.view_ray(pixel))
    }

    /// As [`Self::pinhole`], through a point of the lens (unit disk) when the camera has one.
    #[must_use]
    pub fn through_lens(&self, pixel: DVec2, disk: DVec2) -> Ray {
        let pinhole = self.view_ray(pixel);
        if self.lens_radius <= 0.0 {
            return self.to_world(pinhole);
        }
        let in_focus = pinhole.origin + pinhole.direction * self.focus_distance;
        let origin = pinhole.origin + DVec3::new(disk.x, disk.y, 0.0) * self.lens_radius;
        self.to_world(Ray { origin, direction: (in_focus - origin) / self.focus_distance })
    }

    /// Depth as Hydra stores it: window depth in `[0, 1]`, 1 = far plane.
    #[must_use]
    pub fn window_depth(&self, point: DVec3) -> f64 {
        let clip = self.clip_from_view * self.view_from_world * point.extend(1.0);
        0.5 * (clip.z / clip.w) + 0.5
    }

    /// Positive distance along the view axis.
    #[must_use]
    pub fn camera_depth(&self, point: DVec3) -> f64 {
        -self.view_from_world.transform_point3(point).z
    }

    /// A world normal in view space, of unit length.
    #[must_use]
    pub fn view_normal(&self, normal: DVec3) -> DVec3 {
        (self.world_from_view.transpose() * normal.extend(0.0)).truncate().normalize()
    }
}
