// SPDX-License-Identifier: Apache-2.0
//! Local lights as the device has them, and what the tree needs to know of them. Pure.

use super::tree::LightBounds;
use super::{luminance, narrow};
use crate::assets::motion_key;
use oocpt_abi::{
    GpuInfiniteLight, GpuLightKey, GpuLightKind, GpuLightShaping, GpuLocalLight, LIGHT_SHAPES, LightFlags, NO_INDEX,
    pack_color,
};
use oocpt_core::scene::{Light, LightMotion, LightShaping, LocalLight, LocalShape, MotionKey};
use std::f64::consts::{FRAC_PI_2, PI};

/// Kind and flags of a light.
pub(super) fn flags(light: &Light, kind: u32) -> u32 {
    let mut flags = LightFlags::empty();
    flags.set(LightFlags::CAMERA_VISIBLE, light.camera_visible);
    flags.set(LightFlags::NO_SHADOWS, !light.has_shadows);
    flags.set(LightFlags::SHADOW_COLOR, light.has_shadows && pack_color(light.shadow_color) != 0);
    flags.set(LightFlags::SHADOW_LINK, light.has_shadows && light.shadow_link != 0);
    flags.set(LightFlags::SHADOW_REACH, light.shadow_reach.is_some());
    kind | flags.bits()
}

/// How far the light's shadows reach: see `LightTablePointers::local_reaches`.
pub(super) fn reach(light: &Light) -> [f32; 4] {
    let Some(reach) = light.shadow_reach else { return [f32::MAX, 0.0, 1.0, 0.0] };
    [reach.distance, reach.falloff, 1.0 / reach.gamma, 0.0]
}

/// A light at infinity without its direction, picture and probability.
pub(super) fn infinite(light: &Light, kind: GpuLightKind) -> GpuInfiniteLight {
    GpuInfiniteLight {
        direction: [0.0, 0.0, 1.0],
        one_minus_cos: 0.0,
        radiance: light.radiance,
        probability: 0.0,
        cumulative: 0.0,
        diffuse: light.diffuse,
        specular: light.specular,
        flags: flags(light, kind as u32),
        map: NO_INDEX,
        light_link: light.light_link,
        shadow_link: light.shadow_link,
        shadow_color: if light.has_shadows { pack_color(light.shadow_color) } else { 0 },
    }
}

/// The shape's row of the device's table; none for what has no row, which a test says cannot be.
fn kind(shape: LocalShape) -> Option<u32> {
    LIGHT_SHAPES.iter().find(|row| row.name == shape.name()).map(|row| row.kind)
}

/// A light relative to `origin`, without its indices; `None` where single precision does not hold its shape.
pub(super) fn encode(light: &Light, local: &LocalLight, origin: [f64; 3]) -> Option<GpuLocalLight> {
    let m = local.world_from_unit.matrix3;
    let inverse = m.inverse().transpose();
    let axis = |v: [f64; 3]| v.map(narrow);
    let place = local.world_from_unit.translation.to_array();
    let place = [0, 1, 2].map(|k| place[k] - origin[k]);
    let high = place.map(narrow);
    let low = [0, 1, 2].map(|k| narrow(place[k] - f64::from(high[k])));
    let gpu = GpuLocalLight {
        position: high,
        flags: flags(light, kind(local.shape)?),
        position_lo: low,
        determinant: narrow(m.determinant()),
        x: axis(m.x_axis.to_array()),
        shaping: NO_INDEX,
        y: axis(m.y_axis.to_array()),
        map: NO_INDEX,
        z: axis(m.z_axis.to_array()),
        light_link: light.light_link,
        row_x: axis(inverse.x_axis.to_array()),
        shadow_link: light.shadow_link,
        row_y: axis(inverse.y_axis.to_array()),
        diffuse: light.diffuse,
        row_z: axis(inverse.z_axis.to_array()),
        specular: light.specular,
        radiance: light.radiance,
        shadow_color: if light.has_shadows { pack_color(light.shadow_color) } else { 0 },
    };
    let numbers = [gpu.position, gpu.x, gpu.y, gpu.z, gpu.row_x, gpu.row_y, gpu.row_z];
    let sound = numbers.as_flattened().iter().all(|v| v.is_finite()) && gpu.determinant.is_normal();
    sound.then_some(gpu)
}

/// What the irradiance at distance 1, seen where the light shines, is of its power in [`bounds`]: a body shows a
/// quarter of its surface on average (Cauchy), and shaping takes away from the power, not from what it lets through.
pub(super) fn concentration(local: &LocalLight) -> f64 {
    let flat = local.shape.is_flat();
    let shaped = local.shaping.as_ref().map_or(1.0, |shaping| solid_share(shaping, flat));
    if flat { 1.0 / shaped } else { 0.25 / shaped }
}

