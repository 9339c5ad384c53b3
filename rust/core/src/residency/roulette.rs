// SPDX-License-Identifier: Apache-2.0
//! Russian roulette on loads (`oocpt:stragglerRoulette`): a chunk that few rays wait for is loaded with a probability `p`. If it is, all
//! rays that wait for it count `1 / p` times; if not, they end where they are.
//!
//! # Unbiased
//! A ray is weighted by `1 / p` exactly if a number `u`, drawn for this load alone, is below `p`; `p` is fixed before `u` is looked at, so
//! the expectation over `u` is what the ray would have brought, whatever `p` was made of (Arvo and Kirk 1990). One `u` for all
//! rays of a load, since the load is the work: ended one by one, `n` rays would save it with probability `(1 - p)^n` only.
//!
//! # p
//! The picture's variance and time, of which the product is to be smallest (efficiency: Bolin and Meyer 1997; Vorba and Křivánek 2016), are
//! `V + sum (1 / p - 1) s` and `T + sum p c` over the loads, `s` the second moment of what a load's rays bring and `c` its time. Derived by
//! `p`: `p = sqrt((s / V) / (c / T))`, at most 1. `V` and `T` are taken per path, `s` is [`Stakes::worth`]. A weighted ray is worth more, so it
//! seldom plays again. `p` is at least [`LEAST`]: nobody knows what a ray brings before it does, and weights stay bounded.
//!
//! # States of a chunk
//! `Open -> Approved` (until it was resident, or nobody waits) or `Open -> Ending` (until the step that ends its rays was seen). Rays that
//! come to an approved chunk get on without a weight: its load is paid for. Pure; called by one thread.

use super::ChunkId;
use crate::sampler::{combine, hash};

/// The least probability of a load.
pub const LEAST: f64 = 1.0 / 16.0;
/// A dimension of its own among the uses of the seed.
const DIMENSION: u32 = 0x0005_eed0;

/// What the picture costs, as far as it is known.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Prices {
    /// Seconds to load a byte.
    pub secs_per_byte: f64,
    /// Seconds of a path, with all its share of loads.
    pub secs_per_path: f64,
    /// Relative variance that a path leaves in its pixel.
    pub variance: f64,
    /// For tests: the probability of every load that is played for, whatever it costs.
    pub fixed: Option<f64>,
}

/// What is at stake with a load.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stakes {
    /// The chunk.
    pub chunk: ChunkId,
    /// Bytes to load.
    pub bytes: u64,
    /// Second moment of what the rays that wait bring, relative to their pixels, all together. Infinite: they are to be traced.
    pub worth: f64,
}

/// What becomes of the rays that wait for a chunk.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Verdict {
    /// The chunk.
    pub chunk: ChunkId,
    /// How often they count from now on; 0: they end.
    pub weight: f32,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
enum State {
    #[default]
    Open,
    Approved,
    /// By this step.
    Ending(u64),
}

/// See the module.
#[derive(Debug)]
pub struct Roulette {
    seed: u32,
    states: Vec<State>,
    draws: Vec<u32>,
    /// Chunks that are not open.
    judged: Vec<ChunkId>,
    verdicts: Vec<Verdict>,
    /// Loads that nobody waits for any more.
    pub loads_saved: u64,
}

impl Roulette {
    /// For so many chunks.
    #[must_use]
    pub fn new(seed: u32, chunks: usize) -> Self {
        Self {
            seed,
            states: vec![State::Open; chunks],
            draws: vec![0; chunks],
            judged: Vec::new(),
            verdicts: Vec::new(),
            loads_saved: 0,
        }
    }

    /// Takes note of what step `seen` left: the rays that wait for each chunk, and which chunks are resident.
    pub fn observe(&mut self, seen: u64, waiting: &[u32], is_resident: impl Fn(ChunkId) -> bool) {
        let states = &mut self.states;
        self.judged.retain(|&chunk| {
            let is_over = match states[chunk as usize] {
                State::Open => true,
                State::Approved => is_resident(chunk) || super::at(waiting, chunk) == 0,
                State::Ending(step) => seen >= step,
            };
            if is_over {
                states[chunk as usize] = State::Open;
            }
            !is_over
        });
    }

    /// Whether the chunk may be loaded; draws if it was not decided. What has to become of rays is in [`Self::take_verdicts`], to be done in step
    /// `step` at the latest, and before the chunk is shown.
    pub fn judge(&mut self, stakes: &Stakes, prices: &Prices, step: u64) -> bool {
        let Some(state) = self.states.get_mut(stakes.chunk as usize) else { return true };
        if *state != State::Open {
            return *state == State::Approved;
        }
        let p = survival(stakes, prices);
        let is_approved = p >= 1.0 || draw(self.seed, stakes.chunk, &mut self.draws) < p;
        *state = if is_approved { State::Approved } else { State::Ending(step) };
        self.judged.push(stakes.chunk);
        self.loads_saved += u64::from(!is_approved);
        if p < 1.0 {
            #[expect(clippy::cast_possible_truncation, reason = "1 to 16")]
            let weight = if is_approved { (1.0 / p) as f32 } else { 0.0 };
            self.verdicts.push(Verdict { chunk: stakes.chunk, weight });
        }
        is_approved
    }

    /// What was decided since the last call.
    pub fn take_verdicts(&mut self) -> Vec<Verdict> {
        std::mem::take(&mut self.verdicts)
    }

