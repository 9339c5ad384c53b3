// SPDX-License-Identifier: Apache-2.0
//! Keeps the scene on the device from frame to frame: the assets that a snapshot needs, those that are resident, and
//! whether all of them fit.
//!
//! [`SceneCache::sync`] lists what a snapshot needs. If it fits the budget, [`DeviceScene::load_all`] loads everything;
//! else the streaming loop loads what the rays ask for. Render thread only.

use super::catalog::SceneAssets;
use super::source::AssetKey;
use super::store::{AssetStore, MemoryWait};
use super::tables::{SceneTables, ShownTop, TableEntries};
use crate::device::Device;
use crate::error::RenderError;
use crate::job::shared::FrameGate;
use crate::job::timings::RenderTimings;
use crate::textures::{ImageLibrary, TextureCache};
use oocpt_abi::{MAX_LEVELS, REFIT_THREADS};
use oocpt_core::inventory::RenderInventory;
use oocpt_core::residency::AssetId;
use oocpt_core::scene::Snapshot;
use oocpt_core::settings::Settings;
use oocpt_gpu::HeapRange;
use rustc_hash::{FxHashMap, FxHashSet};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

/// Bytes of assets that may be in transit at the same time while everything is loaded.
const IN_FLIGHT_BYTES: u64 = 512 << 20;
/// The longest time that a copy on the device may take.
const COPY_TIMEOUT: Duration = Duration::from_secs(120);

/// Addresses and sizes of the scene's tables, for the passes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SceneView {
    pub(crate) top_nodes: u64,
    pub(crate) chunk_instances: u64,
    pub(crate) chunks: u64,
    pub(crate) assemblies: u64,
    pub(crate) meshes: u64,
    /// 0 if no mesh has a material; so are the next two.
    pub(crate) materials: u64,
    pub(crate) prims: u64,
    pub(crate) material_slots: u64,
    /// 0 if no material has a program.
    pub(crate) programs: u64,
    /// 0 if no placement of an opened assembly has values.
    pub(crate) placed_values: u64,
    /// True if some material has an alpha test.
    pub(crate) has_cutouts: bool,
    /// A kind of cutout in the scene that native traversal does not support.
    pub(crate) not_native_cutouts: Option<&'static str>,
    /// True if some alpha tests have an opacity mask.
    pub(crate) has_opacity_masks: bool,
    /// True if most of them have.
    pub(crate) masks_answer_most: bool,
    /// 0 if nothing reads a texture.
    pub(crate) textures: u64,
    /// 0 if nothing reads a texture.
    pub(crate) texture_pages: u64,
    /// Bytes of all trees, items and records.
    pub(crate) geometry_bytes: u64,
    /// Longest chain of instance records inside a chunk.
    pub(crate) max_levels: u32,
    /// Stack entries that a walk of the top level needs.
    top_stack: u32,
    /// Traversal stack entries of a ray.
    pub(crate) stack_size: u32,
}

impl SceneView {
    /// This view for passes that take the deepest nesting that is supported.
    pub(crate) fn deepest(self, stack_entries: u32) -> Self {
        Self { max_levels: MAX_LEVELS, ..self }.with_stack(stack_entries)
    }

    /// This view for chunks that need `stack_entries` below the top level.
    pub(crate) fn with_stack(self, stack_entries: u32) -> Self {
        // A walk needs one more entry per way back to a level above, and one for the end. The sum is rounded up, so
        // that small edits do not need new pipelines.
        let stack_size = (self.top_stack + stack_entries + self.max_levels + 2).next_multiple_of(16);
        Self { stack_size, ..self }
    }
}

/// A snapshot's data on the device.
#[derive(Debug)]
pub(crate) struct DeviceScene {
    pub(crate) assets: Arc<SceneAssets>,
    pub(crate) store: AssetStore,
    pub(super) tables: Option<SceneTables>,
    /// The host's mirror of the tables.
    pub(super) entries: TableEntries,
    /// True if the tables are those of a scene in core, but for what an edit has left to be written.
    pub(super) is_in_core: bool,
    /// Of a scene in core: what each asset needs for [`Self::stack_entries`], and all of them.
    stacks: OnceLock<(Vec<u32>, u32)>,
    /// Of a scene in core: the assets among which those that are missing are, if that is known.
    pub(super) lacking: Option<Vec<AssetId>>,
    /// After an edit whose entries are not in the tables yet: what these show.
    pub(super) shown_top: Option<ShownTop>,
    /// The entries.
    pub(super) unshown: Vec<AssetId>,
    /// Assets that were listed, and bytes of tables that were written, since [`Self::load_all`] told them.
    pub(super) listed: u64,
    pub(super) table_bytes: u64,
    /// Where held chunks that moved were, by shape: chunks of the scene before that are still on the device.
    before: FxHashMap<u64, AssetKey>,
    /// True until its chunks that are measured late have been.
    is_new: bool,
    /// True if the frame may read tiles that find no room on the device in host memory.
    pub(crate) maps_tiles: bool,
}

