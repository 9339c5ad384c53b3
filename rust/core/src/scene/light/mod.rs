// SPDX-License-Identifier: Apache-2.0
//! Lights: turns the `UsdLux` inputs into the emitters that the renderer samples. Pure.
//!
//! Follow a light: [`Light::from_desc`] (radiance, emitter), its [`LocalLight`] (`local`), the placements of lights
//! inside prototypes (`instanced`), the collections of light linking (`links`), measured profiles (`ies`).

mod blackbody;
mod ies;
mod instanced;
mod links;
mod local;
mod motion;
mod shape;

use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3};

use crate::desc::{AssetRef, DomeFormat, LightDesc, LightKind, ShadowReach};

pub use blackbody::blackbody;
pub use ies::{IesError, IesProfile};
pub(crate) use instanced::{MAX_INSTANCED_LIGHTS, placements};
pub use links::LinkTable;
pub use local::{LightShaping, LocalLight};
pub use motion::LightMotion;
pub use shape::LocalShape;

/// A light that shines.
#[derive(Clone, Debug, PartialEq)]
pub struct Light {
    /// Path of its prim, for messages.
    pub path: Arc<str>,
    /// Kind and geometry of the emission.
    pub emitter: LightEmitter,
    /// Radiance, linear Rec. 709. For a distant light without extent: irradiance on a facing surface; for a point:
    /// radiant intensity; for a line: radiant intensity per unit of length, seen from the side.
    pub radiance: [f32; 3],
    /// True if camera rays see it directly.
    pub camera_visible: bool,
    /// Multiplier of its diffuse reflection.
    pub diffuse: f32,
    /// Multiplier of its specular reflection.
    pub specular: f32,
    /// True if prims shadow it.
    pub has_shadows: bool,
    /// Share of its light, by colour, that reaches points in shadow.
    pub shadow_color: [f32; 3],
    /// Length that its shadows reach; `None`: without end. Its numbers are usable: no stretch is longer than the
    /// distance, and the exponent is above 0.
    pub shadow_reach: Option<ShadowReach>,
    /// Number in [`LinkTable`] of the category of prims that it lights; 0: all.
    pub light_link: u32,
    /// Number of the category of prims that shadow it; 0: all.
    pub shadow_link: u32,
    /// Label in light path expressions.
    pub label: Option<Arc<str>>,
    /// Motion while the shutter is open.
    pub motion: Option<Arc<LightMotion>>,
}

/// Kinds of light source.
#[derive(Clone, Debug, PartialEq)]
pub enum LightEmitter {
    /// Light from all directions, multiplied by a texture.
    Dome {
        /// Texture; `None`: constant radiance.
        texture: Option<DomeTexture>,
    },
    /// Light from a cone of directions.
    Distant {
        /// Unit, world space, from the scene towards the light.
        direction: [f32; 3],
        /// `1 - cos` of half the opening angle; exactly 0 = a single direction. It is stored instead of the cosine,
        /// which in f32 has an error of 0.3 % in the solid angle of a sun of half a degree.
        one_minus_cos: f32,
    },
    /// Light from a position in the world.
    Local(Arc<LocalLight>),
}

/// The texture of a dome. It is mapped by longitude and latitude as in the `OpenEXR` format: a direction d of the
/// dome's frame is at `u = 1/2 - atan2(d.x, d.z) / 2 pi` from the left and `v = acos(d.y) / pi` from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct DomeTexture {
    /// File of the texture.
    pub asset: AssetRef,
    /// Rows of the rotation (or reflection) from the world to the dome.
    pub dome_from_world: [[f32; 3]; 3],
    /// Layout of the file.
    pub format: DomeFormat,
}

impl Light {
    /// Computes one light. `None` if a value is not finite or the transform gives no direction; a light without
    /// emission is a light of radiance 0.
    ///
    /// `UsdLux`: `L = intensity * 2^exposure * color * blackbody(temperature)`. A normalised light is divided by its
    /// area in the world; a distant one of half angle t by `pi sin^2 t` (t <= 90 degrees) or `pi (2 - sin^2 t)`: at
    /// angle 0, or below `MIN_HALF_ANGLE`, it is a single direction of the same irradiance.
    #[must_use]
    pub fn from_desc(desc: &LightDesc) -> Option<Self> {
        let transform = DAffine3::from_mat4(desc.prim.transform);
        Self::placed(desc, &transform)
    }

    /// As [`Light::from_desc`], with another transform.
    pub(crate) fn placed(desc: &LightDesc, transform: &DAffine3) -> Option<Self> {
        if !transform.is_finite() {
            return None;
        }
        let (emitter, scale) = match &desc.kind {
            LightKind::Dome { texture, format } => (dome(texture.as_ref(), *format, transform)?, 1.0),
            LightKind::Distant { angle_degrees } => distant(*angle_degrees, desc.normalize, transform)?,
            _ => {
                let (local, scale) = LocalLight::new(desc, transform)?;
                (LightEmitter::Local(Arc::new(local)), scale)
            }
        };
        let multiplier = |value: f32| value.is_finite().then_some(value.max(0.0));
        Some(Self {
            path: desc.prim.path.clone(),
            emitter,
            radiance: radiance(desc, scale)?,
            camera_visible: desc.camera_visible,
            diffuse: multiplier(desc.diffuse)?,
            specular: multiplier(desc.specular)?,
            has_shadows: desc.shadow_enable,
            shadow_color: if desc.shadow_color.iter().all(|c| c.is_finite()) {
                desc.shadow_color.map(|c| c.clamp(0.0, 1.0))
            } else {
                return None;
            },
            shadow_reach: desc.shadow_reach.filter(|_| desc.shadow_enable).map(shadow_reach),
            light_link: 0,
            shadow_link: 0,
            label: desc.label.clone().filter(|label| !label.is_empty()),
            motion: None,
        })
    }

