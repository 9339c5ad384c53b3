// SPDX-License-Identifier: Apache-2.0
//! Carries out what the planner decides: starts loads, evicts, and shows units to the rays when everything they need is
//! resident.
//!
//! A unit is shown and hidden by its entry in the chunk table, written between two submissions: inside a submission
//! nothing appears or disappears. Memory of evicted assets is free when the submissions made before have ended. Render
//! thread only.

use super::reach::MappedUnits;
use crate::assets::{AssetStore, HostHeapFiller, MemoryWait, SceneAssets, SceneTables, TableEntries};
use crate::device::Device;
use crate::error::RenderError;
use oocpt_core::residency::{
    AssetId, LoadProposal, PlanError, PlannerOptions, PolicyKind, RayDemand, ResidencyCommand, ResidencyPlanner, UnitId,
};
use oocpt_gpu::{CommandList, Submission};
use rustc_hash::{FxHashMap, FxHashSet};
use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;

/// One part in so many of the budget may be in transit at a time: throughput is the bytes in transit over the time of a
/// load, about two steps.
const IN_FLIGHT_SHARE: u64 = 6;
/// Most bytes in transit at a time.
const MAX_BYTES_IN_FLIGHT: u64 = 2 << 30;

/// A load that the planner requested.
#[derive(Debug)]
struct PlannedLoad {
    unit: UnitId,
    /// Assets that have no memory yet.
    unplaced: VecDeque<AssetId>,
    /// Assets that this load has begun.
    begun: Vec<AssetId>,
}

/// The residency of a scene's units, as the planner decides it.
#[derive(Debug)]
pub(crate) struct SceneResidency<'a> {
    pub(super) device: &'a Device,
    pub(super) assets: Arc<SceneAssets>,
    pub(super) store: &'a mut AssetStore,
    entries: TableEntries,
    tables: &'a SceneTables,
    pub(crate) planner: ResidencyPlanner,
    /// Bytes for geometry and tiles; the planner may have less, to leave room for tiles.
    pub(super) budget: u64,
    /// Loads that wait for memory, in the planner's order.
    waiting: VecDeque<PlannedLoad>,
    /// The number of missing assets of every unit in transit.
    missing: FxHashMap<UnitId, usize>,
    /// The units that wait for each missing asset.
    dependents: FxHashMap<AssetId, Vec<UnitId>>,
    /// Assets in transit that nobody needs any more.
    orphans: FxHashSet<AssetId>,
    /// Entries to write before the next step.
    changed: Vec<AssetId>,
    copies: Vec<Arc<Submission>>,
    /// The chunks and meshes that rays read in host memory.
    pub(super) reach: Option<MappedUnits>,
    /// True if units that no ray has asked for are loaded into host memory too.
    pub(super) brings_rest: bool,
    /// True if all geometry is resident and the next passes rely on it: nothing is evicted any more.
    pub(super) stays: bool,
    pub(super) filler: Option<HostHeapFiller>,
    /// Units that the rays of the next step see for the first time.
    pub(crate) arrived: Vec<UnitId>,
    /// Traversal stack entries that the resident units need below the top level.
    pub(crate) stack_entries: u32,
    pub(crate) bytes_copied: u64,
    pub(crate) textures: TileStats,
}

/// The part of the planner's counters that concerns tiles of textures.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct TileStats {
    pub(crate) loads: u64,
    pub(crate) reloads: u64,
    pub(crate) bytes_loaded: u64,
    /// Bytes on the device now.
    pub(crate) bytes_held: u64,
}

/// The inputs of a residency.
pub(crate) struct ResidencyStart<'a> {
    pub(crate) device: &'a Device,
    pub(crate) assets: &'a Arc<SceneAssets>,
    pub(crate) store: &'a mut AssetStore,
    pub(crate) tables: &'a SceneTables,
    pub(crate) budget: u64,
    pub(crate) policy: PolicyKind,
    /// Allocates the memory in which rays may read chunks; `None` if they may not.
    pub(crate) filler: Option<HostHeapFiller>,
}

