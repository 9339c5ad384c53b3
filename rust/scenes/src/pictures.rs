// SPDX-License-Identifier: Apache-2.0
//! Pictures for the textured scenes, made when they are read: no files, the same texels always. Every level is there,
//! as in a tiled file with mip maps.
//!
//! A picture is called `kind:side:seed`; kinds: `bark` (colour), `surface` (three numbers, raw), `leaf` (colour, alpha
//! in the shape of a leaf) and `sheet` (the same colour, opaque all over). Texels are value noise of several octaves,
//! about as dear as decoding them from a compressed file.

use oocpt_core::scene::AssetRef;
use oocpt_core::texture::{MAX_SIDE, TexelFormat};
use oocpt_render::textures::{ImageError, ImageInfo, ImageLibrary, SourceImage};
use std::sync::Arc;

/// The library of all such pictures.
#[derive(Debug)]
pub struct Pictures;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Bark,
    Surface,
    Leaf,
    Sheet,
}

#[derive(Debug)]
struct Picture {
    kind: Kind,
    side: u32,
    seed: u32,
}

impl ImageLibrary for Pictures {
    fn open(&self, asset: &AssetRef) -> Result<Arc<dyn SourceImage>, ImageError> {
        let picture = Picture::named(&asset.resolved).ok_or_else(|| ImageError("no such picture".into()))?;
        Ok(Arc::new(picture))
    }
}

impl Picture {
    fn named(name: &str) -> Option<Self> {
        let mut parts = name.split(':');
        let kind = match parts.next()? {
            "bark" => Kind::Bark,
            "surface" => Kind::Surface,
            "leaf" => Kind::Leaf,
            "sheet" => Kind::Sheet,
            _ => return None,
        };
        let side = parts.next()?.parse().ok().filter(|side| (1..=MAX_SIDE).contains(side))?;
        Some(Self { kind, side, seed: parts.next()?.parse().ok()? })
    }

    /// Noise at a place of the unit square, 0 to 1; `finest`: cells along a side of the finest octave that is not left
    /// out.
    fn noise(&self, s: f32, t: f32, finest: u32) -> f32 {
        let (mut sum, mut total, mut weight) = (0.0, 0.0, 1.0);
        for (octave, cells) in [8_u32, 32, 128, 512].into_iter().enumerate() {
            if octave > 0 && cells > finest {
                break;
            }
            sum += weight * lattice(s, t, cells, self.seed ^ cells);
            total += weight;
            weight *= 0.6;
        }
        sum / total
    }

    fn texel(&self, x: u32, y: u32, side: u32) -> [f32; 4] {
        let step = 1.0 / unsigned(side);
        let (s, t) = ((unsigned(x) + 0.5) * step, (unsigned(y) + 0.5) * step);
        let noise = self.noise(s, t, side / 2);
        let hue = unit(hash(self.seed));
        match self.kind {
            Kind::Bark => [0.25 + 0.5 * noise, 0.2 + 0.4 * noise * hue, 0.1 + 0.2 * noise, 1.0],
            Kind::Surface => [1.0, 0.3 + 0.6 * noise, if noise > 0.62 { 0.8 } else { 0.0 }, 1.0],
            Kind::Leaf => [0.1 + 0.3 * hue, 0.3 + 0.5 * noise, 0.1, leaf(s, t, step)],
            Kind::Sheet => [0.1 + 0.3 * hue, 0.3 + 0.5 * noise, 0.1, 1.0],
        }
    }

    /// The sides of all levels.
    fn sides(&self) -> impl Iterator<Item = u32> {
        let side = self.side;
        (0..=side.ilog2()).map(move |level| side >> level)
    }
}

impl SourceImage for Picture {
    fn info(&self) -> ImageInfo {
        ImageInfo {
            levels: self.sides().map(|side| [side; 2]).collect(),
            channels: if self.kind == Kind::Surface { 3 } else { 4 },
            format: TexelFormat::U8,
            tile_friendly: true,
            is_srgb: None,
            wrap: None,
        }
    }

