// SPDX-License-Identifier: Apache-2.0
//! The assets on the device and those in transit: memory -> copied -> ready. Beside them, those in host memory that the
//! device can read: rays can use both, and an asset in host memory is promoted to the device by one copy.
//!
//! Assets are kept from frame to frame by content key, so that an edit loads only what changed. Render thread only; the
//! copying is done by the loader's threads and the device.

use super::catalog::SceneAssets;
use super::copied::CopiedAssets;
use super::kept::EncodedAssets;
use super::load::LoadResult;
use super::place::{AssetMemory, ResidentAsset};
use super::placing::DevicePlacing;
use super::shapes::LevelShapes;
use super::source::{AssetKey, AssetSource};
use super::values::ALIGN;
use crate::device::Device;
use crate::error::RenderError;
use oocpt_core::residency::AssetId;
use oocpt_gpu::{HeapRange, Submission};
use rustc_hash::FxHashSet;
use std::collections::VecDeque;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Longest wait for the loader to release memory that nobody wants any more.
const LET_GO_TIMEOUT: Duration = Duration::from_secs(60);

/// The assets that [`AssetStore::advance`] has taken in.
#[derive(Debug, Default)]
pub(crate) struct ArrivedAssets {
    /// Assets that have become ready on the device.
    pub(crate) ready: Vec<AssetId>,
    /// Assets that have become ready in host memory.
    pub(crate) mapped: Vec<AssetId>,
    /// Copies that users of the assets must wait for on the device.
    pub(crate) copies: Vec<Arc<Submission>>,
    /// Bytes that were copied to the device.
    pub(crate) bytes: u64,
}

/// The behaviour when memory is short.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum MemoryWait {
    /// Wait for memory that the device still uses; running out is an error.
    Wait,
    /// Take only free memory; running out is not an error.
    Now,
}

/// Assets that the device copies from host memory.
#[derive(Debug, Default)]
struct AssetPromotion {
    /// The submitted copy; `None` if it is not submitted yet.
    copy: Option<Arc<Submission>>,
    /// Source and target of each asset that is not submitted.
    sources: Vec<(Arc<HeapRange>, Arc<HeapRange>)>,
    copied: CopiedAssets,
}

/// The assets on the device and in host memory, by content key.
#[derive(Debug, Default)]
pub(crate) struct AssetStore {
    device: AssetMemory,
    host: AssetMemory,
    /// Copies into host memory that are not known to be done.
    mapping: VecDeque<(Vec<Arc<Submission>>, CopiedAssets)>,
    /// Copies into host memory that the next promotion waits for.
    mapped_by: Vec<Arc<Submission>>,
    promotion: AssetPromotion,
    promoting: VecDeque<AssetPromotion>,
    kept: Arc<EncodedAssets>,
    /// What the device places by itself.
    pub(super) placing: DevicePlacing,
    /// Assets that could not be read since the last [`AssetStore::take_left_out`]: rays find nothing there.
    left_out: Vec<(AssetKey, String)>,
    /// Paths that were streamed since the last edit.
    pub(crate) paths_streamed: u64,
}

impl AssetStore {
    /// The encodings kept in host memory for reloads.
    pub(crate) fn kept(&self) -> &EncodedAssets {
        &self.kept
    }

    /// The shapes of trees over records that move.
    pub(crate) fn shapes(&self) -> &LevelShapes {
        &self.kept.shapes
    }

    /// Forgets the assets in transit and every asset that `keep` does not have; tiles by `keeps_tiles_of` their image.
    pub(crate) fn retain(&mut self, keep: &FxHashSet<AssetKey>, keeps_tiles_of: impl Fn(u64) -> bool) {
        self.forget_arriving();
        self.paths_streamed = 0;
        self.kept.retain(|key| keep.contains(key));
        for place in [&mut self.device, &mut self.host] {
            place.ready.retain(|key, _| match key {
                AssetKey::Tile(image, _) => keeps_tiles_of(*image),
                _ => keep.contains(key),
            });
        }
    }

