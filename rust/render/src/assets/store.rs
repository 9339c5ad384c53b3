// SPDX-License-Identifier: Apache-2.0
//! The assets on the device and those on their way: memory -> copied -> ready.
//!
//! Kept from frame to frame by content key, so that an edit brings only what changed. Render thread only; the copying
//! is done by the loader's threads.

use super::catalog::SceneAssets;
use super::kept::Kept;
use super::load::{Inbox, Wanted};
use super::source::{ALIGN, AssetKey, Source};
use crate::device::Device;
use crate::error::RenderError;
use oocpt_core::residency::AssetId;
use oocpt_gpu::{HeapRange, Submission};
use rustc_hash::{FxHashMap, FxHashSet};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Bytes of assets that the loader is asked for at once, about: they are ready together.
const LOAD_BYTES: u64 = 4 << 20;
/// Longest wait for the loader to let go of memory that nobody wants any more.
const LET_GO_TIMEOUT: Duration = Duration::from_secs(60);

/// An asset that rays may use.
#[derive(Debug)]
pub(crate) struct Resident {
    memory: Arc<HeapRange>,
    /// Stack entries that a walk of its own tree needs.
    pub(crate) stack: u32,
}

impl Resident {
    /// Device address of its first byte.
    pub(crate) fn address(&self) -> u64 {
        self.memory.address()
    }
}

/// What [`Store::advance`] found.
#[derive(Debug, Default)]
pub(crate) struct Arrived {
    /// Assets that are ready now.
    pub(crate) ready: Vec<AssetId>,
    /// Copies that whoever uses them must wait for on the device.
    pub(crate) copies: Vec<Submission>,
    /// Bytes that were copied.
    pub(crate) bytes: u64,
}

/// How to ask for memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Patience {
    /// Wait for what the device still uses; running out is an error.
    Wait,
    /// Take what is free now; running out is an answer.
    Now,
}

/// See the module.
#[derive(Debug, Default)]
pub(crate) struct Store {
    inbox: Inbox,
    resident: FxHashMap<AssetKey, Resident>,
    /// The memory of assets on their way.
    arriving: FxHashMap<AssetId, Arc<HeapRange>>,
    /// Of these, what the loader was not asked for yet, and its bytes.
    begun: Vec<Wanted>,
    begun_bytes: u64,
    kept: Arc<Kept>,
}

impl Store {
    /// What is kept in host memory to come back.
    pub(crate) fn kept(&self) -> &Kept {
        &self.kept
    }

    /// Forgets what is on its way and every asset that `keep` does not have, tiles by `keeps_tiles_of` their image.
    pub(crate) fn retain(&mut self, keep: &FxHashSet<AssetKey>, keeps_tiles_of: impl Fn(u64) -> bool) {
        self.forget_arriving();
        self.kept.retain(|key| keep.contains(key));
        self.resident.retain(|key, _| match key {
            AssetKey::Tile(image, _) => keeps_tiles_of(*image),
            _ => keep.contains(key),
        });
    }

    /// Forgets everything on the device, also what is on its way, and waits until the loader has let go of its memory.
    pub(crate) fn clear(&mut self) {
        let held: Vec<_> = self.arriving.drain().map(|(_, memory)| memory).collect();
        self.forget_arriving();
        self.resident.clear();
        let started = Instant::now();
        while held.iter().any(|range| Arc::strong_count(range) > 1) && started.elapsed() < LET_GO_TIMEOUT {
            std::thread::sleep(Duration::from_millis(1));
        }
        let busy = held.iter().filter(|range| Arc::strong_count(range) > 1).count();
        if busy > 0 {
            tracing::warn!(busy, "the loader does not let go of memory that nobody wants any more");
        }
    }

    /// Forgets what is on its way.
    pub(crate) fn forget_arriving(&mut self) {
        self.inbox = Inbox::default();
        self.arriving.clear();
        (self.begun, self.begun_bytes) = (Vec::new(), 0);
    }

