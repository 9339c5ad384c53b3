// SPDX-License-Identifier: Apache-2.0
//! Textures: where images come from (`image`), levels that files lack (`mips`), one image as tiles (`tiles`), and all textures of a
//! snapshot (`set`).
//!
//! An image is cut into tiles (`oocpt_core::texture::Layout`); a tile is an asset and a unit of the planner, brought by the loader's
//! threads as meshes are. Nothing here touches the device.

mod image;
mod mips;
mod set;
#[cfg(test)]
mod tests;
mod tiles;

pub use image::{BAND_BYTES, ColorTransform, Image, ImageError, ImageInfo, ImageLibrary};
pub(crate) use set::{TextureCache, TextureSet};
pub(crate) use tiles::TextureImage;
