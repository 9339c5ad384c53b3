// SPDX-License-Identifier: Apache-2.0
//! Where the bytes of lights' files come from: the host says.

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

/// Reads the files that lights name. Called from the render thread; may take its time.
pub trait LightFiles: std::fmt::Debug + Send + Sync {
    /// The picture of a dome or of a rectangle.
    ///
    /// # Errors
    /// Why it cannot be had, for the user.
    fn picture(&self, asset: &AssetRef) -> Result<LightPicture, String>;

    /// The bytes of an IES profile, at most `limit`.
    ///
    /// # Errors
    /// Why they cannot be had, for the user.
    fn bytes(&self, asset: &AssetRef, limit: u64) -> Result<Vec<u8>, String>;
}

/// No file can be read.
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
