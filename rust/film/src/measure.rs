// SPDX-License-Identifier: Apache-2.0
//! Measures the error of a film at a number of samples that all its pixels have, as `measure_error.comp` does on the
//! device, in `f64`, and follows it over the octaves.
//!
//! Guarantees: pixels of a row are summed from the left, rows in ascending order. The same film gives the same bits,
//! however many threads there are and in whatever portions it comes. Pure; any thread.

use crate::exact::ExactSums as _;
use crate::header::FilmHeader;
use oocpt_abi::{ExactPixel, MAX_PIXEL_ERROR, MEAN_TRUST};
use oocpt_core::convergence::{ConvergenceEstimator, ErrorEstimate, PictureErrorSums};
use oocpt_core::stats::WorstPixel;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Number of worst pixels that are told.
const WORST: usize = 8;

/// The error of a film at a number of samples.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct OctaveError {
    /// Samples of each pixel: a power of two, or all samples of the film.
    pub samples: u32,
    /// Sums over the pixels, from which the estimate follows.
    pub sums: PictureErrorSums,
    /// The pixels with the largest error, worst first, counted from the upper left of the picture.
    pub worst: Vec<WorstPixel>,
}

/// The estimates of errors at ascending numbers of samples.
#[must_use]
pub fn estimates(errors: &[OctaveError]) -> Vec<Option<ErrorEstimate>> {
    let mut convergence = ConvergenceEstimator::default();
    let estimate = |error: &OctaveError| match error.samples {
        samples if samples.is_power_of_two() => convergence.octave(samples.ilog2(), &error.sums),
        samples => convergence.between(f64::from(samples), &error.sums),
    };
    errors.iter().map(estimate).collect()
}

/// What is known of a pixel.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PixelState {
    mean: [f64; 3],
    variance: [f64; 3],
    change: [f64; 3],
}

impl PixelState {
    /// The state of a pixel whose mean was `earlier` at the last power of two of samples before.
    pub(crate) fn new(pixel: &ExactPixel, earlier: [f64; 3]) -> Self {
        let mean = pixel.mean();
        Self { mean, variance: pixel.variance_of_mean(), change: [0, 1, 2].map(|c| mean[c] - earlier[c]) }
    }
}

/// Sums over pixels: of `s`, `d`, `ss`, `sd`, `dd`, `doubt`, and the worst pixels.
#[derive(Clone, Debug, Default)]
struct ErrorTotals {
    sums: [f64; 6],
    /// Error and place in the film, worst first.
    worst: Vec<(f64, u32, u32)>,
}

impl ErrorTotals {
    fn add(&mut self, sums: [f64; 6]) {
        for (sum, value) in self.sums.iter_mut().zip(sums) {
            *sum += value;
        }
    }

    fn meet(&mut self, error: f64, [x, y]: [u32; 2]) {
        let last = self.worst.get(WORST - 1).map_or(0.0, |(error, _, _)| *error);
        // Of equals those that came first are kept: they come from the left, and in ascending rows.
        if error > last {
            let at = self.worst.partition_point(|(have, _, _)| *have >= error);
            self.worst.insert(at, (error, x, y));
            self.worst.truncate(WORST);
        }
    }
}

/// Measures a film whose pixels come in their order, in portions.
#[derive(Debug)]
pub(crate) struct ErrorMeasurer {
    samples: u32,
    size: [u32; 2],
    /// Column and row of the film in the picture, and height of the picture.
    window: [u32; 3],
    floor: f64,
    /// States of rows from `first` on.
    states: Vec<PixelState>,
    first: u32,
    /// The next row to be summed.
    next: u32,
    totals: ErrorTotals,
}

impl ErrorMeasurer {
    pub(crate) fn new(header: &FilmHeader, samples: u32) -> Self {
        let [x, y, ..] = header.identity.request.window;
        let [_, height] = header.identity.request.size;
        Self {
            samples,
            size: header.size(),
            window: [x, y, height],
            floor: f64::from(header.view.error_floor),
            states: Vec::new(),
            first: 0,
            next: 0,
            totals: ErrorTotals::default(),
        }
    }