/// Where the light is and where it shines; `power` counts relative to other lights.
pub(super) fn bounds(light: &Light, local: &LocalLight, origin: [f64; 3], brightness: f64) -> LightBounds {
    let m = local.world_from_unit.matrix3;
    let columns = [m.x_axis, m.y_axis, m.z_axis].map(|v| v.to_array());
    let at = local.world_from_unit.translation.to_array();
    let half = [0, 1, 2].map(|k| {
        let [x, y, z] = columns.map(|column| column[k].abs());
        let half = local.shape.half_extent([x, y, z]);
        // Rounding of what is traced.
        half * (1.0 + 1e-6) + 1e-7 * half.max((at[k] - origin[k]).abs() * 1e-6)
    });
    let min = [0, 1, 2].map(|k| at[k] - origin[k] - half[k]);
    let max = [0, 1, 2].map(|k| at[k] - origin[k] + half[k]);
    let axis = local.axis().map(f64::from);
    let flat = local.shape.is_flat();
    let (mut spread, mut emission) = if flat { (0.0, FRAC_PI_2) } else { (PI, FRAC_PI_2) };
    if let Some(shaping) = &local.shaping {
        let cone = f64::from(shaping.cone_angle);
        if flat {
            emission = emission.min(cone);
        } else if cone < PI {
            // It shines the same in all of the cone.
            (spread, emission) = (cone, 0.0);
        }
    }
    let body = match local.shape {
        LocalShape::Point => 4.0,
        LocalShape::Line => PI * 2.0 * m.x_axis.length(),
        _ => local.area,
    };
    let multiplier = f64::from(light.diffuse.max(light.specular));
    let shaped = local.shaping.as_ref().map_or(1.0, |shaping| solid_share(shaping, flat));
    let power = luminance_of(light) * body * multiplier * shaped * brightness;
    let bounds = LightBounds { min, max, axis, spread, emission, back: 0.0, power: finite_power(power) };
    light.motion.as_ref().map_or(bounds, |motion| swept(bounds, motion, local.shape, origin))
}

/// Bounds over the whole shutter: the box of all places, the cone around all cones, the largest power.
fn swept(at_rest: LightBounds, motion: &LightMotion, shape: LocalShape, origin: [f64; 3]) -> LightBounds {
    let (min, max) = motion.swept(shape.half_box());
    let (min, max) = ([0, 1, 2].map(|k| min[k] - origin[k]), [0, 1, 2].map(|k| max[k] - origin[k]));
    let (axes, turn) = motion.axes();
    let cone = |axis: &[f64; 3]| LightBounds { axis: *axis, spread: at_rest.spread, power: 1.0, ..at_rest };
    let all = axes.iter().map(cone).fold(super::tree::NOTHING, |sum, cone| sum.union(&cone));
    let spread = if all.spread < PI { (all.spread + 0.5 * turn + 1e-6).min(PI) } else { PI };
    let brightest = motion.radiance.iter().copied().fold(1.0, f64::max);
    LightBounds { min, max, axis: all.axis, spread, power: finite_power(at_rest.power * brightest), ..at_rest }
}

/// Keys of a light that moves, relative to `origin`.
pub(super) fn keys(motion: &LightMotion, origin: [f64; 3]) -> impl Iterator<Item = GpuLightKey> {
    motion.keys.iter().zip(&motion.radiance).map(move |(key, radiance)| {
        let mut own = *key;
        own.translation.x -= origin[0];
        own.translation.y -= origin[1];
        own.translation.z -= origin[2];
        light_key(&own, *radiance)
    })
}

/// A key with its place in two floats.
pub(super) fn light_key(own: &MotionKey, radiance: f64) -> GpuLightKey {
    let key = motion_key(own);
    let place = own.translation.to_array();
    let low = [0, 1, 2].map(|k| narrow(place[k] - f64::from(key.translation[k])));
    GpuLightKey { key, translation_lo: low, radiance: narrow(radiance) }
}

pub(super) fn finite_power(power: f64) -> f64 {
    if power.is_finite() { power } else { f64::MAX / 1e9 }
}

/// Luminance, but not 0 for pure colours.
fn luminance_of(light: &Light) -> f64 {
    luminance(light.radiance).max(light.radiance.iter().map(|&c| 0.01 * f64::from(c)).sum())
}

/// Roughly the share of the light that shaping leaves.
fn solid_share(shaping: &LightShaping, flat: bool) -> f64 {
    let cone = f64::from(shaping.cone_angle);
    let cone = if flat { cone.min(FRAC_PI_2).sin().powi(2) } else { 0.5 * (1.0 - cone.cos()) };
    let tint = f64::from(shaping.focus_tint.iter().copied().fold(0.0, f32::max)).min(1.0);
    let focus = if shaping.focus > 0.0 { (1.0 / (1.0 + f64::from(shaping.focus))).max(tint) } else { 1.0 };
    (cone * focus).max(1e-6)
}

/// Shaping as the device has it, for a light of these axes. `ies`: word of the profile and its factor.
pub(super) fn shaping([x, y, z]: [[f64; 3]; 3], shaping: &LightShaping, ies: Option<(u32, f32)>) -> GpuLightShaping {
    let axis = |v: [f64; 3]| v.map(narrow);
    GpuLightShaping {
        axis: axis(z.map(|v| -v)),
        cone_angle: shaping.cone_angle,
        x: axis(x),
        smooth_start: shaping.smooth_start,
        y: axis(y),
        focus: shaping.focus,
        focus_tint: shaping.focus_tint,
        ies: ies.map_or(NO_INDEX, |(word, _)| word),
        angle_scale: shaping.ies_angle_scale,
        ies_scale: ies.map_or(1.0, |(_, scale)| scale),
        pad: [0; 2],
    }
}
