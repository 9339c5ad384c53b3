// SPDX-License-Identifier: Apache-2.0
//! Coverage of a cutout around a position, without its texture: `traversal/opacity_mask.glsl` and
//! `texture/near_width.glsl`, operation by operation. The layout is that of `oocpt_core::texture::OpacityMask`. Pure,
//! any thread.

use crate::primvar::TriangleCorners;
use crate::texture::near_image;
use crate::vector::{V3, cross3, dot3};
use oocpt_abi::{GpuCutout, MASK_SET, MAX_ANISOTROPY, WRAP_BLACK, WRAP_MIRROR, WRAP_REPEAT};
use oocpt_gpu::{HostBytes, HostView};

/// A candidate of a hit, and the ray.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MaskCandidate<'a> {
    pub(crate) corners: &'a TriangleCorners,
    pub(crate) uv: [f32; 2],
    /// Edges of the triangle.
    pub(crate) edges: [V3; 2],
    pub(crate) direction: V3,
    /// Width of the ray's cone over the length of the direction.
    pub(crate) cone: f32,
}

/// Coordinate in the image, as `inside_image` of the shaders; `None` around a picture that is not continued.
fn inside_image(s: f32, wrap: u32, narrow: &mut bool) -> Option<f32> {
    let s = near_image(s, wrap);
    if (0.0..=1.0).contains(&s) {
        return Some(s);
    }
    match wrap {
        WRAP_REPEAT => Some(s - s.floor()),
        WRAP_MIRROR => Some(if s < 0.0 { -s } else { 2.0 - s }),
        WRAP_BLACK => None,
        _ => {
            *narrow = true;
            Some(s.clamp(0.0, 1.0))
        }
    }
}

/// Coverage at `st` in parts of 255, for a lookup as wide as `width` texels, as `coverage_in_mask` of the shaders;
/// `None` if the finest level of the texture decides.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_precision_loss,
    reason = "in the image"
)]
fn coverage_in_mask(mask: HostBytes<'_>, [size, modes]: [u32; 2], st: [f32; 2], width: f32) -> Option<u8> {
    let level = (modes >> 8) & 31;
    let mut narrow = width < f32::from_bits((127 + level.max(1)) << 23);
    let st = [inside_image(st[0], modes & 3, &mut narrow), inside_image(st[1], (modes >> 2) & 3, &mut narrow)];
    let [Some(s), Some(t)] = st else {
        return (!narrow).then_some((modes >> 24) as u8);
    };
    let side = |size: u32| (size >> level).max(1) << ((modes >> 4) & 7);
    let [width, height] = [side(size & 0xffff), side(size >> 16)];
    let [x, y] = [(s * width as f32) as u32, (t * height as f32) as u32];
    let byte = 8_u32.wrapping_add(y.min(height - 1).wrapping_mul(width)).wrapping_add(x.min(width - 1));
    let coverage = mask.get::<u8>(byte as usize)?;
    (!narrow || matches!(coverage, 0 | 255)).then_some(coverage)
}

/// Coverage at a position, as `coverage_at` of the shaders.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_precision_loss,
    reason = "parts from 0 to 9, and sides of an image"
)]
pub(crate) fn coverage_at(view: &HostView, cutout: &GpuCutout, at: &MaskCandidate<'_>) -> Option<u8> {
    let [s, t, ..] = at.corners.mixed(at.uv);
    let rows = [cutout.row_s, cutout.row_t];
    let mut place = rows.map(|row| row[0] * s + row[1] * t + row[2]);
    let (mut mask, mut head) = (cutout.mask, [cutout.size, cutout.modes]);
    if head[1] & MASK_SET != 0 {
        let part = place.map(f32::floor);
        if !part.iter().all(|at| (0.0..10.0).contains(at)) {
            return None;
        }
        let away: i32 = view.bytes(mask).get(2 + part[0] as usize + 10 * part[1] as usize)?;
        if away == 0 {
            return None;
        }
        place = [place[0] - part[0], place[1] - part[1]];
        mask = mask.wrapping_add_signed(16 * i64::from(away));
        head = view.bytes(mask).get(0)?;
    }
    let size = [(head[0] & 0xffff) as f32, (head[0] >> 16) as f32];
    let grown = at.corners.growth().map(|along| [0, 1].map(|i| size[i] * dot2(rows[i], along)));
    coverage_in_mask(view.bytes(mask), head, place, near_lookup_width(at, grown))
}

fn dot2(a: [f32; 3], b: [f32; 2]) -> f32 {
    a[0] * b[0] + a[1] * b[1]
}

/// Width of a lookup in texels, as `near_lookup_width` of the shaders; 0 if it cannot be computed.
fn near_lookup_width(at: &MaskCandidate<'_>, [at_e, at_f]: [[f32; 2]; 2]) -> f32 {
    let ([e, f], d) = (at.edges, at.direction);
    let (p, q) = (cross3(e, d), cross3(f, d));
    let dd = dot3(d, d);
    let across = dot3(e, q);
    let area = at_e[0] * at_f[1] - at_e[1] * at_f[0];
    let gradient = |i: usize| at_e[i] * q + (-(at_f[i])) * p;
    let (u, v) = (gradient(0), gradient(1));
    let (a, b, c) = (dot3(u, u), dot3(u, v), dot3(v, v));
    let half_difference = 0.5 * (a - c);
    let longer = (0.5 * (a + c) + (half_difference * half_difference + b * b).sqrt()).sqrt();
    let shorter = area.abs() * dd.sqrt() / longer;
    let least = longer / (MAX_ANISOTROPY * across.abs());
    let width = at.cone * dd.sqrt() * if shorter > least { shorter } else { least };
    let has_range = across * across > 1.0e-30 && a + c > 1.0e-16 && a + c < 1.0e17;
    if has_range && width < 1.0e9 { width } else { 0.0 }
}
