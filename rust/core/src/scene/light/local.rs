// SPDX-License-Identifier: Apache-2.0
//! Lights that are somewhere: shape, placement, shaping. Pure.

use glam::{DAffine3, DMat3, DVec3};

use super::shape::{LocalShape, shape_of};
use super::{narrow, orthonormal};
use crate::desc::{AssetRef, LightDesc, ShapingCone};

/// A light at a place.
#[derive(Clone, Debug, PartialEq)]
pub struct LocalLight {
    /// Shape of unit size.
    pub shape: LocalShape,
    /// World (not relative to the snapshot's origin) from the unit shape. Regular; of a plane shape, the z axis is the
    /// unit normal.
    pub world_from_unit: DAffine3,
    /// Unit perpendicular axes (columns) of the light: it points along -z.
    pub frame: DMat3,
    /// Area in the world; 0 for points and lines.
    pub area: f64,
    /// Where it shines; `None`: everywhere its shape does.
    pub shaping: Option<LightShaping>,
    /// Picture on a rectangle: u grows from +x to -x, v from +y to -y, (0, 0) the upper left of the file.
    pub texture: Option<AssetRef>,
}

/// Where a light shines about its -z axis. Checked: finite, in range.
#[derive(Clone, Debug, PartialEq)]
pub struct LightShaping {
    /// Half angle of the cone, radians, in [0, pi]; pi with a profile, which says itself where no light goes
    /// (`UsdLux`: the cone does not affect profiles).
    pub cone_angle: f32,
    /// Angle at which the light begins to fade out towards the cone's, radians.
    pub smooth_start: f32,
    /// Exponent of the cosine to the axis, forwards and backwards; 0: none.
    pub focus: f32,
    /// Colour of what the exponent takes away.
    pub focus_tint: [f32; 3],
    /// A measured profile.
    pub ies: Option<AssetRef>,
    /// `UsdLux` `ies:angleScale`.
    pub ies_angle_scale: f32,
    /// Divide the profile by its mean.
    pub ies_normalize: bool,
}

impl LightShaping {
    /// `None` when a value is not finite; `Some(None)` when nothing is left out of the shape's own light, which of a
    /// flat one is that to one side.
    fn new(desc: &ShapingCone, is_flat: bool) -> Option<Option<Self>> {
        let numbers = [desc.cone_angle_degrees, desc.cone_softness, desc.focus, desc.ies_angle_scale];
        if !numbers.iter().chain(&desc.focus_tint).all(|v| v.is_finite()) {
            return None;
        }
        let ies = desc.ies.clone().filter(|asset| !asset.authored.is_empty() || !asset.resolved.is_empty());
        let focus = desc.focus.max(0.0);
        let whole = if is_flat { 90.0 } else { 180.0 };
        let has_cone = ies.is_none() && (desc.cone_angle_degrees < whole || desc.cone_softness > 0.0);
        if !has_cone && focus <= 0.0 && ies.is_none() {
            return Some(None);
        }
        let (cone, softness) = if has_cone { (desc.cone_angle_degrees, desc.cone_softness) } else { (180.0, 0.0) };
        let cone_angle = cone.clamp(0.0, 180.0).to_radians();
        Some(Some(Self {
            cone_angle,
            smooth_start: cone_angle * (1.0 - softness.clamp(0.0, 1.0)),
            focus,
            focus_tint: desc.focus_tint.map(|c| c.max(0.0)),
            ies,
            ies_angle_scale: desc.ies_angle_scale,
            ies_normalize: desc.ies_normalize,
        }))
    }
}

impl LocalLight {
    /// The light and what its radiance is multiplied by; not finite when it has no extent that could shine.
    pub(super) fn new(desc: &LightDesc, transform: &DAffine3) -> Option<(Self, f64)> {
        let (shape, size, texture) = shape_of(&desc.kind)?;
        if !size.is_finite() {
            return None;
        }
        let size = size.max(DVec3::ZERO);
        let frame = orthonormal(&transform.matrix3)?;
        let mut linear = transform.matrix3;
        if shape.is_flat() {
            linear.z_axis = frame.z_axis;
        }
        let unit = DMat3::from_cols(linear.x_axis * size.x, linear.y_axis * size.y, linear.z_axis * size.z);
        let area = shape.area(&unit);
        let (shape, scale) = finished(shape, area, &unit, desc);
        // What has no extent keeps a regular matrix: it is only asked for its place.
        let unit = if scale.is_finite() && is_regular(&unit) { unit } else { thin(&unit, &frame) };
        let shaping = match &desc.shaping {
            Some(shaping) => LightShaping::new(shaping, shape.is_flat())?,
            None => None,
        };
        let area = if shape.is_thin() { 0.0 } else { area };
        let world_from_unit = DAffine3 { matrix3: unit, translation: transform.translation };
        Some((Self { shape, world_from_unit, frame, area, shaping, texture }, scale))
    }
}

/// The factor from the authored emission to the stored one. A convex body of area A shines, averaged over directions,
/// as a point of intensity `L A / 4` (Cauchy); a thin cylinder of area A as a line of intensity `L A / (pi length)` per
/// length.
fn finished(shape: LocalShape, area: f64, unit: &DMat3, desc: &LightDesc) -> (LocalShape, f64) {
    let body = match shape {
        LocalShape::Point => LocalShape::Sphere.area(unit),
        LocalShape::Line => LocalShape::Cylinder.area(unit),
        _ => area,
    };
    let length = 2.0 * unit.x_axis.length();
    let normalized = if desc.normalize { 1.0 } else { body };
    let scale = match shape {
        LocalShape::Point => 0.25 * normalized,
        LocalShape::Line => normalized / (std::f64::consts::PI * length),
        _ if area <= 0.0 => f64::INFINITY,
        _ => normalized / area,
    };
    (shape, scale)
}

fn is_regular(m: &DMat3) -> bool {
    let volume = m.x_axis.length() * m.y_axis.length() * m.z_axis.length();
    m.determinant().abs() > 1e-12 * volume && volume > 0.0 && volume.is_finite()
}

/// The frame's axes, the first as long as the first of `m`.
fn thin(m: &DMat3, frame: &DMat3) -> DMat3 {
    let x = if m.x_axis.length_squared() > 0.0 { m.x_axis } else { frame.x_axis };
    DMat3::from_cols(x, frame.y_axis, frame.z_axis)
}

impl LocalLight {
    /// The direction that the light points in, unit.
    #[must_use]
    pub fn axis(&self) -> [f32; 3] {
        (-self.frame.z_axis).to_array().map(narrow)
    }
}
