// SPDX-License-Identifier: Apache-2.0
//! Estimates the relative mean squared error of a picture against its converged state, with a 95 % confidence interval,
//! from sums that the film takes when its sample count is a power of two. Pure; `f64`; any thread.
//!
//! # What is estimated
//! `relMSE = mean over pixels of mean over channels of (x - mu)^2 / (mu^2 + 0.01)` (Rousselle et al. 2011, "Adaptive
//! sampling and reconstruction using greedy error minimization", eq. 12): `x` is this very picture, `mu` the one with
//! infinitely many samples.
//!
//! # How
//! Samples of a pixel are scrambled Sobol points (Owen 1997), not independent: the variance `s` of the samples over
//! their number overestimates the error. Halves of `2^m` such samples are exchangeable, so the change `d` of the mean
//! from `2^(m-1)` to `2^m` samples has the mean square `V(2^(m-1)) - V(2^m)`, `V(n)` the variance of the mean; and
//! `V(2^m)` is the sum of all changes to come. Of `R = d / s`, summed over all pixels, a Kalman filter over the octaves
//! follows `ln R` and its slope `-b`. An integrand is a sum of parts whose variances fall with their own powers of the
//! samples (ANOVA and smoothness: Owen 1997), and those that fall fast die first, so the slope dies too. It is taken
//! for that of two parts, with the powers of `PARTS` on both sides of `b`: that gives the next slope, and the share of
//! the change that is still to come. Independent samples give `R = 1`, `b = 0` and the textbook `s`.
//!
//! # The interval
//! The interval is log-normal, from three independent parts: the uncertainty of the filter; the difference of this
//! picture's error from its mean (signs of halves may be swapped, so `sum (d - R s)^2` is the variance of `sum x^2`
//! too, for a lone firefly as for Gaussian noise); and the standard errors of the means that errors are divided by.
//! Between powers of two the estimate lies between that of independent blocks and the power law, and the interval
//! covers both.

use serde::{Deserialize, Serialize};

/// relMSE that remains from rounding in single precision.
const ROUNDING: f64 = 1e-14;
/// Slope of `ln R` downwards a priori, per octave in units of `ln 2`, and its standard deviation.
const SLOPE: (f64, f64) = (0.3, 0.4);
/// Steepest slope that is accepted: that of smooth integrands, whose variance falls as the cube of the samples.
const STEEPEST: f64 = 2.0;
/// Slopes of parts of an integrand: noise in many dimensions, edges, edges met by one dimension, smooth. Measured
/// (decisions/0009): with one part of any slope the estimate is a fifth low.
const PARTS: [f64; 4] = [0.0, 0.7, 1.0, STEEPEST];
/// Standard deviations by which `ln R` and its slope may change besides, per octave.
const DRIFT: (f64, f64) = (0.1, 0.15);
/// Variance of the logarithm of the estimate that effects outside of the model add.
const MODEL: f64 = 0.02;
/// Quantile of a two-sided 95 % interval of the normal distribution.
const Z: f64 = 1.959_963_985;

/// Sums over the pixels of a picture. `s` and `d`, defined in the lead of the module, are relative, squared and
/// averaged over the channels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct PictureErrorSums {
    /// Pixels of the picture.
    pub pixels: f64,
    /// Sum of `s`, the variance of the mean by that of the samples.
    pub s: f64,
    /// Sum of `d`, the squared change of the mean since the last power of two below.
    pub d: f64,
    /// Sum of `s * s`.
    pub ss: f64,
    /// Sum of `s * d`.
    pub sd: f64,
    /// Sum of `d * d`.
    pub dd: f64,
    /// Sum of `(s * e)^2`, `e` the relative standard error of the divisor.
    pub doubt: f64,
}

/// An estimate of relMSE.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct ErrorEstimate {
    /// The estimate.
    pub rel_mse: f64,
    /// Lower end of the 95 % confidence interval.
    pub low: f64,
    /// Upper end of the 95 % confidence interval.
    pub high: f64,
}

/// Mean and covariance of (`ln R`, slope of `ln G` downwards in units of `ln 2`).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct FilterState {
    log_ratio: f64,
    slope: f64,
    /// Covariance of the filter's state: variance of the ratio, covariance, variance of the slope.
    covariance: [f64; 3],
}

/// Follows one render through the octaves.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ConvergenceEstimator {
    /// The last octave, and the filter's state after it.
    last: Option<(u32, FilterState)>,
}

/// The part of the expected `s` that exists because samples that cover the domain evenly spread wider than independent
/// ones: `E s = sigma^2 / n (n - G) / (n - 1)`, with `G` the ratio of the variances of the two kinds of means.
fn spread_wide(samples: f64, gain: f64) -> f64 {
    (samples - gain.clamp(0.0, 1.0)) / (samples - 1.0).max(1.0)
}

