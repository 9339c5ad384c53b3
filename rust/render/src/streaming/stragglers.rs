// SPDX-License-Identifier: Apache-2.0
//! Roulette on loads in the loop of a stage: the worth of the waiting rays as the device measured it, the costs of
//! loads and paths by the clock, and the verdicts for the rays. The decision itself is
//! `oocpt_core::residency::roulette`.
//!
//! Loads are decided about when the planner is about to begin them, and only if nearly all rays wait and few paths are
//! left that may begin or go on: as long as the device has work, loads cost nothing, and as long as there are many
//! paths, others will want the chunk. Tiles of textures are always loaded: many rays share one, and it is small.
//!
//! The cost of a load is the time that the picture waits for it: the seconds of just those waits, by the bytes that
//! arrived in them ([`StragglerPrice`]). Measured by all the time in which something is loaded it would be many times
//! more, since most of that time the device traces; and ever more, the fewer loads are left.

use super::observe::StepObservation;
use oocpt_abi::{WORTH_MUST, WORTH_ONE};
#[cfg(feature = "faults")]
use oocpt_core::residency::roulette::MIN_PROBABILITY;
use oocpt_core::residency::roulette::{LoadPrices, LoadRoulette, LoadStakes};
use oocpt_core::residency::{LoadProposal, UnitId};

/// Paths are stragglers if they are fewer than one in so many of the paths in flight when there are enough.
const FEW: u64 = 64;
/// Number of rays waiting for a chunk from which on it is loaded whatever they contribute; the sum of `roulette_worth`
/// for fewer stays below [`WORTH_MUST`].
const MANY_RAYS: u32 = 1 << 12;
/// The device idles if so many times more rays wait than can be traced, as in the planner.
const IDLE_RATIO: u64 = 64;
/// Loads from which on their price is known.
const KNOWN_LOADS: f64 = 8.0;
/// Loads from which on older ones count half.
const WINDOW_LOADS: f64 = 64.0;

/// The cost of the paths so far.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct RenderCost {
    pub(super) secs: f64,
    /// Paths that have ended.
    pub(super) paths: u64,
    /// All paths of the picture.
    pub(super) all_paths: u64,
    /// Relative variance per path of the picture's error, if it was measured.
    pub(super) variance: Option<f64>,
}

/// The host's knowledge at one moment.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct StragglerMoment {
    /// Seconds since the stage began.
    pub(super) secs: f64,
    pub(super) loads: u64,
    pub(super) bytes_loaded: u64,
    /// True if from now on few paths are left, nearly all wait, and something is being loaded.
    pub(super) waits: bool,
}

/// Seconds by byte of the loads that the picture waits for, the latest ones weighted most.
#[derive(Clone, Copy, Debug, Default)]
struct StragglerPrice {
    last: StragglerMoment,
    secs: f64,
    bytes: f64,
    loads: f64,
}

impl StragglerPrice {
    #[expect(clippy::cast_precision_loss, reason = "estimates")]
    fn note(&mut self, now: StragglerMoment) {
        if self.last.waits {
            self.secs += (now.secs - self.last.secs).max(0.0);
            self.bytes += now.bytes_loaded.saturating_sub(self.last.bytes_loaded) as f64;
            self.loads += now.loads.saturating_sub(self.last.loads) as f64;
        }
        if self.loads >= WINDOW_LOADS {
            for sum in [&mut self.secs, &mut self.bytes, &mut self.loads] {
                *sum *= 0.5;
            }
        }
        self.last = now;
    }

    /// The price; `None` as long as too little was loaded.
    fn secs_per_byte(&self) -> Option<f64> {
        (self.loads >= KNOWN_LOADS).then(|| self.secs / self.bytes)
    }
}

/// The state of roulette on loads in one render.
#[derive(Debug)]
pub(crate) struct StragglerRoulette {
    roulette: LoadRoulette,
    price: StragglerPrice,
    units: usize,
    #[cfg(feature = "faults")]
    faults: crate::job::faults::PlantedFaults,
}

