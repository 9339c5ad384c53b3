// SPDX-License-Identifier: Apache-2.0
//! Adaptive sampling: distributes samples over pixels so that relMSE falls fastest, without bias. Pure; any thread.
//!
//! # Why it is unbiased
//! Each pixel has two streams of samples, independent of each other: scrambled Sobol sequences of their own. A picture
//! is half the mean of one plus half the mean of the other, whatever their numbers. The number of samples of stream 0
//! that a pixel gets is decided by the estimates of stream 1 alone, and vice versa; and only by those first samples
//! that *every* pixel has, the same number everywhere. So a count is independent of all samples that it counts, and the
//! mean of each stream has the right expectation, exactly. (Decided by its own samples, a pixel that has missed bright
//! light so far would look easy, and stay too dark: Kirk and Arvo 1991, "Unbiased sampling techniques for image
//! synthesis".)
//!
//! # How samples are distributed
//! With variance `v` of a pixel's mean at `n` samples, falling as `1/n`, the sum over pixels is least at counts
//! proportional to `sqrt(v n)` (Neyman 1934). `v` is relMSE's own: divided by the square of the pixel. It is taken from
//! the change of the mean since half as many samples, a noisy number but right for points that stratify, and to a
//! lesser part from the variance of the samples; both summed over 5 x 5 pixels. Counts are powers of two: a prefix of a
//! Sobol sequence is best there, and at most a factor `sqrt(2)` off costs 2 %.
//!
//! # Epochs
//! First every pixel gets 2^[`FIRST_OCTAVE`] samples of each stream; then epochs double the mean number of samples. In
//! an epoch every pixel gets at least a quarter of that mean and at most 2^[`OCTAVE_SPAN`] times that minimum. Counts
//! depend on samples alone: same seed, same device, same counts, at every memory budget.

use std::collections::{BTreeMap, BTreeSet};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use oocpt_abi::{ESTIMATE_FIRST, ESTIMATE_RING, STREAM_BIT, sampler::hash};

/// Streams of samples of each pixel.
pub const STREAMS: usize = 2;
/// In the first epoch every pixel gets 2^`FIRST_OCTAVE` samples of each stream.
pub const FIRST_OCTAVE: u32 = ESTIMATE_FIRST;
/// Octaves between the fewest and the most samples of a stream.
pub const OCTAVE_SPAN: u32 = 6;
// The octave that decides an epoch is still there when the pixel with most samples has filled the ring.
const _: () = assert!(OCTAVE_SPAN + 1 < ESTIMATE_RING, "the ring of estimates is too short");
/// Highest octave of a stream.
const MAX_OCTAVE: u32 = 23;
/// Weight of the variance by the samples beside the one by the change of the mean.
const SAMPLE_VARIANCE_WEIGHT: f64 = 0.25;
/// Priorities are whole numbers of steps, so many to an octave of samples.
const STEPS_PER_OCTAVE: i32 = 32;
/// Priorities lie within so many octaves of the largest one; what is lower counts as the lowest.
const PRIORITY_OCTAVES: i32 = 24;
/// Pixels of a parallel task.
const PIXELS_PER_TASK: usize = 1 << 15;

/// Two estimates of a pixel's variance by the first `2^octave` samples of a stream, as the film computes them. Both are
/// relative to the square of the pixel and for one sample: the variance of the mean times the number of samples.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct VarianceEstimate {
    /// From the variance of the samples.
    pub spread: f32,
    /// From the square of the mean's change since half as many samples.
    pub change: f32,
}

impl VarianceEstimate {
    /// Unpacks what the film keeps: the square roots of both as half floats, `spread` in the low bits.
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

/// One pixel of one stream in an epoch: its index in trace order, with [`STREAM_BIT`] for the second stream, and the
/// index of its first sample.
pub type PixelStart = [u32; 2];

/// Samples of an epoch that the same pixels get: `rows` samples for each of the first `width` entries, row by row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SampleBand {
    /// Index of its first path in the render.
    pub first: u64,
    /// Number of entries.
    pub width: u32,
    /// First row: number of samples that these entries have had before in this epoch.
    pub row: u32,
    /// Samples of each entry.
    pub rows: u32,
}

