// SPDX-License-Identifier: Apache-2.0
//! Lookups of textures for cutouts: texture/texture.glsl of one channel, operation by operation. No Ptex, and no float
//! pictures whose channel goes through the sRGB curve, which is the device's own function: scenes with such cutouts are
//! left to the shaders ([`crate::unsupported`]). Any thread.

use crate::scene::TraversalScene;
use half::f16;
use oocpt_abi::{
    Features, GpuTexture, PAGE_BROKEN, TAIL_SIDE, TEXTURE_BORDER, TEXTURE_CHANNELS, TEXTURE_F16, TEXTURE_FORMAT_SHIFT,
    TEXTURE_SRGB, TEXTURE_U8, TEXTURE_UDIM, TEXTURE_WRAP_S_SHIFT, TEXTURE_WRAP_T_SHIFT, TILE_SIDE, TextureFeedback,
    WRAP_BLACK, WRAP_CLAMP, WRAP_MIRROR, WRAP_REPEAT,
};
use oocpt_gpu::HostBytes;
use std::mem::offset_of;

/// Value of a texel that is not known, as `UNKNOWN_TEXEL` of the shaders.
const UNKNOWN_TEXEL: f32 = 0.5;

macro_rules! feedback {
    ($member:ident) => {
        offset_of!(TextureFeedback, $member) / 4
    };
}

/// The parameters of a lookup.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TextureLookup {
    pub(crate) texture: u32,
    pub(crate) st: [f32; 2],
    /// Width of the filter, texels.
    pub(crate) width: f32,
    pub(crate) channel: u32,
}

/// Result of a lookup.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum LookupResult {
    Texel(f32),
    /// There is no image, or none that could be read; with `TEXTURE_BORDER` this value is a texel.
    Fallback(f32),
    /// Streaming: a tile is absent. It has the number of the eight texels that are done, and their mean.
    Waits {
        page: u32,
        taps: u32,
        mean: f32,
    },
}

/// A texture, or a part of a UDIM set, and the position in it.
enum UdimPart {
    Found(GpuTexture, [f32; 2]),
    /// The set has no part at the position.
    Missing(GpuTexture),
}

/// A level of a texture, as `TextureLevel` of the shaders.
struct MipLevel {
    size: [u32; 2],
    page: u32,
    /// Offset of its texels in the tile, bytes.
    offset: usize,
    in_tail: bool,
}

impl MipLevel {
    fn new(t: &GpuTexture, level: u32) -> Self {
        let texel_bytes = (t.flags & TEXTURE_CHANNELS) << format_of(t);
        let (mut page, mut offset) = (t.first_page, 0_u32);
        for finer in 0..level {
            let [x, y] = level_size(t, finer);
            if x.max(y) <= TAIL_SIDE {
                offset = offset.wrapping_add((x * y * texel_bytes).next_multiple_of(4));
            } else {
                page = page.wrapping_add(x.div_ceil(TILE_SIDE).wrapping_mul(y.div_ceil(TILE_SIDE)));
            }
        }
        let size = level_size(t, level);
        Self { size, page, offset: offset as usize, in_tail: size[0].max(size[1]) <= TAIL_SIDE }
    }
}

fn level_size(t: &GpuTexture, level: u32) -> [u32; 2] {
    [t.width, t.height].map(|side| side.checked_shr(level).unwrap_or(0).max(1))
}

fn format_of(t: &GpuTexture) -> u32 {
    (t.flags >> TEXTURE_FORMAT_SHIFT) & 3
}

fn wraps_of(t: &GpuTexture) -> [u32; 2] {
    [TEXTURE_WRAP_S_SHIFT, TEXTURE_WRAP_T_SHIFT].map(|shift| (t.flags >> shift) & 3)
}

/// Returns true if the fallback is the border around the picture.
fn has_border(t: &GpuTexture) -> bool {
    t.flags & TEXTURE_BORDER != 0
}

fn fallback_value(t: &GpuTexture, channel: u32) -> f32 {
    t.fallback[channel as usize & 3]
}

/// Value of a texture without texels.
fn fallback_of(t: &GpuTexture, channel: u32) -> LookupResult {
    let value = fallback_value(t, channel);
    if has_border(t) { LookupResult::Texel(value) } else { LookupResult::Fallback(value) }
}

/// Coordinate relative to the nearest image, as `near_image` of the shaders.
pub(crate) fn near_image(s: f32, wrap: u32) -> f32 {
    #[expect(clippy::neg_cmp_op_on_partial_ord, reason = "NaN is 0")]
    if !(s.abs() < 1.0e9) {
        return 0.0;
    }
    match wrap {
        _ if (-1.0..=2.0).contains(&s) => s,
        WRAP_REPEAT => s - s.floor(),
        WRAP_MIRROR => s - 2.0 * (0.5 * s).floor(),
        _ => s.clamp(-1.0, 2.0),
    }
}

