// SPDX-License-Identifier: Apache-2.0
//! What the renderer asks of images: the bridge answers with the host's files, tests and command lines with their own.

use oocpt_core::scene::AssetRef;
use oocpt_core::texture::{TexelFormat, Wrap};
use oocpt_ptex::ReadAt;
use std::fmt::Debug;
use std::sync::Arc;

/// Why an image cannot be had, in words for the user.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct ImageError(pub String);

/// What is known of an image before its texels are read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ImageInfo {
    /// Texels of the levels in the file, the finest first; at least one. Levels that are not `max(1, size >> level)`
    /// are not used, nor any after them; what lacks is made.
    pub levels: Vec<[u32; 2]>,
    /// 1 to 4.
    pub channels: u32,
    /// Format that [`SourceImage::read`] gives.
    pub format: TexelFormat,
    /// Reading a part costs about as much as the part. Else a part may cost as much as all rows above it: take all of
    /// the image once
    /// ([`SourceImage::decode`]) where more than a few texels are wanted.
    pub tile_friendly: bool,
    /// The file says that it is sRGB, or that it is not.
    pub is_srgb: Option<bool>,
    /// The file says how it is continued outside, along s and t; never [`Wrap::UseMetadata`].
    pub wrap: Option<[Wrap; 2]>,
}

/// An open image. Called by several threads at once.
pub trait SourceImage: Send + Sync + Debug {
    /// What is known of it; always the same.
    fn info(&self) -> ImageInfo;

    /// Reads `size` texels of a level from `at` on (the lowest left one is (0, 0)) to `out`: tightly packed, row by row
    /// from the bottom, `channels` values of `format` each, in the machine's byte order. The range lies inside the
    /// level and `out` has its length.
    fn read(&self, level: u32, at: [u32; 2], size: [u32; 2], out: &mut [u8]) -> Result<(), ImageError>;

    /// Decodes a level once, from the top of the image down. `sink(top, rows)` gets bands of whole rows, of at most
    /// [`BAND_BYTES`] or one
    /// row: `top` is the number of the band's first row counted from the top of the image, and the rows in a band go
    /// on downwards (those
    /// of [`Self::read`] go up). Texels as `read` gives them. Bands come in order, on the calling thread; together
    /// they are the level.
    /// Where the sink gives `false` no more are decoded, which is no error.
    fn decode(&self, level: u32, sink: &mut dyn FnMut(u32, &[u8]) -> bool) -> Result<(), ImageError> {
        decode_by_reading(self, level, sink)
    }
}

/// Most bytes of a band of rows that [`SourceImage::decode`] gives, unless one row is longer.
pub const BAND_BYTES: usize = 4 << 20;

/// [`SourceImage::decode`] for images of which any part is read as quickly as any other.
fn decode_by_reading<I: SourceImage + ?Sized>(
    image: &I,
    level: u32,
    sink: &mut dyn FnMut(u32, &[u8]) -> bool,
) -> Result<(), ImageError> {
    let info = image.info();
    let Some(&[width, height]) = info.levels.get(level as usize) else {
        return Err(ImageError(format!("it has no level {level}")));
    };
    let stride = width as usize * (info.channels * info.format.bytes()) as usize;
    let most = u32::try_from(BAND_BYTES / stride.max(1)).unwrap_or(u32::MAX).clamp(1, height.max(1));
    let mut upwards = vec![0; stride * most as usize];
    let mut downwards = Vec::with_capacity(upwards.len());
    for top in (0..height).step_by(most as usize) {
        let rows = most.min(height - top);
        let part = &mut upwards[..stride * rows as usize];
        image.read(level, [0, height - top - rows], [width, rows], part)?;
        downwards.clear();
        part.rchunks_exact(stride).for_each(|row| downwards.extend_from_slice(row));
        if !sink(top, &downwards) {
            break;
        }
    }
    Ok(())
}

/// A conversion of colours to linear Rec. 709. Called by several threads at once.
pub trait ColorTransform: Send + Sync + Debug {
    /// Converts texels of 1 to 4 channels, tightly packed, in place. Alpha (the second of two channels, the fourth)
    /// stays. Grey goes through
    /// as r = g = b, and the red that comes out is taken.
    fn apply(&self, texels: &mut [f32], channels: u32) -> Result<(), ImageError>;
}

/// Opens images. Called by the render thread.
pub trait ImageLibrary: Send + Sync + Debug {
    /// Opens a file.
    fn open(&self, asset: &AssetRef) -> Result<Arc<dyn SourceImage>, ImageError>;

    /// Opens the member `number` (1001 to 1100) of a set of files with `<UDIM>` in its path; `None` when there is none.
    fn open_part(&self, set: &AssetRef, number: u32) -> Option<Result<Arc<dyn SourceImage>, ImageError>> {
        let name = |text: &str| text.replace("<UDIM>", &number.to_string()).into();
        let part = AssetRef { authored: name(&set.authored), resolved: name(&set.resolved) };
        self.open(&part).ok().map(Ok)
    }

    /// The bytes of a file, for formats that are not read through [`Self::open`] (Ptex).
    fn bytes(&self, asset: &AssetRef) -> Result<Box<dyn ReadAt>, ImageError> {
        Err(ImageError(format!("{} cannot be read in parts", asset.authored)))
    }

    /// A text that changes when the content of a file may have changed, got without decoding anything:
    /// `file:<canonical path>:<bytes>:<time
    /// of modification in ns>` for a plain file, `hash:<xxh3 of the content, 128 bits, hexadecimal>:<bytes>` for
    /// anything else.
    fn identity(&self, asset: &AssetRef) -> Result<String, ImageError> {
        Err(ImageError(format!("{} has no identity", asset.authored)))
    }

    /// A text that changes when what names of colour spaces mean may have changed.
    fn color_config(&self) -> String {
        String::new()
    }

    /// The conversion from a named colour space ([`oocpt_core::material::ColorSpace::Named`]).
    fn color_transform(&self, name: &str) -> Result<Arc<dyn ColorTransform>, ImageError> {
        Err(ImageError(format!("the colour space `{name}` is not known")))
    }
}
