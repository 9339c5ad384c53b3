// SPDX-License-Identifier: Apache-2.0
//! Filters of pixels, by importance sampling (Ernst, Stamminger and Greiner 2006): a sample belongs to one pixel, and
//! its place about the pixel's centre is chosen by the filter, which is separable. So pixels stay independent of each
//! other, as the film and its error need them.
//!
//! A filter is a table of places by random numbers, for one axis and half of it. Pure, any thread.

use serde::{Deserialize, Serialize};

/// Steps in which a filter is integrated.
const STEPS: u32 = 1 << 13;

/// The shape of a pixel's filter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PixelFilterKind {
    /// Constant.
    #[default]
    Box,
    /// Falls linearly.
    Triangle,
    /// A Gaussian that ends at three standard deviations, less its value there.
    Gaussian,
    /// The four-term Blackman-Harris window.
    BlackmanHarris,
    /// The cubic of Mitchell and Netravali (1988) with B = C = 1/3; it is negative on the outside.
    Mitchell,
}

impl PixelFilterKind {
    /// All values, in the order of the documentation.
    pub const ALL: [Self; 5] = [Self::Box, Self::Triangle, Self::Gaussian, Self::BlackmanHarris, Self::Mitchell];

    /// The name in settings and reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Box => "box",
            Self::Triangle => "triangle",
            Self::Gaussian => "gaussian",
            Self::BlackmanHarris => "blackman-harris",
            Self::Mitchell => "mitchell",
        }
    }

    /// The value of this name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }

    /// The width in pixels if none is asked for.
    #[must_use]
    pub fn usual_width(self) -> f32 {
        match self {
            Self::Box => 1.0,
            Self::Triangle => 2.0,
            Self::Gaussian | Self::BlackmanHarris => 3.0,
            Self::Mitchell => 4.0,
        }
    }

    /// The filter along an axis, not normalised, at `x` times half its width from the centre; 0 from 1 on.
    #[must_use]
    pub fn value(self, x: f64) -> f64 {
        let x = x.abs();
        if x >= 1.0 {
            return 0.0;
        }
        match self {
            Self::Box => 1.0,
            Self::Triangle => 1.0 - x,
            Self::Gaussian => (-4.5 * x * x).exp() - (-4.5_f64).exp(),
            Self::BlackmanHarris => {
                let angle = std::f64::consts::PI * x;
                0.35875 + 0.48829 * angle.cos() + 0.14128 * (2.0 * angle).cos() + 0.01168 * (3.0 * angle).cos()
            }
            Self::Mitchell => {
                let t = 2.0 * x;
                if t < 1.0 {
                    (7.0 * t * t * t - 12.0 * t * t + 16.0 / 3.0) / 6.0
                } else {
                    (-7.0 / 3.0 * t * t * t + 12.0 * t * t - 20.0 * t + 32.0 / 3.0) / 6.0
                }
            }
        }
    }
}

/// The filter of a picture's pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PixelFilter {
    /// Its shape.
    pub kind: PixelFilterKind,
    /// Its full width in pixels: it is 0 farther than half of it from the pixel's centre.
    pub width: f32,
}

/// A filter by random numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct PixelFilterTable {
    /// Pixels from the centre, so that of the filter's absolute value the share `(1 - i / intervals)^2` is farther than
    /// the i-th: linear between two of them. A step has a share of its own size where filters have little left.
    pub offsets: Vec<f32>,
    /// Random number from which on the filter is negative along an axis; above 1 if it never is.
    pub negative_from: f32,
    /// Weight of a sample where the filter is positive, minus that where it is negative: its mean is 1.
    pub weight: f32,
}

impl PixelFilter {
    /// The filter of this shape; of its usual width if `width` is 0.
    #[must_use]
    pub fn new(kind: PixelFilterKind, width: f32) -> Self {
        Self { kind, width: if width > 0.0 { width } else { kind.usual_width() } }
    }

    /// Returns true if it is the square of the pixel, for which samples need no table.
    #[must_use]
    #[expect(clippy::float_cmp, reason = "any other width is another filter")]
    pub fn is_plain(self) -> bool {
        self.kind == PixelFilterKind::Box && self.width == 1.0
    }