impl<'a> SceneResidency<'a> {
    /// Takes over the assets of earlier frames, as far as they fit `budget`; frees the rest.
    pub(crate) fn new(start: ResidencyStart<'a>) -> Result<Self, RenderError> {
        let ResidencyStart { device, assets, store, tables, budget, policy, filler } = start;
        let options = PlannerOptions {
            in_flight_bytes: (budget / IN_FLIGHT_SHARE).min(MAX_BYTES_IN_FLIGHT),
            pin_steps: 3,
            first_tile: Some(assets.tile_unit(0)),
        };
        let planner = ResidencyPlanner::with_policy(Arc::clone(&assets.catalog), budget, policy.policy(), options)
            .map_err(|error| plan_error(assets, &error))?;
        let mut residency = Self {
            device,
            assets: Arc::clone(assets),
            store,
            entries: TableEntries::new(assets),
            tables,
            planner,
            budget,
            waiting: VecDeque::new(),
            missing: FxHashMap::default(),
            dependents: FxHashMap::default(),
            orphans: FxHashSet::default(),
            changed: Vec::new(),
            copies: Vec::new(),
            reach: filler
                .is_some()
                .then(|| MappedUnits::new(assets.catalog.unit_count(), assets.geometry_count() as usize)),
            brings_rest: false,
            stays: false,
            filler,
            arrived: Vec::new(),
            stack_entries: 0,
            bytes_copied: 0,
            textures: TileStats::default(),
        };
        residency.take_over();
        Ok(residency)
    }

    fn take_over(&mut self) {
        let mut kept: FxHashSet<AssetId> = FxHashSet::default();
        let geometry: Vec<UnitId> = self.assets.geometry_units().collect();
        // There may be millions of tiles: only the resident ones are visited.
        let tiles = self.store.tiles().filter_map(|(image, tile)| self.assets.textures.number_of(image, tile));
        let mut tiles: Vec<UnitId> = tiles.map(|tile| self.assets.tile_unit(tile)).collect();
        tiles.sort_unstable();
        for unit in geometry.into_iter().chain(tiles.iter().copied()) {
            let complete = self.assets.catalog.assets(unit).iter().all(|&asset| self.is_ready(asset));
            if complete && self.planner.keep_resident(unit) {
                let closure: Vec<AssetId> = self.assets.catalog.assets(unit).to_vec();
                for &asset in &closure {
                    self.show(asset);
                }
                kept.extend(closure);
                self.grow_stack(unit);
                self.textures.bytes_held += self.bytes_of_tile(unit);
            }
        }
        let tiles = tiles.iter().map(|unit| self.assets.own_asset(*unit));
        let unused: Vec<AssetId> =
            self.assets.needed.iter().copied().chain(tiles).filter(|asset| !kept.contains(asset)).collect();
        unused.into_iter().for_each(|asset| self.let_go(asset));
        self.take_over_mapped();
    }

    fn is_ready(&self, asset: AssetId) -> bool {
        self.assets.key(asset).is_some_and(|key| self.store.get(&key).is_some())
    }

    /// Sets the table entry of a ready asset, in host memory if it is not on the device.
    pub(super) fn show(&mut self, asset: AssetId) {
        let key = self.assets.key(asset);
        if let Some(resident) = key.and_then(|key| self.store.reached(&key)) {
            self.entries.set(&self.assets, asset, resident.address());
            self.changed.push(asset);
        }
    }

    pub(super) fn grow_stack(&mut self, unit: UnitId) {
        let own = |asset: AssetId| {
            let key = self.assets.key(asset);
            key.and_then(|key| self.store.reached(&key)).map_or(0, |found| found.stack)
        };
        self.stack_entries = self.stack_entries.max(self.assets.stack_of(unit, own));
    }

