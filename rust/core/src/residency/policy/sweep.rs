// SPDX-License-Identifier: Apache-2.0
//! Round robin over all units that have demand, in the order of their ids, as GPU-Motunui (C. Hellmuth, 2020) passes
//! over all its partitions again and again. What was loaded the longest time ago goes first. What rays need with a unit
//! comes next to it: by its own turn it might come only when the unit has gone again.

use super::super::UnitId;
use super::{LoadPolicy, PolicyView};

/// Round robin.
#[derive(Clone, Debug, Default)]
pub struct SweepPolicy {
    /// The unit after the one loaded last by its turn.
    cursor: UnitId,
    /// What rays need with that unit.
    next: Option<UnitId>,
    /// Units that could be loaded in this step, with what rays need with each.
    partners: Vec<(UnitId, Option<UnitId>)>,
}

impl LoadPolicy for SweepPolicy {
    fn order(&mut self, view: &PolicyView<'_>, demanded: &[UnitId], limit: usize) -> Vec<(f64, UnitId)> {
        let next = self.next;
        let place = |unit: UnitId| if Some(unit) == next { 0 } else { unit.wrapping_sub(self.cursor).max(1) };
        let mut ids: Vec<(UnitId, UnitId)> = demanded.iter().map(|&unit| (place(unit), unit)).collect();
        if ids.len() > limit {
            ids.select_nth_unstable(limit);
            ids.truncate(limit);
        }
        ids.sort_unstable();
        self.partners = ids.iter().map(|&(_, unit)| (unit, view.partner(unit))).collect();
        ids.into_iter().map(|(distance, unit)| (-f64::from(distance), unit)).collect()
    }

    fn loss(&self, view: &PolicyView<'_>, unit: UnitId) -> f64 {
        -f64::from(view.resident_steps(unit))
    }

    fn displaces(&self, _value: f64, _loss: f64) -> bool {
        true
    }

    fn issued(&mut self, unit: UnitId) {
        if self.next.take() != Some(unit) {
            self.cursor = unit.wrapping_add(1);
            self.next = self.partners.iter().find(|(of, _)| *of == unit).and_then(|(_, partner)| *partner);
        }
    }
}
