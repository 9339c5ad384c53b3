// SPDX-License-Identifier: Apache-2.0
//! From camera matrices to rays that are affine in the pixel position, and to the rows that turn a hit point into
//! depths. All in f64, rounded once at the end. Pure; any thread.

use glam::{DAffine3, DMat4, DVec2, DVec3, DVec4};

/// A camera as Hydra resolves it for one image.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// World from view space (view looks along -z, +y is up).
    pub world_from_view: DMat4,
    /// Clip from view space, OpenGL conventions (z in [-w, w]), window policy applied.
    pub projection: DMat4,
    /// Where the projection's [-1, 1] square lands: x0, y0, x1, y1 in pixels, y down (as `CameraUtilFraming`).
    pub display_window: [f32; 4],
    /// The pixels of the image: x0, y0, x1, y1, end exclusive, y down. Row 0 of a buffer is its *last* line.
    pub data_window: [i32; 4],
    /// Radius of the lens in scene units, 0 = pinhole.
    pub lens_radius: f64,
    /// Distance of the plane in focus along the view axis, scene units.
    pub focus_distance: f64,
}

/// Rays for the GPU, relative to the origin given to [`Camera::rays`].
///
/// With `px, py` in pixels from the lower left corner of the data window (pixel centres at +0.5):
/// `origin = o + px * o_x + py * o_y`, `direction = d + px * d_x + py * d_y`. The direction is not normalised: it goes one
/// unit along the view axis, so the ray parameter is the camera depth (of a camera without scale).
/// With a lens: `p = origin + direction * focus`, `origin' = origin + u * lens_u + v * lens_v`,
/// `direction' = (p - origin') / focus`, for `(u, v)` in the unit disk.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CameraRays {
    /// Ray origin at pixel position (0, 0).
    pub o: [f32; 3],
    /// Its change per pixel to the right (zero for perspective).
    pub o_x: [f32; 3],
    /// Its change per pixel up (zero for perspective).
    pub o_y: [f32; 3],
    /// Ray direction at pixel position (0, 0).
    pub d: [f32; 3],
    /// Its change per pixel to the right.
    pub d_x: [f32; 3],
    /// Its change per pixel up.
    pub d_y: [f32; 3],
    /// View x axis times the lens radius; zero = pinhole.
    pub lens_u: [f32; 3],
    /// View y axis times the lens radius.
    pub lens_v: [f32; 3],
    /// Ray parameter of the plane in focus; 1 without a lens.
    pub focus: f32,
    /// Clip z of a point = dot of this with (p, 1). Window depth is `0.5 * z / w + 0.5`.
    pub clip_z: [f32; 4],
    /// Clip w of a point, likewise.
    pub clip_w: [f32; 4],
    /// Rows of the affine view-from-world matrix: `Peye`, and camera depth = -z.
    pub view_from_world: [[f32; 4]; 3],
    /// Rows of the matrix that takes world normals to view space (inverse transpose of `view_from_world`).
    pub view_normal: [[f32; 3]; 3],
}

/// Why a camera gives no rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CameraError {
    /// A matrix or window holds NaN or infinity.
    #[error("the camera's {0} is not finite")]
    NotFinite(&'static str),
    /// A matrix or window has no extent.
    #[error("the camera's {0} is singular")]
    Singular(&'static str),
    /// Neither a perspective (also off-axis) nor an orthographic projection.
    #[error("the camera's projection is neither perspective nor orthographic")]
    Unsupported,
}

impl Camera {
    /// Rays and depth rows relative to the world point `origin`.
    ///
    /// # Errors
    /// See [`CameraError`].
    pub fn rays(&self, origin: DVec3) -> Result<CameraRays, CameraError> {
        todo!("{origin} {:?} {:?} {:?}", DVec2::ZERO, DVec4::ZERO, DAffine3::IDENTITY)
    }
}
