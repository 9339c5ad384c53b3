// SPDX-License-Identifier: Apache-2.0
//! Brings units to the device that rays read in host memory: nobody waits for them, but what is visited most is read
//! fastest there.

use super::UnitId;
use super::entry::UnitState;
use super::planner::ResidencyPlanner;
use super::policy::top;
use super::step::DemandPlan;

/// Units that are tried in a step; bytes in flight bound them too.
const CANDIDATES: usize = 4096;

impl ResidencyPlanner {
    /// Loads mapped units by the policy's measure of their visits: as far as they are worth more than what goes, and
    /// where nothing has to go, whatever is visited at all.
    pub(super) fn load_mapped(&mut self, plan: &mut DemandPlan<'_>) {
        // The bus is for what rays wait for, and the few that still go on read little.
        if plan.is_idle() || plan.demand.keep_below > 0 {
            return;
        }
        let view = self.view(plan.demand);
        let units = (0..).zip(plan.demand.mapped).filter_map(|(unit, is_mapped)| is_mapped.then_some(unit));
        let absent = units.filter(|unit: &UnitId| {
            self.entries.get(*unit as usize).is_some_and(|entry| entry.state == UnitState::Absent && entry.heat > 0.0)
        });
        let values = absent.filter_map(|unit| Some((self.policy.visited(&view, unit)?, unit)));
        let least = self.policy.least_visited();
        let worth = |(value, unit): (f64, UnitId)| (if value >= least { value } else { 0.0 }, unit);
        let candidates: Vec<_> = top(values.collect(), CANDIDATES).into_iter().map(worth).collect();
        self.try_each(plan, &candidates);
    }
}
