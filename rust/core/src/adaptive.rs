// SPDX-License-Identifier: Apache-2.0
//! Adaptive sampling: which pixel gets how many samples, so that relMSE falls fastest and nothing is biased. Pure; any
//! thread.
//!
//! # Why it is unbiased
//! Each pixel has two streams of samples, independent of each other: scrambled Sobol sequences of their own. A picture
//! is half the mean of one plus half the mean of the other, whatever their numbers. How many samples of stream 0 a
//! pixel gets is decided by the estimates of stream 1 alone, and the other way round; and only by a first part of
//! them that *every* pixel has, the same number everywhere. So a count is independent of all samples that it counts,
//! and the mean of each stream has the right expectation, exactly. (Decided from its own samples a pixel that has
//! missed what is bright so far would look easy, and stay too dark: Kirk and Arvo 1991, "Unbiased sampling techniques
//! for image synthesis".)
//!
//! # Who gets how many
//! With variance `v` of a pixel's mean at `n` samples, falling as `1/n`, the sum over pixels is least at counts
//! proportional to `sqrt(v n)` (Neyman 1934). `v` is relMSE's own: divided by the square of the pixel. It is taken from
//! the change of the mean since half as many samples, a noisy number but right for points that stratify, and to a
//! lesser part from the variance of the samples; both summed over 5 x 5 pixels. Counts are powers of two: a prefix of a
//! Sobol sequence is best there, and at most a factor `sqrt(2)` off costs 2 %.
//!
//! # Epochs
//! First every pixel gets [`FIRST`] samples of each stream; then epochs double the mean number of samples. In an epoch
//! every pixel gets at least a quarter of that mean and at most [`SPAN`] octaves more. What is decided depends on
//! samples alone: same seed, same device, same counts, at every memory budget.

use std::collections::{BTreeMap, BTreeSet};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use oocpt_abi::sampler::hash;

/// Streams of samples.
pub const STREAMS: usize = 2;
/// Octave of the samples of each stream in the first epoch.
pub const FIRST: u32 = FIRST_LEVEL as u32;
const FIRST_LEVEL: u8 = 3;
/// Octaves between the fewest and the most samples of a stream.
pub const SPAN: u32 = 6;
/// Octaves of estimates that are kept: `SPAN + 1` and one to spare.
pub const RING: u32 = 8;
/// Highest octave of a stream.
const HIGHEST: u32 = 23;
/// Weight of the samples' variance against that of the mean's change.
const SHRINK: f64 = 0.25;
/// Steps of an octave in which counts are compared.
const STEPS: i32 = 32;
/// Octaves below the largest standard deviation that are told apart.
const DEPTH: i32 = 24;
/// Pixels that one thread looks at in a row.
const PART: usize = 1 << 15;
/// Where the row of a band begins in `SampleBand::first_sample`.
pub const BAND_SHIFT: u32 = 26;

/// Estimates by the first `2^octave` samples of a stream, as `measured` by the film: variance of the mean by that of
/// its samples, and square of the mean's change since half as many, both relative to the pixel and times the samples.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct VarianceEstimate {
    /// By the variance of the samples.
    pub spread: f32,
    /// By the change of the mean.
    pub change: f32,
}

impl VarianceEstimate {
    /// From the square roots of both as halves, the first in the low bits: what the film keeps.
    #[must_use]
    pub fn unpack(bits: u32) -> Self {
        #[expect(clippy::cast_possible_truncation, reason = "two halves of 16 bits")]
        let [low, high] = [bits as u16, (bits >> 16) as u16].map(|half| {
            let root = half::f16::from_bits(half).to_f32();
            if root.is_finite() { root * root } else { 0.0 }
        });
        Self { spread: low, change: high }
    }
}

/// One pixel of one stream in an epoch: its number in trace order, with the stream in the highest bit; and its first
/// sample.
pub type PixelStart = [u32; 2];

/// Samples of an epoch that the same pixels get: `rows` for each of the first `width` entries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SampleBand {
    /// Its first path, of all of the render.
    pub first: u64,
    /// Entries.
    pub width: u32,
    /// The first row: samples that these entries have had before in this epoch.
    pub row: u32,
    /// Samples of each.
    pub rows: u32,
}

impl SampleBand {
    /// One behind its last path.
    #[must_use]
    pub fn end(&self) -> u64 {
        self.first + u64::from(self.width) * u64::from(self.rows)
    }
}

/// The paths of one epoch.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct AdaptiveEpoch {
    /// Who gets samples, those with most first.
    pub entries: Vec<PixelStart>,
    /// In the order of their paths, without gaps.
    pub bands: Vec<SampleBand>,
    /// One behind its last path.
    pub end: u64,
    /// Octave of the mean number of samples of a pixel, both streams together, that it ends with, about.
    pub octave: u32,
}