impl SampleBand {
    /// One past its last path.
    #[must_use]
    pub fn end(&self) -> u64 {
        self.first + u64::from(self.width) * u64::from(self.rows)
    }
}

/// The paths of one epoch.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct AdaptiveEpoch {
    /// The pixels that get samples, those with most first.
    pub entries: Vec<PixelStart>,
    /// Bands in the order of their paths, without gaps.
    pub bands: Vec<SampleBand>,
    /// One past its last path.
    pub end: u64,
    /// The mean number of samples of a pixel, both streams together, is about 2^`octave` when the epoch ends.
    pub octave: u32,
}

/// How a render has spent its samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AdaptiveUsage {
    /// Epochs so far, the first one included.
    pub epochs: u32,
    /// Fewest samples of a pixel, both streams together.
    pub fewest: u32,
    /// Most samples of a pixel, both streams together.
    pub most: u32,
    /// Share of the samples beyond those that every pixel has, 0 to 1.
    pub decided: f64,
}

/// The epochs of one render.
#[derive(Clone, Debug)]
pub struct AdaptiveSchedule {
    size: [u32; 2],
    /// Pixel `y * width + x` of each index in trace order.
    trace: Vec<u32>,
    /// Samples per pixel that the whole render may take, on average.
    samples: u32,
    /// By stream and pixel `y * width + x`: each has 2^octave samples when the epoch ends.
    octaves: [Vec<u8>; STREAMS],
    epoch: AdaptiveEpoch,
    /// Index of the epoch.
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
    /// The first epoch of a render of so many pixels with so many samples each, on average.
    #[must_use]
    pub fn new(size: [u32; 2], samples: u32) -> Self {
        let pixels = size[0].saturating_mul(size[1]);
        let pixel = |index| {
            let [x, y] = pixel_position(index, size);
            y * size[0] + x
        };
        let trace: Vec<u32> = (0..pixels).into_par_iter().map(pixel).collect();
        let entries =
            [0, STREAM_BIT].into_iter().flat_map(|bit| (0..pixels).map(move |index| [index | bit, 0])).collect();
        let width = 2 * pixels;
        let band = SampleBand { first: 0, width, row: 0, rows: 1 << FIRST_OCTAVE };
        let epoch = AdaptiveEpoch { entries, bands: vec![band], end: band.end(), octave: FIRST_OCTAVE + 1 };
        let octaves = [(); STREAMS].map(|()| vec![u8::try_from(FIRST_OCTAVE).unwrap_or(0); trace.len()]);
        Self { size, trace, samples, octaves, epoch, number: 0 }
    }

    /// The epoch in progress.
    #[must_use]
    pub fn epoch(&self) -> &AdaptiveEpoch {
        &self.epoch
    }

    /// True if no epoch follows this one, so that its samples decide nothing any more.
    #[must_use]
    pub fn is_last(&self) -> bool {
        self.budget(self.number + 1) <= self.budget(self.number)
    }

    /// The next epoch is decided by the estimates of the first 2^`deciding_octave` samples of each stream.
    #[must_use]
    pub fn deciding_octave(&self) -> u32 {
        self.min_octave(self.number)
    }

    /// Octave of the fewest samples of a stream by the end of epoch `number`: a quarter of the mean, or less.
    fn min_octave(&self, number: u32) -> u32 {
        let mean = self.budget(number) / (self.trace.len() as u64).max(1);
        FIRST_OCTAVE.max(mean.checked_ilog2().unwrap_or(0).saturating_sub(2))
    }

