// SPDX-License-Identifier: Apache-2.0
//! The schedule of L. Berchtold's thesis (2022): a unit's value is the number n of its waiting rays, 256 n when it is
//! resident; units are loaded from the top of the list while their value is not ten times below the best.
//!
//! Where we differ: there, rays queue at resident units too and are traced from the queue; here they go on at once, so
//! a resident unit's n is what it was visited by since the last step (0 when nobody counts), and the best value is
//! taken among absent units. Equal losses: the least recently used goes.

use super::super::UnitId;
use super::{LoadPolicy, PolicyView, top};

/// Most waiting rays first.
#[derive(Clone, Copy, Debug, Default)]
pub struct PriorityPolicy;

/// A resident unit's rays count this many times.
const RESIDENT_FACTOR: f64 = 256.0;
/// Loads stop at this fraction of the best value.
const DROP: f64 = 0.1;

impl LoadPolicy for PriorityPolicy {
    fn order(&mut self, view: &PolicyView<'_>, demanded: &[UnitId], limit: usize) -> Vec<(f64, UnitId)> {
        let best = f64::from(demanded.iter().map(|&unit| view.waiting(unit)).max().unwrap_or(0));
        let values = demanded.iter().map(|&unit| (f64::from(view.waiting(unit)), unit));
        top(values.filter(|&(value, _)| value >= best * DROP).collect(), limit)
    }

    fn loss(&self, view: &PolicyView<'_>, unit: UnitId) -> f64 {
        let rays = f64::from(view.waiting(unit)) + f64::from(view.visits(unit));
        RESIDENT_FACTOR * rays - f64::from(view.idle_steps(unit)) / 4_294_967_296.0
    }

    fn displaces(&self, value: f64, loss: f64) -> bool {
        value > loss
    }
}