    /// The table of so many intervals, at least one.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "rounding to the precision of the device")]
    pub fn table(self, intervals: u32) -> PixelFilterTable {
        let intervals = intervals.max(1);
        let place = |step: u32| f64::from(step) / f64::from(STEPS);
        // Simpson's rule; the sign does not change within a step that counts for anything.
        let part = |step: u32| {
            let (a, b) = (place(step), place(step + 1));
            let values = [a, 0.5 * (a + b), b - 1e-12].map(|x| self.kind.value(x).abs());
            (values[0] + 4.0 * values[1] + values[2]) / 6.0
        };
        let mut sums = vec![0.0];
        let mut negative = 0.0;
        for step in 0..STEPS {
            let here = part(step);
            sums.push(sums[sums.len() - 1] + here);
            if self.kind.value(0.5 * (place(step) + place(step + 1))) < 0.0 {
                negative += here;
            }
        }
        let all = sums[sums.len() - 1];
        let half_width = 0.5 * f64::from(self.width);
        let offset = |interval: u32| {
            let wanted = all * (1.0 - (1.0 - f64::from(interval) / f64::from(intervals)).powi(2));
            let after = sums.partition_point(|sum| *sum < wanted).clamp(1, sums.len() - 1);
            let (low, high) = (sums[after - 1], sums[after]);
            let within = if high > low { ((wanted - low) / (high - low)).clamp(0.0, 1.0) } else { 0.0 };
            (half_width * ((after - 1) as f64 + within) / f64::from(STEPS)) as f32
        };
        let share = negative / all;
        PixelFilterTable {
            offsets: (0..=intervals).map(offset).collect(),
            negative_from: if share > 0.0 { (1.0 - share) as f32 } else { 2.0 },
            weight: (1.0 - 2.0 * share).powi(-2) as f32,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Mean of a function of the place along an axis, over the samples of a table, weighted along this axis alone.
    fn mean(table: &PixelFilterTable, of: impl Fn(f64) -> f64) -> f64 {
        let count = 100_000;
        let sum: f64 = (0..count)
            .map(|k| {
                let v = (f64::from(k) + 0.5) / f64::from(count);
                let at = (1.0 - (1.0 - v).sqrt()) * (table.offsets.len() - 1) as f64;
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "an index")]
                let i = at as usize;
                let [a, b] = [i, i + 1].map(|i| f64::from(table.offsets[i]));
                let sign = if v >= f64::from(table.negative_from) { -1.0 } else { 1.0 };
                sign * f64::from(table.weight).sqrt() * of(a + (at - i as f64) * (b - a))
            })
            .sum();
        sum / f64::from(count)
    }

    /// The same of the filter itself.
    fn exact(filter: PixelFilter, of: impl Fn(f64) -> f64) -> f64 {
        let places = || (0..200_000).map(|k| (f64::from(k) + 0.5) / 200_000.0);
        let all: f64 = places().map(|x| filter.kind.value(x)).sum();
        places().map(|x| filter.kind.value(x) * of(x * 0.5 * f64::from(filter.width))).sum::<f64>() / all
    }

    #[test]
    fn tables_have_the_moments_of_their_filters() {
        for kind in PixelFilterKind::ALL {
            for width in [0.0, 1.3, 7.0] {
                let filter = PixelFilter::new(kind, width);
                let table = filter.table(512);
                assert!((mean(&table, |_| 1.0) - 1.0).abs() < 2e-5, "{kind:?}: weights have mean 1");
                for power in [1, 2, 4] {
                    let unit = (0.5 * f64::from(filter.width)).powi(power);
                    let [told, true_one] = [mean(&table, |x| x.powi(power)), exact(filter, |x| x.powi(power))];
                    assert!((told - true_one).abs() < 1e-5 * unit, "{filter:?}, power {power}: {told}, {true_one}");
                }
            }
        }
    }

    #[test]
    fn only_mitchell_is_negative() {
        for kind in PixelFilterKind::ALL {
            let table = PixelFilter::new(kind, 0.0).table(512);
            assert_eq!(table.weight > 1.0, kind == PixelFilterKind::Mitchell, "{kind:?}: {}", table.weight);
            assert_eq!(table.negative_from < 1.0, kind == PixelFilterKind::Mitchell, "{kind:?}");
        }
        let Some(crossing) =
            (0..1000).map(|k| f64::from(k) / 1000.0).find(|x| PixelFilterKind::Mitchell.value(*x) < 0.0)
        else {
            panic!("it has negative lobes");
        };
        let table = PixelFilter::new(PixelFilterKind::Mitchell, 4.0).table(512);
        let at = (1.0 - (1.0 - f64::from(table.negative_from)).sqrt()) * 512.0;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "an index")]
        let offset = f64::from(table.offsets[at as usize]);
        assert!((offset - 2.0 * crossing).abs() < 0.05, "from {offset}, not {}", 2.0 * crossing);
    }

    #[test]
    fn the_pixels_square_is_the_only_plain_filter() {
        assert!(PixelFilter::new(PixelFilterKind::Box, 0.0).is_plain(), "the usual width");
        assert!(!PixelFilter::new(PixelFilterKind::Box, 1.5).is_plain());
        assert!(!PixelFilter::new(PixelFilterKind::Triangle, 1.0).is_plain());
    }

    proptest! {
        #[test]
        fn offsets_rise_from_the_centre_to_the_edge(kind in 0_usize..5, width in 1e-6_f32..64.0, intervals in 1_u32..600) {
            let filter = PixelFilter::new(PixelFilterKind::ALL[kind], width);
            let PixelFilterTable { offsets, weight, .. } = filter.table(intervals);
            prop_assert_eq!(offsets.len(), intervals as usize + 1);
            prop_assert!(offsets[0].abs() < f32::MIN_POSITIVE && (1.0..2.0).contains(&weight));
            prop_assert!(offsets.windows(2).all(|pair| pair[0] <= pair[1]));
            let edge = offsets[offsets.len() - 1];
            prop_assert!(edge <= 0.5 * width && edge > 0.49 * width, "{} of {}", edge, width);
        }
    }
}