impl StragglerRoulette {
    /// For a scene of so many chunks and meshes.
    pub(crate) fn new(seed: u32, units: usize) -> Self {
        Self {
            roulette: LoadRoulette::new(seed, units),
            price: StragglerPrice::default(),
            units,
            #[cfg(feature = "faults")]
            faults: crate::job::faults::PlantedFaults::default(),
        }
    }

    /// This roulette with the faults that a test plants.
    #[cfg(feature = "faults")]
    pub(crate) fn with_faults(self, faults: crate::job::faults::PlantedFaults) -> Self {
        Self { faults, ..self }
    }

    /// Returns true if `alive` paths are stragglers, where `most` may be in flight and none can begin.
    pub(super) fn are_few(&self, alive: u64, most: u64) -> bool {
        #[cfg(feature = "faults")]
        if self.faults.roulette_per_mille.is_some() {
            return true;
        }
        alive.saturating_mul(FEW) <= most
    }

    /// Logs the result of the roulette.
    pub(super) fn log(&self, prices: &LoadPrices) {
        tracing::info!(
            loads_saved = self.roulette.loads_saved,
            share_of_variance = self.roulette.spent / (prices.variance * prices.paths),
            variance_of_path = prices.variance,
            ns_of_path = 1e9 * prices.secs_per_path,
            ns_of_byte = 1e9 * prices.secs_per_byte,
            "roulette on loads"
        );
    }

    /// Loads that nobody waits for any more.
    pub(super) fn loads_saved(&self) -> u64 {
        self.roulette.loads_saved
    }

    /// Takes in the results of a step, as [`LoadRoulette::observe`] does.
    pub(super) fn observe(&mut self, seen: &StepObservation, is_resident: impl Fn(UnitId) -> bool) {
        self.roulette.observe(seen.step, &seen.waiting, is_resident);
    }

    /// Takes in the time.
    pub(super) fn note(&mut self, now: StragglerMoment) {
        self.price.note(now);
    }

    /// Returns true if nearly all rays wait.
    pub(super) fn is_idle(seen: &StepObservation) -> bool {
        seen.waiting() > 0 && seen.waiting() >= seen.active().saturating_mul(IDLE_RATIO)
    }

    /// Returns true if a load may begin; rays that wait for it first are weighted or ended in step `next`. Rays that
    /// will reach the chunk later pay their share of it.
    pub(super) fn agrees(
        &mut self,
        proposal: &LoadProposal,
        seen: &StepObservation,
        prices: &LoadPrices,
        next: u64,
    ) -> bool {
        let of = |values: &[u32]| values.get(proposal.unit as usize).copied();
        let (first, later) = (of(&seen.waiting).unwrap_or(0), of(&seen.next).unwrap_or(0));
        let worth = match of(&seen.worth) {
            // Rays of a mesh whose chunk is absent are counted at that chunk: here none could be ended.
            Some(worth @ 1..WORTH_MUST) if proposal.is_idle && first > 0 && first < MANY_RAYS => {
                f64::from(worth) / f64::from(WORTH_ONE)
            }
            _ => f64::INFINITY,
        };
        let share = f64::from(first) / (f64::from(first) + f64::from(later)).max(1.0);
        let stakes = LoadStakes { unit: proposal.unit, bytes: proposal.bytes, worth, share };
        #[cfg(feature = "faults")]
        if let Some(per_mille) = self.faults.roulette_per_mille {
            let p = if worth.is_finite() { (f64::from(per_mille) / 1000.0).clamp(MIN_PROBABILITY, 1.0) } else { 1.0 };
            return self.roulette.judge_by(&stakes, next, |_, _| p);
        }
        self.roulette.judge(&stakes, prices, next)
    }