/// What a render has spent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AdaptiveUsage {
    /// Epochs that were decided, the first among them.
    pub epochs: u32,
    /// Fewest samples of a pixel, both streams together.
    pub fewest: u32,
    /// Most.
    pub most: u32,
    /// Share of the samples that the decisions gave, 0 to 1; the rest every pixel has.
    pub decided: f64,
}

/// The way of one render through its epochs.
#[derive(Clone, Debug)]
pub struct AdaptiveSchedule {
    size: [u32; 2],
    /// Pixel `y * width + x` of each number in trace order.
    trace: Vec<u32>,
    /// Samples per pixel that there may be.
    samples: u32,
    /// Octave of the samples of each pixel, `y * width + x`, by stream.
    levels: [Vec<u8>; STREAMS],
    epoch: AdaptiveEpoch,
    number: u32,
}

/// Position of a pixel in trace order: strips of 8 rows, cut into tiles of 8 columns. The twin of `pixel_position` of
/// the shaders.
#[must_use]
pub fn pixel_position(index: u32, [width, height]: [u32; 2]) -> [u32; 2] {
    let (width, height) = (width.max(1), height.max(1));
    let strip = index / (8 * width);
    let rows = height.saturating_sub(8 * strip).clamp(1, 8);
    let in_strip = index - strip * 8 * width;
    let tile = in_strip / (8 * rows);
    let columns = width.saturating_sub(8 * tile).clamp(1, 8);
    let in_tile = in_strip - tile * 8 * rows;
    [8 * tile + in_tile % columns, 8 * strip + in_tile / columns]
}

impl AdaptiveSchedule {
    /// A render of so many pixels with so many samples each, on average; its first epoch.
    #[must_use]
    pub fn new(size: [u32; 2], samples: u32) -> Self {
        let pixels = size[0].saturating_mul(size[1]);
        let place = |index| pixel_position(index, size);
        let trace: Vec<u32> =
            (0..pixels).into_par_iter().map(|index| place(index)[1] * size[0] + place(index)[0]).collect();
        let entries = (0..2).flat_map(|stream| (0..pixels).map(move |index| [index | stream << 31, 0])).collect();
        let width = 2 * pixels;
        let band = SampleBand { first: 0, width, row: 0, rows: 1 << FIRST };
        let epoch = AdaptiveEpoch { entries, bands: vec![band], end: band.end(), octave: FIRST + 1 };
        let levels = [vec![FIRST_LEVEL; trace.len()], vec![FIRST_LEVEL; trace.len()]];
        Self { size, trace, samples, levels, epoch, number: 0 }
    }

    /// The epoch under way.
    #[must_use]
    pub fn epoch(&self) -> &AdaptiveEpoch {
        &self.epoch
    }

    /// Whether no epoch follows this one: nothing that its samples say decides anything any more.
    #[must_use]
    pub fn is_last(&self) -> bool {
        self.budget(self.number + 1) <= self.budget(self.number)
    }

    /// Octave of the samples of each stream whose word decides the next epoch.
    #[must_use]
    pub fn decisive(&self) -> u32 {
        self.least(self.number)
    }

    /// Octave of the fewest samples of a stream by the end of epoch `number`: a quarter of the mean, or less.
    fn least(&self, number: u32) -> u32 {
        let mean = self.budget(number) / (self.trace.len() as u64).max(1);
        FIRST.max(mean.checked_ilog2().unwrap_or(0).saturating_sub(2))
    }

    /// Paths that each stream may have by the end of epoch `number`.
    fn budget(&self, number: u32) -> u64 {
        let pixels = self.trace.len() as u64;
        let half = pixels * u64::from(self.samples) / 2;
        half.min(pixels << (FIRST + number).min(HIGHEST))
    }

    /// Goes on to the next epoch, once all paths of this one are done; `estimates` are those by the first `2^decisive`
    /// samples of each stream, by pixel. False when there are no more samples to spend.
    pub fn advance(&mut self, estimates: [&[VarianceEstimate]; STREAMS]) -> bool {
        let [one, other] = estimates;
        // Each is decided by the other.
        self.advance_by([other, one])
    }

    /// As [`AdaptiveSchedule::advance`], where `deciding[s]` decides about stream `s`: biased if it shares samples with
    /// it.
    pub fn advance_by(&mut self, deciding: [&[VarianceEstimate]; STREAMS]) -> bool {
        let number = self.number + 1;
        let budget = self.budget(number);
        if budget <= self.budget(self.number) || deciding.iter().any(|estimate| estimate.len() != self.trace.len()) {
            return false;
        }
        let decide = |stream: usize| {
            let wanted = wanted(&weights(deciding[stream], self.size));
            allocate(&wanted, &self.levels[stream], self.least(number), budget, stream)
        };
        let next: [Vec<u8>; STREAMS] = rayon::join(|| decide(0), || decide(1)).into();
        self.epoch = self.list(&next, self.epoch.end, FIRST + 1 + number);
        self.levels = next;
        self.number = number;
        !self.epoch.bands.is_empty()
    }