    /// Takes the next pixels.
    pub(crate) fn take(&mut self, states: impl IndexedParallelIterator<Item = PixelState>) {
        self.states.par_extend(states);
        let [width, height] = self.size;
        let rows = self.first + u32::try_from(self.states.len() / width.max(1) as usize).unwrap_or(0);
        // The row above has to be there.
        let end = if rows >= height { height } else { rows.saturating_sub(1) };
        let done: Vec<ErrorTotals> = (self.next..end).into_par_iter().map(|y| self.row(y)).collect();
        for row in done {
            self.totals.add(row.sums);
            row.worst.iter().for_each(|(error, x, y)| self.totals.meet(*error, [*x, *y]));
        }
        self.next = end.max(self.next);
        let kept = self.next.saturating_sub(1).max(self.first);
        self.states.drain(..(kept - self.first) as usize * width as usize);
        self.first = kept;
    }

    /// The result, once all pixels have come.
    pub(crate) fn finish(self) -> OctaveError {
        let [s, d, ss, sd, dd, doubt] = self.totals.sums;
        let [width, height] = self.size.map(f64::from);
        let [left, low, all] = self.window;
        let place = |(error, x, y): &(f64, u32, u32)| WorstPixel {
            x: left + x,
            y: all.saturating_sub(1).saturating_sub(low + y),
            error: *error,
        };
        OctaveError {
            samples: self.samples,
            sums: PictureErrorSums { pixels: width * height, s, d, ss, sd, dd, doubt },
            worst: self.totals.worst.iter().map(place).collect(),
        }
    }

    fn state(&self, x: u32, y: u32) -> PixelState {
        let index = (y - self.first) as usize * self.size[0] as usize + x as usize;
        self.states.get(index).copied().unwrap_or_default()
    }

    fn row(&self, y: u32) -> ErrorTotals {
        let mut totals = ErrorTotals::default();
        for x in 0..self.size[0] {
            let [s, d, doubt] = self.error_of(x, y);
            let doubt = s * doubt;
            totals.add([s, d, s * s, s * d, d * d, doubt * doubt]);
            totals.meet(s, [x, y]);
        }
        totals
    }

    /// Sum and sum of squares of the neighbours' means, and their number.
    fn neighbours(&self, x: u32, y: u32, channel: usize) -> (f64, f64, f64) {
        let (mut sum, mut squares, mut count) = (0.0, 0.0, 0.0);
        let [width, height] = self.size;
        for near_y in y.saturating_sub(1)..=(y + 1).min(height - 1) {
            for near_x in x.saturating_sub(1)..=(x + 1).min(width - 1) {
                if [near_x, near_y] != [x, y] {
                    let mean = self.state(near_x, near_y).mean[channel];
                    sum += mean;
                    squares += mean * mean;
                    count += 1.0;
                }
            }
        }
        (sum, squares, count)
    }

    /// `s`, `d`, and the relative standard error of what they are divided by (`error_of` of the shader).
    fn error_of(&self, x: u32, y: u32) -> [f64; 3] {
        let PixelState { mean, variance, change } = self.state(x, y);
        let (mut s, mut d, mut worst_doubt) = (0.0, 0.0, 0.0_f64);
        for channel in 0..3 {
            let (mean, variance, change) = (mean[channel], variance[channel], change[channel]);
            let (mut level, mut level_variance) = (mean, variance);
            let (sum, squares, count) = self.neighbours(x, y, channel);
            if count > 0.0 {
                let around = sum / count;
                let spread = (squares / count - around * around).max(0.0);
                let apart = mean - around;
                let keep = (1.0 - f64::from(MEAN_TRUST) * variance / (apart * apart).max(1e-30)).clamp(0.0, 1.0);
                level = around + keep * apart;
                level_variance = keep * keep * variance + (1.0 - keep) * (1.0 - keep) * spread;
            }
            let divisor = level * level + self.floor;
            s += variance / divisor;
            d += change * change / divisor;
            worst_doubt = worst_doubt.max(2.0 * level.abs() * level_variance.sqrt() / divisor);
        }
        // min() takes NaN away as well.
        let [s, d] = [s / 3.0, d / 3.0].map(|error: f64| f64::from(MAX_PIXEL_ERROR).min(error));
        [s, d, worst_doubt.min(1.0)]
    }
}
