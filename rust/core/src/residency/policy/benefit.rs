// SPDX-License-Identifier: Apache-2.0
//! Our policy: weighs the benefit of a load to rays, per byte that it moves, against the cost of an eviction.
//!
//! Value of a load: (waiting rays + a share of the rays that will come to it next), grown with the time they have
//! waited, per byte that is not yet on the device (shared meshes often are). Loss of an eviction: the rays that needed
//! the unit lately, per byte that only it holds; such rays come back as demand, and such bytes have to be moved again.
//!
//! While rays can be traced, only worthwhile loads are made. When none can, every waiting ray costs time, however many
//! bytes its units have: then all units that rays wait for are loaded, and only such units are worth keeping. (Measured
//! on an H200, island of 10 M instances at 29 %: the last 0.5 % of the paths took 0.69 s with few loads in flight, 0.39
//! s with many.)

use super::super::UnitId;
use super::{LoadPolicy, PolicyView, top};

/// Loads the unit with most waiting rays per byte first.
#[derive(Clone, Copy, Debug, Default)]
pub struct BenefitPolicy;

/// Weight of a ray that has the unit further down its list.
const NEXT_WEIGHT: f64 = 0.125;
/// Factor by which a load's value must exceed the loss that it causes.
const HYSTERESIS: f64 = 1.25;
/// Number of steps of waiting that doubles a unit's value.
const AGE_STEPS: f64 = 512.0;
/// Loads stop at this fraction of the best value: units that are worth less now gather rays until they are worth more,
/// and the link moves fewer bytes for the same rays.
const DROP: f64 = 0.5;
/// Weight of recent rays when nothing can be traced: it only orders evictions.
const IDLE_HEAT: f64 = 1e-9;
/// Number of units whose assets are examined in a step, the best by their whole closures.
const LOOKED_AT: usize = 1024;
/// Bytes that a visit reads in host memory, some nodes and triangles: a unit is worth loading when its recent visits
/// have read as many bytes there as the load moves.
const VISIT_BYTES: f64 = 1024.0;
/// Fixed cost of a load, as bytes.
const LOAD_BYTES: f64 = 65536.0;

#[expect(clippy::cast_precision_loss, reason = "an estimate")]
fn cost(bytes: u64) -> f64 {
    bytes as f64 + LOAD_BYTES
}

fn rays(view: &PolicyView<'_>, unit: UnitId) -> f64 {
    let rays = f64::from(view.waiting(unit)) + NEXT_WEIGHT * f64::from(view.next(unit));
    rays * (1.0 + f64::from(view.waited_steps(unit)) / AGE_STEPS)
}

impl LoadPolicy for BenefitPolicy {
    fn order(&mut self, view: &PolicyView<'_>, demanded: &[UnitId], limit: usize) -> Vec<(f64, UnitId)> {
        let whole = |&unit: &UnitId| (rays(view, unit) / cost(view.catalog().closure_bytes(unit)), unit);
        let likely = top(demanded.iter().map(whole).collect(), LOOKED_AT.max(limit));
        let exact = likely.into_iter().filter_map(|(_, unit)| {
            let missing = view.missing_bytes(unit)?;
            Some((rays(view, unit) / cost(missing), unit))
        });
        let mut best = top(exact.collect(), limit);
        let drop = if view.is_idle() { 0.0 } else { DROP };
        let least = best.first().map_or(0.0, |first| first.0 * drop);
        best.truncate(best.partition_point(|&(value, _)| value >= least));
        best
    }

    fn loss(&self, view: &PolicyView<'_>, unit: UnitId) -> f64 {
        let heat = if view.is_idle() { IDLE_HEAT * view.heat(unit) } else { view.heat(unit) };
        (heat + f64::from(view.waiting(unit))) / cost(view.exclusive_bytes(unit))
    }

    fn displaces(&self, value: f64, loss: f64) -> bool {
        value > HYSTERESIS * loss
    }

    fn visited(&self, view: &PolicyView<'_>, unit: UnitId) -> Option<f64> {
        Some(view.heat(unit) / cost(view.missing_bytes(unit)?))
    }

    fn least_visited(&self) -> f64 {
        1.0 / VISIT_BYTES
    }

    fn prefetch(&self, view: &PolicyView<'_>, unit: UnitId) -> Option<f64> {
        let missing = view.missing_bytes(unit)?;
        Some(NEXT_WEIGHT * f64::from(view.next(unit)) / cost(missing))
    }
}