/// For a slope that two parts add up to: the slope an octave later, and `V(n)` over `V(n/2) - V(n)`.
fn parts(slope: f64) -> (f64, f64) {
    let slope = slope.clamp(0.0, STEEPEST);
    let above = PARTS.iter().skip(1).position(|part| slope <= *part).unwrap_or(PARTS.len() - 2);
    let (flat, steep) = (PARTS[above], PARTS[above + 1]);
    let [slow, fast, fell] = [flat, steep, slope].map(|slope| (-slope).exp2());
    // Share of the steep part in the last change: it was larger in the change before.
    let share = (slow - fell) / (slow - fast) * fast / fell;
    let next = -((1.0 - share) * slow + share * fast).log2();
    let to_come = |part: f64| 1.0 / ((1.0 + part).exp2() - 1.0);
    (next, (1.0 - share) * to_come(flat) + share * to_come(steep))
}

/// Derivative of `of(slope)`.
fn derivative(slope: f64, of: impl Fn(f64) -> f64) -> f64 {
    let (low, high) = ((slope - 1e-3).max(0.0), (slope + 1e-3).min(STEEPEST));
    (of(high) - of(low)) / (high - low)
}

impl PictureErrorSums {
    /// Adds the sums over other pixels of the same picture.
    pub fn add(&mut self, other: &Self) {
        let Self { pixels, s, d, ss, sd, dd, doubt } = other;
        let terms = [(&mut self.pixels, pixels), (&mut self.s, s), (&mut self.d, d), (&mut self.ss, ss)];
        let more = [(&mut self.sd, sd), (&mut self.dd, dd), (&mut self.doubt, doubt)];
        terms.into_iter().chain(more).for_each(|(sum, term)| *sum += term);
    }

    /// The square of the relative scatter of `d` around `ratio * s`.
    fn scatter(&self, ratio: f64) -> f64 {
        let around = ratio.mul_add(ratio * self.ss, (-2.0 * ratio).mul_add(self.sd, self.dd));
        around.max(0.0) / (ratio * self.s).powi(2).max(f64::MIN_POSITIVE)
    }

    fn is_sound(&self) -> bool {
        let all = [self.pixels, self.s, self.d, self.ss, self.sd, self.dd, self.doubt];
        all.iter().all(|v| v.is_finite() && *v >= 0.0) && self.pixels >= 1.0
    }
}

impl FilterState {
    fn first(log_ratio: f64, variance: f64) -> Self {
        Self { log_ratio, slope: SLOPE.0, covariance: [variance, 0.0, SLOPE.1 * SLOPE.1] }
    }

    /// The state predicted for the next octave.
    fn predicted(self) -> Self {
        let ln2 = std::f64::consts::LN_2;
        let [ratio, both, slope] = self.covariance;
        let (next, _) = parts(self.slope);
        // At most 1: if there is only a steep part, its slope is not known better than that.
        let kept = derivative(self.slope, |slope| parts(slope).0).min(1.0);
        let step = kept * ln2;
        let covariance = [
            (step * step).mul_add(slope, (-2.0 * step).mul_add(both, ratio)) + DRIFT.0 * DRIFT.0,
            kept * (both - step * slope),
            (kept * kept).mul_add(slope, DRIFT.1 * DRIFT.1),
        ];
        Self { log_ratio: self.log_ratio - ln2 * next, slope: next, covariance }
    }

    /// The state after an observation of `log_ratio` with the given variance at an octave.
    fn updated(self, log_ratio: f64, variance: f64, octave: u32) -> Self {
        let [ratio, both, slope] = self.covariance;
        let surprise = log_ratio - self.log_ratio;
        let expected = ratio + variance;
        if surprise > 0.0 && surprise * surprise > 9.0 * expected {
            // A new effect, such as the first firefly: the past has no information about it, and the step from
            // independent samples has little.
            let slope = (-log_ratio / (f64::from(octave) * std::f64::consts::LN_2)).clamp(0.0, SLOPE.0);
            return Self { log_ratio, slope, covariance: [variance, 0.0, SLOPE.1 * SLOPE.1 / 4.0] };
        }
        let gain = [ratio / expected, both / expected];
        Self {
            log_ratio: gain[0].mul_add(surprise, self.log_ratio),
            slope: gain[1].mul_add(surprise, self.slope).clamp(0.0, STEEPEST),
            covariance: [(1.0 - gain[0]) * ratio, (1.0 - gain[0]) * both, slope - gain[1] * both],
        }
    }

    /// Variance of the logarithm of the estimate.
    fn variance(&self) -> f64 {
        let by_slope = derivative(self.slope, |slope| parts(slope).1.ln());
        let [ratio, both, slope] = self.covariance;
        (by_slope * by_slope).mul_add(slope, (2.0 * by_slope).mul_add(both, ratio)).max(0.0)
    }
}

