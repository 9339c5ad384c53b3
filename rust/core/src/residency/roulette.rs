// SPDX-License-Identifier: Apache-2.0
//! Russian roulette on loads (`oocpt:stragglerRoulette`): a unit that few rays wait for is loaded with a probability
//! `p`. If it is, all rays that wait for it count `1 / p` times; if not, they end where they are.
//!
//! # Unbiased
//! A ray is weighted by `1 / p` exactly if a number `u`, drawn for this load alone, is below `p`; `p` is fixed before
//! `u` is looked at, so the expectation over `u` is the contribution that the ray would have had, however `p` was
//! chosen (Arvo and Kirk 1990). One `u` for all rays of a load, since the load is the work: ended one by one, `n` rays
//! would save it with probability `(1 - p)^n` only. Over consecutive seeds the numbers of a load are stratified, each
//! load's in an order of its own (Burley 2020): a picture merged from several seeds has less of this variance, and
//! nothing else changes.
//!
//! # p
//! A load brings a pixel the sum `F` of the contributions of its `m` rays there, all or nothing, so it adds
//! `(1 / p - 1) E[F^2]` to the variance of the pixel's sum: `m^2 c^2` where each ray brings `c`. `s` is the sum over
//! the pixels, relative to them. With `V` the relative variance and `T` the seconds of a path, `N` paths and `c` the
//! seconds that the picture is done sooner without the load, variance and time of the picture are proportional to
//! `N V + sum (1 / p - 1) s` and `N T + sum p c`; their product is to be smallest (efficiency: Bolin and Meyer 1997;
//! Vorba and Křivánek 2016). Playing one load with `p` instead of always loading it changes the logarithm of the
//! product by `-x (1 - p) (1 - p0^2 / p) / N`, with `x = c / T` and `p0 = sqrt((s / V) / x)`: smallest at `p0`, a gain
//! as long as `p0^2 < p`.
//!
//! # Careful
//! `s`, `V`, `c` are estimates. [`CARE`] times `s` is taken for `s`, hence `p = sqrt(2) p0`: that loses at most a tenth
//! of the gain where the estimates are right, and is a gain as long as `s / (V c)` is less than `2 / p` times the
//! estimate. A load with `p` above [`MAX_PROBABILITY`] is not played for: it would save little, and soon be wanted
//! again by rays that are not known yet. Two accounts of the variance spent, `sum (1 / p - 1) s`, bound the harm:
//! - of a unit, since it was loaded last: a share [`PER_LOAD`] of `V x`, the cost of the load. So a unit that is wanted
//!   again and again is loaded in the end, and the variance spent on it in vain is a small part of its price (rent or
//!   buy; Karlin et al. 1988, "Competitive snoopy caching").
//! - of all: a share [`PER_PICTURE`] of the picture's own `N V`.
//!
//! `p` is raised to what they leave. It is at least [`MIN_PROBABILITY`]: the contribution of a ray is not known in
//! advance, and weights stay bounded.
//!
//! # States of a unit
//! `Open -> Approved` (until it was resident, or no ray waits) or `Open -> Ending`, both at least until the step that
//! weights or ends its rays was seen: a unit has one verdict in a step. Rays that reach an approved unit continue
//! without a weight: its load is paid for. Pure; called by one thread.

use super::UnitId;
use oocpt_abi::sampler::{combine, hash, sample_4d};

/// Least probability of a load.
pub const MIN_PROBABILITY: f64 = 1.0 / 16.0;
/// Greatest probability below 1; a load with a greater one is not played for.
pub const MAX_PROBABILITY: f64 = 0.5;
/// Factor by which the stakes may be underestimated.
pub const CARE: f64 = 2.0;
/// Share of a load's cost, in variance, that may be spent in vain before it.
pub const PER_LOAD: f64 = 0.25;
/// Share of the picture's own variance that may be spent in all.
pub const PER_PICTURE: f64 = 0.125;
/// Dimension of these numbers among the uses of the seed.
const DIMENSION: u32 = 0x0005_eed0;

