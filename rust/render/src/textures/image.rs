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
    /// Reading a part costs about as much as the part; else whole rows are read at a time where possible.
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
}

/// Opens images. Called by the render thread.
pub trait ImageLibrary: Send + Sync + Debug {
    /// Opens a file.
    fn open(&self, asset: &AssetRef) -> Result<Arc<dyn Image>, ImageError>;

    /// Opens the member `number` (1001 to 1100) of a set of files with `<UDIM>` in its path; `None` when there is none.
    fn open_part(&self, set: &AssetRef, number: u32) -> Option<Result<Arc<dyn Image>, ImageError>> {
        let name = |text: &str| text.replace("<UDIM>", &number.to_string()).into();
        let part = AssetRef { authored: name(&set.authored), resolved: name(&set.resolved) };
        self.open(&part).ok().map(Ok)
    }
}