/// The device scene of the last snapshot, with its images and lights.
#[derive(Debug, Default)]
pub(crate) struct SceneCache {
    scene: Option<DeviceScene>,
    textures: TextureCache,
}

impl SceneCache {
    /// Opens the images that the textures of a snapshot read: `images` knows them, `settings` say where they are kept
    /// when decoded.
    pub(crate) fn open_textures(
        &mut self,
        snapshot: &Snapshot,
        images: Option<&Arc<dyn ImageLibrary>>,
        settings: &Settings,
    ) -> &TextureCache {
        self.textures.keep_in(settings);
        self.textures.sync(images, &snapshot.surfaces.textures);
        &self.textures
    }

    /// Clears the device scene as [`DeviceScene::clear`] does, if there is one.
    pub(crate) fn clear(&mut self, device: &Device) -> Result<(), RenderError> {
        self.scene.as_mut().map_or(Ok(()), |scene| scene.clear(device))
    }

    /// Makes the assets of `snapshot` the wanted ones and drops those that it does not need. `images` opens what
    /// textures name.
    pub(crate) fn sync(
        &mut self,
        snapshot: &Arc<Snapshot>,
        images: Option<&Arc<dyn ImageLibrary>>,
    ) -> Result<&mut DeviceScene, RenderError> {
        match &mut self.scene {
            // An unchanged scene keeps its assets and tables.
            Some(scene) if Arc::ptr_eq(&scene.assets.snapshot, snapshot) => scene.store.forget_arriving(),
            _ => {
                let textures = self.textures.sync(images, &snapshot.surfaces.textures);
                let before = self.scene.as_ref().map(|scene| &scene.assets);
                let masks = match before.filter(|before| before.has_surfaces_of(snapshot, &textures)) {
                    Some(before) => Arc::clone(&before.masks),
                    None => self.textures.opacity_masks(&snapshot.surfaces, &textures.records),
                };
                if self.scene.as_mut().is_some_and(|scene| scene.edit(snapshot, &textures, &masks)) {
                    return self.scene.as_mut().ok_or_else(|| RenderError::Internal("the scene was not made".into()));
                }
                let before = self.scene.as_ref().map(|scene| &scene.assets);
                let kept = before.and_then(|assets| assets.with_same_geometry(snapshot, &textures, &masks));
                let assets = match kept {
                    Some(assets) => assets,
                    None => SceneAssets::new(snapshot, &textures, masks)?,
                };
                let assets = Arc::new(assets);
                let mut before = FxHashMap::default();
                let mut keep: FxHashSet<AssetKey> = assets.keys().map(|(_, key)| key).collect();
                let mut store = match self.scene.take() {
                    Some(scene) => {
                        if scene.is_in_core {
                            before = moved_from(&scene, &assets, &keep);
                        }
                        scene.store
                    }
                    None => AssetStore::default(),
                };
                keep.extend(before.values());
                store.retain(&keep, |image| assets.textures.has(image));
                let moving: FxHashSet<u64> = assets.shapes().collect();
                store.shapes().begin(|shape| moving.contains(&shape));
                self.scene = Some(DeviceScene {
                    listed: assets.source_count() as u64,
                    assets,
                    store,
                    tables: None,
                    entries: TableEntries::default(),
                    is_in_core: false,
                    stacks: OnceLock::new(),
                    lacking: None,
                    shown_top: None,
                    unshown: Vec::new(),
                    table_bytes: 0,
                    before,
                    is_new: true,
                    maps_tiles: false,
                });
            }
        }
        self.scene.as_mut().ok_or_else(|| RenderError::Internal("the scene was not made".into()))
    }
}

/// Where the held chunks of `assets` were that moved, by shape: chunks of the scene before that nothing else needs.
fn moved_from(scene: &DeviceScene, assets: &SceneAssets, keep: &FxHashSet<AssetKey>) -> FxHashMap<u64, AssetKey> {
    let is_there = |key: &AssetKey| scene.store.get(key).is_some();
    let moved = assets.held_chunks().filter(|chunk| !is_there(&AssetKey::Chunk(chunk.key())));
    let moved: FxHashSet<u64> = moved.map(|chunk| chunk.shape()).collect();
    let old = scene.assets.chunks().filter(|chunk| moved.contains(&chunk.shape()));
    let old = old.map(|chunk| (chunk.shape(), AssetKey::Chunk(chunk.key())));
    old.filter(|(_, key)| is_there(key) && !keep.contains(key)).collect()
}

