// SPDX-License-Identifier: Apache-2.0
//! The assets on the device and those on their way: memory -> copied -> built -> ready.
//!
//! Kept from frame to frame by content key, so that an edit brings only what changed. Render thread only; the copying
//! is done by the loader's threads.

use super::build::{Build, Builder, MOST_BUILDS};
use super::catalog::SceneAssets;
use super::load::Inbox;
use super::source::{ALIGN, AssetKey, Source};
use crate::device::Device;
use crate::error::RenderError;
use oocpt_core::residency::AssetId;
use oocpt_gpu::{HeapRange, Submission};
use rustc_hash::{FxHashMap, FxHashSet};
use std::sync::Arc;
use std::time::{Duration, Instant};

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

/// An asset on its way.
#[derive(Debug)]
struct Arriving {
    memory: Arc<HeapRange>,
    /// Boxes and scratch memory of the build; none for a mesh.
    workspace: Option<Arc<HeapRange>>,
    /// Copies under way, once the loader has written everything.
    copies: Option<Vec<Submission>>,
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
#[derive(Debug)]
pub(crate) struct Store {
    inbox: Inbox,
    builder: Builder,
    resident: FxHashMap<AssetKey, Resident>,
    arriving: FxHashMap<AssetId, Arriving>,
    /// Copied, waiting for their trees to be built.
    unbuilt: Vec<AssetId>,
}

impl Store {
    pub(crate) fn new(device: &Device) -> Result<Self, RenderError> {
        Ok(Self {
            inbox: Inbox::default(),
            builder: Builder::new(device)?,
            resident: FxHashMap::default(),
            arriving: FxHashMap::default(),
            unbuilt: Vec::new(),
        })
    }

    /// Forgets what is on its way and every asset that `keep` does not have, tiles by `keeps_tiles_of` their image.
    pub(crate) fn retain(
        &mut self,
        keep: &FxHashSet<AssetKey>,
        keeps_tiles_of: impl Fn(u64) -> bool,
    ) -> Result<(), RenderError> {
        self.forget_arriving()?;
        self.resident.retain(|key, _| match key {
            AssetKey::Tile(image, _) => keeps_tiles_of(*image),
            _ => keep.contains(key),
        });
        Ok(())
    }

    /// Forgets everything, also what is on its way, and waits until the loader has let go of its memory.
    pub(crate) fn clear(&mut self) -> Result<(), RenderError> {
        let arriving = self.arriving.drain().map(|(_, arriving)| arriving);
        let held: Vec<_> = arriving.flat_map(|of| [Some(of.memory), of.workspace]).flatten().collect();
        self.forget_arriving()?;
        self.resident.clear();
        let started = Instant::now();
        while held.iter().any(|range| Arc::strong_count(range) > 1) && started.elapsed() < LET_GO_TIMEOUT {
            std::thread::sleep(Duration::from_millis(1));
        }
        let busy = held.iter().filter(|range| Arc::strong_count(range) > 1).count();
        if busy > 0 {
            tracing::warn!(busy, "the loader does not let go of memory that nobody wants any more");
        }
        Ok(())
    }

    /// Forgets what is on its way.
    pub(crate) fn forget_arriving(&mut self) -> Result<(), RenderError> {
        self.builder.finished(true)?;
        self.inbox = Inbox::default();
        self.arriving.clear();
        self.unbuilt.clear();
        Ok(())
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

    /// Bytes of what is on its way, with workspaces.
    pub(crate) fn arriving_bytes(&self) -> u64 {
        let of = |range: &Arc<HeapRange>| range.size();
        self.arriving.values().map(|arriving| of(&arriving.memory) + arriving.workspace.as_ref().map_or(0, of)).sum()
    }

    /// Assets on their way.
    pub(crate) fn in_flight(&self) -> usize {
        self.arriving.len()
    }

    /// Starts to bring `asset`; false when there is no memory for it now (only with [`Patience::Now`]).
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
        let mut workspace = None;
        if source.workspace_bytes() > 0 {
            let Some(range) = allocate(device, "instance build", source.workspace_bytes(), patience)? else {
                return Ok(false);
            };
            workspace = Some(Arc::new(range));
        }
        self.inbox.load(device.loader()?, asset, source, Arc::clone(&memory), workspace.clone())?;
        self.arriving.insert(asset, Arriving { memory, workspace, copies: None });
        Ok(true)
    }

