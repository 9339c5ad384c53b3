// SPDX-License-Identifier: Apache-2.0
//! One memory in which assets may lie, the device's or the host's: what is there, and what the loader is bringing.
//! Render thread only.

use super::kept::EncodedAssets;
use super::load::{CopiedAssets, LoadInbox, WantedAsset};
use super::source::{AssetKey, AssetSource};
use crate::device::Device;
use crate::error::RenderError;
use oocpt_core::residency::AssetId;
use oocpt_gpu::HeapRange;
use rustc_hash::FxHashMap;
use std::sync::Arc;

/// Bytes of assets that the loader is asked for at once, about: they are ready together.
const LOAD_BYTES: u64 = 4 << 20;

/// An asset that rays may use.
#[derive(Debug)]
pub(crate) struct ResidentAsset {
    pub(super) memory: Arc<HeapRange>,
    /// Stack entries that a walk of its own tree needs.
    pub(crate) stack: u32,
}

impl ResidentAsset {
    /// Device address of its first byte.
    pub(crate) fn address(&self) -> u64 {
        self.memory.address()
    }
}

/// See the module.
#[derive(Debug, Default)]
pub(super) struct AssetMemory {
    pub(super) inbox: LoadInbox,
    pub(super) ready: FxHashMap<AssetKey, ResidentAsset>,
    /// The memory of assets on their way.
    pub(super) arriving: FxHashMap<AssetId, Arc<HeapRange>>,
    /// Of these, what the loader was not asked for yet, and its bytes.
    begun: Vec<WantedAsset>,
    begun_bytes: u64,
}

impl AssetMemory {
    /// Starts to bring an asset to `memory`, at the latest with [`AssetMemory::send`].
    pub(super) fn bring(
        &mut self,
        device: &Device,
        kept: &Arc<EncodedAssets>,
        (asset, source): (AssetId, AssetSource),
        memory: HeapRange,
    ) -> Result<(), RenderError> {
        let memory = Arc::new(memory);
        let is_tile = matches!(source, AssetSource::Tile(..));
        let wanted = WantedAsset { asset, source, target: Arc::clone(&memory) };
        self.arriving.insert(asset, Arc::clone(&memory));
        if is_tile {
            // Its file may take long to decode: nothing else should wait for it.
            return self.inbox.load(device.loader()?, vec![wanted], kept);
        }
        self.begun_bytes += memory.size();
        self.begun.push(wanted);
        if self.begun_bytes >= LOAD_BYTES { self.send(device, kept) } else { Ok(()) }
    }

    /// Has the loader begin with all that was asked for.
    pub(super) fn send(&mut self, device: &Device, kept: &Arc<EncodedAssets>) -> Result<(), RenderError> {
        self.begun_bytes = 0;
        self.inbox.load(device.loader()?, std::mem::take(&mut self.begun), kept)
    }

    /// Image and number of every tile that is ready, in no order.
    pub(super) fn tiles(&self) -> impl Iterator<Item = (u64, u32)> + '_ {
        self.ready.keys().filter_map(|key| match key {
            AssetKey::Tile(image, tile) => Some((*image, *tile)),
            _ => None,
        })
    }

    /// Forgets what is on its way.
    pub(super) fn forget_arriving(&mut self) {
        self.inbox = LoadInbox::default();
        self.arriving.clear();
        (self.begun, self.begun_bytes) = (Vec::new(), 0);
    }

    /// Takes note of what was copied; gives the assets that are ready now.
    pub(super) fn note_copied(
        &mut self,
        copied: &CopiedAssets,
        key: impl Fn(AssetId) -> Option<AssetKey>,
    ) -> impl Iterator<Item = AssetId> {
        let mut ready = Vec::new();
        for &(asset, stack) in &copied.assets {
            let Some(memory) = self.arriving.remove(&asset) else { continue };
            if let Some(key) = key(asset) {
                self.ready.insert(key, ResidentAsset { memory, stack });
            }
            ready.push(asset);
        }
        ready.into_iter()
    }
}