    /// Image and number of every tile that is ready, in no order.
    pub(crate) fn tiles(&self) -> impl Iterator<Item = (u64, u32)> + '_ {
        self.resident.keys().filter_map(|key| match key {
            AssetKey::Tile(image, tile) => Some((*image, *tile)),
            _ => None,
        })
    }

    /// The asset, if it is ready.
    pub(crate) fn get(&self, key: &AssetKey) -> Option<&Resident> {
        self.resident.get(key)
    }

    /// Lets go of an asset; its memory is free when the device has done what was submitted so far.
    pub(crate) fn evict(&mut self, key: &AssetKey) {
        self.resident.remove(key);
    }

    /// Bytes of what is ready.
    pub(crate) fn bytes(&self) -> u64 {
        self.resident.values().map(|resident| resident.memory.size()).sum()
    }

    /// Bytes of what is on its way.
    pub(crate) fn arriving_bytes(&self) -> u64 {
        self.arriving.values().map(|memory| memory.size()).sum()
    }

    /// Assets on their way.
    pub(crate) fn in_flight(&self) -> usize {
        self.arriving.len()
    }

    /// Starts to bring `asset`, at the latest with [`Store::send`]; false when there is no memory for it now (only with
    /// [`Patience::Now`]).
    pub(crate) fn begin(
        &mut self,
        device: &Device,
        assets: &SceneAssets,
        asset: AssetId,
        patience: Patience,
    ) -> Result<bool, RenderError> {
        let Some(source) = assets.source(asset) else {
            return Err(RenderError::Internal(format!("asset {asset} does not exist")));
        };
        source.check().map_err(|(what, count, limit)| RenderError::TooMany { what, count, limit })?;
        let Some(memory) = allocate(device, source.name(), source.size(), patience)? else { return Ok(false) };
        let memory = Arc::new(memory);
        let is_tile = matches!(source, Source::Tile(..));
        let wanted = Wanted { asset, source, target: Arc::clone(&memory) };
        self.arriving.insert(asset, Arc::clone(&memory));
        if is_tile {
            // Its file may take long to decode: nothing else should wait for it.
            self.inbox.load(device.loader()?, vec![wanted], &self.kept)?;
            return Ok(true);
        }
        self.begun_bytes += memory.size();
        self.begun.push(wanted);
        if self.begun_bytes >= LOAD_BYTES {
            self.send(device)?;
        }
        Ok(true)
    }

    /// Has the loader begin with all that was asked for.
    pub(crate) fn send(&mut self, device: &Device) -> Result<(), RenderError> {
        self.begun_bytes = 0;
        self.inbox.load(device.loader()?, std::mem::take(&mut self.begun), &self.kept)
    }

    /// Takes note of what has arrived. Waits at most `wait` for the first.
    pub(crate) fn advance(&mut self, assets: &SceneAssets, wait: Duration) -> Result<Arrived, RenderError> {
        let mut arrived = Arrived::default();
        let mut next = self.inbox.next(wait);
        while let Some(loaded) = next {
            let copied = loaded?;
            arrived.bytes += copied.bytes;
            arrived.copies.extend(copied.submissions);
            for (asset, stack) in copied.assets {
                let Some(memory) = self.arriving.remove(&asset) else { continue };
                if let Some(key) = assets.key(asset) {
                    self.resident.insert(key, Resident { memory, stack });
                }
                arrived.ready.push(asset);
            }
            next = self.inbox.try_next();
        }
        Ok(arrived)
    }
}

fn allocate(device: &Device, name: &str, bytes: u64, patience: Patience) -> Result<Option<HeapRange>, RenderError> {
    let bytes = bytes.max(ALIGN);
    match patience {
        Patience::Wait => Ok(Some(device.heap.alloc(name, bytes, ALIGN)?)),
        Patience::Now => Ok(device.heap.try_alloc(name, bytes, ALIGN)?),
    }
}
