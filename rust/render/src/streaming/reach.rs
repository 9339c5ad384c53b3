// SPDX-License-Identifier: Apache-2.0
//! Chunks, meshes and tiles that rays read in host memory, across the bus, while the device has no room for them: no
//! ray waits for these. The most visited ones are promoted to the device (`ResidencyPlanner`), the evicted ones are
//! read in host memory again.
//!
//! A unit is readable when all assets of its closure lie in host memory. Pure bookkeeping.

use oocpt_core::residency::{AssetId, RayDemand, UnitId};
use rustc_hash::FxHashMap;

/// The state of a unit on its way into host memory.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum MappingState {
    #[default]
    Absent,
    /// So many of its assets have not arrived yet.
    Coming(usize),
    There,
}

/// The units in host memory and those in transit.
#[derive(Debug, Default)]
pub(super) struct MappedUnits {
    states: Vec<MappingState>,
    /// Units that wait for an asset.
    dependents: FxHashMap<AssetId, Vec<UnitId>>,
    /// True by unit if it is in host memory, for the planner.
    mapped: Vec<bool>,
    /// Rays that wait for each unit and cannot read it.
    waiting: Vec<u32>,
    /// Units for which `waiting` is not 0.
    requested: Vec<UnitId>,
    /// Rays that entered each unit since the step before.
    visits: Vec<u32>,
    /// Rays that had entered each unit by then, modulo 2^32.
    counted: Vec<u32>,
}

impl MappedUnits {
    /// Begins with none of so many units in host memory; the first `geometry` of them are chunks and meshes, whose
    /// visits are counted.
    pub(super) fn new(units: usize, geometry: usize) -> Self {
        Self {
            states: vec![MappingState::Absent; units],
            mapped: vec![false; units],
            visits: vec![0; geometry],
            counted: vec![0; geometry],
            ..Self::default()
        }
    }

    /// Restarts the counts at 0.
    pub(super) fn begin(&mut self) {
        self.counted.fill(0);
    }

    /// Returns true if rays can read the unit in host memory.
    pub(super) fn is_there(&self, unit: UnitId) -> bool {
        self.mapped.get(unit as usize) == Some(&true)
    }

    /// Returns true if the unit is neither in host memory nor in transit.
    pub(super) fn is_absent(&self, unit: UnitId) -> bool {
        self.states.get(unit as usize) == Some(&MappingState::Absent)
    }

    /// Notes that a unit becomes readable as soon as these assets arrive.
    pub(super) fn expect(&mut self, unit: UnitId, missing: &[AssetId]) {
        for &asset in missing {
            self.dependents.entry(asset).or_default().push(unit);
        }
        self.set(unit, if missing.is_empty() { MappingState::There } else { MappingState::Coming(missing.len()) });
    }

    fn set(&mut self, unit: UnitId, state: MappingState) {
        let at = unit as usize;
        if let (Some(known), Some(mapped)) = (self.states.get_mut(at), self.mapped.get_mut(at)) {
            (*known, *mapped) = (state, state == MappingState::There);
        }
    }

    /// Takes in an asset; returns the units that it completes.
    pub(super) fn arrived(&mut self, asset: AssetId) -> Vec<UnitId> {
        let mut there = Vec::new();
        for unit in self.dependents.remove(&asset).unwrap_or_default() {
            let Some(MappingState::Coming(missing)) = self.states.get(unit as usize).copied() else { continue };
            let left = missing.saturating_sub(1);
            self.set(unit, if left == 0 { MappingState::There } else { MappingState::Coming(left) });
            if left == 0 {
                there.push(unit);
            }
        }
        there
    }

    /// Takes in the number of rays that have entered each unit since the counts began.
    pub(super) fn count(&mut self, counts: &[u32]) {
        for ((visits, counted), count) in self.visits.iter_mut().zip(&mut self.counted).zip(counts) {
            *visits = count.wrapping_sub(*counted);
            *counted = *count;
        }
    }

    /// The demand for the planner: no ray waits for a unit that is in host memory or in transit.
    pub(super) fn demand<'a>(&'a mut self, demand: &RayDemand<'a>) -> RayDemand<'a> {
        for unit in self.requested.drain(..) {
            if let Some(rays) = self.waiting.get_mut(unit as usize) {
                *rays = 0;
            }
        }
        self.waiting.resize(demand.waiting.len(), 0);
        for &unit in demand.requested.unwrap_or_default() {
            let at = unit as usize;
            let comes = self.states.get(at).is_some_and(|state| *state != MappingState::Absent);
            if let (false, Some(rays), Some(waiting)) = (comes, self.waiting.get_mut(at), demand.waiting.get(at)) {
                *rays = *waiting;
                self.requested.push(unit);
            }
        }
        RayDemand {
            waiting: &self.waiting,
            requested: Some(&self.requested),
            visits: &self.visits,
            mapped: &self.mapped,
            ..*demand
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_unit_is_reachable_when_all_its_assets_are_resident() {
        let mut reach = MappedUnits::new(3, 3);
        reach.expect(0, &[7, 8]);
        reach.expect(2, &[8]);
        assert_eq!([0, 1, 2].map(|unit| reach.is_absent(unit)), [false, true, false], "on their way");
        assert_eq!(reach.arrived(8), [2], "the other one lacks an asset");
        assert_eq!((reach.is_there(0), reach.is_there(2)), (false, true));
        assert_eq!(reach.arrived(7), [0]);
        assert_eq!(reach.arrived(7), [0; 0], "nobody waits any more");
        reach.expect(1, &[]);
        assert!(reach.is_there(1), "nothing was missing");
        assert!(!reach.is_there(3) && !reach.is_absent(3), "no such unit");
    }

    #[test]
    fn units_in_flight_are_removed_from_demand() {
        let mut reach = MappedUnits::new(3, 3);
        reach.expect(1, &[5]);
        let demand =
            RayDemand { waiting: &[1, 2, 3, 4], requested: Some(&[0, 1, 3]), active: 9, ..RayDemand::default() };
        let requested = reach.demand(&demand);
        assert_eq!(
            (requested.waiting, requested.requested, requested.active),
            (&[1, 0, 0, 4][..], Some(&[0, 3][..]), 9)
        );
        let _ = reach.arrived(5);
        let demand = RayDemand { waiting: &[0, 2, 3, 0], requested: Some(&[1, 2]), ..demand };
        let requested = reach.demand(&demand);
        assert_eq!(
            (requested.waiting, requested.mapped),
            (&[0, 0, 3, 0][..], &[false, true, false][..]),
            "of this step alone"
        );
    }

    #[test]
    fn visit_counts_come_from_the_last_step() {
        let mut reach = MappedUnits::new(2, 2);
        reach.count(&[5, u32::MAX]);
        reach.count(&[7, 3]);
        assert_eq!(reach.visits, [2, 4], "counts wrap");
        reach.begin();
        reach.count(&[1]);
        assert_eq!(reach.visits[0], 1, "a new stage");
    }
}