    /// The known costs; NaN for those that are not known. Of two variances the smaller one is taken.
    #[expect(clippy::cast_precision_loss, reason = "estimates")]
    pub(super) fn prices(&self, spent: &RenderCost, seen: &StepObservation) -> LoadPrices {
        let of_paths = f64::from(seen.roulette.variance);
        let known = spent.variance.into_iter().chain([of_paths]).filter(|variance| *variance > 0.0);
        let secs_per_byte = self.price.secs_per_byte();
        #[cfg(feature = "faults")]
        let secs_per_byte = self.faults.roulette_ns_per_byte.map(|ns| 1e-9 * f64::from(ns)).or(secs_per_byte);
        LoadPrices {
            secs_per_byte: secs_per_byte.unwrap_or(f64::NAN),
            secs_per_path: spent.secs / spent.paths as f64,
            variance: known.fold(f64::NAN, f64::min),
            paths: spent.all_paths as f64,
        }
    }

    /// Returns true if the next step has something to do.
    pub(super) fn has_verdicts(&self) -> bool {
        self.roulette.has_verdicts()
    }

    /// The verdicts for the next step: by chunk, 0 = none, above: a weight, below: the rays end. `None` if nothing was
    /// decided.
    pub(super) fn take_verdicts(&mut self) -> Option<Vec<f32>> {
        if !self.has_verdicts() {
            return None;
        }
        let mut table = vec![0.0; self.units];
        for verdict in self.roulette.take_verdicts() {
            let weight = verdict.weight;
            #[cfg(feature = "faults")]
            let weight = if self.faults.unweighted_roulette { weight.min(1.0) } else { weight };
            if let Some(entry) = table.get_mut(verdict.unit as usize) {
                *entry = if verdict.weight > 0.0 { weight } else { -1.0 };
            }
        }
        Some(table)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(waiting: u32, worth: u32) -> StepObservation {
        StepObservation { waiting: vec![0, waiting], worth: vec![0, worth], ..StepObservation::default() }
    }

    /// Counts how many of a hundred loads of a chunk are agreed to.
    fn agreed(seen: &StepObservation, is_idle: bool) -> usize {
        let prices = LoadPrices { secs_per_byte: 1.0, secs_per_path: 1e-9, variance: 1.0, paths: 1e9 };
        let proposal = LoadProposal { unit: 1, bytes: 1 << 20, is_idle };
        let yes = |seed: u32| StragglerRoulette::new(seed, 2).agrees(&proposal, seen, &prices, 1);
        (0..100).filter(|&seed| yes(seed)).count()
    }

    #[test]
    fn roulette_applies_only_to_expensive_loads_on_an_idle_device() {
        assert!(agreed(&seen(3, WORTH_ONE), true) < 30, "one in sixteen");
        assert_eq!(agreed(&seen(3, WORTH_ONE), false), 100, "the device has work");
        assert_eq!(agreed(&seen(MANY_RAYS, WORTH_ONE), true), 100, "many rays wait");
        assert_eq!(agreed(&seen(3, WORTH_ONE | WORTH_MUST), true), 100, "a camera ray waits");
        assert_eq!(agreed(&seen(3, 0), true), 100, "the rays wait for another unit");
        assert_eq!(agreed(&StepObservation::default(), true), 100, "nothing is known");
    }

    #[test]
    fn rays_with_the_chunk_further_along_share_the_load_cost() {
        // A load costs 1000 paths, so one ray has p = 0.1; with 24 others to come it pays for 40 of them: p = 0.5, and
        // with more it is not played.
        let prices = LoadPrices { secs_per_byte: 1e-6, secs_per_path: 1e-3, variance: 0.2, paths: 1e9 };
        let proposal = LoadProposal { unit: 1, bytes: 1_000_000, is_idle: true };
        let agreed = |later: u32| {
            let seen = StepObservation { next: vec![0, later], ..seen(1, WORTH_ONE) };
            (0..400).filter(|&seed| StragglerRoulette::new(seed, 2).agrees(&proposal, &seen, &prices, 1)).count()
        };
        let (alone, shared, many) = (agreed(0), agreed(24), agreed(26));
        assert!(alone < 70 && (150..250).contains(&shared) && many == 400, "{alone}, {shared}, {many} of 400");
    }

    #[test]
    fn the_price_of_a_byte_is_measured_waiting_time() {
        let mut price = StragglerPrice::default();
        let at = |secs, loads, waits| StragglerMoment { secs, loads, bytes_loaded: 10 * loads, waits };
        price.note(at(5.0, 100, true));
        assert!(price.secs_per_byte().is_none(), "what was loaded while the device had work costs nothing");
        price.note(at(6.0, 107, false));
        assert!(price.secs_per_byte().is_none(), "too few");
        price.note(at(60.0, 500, true));
        price.note(at(60.5, 510, true));
        let known = price.secs_per_byte().expect("17 loads");
        assert!((known - 1.5 / 170.0).abs() < 1e-12, "only while it waits: {known}");
        // From 64 loads on those so far count half.
        price.note(at(61.0, 563, true));
        price.note(at(65.0, 573, true));
        let known = price.secs_per_byte().expect("more");
        assert!((known - 5.0 / 450.0).abs() < 1e-12, "half of 2 s and 700, and 4 s and 100: {known}");
    }

    #[test]
    fn unknown_prices_are_none() {
        let stragglers = StragglerRoulette::new(1, 2);
        let spent = |variance| RenderCost { secs: 1.0, paths: 10, all_paths: 20, variance };
        let of_paths = |variance| StepObservation {
            roulette: oocpt_abi::RouletteStats { variance, ..Default::default() },
            ..StepObservation::default()
        };
        let known = |measured, said| stragglers.prices(&spent(measured), &of_paths(said)).variance;
        assert!(known(None, 0.0).is_nan() && known(Some(0.0), 0.0).is_nan(), "nobody said anything");
        assert!(
            (known(Some(0.5), 0.25) - 0.25).abs() < 1e-9 && (known(Some(0.5), 1.0) - 0.5).abs() < 1e-9,
            "the smaller"
        );
        assert!((known(None, 0.25) - 0.25).abs() < 1e-9, "the only one");
        let prices = stragglers.prices(&spent(None), &StepObservation::default());
        assert!(prices.secs_per_byte.is_nan() && (prices.secs_per_path - 0.1).abs() < 1e-12, "{prices:?}");
    }

    #[test]
    fn stragglers_are_at_most_one_path_in_64() {
        let stragglers = StragglerRoulette::new(1, 2);
        assert!(stragglers.are_few(1000, 64_000) && !stragglers.are_few(1001, 64_000), "one in 64");
        let faults = crate::job::faults::PlantedFaults { roulette_per_mille: Some(500), ..Default::default() };
        assert!(
            StragglerRoulette::new(1, 2).with_faults(faults).are_few(8000, 8000),
            "always, where a test sets the odds"
        );
    }

    #[test]
    fn verdicts_are_encoded_per_chunk() {
        let prices = LoadPrices { secs_per_byte: 1.0, secs_per_path: 1e-9, variance: 1.0, paths: 1e9 };
        let mut stragglers = StragglerRoulette::new(7, 200);
        let many = StepObservation { waiting: vec![1; 200], worth: vec![1; 200], ..StepObservation::default() };
        let yes: Vec<bool> = (0..199)
            .map(|chunk| {
                stragglers.agrees(&LoadProposal { unit: chunk, bytes: 1 << 20, is_idle: true }, &many, &prices, 1)
            })
            .collect();
        let table = stragglers.take_verdicts().expect("something was decided");
        for (entry, yes) in table.iter().zip(&yes) {
            assert!((*entry - if *yes { 16.0 } else { -1.0 }).abs() < 1e-6, "{entry} for {yes}");
        }
        assert!(yes.contains(&true) && table[199].abs() < 1e-6, "and nothing for the one that was not asked about");
        assert!(stragglers.take_verdicts().is_none() && !stragglers.has_verdicts(), "once");
    }
}