impl DeviceScene {
    /// Places the chunks that moved on the device, where it can ([`super::moved`]); the others are missing. Then
    /// gives the top level the bounds of all. Returns whether the device placed what moved; `None` if nothing did.
    pub(crate) fn place_moved(
        &mut self,
        device: &Device,
        timings: &mut RenderTimings,
    ) -> Result<Option<bool>, RenderError> {
        let before = std::mem::take(&mut self.before);
        let mut is_placed = None;
        if !before.is_empty() {
            is_placed = Some(self.place_from(device, &before, timings)?);
        } else if self.is_new && self.assets.held_chunks().next().is_none() {
            self.store.stop_placing();
        }
        if let Some(world) = self.is_new.then(|| self.assets.snapshot.world.measured()).flatten() {
            let assets = Arc::get_mut(&mut self.assets);
            let assets =
                assets.ok_or_else(|| RenderError::Internal("assets are in use before they are there".into()))?;
            assets.bound(&world);
        }
        self.is_new = false;
        Ok(is_placed)
    }

    fn place_from(
        &mut self,
        device: &Device,
        before: &FxHashMap<u64, AssetKey>,
        timings: &mut RenderTimings,
    ) -> Result<bool, RenderError> {
        let started = Instant::now();
        let has_doubles = device.gpu.report().capabilities.shader_float64;
        let placed = match has_doubles && device.gpu.limits().max_workgroup_threads >= REFIT_THREADS {
            true => self.store.place_held(device, &self.assets, before),
            false => Ok((0, false)),
        };
        before.values().for_each(|key| self.store.evict(key));
        let placed = placed.or_else(|error| {
            // What is on the device may be half of an edit.
            self.store.stop_placing();
            match error {
                RenderError::Budget { .. } => Ok((0, false)),
                error => Err(error),
            }
        });
        let (bytes, is_placed) = placed?;
        timings.uploaded_bytes += bytes;
        timings.upload_secs += started.elapsed().as_secs_f64();
        Ok(is_placed)
    }

    /// Bytes that are not loaded yet, with tables; tiles of textures left out.
    pub(crate) fn missing_bytes(&self) -> u64 {
        let missing: u64 = self.missing().filter_map(|id| self.assets.source(id)).map(|s| s.bytes()).sum();
        missing + SceneTables::bytes(&self.assets)
    }

    /// Longest chain of instance records inside a chunk, at least 1.
    pub(crate) fn levels(&self) -> u32 {
        self.assets.snapshot.world.levels.max(1)
    }

    /// Chunks of the scene; counted by `SceneAssets::new`.
    pub(crate) fn chunk_count(&self) -> u32 {
        u32::try_from(self.assets.snapshot.world.chunks.len()).unwrap_or(u32::MAX)
    }

    /// Units of the planner: chunks, then tiles of textures.
    pub(crate) fn unit_count(&self) -> u32 {
        u32::try_from(self.assets.catalog.unit_count()).unwrap_or(u32::MAX)
    }

    /// Makes the next frame build the tables anew.
    pub(super) fn forget_tables(&mut self) {
        self.is_in_core = false;
    }

    pub(super) fn tables(&self) -> Option<&SceneTables> {
        self.tables.as_ref()
    }

    pub(super) fn entries(&self) -> &TableEntries {
        &self.entries
    }

    /// Notes the address of a ready asset, for the tables.
    pub(super) fn show(&mut self, asset: AssetId) {
        if let Some(resident) = self.assets.key(asset).and_then(|key| self.store.reached(&key)) {
            self.entries.set(&self.assets, asset, resident.address());
        }
    }