    fn list(&self, next: &[Vec<u8>; STREAMS], begin: u64, octave: u32) -> AdaptiveEpoch {
        // By what they get: there are few different numbers.
        let parts: Vec<BTreeMap<u32, Vec<PixelStart>>> = (0..STREAMS)
            .flat_map(|stream| (0..self.trace.len().div_ceil(PART)).map(move |part| (stream, part * PART)))
            .collect::<Vec<_>>()
            .into_par_iter()
            .map(|(stream, begin)| self.classes(&next[stream], stream, begin))
            .collect();
        let extras: BTreeSet<u32> = parts.iter().flat_map(|part| part.keys().copied()).collect();
        let mut entries = Vec::new();
        let mut ends = Vec::new();
        for extra in extras.into_iter().rev() {
            for class in parts.iter().filter_map(|part| part.get(&extra)) {
                entries.extend_from_slice(class);
            }
            ends.push((extra, entries.len()));
        }
        let (mut bands, mut first, mut row) = (Vec::new(), begin, 0);
        for (extra, width) in ends.into_iter().rev() {
            let width = u32::try_from(width).unwrap_or(u32::MAX);
            let band = SampleBand { first, width, row, rows: extra - row };
            first = band.end();
            row = extra;
            bands.push(band);
        }
        AdaptiveEpoch { entries, bands, end: first, octave }
    }

    /// Those of a part of the pixels, in trace order from `begin` on, that get samples of a stream, by how many more.
    fn classes(&self, next: &[u8], stream: usize, begin: usize) -> BTreeMap<u32, Vec<PixelStart>> {
        let had = &self.levels[stream];
        let mark = if stream == 0 { 0 } else { 1 << 31 };
        let mut classes: BTreeMap<u32, Vec<PixelStart>> = BTreeMap::new();
        for (index, pixel) in self.trace.iter().enumerate().skip(begin).take(PART) {
            let at = *pixel as usize;
            let (old, new) = (1_u32 << had[at], 1_u32 << next[at]);
            if new > old {
                // A render has at most 2^28 pixels.
                #[expect(clippy::cast_possible_truncation, reason = "an index of a pixel")]
                classes.entry(new - old).or_default().push([index as u32 | mark, old]);
            }
        }
        classes
    }

    /// What has been spent when this epoch is done.
    #[must_use]
    pub fn spent(&self) -> AdaptiveUsage {
        let counts = || self.levels[0].par_iter().zip(&self.levels[1]).map(|(a, b)| (1_u32 << a) + (1_u32 << b));
        let all: u64 = counts().map(u64::from).sum();
        let uniform = (self.trace.len() as u64) << (self.least(self.number) + 1);
        #[expect(clippy::cast_precision_loss, reason = "shown, not computed with")]
        let decided = all.saturating_sub(uniform) as f64 / all.max(1) as f64;
        AdaptiveUsage {
            epochs: self.number + 1,
            fewest: counts().min().unwrap_or(0),
            most: counts().max().unwrap_or(0),
            decided,
        }
    }
}

/// Relative variance of a sample at each pixel, as far as the mean of many such is concerned, of its own estimates
/// and those of its neighbours.
fn weights(estimates: &[VarianceEstimate], size: [u32; 2]) -> Vec<f64> {
    let spread = blurred(estimates, |estimate| estimate.spread, size);
    let change = blurred(estimates, |estimate| estimate.change, size);
    let [all_spread, all_change] = [&spread, &change].map(|all| all.iter().sum::<f64>());
    let ratio = if all_spread > 0.0 { all_change / all_spread } else { 1.0 };
    spread.par_iter().zip(&change).map(|(s, d)| (d + SHRINK * ratio * s) / (1.0 + SHRINK)).collect()
}

/// Means over 5 x 5 pixels, weighted 1 2 3 2 1 each way, of those that there are.
fn blurred(estimates: &[VarianceEstimate], value: fn(&VarianceEstimate) -> f32, [width, height]: [u32; 2]) -> Vec<f64> {
    let finite = |value: f32| if value.is_finite() { f64::from(value.max(0.0)) } else { 0.0 };
    let values: Vec<f64> = estimates.par_iter().map(|estimate| finite(value(estimate))).collect();
    let (width, height) = (width as usize, height as usize);
    let across = blurred_along(&values, |at| at % width.max(1), 1, width);
    blurred_along(&across, |at| at / width.max(1), width, height)
}

