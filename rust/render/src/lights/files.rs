// SPDX-License-Identifier: Apache-2.0
//! The contents of lights' files, from frame to frame.

use super::dome_layout::to_latlong;
use super::picture::{self, EncodedPicture};
use crate::job::light_files::LightFiles;
use oocpt_core::scene::{AssetRef, DomeFormat, IesProfile};
use rustc_hash::FxHashMap;
use std::sync::Arc;

/// Longest IES profile, bytes.
const MAX_PROFILE_BYTES: u64 = 16 << 20;

/// Pictures and profiles that were read; files that no light names any more are forgotten.
#[derive(Debug, Default)]
pub(crate) struct FileCache {
    pictures: FxHashMap<(AssetRef, Option<DomeFormat>), CachedFile<EncodedPicture>>,
    profiles: FxHashMap<AssetRef, CachedFile<IesProfile>>,
}

#[derive(Debug)]
struct CachedFile<T> {
    result: Result<Arc<T>, String>,
    is_used: bool,
}

impl FileCache {
    /// A picture, read once; `dome` is the layout of a dome's picture, `None` for a rectangle's.
    pub(super) fn picture(
        &mut self,
        asset: &AssetRef,
        dome: Option<DomeFormat>,
        files: &dyn LightFiles,
    ) -> Result<Arc<EncodedPicture>, String> {
        let read = || {
            let picture = files.picture(found(asset)?)?;
            if let Some(fault) = picture::fault(&picture) {
                return Err(fault);
            }
            Ok(Arc::new(match dome {
                Some(format) => EncodedPicture::dome(to_latlong(picture, format)),
                None => EncodedPicture::flat(picture),
            }))
        };
        let entry = self.pictures.entry((asset.clone(), dome));
        let entry = entry.or_insert_with(|| CachedFile { result: read(), is_used: true });
        entry.is_used = true;
        entry.result.clone()
    }

    /// A profile, read once.
    pub(super) fn profile(&mut self, asset: &AssetRef, files: &dyn LightFiles) -> Result<Arc<IesProfile>, String> {
        let read = || {
            let bytes = files.bytes(found(asset)?, MAX_PROFILE_BYTES)?;
            IesProfile::parse(&bytes).map(Arc::new).map_err(|error| error.to_string())
        };
        let entry = self.profiles.entry(asset.clone()).or_insert_with(|| CachedFile { result: read(), is_used: true });
        entry.is_used = true;
        entry.result.clone()
    }

    /// Forgets the files that were not used since the last call.
    pub(super) fn forget_unused(&mut self) {
        self.pictures.retain(|_, entry| std::mem::take(&mut entry.is_used));
        self.profiles.retain(|_, entry| std::mem::take(&mut entry.is_used));
    }
}

fn found(asset: &AssetRef) -> Result<&AssetRef, String> {
    if asset.resolved.is_empty() { Err("the file was not found".into()) } else { Ok(asset) }
}