    /// Forgets the assets in transit, and these, wherever they are.
    pub(super) fn forget(&mut self, gone: impl Iterator<Item = AssetKey>) {
        self.forget_arriving();
        self.paths_streamed = 0;
        for key in gone {
            self.kept.forget(&key);
            self.device.ready.remove(&key);
            self.host.ready.remove(&key);
        }
    }

    /// Forgets everything on the device and in transit, and waits until the loader has released its memory.
    pub(crate) fn clear(&mut self) {
        let held: Vec<_> = self.device.arriving.drain().map(|(_, memory)| memory).collect();
        self.forget_arriving();
        self.device.ready.clear();
        self.placing = DevicePlacing::default();
        let started = Instant::now();
        while held.iter().any(|range| Arc::strong_count(range) > 1) && started.elapsed() < LET_GO_TIMEOUT {
            std::thread::sleep(Duration::from_millis(1));
        }
        let busy = held.iter().filter(|range| Arc::strong_count(range) > 1).count();
        if busy > 0 {
            tracing::warn!(busy, "the loader does not let go of memory that nobody wants any more");
        }
    }

    /// Forgets the assets in transit.
    pub(crate) fn forget_arriving(&mut self) {
        self.device.forget_arriving();
        self.host.forget_arriving();
        self.mapping.clear();
        self.promotion = AssetPromotion::default();
        self.promoting.clear();
    }

    /// Forgets the assets in host memory; with `keeps_tiles`, all but tiles of textures.
    pub(crate) fn unmap(&mut self, keeps_tiles: bool) {
        self.host.forget_arriving();
        self.host.ready.retain(|key, _| keeps_tiles && matches!(key, AssetKey::Tile(..)));
        self.mapping.clear();
    }

