// SPDX-License-Identifier: Apache-2.0
//! What a policy may look at during a step.

use super::super::entry::UnitEntry;
use super::super::holdings::AssetHoldings;
use super::super::{RayDemand, UnitCatalog, UnitId, at};

/// The planner's state as a policy sees it. Ids are valid units.
#[derive(Debug)]
pub struct PolicyView<'a> {
    pub(in super::super) catalog: &'a UnitCatalog,
    pub(in super::super) demand: RayDemand<'a>,
    pub(in super::super) entries: &'a [UnitEntry],
    pub(in super::super) holdings: &'a AssetHoldings,
    pub(in super::super) step: u32,
}

impl PolicyView<'_> {
    /// The catalog.
    pub fn catalog(&self) -> &UnitCatalog {
        self.catalog
    }

    /// Rays that wait for the unit.
    pub fn waiting(&self, unit: UnitId) -> u32 {
        at(self.demand.waiting, unit)
    }

    /// A unit that rays need at the same time as this one, one of several.
    pub fn partner(&self, unit: UnitId) -> Option<UnitId> {
        at(self.demand.partners, unit).checked_sub(1)
    }

    /// No ray can be traced: the device waits for loads.
    pub fn is_idle(&self) -> bool {
        self.demand.active == 0
    }

    /// Rays that have the unit further down their list.
    pub fn next(&self, unit: UnitId) -> u32 {
        at(self.demand.next, unit)
    }

    /// Rays that visited the unit since the last step, if the caller counts them.
    pub fn visits(&self, unit: UnitId) -> u32 {
        at(self.demand.visits, unit)
    }

    /// Rays that needed the unit lately, halved every 16 steps.
    pub fn heat(&self, unit: UnitId) -> f64 {
        f64::from(self.entries[unit as usize].heat_at(self.step))
    }

    /// Steps for which rays have waited for the unit without a gap.
    pub fn waited_steps(&self, unit: UnitId) -> u32 {
        self.step.wrapping_sub(self.entries[unit as usize].since)
    }

    /// Steps since the unit was last waited for, visited or loaded.
    pub fn idle_steps(&self, unit: UnitId) -> u32 {
        self.step.wrapping_sub(self.entries[unit as usize].used)
    }

    /// Steps since the unit became usable; for resident units.
    pub fn resident_steps(&self, unit: UnitId) -> u32 {
        self.step.wrapping_sub(self.entries[unit as usize].usable)
    }

    /// Bytes a load would bring, `None` while one of its assets is on its way for another unit. Costs its assets.
    pub fn missing_bytes(&self, unit: UnitId) -> Option<u64> {
        self.holdings.missing(self.catalog, unit)
    }

    /// Bytes an eviction would free.
    pub fn exclusive_bytes(&self, unit: UnitId) -> u64 {
        self.holdings.exclusive(unit)
    }
}