    /// Paths that each stream may have by the end of epoch `number`, of all pixels together.
    fn budget(&self, number: u32) -> u64 {
        let pixels = self.trace.len() as u64;
        let half = pixels * u64::from(self.samples) / 2;
        half.min(pixels << (FIRST_OCTAVE + number).min(MAX_OCTAVE))
    }

    /// Goes on to the next epoch, once all paths of this one are done. `estimates` are those of
    /// [`Self::deciding_octave`], by stream and pixel. False if there are no more samples to spend.
    pub fn advance(&mut self, estimates: [&[VarianceEstimate]; STREAMS]) -> bool {
        let [first, second] = estimates;
        // Each stream is decided by the other one.
        self.advance_by([second, first])
    }

    /// As [`AdaptiveSchedule::advance`], where `deciding[s]` decides stream `s`: the result is biased if it shares
    /// samples with it.
    pub fn advance_by(&mut self, deciding: [&[VarianceEstimate]; STREAMS]) -> bool {
        let number = self.number + 1;
        let budget = self.budget(number);
        if budget <= self.budget(self.number) || deciding.iter().any(|estimate| estimate.len() != self.trace.len()) {
            return false;
        }
        let decide = |stream: usize| {
            let priorities = priorities(&variances(deciding[stream], self.size));
            allocate(&priorities, &self.octaves[stream], self.min_octave(number), budget, stream)
        };
        let next: [Vec<u8>; STREAMS] = rayon::join(|| decide(0), || decide(1)).into();
        self.epoch = self.epoch_of(&next, self.epoch.end, FIRST_OCTAVE + 1 + number);
        self.octaves = next;
        self.number = number;
        !self.epoch.bands.is_empty()
    }

    /// The epoch that brings all pixels to the octaves `next`; its first path is `begin`.
    fn epoch_of(&self, next: &[Vec<u8>; STREAMS], begin: u64, octave: u32) -> AdaptiveEpoch {
        // Counts are differences of powers of two, so few of them are different.
        let parts: Vec<BTreeMap<u32, Vec<PixelStart>>> = (0..STREAMS)
            .flat_map(|stream| {
                (0..self.trace.len().div_ceil(PIXELS_PER_TASK)).map(move |task| (stream, task * PIXELS_PER_TASK))
            })
            .collect::<Vec<_>>()
            .into_par_iter()
            .map(|(stream, begin)| self.entries_by_count(&next[stream], stream, begin))
            .collect();
        let counts: BTreeSet<u32> = parts.iter().flat_map(|part| part.keys().copied()).collect();
        let mut entries = Vec::new();
        let mut ends = Vec::new();
        for count in counts.into_iter().rev() {
            for pixels in parts.iter().filter_map(|part| part.get(&count)) {
                entries.extend_from_slice(pixels);
            }
            ends.push((count, entries.len()));
        }
        let (mut bands, mut first, mut row) = (Vec::new(), begin, 0);
        for (count, width) in ends.into_iter().rev() {
            let width = u32::try_from(width).unwrap_or(u32::MAX);
            let band = SampleBand { first, width, row, rows: count - row };
            first = band.end();
            row = count;
            bands.push(band);
        }
        AdaptiveEpoch { entries, bands, end: first, octave }
    }

    /// The pixels of one task, in trace order from `begin` on, that get samples of a stream, by the number of samples.
    fn entries_by_count(&self, next: &[u8], stream: usize, begin: usize) -> BTreeMap<u32, Vec<PixelStart>> {
        let octaves = &self.octaves[stream];
        let stream_bit = if stream == 0 { 0 } else { STREAM_BIT };
        let mut entries: BTreeMap<u32, Vec<PixelStart>> = BTreeMap::new();
        for (index, pixel) in self.trace.iter().enumerate().skip(begin).take(PIXELS_PER_TASK) {
            let at = *pixel as usize;
            let (old, new) = (1_u32 << octaves[at], 1_u32 << next[at]);
            if new > old {
                // A render has at most 2^28 pixels.
                #[expect(clippy::cast_possible_truncation, reason = "an index of a pixel")]
                entries.entry(new - old).or_default().push([index as u32 | stream_bit, old]);
            }
        }
        entries
    }

