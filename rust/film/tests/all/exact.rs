// SPDX-License-Identifier: Apache-2.0
//! Exact sums: no order, no cut changes a bit, and they are the sums.

use oocpt_film::{ExactPixel, ExactSums as _};
use proptest::prelude::*;

/// Any finite number, with many from the edges of what a float holds.
fn hostile() -> impl Strategy<Value = f32> {
    let any = any::<u32>().prop_map(|bits| {
        let value = f32::from_bits(bits);
        if value.is_finite() { value } else { f32::from_bits(bits & !(1 << 30)) }
    });
    let edges = prop_oneof![
        Just(0.0),
        Just(-0.0),
        Just(f32::from_bits(1)),
        Just(-f32::from_bits(1)),
        Just(f32::from_bits(0x007f_ffff)),
        Just(f32::MIN_POSITIVE),
        Just(1e-38),
        Just(1.0),
        Just(-1.0),
        Just(3e38),
        Just(f32::MAX),
        Just(f32::MIN),
    ];
    prop_oneof![any, edges, 0.0_f32..1.0, -1e9_f32..1e9]
}

fn sample() -> impl Strategy<Value = [f32; 4]> {
    let alpha = prop_oneof![0.0_f32..=1.0, hostile()];
    ([hostile(), hostile(), hostile()], alpha).prop_map(|([r, g, b], alpha)| [r, g, b, alpha])
}

fn record(samples: &[[f32; 4]]) -> ExactPixel {
    let mut record = ExactPixel::default();
    samples.iter().for_each(|sample| assert!(record.add_sample(*sample), "{sample:?} is finite"));
    record
}

/// An integer of 704 bits, two's complement, in units of 2^-298.
#[derive(Clone, Copy, Default, PartialEq, Debug)]
struct Wide([u64; 11]);

impl Wide {
    fn add(&mut self, other: Self) {
        let mut carry = 0;
        for (mine, its) in self.0.iter_mut().zip(other.0) {
            let sum = u128::from(*mine) + u128::from(its) + carry;
            *mine = sum as u64;
            carry = sum >> 64;
        }
    }

    fn negated(self) -> Self {
        let mut all = Self(self.0.map(|word| !word));
        let mut one = Self::default();
        one.0[0] = 1;
        all.add(one);
        all
    }

    fn is_negative(self) -> bool {
        self.0[10] >> 63 == 1
    }

    /// `value * 2^at`.
    fn new(value: i128, at: u32) -> Self {
        let mut all = Self::default();
        let (word, bit) = (at as usize / 64, at % 64);
        let magnitude = value.unsigned_abs();
        let (low, high) = (magnitude as u64, (magnitude >> 64) as u64);
        all.0[word] = low << bit;
        all.0[word + 1] = high << bit | low.checked_shr(64 - bit).unwrap_or(0);
        if let Some(top) = all.0.get_mut(word + 2) {
            *top = high.checked_shr(64 - bit).unwrap_or(0);
        }
        if value < 0 { all.negated() } else { all }
    }

    /// In units of 1, rounded somehow.
    fn to_f64(self) -> f64 {
        let magnitude = if self.is_negative() { self.negated() } else { self };
        let sum: f64 =
            (0..11_i32).zip(magnitude.0).map(|(word, bits)| bits as f64 * 2.0_f64.powi(64 * word - 298)).sum();
        if self.is_negative() { -sum } else { sum }
    }
}

/// A float as `fraction * 2^(position - 149)`, by what `f64` says of it.
fn parts(value: f32) -> (i128, u32) {
    let value = f64::from(value);
    let mut position = 0;
    while (value * 2.0_f64.powi(149 - i32::try_from(position).expect("small"))).abs() >= 2.0_f64.powi(24) {
        position += 1;
    }
    (((value * 2.0_f64.powi(149 - i32::try_from(position).expect("small"))) as i128), position)
}

/// The limbs of a record's channel as a number.
fn of_limbs(limbs: [i64; 3], lowest: u32, unit: u32) -> Wide {
    let mut sum = Wide::default();
    for (limb, at) in limbs.into_iter().zip([0, 32, 64]) {
        sum.add(Wide::new(i128::from(limb), 32 * lowest + at + unit));
    }
    sum
}

