// SPDX-License-Identifier: Apache-2.0
//! From camera matrices to rays that are affine in the pixel position, and to the rows that turn a hit point into
//! depths. All in f64, rounded once at the end; the ray origin is kept in two floats. Pure; any thread.

use crate::desc::TransformSample;
use glam::{DAffine3, DMat2, DMat3, DMat4, DVec2, DVec3, DVec4};

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
    /// Planes in view space, a x + b y + c z + d: what is seen directly is only what is nowhere below 0 (see
    /// [`crate::MAX_CLIP_PLANES`]).
    pub clip_planes: Vec<DVec4>,
    /// `world_from_view` at times about the shutter; empty where it does not move.
    pub motion: Vec<TransformSample>,
    /// What the colour of the finished picture is multiplied by (`UsdGeomCamera::ComputeLinearExposureScale`): finite,
    /// not negative, else it counts as 1. No other image knows of it.
    pub exposure_scale: f32,
}

/// Rays for the GPU, relative to the origin given to [`Camera::rays`].
///
/// With `px, py` in pixels from the lower left corner of the data window (pixel centres at +0.5):
/// `origin = (o + o_lo) + px * o_x + py * o_y`, `direction = d + px * d_x + py * d_y`. The direction is not normalised:
/// it goes one unit along the view axis, so the ray parameter is the camera depth (of a camera without scale). With a
/// lens: `p = origin + direction * focus`, `origin' = origin + u * lens_u + v * lens_v`, `direction' = (p - origin') /
/// focus`, for `(u, v)` in the unit disk.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CameraRays {
    /// Ray origin at pixel position (0, 0), rounded to single precision.
    pub o: [f32; 3],
    /// What the rounding took: `o + o_lo` (summed in f64) is the origin to 2^-48 of itself, per component, so that a
    /// camera 10^7 units away keeps a ten-millionth of a unit. Smaller than half a step of `o`; below 10^-30 nothing is
    /// promised.
    pub o_lo: [f32; 3],
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
    /// Clip z of a point = dot of this with (v, 1), v in view space. Window depth is `0.5 * z / w + 0.5`. In view space
    /// and not in the world's directions: there a wide angle's z and w would each cancel, and not by the same amount.
    pub clip_z: [f32; 4],
    /// Clip w of a point, likewise.
    pub clip_w: [f32; 4],
    /// Pixel x of a point, from the lower left corner of the data window: dot of this with (v, 1), v in view space,
    /// over that of `clip_w`.
    pub pixel_x: [f32; 4],
    /// Pixel y, likewise.
    pub pixel_y: [f32; 4],
    /// Rows of the affine view-from-world matrix for points relative to `o + o_lo`: `Peye`, and camera depth = -z.
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

/// View-space rays: affine in the normalised device coordinates.
struct ViewRays {
    origin: PixelAffine,
    direction: PixelAffine,
}

/// `constant + x * per_x + y * per_y`.
#[derive(Clone, Copy)]
struct PixelAffine {
    constant: DVec3,
    per_x: DVec3,
    per_y: DVec3,
}

impl PixelAffine {
    fn map(self, f: impl Fn(DVec3) -> DVec3) -> Self {
        Self { constant: f(self.constant), per_x: f(self.per_x), per_y: f(self.per_y) }
    }

    /// The same function of `q`, where `x = at.x + scale.x * q.x` and likewise y.
    fn substitute(self, at: DVec2, scale: DVec2) -> Self {
        Self {
            constant: self.constant + self.per_x * at.x + self.per_y * at.y,
            per_x: self.per_x * scale.x,
            per_y: self.per_y * scale.y,
        }
    }
}