/// Costs of the picture, as far as they are known.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LoadPrices {
    /// Seconds by which the picture is finished sooner for each byte that is not loaded.
    pub secs_per_byte: f64,
    /// Seconds of a path, including its share of loads.
    pub secs_per_path: f64,
    /// Relative variance that a path leaves in its pixel.
    pub variance: f64,
    /// Number of paths of the picture.
    pub paths: f64,
}

/// Costs and effect of a load.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LoadStakes {
    /// The unit.
    pub unit: UnitId,
    /// Bytes to load.
    pub bytes: u64,
    /// Second moment of the contributions that the waiting rays bring to a pixel together, relative to it, summed over
    /// the pixels. Infinite: they must be traced.
    pub worth: f64,
    /// Share of these rays in the load, which others will use as well; 0 to 1.
    pub share: f64,
}

/// Decision about the rays that wait for a unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RouletteVerdict {
    /// The unit.
    pub unit: UnitId,
    /// Factor that multiplies their weight from now on; 0: they end.
    pub weight: f32,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
enum RouletteState {
    #[default]
    Open,
    /// The unit may be loaded; this step weights its rays.
    Approved(u64),
    /// The rays of the unit end; this step ends them.
    Ending(u64),
}

/// Plays Russian roulette for the loads of units.
#[derive(Debug)]
pub struct LoadRoulette {
    seed: u32,
    states: Vec<RouletteState>,
    draws: Vec<u32>,
    /// Variance spent on each unit since its last load, and in all.
    lost: Vec<f64>,
    /// Variance spent in all, in units of the relative variance of a path: divided by `variance * paths` it is the
    /// share of the picture's own.
    pub spent: f64,
    /// Units whose state is not `Open`.
    judged: Vec<UnitId>,
    verdicts: Vec<RouletteVerdict>,
    /// Number of loads that no ray waits for any more.
    pub loads_saved: u64,
}

impl LoadRoulette {
    /// Creates the roulette of `units` units, all open.
    #[must_use]
    pub fn new(seed: u32, units: usize) -> Self {
        Self {
            seed,
            states: vec![RouletteState::Open; units],
            draws: vec![0; units],
            lost: vec![0.0; units],
            spent: 0.0,
            judged: Vec::new(),
            verdicts: Vec::new(),
            loads_saved: 0,
        }
    }

    /// Records the state after step `seen`: the rays that wait for each unit, and the units that are resident.
    pub fn observe(&mut self, seen: u64, waiting: &[u32], is_resident: impl Fn(UnitId) -> bool) {
        let states = &mut self.states;
        self.judged.retain(|&unit| {
            let is_over = match states[unit as usize] {
                RouletteState::Open => true,
                RouletteState::Approved(step) => seen >= step && (is_resident(unit) || super::at(waiting, unit) == 0),
                RouletteState::Ending(step) => seen >= step,
            };
            if is_over {
                states[unit as usize] = RouletteState::Open;
            }
            !is_over
        });
    }

    /// Returns true if the unit may be loaded; draws if it was not decided. [`Self::take_verdicts`] has the decisions
    /// about rays, to be carried out in step `step` at the latest, and before the unit is usable.
    pub fn judge(&mut self, stakes: &LoadStakes, prices: &LoadPrices, step: u64) -> bool {
        self.judge_by(stakes, step, |lost, spent| probability(stakes, prices, lost, spent))
    }

    /// As [`Self::judge`], where `p` gives the probability from the variance spent on the unit and in all.
    pub fn judge_by(&mut self, stakes: &LoadStakes, step: u64, p: impl FnOnce(f64, f64) -> f64) -> bool {
        let Some(state) = self.states.get_mut(stakes.unit as usize) else { return true };
        if *state != RouletteState::Open {
            return matches!(*state, RouletteState::Approved(_));
        }
        let lost = self.lost.get_mut(stakes.unit as usize);
        let p = p(lost.as_deref().map_or(0.0, |lost| *lost), self.spent);
        let is_approved = p >= 1.0 || draw(self.seed, stakes.unit, &mut self.draws) < p;
        if p < 1.0 {
            self.spent += (1.0 / p - 1.0) * stakes.worth;
        }
        if let Some(lost) = lost {
            *lost = if is_approved { 0.0 } else { *lost + (1.0 / p - 1.0) * stakes.worth };
        }
        *state = if is_approved { RouletteState::Approved(step) } else { RouletteState::Ending(step) };
        self.judged.push(stakes.unit);
        self.loads_saved += u64::from(!is_approved);
        if p < 1.0 {
            #[expect(clippy::cast_possible_truncation, reason = "1 to 16")]
            let weight = if is_approved { (1.0 / p) as f32 } else { 0.0 };
            self.verdicts.push(RouletteVerdict { unit: stakes.unit, weight });
        }
        is_approved
    }