    /// Image and number of every tile that is ready on the device, in no order.
    pub(crate) fn tiles(&self) -> impl Iterator<Item = (u64, u32)> + '_ {
        self.device.tiles()
    }

    /// Image and number of every tile that is ready in host memory, in no order.
    pub(crate) fn mapped_tiles(&self) -> impl Iterator<Item = (u64, u32)> + '_ {
        self.host.tiles()
    }

    /// The asset, if it is ready on the device.
    pub(crate) fn get(&self, key: &AssetKey) -> Option<&ResidentAsset> {
        self.device.ready.get(key)
    }

    /// The asset, if it is ready in host memory.
    pub(crate) fn mapped(&self, key: &AssetKey) -> Option<&ResidentAsset> {
        self.host.ready.get(key)
    }

    /// The asset as rays are to use it: on the device, or else in host memory.
    pub(crate) fn reached(&self, key: &AssetKey) -> Option<&ResidentAsset> {
        self.get(key).or_else(|| self.mapped(key))
    }

    /// Returns true if some asset is ready in host memory.
    pub(crate) fn maps_any(&self) -> bool {
        self.mapped_count() > 0
    }

    /// Assets in host memory.
    pub(crate) fn mapped_count(&self) -> usize {
        self.host.ready.len()
    }

    /// Bytes of what the device places chunks from.
    pub(crate) fn placing_bytes(&self) -> u64 {
        self.placing.bytes()
    }

    /// Frees what the device places chunks from; what was placed stays.
    pub(crate) fn stop_placing(&mut self) {
        self.placing = DevicePlacing::default();
    }

    /// Makes the memory of a ready asset that of another one, which it holds now.
    pub(super) fn take_over(&mut self, from: &AssetKey, to: AssetKey) {
        if let Some(resident) = self.device.ready.remove(from) {
            self.device.ready.insert(to, resident);
        }
    }

    /// Evicts an asset; its memory is free when the device has done what was submitted so far.
    pub(crate) fn evict(&mut self, key: &AssetKey) {
        self.device.ready.remove(key);
    }

    /// Forgets the assets that could not be read, so that they are tried again when they are wanted again; returns the
    /// reasons.
    pub(crate) fn take_left_out(&mut self) -> Vec<String> {
        let left_out = std::mem::take(&mut self.left_out);
        let take = |(key, why): (AssetKey, String)| {
            self.device.ready.remove(&key);
            self.host.ready.remove(&key);
            why
        };
        left_out.into_iter().map(take).collect()
    }

    /// Bytes of the ready assets.
    pub(crate) fn bytes(&self) -> u64 {
        self.device.ready.values().map(|resident| resident.memory.size()).sum()
    }

    /// Bytes of the assets in transit.
    pub(crate) fn arriving_bytes(&self) -> u64 {
        self.device.arriving.values().map(|memory| memory.size()).sum()
    }

    /// Assets in transit.
    pub(crate) fn in_flight(&self) -> usize {
        self.device.arriving.len()
    }

    /// Starts to load `asset`, at the latest with [`AssetStore::send`]; returns false if there is no memory for it now
    /// (only with [`MemoryWait::Now`]).
    pub(crate) fn begin(
        &mut self,
        device: &Device,
        assets: &SceneAssets,
        asset: AssetId,
        patience: MemoryWait,
    ) -> Result<bool, RenderError> {
        let Some(source) = assets.source(asset) else {
            return Err(RenderError::Internal(format!("asset {asset} does not exist")));
        };
        source.check().map_err(|(what, count, limit)| RenderError::TooMany { what, count, limit })?;
        let Some(memory) = allocate(device, source.name(), source.size(), patience)? else { return Ok(false) };
        match self.host.ready.get(&source.key()) {
            Some(mapped) => {
                let memory = Arc::new(memory);
                self.device.arriving.insert(asset, Arc::clone(&memory));
                self.promotion.copied.bytes += source.size();
                self.promotion.copied.assets.push((asset, mapped.stack));
                self.promotion.sources.push((Arc::clone(&mapped.memory), memory));
            }
            None => self.device.bring(device, &self.kept, (asset, source), memory)?,
        }
        Ok(true)
    }

    /// Starts to load `asset` into host memory, at the latest with [`AssetStore::send`]; returns false if no memory has
    /// been allocated for it yet, or none is allowed. The asset must be neither there nor in transit.
    pub(crate) fn map(&mut self, device: &Device, assets: &SceneAssets, asset: AssetId) -> Result<bool, RenderError> {
        let Some(source) = assets.source(asset) else { return Ok(false) };
        if source.check().is_err() {
            return Ok(false);
        }
        let (heap, bytes) = (device.host_heap()?, source.size().max(ALIGN));
        // Allocating an arena takes long; another thread does it.
        if heap.stats().largest_free < bytes { Ok(false) } else { self.map_now(device, (asset, source)) }
    }

    /// Loads `asset` into host memory as [`AssetStore::map`] does, but allocates memory for it.
    pub(crate) fn map_now(
        &mut self,
        device: &Device,
        (asset, source): (AssetId, AssetSource),
    ) -> Result<bool, RenderError> {
        let (heap, bytes) = (device.host_heap()?, source.size().max(ALIGN));
        let Some(memory) = heap.try_alloc(source.name(), bytes, ALIGN)? else { return Ok(false) };
        self.host.bring(device, &self.kept, (asset, source), memory)?;
        Ok(true)
    }

    /// Assets in transit to host memory.
    pub(crate) fn mapping(&self) -> usize {
        self.host.arriving.len()
    }

    /// Bytes of the assets in transit to host memory.
    pub(crate) fn mapping_bytes(&self) -> u64 {
        self.host.arriving.values().map(|memory| memory.size()).sum()
    }

    /// Returns true if an asset is in transit to host memory.
    pub(crate) fn is_mapping(&self, asset: AssetId) -> bool {
        self.host.arriving.contains_key(&asset)
    }

    /// Starts the loads and copies that were requested.
    pub(crate) fn send(&mut self, device: &Device) -> Result<(), RenderError> {
        self.device.send(device, &self.kept)?;
        self.host.send(device, &self.kept)?;
        let mut promotion = std::mem::take(&mut self.promotion);
        if promotion.sources.is_empty() {
            return Ok(());
        }
        let mut commands = device.gpu.transfer_commands("promote")?;
        for copy in self.mapped_by.drain(..) {
            commands.wait_for(&copy);
        }
        // No two copies have the same target.
        commands.all_concurrent();
        for (source, target) in promotion.sources.drain(..) {
            commands.copy(&*source, 0, &*target, 0, target.size());
        }
        promotion.copy = Some(Arc::new(commands.submit()?));
        self.promoting.push_back(promotion);
        Ok(())
    }

    /// Takes in what has arrived. Waits at most `wait` for the first asset.
    pub(crate) fn advance(&mut self, assets: &SceneAssets, wait: Duration) -> Result<ArrivedAssets, RenderError> {
        let mut arrived = ArrivedAssets::default();
        self.take_promoted(assets, &mut arrived);
        self.take_mapped(assets, &mut arrived)?;
        let nothing = arrived.ready.is_empty() && arrived.mapped.is_empty();
        let wait = if nothing { wait } else { Duration::ZERO };
        if !wait.is_zero() && self.device.inbox.in_flight() == 0 {
            let copies = self.promoting.front().and_then(|promotion| promotion.copy.clone());
            let copies = copies.into_iter().chain(self.mapping.front().and_then(|(copies, _)| copies.first().cloned()));
            match copies.into_iter().next() {
                Some(copy) => _ = copy.wait(wait)?,
                None => {
                    if let Some(loaded) = self.host.inbox.next(wait) {
                        self.note_mapping(loaded)?;
                    }
                }
            }
            return Ok(arrived);
        }
        let mut next = self.device.inbox.next(wait);
        while let Some(loaded) = next {
            let mut copied = loaded?;
            arrived.bytes += copied.bytes;
            arrived.copies.extend(copied.submissions.drain(..).map(Arc::new));
            self.left_out.append(&mut copied.left_out);
            arrived.ready.extend(self.device.note_copied(&copied, |asset| assets.key(asset)));
            next = self.device.inbox.try_next();
        }
        Ok(arrived)
    }

    /// Takes in the assets that the device has copied from host memory.
    fn take_promoted(&mut self, assets: &SceneAssets, arrived: &mut ArrivedAssets) {
        let is_done = |promotion: &AssetPromotion| promotion.copy.as_ref().is_some_and(|copy| copy.is_done());
        while self.promoting.front().is_some_and(is_done) {
            let Some(promotion) = self.promoting.pop_front() else { break };
            arrived.bytes += promotion.copied.bytes;
            arrived.copies.extend(promotion.copy);
            arrived.ready.extend(self.device.note_copied(&promotion.copied, |asset| assets.key(asset)));
        }
    }

    /// Takes in the assets that are complete in host memory.
    fn take_mapped(&mut self, assets: &SceneAssets, arrived: &mut ArrivedAssets) -> Result<(), RenderError> {
        while let Some(loaded) = self.host.inbox.try_next() {
            self.note_mapping(loaded)?;
        }
        while self.mapping.front().is_some_and(|(copies, _)| copies.iter().all(|copy| copy.is_done())) {
            let Some((copies, copied)) = self.mapping.pop_front() else { break };
            arrived.copies.extend(copies.iter().cloned());
            self.mapped_by.extend(copies);
            arrived.mapped.extend(self.host.note_copied(&copied, |asset| assets.key(asset)));
        }
        Ok(())
    }

    fn note_mapping(&mut self, loaded: LoadResult) -> Result<(), RenderError> {
        let mut copied = loaded?;
        let copies = copied.submissions.drain(..).map(Arc::new).collect();
        self.left_out.append(&mut copied.left_out);
        self.mapping.push_back((copies, copied));
        Ok(())
    }
}

fn allocate(device: &Device, name: &str, bytes: u64, patience: MemoryWait) -> Result<Option<HeapRange>, RenderError> {
    let bytes = bytes.max(ALIGN);
    match patience {
        MemoryWait::Wait => Ok(Some(device.heap.alloc(name, bytes, ALIGN)?)),
        MemoryWait::Now => Ok(device.heap.try_alloc(name, bytes, ALIGN)?),
    }
}