/// Compares sums with exact ones: `n` numbers may lose `n 2^-64` of the largest.
fn compare(sums: Wide, exact: Wide, n: usize, largest: f64, rounded: f64) -> Result<(), TestCaseError> {
    let mut difference = sums;
    difference.add(exact.negated());
    let bound = n as f64 * 2.0_f64.powi(-64) * largest;
    prop_assert!(difference.to_f64().abs() <= bound, "off by {:e}, bound {bound:e}", difference.to_f64());
    let off = (rounded - sums.to_f64()).abs();
    prop_assert!(
        off <= 1e-15 * rounded.abs() + f64::MIN_POSITIVE,
        "{rounded:e} is rounded once from {:e}",
        sums.to_f64()
    );
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn no_order_and_no_cut_changes_a_bit(
        samples in prop::collection::vec((sample(), 0_usize..5, any::<u32>()), 1..60),
        order in Just([0, 1, 2, 3, 4]).prop_shuffle(),
    ) {
        let all: Vec<[f32; 4]> = samples.iter().map(|(sample, ..)| *sample).collect();
        let expected = record(&all);
        let mut shuffled = samples;
        shuffled.sort_by_key(|(_, _, key)| *key);
        let mut merged = ExactPixel::default();
        for part in order {
            let own: Vec<[f32; 4]> = shuffled.iter().filter(|(_, of, _)| *of == part).map(|(s, ..)| *s).collect();
            merged.merge(&record(&own));
        }
        prop_assert_eq!(merged, expected);
        prop_assert!(merged.is_sound(), "what the sums of samples are is what files may have");
    }

    #[test]
    fn sums_are_those_of_the_samples(samples in prop::collection::vec(sample(), 1..60)) {
        let record = record(&samples);
        let (sums, squares) = (record.sums(), record.square_sums());
        for channel in 0..3 {
            let (mut sum, mut square) = (Wide::default(), Wide::default());
            let mut largest = 0.0_f64;
            for sample in &samples {
                let (fraction, position) = parts(sample[channel]);
                sum.add(Wide::new(fraction, position + 149));
                square.add(Wide::new(fraction * fraction, 2 * position));
                largest = largest.max(f64::from(sample[channel]).abs());
            }
            let lowest = |index: usize| record.lowest >> (4 * index) & 15;
            compare(of_limbs(record.sum[channel], lowest(channel), 149), sum, samples.len(), largest, sums[channel])?;
            let have = of_limbs(record.squares[channel], lowest(3 + channel), 0);
            compare(have, square, samples.len(), largest * largest, squares[channel])?;
        }
    }

    #[test]
    fn alpha_is_cut_towards_zero(alpha in prop_oneof![hostile(), 0.0_f32..=1.0, -2e6_f32..2e6]) {
        let mut record = ExactPixel::default();
        record.add_sample([0.0, 0.0, 0.0, alpha]);
        let expected = (f64::from(alpha).clamp(-1_048_576.0, 1_048_576.0) * 4_294_967_296.0).trunc();
        prop_assert_eq!(record.alpha, expected as i64);
    }
}

#[test]
fn two_to_the_31_samples_of_the_largest_float_hold() {
    for value in [f32::MAX, f32::MIN, f32::from_bits(1), 1.0] {
        let mut record = record(&[[value, -value, value, 0.999]]);
        for _ in 0..31 {
            record.merge(&{ record });
        }
        assert_eq!(record.samples, 1 << 31);
        assert!(record.is_sound(), "{value}");
        assert_eq!(record.mean(), [f64::from(value), -f64::from(value), f64::from(value)]);
        let alpha = (f64::from(0.999_f32) * 4_294_967_296.0).trunc() / 4_294_967_296.0;
        assert!((record.alpha_mean() - alpha).abs() < 1e-15, "{}", record.alpha_mean());
        assert!(record.variance_of_mean()[0] < 1e-24 * f64::from(value) * f64::from(value), "all are the same");
    }
}

#[test]
fn samples_that_are_not_finite_count_as_black() {
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let mut record = ExactPixel::default();
        assert!(!record.add_sample([1.0, bad, 1.0, 1.0]), "it is told");
        assert_eq!((record.samples, record.sum, record.alpha), (1, [[0; 3]; 3], 1 << 32), "as in the plain film");
        record.add_sample([0.0, 0.0, 0.0, bad]);
        let most = if bad.is_sign_negative() { -(1_i64 << 52) } else { 1 << 52 };
        assert_eq!(record.alpha, (1 << 32) + most, "alpha is cut off");
    }
}

#[test]
fn variance_is_that_of_the_samples() {
    let values: [f32; 5] = [0.5, 0.25, 1e-3, 7.0, 0.0];
    let record = record(&values.map(|v| [v, 2.0 * v, 1e20 * v, 1.0]));
    let mean = values.iter().map(|v| f64::from(*v)).sum::<f64>() / 5.0;
    let variance = values.iter().map(|v| (f64::from(*v) - mean).powi(2)).sum::<f64>() / 4.0 / 5.0;
    for (have, factor) in record.variance_of_mean().into_iter().zip([1.0, 4.0, 1e40]) {
        assert!((have / (factor * variance) - 1.0).abs() < 1e-6, "{have} of {factor}");
    }
    assert_eq!(ExactPixel::default().variance_of_mean(), [0.0; 3]);
}

#[test]
fn a_sum_is_rounded_once() {
    // Half of the last bit of 2^69, and a little more: limb by limb it would be lost.
    let large = 2.0_f32.powi(69);
    let sum = record(&[[large; 4], [65536.0; 4], [1.0 / 32.0; 4]]).sums()[0];
    assert_eq!(sum, f64::from(large) + 131_072.0);
}