    /// Whether something was decided since.
    #[must_use]
    pub fn has_verdicts(&self) -> bool {
        !self.verdicts.is_empty()
    }
}

/// The probability of a load, [`LEAST`] to 1; 1 where something is not known.
#[must_use]
pub fn survival(stakes: &Stakes, prices: &Prices) -> f64 {
    if let (Some(fixed), true) = (prices.fixed, stakes.worth.is_finite()) {
        return fixed.clamp(LEAST, 1.0);
    }
    #[expect(clippy::cast_precision_loss, reason = "an estimate")]
    let cost = stakes.bytes as f64 * prices.secs_per_byte;
    let square = (stakes.worth / prices.variance) * (prices.secs_per_path / cost);
    if square < 1.0 { square.sqrt().max(LEAST) } else { 1.0 }
}

/// The next number of a chunk, in 0..1.
fn draw(seed: u32, chunk: ChunkId, draws: &mut [u32]) -> f64 {
    let mut number = 0;
    if let Some(count) = draws.get_mut(chunk as usize) {
        number = *count;
        *count = count.wrapping_add(1);
    }
    let key = combine(combine(combine(DIMENSION, seed), chunk), number);
    f64::from(hash(hash(key) ^ DIMENSION)) / 4_294_967_296.0
}

#[cfg(test)]
mod tests {
    use super::*;

    const PRICES: Prices = Prices { secs_per_byte: 1e-9, secs_per_path: 1e-6, variance: 0.1, fixed: None };

    fn stakes(chunk: ChunkId, worth: f64) -> Stakes {
        Stakes { chunk, bytes: 1_000_000, worth }
    }

    #[test]
    fn known_probabilities() {
        // A load costs as much time as 1000 paths, which leave a variance of 100.
        let p = |worth| survival(&stakes(0, worth), &PRICES);
        assert!((p(25.0) - 0.5).abs() < 1e-12, "a quarter of the variance: half, {}", p(25.0));
        assert!((p(100.0) - 1.0).abs() < 1e-12 && (p(1e6) - 1.0).abs() < 1e-12, "worth it: always");
        assert!((p(1e-9) - LEAST).abs() < 1e-12, "never below the least");
        let unknown = Prices { secs_per_byte: 0.0, ..PRICES };
        assert!((survival(&stakes(0, 0.0), &unknown) - 1.0).abs() < 1e-12, "0 / 0 is not known");
        let fixed = Prices { fixed: Some(0.25), ..PRICES };
        assert!((survival(&stakes(0, 1e9), &fixed) - 0.25).abs() < 1e-12, "as told");
        for prices in [PRICES, fixed] {
            let must = survival(&stakes(0, f64::INFINITY), &prices);
            assert!((must - 1.0).abs() < 1e-12, "rays that are to be traced");
        }
    }

    #[test]
    fn weights_make_up_for_what_ends() {
        let chunks = 20_000;
        let mut roulette = Roulette::new(3, chunks);
        let agreed = (0..20_000).filter(|&chunk| roulette.judge(&stakes(chunk, 4.0), &PRICES, 1)).count();
        let verdicts = roulette.take_verdicts();
        let sum: f64 = verdicts.iter().map(|verdict| f64::from(verdict.weight)).sum();
        // Standard deviation of the sum: sqrt(n (1 / p - 1)) with p = 0.2.
        assert!((sum - 20_000.0).abs() < 4.0 * (20_000.0_f64 * 4.0).sqrt(), "weights add up to {sum}");
        assert_eq!(verdicts.len(), chunks, "one each");
        assert_eq!(roulette.loads_saved, 20_000 - agreed as u64, "the others are not loaded");
        assert!(!roulette.has_verdicts(), "they were taken");
    }

    #[test]
    fn a_chunk_is_judged_once_until_it_was_there() {
        let mut roulette = Roulette::new(1, 4);
        assert!(roulette.judge(&stakes(2, f64::INFINITY), &PRICES, 5), "worth it");
        assert!(roulette.judge(&stakes(2, 0.0), &PRICES, 6) && !roulette.has_verdicts(), "paid for");
        roulette.observe(6, &[0, 0, 1], |_| false);
        assert!(roulette.judge(&stakes(2, 0.0), &PRICES, 7), "still on its way");
        roulette.observe(7, &[0, 0, 1], |chunk| chunk == 2);
        while roulette.judge(&stakes(2, 0.0), &PRICES, 8) {
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
    fn numbers_of_chunks_and_seeds_have_nothing_in_common() {
        let mut sum = [0.0; 3];
        for chunk in 0..4000 {
            let (mut a, mut b) = (vec![0; 4000], vec![0; 4000]);
            let one = [draw(1, chunk, &mut a), draw(1, chunk, &mut a), draw(2, chunk, &mut b)].map(|u| u - 0.5);
            sum[0] += one[0] * one[1];
            sum[1] += one[0] * one[2];
            sum[2] += one[0];
        }
        // Standard deviations over 4000: 1/12 and 1/sqrt(12) of their square root.
        assert!(sum[0].abs() < 4.0 * 63.2 / 12.0 && sum[1].abs() < 4.0 * 63.2 / 12.0, "independent: {sum:?}");
        assert!(sum[2].abs() < 4.0 * 63.2 / 3.46, "uniform: {sum:?}");
    }
}
