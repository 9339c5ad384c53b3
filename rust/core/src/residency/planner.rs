// SPDX-License-Identifier: Apache-2.0
//! The planner's public interface: construction, reports of the caller, queries. Planning itself is in `step`.

use super::entry::{UnitEntry, UnitState};
use super::holdings::AssetHoldings;
use super::policy::{LoadPolicy, PolicyKind};
use super::{AssetId, ResidencyCommand, ResidencyStats, UnitCatalog, UnitId};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Reason why a budget was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PlanError {
    /// The budget is smaller than units that must be resident together.
    #[error("units {units:?} need {bytes} bytes of device memory at once, the budget is {budget}")]
    TooLarge {
        /// The largest base and the largest other unit, as far as they exist, or a unit that stands alone.
        units: [Option<UnitId>; 2],
        /// Bytes of these units with all their assets.
        bytes: u64,
        /// The budget, bytes.
        budget: u64,
    },
}

/// Settings of a planner that depend on the device rather than on the scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PlannerOptions {
    /// Bytes of demanded loads in flight at a time (one load is always allowed; four times as many if the device would
    /// idle). 0 = an eighth of the budget (half of it when idle), at most 128 MiB. With fewer bytes demand is read
    /// again sooner.
    pub in_flight_bytes: u64,
    /// Number of steps that see a unit usable before it may be evicted, 0 = 2: with one submission in flight the first
    /// step after a load still sees the earlier demand. Each further submission in flight needs one more.
    pub pin_steps: u32,
    /// Units from this one on are tiles of textures, whose visits are not counted. They are kept while they take less
    /// than a third of the budget and leave room for the least budget. `None` = there are none.
    pub first_tile: Option<UnitId>,
}

/// A load in flight.
#[derive(Clone, Debug)]
pub(super) struct UnitLoad {
    pub(super) unit: UnitId,
    pub(super) assets: Vec<AssetId>,
    pub(super) bytes: u64,
    pub(super) kind: LoadKind,
}

/// Reason why a load was begun.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum LoadKind {
    Demanded = 0,
    Prefetch = 1,
}

/// Decides which units are on the device, step by step.
#[derive(Debug)]
pub struct ResidencyPlanner {
    pub(super) catalog: Arc<UnitCatalog>,
    pub(super) policy: Box<dyn LoadPolicy>,
    pub(super) options: PlannerOptions,
    pub(super) budget: u64,
    /// Bytes that loads may fill: the budget, or less for a while after a failed load.
    pub(super) allowance: u64,
    pub(super) largest: u64,
    /// Bytes of texture tiles that are held.
    tile_bytes: u64,
    pub(super) entries: Vec<UnitEntry>,
    pub(super) holdings: AssetHoldings,
    pub(super) residents: Vec<UnitId>,
    pub(super) loading: BTreeMap<UnitId, UnitLoad>,
    /// Pairs of units that are kept until rays could use them together.
    pub(super) pairs: Vec<[UnitId; 2]>,
    /// Two units that starve together, one of which has no room yet.
    pub(super) owed: Option<[UnitId; 2]>,
    /// Evictions with which the next step begins: assets of failed loads that had been on the device.
    pub(super) dropped: Vec<ResidencyCommand>,
    pub(super) stats: ResidencyStats,
    pub(super) step: u32,
    pub(super) loads_begun: u32,
    /// Bytes of loads in flight: demanded ones, and prefetches.
    pub(super) in_flight: [u64; 2],
    /// Index in `residents` at which the next search for victims begins.
    pub(super) hand: usize,
}

impl ResidencyPlanner {
    /// Creates a planner with nothing resident. An error if units that rays need at once do not fit the budget.
    pub fn new(catalog: Arc<UnitCatalog>, budget: u64, kind: PolicyKind) -> Result<Self, PlanError> {
        Self::with_policy(catalog, budget, kind.policy(), PlannerOptions::default())
    }

    /// As [`Self::new`], with a given policy and options.
    pub fn with_policy(
        catalog: Arc<UnitCatalog>,
        budget: u64,
        policy: Box<dyn LoadPolicy>,
        options: PlannerOptions,
    ) -> Result<Self, PlanError> {
        let largest = check_budget(&catalog, budget)?;
        Ok(Self {
            policy,
            options,
            budget,
            allowance: budget,
            largest,
            tile_bytes: 0,
            entries: vec![UnitEntry::default(); catalog.unit_count()],
            holdings: AssetHoldings::new(&catalog),
            residents: Vec::new(),
            loading: BTreeMap::new(),
            pairs: Vec::new(),
            owed: None,
            dropped: Vec::new(),
            stats: ResidencyStats::default(),
            step: 0,
            loads_begun: 0,
            in_flight: [0; 2],
            hand: 0,
            catalog,
        })
    }

