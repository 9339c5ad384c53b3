// SPDX-License-Identifier: Apache-2.0
//! Roulette on loads as the loop of a stage plays it: what the rays at stake are worth as the device said, what loads and paths cost as
//! the clock says, and what the device is to do with the rays. The decision itself is `oocpt_core::residency::roulette`.
//!
//! Loads are decided about when the planner is about to begin them, and only when nearly all rays wait and few paths are left that may begin
//! or go on: as long as the device has work, loads cost nothing, and as long as there are many paths, others will want the chunk. Tiles of textures are always loaded: many rays share one, and it is small.

use super::observe::Observation;
use oocpt_core::residency::roulette::{Prices, Roulette, Stakes};
use oocpt_core::residency::{ChunkId, Proposal};
use oocpt_shader_abi::{WORTH_MUST, WORTH_ONE};

/// Stragglers are so few of the paths that are in flight when there are enough: one in this many.
const FEW: u64 = 8;
/// Rays that wait for a chunk from which on it is loaded whatever they bring; far below what sums of [`WORTH_ONE`] can hold.
const MANY_RAYS: u32 = 1 << 14;
/// Keeps the relative variance of black pictures finite, as in `measure_error`.
const EPSILON: f64 = 1e-2;
/// Share of the second moment of paths that their variance in a pixel is taken for, until an error was measured: pixels differ among
/// each other, and samples are stratified.
const VARIANCE_SHARE: f64 = 0.125;

/// What loads and paths have cost so far.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Spent {
    pub(super) loading_secs: f64,
    pub(super) bytes_loaded: u64,
    pub(super) secs: f64,
    pub(super) paths: u64,
    /// Relative variance per path of the picture's error, if it was measured.
    pub(super) variance: Option<f64>,
}

/// See the module.
#[derive(Debug)]
pub(crate) struct Stragglers {
    roulette: Roulette,
    chunks: usize,
    fixed: Option<f64>,
    plant_unweighted: bool,
}

impl Stragglers {
    /// For a scene of so many chunks. For tests: `fixed`, see [`Prices`]; `plant_unweighted`, a fault.
    pub(crate) fn new(seed: u32, chunks: usize, fixed: Option<f64>, plant_unweighted: bool) -> Self {
        Self { roulette: Roulette::new(seed, chunks), chunks, fixed, plant_unweighted }
    }

    /// Whether `alive` paths are stragglers, where `most` may be in flight and none can begin.
    pub(super) fn are_few(&self, alive: u64, most: u64) -> bool {
        self.fixed.is_some() || alive.saturating_mul(FEW) <= most
    }

    /// Loads that nobody waits for any more.
    pub(super) fn loads_saved(&self) -> u64 {
        self.roulette.loads_saved
    }

    /// See [`Roulette::observe`].
    pub(super) fn observe(&mut self, seen: &Observation, is_resident: impl Fn(ChunkId) -> bool) {
        self.roulette.observe(seen.step, &seen.waiting, is_resident);
    }

    /// Whether a load may begin, worth what the rays that wait first bring, and as much for each that will come to the chunk later on; rays are weighted or ended in step `next`.
    pub(super) fn agrees(&mut self, proposal: &Proposal, seen: &Observation, prices: &Prices, next: u64) -> bool {
        let of = |values: &[u32]| values.get(proposal.chunk as usize).copied();
        let (first, later) = (of(&seen.waiting).unwrap_or(0), of(&seen.next).unwrap_or(0));
        let worth = match of(&seen.worth) {
            Some(worth) if proposal.is_idle && first > 0 && first < MANY_RAYS && worth & WORTH_MUST == 0 => {
                f64::from(worth) / f64::from(WORTH_ONE) * (1.0 + f64::from(later) / f64::from(first))
            }
            _ => f64::INFINITY,
        };
        self.roulette.judge(&Stakes { chunk: proposal.chunk, bytes: proposal.bytes, worth }, prices, next)
    }

