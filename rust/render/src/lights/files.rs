// SPDX-License-Identifier: Apache-2.0
//! Where the bytes of lights' files come from.

use super::picture::{self, EncodedPicture};
use oocpt_core::scene::{AssetRef, IesProfile};
use rustc_hash::FxHashMap;
use std::sync::Arc;

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

/// Longest IES profile, bytes.
const MAX_PROFILE_BYTES: u64 = 16 << 20;

/// What was read, from frame to frame; files that no light names any more are forgotten.
#[derive(Debug, Default)]
pub(crate) struct FileCache {
    pictures: FxHashMap<(AssetRef, bool), Entry<EncodedPicture>>,
    profiles: FxHashMap<AssetRef, Entry<IesProfile>>,
}

#[derive(Debug)]
struct Entry<T> {
    result: Result<Arc<T>, String>,
    is_used: bool,
}

impl FileCache {
    /// A picture, read once; `is_dome` says what for.
    pub(super) fn picture(
        &mut self,
        asset: &AssetRef,
        is_dome: bool,
        files: &dyn LightFiles,
    ) -> Result<Arc<EncodedPicture>, String> {
        let read = || {
            let picture = files.picture(found(asset)?)?;
            if let Some(fault) = picture::fault(&picture) {
                return Err(fault);
            }
            Ok(Arc::new(if is_dome { EncodedPicture::dome(picture) } else { EncodedPicture::flat(picture) }))
        };
        let entry = self.pictures.entry((asset.clone(), is_dome));
        let entry = entry.or_insert_with(|| Entry { result: read(), is_used: true });
        entry.is_used = true;
        entry.result.clone()
    }

    /// A profile, read once.
    pub(super) fn profile(&mut self, asset: &AssetRef, files: &dyn LightFiles) -> Result<Arc<IesProfile>, String> {
        let read = || {
            let bytes = files.bytes(found(asset)?, MAX_PROFILE_BYTES)?;
            IesProfile::parse(&bytes).map(Arc::new).map_err(|error| error.to_string())
        };
        let entry = self.profiles.entry(asset.clone()).or_insert_with(|| Entry { result: read(), is_used: true });
        entry.is_used = true;
        entry.result.clone()
    }

    /// Forgets what was not asked for since the last call.
    pub(super) fn forget_unused(&mut self) {
        self.pictures.retain(|_, entry| std::mem::take(&mut entry.is_used));
        self.profiles.retain(|_, entry| std::mem::take(&mut entry.is_used));
    }
}

fn found(asset: &AssetRef) -> Result<&AssetRef, String> {
    if asset.resolved.is_empty() { Err("the file was not found".into()) } else { Ok(asset) }
}