    /// Notes, at the start or after an edit, that the unit's content is on the device already. Returns `false`, and the
    /// caller frees it, if the unit is unknown or does not fit the budget beside what is held. The caller also frees
    /// content of which [`Self::holds`] is false once all units are kept.
    pub fn keep_resident(&mut self, unit: UnitId) -> bool {
        match self.state(unit) {
            UnitState::Resident => return true,
            UnitState::Loading => return false,
            UnitState::Absent | UnitState::Requested => {}
        }
        let Some(missing) = self.holdings.missing(&self.catalog, unit) else { return false };
        if unit as usize >= self.entries.len() || self.holdings.held() + missing > self.budget {
            return false;
        }
        let mut new = Vec::new();
        self.holdings.acquire(&self.catalog, unit, &mut new);
        self.holdings.arrived(&self.catalog, &new);
        self.count_tile(unit);
        self.stats.peak_bytes = self.stats.peak_bytes.max(self.holdings.held());
        self.become_resident(unit);
        true
    }

    /// Notes that a load is done: the unit is in the unit table of the next submission. Ignored for a unit that is not
    /// loading.
    pub fn loaded(&mut self, unit: UnitId) {
        let Some(load) = self.take_load(unit) else { return };
        let again = self.holdings.arrived(&self.catalog, &load.assets);
        self.stats.loads += 1;
        self.stats.bytes_loaded += load.bytes;
        self.stats.bytes_reloaded += again;
        self.stats.failures_in_a_row = 0;
        let loads = self.entries[unit as usize].loads;
        self.stats.reloads += u64::from(loads > 0);
        self.stats.prefetches += u64::from(load.kind == LoadKind::Prefetch);
        self.become_resident(unit);
        self.entries[unit as usize].loads = loads.saturating_add(1);
        if load.kind == LoadKind::Prefetch && !self.is_demanded(unit) {
            self.entries[unit as usize].usable = self.step.wrapping_sub(self.pin_steps());
        }
        self.allowance += (self.budget.saturating_sub(self.allowance)).div_ceil(RECOVERY);
    }

    /// Notes that a load found no memory. Nothing of the load is on the device; assets that the unit shared with
    /// evicted ones are freed by the next step's first commands. The planner fills less until loads succeed again, and
    /// tries this unit again after some steps. Ignored for a unit that is not loading.
    pub fn failed(&mut self, unit: UnitId) {
        let Some(load) = self.take_load(unit) else { return };
        self.holdings.set_in_flight(&load.assets, false);
        let mut freed = Vec::new();
        self.holdings.release(&self.catalog, unit, &mut freed);
        self.count_tile_gone(unit);
        freed.retain(|asset| load.assets.binary_search(asset).is_err());
        if !freed.is_empty() {
            self.dropped.push(ResidencyCommand::Evict { unit, assets: freed });
        }
        self.stats.failed_loads += 1;
        self.stats.failures_in_a_row += 1;
        let pause = 1_u32 << self.stats.failures_in_a_row.min(MAX_PAUSE_LOG2);
        let entry = &mut self.entries[unit as usize];
        entry.state = UnitState::Absent;
        entry.retry = self.step.wrapping_add(pause);
        self.allowance = self.holdings.held().min(self.allowance);
        self.count_bytes();
    }

    /// Sets another budget. The next step evicts what exceeds it. An error, and no change, if a unit does not fit.
    pub fn set_budget(&mut self, budget: u64) -> Result<(), PlanError> {
        check_budget(&self.catalog, budget)?;
        self.budget = budget;
        self.allowance = budget;
        Ok(())
    }

    /// The budget in bytes.
    pub fn budget(&self) -> u64 {
        self.budget
    }

    /// The catalog.
    pub fn catalog(&self) -> &Arc<UnitCatalog> {
        &self.catalog
    }

    /// Totals since the planner was made.
    pub fn stats(&self) -> &ResidencyStats {
        &self.stats
    }