impl Camera {
    /// Rays and depth rows relative to the world point `origin`.
    ///
    /// # Errors
    /// See [`CameraError`].
    pub fn rays(&self, origin: DVec3) -> Result<CameraRays, CameraError> {
        let world = self.world_affine(origin)?;
        let (at, scale) = self.ndc_of_pixel()?;
        let view = view_rays(&self.projection)?;
        let vector = |v: DVec3| world.matrix3 * v;
        let mut o = view.origin.map(vector).substitute(at, scale);
        o.constant += world.translation;
        let d = view.direction.map(vector).substitute(at, scale);
        let high = o.constant.as_vec3();
        let (radius, focus) = self.lens()?;
        // As seen from where rays begin: offsets of a camera far from the origin would not be exact in single
        // precision.
        let start = o.constant - world.translation;
        let from_start = DAffine3 { matrix3: world.matrix3, translation: -start };
        let view_from_world = from_start.inverse();
        let rays = CameraRays {
            o: high.to_array(),
            o_lo: (o.constant - high.as_dvec3()).as_vec3().to_array(),
            o_x: o.per_x.as_vec3().to_array(),
            o_y: o.per_y.as_vec3().to_array(),
            d: d.constant.as_vec3().to_array(),
            d_x: d.per_x.as_vec3().to_array(),
            d_y: d.per_y.as_vec3().to_array(),
            lens_u: (world.matrix3.x_axis * radius).as_vec3().to_array(),
            lens_v: (world.matrix3.y_axis * radius).as_vec3().to_array(),
            focus,
            clip_z: self.projection.row(2).as_vec4().to_array(),
            clip_w: self.projection.row(3).as_vec4().to_array(),
            pixel_x: ((self.projection.row(0) - at.x * self.projection.row(3)) / scale.x).as_vec4().to_array(),
            pixel_y: ((self.projection.row(1) - at.y * self.projection.row(3)) / scale.y).as_vec4().to_array(),
            view_from_world: affine_rows(&view_from_world),
            view_normal: matrix_rows(&world.matrix3.transpose()),
        };
        if rays.is_finite() { Ok(rays) } else { Err(CameraError::NotFinite("frustum in single precision")) }
    }

    fn world_affine(&self, origin: DVec3) -> Result<DAffine3, CameraError> {
        let m = self.world_from_view;
        if !m.is_finite() || !origin.is_finite() {
            return Err(CameraError::NotFinite("transform"));
        }
        if m.row(3) != DVec4::W || !is_invertible(&DMat3::from_mat4(m)) {
            return Err(CameraError::Singular("transform"));
        }
        let mut world = DAffine3::from_mat4(m);
        world.translation -= origin;
        Ok(world)
    }

    /// NDC of the lower left corner of the data window, and NDC per pixel.
    fn ndc_of_pixel(&self) -> Result<(DVec2, DVec2), CameraError> {
        let [x0, y0, x1, y1] = self.display_window.map(f64::from);
        let [left, _, _, bottom] = self.data_window.map(f64::from);
        let size = DVec2::new(x1 - x0, y1 - y0);
        if !size.is_finite() || !x0.is_finite() || !y0.is_finite() {
            return Err(CameraError::NotFinite("display window"));
        }
        if size.x <= 0.0 || size.y <= 0.0 {
            return Err(CameraError::Singular("display window"));
        }
        // Windows are y down and NDC is y up: pixel row 0 begins at the lower edge of the data window.
        let at = DVec2::new(2.0 * (left - x0) / size.x - 1.0, 1.0 - 2.0 * (bottom - y0) / size.y);
        Ok((at, 2.0 / size))
    }

    /// [`Self::exposure_scale`] as it counts.
    #[must_use]
    pub fn exposure(&self) -> f32 {
        if self.exposure_scale.is_finite() && self.exposure_scale >= 0.0 { self.exposure_scale } else { 1.0 }
    }