    /// Asks the planner what to do about `demand`, and begins to do it; units that rays wait for are loaded only if
    /// `agrees` returns true.
    pub(crate) fn plan(
        &mut self,
        demand: &RayDemand<'_>,
        agrees: &mut dyn FnMut(&LoadProposal) -> bool,
    ) -> Result<(), RenderError> {
        let mut demand = *demand;
        if self.stays {
            demand.keep_below = self.assets.tile_unit(0);
        } else {
            self.map_demanded(&demand)?;
        }
        let commands = match &mut self.reach {
            Some(reach) => self.planner.step_if(&reach.demand(&demand), agrees),
            None => self.planner.step_if(&demand, agrees),
        };
        for command in commands {
            match command {
                ResidencyCommand::Evict { unit, assets } => self.evict(unit, &assets),
                ResidencyCommand::Load { unit, assets } => self.begin(unit, assets),
            }
        }
        self.place_waiting()
    }

    /// Bytes of a unit that is a tile, 0 of others.
    fn bytes_of_tile(&self, unit: UnitId) -> u64 {
        if self.assets.is_tile(unit) { self.assets.catalog.closure_bytes(unit) } else { 0 }
    }

    fn evict(&mut self, unit: UnitId, assets: &[AssetId]) {
        // A failed load may have brought none of its assets.
        if assets.iter().any(|&asset| self.is_ready(asset)) {
            self.textures.bytes_held = self.textures.bytes_held.saturating_sub(self.bytes_of_tile(unit));
        }
        for &asset in assets {
            self.let_go(asset);
        }
        let own = self.assets.own_asset(unit);
        let is_reached = self.reach.as_ref().is_some_and(|reach| reach.is_there(unit));
        for &asset in assets.iter().chain((!assets.contains(&own)).then_some(&own)) {
            let is_mapped = self.assets.key(asset).is_some_and(|key| self.store.mapped(&key).is_some());
            // Other chunks may read it in host memory; the unit's own asset is shown when all that it needs is
            // resident.
            if is_mapped && (asset != own || is_reached) {
                self.show(asset);
            } else {
                self.entries.clear(&self.assets, asset);
                self.changed.push(asset);
            }
        }
    }

    /// Frees an asset once the submissions made so far have ended.
    fn let_go(&mut self, asset: AssetId) {
        if let Some(key) = self.assets.key(asset) {
            self.store.evict(&key);
        }
    }

    fn begin(&mut self, unit: UnitId, assets: Vec<AssetId>) {
        let mut missing = 0;
        for &asset in self.assets.catalog.assets(unit) {
            if !self.is_ready(asset) {
                missing += 1;
                self.dependents.entry(asset).or_default().push(unit);
            }
        }
        self.missing.insert(unit, missing);
        self.waiting.push_back(PlannedLoad { unit, unplaced: assets.into(), begun: Vec::new() });
    }

    /// Allocates memory for the waiting loads, in order, as far as there is any, and starts them.
    fn place_waiting(&mut self) -> Result<(), RenderError> {
        self.place()?;
        self.store.send(self.device)
    }

    fn place(&mut self) -> Result<(), RenderError> {
        while let Some(mut load) = self.waiting.pop_front() {
            while let Some(asset) = load.unplaced.pop_front() {
                // The asset may be in transit for another load, or have arrived since this one was queued.
                if self.orphans.remove(&asset) || self.is_ready(asset) {
                    continue;
                }
                if self.begins(asset)? {
                    load.begun.push(asset);
                    continue;
                }
                load.unplaced.push_front(asset);
                // Orphans are dropped as soon as they have arrived.
                if self.device.heap.stats().retired_bytes == 0 && self.orphans.is_empty() {
                    self.give_up(load);
                    return Ok(());
                }
                self.waiting.push_front(load);
                return Ok(());
            }
            self.finish_if_ready(load.unit);
        }
        Ok(())
    }

    /// Starts to load an asset; for one that is too large for arenas, empty arenas are freed if need be.
    fn begins(&mut self, asset: AssetId) -> Result<bool, RenderError> {
        let Self { device, assets, store, .. } = self;
        if store.begin(device, assets, asset, MemoryWait::Now)? {
            return Ok(true);
        }
        if assets.catalog.bytes(asset) <= device.heap.largest_shared() {
            return Ok(false);
        }
        device.heap.trim();
        store.begin(device, assets, asset, MemoryWait::Now)
    }