impl ConvergenceEstimator {
    /// Updates the filter with the film at `2^octave` samples in every pixel, and returns the estimated error; `None`
    /// below two samples or if the sums are not sound. Octaves come in ascending order; some may be missing.
    pub fn octave(&mut self, octave: u32, sums: &PictureErrorSums) -> Option<ErrorEstimate> {
        if octave == 0 || octave > 32 || !sums.is_sound() {
            return None;
        }
        if sums.s <= 0.0 || sums.d <= 0.0 {
            return Some(ErrorEstimate { rel_mse: 0.0, low: 0.0, high: ROUNDING });
        }
        let samples = f64::from(octave).exp2();
        let wide = spread_wide(samples, sums.d / sums.s);
        let ratio = sums.d / sums.s * wide;
        let scatter = sums.scatter(sums.d / sums.s).max(1e-6).ln_1p();
        // The mean of a log-normal ratio, not its median.
        let seen = (0.5_f64.mul_add(scatter.min(1.0), ratio.ln()), scatter);
        let state = match self.last {
            None => FilterState::first(seen.0, seen.1),
            Some((last, mut state)) => {
                for _ in last..octave {
                    state = state.predicted();
                }
                state.updated(seen.0, seen.1, octave)
            }
        };
        // At two samples `d` and `s` are one and the same.
        if octave > 1 {
            self.last = Some((octave, state));
        }
        let ratio = state.log_ratio.exp();
        let value = ratio * parts(state.slope).1 * sums.s / wide;
        Some(interval(value, sums, state.variance(), sums.scatter(ratio / wide)))
    }

    /// The error at any number of samples that is at least that of the last octave.
    #[must_use]
    pub fn between(&self, samples: f64, sums: &PictureErrorSums) -> Option<ErrorEstimate> {
        let (octave, state) = self.last?;
        if !sums.is_sound() || samples.is_nan() || samples < f64::from(octave).exp2() {
            return None;
        }
        if sums.s <= 0.0 {
            return Some(ErrorEstimate { rel_mse: 0.0, low: 0.0, high: ROUNDING });
        }
        let gain = state.log_ratio.exp() * parts(state.slope).1;
        let by_law = (samples / f64::from(octave).exp2()).powf(-parts(state.slope).0);
        let by_blocks = blocks(samples, octave, state.slope).max(by_law);
        let value = gain * (by_law * by_blocks).sqrt() * sums.s / spread_wide(samples, gain);
        let between = 0.5 * (by_blocks / by_law).ln();
        // The scatter of Gaussian noise: an upper bound where fireflies lead.
        let scatter = 2.0 * sums.ss / (sums.s * sums.s);
        Some(interval(value, sums, between.mul_add(between, state.variance()), scatter))
    }
}

/// The error of an adaptive picture, which is half the sum of two means that share no sample (see [`crate::adaptive`]).
/// The square of half their difference, `d` of `sums`, has the same expectation as that of the picture's error, without
/// any model. None below two samples or without sound sums.
#[must_use]
pub fn of_halves(sums: &PictureErrorSums) -> Option<ErrorEstimate> {
    if !sums.is_sound() {
        return None;
    }
    if sums.s <= 0.0 || sums.d <= 0.0 {
        return Some(ErrorEstimate { rel_mse: 0.0, low: 0.0, high: ROUNDING });
    }
    // Estimate and error have the same distribution, and are all but independent.
    let scatter = sums.scatter(sums.d / sums.s);
    Some(interval(sums.d, sums, scatter.ln_1p(), scatter))
}

/// Variance of the mean of `samples` in independent blocks of powers of two, relative to the variance that independent
/// samples would have, extrapolated from `2^octave`.
fn blocks(samples: f64, octave: u32, slope: f64) -> f64 {
    let mut rest = samples.floor();
    let mut sum = 0.0;
    while rest >= 1.0 {
        let block = rest.log2().floor().exp2();
        sum += block * (block / f64::from(octave).exp2()).powf(-slope);
        rest -= block;
    }
    sum / samples.max(1.0)
}

fn interval(sum: f64, sums: &PictureErrorSums, state: f64, scatter: f64) -> ErrorEstimate {
    let doubt = sums.doubt / (sums.s * sums.s).max(f64::MIN_POSITIVE);
    // This picture's error is skewed too: its median lies below its mean.
    let middle = (-0.5 * scatter.ln_1p().min(1.0)).exp();
    let spread = (Z * (MODEL + state + scatter.ln_1p() + doubt.ln_1p()).sqrt()).min(60.0);
    let rel_mse = sum / sums.pixels;
    ErrorEstimate {
        rel_mse,
        low: (rel_mse * middle * (-spread).exp() - ROUNDING).max(0.0),
        high: (rel_mse * middle).mul_add(spread.exp(), ROUNDING),
    }
}
