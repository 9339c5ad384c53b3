// SPDX-License-Identifier: Apache-2.0
//! What is known of a cutout without its texture: `traversal/opacity_mask.glsl`. The layout is that of
//! `oocpt_core::texture::OpacityMask`. Pure, any thread.

use crate::texture::{near_image, select_level};
use oocpt_gpu::HostBytes;
use oocpt_shader_abi::{WRAP_CLAMP, WRAP_REPEAT};

/// As in `oocpt_core::texture::Presence`.
const NEVER: u32 = 1;
const ALWAYS: u32 = 2;

/// A coordinate in the image; none where the mask does not say.
fn inside_image(s: f32, wrap: u32) -> Option<f32> {
    let s = near_image(s, wrap);
    if (0.0..=1.0).contains(&s) {
        return Some(s);
    }
    match wrap {
        WRAP_REPEAT => Some(s - s.floor()),
        WRAP_CLAMP => Some(s.clamp(0.0, 1.0)),
        _ => None,
    }
}

/// Whether a lookup at `st`, as wide as `width` texels, finds the surface there, if the mask knows.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_precision_loss,
    reason = "in the image"
)]
pub(crate) fn known_presence(mask: HostBytes<'_>, st: [f32; 2], width: f32) -> Option<bool> {
    let [size, head] = mask.get::<[u32; 2]>(0)?;
    let st = [inside_image(st[0], head & 3)?, inside_image(st[1], (head >> 2) & 3)?];
    let (pair, share) = select_level((head >> 16) & 0xff, width);
    let behind_first = pair.checked_sub((head >> 8) & 0xff)?;
    let [begin, cut] = mask.get::<[u32; 2]>(1 + behind_first as usize)?;
    let (columns, fine, bins) = (cut & 0xffff, (cut >> 16) & 0xff, (cut >> 24) & 7);
    let side = |size: u32| size.checked_shr(pair).unwrap_or(0).max(1).checked_shl(fine).unwrap_or(0);
    let sides = [side(size & 0xffff), side(size >> 16)];
    let first = if fine == 0 { 0.5 } else { 0.0 };
    let at = [0, 1].map(|i| (st[i] * sides[i] as f32 + first).floor() as u32);
    let row = ((share * (1 << bins) as f32) as u32).wrapping_mul(sides[1].wrapping_add(1)).wrapping_add(at[1]);
    let cell = begin.wrapping_add(row.wrapping_mul(columns)).wrapping_add(at[0]);
    match (mask.get::<u32>((cell >> 4) as usize)? >> ((cell & 15) * 2)) & 3 {
        NEVER => Some(false),
        ALWAYS => Some(true),
        _ => None,
    }
}