/// Finer of two levels up to `coarsest`, and share of the next one, as `select_level` of the shaders.
pub(crate) fn select_level(coarsest: u32, width: f32) -> (u32, f32) {
    #[expect(clippy::neg_cmp_op_on_partial_ord, reason = "NaN is the finest level")]
    if !(width > 1.0) {
        return (0, 0.0);
    }
    let bits = width.to_bits();
    let level = (bits >> 23) - 127;
    if level >= coarsest {
        return (coarsest, 0.0);
    }
    (level, f32::from_bits((bits & 0x007f_ffff) | 0x3f80_0000) - 1.0)
}

/// Lower of the two texels around s, and share of the upper one, as `texel_place` of the shaders.
#[expect(clippy::cast_possible_truncation, clippy::cast_precision_loss, reason = "as the shader")]
fn texel_place(s: f32, size: u32) -> (i32, f32) {
    let bits = s.to_bits();
    let exponent = (bits >> 23) & 0xff;
    // s is its mantissa / 2^shift; values above 4 do not occur.
    let shift = 150_u32.saturating_sub(exponent).max(1);
    if shift > 60 {
        return (-1, 0.5);
    }
    let product = (u64::from((bits & 0x007f_ffff) | 0x0080_0000) * u64::from(size)).cast_signed();
    let place = (if s < 0.0 { -product } else { product }).wrapping_sub(1 << (shift - 1));
    let share = (place & ((1 << shift) - 1)) as f32 * f32::from_bits((127 - shift) << 23);
    ((place >> shift) as i32, share)
}

/// Index of a texel, as `wrap_texel` of the shaders; `None` for transparent black.
fn wrap_texel(x: i32, size: u32, wrap: u32) -> Option<u32> {
    let (x, size) = (i64::from(x), i64::from(size));
    let inside = match wrap {
        _ if (0..size).contains(&x) => x,
        WRAP_CLAMP => x.clamp(0, size - 1),
        WRAP_BLACK => return None,
        WRAP_MIRROR => {
            let m = x.rem_euclid(2 * size);
            m.min(2 * size - 1 - m)
        }
        _ => x.rem_euclid(size),
    };
    u32::try_from(inside).ok()
}

/// Value of a byte in [0, 1], as `byte_to_unit` of the shaders.
fn byte_to_unit(byte: u8) -> f32 {
    let v = f32::from(byte);
    v * (257.0 / 65536.0) + v * 5.983_839e-8
}