/// `place(at)` is that of `values[at]` among `length` values, `stride` apart.
fn blurred_along(values: &[f64], place: impl Fn(usize) -> usize + Sync, stride: usize, length: usize) -> Vec<f64> {
    let of = |at: usize| {
        let (along, mut sum, mut weight) = (place(at), 0.0, 0.0);
        for (offset, w) in [1.0, 2.0, 3.0, 2.0, 1.0].into_iter().enumerate() {
            if along + offset >= 2 && along + offset < length + 2 {
                sum += w * values[at + offset * stride - 2 * stride];
                weight += w;
            }
        }
        sum / weight
    };
    (0..values.len()).into_par_iter().map(of).collect()
}

/// Where each pixel's wish stands: steps of octaves below the largest one, whole numbers from `-STEPS * DEPTH` to 0.
fn wanted(weights: &[f64]) -> Vec<i32> {
    let most = weights.iter().copied().fold(0.0, f64::max);
    let lowest = -STEPS * DEPTH;
    let of = |weight: f64| {
        if most <= 0.0 || weight <= 0.0 {
            return lowest;
        }
        let octaves = 0.5 * (weight / most).log2() * f64::from(STEPS);
        #[expect(clippy::cast_possible_truncation, reason = "bounded")]
        let steps = octaves.max(f64::from(lowest)).round() as i32;
        steps
    };
    weights.par_iter().map(|weight| of(*weight)).collect()
}

/// The octave of a pixel that stands `wanted` below the largest when the largest would get `scale` steps of an octave.
fn level(wanted: i32, scale: i32, old: u8, least: u32) -> u8 {
    let octave = (wanted + scale + STEPS / 2).div_euclid(STEPS);
    let most = (least + SPAN).min(HIGHEST);
    let bounded = u32::try_from(octave).unwrap_or(0).clamp(least, most).max(u32::from(old));
    // At most HIGHEST.
    u8::try_from(bounded).unwrap_or(old)
}

/// Octaves of samples for all pixels, none below `old` or `least`, of `budget` samples in all, at most, unless the
/// least is more.
fn allocate(wanted: &[i32], old: &[u8], least: u32, budget: u64, stream: usize) -> Vec<u8> {
    // Pixels by what they have and what they want.
    let count = |wanted: &[i32], old: &[u8]| {
        let mut groups = vec![[0_u64; 32]; usize::try_from(STEPS * DEPTH + 1).unwrap_or(1)];
        for (wanted, old) in wanted.iter().zip(old) {
            if let Some(group) = groups.get_mut(wanted.unsigned_abs() as usize) {
                group[usize::from(old & 31)] += 1;
            }
        }
        groups
    };
    let add = |mut sum: Vec<[u64; 32]>, part: Vec<[u64; 32]>| {
        sum.iter_mut().flatten().zip(part.iter().flatten()).for_each(|(sum, part)| *sum += part);
        sum
    };
    let groups = wanted
        .par_chunks(PART)
        .zip(old.par_chunks(PART))
        .map(|(wanted, old)| count(wanted, old))
        .reduce(|| count(&[], &[]), add);
    let total = |scale: i32| -> u64 {
        let of = |(wanted, group): (i32, &[u64; 32])| {
            let counts = (0_u8..).zip(group).filter(|(_, count)| **count > 0);
            counts.map(|(old, count)| count << level(-wanted, scale, old, least)).sum::<u64>()
        };
        (0..).zip(&groups).map(of).sum()
    };
    // All get the least below, all the most above.
    let (mut low, mut high) = (-STEPS, STEPS * (DEPTH + i32::try_from(HIGHEST).unwrap_or(0) + 1));
    while high - low > 1 {
        let middle = low + (high - low) / 2;
        if total(middle) <= budget { low = middle } else { high = middle }
    }
    let mut levels: Vec<u8> =
        wanted.par_iter().zip(old).map(|(wanted, old)| level(*wanted, low, *old, least)).collect();
    let mut left = budget.saturating_sub(total(low));
    // What is left goes to some of those that are next, by lot.
    let lot = |(at, ((wanted, old), level_now)): (usize, ((&i32, &u8), &u8))| {
        let more = level(*wanted, high, *old, least);
        #[expect(clippy::cast_possible_truncation, reason = "a lot, not a number")]
        let lot = hash((at as u32) << 1 | stream as u32);
        (more > *level_now).then_some((lot, at, more))
    };
    let mut next: Vec<(u32, usize, u8)> = wanted.par_iter().zip(old).zip(&levels).enumerate().filter_map(lot).collect();
    next.par_sort_unstable();
    for (_, at, more) in next {
        let cost = (1_u64 << more) - (1_u64 << levels[at]);
        if cost <= left {
            left -= cost;
            levels[at] = more;
        }
    }
    levels
}
