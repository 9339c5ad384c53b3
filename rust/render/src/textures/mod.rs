// SPDX-License-Identifier: Apache-2.0
//! Textures: the sources of images (`image`), the meaning of their texels (`texels`), one image as tiles (`tiles`), and
//! all textures of a snapshot (`set`).
//!
//! An image is cut into tiles (`oocpt_core::texture::TileLayout`); a tile is an asset and a unit of the planner, loaded
//! by the loader's threads as meshes are. Files that cannot give tiles of all levels at little cost are decoded once
//! (`convert`) and kept (`prepared`), as tiled and mip-mapped files (`tx`) in a folder (`disk`) or in host memory
//! (`memory`). Nothing here touches the device. Textures that displace surfaces are read through the same cache
//! (`heights`).

mod contents;
mod convert;
mod disk;
mod file;
mod heights;
mod image;
mod mask_key;
mod memory;
mod opacity_masks;
mod open;
mod prepared;
mod ptex;
mod set;
#[cfg(test)]
mod tests;
mod texels;
mod tiles;
mod tx;
mod under_way;

/// Pauses before a failed read is tried again: the disk may be busy or far away. Files that cannot be decoded cost half
/// a second, once.
const PAUSES: [Duration; 3] = [Duration::from_millis(20), Duration::from_millis(100), Duration::from_millis(400)];

pub(crate) use contents::FileContents;
pub use file::{CacheEntry, FileReport, TextureFile};
pub(crate) use heights::HeightTextures;
pub use image::{BAND_BYTES, ColorTransform, ImageError, ImageInfo, ImageLibrary, SourceImage};
pub(crate) use opacity_masks::OpacityMasks;
pub(crate) use set::{TextureCache, TextureSet};
pub(crate) use tiles::TextureImage;
pub use under_way::remove_unfinished;

use std::time::Duration;
