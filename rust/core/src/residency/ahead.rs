// SPDX-License-Identifier: Apache-2.0
//! Starts loads besides the most valuable ones: units that few rays wait for, while there is room, and units that rays
//! will ask for next.

use super::entry::UnitState;
use super::planner::{LoadKind, ResidencyPlanner};
use super::policy::top;
use super::step::{DemandPlan, LoadOutcome, LoadPriority, PREFETCH_SHARE, for_each_nonzero};
use super::{UnitId, at};

/// Bytes in flight up to which units with few waiting rays are loaded: some for each thread that loads, and no more,
/// because later demand would have to wait for them.
const ROOMY_IN_FLIGHT: u64 = 256 << 20;
/// Number of units with few rays that are tried in a step.
const ROOMY: usize = 1024;
/// Number of prefetches that are tried in a step.
const PREFETCHES: usize = 256;

impl ResidencyPlanner {
    /// Loads all units that rays wait for, as far as there is free room: they will be asked for until they are loaded,
    /// at the latest by the last rays of a render, which have nothing else to do.
    pub(super) fn fill_room(&mut self, plan: &mut DemandPlan<'_>) {
        let limit = ROOMY_IN_FLIGHT.min(self.in_flight_limit(plan));
        if self.in_flight[LoadKind::Demanded as usize] >= limit {
            return;
        }
        let absent = |unit: &UnitId| self.entries[*unit as usize].state == UnitState::Absent;
        if self.holdings.held() >= self.allowance {
            return;
        }
        let wanted: Vec<UnitId> = plan.demanded.iter().copied().filter(absent).collect();
        let rays = |unit: &UnitId| (f64::from(at(plan.demand.waiting, *unit)), *unit);
        for (_, unit) in top(wanted.iter().map(rays).collect(), ROOMY) {
            // The value is 0, so that nothing is evicted for it.
            let tried = self.try_load(plan, unit, LoadPriority::Worth(0.0));
            if tried == LoadOutcome::Full || self.in_flight[LoadKind::Demanded as usize] >= limit {
                break;
            }
        }
    }

    /// Loads units that rays have further down their lists, when everything demanded is in flight.
    pub(super) fn prefetch(&mut self, plan: &mut DemandPlan<'_>) {
        if self.in_flight[LoadKind::Prefetch as usize] >= self.in_flight_limit(plan) / PREFETCH_SHARE {
            return;
        }
        let mut wanted = Vec::new();
        for_each_nonzero(plan.demand.requested, plan.demand.next, self.entries.len(), |unit, rays| {
            let absent = self.entries[unit as usize].state == UnitState::Absent;
            if absent && at(plan.demand.waiting, unit) == 0 {
                wanted.push((f64::from(rays), unit));
            }
        });
        let view = self.view(plan.demand);
        let value = |(_, unit)| self.policy.prefetch(&view, unit).map(|value| (value, unit));
        let values = top(wanted, PREFETCHES).into_iter().filter_map(value).collect();
        for (value, unit) in top(values, PREFETCHES) {
            if self.try_load(plan, unit, LoadPriority::Ahead(value)) == LoadOutcome::Full {
                break;
            }
        }
    }

    /// Returns true if, with everything held now, demanded loads still find room for all that may be in flight and one
    /// unit more: in free bytes and in those that only unpinned units hold.
    pub(super) fn leaves_room(&self, plan: &DemandPlan<'_>) -> bool {
        let reserve = self.in_flight_limit(plan).saturating_add(self.largest);
        let mut missing = self.holdings.held().saturating_add(reserve).saturating_sub(self.allowance);
        let mut unpinned = self.residents.iter().filter(|&&unit| self.is_unpinned(unit));
        while missing > 0 {
            let Some(&unit) = unpinned.next() else { return false };
            missing = missing.saturating_sub(self.holdings.exclusive(unit));
        }
        true
    }
}
