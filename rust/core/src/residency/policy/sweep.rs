// SPDX-License-Identifier: Apache-2.0
//! Round robin over all units that have demand, in the order of their ids, as GPU-Motunui (C. Hellmuth, 2020) passes
//! over all its partitions again and again. What was loaded the longest time ago goes first.

use super::super::UnitId;
use super::{Policy, View};

/// Round robin.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sweep {
    /// The unit after the one loaded last.
    cursor: UnitId,
}

impl Policy for Sweep {
    fn order(&mut self, _view: &View<'_>, demanded: &[UnitId], limit: usize) -> Vec<(f64, UnitId)> {
        let mut ids: Vec<(UnitId, UnitId)> =
            demanded.iter().map(|&unit| (unit.wrapping_sub(self.cursor), unit)).collect();
        if ids.len() > limit {
            ids.select_nth_unstable(limit);
            ids.truncate(limit);
        }
        ids.sort_unstable();
        ids.into_iter().map(|(distance, unit)| (-f64::from(distance), unit)).collect()
    }

    fn loss(&self, view: &View<'_>, unit: UnitId) -> f64 {
        -f64::from(view.resident_steps(unit))
    }

    fn displaces(&self, _value: f64, _loss: f64) -> bool {
        true
    }

    fn issued(&mut self, unit: UnitId) {
        self.cursor = unit.wrapping_add(1);
    }
}