    /// The decisions since the last call.
    pub fn take_verdicts(&mut self) -> Vec<RouletteVerdict> {
        std::mem::take(&mut self.verdicts)
    }

    /// Returns true if there are decisions that were not taken.
    #[must_use]
    pub fn has_verdicts(&self) -> bool {
        !self.verdicts.is_empty()
    }
}

/// The probability of a load, [`MIN_PROBABILITY`] to [`MAX_PROBABILITY`] or 1, if `lost` and `spent` were spent on its
/// unit and in all; 1 if something is not known.
#[must_use]
pub fn probability(stakes: &LoadStakes, prices: &LoadPrices, lost: f64, spent: f64) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "an estimate")]
    let cost = stakes.bytes as f64 * prices.secs_per_byte * stakes.share;
    let in_paths = cost / prices.secs_per_path;
    let is_known = in_paths > 0.0 && in_paths.is_finite() && prices.variance > 0.0 && stakes.worth >= 0.0;
    if !is_known {
        return 1.0;
    }
    let wanted = (CARE * stakes.worth / (prices.variance * in_paths)).sqrt();
    // At least this part of the remaining variance is spent: 1 / p - 1 = left / worth.
    let floor = |left: f64| stakes.worth / (stakes.worth + left.max(0.0));
    let floors = floor(PER_LOAD * prices.variance * in_paths - lost)
        .max(floor(PER_PICTURE * prices.variance * prices.paths - spent));
    let p = wanted.max(MIN_PROBABILITY).max(if stakes.worth > 0.0 { floors } else { 0.0 });
    if p <= MAX_PROBABILITY { p } else { 1.0 }
}

/// The next number of a unit, in 0..1.
fn draw(seed: u32, unit: UnitId, draws: &mut [u32]) -> f64 {
    let mut number = 0;
    if let Some(count) = draws.get_mut(unit as usize) {
        number = *count;
        *count = count.wrapping_add(1);
    }
    f64::from(sample_4d(seed, number, hash(combine(DIMENSION, unit)))[0])
}

#[cfg(test)]
mod tests {
    use super::*;

    const PRICES: LoadPrices = LoadPrices { secs_per_byte: 1e-9, secs_per_path: 1e-6, variance: 0.1, paths: 1e9 };

    fn stakes(unit: UnitId, worth: f64) -> LoadStakes {
        LoadStakes { unit, bytes: 1_000_000, worth, share: 1.0 }
    }

    #[test]
    fn roulette_probabilities_match_known_values() {
        // A load costs as much time as 1000 paths, which leave a variance of 100: p = sqrt(2 worth / 100).
        let p = |worth| probability(&stakes(0, worth), &PRICES, 0.0, 0.0);
        assert!((p(8.0) - 0.4).abs() < 1e-12, "0.28 would be best, but care is taken: {}", p(8.0));
        assert!((p(12.5) - 0.5).abs() < 1e-12 && (p(12.6) - 1.0).abs() < 1e-12, "{} {}", p(12.5), p(12.6));
        assert!(
            (p(1e-9) - MIN_PROBABILITY).abs() < 1e-12 && (p(0.0) - MIN_PROBABILITY).abs() < 1e-12,
            "never below the least"
        );
        let shared = LoadStakes { share: 0.25, ..stakes(0, 2.0) };
        assert!((probability(&shared, &PRICES, 0.0, 0.0) - 0.4).abs() < 1e-12, "others need it too");
        let unknown = [
            LoadPrices { secs_per_byte: 0.0, ..PRICES },
            LoadPrices { secs_per_byte: f64::INFINITY, ..PRICES },
            LoadPrices { secs_per_byte: f64::NAN, ..PRICES },
            LoadPrices { secs_per_path: f64::INFINITY, ..PRICES },
            LoadPrices { variance: 0.0, ..PRICES },
            LoadPrices { variance: f64::NAN, ..PRICES },
        ];
        for prices in unknown {
            let p = probability(&stakes(0, 0.0), &prices, 0.0, 0.0);
            assert!((p - 1.0).abs() < 1e-12, "not known: {prices:?}");
        }
        let must = probability(&stakes(0, f64::INFINITY), &PRICES, 0.0, 0.0);
        assert!((must - 1.0).abs() < 1e-12, "rays that are to be traced");
    }