    fn lens(&self) -> Result<(f64, f32), CameraError> {
        if !self.lens_radius.is_finite() || !self.focus_distance.is_finite() {
            return Err(CameraError::NotFinite("lens"));
        }
        if self.lens_radius <= 0.0 {
            return Ok((0.0, 1.0));
        }
        if self.focus_distance <= 0.0 {
            return Err(CameraError::Singular("focus distance"));
        }
        Ok((self.lens_radius, narrow(self.focus_distance)))
    }
}

impl CameraRays {
    fn is_finite(&self) -> bool {
        let origin = [self.o, self.o_lo, self.o_x, self.o_y];
        let vectors = [self.d, self.d_x, self.d_y, self.lens_u, self.lens_v];
        let rows = [self.clip_z, self.clip_w, self.pixel_x, self.pixel_y];
        origin.iter().chain(&vectors).chain(&self.view_normal).flatten().all(|v| v.is_finite())
            && rows.iter().chain(&self.view_from_world).flatten().all(|v| v.is_finite())
            && self.focus.is_finite()
    }
}

#[expect(clippy::cast_possible_truncation, reason = "rounding to single precision is what is wanted")]
fn narrow(value: f64) -> f32 {
    value as f32
}

/// False when the columns are (nearly) dependent.
fn is_invertible(m: &DMat3) -> bool {
    let volume = m.x_axis.length() * m.y_axis.length() * m.z_axis.length();
    m.determinant().abs() > 1e-12 * volume
}

/// Solves `projection * (X, Y, Z, 1) ~ (x, y, ., 1)` for the points at view depth 1, as a function of (x, y).
fn view_rays(projection: &DMat4) -> Result<ViewRays, CameraError> {
    if !projection.is_finite() {
        return Err(CameraError::NotFinite("projection"));
    }
    let [r0, r1, r3] = [projection.row(0), projection.row(1), projection.row(3)];
    let scale = DMat2::from_cols(DVec2::new(r0.x, r1.x), DVec2::new(r0.y, r1.y));
    if scale.determinant() == 0.0 || !scale.inverse().is_finite() {
        return Err(CameraError::Singular("projection"));
    }
    let inverse = scale.inverse();
    let lift = |v: DVec2, z: f64| DVec3::new(v.x, v.y, z);
    let slope = |w: f64| (lift(inverse.x_axis * w, 0.0), lift(inverse.y_axis * w, 0.0));
    let by_depth = DVec2::new(r0.z, r1.z);
    let shift = DVec2::new(r0.w, r1.w);
    let zero = PixelAffine { constant: DVec3::ZERO, per_x: DVec3::ZERO, per_y: DVec3::ZERO };
    if r3.x == 0.0 && r3.y == 0.0 && r3.w == 0.0 && r3.z < 0.0 && shift == DVec2::ZERO {
        // Perspective: w = -r3.z at Z = -1, and scale * XY - by_depth = w * (x, y).
        let (per_x, per_y) = slope(-r3.z);
        let direction = PixelAffine { constant: lift(inverse * by_depth, -1.0), per_x, per_y };
        return Ok(ViewRays { origin: zero, direction });
    }
    if r3.x == 0.0 && r3.y == 0.0 && r3.z == 0.0 && r3.w > 0.0 {
        // Orthographic (sheared when by_depth is not zero): scale * XY + by_depth * Z + shift = w * (x, y).
        let (per_x, per_y) = slope(r3.w);
        let origin = PixelAffine { constant: lift(-(inverse * shift), 0.0), per_x, per_y };
        let direction = PixelAffine { constant: lift(inverse * by_depth, -1.0), ..zero };
        return Ok(ViewRays { origin, direction });
    }
    Err(CameraError::Unsupported)
}

fn affine_rows(m: &DAffine3) -> [[f32; 4]; 3] {
    let m = DMat4::from(*m);
    [0, 1, 2].map(|k| m.row(k).as_vec4().to_array())
}

fn matrix_rows(m: &DMat3) -> [[f32; 3]; 3] {
    [0, 1, 2].map(|k| m.row(k).as_vec3().to_array())
}