    fn missing(&self) -> impl Iterator<Item = AssetId> + '_ {
        let known = self.lacking.as_ref().filter(|_| self.is_in_core);
        let all = known.is_none().then_some(&self.assets.needed);
        let looked_at = all.into_iter().chain(known).flatten().copied();
        looked_at.filter(|asset| self.assets.key(*asset).is_some_and(|key| self.store.get(&key).is_none()))
    }

    /// As [`AssetStore::take_left_out`].
    pub(crate) fn take_left_out(&mut self) -> Vec<String> {
        let left_out = self.store.take_left_out();
        if !left_out.is_empty() {
            self.lacking = None;
        }
        left_out
    }

    /// Loads every asset except texture tiles, which are loaded on demand, and fills the tables. Returns `Ok(false)` if
    /// the gate stopped it.
    pub(crate) fn load_all(
        &mut self,
        device: &Device,
        gate: &FrameGate<'_>,
        timings: &mut RenderTimings,
    ) -> Result<bool, RenderError> {
        let started = Instant::now();
        let mut missing: Vec<AssetId> = self.missing().collect();
        timings.listed_assets += std::mem::take(&mut self.listed);
        if missing.is_empty() && self.is_in_core && self.shown_top.is_none() {
            self.lacking = Some(Vec::new());
            return Ok(true);
        }
        let is_edit = self.is_in_core && self.lacking.is_some();
        // Instance records are loaded first: they take longest, and the last ones should not be waited for alone.
        missing.reverse();
        let mut missing = missing.into_iter().peekable();
        let mut on_the_way = 0_u64;
        let mut patience = gate.patience();
        while missing.peek().is_some() || self.store.in_flight() > 0 {
            if !gate.proceed() {
                return Ok(false);
            }
            while let Some(&asset) = missing.peek() {
                let cost = self.cost(asset);
                if on_the_way > 0 && on_the_way + cost > IN_FLIGHT_BYTES {
                    break;
                }
                self.store.begin(device, &self.assets, asset, MemoryWait::Wait)?;
                on_the_way += cost;
                missing.next();
            }
            self.store.send(device)?;
            let arrived = self.store.advance(&self.assets, Duration::from_millis(50))?;
            timings.uploaded_bytes += arrived.bytes;
            for copy in &arrived.copies {
                if !copy.wait(COPY_TIMEOUT)? {
                    return Err(RenderError::Internal("a copy to the device did not finish".into()));
                }
            }
            for asset in &arrived.ready {
                on_the_way = on_the_way.saturating_sub(self.cost(*asset));
                patience.came(Instant::now());
            }
            gate.shared().wait_for_loads(
                &mut patience,
                "part of the scene",
                self.store.in_flight(),
                device.loader()?.lives(),
            )?;
        }
        timings.upload_secs += started.elapsed().as_secs_f64();
        let started = Instant::now();
        if is_edit {
            self.show_edit(device)?;
        } else {
            self.show_all(device)?;
            (self.is_in_core, self.stacks) = (true, OnceLock::new());
        }
        self.lacking = Some(Vec::new());
        timings.table_bytes += std::mem::take(&mut self.table_bytes);
        timings.build_secs += started.elapsed().as_secs_f64();
        Ok(true)
    }

    /// Returns true if rays can use the whole scene, on the device or in host memory; tiles of textures left out.
    pub(crate) fn is_all_there(&self) -> bool {
        self.assets.keys().all(|(_, key)| self.store.reached(&key).is_some())
    }

    /// Fills the tables with the addresses of all assets.
    pub(crate) fn show_where_it_is(&mut self, device: &Device) -> Result<(), RenderError> {
        self.store.forget_arriving();
        self.is_in_core = false;
        self.show_all(device)
    }

    fn show_all(&mut self, device: &Device) -> Result<(), RenderError> {
        (self.tables, self.entries) = (None, TableEntries::new(&self.assets));
        (self.shown_top, self.unshown) = (None, Vec::new());
        let first = self.assets.first_tile();
        let textures = &self.assets.textures;
        let tiles = self.store.tiles().chain(self.store.mapped_tiles());
        let tiles = tiles.filter_map(|(image, tile)| Some(first + textures.number_of(image, tile)?));
        let there: Vec<AssetId> = self.assets.needed.iter().copied().chain(tiles).collect();
        there.into_iter().for_each(|asset| self.show(asset));
        self.tables = Some(SceneTables::new(device, &self.assets, &self.entries)?);
        self.table_bytes += SceneTables::bytes(&self.assets);
        Ok(())
    }

    /// Drops everything on the device, tables too, and frees the memory. Waits for the device.
    pub(crate) fn clear(&mut self, device: &Device) -> Result<(), RenderError> {
        self.store.clear();
        (self.tables, self.is_in_core, self.entries) = (None, false, TableEntries::default());
        device.gpu.wait_idle()?;
        device.heap.trim();
        Ok(())
    }

    /// Frees the host memory that rays read across the bus; with `keeps_tiles`, not that of tiles of textures.
    pub(crate) fn unmap(&mut self, device: &Device, keeps_tiles: bool) {
        self.store.unmap(keeps_tiles);
        if let Some(heap) = device.host_heap_if_made() {
            heap.trim();
        }
    }

    /// Bytes of device memory that [`Self::clear`] frees, in arenas that others do not share.
    pub(crate) fn bytes_to_clear(&self, device: &Device) -> u64 {
        let heap = device.heap.stats();
        let own = self.store.bytes() + self.store.arriving_bytes() + self.store.placing_bytes();
        let of_others = heap.live_bytes.saturating_sub(own);
        (heap.arena_bytes + heap.dedicated_bytes).saturating_sub(of_others)
    }

    /// Bytes of the tables.
    pub(crate) fn table_bytes(&self) -> u64 {
        SceneTables::bytes(&self.assets)
    }

    fn cost(&self, asset: AssetId) -> u64 {
        self.assets.source(asset).map_or(0, |source| source.bytes())
    }

    /// Creates tables in which every chunk is absent, for streaming.
    pub(crate) fn make_empty_tables(&mut self, device: &Device) -> Result<(), RenderError> {
        self.is_in_core = false;
        self.entries = TableEntries::default();
        self.tables = Some(SceneTables::new(device, &self.assets, &TableEntries::new(&self.assets))?);
        Ok(())
    }

    /// Lists the tables, and, if all of the scene is resident, its assets by their content.
    pub(crate) fn list(&self, inventory: &mut RenderInventory, in_core: bool) {
        if let Some(tables) = &self.tables {
            tables.list(inventory);
        }
        if in_core {
            self.assets.list(inventory);
        }
    }

    /// The parts that a streaming loop works with.
    pub(crate) fn parts(&mut self) -> Result<(&Arc<SceneAssets>, &mut AssetStore, &SceneTables), RenderError> {
        match &self.tables {
            Some(tables) => Ok((&self.assets, &mut self.store, tables)),
            None => Err(RenderError::Internal("the scene's tables were not made".into())),
        }
    }

    /// Stack entries that the resident chunks need below the top level.
    pub(crate) fn stack_entries(&self) -> u32 {
        match self.is_in_core {
            true => self.stacks.get_or_init(|| self.find_stacks()).1,
            false => self.find_stacks().1,
        }
    }

    fn find_stacks(&self) -> (Vec<u32>, u32) {
        let stacks = self.assets.stacks(|asset| self.own_stack(asset));
        let most = stacks.iter().copied().max().unwrap_or(0);
        (stacks, most)
    }

    /// Finds the stack entries of `changed` (sorted) anew.
    pub(super) fn renew_stacks(&mut self, changed: &[AssetId]) {
        let Some((mut stacks, _)) = self.stacks.take() else { return };
        self.assets.renew_stacks(&mut stacks, changed, |asset| self.own_stack(asset));
        let most = stacks.iter().copied().max().unwrap_or(0);
        self.stacks = OnceLock::from((stacks, most));
    }

    fn own_stack(&self, asset: AssetId) -> u32 {
        let key = self.assets.key(asset);
        key.and_then(|key| self.store.reached(&key)).map_or(0, |resident| resident.stack)
    }

    /// The view for chunks that need `stack_entries` below the top level.
    pub(crate) fn view(&self, stack_entries: u32) -> Result<SceneView, RenderError> {
        let Some(tables) = &self.tables else {
            return Err(RenderError::Internal("the scene's tables were not made".into()));
        };
        let view = SceneView {
            top_nodes: tables.top_nodes.address(),
            chunk_instances: tables.chunk_instances.address(),
            chunks: tables.chunks.address(),
            assemblies: tables.assemblies.address(),
            meshes: tables.meshes.address(),
            materials: tables.surfaces.as_ref().map_or(0, |surfaces| surfaces.materials.address()),
            prims: tables.surfaces.as_ref().map_or(0, |surfaces| surfaces.prims.address()),
            material_slots: tables.surfaces.as_ref().map_or(0, |surfaces| surfaces.slots.address()),
            programs: tables.surfaces.as_ref().and_then(|s| s.programs.as_ref()).map_or(0, HeapRange::address),
            has_cutouts: self.assets.masks.has_cutouts,
            not_native_cutouts: self.assets.masks.not_native,
            has_opacity_masks: !self.assets.masks.words.is_empty(),
            masks_answer_most: self.assets.masks.answer_most(),
            placed_values: tables.placed_values.as_ref().map_or(0, HeapRange::address),
            textures: tables.textures.as_ref().map_or(0, |textures| textures.records.address()),
            texture_pages: tables.textures.as_ref().map_or(0, |textures| textures.pages.address()),
            geometry_bytes: self.assets.geometry_bytes(),
            max_levels: self.levels(),
            top_stack: self.assets.top.stack,
            stack_size: 0,
        };
        Ok(view.with_stack(stack_entries))
    }
}
