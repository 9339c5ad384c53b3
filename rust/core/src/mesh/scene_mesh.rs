// SPDX-License-Identifier: Apache-2.0
//! The meshes of a snapshot: summaries in memory, assets in memory as far as there is room, else in files.

use std::ops::Deref;
use std::sync::atomic::Ordering;
use std::sync::{Arc, OnceLock};
use std::time::Duration;

use super::MeshAsset;
use super::host_memory::HeldMemory;
use super::payload;
use super::recipe::{MeshRecipe, MeshStorage};
use super::store::{PayloadError, PayloadSource};
use super::summary::MeshSummary;
use crate::again::again;
use crate::texture::HeightCache;

/// Message of a test's payload that can be neither read nor built again.
#[cfg(feature = "faults")]
pub const LOST_FOR_GOOD: &str = "lost for good";

/// Pauses before each retry of a read that failed.
const PAUSES: [Duration; 3] = [Duration::from_millis(100), Duration::from_millis(400), Duration::from_millis(1600)];

/// Reason why the asset of a mesh cannot be read.
#[derive(Clone, Debug, thiserror::Error)]
#[error("{path}: the mesh cannot be read back ({cause}), nor built again")]
pub struct StoredError {
    path: Arc<str>,
    cause: PayloadError,
}

/// An asset in a file.
#[derive(Debug)]
pub(super) struct StoredAsset {
    payload: Arc<dyn PayloadSource>,
    /// Of the assets of its recipe.
    index: usize,
    key: Option<u128>,
    recipe: Arc<MeshRecipe>,
    storage: MeshStorage,
}

impl StoredAsset {
    pub(super) fn new(
        payload: Arc<dyn PayloadSource>,
        index: usize,
        key: Option<u128>,
        recipe: &Arc<MeshRecipe>,
        storage: &MeshStorage,
    ) -> Self {
        Self { payload, index, key, recipe: recipe.clone(), storage: storage.clone() }
    }

    /// Builds the asset again, if its file cannot be read any more.
    fn build_again(&self, summary: &MeshSummary, cause: &PayloadError) -> Option<Arc<MeshAsset>> {
        #[cfg(feature = "faults")]
        if *cause == PayloadError::Read(LOST_FOR_GOOD.into()) {
            return None;
        }
        if let Some(files) = &self.storage.files {
            files.damaged(self.key, cause);
        }
        let heights = HeightCache::new(self.recipe.height_files.clone());
        let (mut index, mut wanted) = (0, None);
        let mut put = |cluster| {
            if index == self.index {
                wanted = Some(cluster);
            }
            index += 1;
        };
        let built = self.recipe.build(&heights, 1, None, &mut put);
        let asset = built.asset.or(wanted)?;
        (MeshSummary::of(&asset) == *summary).then(|| Arc::new(asset))
    }
}

/// A mesh of a snapshot. It derefs to its summary, which is known without reading a file.
#[derive(Debug)]
pub struct SceneMesh {
    pub(super) summary: MeshSummary,
    /// The asset, if it is in memory.
    pub(super) host: OnceLock<(Arc<MeshAsset>, HeldMemory)>,
    /// The asset in a file. At least one of `host` and `stored` is set.
    pub(super) stored: Option<StoredAsset>,
}

impl Deref for SceneMesh {
    type Target = MeshSummary;

    fn deref(&self) -> &MeshSummary {
        &self.summary
    }
}

impl SceneMesh {
    /// The asset. Reads it from a file where it is not in memory; it is not kept then. Any thread. A failed read is
    /// tried again within two seconds; if that fails, or if a file is damaged, the asset is built again on the rayon
    /// pool, and kept.
    ///
    /// # Errors
    /// The file cannot be read, and the asset not be built again.
    pub fn asset(&self) -> Result<Arc<MeshAsset>, StoredError> {
        if let Some((asset, _)) = self.host.get() {
            return Ok(asset.clone());
        }
        let path = |stored: Option<&StoredAsset>| stored.map_or_else(|| "".into(), |s| s.recipe.desc.prim.path.clone());
        let error = |cause| StoredError { path: path(self.stored.as_ref()), cause };
        let stored = self.stored.as_ref().ok_or_else(|| error(PayloadError::Damaged))?;
        let read = || payload::read(&self.summary, &*stored.payload);
        // A disk may be busy or far away. What has failed in spite of that is not waited for with every mesh.
        let pauses = if stored.storage.is_unreadable.load(Ordering::Relaxed) { &[][..] } else { &PAUSES };
        let wait = |pause| {
            if let Some(files) = &stored.storage.files {
                files.wait(pause);
            }
        };
        match again(pauses, |error| matches!(error, PayloadError::Read(_)), wait, read) {
            Ok(asset) => {
                stored.storage.is_unreadable.store(false, Ordering::Relaxed);
                Ok(Arc::new(asset))
            }
            Err(cause) => {
                if matches!(cause, PayloadError::Read(_)) {
                    stored.storage.is_unreadable.store(true, Ordering::Relaxed);
                }
                let asset = stored.build_again(&self.summary, &cause).ok_or_else(|| error(cause))?;
                let held = stored.storage.memory.hold(asset.host_bytes());
                Ok(self.host.get_or_init(|| (asset, held)).0.clone())
            }
        }
    }

    /// Bytes of host memory that [`Self::asset`] allocates: those of an asset that is in a file, else 0.
    #[must_use]
    pub fn bytes_to_read(&self) -> u64 {
        match (self.host.get(), &self.stored) {
            (None, Some(stored)) => stored.payload.size(),
            _ => 0,
        }
    }

    /// Bytes of host memory held.
    #[must_use]
    pub fn host_bytes(&self) -> u64 {
        let asset = self.host.get().map_or(0, |(asset, _)| asset.host_bytes());
        size_of::<Self>() as u64 + asset
    }
}