    fn read(&self, level: u32, at: [u32; 2], size: [u32; 2], out: &mut [u8]) -> Result<(), ImageError> {
        let channels = if self.kind == Kind::Surface { 3 } else { 4 };
        let side = (self.side >> level.min(31)).max(1);
        for (y, row) in (at[1]..).zip(out.chunks_exact_mut(size[0] as usize * channels)) {
            for (x, texel) in (at[0]..).zip(row.chunks_exact_mut(channels)) {
                for (byte, value) in texel.iter_mut().zip(self.texel(x, y, side)) {
                    *byte = byte_of(value);
                }
            }
        }
        Ok(())
    }
}

/// How much of a texel of width `step` is leaf: pointed at both ends, a third as wide as long, with a serrated rim.
fn leaf(s: f32, t: f32, step: f32) -> f32 {
    // A parabola for the blade, and triangles for its teeth.
    let teeth = (t * 12.0).fract();
    let half_width = 1.3 * t * (1.0 - t) + 0.04 * (teeth - 0.5);
    let rim = half_width - (s - 0.5).abs();
    (0.5 + rim / step).clamp(0.0, 1.0)
}

/// A lattice of random numbers, linear between.
fn lattice(s: f32, t: f32, cells: u32, seed: u32) -> f32 {
    let (x, y) = (s * unsigned(cells), t * unsigned(cells));
    let (column, row) = (floor(x), floor(y));
    let (u, v) = (x - unsigned(column), y - unsigned(row));
    let value = |dx: u32, dy: u32| unit(hash((column + dx).wrapping_add((row + dy).wrapping_mul(0x9e37)) ^ hash(seed)));
    let below = value(0, 0) + u * (value(1, 0) - value(0, 0));
    let above = value(0, 1) + u * (value(1, 1) - value(0, 1));
    below + v * (above - below)
}

fn hash(i: u32) -> u32 {
    let x = (i ^ (i >> 16)).wrapping_mul(0x21f0_aaad);
    let x = (x ^ (x >> 15)).wrapping_mul(0x735a_2d97);
    x ^ (x >> 15)
}

/// The upper 24 bits as a number from 0 to 1.
fn unit(bits: u32) -> f32 {
    unsigned(bits >> 8) / unsigned(1 << 24)
}

#[expect(clippy::cast_precision_loss, reason = "numbers up to 2^24 are exact")]
fn unsigned(value: u32) -> f32 {
    value as f32
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "float casts saturate")]
fn floor(value: f32) -> u32 {
    value as u32
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "float casts saturate")]
fn byte_of(value: f32) -> u8 {
    (value * 255.0 + 0.5) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(name: &str, level: u32, at: [u32; 2], size: [u32; 2]) -> Vec<u8> {
        let picture = Picture::named(name).expect("a name of a picture");
        let mut out = vec![0; size[0] as usize * size[1] as usize * picture.info().channels as usize];
        picture.read(level, at, size, &mut out).expect("it cannot fail");
        out
    }

    #[test]
    fn a_partial_read_equals_the_crop_of_the_whole() {
        let whole = read("bark:64:5", 0, [0; 2], [64; 2]);
        let part = read("bark:64:5", 0, [10, 20], [3, 1]);
        assert_eq!(part, whole[(20 * 64 + 10) * 4..(20 * 64 + 13) * 4], "three texels");
        assert_ne!(whole, read("bark:64:6", 0, [0; 2], [64; 2]), "another seed, another picture");
    }

    #[test]
    fn a_leaf_has_opaque_and_clear_texels_and_a_sheet_is_opaque() {
        let alpha = |name| -> Vec<u8> { read(name, 0, [0; 2], [64; 2]).chunks(4).map(|texel| texel[3]).collect() };
        let leaf = alpha("leaf:64:1");
        let there = leaf.iter().filter(|a| **a > 127).count();
        assert!((1024..3072).contains(&there), "a good part of the card is leaf: {there} of 4096");
        assert_eq!(leaf[0], 0, "corners are not there");
        assert!(alpha("sheet:64:1").iter().all(|a| *a == 255), "all there");
    }

    #[test]
    fn malformed_picture_names_are_refused() {
        for name in ["", "bark", "bark:0:1", "bark:99999999:1", "bark:4:x", "rock:4:1"] {
            assert!(Picture::named(name).is_none(), "{name}");
        }
    }
}
