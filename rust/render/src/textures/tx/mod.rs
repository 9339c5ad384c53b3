// SPDX-License-Identifier: Apache-2.0
//! Tiled, mip-mapped image files in which decoded images are kept: `BigTIFF` (the TIFF 6.0 specification; Aldus and
//! Adobe 1992, extended to 64-bit offsets by libtiff), little-endian, uncompressed, read by every program that reads
//! TIFF.
//!
//! The tiles of all levels arrive in any order and are appended as they arrive; the directories, one a level, follow
//! behind them. So one pass over an image writes all of its levels, which no library allows: they end a level before
//! they begin the next. A private field has a checksum for each tile. Rows are stored from the bottom up (orientation
//! 4), as textures count them.

mod read;
#[cfg(test)]
mod tests;
mod write;

pub(super) use read::TxFile;
pub(super) use write::TxWriter;

use super::image::ImageInfo;
use oocpt_abi::TILE_SIDE;
use oocpt_core::texture::{LayoutError, TexelFormat, TileLayout, Wrap};
use serde::{Deserialize, Serialize};

/// Changes whenever older files cannot be used.
const VERSION: u32 = 1;
/// Sides of tiles are multiples of this.
const TILE_STEP: u32 = 16;
/// Most bytes of the description.
const MAX_DESCRIPTION_BYTES: u64 = 1 << 20;

const NEW_SUBFILE_TYPE: u16 = 254;
const IMAGE_WIDTH: u16 = 256;
const IMAGE_LENGTH: u16 = 257;
const BITS_PER_SAMPLE: u16 = 258;
const COMPRESSION: u16 = 259;
const PHOTOMETRIC: u16 = 262;
const IMAGE_DESCRIPTION: u16 = 270;
const ORIENTATION: u16 = 274;
const SAMPLES_PER_PIXEL: u16 = 277;
const PLANAR_CONFIGURATION: u16 = 284;
const SOFTWARE: u16 = 305;
const TILE_WIDTH: u16 = 322;
const TILE_LENGTH: u16 = 323;
const TILE_OFFSETS: u16 = 324;
const TILE_BYTE_COUNTS: u16 = 325;
const EXTRA_SAMPLES: u16 = 338;
const SAMPLE_FORMAT: u16 = 339;
/// A private tag: XXH3 (64 bits) of each tile. Numbers above 65000 are for private use.
const TILE_CHECKSUMS: u16 = 65_100;

const ASCII: u16 = 2;
const SHORT: u16 = 3;
const LONG: u16 = 4;
const LONG8: u16 = 16;

/// The properties of an image, stored as text in the file's description.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct TxDescription {
    /// [`VERSION`].
    version: u32,
    /// The identity of the source, and how it is read.
    pub(super) key: String,
    /// Texels of level 0, which need not be in the file.
    pub(super) size: [u32; 2],
    /// Number of channels, 1 to 4.
    pub(super) channels: u32,
    format: TxFormat,
    /// The finest level in the file.
    pub(super) first_level: u32,
    /// True or false if the source says that it is sRGB or not.
    is_srgb: Option<bool>,
    wrap: Option<[WrapMode; 2]>,
    /// True if there is one level of rows ([`TileLayout::of_rows`]).
    #[serde(default)]
    is_flat: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
enum TxFormat {
    U8,
    F16,
    F32,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
enum WrapMode {
    Black,
    Clamp,
    Repeat,
    Mirror,
}

impl TxDescription {
    pub(super) fn new(key: &str, info: &ImageInfo, is_flat: bool, first_level: u32) -> Self {
        let wrap = |wrap| match wrap {
            Wrap::UseMetadata | Wrap::Black => WrapMode::Black,
            Wrap::Clamp => WrapMode::Clamp,
            Wrap::Repeat => WrapMode::Repeat,
            Wrap::Mirror => WrapMode::Mirror,
        };
        Self {
            version: VERSION,
            key: key.to_owned(),
            size: info.levels.first().copied().unwrap_or_default(),
            channels: info.channels,
            format: match info.format {
                TexelFormat::U8 => TxFormat::U8,
                TexelFormat::F16 => TxFormat::F16,
                TexelFormat::F32 => TxFormat::F32,
            },
            first_level,
            is_srgb: info.is_srgb,
            wrap: info.wrap.map(|modes| modes.map(wrap)),
            is_flat,
        }
    }

    /// The properties of the source, with level 0 alone.
    pub(super) fn info(&self) -> ImageInfo {
        let wrap = |mode| match mode {
            WrapMode::Black => Wrap::Black,
            WrapMode::Clamp => Wrap::Clamp,
            WrapMode::Repeat => Wrap::Repeat,
            WrapMode::Mirror => Wrap::Mirror,
        };
        ImageInfo {
            levels: vec![self.size],
            channels: self.channels,
            format: self.format(),
            tile_friendly: false,
            is_srgb: self.is_srgb,
            wrap: self.wrap.map(|modes| modes.map(wrap)),
        }
    }

    fn format(&self) -> TexelFormat {
        match self.format {
            TxFormat::U8 => TexelFormat::U8,
            TxFormat::F16 => TexelFormat::F16,
            TxFormat::F32 => TexelFormat::F32,
        }
    }

    fn texel_bytes(&self) -> usize {
        (self.channels * self.format().bytes()) as usize
    }

    /// Returns true if the version is this one and the numbers are possible.
    fn is_possible(&self) -> bool {
        let layout = self.layout();
        self.version == VERSION
            && (1..=4).contains(&self.channels)
            && layout.is_ok_and(|layout| self.first_level < layout.levels())
    }

    /// The layout of level 0, for texels of 4 bytes: the size of a texel does not change the sizes of levels.
    fn layout(&self) -> Result<TileLayout, LayoutError> {
        match self.size {
            [TILE_SIDE, height] if self.is_flat => TileLayout::of_rows(height.saturating_mul(TILE_SIDE), 4),
            size => TileLayout::new(size, 4),
        }
    }

    /// The levels in the file.
    fn levels(&self) -> Vec<TxLevel> {
        let Ok(layout) = self.layout() else { return Vec::new() };
        (self.first_level..layout.levels()).map(|level| TxLevel::new(layout.level_size(level))).collect()
    }
}

/// The tiling of a level in the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct TxLevel {
    size: [u32; 2],
    /// Texels of each tile; those at the right and upper border are padded.
    tile: [u32; 2],
    /// Tiles along s and t.
    tiles: [u32; 2],
}

impl TxLevel {
    fn new(size: [u32; 2]) -> Self {
        let tile = size.map(|side| TILE_SIDE.min(side.next_multiple_of(TILE_STEP)));
        Self { size, tile, tiles: [size[0].div_ceil(tile[0]), size[1].div_ceil(tile[1])] }
    }

    fn count(&self) -> usize {
        self.tiles[0] as usize * self.tiles[1] as usize
    }

    /// The number of a tile; TIFF counts them row by row, and row 0 is the bottom one.
    fn number(&self, at: [u32; 2]) -> usize {
        at[1] as usize * self.tiles[0] as usize + at[0] as usize
    }

    fn tile_bytes(&self, texel_bytes: usize) -> usize {
        self.tile[0] as usize * self.tile[1] as usize * texel_bytes
    }
}
