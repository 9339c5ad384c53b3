// SPDX-License-Identifier: Apache-2.0
//! Images that the tests read: random texels, levels that tell which they are, one that breaks off.

use oocpt_core::scene::AssetRef;
use oocpt_core::texture::TexelFormat;
use oocpt_ptex::ReadAt;
use oocpt_render::textures::{ImageError, ImageInfo, ImageLibrary, SourceImage};
use std::sync::Arc;

pub(super) fn hash(i: u32) -> u32 {
    let x = (i ^ (i >> 16)).wrapping_mul(0x21f0_aaad);
    let x = (x ^ (x >> 15)).wrapping_mul(0x735a_2d97);
    x ^ (x >> 15)
}

/// Blocks of three by three texels of random bytes.
#[derive(Debug)]
pub(super) struct Noise {
    pub(super) size: [u32; 2],
    pub(super) channels: u32,
    pub(super) seed: u32,
}

impl SourceImage for Noise {
    fn info(&self) -> ImageInfo {
        let (levels, channels) = (vec![self.size], self.channels);
        ImageInfo { levels, channels, format: TexelFormat::U8, tile_friendly: true, is_srgb: None, wrap: None }
    }

    fn read(&self, _level: u32, at: [u32; 2], size: [u32; 2], out: &mut [u8]) -> Result<(), ImageError> {
        let channels = self.channels as usize;
        for (y, row) in (at[1]..).zip(out.chunks_exact_mut(size[0] as usize * channels)) {
            for (x, texel) in (at[0]..).zip(row.chunks_exact_mut(channels)) {
                texel.copy_from_slice(&self.texel(x, y)[..channels]);
            }
        }
        Ok(())
    }
}

impl Noise {
    pub(super) fn texel(&self, x: u32, y: u32) -> [u8; 4] {
        hash(x / 3 + 7919 * (y / 3) + 104_729 * self.seed).to_le_bytes()
    }
}

/// Level `l` of 512 texels and less is `20 l` all over.
#[derive(Debug)]
struct Steps;

impl SourceImage for Steps {
    fn info(&self) -> ImageInfo {
        let levels = (0..10).map(|level| [512 >> level; 2]).collect();
        ImageInfo { levels, channels: 1, format: TexelFormat::U8, tile_friendly: true, is_srgb: None, wrap: None }
    }

    fn read(&self, level: u32, _: [u32; 2], _: [u32; 2], out: &mut [u8]) -> Result<(), ImageError> {
        out.fill(20 * u8::try_from(level).expect("ten levels"));
        Ok(())
    }
}

/// Texels along a side of "checks".
pub(super) const CHECKS: u32 = 256;

/// Eight by eight fields of 0.1 and 0.8 (as bytes), by level as the mean of four texels makes them.
pub(super) fn check(level: u32, x: u32, y: u32) -> u8 {
    if level > 5 {
        return 115;
    }
    let field = |texel: u32| (texel >> (5 - level)) & 1;
    if field(x) == field(y) { 26 } else { 204 }
}

#[derive(Debug)]
struct Checks;

impl SourceImage for Checks {
    fn info(&self) -> ImageInfo {
        let levels = (0..=8).map(|level| [CHECKS >> level; 2]).collect();
        ImageInfo { levels, channels: 1, format: TexelFormat::U8, tile_friendly: true, is_srgb: None, wrap: None }
    }

    fn read(&self, level: u32, at: [u32; 2], size: [u32; 2], out: &mut [u8]) -> Result<(), ImageError> {
        for (y, row) in (at[1]..).zip(out.chunks_exact_mut(size[0] as usize)) {
            for (x, texel) in (at[0]..).zip(row) {
                *texel = check(level, x, y);
            }
        }
        Ok(())
    }
}

/// 256 texels a side; what lies above the middle of level 0 cannot be read, nor any level made of it.
#[derive(Debug)]
struct Torn;

impl SourceImage for Torn {
    fn info(&self) -> ImageInfo {
        Noise { size: [256, 256], channels: 3, seed: 1 }.info()
    }

    fn read(&self, level: u32, at: [u32; 2], size: [u32; 2], out: &mut [u8]) -> Result<(), ImageError> {
        if at[1] + size[1] > 128 {
            return Err(ImageError("it breaks off".into()));
        }
        Noise { size: [256, 256], channels: 3, seed: 1 }.read(level, at, size, out)
    }
}

/// White, with alpha in the shape of a disc of this radius with a soft rim; whoever reads it makes smaller levels.
#[derive(Debug)]
struct Disc([u32; 2], f64);

/// Radius of a "disc ", and of a "leaf ", which covers [`LEAF_AREA`].
const RADII: [(&str, f64); 2] = [("disc ", 0.42), ("leaf ", 0.3)];
/// Share of a "leaf " where alpha is one half or more.
pub(super) const LEAF_AREA: f64 = std::f64::consts::PI * 0.09;