    /// What is known of costs.
    #[expect(clippy::cast_precision_loss, reason = "estimates")]
    pub(super) fn prices(&self, spent: &Spent, seen: &Observation) -> Prices {
        let (mean, moment) = (f64::from(seen.roulette.mean), f64::from(seen.roulette.second_moment));
        let guess = VARIANCE_SHARE * moment / (mean * mean + EPSILON);
        Prices {
            secs_per_byte: spent.loading_secs / spent.bytes_loaded as f64,
            secs_per_path: spent.secs / spent.paths as f64,
            variance: spent.variance.filter(|variance| *variance > 0.0).unwrap_or(guess),
            fixed: self.fixed,
        }
    }

    /// Whether the next step has something to do.
    pub(super) fn has_verdicts(&self) -> bool {
        self.roulette.has_verdicts()
    }

    /// The table of verdicts for the next step: by chunk, 0 = nothing, above: a weight, below: the rays end. None when nothing was decided.
    pub(super) fn take_verdicts(&mut self) -> Option<Vec<f32>> {
        if !self.has_verdicts() {
            return None;
        }
        let mut table = vec![0.0; self.chunks];
        for verdict in self.roulette.take_verdicts() {
            let weight = if self.plant_unweighted { verdict.weight.min(1.0) } else { verdict.weight };
            if let Some(entry) = table.get_mut(verdict.chunk as usize) {
                *entry = if verdict.weight > 0.0 { weight } else { -1.0 };
            }
        }
        Some(table)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(waiting: u32, worth: u32) -> Observation {
        Observation { waiting: vec![0, waiting], worth: vec![0, worth], ..Observation::default() }
    }

    /// Whether load after load of a chunk is agreed to, a hundred times.
    fn agreed(seen: &Observation, is_idle: bool) -> usize {
        let prices = Prices { secs_per_byte: 1.0, secs_per_path: 1e-9, variance: 1.0, fixed: None };
        let proposal = Proposal { chunk: 1, bytes: 1 << 20, is_idle };
        let yes = |seed: u32| Stragglers::new(seed, 2, None, false).agrees(&proposal, seen, &prices, 1);
        (0..100).filter(|&seed| yes(seed)).count()
    }

    #[test]
    fn only_dear_loads_of_an_idle_device_are_played_for() {
        assert!(agreed(&seen(3, WORTH_ONE), true) < 30, "one in sixteen");
        assert_eq!(agreed(&seen(3, WORTH_ONE), false), 100, "the device has work");
        assert_eq!(agreed(&seen(MANY_RAYS, WORTH_ONE), true), 100, "many rays wait");
        assert_eq!(agreed(&seen(3, WORTH_ONE | WORTH_MUST), true), 100, "a camera ray waits");
        assert_eq!(agreed(&Observation::default(), true), 100, "nothing is known");
    }

    #[test]
    fn stragglers_are_few() {
        let stragglers = Stragglers::new(1, 2, None, false);
        assert!(stragglers.are_few(1000, 8000) && !stragglers.are_few(1001, 8000), "one in eight");
        assert!(Stragglers::new(1, 2, Some(0.5), false).are_few(8000, 8000), "always, for tests");
    }

    #[test]
    fn verdicts_are_a_table_by_chunk() {
        let prices = Prices { secs_per_byte: 1.0, secs_per_path: 1e-9, variance: 1.0, fixed: None };
        let mut stragglers = Stragglers::new(7, 200, None, false);
        let many = Observation { waiting: vec![1; 200], worth: vec![1; 200], ..Observation::default() };
        let yes: Vec<bool> = (0..199)
            .map(|chunk| stragglers.agrees(&Proposal { chunk, bytes: 1 << 20, is_idle: true }, &many, &prices, 1))
            .collect();
        let table = stragglers.take_verdicts().expect("something was decided");
        for (entry, yes) in table.iter().zip(&yes) {
            assert!((*entry - if *yes { 16.0 } else { -1.0 }).abs() < 1e-6, "{entry} for {yes}");
        }
        assert!(yes.contains(&true) && table[199].abs() < 1e-6, "and nothing for the one that was not asked about");
        assert!(stragglers.take_verdicts().is_none() && !stragglers.has_verdicts(), "once");
    }
}