    /// Returns true if the light adds nothing.
    #[must_use]
    pub fn is_black(&self) -> bool {
        let is_dark = self.radiance.iter().all(|&c| c <= 0.0);
        is_dark || (self.diffuse <= 0.0 && self.specular <= 0.0)
    }
}

/// Least exponent of the remaining part of the stretch over which shadows fade out: smaller ones vanish in single
/// precision.
const MIN_GAMMA: f32 = 1e-3;

/// The usable part of a reach of shadows. Values that are not numbers limit nothing.
fn shadow_reach(desc: ShadowReach) -> ShadowReach {
    let usable = |value: f32, otherwise: f32| if value.is_nan() { otherwise } else { value };
    let distance = usable(desc.distance, f32::MAX).clamp(0.0, f32::MAX);
    ShadowReach {
        distance,
        falloff: usable(desc.falloff, 0.0).clamp(0.0, distance),
        gamma: usable(desc.gamma, 1.0).clamp(MIN_GAMMA, 1.0 / MIN_GAMMA),
    }
}

/// Emitted radiance times `scale`. `None` if a value is not finite. A scale that is not finite belongs to a light
/// without extent, which emits no light.
pub(super) fn radiance(desc: &LightDesc, scale: f64) -> Option<[f32; 3]> {
    let power = f64::from(desc.intensity) * f64::from(desc.exposure).exp2();
    let tint = desc.color_temperature.map_or(Some([1.0; 3]), blackbody)?;
    let rgb = [0, 1, 2].map(|k| {
        let emitted = power * f64::from(desc.color[k]) * tint[k];
        if scale.is_finite() { narrow((emitted * scale).max(0.0)) } else { 0.0 }
    });
    let valid = desc.color.iter().chain(&rgb).all(|v| v.is_finite()) && power.is_finite();
    valid.then_some(rgb)
}

fn dome(texture: Option<&AssetRef>, format: DomeFormat, transform: &DAffine3) -> Option<LightEmitter> {
    let Some(asset) = texture.filter(|asset| !asset.authored.is_empty() || !asset.resolved.is_empty()) else {
        return Some(LightEmitter::Dome { texture: None });
    };
    let frame = orthonormal(&transform.matrix3)?;
    let rows = frame.transpose();
    let row = |axis: DVec3| axis.as_vec3().to_array();
    // The transpose is the inverse; its rows are the frame's columns.
    let dome_from_world = [row(frame.x_axis), row(frame.y_axis), row(frame.z_axis)];
    debug_assert!(rows.is_finite(), "orthonormal gives finite axes");
    let texture = DomeTexture { asset: asset.clone(), dome_from_world, format };
    Some(LightEmitter::Dome { texture: Some(texture) })
}

fn distant(angle_degrees: f32, normalize: bool, transform: &DAffine3) -> Option<(LightEmitter, f64)> {
    let direction = transform.transform_vector3(DVec3::Z).try_normalize()?;
    if !angle_degrees.is_finite() {
        return None;
    }
    let half_angle = f64::from(angle_degrees.clamp(0.0, 360.0)).to_radians() * 0.5;
    let half_sine = (0.5 * half_angle).sin();
    let is_cone = half_angle >= MIN_HALF_ANGLE;
    let one_minus_cos = if is_cone { narrow(2.0 * half_sine * half_sine) } else { 0.0 };
    let scale = match (!is_cone, normalize) {
        (true, false) if half_angle > 0.0 => distant_size(half_angle),
        (true, _) | (false, false) => 1.0,
        (false, true) => 1.0 / distant_size(half_angle),
    };
    Some((LightEmitter::Distant { direction: direction.as_vec3().to_array(), one_minus_cos }, scale))
}

/// Half angle in radians below which a cone cannot be distinguished from a single direction: a fifth of an arc second.
const MIN_HALF_ANGLE: f64 = 1e-6;

/// `UsdLux`'s size of a distant light of half angle `t` (radians).
fn distant_size(t: f64) -> f64 {
    let sin_squared = t.sin() * t.sin();
    PI * if t <= FRAC_PI_2 { sin_squared } else { 2.0 - sin_squared }
}

/// The frame next to `m` whose axes are unit and perpendicular: z as the planes z = const face, x next to the x axis,
/// and the handedness of `m`. A z axis that lies in the plane of the others, or is missing, is replaced by their
/// normal. `None` if x and y do not span a plane.
fn orthonormal(m: &DMat3) -> Option<DMat3> {
    let normal = m.x_axis.normalize_or_zero().cross(m.y_axis.normalize_or_zero()).try_normalize()?;
    let mirrored = normal.dot(m.z_axis) < 0.0;
    let z = if mirrored { -normal } else { normal };
    let x = m.x_axis.try_normalize()?;
    let y = if mirrored { x.cross(z) } else { z.cross(x) };
    let frame = DMat3::from_cols(x, y, z);
    frame.is_finite().then_some(frame)
}

#[expect(clippy::cast_possible_truncation, reason = "rounding to single precision is what is wanted")]
pub(crate) fn narrow(value: f64) -> f32 {
    value as f32
}
