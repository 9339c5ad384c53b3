// SPDX-License-Identifier: Apache-2.0
//! The interface through which the host supplies the files that lights name.

use oocpt_core::scene::AssetRef;

/// A picture, wholly in memory.
#[derive(Clone, Debug, PartialEq)]
pub struct LightPicture {
    /// Texels in a row, at least 1.
    pub width: u32,
    /// Rows, at least 1.
    pub height: u32,
    /// Linear Rec. 709, the top row first: `width * height` texels.
    pub texels: Vec<[f32; 3]>,
}

/// Reads the files that lights name. Called from the render thread; may block.
pub trait LightFiles: std::fmt::Debug + Send + Sync {
    /// Reads the picture of a dome or of a rectangle.
    ///
    /// # Errors
    /// The reason why the picture cannot be read, for the user.
    fn picture(&self, asset: &AssetRef) -> Result<LightPicture, String>;

    /// Reads the bytes of an IES profile, at most `limit`.
    ///
    /// # Errors
    /// The reason why the file cannot be read, for the user.
    fn bytes(&self, asset: &AssetRef, limit: u64) -> Result<Vec<u8>, String>;
}

/// A reader for which every file is missing.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoFiles;

impl LightFiles for NoFiles {
    fn picture(&self, _: &AssetRef) -> Result<LightPicture, String> {
        Err("this host reads no pictures".into())
    }

    fn bytes(&self, _: &AssetRef, _: u64) -> Result<Vec<u8>, String> {
        Err("this host reads no files".into())
    }
}
