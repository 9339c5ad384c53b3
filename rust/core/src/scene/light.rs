// SPDX-License-Identifier: Apache-2.0
//! Lights: the `UsdLux` inputs worked out to radiance. Pure.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::DVec3;

use super::desc::{LightDesc, LightKind};

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
        /// Radiance inside the cone; irradiance on a facing surface when `one_minus_cos` is 0.
        radiance: [f32; 3],
        /// `1 - cos` of half the opening angle; exactly 0 = a single direction. Kept apart from the cosine, which in f32
        /// is 0.3 % coarse in the solid angle of a sun of half a degree.
        one_minus_cos: f32,
    },
}

impl Light {
    /// Works out one light. `None` when a value is not finite or the transform gives no direction; a light that shines
    /// nothing is a light of radiance 0.
    ///
    /// `UsdLux`: `L = intensity * 2^exposure * color * blackbody(temperature)`. A normalised distant light of half
    /// angle t is divided by `pi sin^2 t` (t <= 90 degrees) or `pi (2 - sin^2 t)`; at angle 0, or below
    /// `MIN_HALF_ANGLE`, it is a single direction of the same irradiance.
    #[must_use]
    pub fn from_desc(desc: &LightDesc) -> Option<Self> {
        let power = f64::from(desc.intensity) * f64::from(desc.exposure).exp2();
        let tint = desc.color_temperature.map_or(Some([1.0; 3]), blackbody)?;
        let emitted = |scale: f64| {
            let rgb = [0, 1, 2].map(|k| narrow((power * scale * f64::from(desc.color[k]) * tint[k]).max(0.0)));
            let valid = desc.color.iter().chain(&rgb).all(|v| v.is_finite()) && power.is_finite();
            valid.then_some(rgb)
        };
        match desc.kind {
            LightKind::Dome { .. } => Some(Self::Dome { radiance: emitted(1.0)?, camera_visible: desc.camera_visible }),
            LightKind::Distant { angle_degrees } => {
                let direction = desc.prim.transform.transform_vector3(DVec3::Z).try_normalize()?;
                if !angle_degrees.is_finite() {
                    return None;
                }
                let half_angle = f64::from(angle_degrees.clamp(0.0, 360.0)).to_radians() * 0.5;
                let half_sine = (0.5 * half_angle).sin();
                let is_cone = half_angle >= MIN_HALF_ANGLE;
                let one_minus_cos = if is_cone { narrow(2.0 * half_sine * half_sine) } else { 0.0 };
                let scale = match (!is_cone, desc.normalize) {
                    (true, false) if half_angle > 0.0 => distant_size(half_angle),
                    (true, _) | (false, false) => 1.0,
                    (false, true) => 1.0 / distant_size(half_angle),
                };
                let direction = direction.as_vec3().to_array();
                Some(Self::Distant { direction, radiance: emitted(scale)?, one_minus_cos })
            }
            LightKind::Rect { .. } | LightKind::Sphere { .. } | LightKind::Disk { .. } | LightKind::Cylinder { .. } => {
                None
            }
        }
    }

    /// True when the light adds nothing.
    #[must_use]
    pub fn is_black(&self) -> bool {
        let (Self::Dome { radiance, .. } | Self::Distant { radiance, .. }) = self;
        radiance.iter().all(|&c| c <= 0.0)
    }
}

/// Half angle in radians below which a cone cannot be told from a single direction: a fifth of an arc second.
const MIN_HALF_ANGLE: f64 = 1e-6;

/// `UsdLux`'s size of a distant light of half angle `t` (radians).
fn distant_size(t: f64) -> f64 {
    let sin_squared = t.sin() * t.sin();
    PI * if t <= FRAC_PI_2 { sin_squared } else { 2.0 - sin_squared }
}

/// Colour of a black body, linear Rec. 709 of luminance 1, as `UsdLux` wants it: temperatures clamp to 1000..10000 K,
/// the colour is scaled to luminance 1, then negative components (out of gamut below about 1900 K) become 0.
///
/// Chromaticity after Krystek, "An algorithm to calculate correlated colour temperature", 1985, eqs. (uv) for 1000 K to
/// 15000 K, error below 1e-4 in u and v. `None` for NaN.
#[must_use]
pub fn blackbody(kelvin: f32) -> Option<[f64; 3]> {
    if kelvin.is_nan() {
        return None;
    }
    let t = f64::from(kelvin).clamp(1000.0, 10000.0);
    let t2 = t * t;
    let u = (0.860_117_757 + 1.541_182_54e-4 * t + 1.286_412_12e-7 * t2)
        / (1.0 + 8.424_202_35e-4 * t + 7.081_451_63e-7 * t2);
    let v = (0.317_398_726 + 4.228_062_45e-5 * t + 4.204_816_91e-8 * t2)
        / (1.0 - 2.897_418_16e-5 * t + 1.614_560_53e-7 * t2);
    // CIE 1960 uv to xy, then XYZ at Y = 1.
    let denominator = 2.0 * u - 8.0 * v + 4.0;
    let (x, y) = (3.0 * u / denominator, 2.0 * v / denominator);
    let (big_x, big_z) = (x / y, (1.0 - x - y) / y);
    // XYZ to linear Rec. 709 (D65); the rows keep Y, so the luminance is 1 up to the rounding of the matrix.
    let rgb = [
        3.240_454_2 * big_x - 1.537_138_5 - 0.498_531_4 * big_z,
        -0.969_266_0 * big_x + 1.876_010_8 + 0.041_556_0 * big_z,
        0.055_643_4 * big_x - 0.204_025_9 + 1.057_225_2 * big_z,
    ];
    let luminance = 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2];
    Some(rgb.map(|c| (c / luminance).max(0.0)))
}

#[expect(clippy::cast_possible_truncation, reason = "rounding to single precision is what is wanted")]
fn narrow(value: f64) -> f32 {
    value as f32
}
