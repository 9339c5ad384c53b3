// SPDX-License-Identifier: Apache-2.0
//! What the renderer asks of images: the bridge answers with the host's files, tests and command lines with their own.

use oocpt_core::scene::AssetRef;
use oocpt_core::texture::{TexelFormat, Wrap};
use std::fmt::Debug;
use std::sync::Arc;

/// Why an image cannot be had, in words for the user.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct ImageError(pub String);

/// What is known of an image before its texels are read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ImageInfo {
    /// Texels of the levels in the file, the finest first; at least one. Levels that are not `max(1, size >> level)` are not used,
    /// nor any after them; what lacks is made.
    pub levels: Vec<[u32; 2]>,
    /// 1 to 4.
    pub channels: u32,
    /// Format that [`Image::read`] gives.
    pub format: TexelFormat,
    /// Reading a part costs about as much as the part: the file is in tiles.
    pub tile_friendly: bool,
    /// The file says that it is sRGB, or that it is not.
    pub is_srgb: Option<bool>,
    /// The file says how it is continued outside, along s and t; never [`Wrap::UseMetadata`].
    pub wrap: Option<[Wrap; 2]>,
}

/// An open image. Called by several threads at once.
pub trait Image: Send + Sync + Debug {
    /// What is known of it; always the same.
    fn info(&self) -> ImageInfo;

    /// Reads `size` texels of a level from `at` on (the lowest left one is (0, 0)) to `out`: tightly packed, row by row from the
    /// bottom, `channels` values of `format` each, in the machine's byte order. The range lies inside the level and `out` has its length.
    fn read(&self, level: u32, at: [u32; 2], size: [u32; 2], out: &mut [u8]) -> Result<(), ImageError>;

    /// Decodes a whole level once, from the top of the image down. `sink` gets bands of whole rows, tightly packed, in the format of
    /// [`Image::read`]: the number of the band's first row, counted from the top of the image, then its rows from the top down. A band
    /// has about [`BAND_BYTES`] at most, or one row. The decoder stops, without an error, when `sink` returns false.
    fn decode(&self, level: u32, sink: &mut dyn FnMut(u32, &[u8]) -> bool) -> Result<(), ImageError> {
        let info = self.info();
        let [width, height] = info.levels.get(level as usize).copied().unwrap_or_default();
        let row_bytes = width as usize * (info.channels * info.format.bytes()) as usize;
        if row_bytes == 0 {
            return Ok(());
        }
        let most = u32::try_from((BAND_BYTES / row_bytes).max(1)).unwrap_or(1);
        let mut bottom_up = vec![0; row_bytes * most.min(height) as usize];
        let mut band = Vec::with_capacity(bottom_up.len());
        let mut top = 0;
        while top < height {
            let rows = most.min(height - top);
            let bytes = &mut bottom_up[..row_bytes * rows as usize];
            self.read(level, [0, height - top - rows], [width, rows], bytes)?;
            band.clear();
            bytes.rchunks_exact(row_bytes).for_each(|row| band.extend_from_slice(row));
            if !sink(top, &band) {
                return Ok(());
            }
            top += rows;
        }
        Ok(())
    }
}

/// Most bytes of a band of several rows.
pub const BAND_BYTES: usize = 4 << 20;

/// Opens images. Called by the render thread.
pub trait ImageLibrary: Send + Sync + Debug {
    /// Opens a file.
    fn open(&self, asset: &AssetRef) -> Result<Arc<dyn Image>, ImageError>;

    /// A text that changes when the content of the file may have changed, found without decoding anything. What is decoded is kept
    /// on disk under it; without one it is not kept.
    fn identity(&self, asset: &AssetRef) -> Result<String, ImageError> {
        Err(ImageError(format!("{} has no identity", asset.authored)))
    }

    /// Opens the member `number` (1001 to 1100) of a set of files with `<UDIM>` in its path; `None` when there is none.
    fn open_part(&self, set: &AssetRef, number: u32) -> Option<Result<Arc<dyn Image>, ImageError>> {
        let name = |text: &str| text.replace("<UDIM>", &number.to_string()).into();
        let part = AssetRef { authored: name(&set.authored), resolved: name(&set.resolved) };
        self.open(&part).ok().map(Ok)
    }
}