    /// Gives up a load for which there is no memory although nothing is about to be freed: the planner must make room.
    /// The loads after it stay: given up as well, they would teach the planner that far less fits than does.
    fn give_up(&mut self, load: PlannedLoad) {
        tracing::debug!(unit = load.unit, "no memory for a unit");
        self.missing.remove(&load.unit);
        for asset in load.begun {
            if self.is_ready(asset) {
                self.let_go(asset);
            } else {
                self.orphans.insert(asset);
            }
        }
        for &asset in self.assets.catalog.assets(load.unit) {
            if let Some(units) = self.dependents.get_mut(&asset) {
                units.retain(|unit| *unit != load.unit);
            }
        }
        self.planner.failed(load.unit);
    }

    /// Takes in what has arrived; waits at most `wait` if there is nothing else to do.
    pub(crate) fn advance(&mut self, wait: Duration) -> Result<(), RenderError> {
        let arrived = self.store.advance(&self.assets, wait)?;
        self.bytes_copied += arrived.bytes;
        self.copies.extend(arrived.copies);
        for asset in arrived.mapped {
            self.mapped(asset);
        }
        for asset in arrived.ready {
            self.arrived(asset);
        }
        self.place_waiting()
    }

    fn arrived(&mut self, asset: AssetId) {
        let units = self.dependents.remove(&asset).unwrap_or_default();
        if self.orphans.remove(&asset) && units.is_empty() {
            return self.let_go(asset);
        }
        for unit in units {
            if let Some(missing) = self.missing.get_mut(&unit) {
                *missing = missing.saturating_sub(1);
            }
            self.finish_if_ready(unit);
        }
    }

    fn finish_if_ready(&mut self, unit: UnitId) {
        if self.missing.get(&unit) != Some(&0) {
            return;
        }
        self.missing.remove(&unit);
        let closure: Vec<AssetId> = self.assets.catalog.assets(unit).to_vec();
        for asset in closure {
            self.show(asset);
        }
        self.grow_stack(unit);
        let tile_bytes = self.bytes_of_tile(unit);
        if tile_bytes > 0 {
            self.textures.loads += 1;
            self.textures.reloads += u64::from(self.planner.load_count(unit) > 0);
            self.textures.bytes_loaded += tile_bytes;
            self.textures.bytes_held += tile_bytes;
        }
        self.arrived.push(unit);
        self.planner.loaded(unit);
    }

    /// Returns true if anything is in transit.
    pub(crate) fn is_loading(&self) -> bool {
        self.store.in_flight() > 0 || !self.waiting.is_empty()
    }

    /// Assets that the loader is bringing.
    pub(crate) fn coming(&self) -> usize {
        self.store.in_flight() + self.store.mapping()
    }

    /// Records the table entries that have changed since the last step.
    pub(crate) fn record(&mut self, commands: &mut CommandList) {
        for copy in self.copies.drain(..) {
            commands.wait_for(&copy);
        }
        self.arrived.clear();
        let mut changed = std::mem::take(&mut self.changed);
        changed.sort_unstable();
        changed.dedup();
        commands.concurrent(|c| {
            self.tables.update(c, &self.assets, &self.entries, &changed);
        });
    }

    /// Returns true if the next step would write table entries.
    pub(crate) fn has_changes(&self) -> bool {
        !self.changed.is_empty()
    }
}

/// Converts a plan error: units that do not fit together are the one thing no planner can help.
fn plan_error(assets: &SceneAssets, error: &PlanError) -> RenderError {
    match *error {
        PlanError::TooLarge { units, bytes, budget } => {
            let parts: Vec<String> = units.into_iter().flatten().map(|unit| assets.describe(unit)).collect();
            RenderError::PartsTooLarge { parts: parts.join(" and "), bytes, budget }
        }
    }
}