    /// State of a unit; `Absent` for an unknown one.
    pub fn state(&self, unit: UnitId) -> UnitState {
        match self.entries.get(unit as usize) {
            Some(entry) if entry.state == UnitState::Absent && self.is_demanded(unit) => UnitState::Requested,
            Some(entry) => entry.state,
            None => UnitState::Absent,
        }
    }

    /// Returns true if the unit is usable.
    pub fn is_resident(&self, unit: UnitId) -> bool {
        self.state(unit) == UnitState::Resident
    }

    /// Returns true if the asset is on the device or being loaded.
    pub fn holds(&self, asset: AssetId) -> bool {
        self.holdings.is_held(asset)
    }

    /// Number of loads of the unit that completed.
    pub fn load_count(&self, unit: UnitId) -> u32 {
        self.entries.get(unit as usize).map_or(0, |entry| entry.loads)
    }

    /// The usable units, in no meaningful order (but the same for the same calls).
    pub fn resident_units(&self) -> &[UnitId] {
        &self.residents
    }

    pub(super) fn pin_steps(&self) -> u32 {
        if self.options.pin_steps == 0 { DEFAULT_PIN_STEPS } else { self.options.pin_steps }
    }

    /// Returns true if the last step saw rays that wait for the unit.
    pub(super) fn is_demanded(&self, unit: UnitId) -> bool {
        self.step != 0 && self.entries[unit as usize].seen == self.step
    }

    fn bytes_of_tile(&self, unit: UnitId) -> u64 {
        let is_tile = self.options.first_tile.is_some_and(|first| unit >= first);
        if is_tile { self.catalog.closure_bytes(unit) } else { 0 }
    }

    pub(super) fn count_tile(&mut self, unit: UnitId) {
        self.tile_bytes += self.bytes_of_tile(unit);
    }

    pub(super) fn count_tile_gone(&mut self, unit: UnitId) {
        self.tile_bytes = self.tile_bytes.saturating_sub(self.bytes_of_tile(unit));
    }

    /// Bytes that tiles may take before one of them is evicted. Failed loads lower it, so that tiles do not keep memory
    /// fragmented for ever.
    fn tile_share(&self) -> u64 {
        (self.budget / TILE_SHARE).min(self.allowance.saturating_sub(self.largest))
    }

    /// Bytes of tiles for which other units may be evicted.
    pub fn room_for_tiles(&self) -> u64 {
        self.tile_share().saturating_sub(self.tile_bytes)
    }

    /// Returns true if the unit is a tile and tiles take so little that none is evicted.
    pub(super) fn is_tile_to_stay(&self, unit: UnitId) -> bool {
        self.options.first_tile.is_some_and(|first| unit >= first) && self.tile_bytes <= self.tile_share()
    }

    pub(super) fn count_bytes(&mut self) {
        self.stats.bytes_held = self.holdings.held();
        self.stats.bytes_in_flight = self.in_flight.iter().sum();
        self.stats.resident_units = self.residents.len() as u64;
    }

    fn take_load(&mut self, unit: UnitId) -> Option<UnitLoad> {
        let load = self.loading.remove(&unit)?;
        let bytes = &mut self.in_flight[load.kind as usize];
        *bytes -= load.bytes;
        Some(load)
    }

    fn become_resident(&mut self, unit: UnitId) {
        let slot = u32::try_from(self.residents.len()).unwrap_or(u32::MAX);
        self.residents.push(unit);
        let entry = &mut self.entries[unit as usize];
        self.stats.units_touched += u64::from(!entry.touched);
        entry.touched = true;
        entry.state = UnitState::Resident;
        entry.slot = slot;
        entry.usable = self.step;
        entry.heat = entry.heat_at(self.step);
        entry.used = self.step;
        self.count_bytes();
    }
}

const DEFAULT_PIN_STEPS: u32 = 2;
/// Texture tiles stay below one in so many bytes of the budget.
const TILE_SHARE: u64 = 3;
/// A completed load restores one in so many bytes that failures took from the allowance.
const RECOVERY: u64 = 128;
/// Base-2 logarithm of the longest pause after failures, in steps.
const MAX_PAUSE_LOG2: u64 = 4;

/// Bytes of the largest units that rays need at once, if they fit.
fn check_budget(catalog: &UnitCatalog, budget: u64) -> Result<u64, PlanError> {
    let (units, bytes) = catalog.largest();
    if bytes <= budget {
        return Ok(bytes);
    }
    Err(PlanError::TooLarge { units, bytes, budget })
}