    /// Moves everything on its way as far as it can go. Waits at most `wait` for the loader when nothing else is to do.
    pub(crate) fn advance(
        &mut self,
        device: &Device,
        assets: &SceneAssets,
        patience: Patience,
        wait: Duration,
    ) -> Result<Arrived, RenderError> {
        let mut arrived = Arrived::default();
        let idle = self.unbuilt.is_empty() && !self.builder.is_busy();
        let mut next = if idle { self.inbox.next(wait) } else { self.inbox.try_next() };
        while let Some(loaded) = next {
            self.copied(assets, loaded.asset, loaded.result?, &mut arrived);
            next = self.inbox.try_next();
        }
        let must_wait = patience == Patience::Wait && self.inbox.in_flight() == 0;
        for (asset, depth) in self.builder.finished(must_wait)? {
            if let Some(arriving) = self.arriving.remove(&asset) {
                self.ready(assets, asset, arriving.memory, depth);
                arrived.ready.push(asset);
            }
        }
        if !self.builder.is_busy() && !self.unbuilt.is_empty() {
            self.start_builds(device, assets)?;
        }
        Ok(arrived)
    }

    fn copied(
        &mut self,
        assets: &SceneAssets,
        asset: AssetId,
        (copies, bytes): (Vec<Submission>, u64),
        arrived: &mut Arrived,
    ) {
        arrived.bytes += bytes;
        let stack = assets.source(asset).as_ref().and_then(Source::known_stack);
        match (stack, self.arriving.get_mut(&asset)) {
            (Some(stack), Some(_)) => {
                arrived.copies.extend(copies);
                if let Some(arriving) = self.arriving.remove(&asset) {
                    self.ready(assets, asset, arriving.memory, stack);
                    arrived.ready.push(asset);
                }
            }
            (None, Some(arriving)) => {
                arriving.copies = Some(copies);
                self.unbuilt.push(asset);
            }
            (_, None) => {}
        }
    }

    fn ready(&mut self, assets: &SceneAssets, asset: AssetId, memory: Arc<HeapRange>, stack: u32) {
        if let Some(key) = assets.key(asset) {
            self.resident.insert(key, Resident { memory, stack });
        }
    }

    fn start_builds(&mut self, device: &Device, assets: &SceneAssets) -> Result<(), RenderError> {
        let mut builds = Vec::new();
        let count = self.unbuilt.len().min(MOST_BUILDS);
        for asset in self.unbuilt.drain(..count) {
            let (Some(arriving), Some(source)) = (self.arriving.get_mut(&asset), assets.source(asset)) else {
                continue;
            };
            let Some(workspace) = arriving.workspace.take() else { continue };
            let depth = self.builder.depth_address(builds.len());
            let job = source.build_job(arriving.memory.address(), workspace.address(), depth);
            let copies = arriving.copies.take().unwrap_or_default();
            builds.push(Build { asset, job, memory: Arc::clone(&arriving.memory), workspace, copies });
        }
        self.builder.submit(device, builds)
    }
}

fn allocate(device: &Device, name: &str, bytes: u64, patience: Patience) -> Result<Option<HeapRange>, RenderError> {
    let bytes = bytes.max(ALIGN);
    match patience {
        Patience::Wait => Ok(Some(device.heap.alloc(name, bytes, ALIGN)?)),
        Patience::Now => Ok(device.heap.try_alloc(name, bytes, ALIGN)?),
    }
}