impl SourceImage for Disc {
    fn info(&self) -> ImageInfo {
        Noise { size: self.0, channels: 4, seed: 0 }.info()
    }

    fn read(&self, _level: u32, at: [u32; 2], size: [u32; 2], out: &mut [u8]) -> Result<(), ImageError> {
        let side = self.0.map(f64::from);
        for (y, row) in (at[1]..).zip(out.chunks_exact_mut(size[0] as usize * 4)) {
            for (x, texel) in (at[0]..).zip(row.chunks_exact_mut(4)) {
                let off = ((f64::from(x) + 0.5) / side[0] - 0.5).hypot((f64::from(y) + 0.5) / side[1] - 0.5);
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 255")]
                let alpha = ((self.1 - off) * 20.0 + 0.5).clamp(0.0, 1.0).mul_add(255.0, 0.5) as u8;
                texel.copy_from_slice(&[255, 255, 255, alpha]);
            }
        }
        Ok(())
    }
}

/// Random floats from 0 to 1, of two bytes (any half in that range) or four.
#[derive(Debug)]
struct Floats {
    noise: Noise,
    format: TexelFormat,
}

impl SourceImage for Floats {
    fn info(&self) -> ImageInfo {
        ImageInfo { format: self.format, ..self.noise.info() }
    }

    fn read(&self, _level: u32, at: [u32; 2], size: [u32; 2], out: &mut [u8]) -> Result<(), ImageError> {
        let bytes = if self.format == TexelFormat::F16 { 2 } else { 4 };
        let channels = self.noise.channels as usize;
        for (y, row) in (at[1]..).zip(out.chunks_exact_mut(size[0] as usize * channels * bytes)) {
            for (x, texel) in (at[0]..).zip(row.chunks_exact_mut(channels * bytes)) {
                let seed = u32::from_le_bytes(self.noise.texel(x, y));
                for (k, value) in (0..).zip(texel.chunks_exact_mut(bytes)) {
                    let bits = hash(seed.wrapping_add(k));
                    #[expect(clippy::cast_precision_loss, reason = "24 bits")]
                    match bytes {
                        2 => value.copy_from_slice(&(bits % 0x3c01).to_le_bytes()[..2]),
                        _ => value.copy_from_slice(&((bits >> 8) as f32 / 16_777_216.0).to_le_bytes()),
                    }
                }
            }
        }
        Ok(())
    }
}

/// A file is called by width, height and channels, with an x between, "half " or "float " before if it has floats;
/// "steps", "checks", "torn", "disc " and "leaf " with width and height, and "part " and "leaves " with numbers of UDIM
/// sets are others.
#[derive(Debug)]
pub(super) struct Library;

impl ImageLibrary for Library {
    fn open(&self, asset: &AssetRef) -> Result<Arc<dyn SourceImage>, ImageError> {
        match &*asset.resolved {
            "steps" => return Ok(Arc::new(Steps)),
            "checks" => return Ok(Arc::new(Checks)),
            "torn" => return Ok(Arc::new(Torn)),
            _ => {}
        }
        for (prefix, radius) in RADII {
            if let Some((width, height)) = asset.resolved.strip_prefix(prefix).and_then(|size| size.split_once('x')) {
                let side = |text: &str| text.parse().map_err(|_not_a_number| ImageError("no such disc".into()));
                return Ok(Arc::new(Disc([side(width)?, side(height)?], radius)));
            }
        }
        match asset.resolved.strip_prefix("leaves ") {
            Some("1001") => return Ok(Arc::new(Disc([256, 256], 0.3))),
            Some("1012") => return Ok(Arc::new(Disc([90, 70], 0.3))),
            Some(_) => return Err(ImageError("no such part".into())),
            None => {}
        }
        match asset.resolved.strip_prefix("part ") {
            Some("1001") => return Ok(Arc::new(Disc([64, 64], 0.42))),
            Some("1002") => return Ok(Arc::new(Disc([300, 200], 0.42))),
            Some("1011") => return Ok(Arc::new(Noise { size: [90, 40], channels: 4, seed: 5 })),
            Some(_) => return Err(ImageError("no such part".into())),
            None => {}
        }
        for (prefix, format) in [("half ", TexelFormat::F16), ("float ", TexelFormat::F32)] {
            if let Some(size) = asset.resolved.strip_prefix(prefix) {
                return Ok(Arc::new(Floats { noise: noise(size)?, format }));
            }
        }
        Ok(Arc::new(noise(&asset.resolved)?))
    }

    fn bytes(&self, _: &AssetRef) -> Result<Box<dyn ReadAt>, ImageError> {
        crate::materials::ptex_file()
    }
}

fn noise(name: &str) -> Result<Noise, ImageError> {
    let numbers: Vec<u32> = name.split('x').filter_map(|part| part.parse().ok()).collect();
    let [width, height, channels] = numbers[..] else { return Err(ImageError("no such image".into())) };
    Ok(Noise { size: [width, height], channels, seed: width })
}