    #[test]
    fn the_variance_account_raises_the_survival_probability() {
        // Worth 8 is played for with 0.4, at 8 (1 / 0.4 - 1) = 12. A quarter of the load's 100 may be lost on its
        // unit.
        let p = |lost, spent, worth| probability(&stakes(0, worth), &PRICES, lost, spent);
        assert!((p(13.0, 0.0, 8.0) - 0.4).abs() < 1e-12, "just enough");
        assert!((p(15.0, 0.0, 8.0) - 8.0 / 18.0).abs() < 1e-12, "10 are left: {}", p(15.0, 0.0, 8.0));
        assert!((p(19.0, 0.0, 8.0) - 1.0).abs() < 1e-12, "6 are left: more than a half");
        assert!(
            (p(30.0, 0.0, 1e-3) - 1.0).abs() < 1e-12 && (p(30.0, 0.0, 0.0) - MIN_PROBABILITY).abs() < 1e-12,
            "overdrawn"
        );
        // An eighth of the picture's own 1e8 may be spent.
        assert!((p(0.0, 12.5e6 - 10.0, 8.0) - 8.0 / 18.0).abs() < 1e-6, "10 are left");
        assert!((p(0.0, 12.5e6, 8.0) - 1.0).abs() < 1e-12, "nothing is");
    }

    #[test]
    fn roulette_variance_stays_within_the_allowance() {
        // Its own variance is 2000, of which 250 may be spent: 31 times 2 (1 / 0.2 - 1), and once the 2 that are left.
        let prices = LoadPrices { paths: 20_000.0, ..PRICES };
        let mut roulette = LoadRoulette::new(3, 1000);
        let agreed = (0..1000).filter(|&unit| roulette.judge(&stakes(unit, 2.0), &prices, 1)).count();
        assert_eq!(roulette.take_verdicts().len(), 32, "then all are loaded");
        assert!((968..990).contains(&agreed) && (roulette.spent - 250.0).abs() < 1e-6, "{agreed}, {}", roulette.spent);
    }

    #[test]
    fn a_unit_demanded_repeatedly_is_loaded() {
        // Each time 2 (1 / 0.2 - 1) = 8 is lost of 25.
        let plays = |seed| {
            let mut roulette = LoadRoulette::new(seed, 1);
            for step in 1..1000 {
                if roulette.judge(&stakes(0, 2.0), &PRICES, step) {
                    return step;
                }
                roulette.observe(step, &[1], |_| false);
            }
            1000
        };
        let (sum, most) = (0..1000).map(plays).fold((0, 0), |(sum, most), n| (sum + n, most.max(n)));
        assert_eq!(most, 4, "after three times in vain");
        assert!((2800..3100).contains(&sum), "1 + 0.8 + 0.64 + 0.512 on average: {sum}");
    }

