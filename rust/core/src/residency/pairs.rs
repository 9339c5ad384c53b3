// SPDX-License-Identifier: Apache-2.0
//! Units that rays need at the same time, such as a mesh and the chunk that places it. A ray gets on once both are
//! usable: so while one is loaded, the other one stays, and both stay until steps have seen them together.

use super::entry::UnitState;
use super::planner::ResidencyPlanner;
use super::step::{DemandPlan, LoadOutcome, LoadPriority};
use super::{RayDemand, UnitId, at};

impl ResidencyPlanner {
    /// What rays that wait for a unit need with it.
    pub(super) fn partner(&self, demand: &RayDemand<'_>, unit: UnitId) -> Option<UnitId> {
        let partner = at(demand.partners, unit).checked_sub(1)?;
        ((partner as usize) < self.entries.len() && partner != unit).then_some(partner)
    }

    /// Whether the unit is on the device or on its way.
    pub(super) fn is_held(&self, unit: UnitId) -> bool {
        matches!(self.entries[unit as usize].state, UnitState::Loading | UnitState::Resident)
    }

    /// Keeps a unit from going, once more.
    pub(super) fn hold(&mut self, unit: UnitId) {
        self.entries[unit as usize].holds += 1;
    }

    /// Undoes a [`Self::hold`].
    pub(super) fn let_go(&mut self, unit: UnitId) {
        self.entries[unit as usize].holds -= 1;
    }

    /// Begins to load a unit, beside what rays need with it.
    pub(super) fn try_load(&mut self, plan: &mut DemandPlan<'_>, unit: UnitId, press: LoadPriority) -> LoadOutcome {
        let partner = self.partner(&plan.demand, unit).filter(|partner| self.is_held(*partner));
        let partner = partner.filter(|_| !matches!(press, LoadPriority::Ahead(_)));
        partner.into_iter().for_each(|partner| self.hold(partner));
        let tried = self.try_load_beside(plan, unit, partner, press);
        match partner {
            Some(partner) if tried == LoadOutcome::Issued => {
                self.hold(unit);
                self.pairs.push([unit, partner]);
            }
            partner => partner.into_iter().for_each(|partner| self.let_go(partner)),
        }
        tried
    }

    /// Lets go of pairs that rays could use, and of those that came apart: after a failed load, or because the budget
    /// was lowered. Cost: the loads under way.
    pub(super) fn settle_pairs(&mut self) {
        let pairs = std::mem::take(&mut self.pairs);
        for pair in pairs {
            let is_apart = pair.iter().any(|unit| !self.is_held(*unit));
            let is_used = |unit: &UnitId| {
                let entry = &self.entries[*unit as usize];
                entry.state == UnitState::Resident && self.step.wrapping_sub(entry.usable) >= self.pin_steps()
            };
            if is_apart || pair.iter().all(is_used) {
                pair.into_iter().for_each(|unit| self.let_go(unit));
            } else {
                self.pairs.push(pair);
            }
        }
    }

    /// Loads a unit that starves, with its partner if that is gone. `false` when one of them has to wait for room.
    pub(super) fn load_with_partner(&mut self, plan: &mut DemandPlan<'_>, unit: UnitId) -> bool {
        let is_mapped = |unit: &UnitId| plan.demand.mapped.get(*unit as usize) == Some(&true);
        let partner = self.partner(&plan.demand, unit).filter(|unit| !self.is_held(*unit) && !is_mapped(unit));
        let Some(partner) = partner else {
            return matches!(self.try_load(plan, unit, LoadPriority::Must), LoadOutcome::Issued | LoadOutcome::Refused);
        };
        [unit, partner].into_iter().for_each(|unit| self.hold(unit));
        self.owed = Some([unit, partner]);
        self.pay_owed(plan)
    }

    /// Goes on with two units that starve together. `false` when one of them has to wait for room: then nothing else is
    /// loaded, so that the room comes, and the other one stays meanwhile. Without that, each could go for the other.
    pub(super) fn pay_owed(&mut self, plan: &mut DemandPlan<'_>) -> bool {
        let Some(pair) = self.owed else { return true };
        for (unit, other) in [(pair[0], pair[1]), (pair[1], pair[0])] {
            if self.is_held(unit) {
                continue;
            }
            if !self.is_demanded(unit) || self.entries[unit as usize].pauses(self.step) {
                return self.forgive(pair);
            }
            // Of partners only this one stays: with another one there might never be room.
            match self.try_load_beside(plan, unit, Some(other), LoadPriority::Must) {
                LoadOutcome::Issued => {}
                LoadOutcome::Refused => return self.forgive(pair),
                LoadOutcome::NoRoom | LoadOutcome::Full | LoadOutcome::Shared => return false,
            }
        }
        self.owed = None;
        self.pairs.push(pair);
        plan.demanded.retain(|unit| !pair.contains(unit));
        true
    }

    /// Nobody waits for the two any more, or one cannot be had now.
    fn forgive(&mut self, pair: [UnitId; 2]) -> bool {
        self.owed = None;
        pair.into_iter().for_each(|unit| self.let_go(unit));
        true
    }
}
