// SPDX-License-Identifier: Apache-2.0
//! What a ray's cone covers of a texture: include/footprint.glsl and the gradients of
//! `include/surface_material.glsl`, operation by operation. Pure, any thread.

use crate::vector::{V3, cross3, dot3};
use oocpt_abi::{LONGEST_FOOTPRINT, MOST_ANISOTROPY, SLANT_MOST};

/// Of a step of a direction, worked out as the shaders' compiler does.
#[expect(clippy::cast_possible_truncation, reason = "rounded once")]
const STEP: f32 = (1.0 / 32767.0_f64) as f32;

/// As the shaders keep it; 0: none, which is the finest level.
pub(crate) type Footprint = [u32; 2];

/// Gradients of both coordinates over a surface, and a normal of it, of any length.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Gradients {
    u: V3,
    v: V3,
    n: V3,
}

impl Gradients {
    /// Over a triangle with edges e and f, along which the coordinates grow by d and g; none where it has no area.
    pub(crate) fn of_edges(d: [f32; 2], g: [f32; 2], e: V3, f: V3) -> Option<Self> {
        let scale = 1.0 / e.largest().max(f.largest());
        let (x, y) = (scale * e, scale * f);
        let n = cross3(x, y);
        let area = dot3(n, n);
        let along_x = (scale / area) * cross3(y, n);
        let along_y = (scale / area) * cross3(n, x);
        let gradient = |k: usize| d[k] * along_x + g[k] * along_y;
        (area > 0.0).then(|| Self { u: gradient(0), v: gradient(1), n })
    }

    /// `make_footprint`: of a cone of width 1 along `d`.
    pub(crate) fn footprint(&self, d: V3) -> Footprint {
        let Self { u, v, n } = *self;
        let across = dot3(n, d);
        let least = dot3(n, n).sqrt() * dot3(d, d).sqrt() / SLANT_MOST;
        let bounded = match across.abs() > least {
            true => across,
            false if across < 0.0 => -least,
            false => least,
        };
        let is_positive = |x: f32| x > 0.0;
        if !is_positive(bounded.abs()) {
            return [0; 2];
        }
        let p = u - (dot3(u, d) / bounded) * n;
        let q = v - (dot3(v, d) / bounded) * n;
        let size = V3([0, 1, 2].map(|i| p[i].abs().max(q[i].abs())));
        let largest = size.largest();
        if !is_positive(largest) {
            return [0; 2];
        }
        if largest > LONGEST_FOOTPRINT {
            return pack(LONGEST_FOOTPRINT, [1.0, 0.0], 1.0);
        }
        let (r, s) = (p.map(|x| x / largest), q.map(|x| x / largest));
        let (a, b, c) = (dot3(r, r), dot3(r, s), dot3(s, s));
        let most = larger_eigenvalue(a, b, c);
        if !is_positive(most) {
            return [0; 2];
        }
        let area = cross3(r, s);
        let direction = if a >= c { [most - c, b] } else { [b, most - a] };
        pack((largest * most.sqrt()).min(LONGEST_FOOTPRINT), direction, dot3(area, area).sqrt() / most)
    }
}

fn larger_eigenvalue(a: f32, b: f32, c: f32) -> f32 {
    let half_difference = 0.5 * (a - c);
    0.5 * (a + c) + (half_difference * half_difference + b * b).sqrt()
}

/// `pack_footprint`.
#[expect(clippy::cast_possible_truncation, clippy::manual_clamp, reason = "a step; NaN becomes 0, as there")]
fn pack(length: f32, [x, y]: [f32; 2], ratio: f32) -> Footprint {
    let sum = x.abs() + y.abs();
    let end = if y < 0.0 { -x } else { x };
    let end = if sum > 0.0 { end / sum } else { 1.0 };
    let steps = (end * 32767.0 + 0.5).floor() as i32;
    let share = ratio.max(0.0).min(1.0).to_bits().wrapping_add(0x2000) >> 14;
    [length.to_bits(), (steps.cast_unsigned() & 0xffff) | share << 16]
}

/// `footprint_width`: how wide a filter has to be, in texels of level 0, for a cone of width `cone`; `s` and `t` are
/// the linear part of the map from the coordinates to the texture's square, `size` its texels. Never NaN.
#[expect(clippy::cast_possible_truncation, clippy::cast_precision_loss, reason = "as the shader")]
pub(crate) fn width(footprint: Footprint, cone: f32, s: [f32; 2], t: [f32; 2], size: [u32; 2]) -> f32 {
    let length = f32::from_bits(footprint[0]);
    let x = f32::from(footprint[1] as u16 as i16) * STEP;
    let direction = [x, 1.0 - x.abs()];
    let dot = |a: [f32; 2], b: [f32; 2]| a[0] * b[0] + a[1] * b[1];
    let scale = 1.0 / dot(direction, direction).sqrt();
    let along = direction.map(|x| x * scale);
    let ratio = f32::from_bits((footprint[1] >> 16) << 14);
    let aside = [-along[1] * ratio, along[0] * ratio];
    let texels = size.map(|side| side as f32);
    let p = [dot(s, along) * texels[0], dot(t, along) * texels[1]];
    let q = [dot(s, aside) * texels[0], dot(t, aside) * texels[1]];
    let largest = p[0].abs().max(q[0].abs()).max(p[1].abs().max(q[1].abs()));
    if largest > 0.0 {
        let (r, l) = (p.map(|x| x / largest), q.map(|x| x / largest));
        let longer =
            larger_eigenvalue(r[0] * r[0] + l[0] * l[0], r[0] * r[1] + l[0] * l[1], r[1] * r[1] + l[1] * l[1]).sqrt();
        let shorter = (r[0] * l[1] - r[1] * l[0]).abs() / longer;
        let width = cone * length * (largest * shorter.max(longer / MOST_ANISOTROPY));
        return if width > 0.0 { width } else { 0.0 };
    }
    0.0
}