    /// How the samples are spent when this epoch is done.
    #[must_use]
    pub fn usage(&self) -> AdaptiveUsage {
        let counts = || self.octaves[0].par_iter().zip(&self.octaves[1]).map(|(a, b)| (1_u32 << a) + (1_u32 << b));
        let all: u64 = counts().map(u64::from).sum();
        let uniform = (self.trace.len() as u64) << (self.min_octave(self.number) + 1);
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

/// Relative variance of one sample at each pixel, from the estimates of the pixel and its neighbours. The variance of
/// the samples is scaled to the change of the mean, which is smaller for points that stratify.
fn variances(estimates: &[VarianceEstimate], size: [u32; 2]) -> Vec<f64> {
    let spread = blurred(estimates, |estimate| estimate.spread, size);
    let change = blurred(estimates, |estimate| estimate.change, size);
    let [all_spread, all_change] = [&spread, &change].map(|all| all.iter().sum::<f64>());
    let ratio = if all_spread > 0.0 { all_change / all_spread } else { 1.0 };
    spread
        .par_iter()
        .zip(&change)
        .map(|(s, d)| (d + SAMPLE_VARIANCE_WEIGHT * ratio * s) / (1.0 + SAMPLE_VARIANCE_WEIGHT))
        .collect()
}

/// Means over 5 x 5 pixels, weighted 1 2 3 2 1 each way; pixels outside the image do not count.
fn blurred(estimates: &[VarianceEstimate], value: fn(&VarianceEstimate) -> f32, [width, height]: [u32; 2]) -> Vec<f64> {
    let finite = |value: f32| if value.is_finite() { f64::from(value.max(0.0)) } else { 0.0 };
    let values: Vec<f64> = estimates.par_iter().map(|estimate| finite(value(estimate))).collect();
    let (width, height) = (width as usize, height as usize);
    let across = blurred_along(&values, |at| at % width.max(1), 1, width);
    blurred_along(&across, |at| at / width.max(1), width, height)
}

/// One pass of the separable blur, along rows or columns of `length` values that are `stride` apart; `place(at)` is the
/// index of `values[at]` in its row or column.
fn blurred_along(values: &[f64], place: impl Fn(usize) -> usize + Sync, stride: usize, length: usize) -> Vec<f64> {
    let blurred = |at: usize| {
        let (along, mut sum, mut weight) = (place(at), 0.0, 0.0);
        for (offset, w) in [1.0, 2.0, 3.0, 2.0, 1.0].into_iter().enumerate() {
            if along + offset >= 2 && along + offset < length + 2 {
                sum += w * values[at + offset * stride - 2 * stride];
                weight += w;
            }
        }
        sum / weight
    };
    (0..values.len()).into_par_iter().map(blurred).collect()
}

/// Priority of each pixel: the logarithm of its standard deviation relative to the largest one, in steps, from
/// `-STEPS_PER_OCTAVE * PRIORITY_OCTAVES` to 0.
fn priorities(variances: &[f64]) -> Vec<i32> {
    let largest = variances.iter().copied().fold(0.0, f64::max);
    let lowest = -STEPS_PER_OCTAVE * PRIORITY_OCTAVES;
    let priority = |variance: f64| {
        if largest <= 0.0 || variance <= 0.0 {
            return lowest;
        }
        let steps = 0.5 * (variance / largest).log2() * f64::from(STEPS_PER_OCTAVE);
        #[expect(clippy::cast_possible_truncation, reason = "bounded")]
        let steps = steps.max(f64::from(lowest)).round() as i32;
        steps
    };
    variances.par_iter().map(|variance| priority(*variance)).collect()
}

/// The octave of a pixel of this priority if priority 0 gets `scale` steps, before bounds: at least `old` and `min`.
fn octave_at(priority: i32, scale: i32, old: u8, min: u32) -> u8 {
    let octave = (priority + scale + STEPS_PER_OCTAVE / 2).div_euclid(STEPS_PER_OCTAVE);
    let max = (min + OCTAVE_SPAN).min(MAX_OCTAVE);
    let bounded = u32::try_from(octave).unwrap_or(0).clamp(min, max).max(u32::from(old));
    // At most MAX_OCTAVE.
    u8::try_from(bounded).unwrap_or(old)
}

/// Octaves of samples for all pixels, at least `old` and `min`, with at most `budget` samples in all, unless the
/// minimum is more.
///
/// Octaves follow the priorities plus a common scale. A histogram tells the total for a scale without a look at the
/// pixels, and bisection finds the largest scale within the budget.
fn allocate(priorities: &[i32], old: &[u8], min: u32, budget: u64, stream: usize) -> Vec<u8> {
    // Pixels by depth, which is the priority negated, and by the octave that they have.
    let count = |priorities: &[i32], old: &[u8]| {
        let depths = usize::try_from(STEPS_PER_OCTAVE * PRIORITY_OCTAVES + 1).unwrap_or(1);
        let mut histogram = vec![[0_u64; 32]; depths];
        for (priority, old) in priorities.iter().zip(old) {
            if let Some(by_octave) = histogram.get_mut(priority.unsigned_abs() as usize) {
                by_octave[usize::from(old & 31)] += 1;
            }
        }
        histogram
    };
    let add = |mut sum: Vec<[u64; 32]>, part: Vec<[u64; 32]>| {
        sum.iter_mut().flatten().zip(part.iter().flatten()).for_each(|(sum, part)| *sum += part);
        sum
    };
    let histogram = priorities
        .par_chunks(PIXELS_PER_TASK)
        .zip(old.par_chunks(PIXELS_PER_TASK))
        .map(|(priorities, old)| count(priorities, old))
        .reduce(|| count(&[], &[]), add);
    let total = |scale: i32| -> u64 {
        let samples = |(depth, by_octave): (i32, &[u64; 32])| {
            let counts = (0_u8..).zip(by_octave).filter(|(_, count)| **count > 0);
            counts.map(|(old, count)| count << octave_at(-depth, scale, old, min)).sum::<u64>()
        };
        (0..).zip(&histogram).map(samples).sum()
    };
    // At `low` all pixels get the minimum, at `high` all get the maximum.
    let highest = PRIORITY_OCTAVES + i32::try_from(MAX_OCTAVE).unwrap_or(0) + 1;
    let (mut low, mut high) = (-STEPS_PER_OCTAVE, STEPS_PER_OCTAVE * highest);
    while high - low > 1 {
        let middle = low + (high - low) / 2;
        if total(middle) <= budget { low = middle } else { high = middle }
    }
    let mut octaves: Vec<u8> =
        priorities.par_iter().zip(old).map(|(priority, old)| octave_at(*priority, low, *old, min)).collect();
    let mut left = budget.saturating_sub(total(low));
    // The rest goes to pixels that the next scale would give more, in a random order that does not depend on threads.
    let candidate = |(at, ((priority, old), octave)): (usize, ((&i32, &u8), &u8))| {
        let raised = octave_at(*priority, high, *old, min);
        #[expect(clippy::cast_possible_truncation, reason = "the input of a hash")]
        let order = hash((at as u32) << 1 | stream as u32);
        (raised > *octave).then_some((order, at, raised))
    };
    let mut candidates: Vec<(u32, usize, u8)> =
        priorities.par_iter().zip(old).zip(&octaves).enumerate().filter_map(candidate).collect();
    candidates.par_sort_unstable();
    for (_, at, raised) in candidates {
        let cost = (1_u64 << raised) - (1_u64 << octaves[at]);
        if cost <= left {
            left -= cost;
            octaves[at] = raised;
        }
    }
    octaves
}