    #[test]
    fn survivor_weights_are_unbiased() {
        let units = 20_000;
        let mut roulette = LoadRoulette::new(3, units);
        let agreed = (0..20_000).filter(|&unit| roulette.judge(&stakes(unit, 2.0), &PRICES, 1)).count();
        let verdicts = roulette.take_verdicts();
        let sum: f64 = verdicts.iter().map(|verdict| f64::from(verdict.weight)).sum();
        // Standard deviation of the sum: sqrt(n (1 / p - 1)) with p = 0.2.
        assert!((sum - 20_000.0).abs() < 4.0 * (20_000.0_f64 * 4.0).sqrt(), "weights add up to {sum}");
        assert_eq!(verdicts.len(), units, "one each");
        assert_eq!(roulette.loads_saved, 20_000 - agreed as u64, "the others are not loaded");
        assert!(!roulette.has_verdicts(), "they were taken");
    }

    #[test]
    fn a_verdict_holds_until_the_unit_was_resident() {
        let mut roulette = LoadRoulette::new(1, 4);
        assert!(roulette.judge(&stakes(2, f64::INFINITY), &PRICES, 5), "worth it");
        assert!(roulette.judge(&stakes(2, 0.0), &PRICES, 6) && !roulette.has_verdicts(), "paid for");
        roulette.observe(6, &[0, 0, 1], |_| false);
        assert!(roulette.judge(&stakes(2, 0.0), &PRICES, 7), "still on its way");
        roulette.observe(7, &[0, 0, 1], |unit| unit == 2);
        while roulette.judge(&stakes(2, 0.0), &PRICES, 8) {
            assert_eq!(roulette.take_verdicts().len(), 1, "its rays are weighted in step 8");
            roulette.observe(7, &[0, 0, 0, 0], |unit| unit == 2);
            assert!(roulette.judge(&stakes(2, 0.0), &PRICES, 8), "which nobody has seen yet");
            assert!(!roulette.has_verdicts(), "one verdict in a step");
            roulette.observe(8, &[0, 0, 0, 0], |_| false);
        }
        let _ = roulette.take_verdicts();
        roulette.observe(7, &[0, 0, 1], |_| false);
        assert!(!roulette.judge(&stakes(2, f64::INFINITY), &PRICES, 9), "the rays of before have not ended yet");
        roulette.observe(8, &[0, 0, 1], |_| false);
        assert!(roulette.judge(&stakes(2, f64::INFINITY), &PRICES, 9), "these are others");
        assert!(roulette.judge(&stakes(9, 0.0), &PRICES, 9), "a tile of a texture");
    }

    #[test]
    fn random_numbers_of_units_and_seeds_are_uncorrelated() {
        let mut sum = [0.0; 3];
        for unit in 0..4000 {
            let (mut a, mut b) = (vec![0; 4000], vec![0; 4000]);
            let one = [draw(1, unit, &mut a), draw(1, unit, &mut a), draw(7777, unit, &mut b)].map(|u| u - 0.5);
            sum[0] += one[0] * one[1];
            sum[1] += one[0] * one[2];
            sum[2] += one[0];
        }
        // Standard deviations over 4000: 1/12 and 1/sqrt(12) of their square root.
        assert!(sum[0].abs() < 4.0 * 63.2 / 12.0 && sum[1].abs() < 4.0 * 63.2 / 12.0, "independent: {sum:?}");
        assert!(sum[2].abs() < 4.0 * 63.2 / 3.46, "uniform: {sum:?}");
    }

    #[test]
    fn random_numbers_are_stratified_over_seeds_for_each_load() {
        let first = |seed, unit: UnitId| draw(seed, unit, &mut vec![0; unit as usize + 1]);
        let mut both = 0;
        for unit in 0..500 {
            let us: Vec<[f64; 2]> = (16..32).map(|seed| [first(seed, unit), first(seed, unit + 500)]).collect();
            let mut sixteenths: Vec<f64> = us.iter().map(|u| (u[0] * 16.0).floor()).collect();
            sixteenths.sort_by(f64::total_cmp);
            assert!(sixteenths.iter().zip(0..16).all(|(is, i)| (is - f64::from(i)).abs() < 0.5), "{sixteenths:?}");
            both += us.iter().filter(|u| u[0] < 0.25 && u[1] < 0.25).count();
        }
        // Rays that need both count 16 times: 8000 / 16 is expected, with a standard deviation of about 17.
        assert!((430..570).contains(&both), "both loads are approved {both} times of 8000");
    }
}