impl TraversalScene<'_> {
    /// Part of a texture at `st`, as `texture_part` of the shaders.
    fn texture_part(&self, texture: u32, st: [f32; 2]) -> Option<UdimPart> {
        let t: GpuTexture = self.textures.get(texture as usize)?;
        if t.flags & TEXTURE_UDIM == 0 {
            return Some(UdimPart::Found(t, st));
        }
        let part = st.map(f32::floor);
        if !part.iter().all(|at| (0.0..10.0).contains(at)) {
            return Some(UdimPart::Missing(t));
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 9")]
        let number = part[0] as u32 + 10 * part[1] as u32;
        let found = self.textures.get(t.first_page.wrapping_add(number) as usize)?;
        Some(UdimPart::Found(found, [st[0] - part[0], st[1] - part[1]]))
    }

    /// Looks a texture up: `continue_lookup` of the shaders from its beginning; in core `requested_lookup`, which
    /// continues without absent tiles.
    pub(crate) fn look_up(&self, path: u32, lookup: &TextureLookup) -> LookupResult {
        let TextureLookup { texture, st, width, channel } = *lookup;
        // If the tables have no such texture, the surface is opaque.
        let Some(part) = self.texture_part(texture, st) else { return LookupResult::Fallback(1.0) };
        let (t, st) = match part {
            UdimPart::Found(t, st) if t.levels > 0 => (t, st),
            UdimPart::Found(t, _) | UdimPart::Missing(t) => return fallback_of(&t, channel),
        };
        let is_streaming = self.has(Features::STREAMING);
        let wraps = wraps_of(&t);
        let st = [near_image(st[0], wraps[0]), near_image(st[1], wraps[1])];
        let (finer, coarse_share) = select_level(t.levels - 1, width);
        let mut mean = if is_streaming { 0.0 } else { UNKNOWN_TEXEL };
        let mut total = 0.0_f32;
        let mut page = u32::MAX;
        let mut tile = HostBytes::NONE;
        for (i, level_share) in [(0, 1.0 - coarse_share), (1, coarse_share)] {
            if level_share == 0.0 {
                continue;
            }
            let level = MipLevel::new(&t, finer + i);
            let (x, share_x) = texel_place(st[0], level.size[0]);
            let (y, share_y) = texel_place(st[1], level.size[1]);
            for k in 0..4 {
                let (right, upper) = (k & 1 != 0, k & 2 != 0);
                let weight = level_share
                    * ((if right { share_x } else { 1.0 - share_x }) * (if upper { share_y } else { 1.0 - share_y }));
                if weight == 0.0 {
                    continue;
                }
                let is_first = total == 0.0;
                total += weight;
                let x = wrap_texel(x.wrapping_add(i32::from(right)), level.size[0], wraps[0]);
                let y = wrap_texel(y.wrapping_add(i32::from(upper)), level.size[1], wraps[1]);
                let mut texel = if has_border(&t) { fallback_value(&t, channel) } else { 0.0 };
                if let (Some(x), Some(y)) = (x, y) {
                    let (column, row) = if level.in_tail { (0, 0) } else { (x / TILE_SIDE, y / TILE_SIDE) };
                    let in_level = row.wrapping_mul(level.size[0].div_ceil(TILE_SIDE)).wrapping_add(column);
                    let wanted = level.page.wrapping_add(in_level);
                    if wanted != page {
                        let address = self.texture_pages.get::<u64>(wanted as usize).unwrap_or(PAGE_BROKEN);
                        if address == 0 && is_streaming {
                            return LookupResult::Waits { page: wanted, taps: 4 * i + k, mean };
                        }
                        if address == 0 {
                            self.request_tile(path, wanted);
                            continue;
                        }
                        if address & PAGE_BROKEN != 0 {
                            return fallback_of(&t, channel);
                        }
                        (page, tile) = (wanted, self.view.bytes(address));
                    }
                    let stride = (level.size[0] - column * TILE_SIDE).min(TILE_SIDE);
                    let index = (y - row * TILE_SIDE) * stride + (x - column * TILE_SIDE);
                    texel = self.texel(&t, tile, level.offset, index as usize, channel);
                }
                mean = if is_first { texel } else { (texel - mean) * (weight / total) + mean };
            }
        }
        LookupResult::Texel(mean)
    }

    /// A channel of a texel, as in `decode_texel` of the shaders; 0 without memory.
    fn texel(&self, t: &GpuTexture, tile: HostBytes<'_>, offset: usize, index: usize, channel: u32) -> f32 {
        let channels = t.flags & TEXTURE_CHANNELS;
        // Index of the number in a texel: (r), (r, a) and (r, g, b, a) stand for four channels.
        let number = match (channels, channel) {
            (1, 3) => return 1.0,
            (1, _) => 0,
            (2, _) => u32::from(channel == 3),
            _ => channel,
        };
        let at = index * channels as usize + number as usize;
        match format_of(t) {
            TEXTURE_U8 => {
                let byte = tile.at_byte::<u8>(offset + at).unwrap_or(0);
                if t.flags & TEXTURE_SRGB != 0 && channel != 3 {
                    return self.view.bytes(t.decode).get(usize::from(byte)).unwrap_or(0.0);
                }
                byte_to_unit(byte)
            }
            TEXTURE_F16 => f16::from_bits(tile.at_byte(offset + 2 * at).unwrap_or(0)).to_f32(),
            _ => tile.at_byte(offset + 4 * at).unwrap_or(0.0),
        }
    }

    /// Notes that a path lacks a tile, as `request_tile` of the shaders.
    fn request_tile(&self, path: u32, page: u32) {
        if self.frame.texture_feedback == 0 {
            return;
        }
        let feedback = self.view.words(self.frame.texture_feedback);
        let address = |at: usize| u64::from(feedback.load(at)) | u64::from(feedback.load(at + 1)) << 32;
        if !self.is_of_aovs() {
            self.view.words(address(feedback!(incomplete_paths))).store(path as usize, 1);
        }
        feedback.store(feedback!(is_incomplete), 1);
        let bit = 1 << (page & 31);
        let requested = self.view.words(address(feedback!(requested)));
        if requested.or((page >> 5) as usize, bit).is_none_or(|before| before & bit != 0) {
            return;
        }
        let at = feedback.add(feedback!(request_count), 1).unwrap_or(u32::MAX);
        if at < feedback.load(feedback!(request_capacity)) {
            self.view.words(address(feedback!(wanted))).store(at as usize, page);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bilinear_positions_are_exact() {
        for (s, size, place, share) in [
            (0.0, 5, -1, 0.5),
            (0.5, 4, 1, 0.5),
            (1.0, 4, 3, 0.5),
            (-0.25, 4, -2, 0.5),
            (0.625, 4, 2, 0.0),
            (0.75, 65536, 49151, 0.5),
        ] {
            assert_eq!(texel_place(s, size), (place, share), "{s} of {size}");
        }
        // Any bits give an answer.
        for s in [f32::MAX, f32::INFINITY, f32::NAN, -f32::MAX, f32::MIN_POSITIVE, 1.0e-45] {
            let (_, share) = texel_place(s, u32::MAX);
            assert!((0.0..=1.0).contains(&share), "{s}: {share}");
        }
    }
}
