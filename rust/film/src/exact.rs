// SPDX-License-Identifier: Apache-2.0
//! Exact sums of the samples of a pixel: what the shaders do, bit for bit, and the numbers that follow from them.
//!
//! Guarantees: integers only, until a sum is rounded once to an `f64`. Those operations of `f64` that follow are IEEE's
//! and never fused: the same bits on every machine. Pure; any thread.

use oocpt_abi::{
    EXACT_ALPHA_BITS, EXACT_LIMBS, EXACT_LOWEST_BITS, EXACT_SQUARE_BIAS, EXACT_SUM_BIAS, ExactPixel, MAX_EXACT_ALPHA,
};

/// Bits of a limb's chunk.
const CHUNK_BITS: u32 = 32;
/// Bits of the fraction of a float.
const FRACTION_BITS: u32 = 23;
/// What is left of a float's bits without the sign.
const MAGNITUDE: u32 = 0x7fff_ffff;
/// Bits of infinity.
const INFINITY: u32 = 0x7f80_0000;
/// Limbs that a number has chunks in, at most.
const SPAN: u32 = 3;

/// A finite float as `fraction * 2^(position - 149)`, and its sign.
#[derive(Clone, Copy)]
struct FloatParts {
    fraction: u32,
    position: u32,
    is_negative: bool,
}

fn parts(value: f32) -> FloatParts {
    let bits = value.to_bits();
    let exponent = (bits & MAGNITUDE) >> FRACTION_BITS;
    let fraction = bits & ((1 << FRACTION_BITS) - 1);
    // Subnormal numbers have the place of the smallest normal ones.
    let hidden = u32::from(exponent > 0) << FRACTION_BITS;
    FloatParts { fraction: fraction | hidden, position: exponent.max(1) - 1, is_negative: bits != bits & MAGNITUDE }
}

/// Bit at which the index of the lowest limb of a channel is: of the sums, then of the sums of squares.
fn lowest_at(of_squares: bool, channel: usize) -> u32 {
    let index = if of_squares { 3 + channel } else { channel };
    (0..).step_by(EXACT_LOWEST_BITS as usize).nth(index).unwrap_or(0)
}

/// Moves a window of limbs up.
fn raise(limbs: &mut [i64; EXACT_LIMBS], by: u32) {
    for _ in 0..by.min(SPAN) {
        *limbs = [limbs[1], limbs[2], 0];
    }
}

/// Adds `magnitude * 2^position`, below 2^79 at a position below 32, to a window of limbs.
fn add(limbs: &mut [i64; EXACT_LIMBS], lowest: &mut u32, (magnitude, position): (u64, u32), is_negative: bool) {
    let wide = u128::from(magnitude) << (position % CHUNK_BITS);
    let first = position / CHUNK_BITS;
    let bits = u128::BITS - wide.leading_zeros();
    let top = first + bits.saturating_sub(1) / CHUNK_BITS;
    let least = if bits == 0 { 0 } else { top.saturating_sub(SPAN - 1) };
    if least > *lowest {
        raise(limbs, least - *lowest);
        *lowest = least;
    }
    for chunk in 0..SPAN {
        let Some(limb) = (first + chunk).checked_sub(*lowest).and_then(|index| limbs.get_mut(index as usize)) else {
            continue;
        };
        #[expect(clippy::cast_possible_truncation, reason = "a chunk")]
        let value = i64::from((wide >> (CHUNK_BITS * chunk)) as u32);
        *limb = limb.wrapping_add(if is_negative { -value } else { value });
    }
}

/// A sample's alpha in units of 2^-32, towards zero.
fn fixed(alpha: f32) -> i64 {
    let FloatParts { fraction, position, is_negative } = parts(alpha);
    // The place of the unit; a fraction of 24 bits that lies below it by more is nothing.
    let unit = EXACT_SUM_BIAS - EXACT_ALPHA_BITS;
    let most = 1_i64 << (MAX_EXACT_ALPHA + EXACT_ALPHA_BITS);
    let limit = (127 + MAX_EXACT_ALPHA) << FRACTION_BITS;
    let magnitude = if alpha.to_bits() & MAGNITUDE >= limit {
        most
    } else if position >= unit {
        i64::from(fraction) << (position - unit)
    } else {
        i64::from(fraction.checked_shr(unit - position).unwrap_or(0))
    };
    if is_negative { -magnitude } else { magnitude }
}

/// A power of two that is a normal `f64`.
fn power_of_two(exponent: i32) -> f64 {
    f64::from_bits(u64::from((exponent + 1023).clamp(1, 2046).unsigned_abs()) << 52)
}

/// A window of limbs as a number: exact, then rounded once.
fn value(limbs: &[i64; EXACT_LIMBS], lowest: u32, bias: u32) -> f64 {
    let [low, middle, high] = limbs.map(i128::from);
    let all = low.wrapping_add(middle << CHUNK_BITS).wrapping_add(high << (2 * CHUNK_BITS));
    #[expect(clippy::cast_precision_loss, reason = "rounds to the nearest")]
    let rounded = all as f64;
    rounded * power_of_two((CHUNK_BITS * lowest).cast_signed() - bias.cast_signed())
}

/// What can be done with an [`ExactPixel`].
pub trait ExactSums {
    /// Adds a sample, premultiplied rgb and alpha. Returns false if a component of its colour is not finite: the sample
    /// then counts as black, as in the plain film.
    fn add_sample(&mut self, rgba: [f32; 4]) -> bool;

    /// Adds all samples of another pixel.
    fn merge(&mut self, other: &Self);

    /// Sum of each channel, rounded once.
    fn sums(&self) -> [f64; 3];

    /// Sum of the squares of each channel, rounded once.
    fn square_sums(&self) -> [f64; 3];

    /// Mean of the colour; black without samples.
    fn mean(&self) -> [f64; 3];

    /// Mean of alpha.
    fn alpha_mean(&self) -> f64;

    /// Variance of the mean, if samples were independent; 0 below two samples.
    fn variance_of_mean(&self) -> [f64; 3];

    /// Whether so many samples can have given these sums.
    fn is_sound(&self) -> bool;
}

/// Number of the lowest limb that is kept.
fn lowest(pixel: &ExactPixel, of_squares: bool, channel: usize) -> u32 {
    pixel.lowest >> lowest_at(of_squares, channel) & ((1 << EXACT_LOWEST_BITS) - 1)
}

fn set_lowest(pixel: &mut ExactPixel, of_squares: bool, channel: usize, index: u32) {
    let at = lowest_at(of_squares, channel);
    pixel.lowest = pixel.lowest & !(((1 << EXACT_LOWEST_BITS) - 1) << at) | index << at;
}

fn window(pixel: &mut ExactPixel, of_squares: bool, channel: usize) -> &mut [i64; EXACT_LIMBS] {
    if of_squares { &mut pixel.squares[channel] } else { &mut pixel.sum[channel] }
}

impl ExactSums for ExactPixel {
    fn add_sample(&mut self, rgba: [f32; 4]) -> bool {
        let is_finite = rgba[..3].iter().all(|v| v.to_bits() & MAGNITUDE < INFINITY);
        if is_finite {
            for (channel, number) in rgba[..3].iter().enumerate() {
                let FloatParts { fraction, position, is_negative } = parts(*number);
                let square = (u64::from(fraction) * u64::from(fraction), 2 * position);
                let terms = [(false, (u64::from(fraction), position), is_negative), (true, square, false)];
                for (of_squares, term, is_negative) in terms {
                    let mut index = lowest(self, of_squares, channel);
                    add(window(self, of_squares, channel), &mut index, term, is_negative);
                    set_lowest(self, of_squares, channel, index);
                }
            }
        }
        self.alpha = self.alpha.wrapping_add(fixed(rgba[3]));
        self.samples = self.samples.wrapping_add(1);
        is_finite
    }

    fn merge(&mut self, other: &Self) {
        for (of_squares, channel) in [false, true].into_iter().flat_map(|of| (0..3).map(move |channel| (of, channel))) {
            let [mine, its] = [lowest(self, of_squares, channel), lowest(other, of_squares, channel)];
            let mut added = *window(&mut { *other }, of_squares, channel);
            let limbs = window(self, of_squares, channel);
            raise(limbs, its.saturating_sub(mine));
            raise(&mut added, mine.saturating_sub(its));
            for (limb, added) in limbs.iter_mut().zip(added) {
                *limb = limb.wrapping_add(added);
            }
            set_lowest(self, of_squares, channel, mine.max(its));
        }
        self.alpha = self.alpha.wrapping_add(other.alpha);
        self.samples = self.samples.wrapping_add(other.samples);
    }

    fn sums(&self) -> [f64; 3] {
        [0, 1, 2].map(|channel| value(&self.sum[channel], lowest(self, false, channel), EXACT_SUM_BIAS))
    }

    fn square_sums(&self) -> [f64; 3] {
        [0, 1, 2].map(|channel| value(&self.squares[channel], lowest(self, true, channel), EXACT_SQUARE_BIAS))
    }

    fn mean(&self) -> [f64; 3] {
        self.sums().map(|sum| sum / f64::from(self.samples.max(1)))
    }

    fn alpha_mean(&self) -> f64 {
        #[expect(clippy::cast_precision_loss, reason = "rounds to the nearest")]
        let sum = self.alpha as f64;
        sum * power_of_two(-EXACT_ALPHA_BITS.cast_signed()) / f64::from(self.samples.max(1))
    }

    fn variance_of_mean(&self) -> [f64; 3] {
        if self.samples < 2 {
            return [0.0; 3];
        }
        let samples = f64::from(self.samples);
        let (sums, squares) = (self.sums(), self.square_sums());
        [0, 1, 2].map(|c| (squares[c] - sums[c] * sums[c] / samples).max(0.0) / (samples - 1.0) / samples)
    }

    fn is_sound(&self) -> bool {
        let most = u64::from(self.samples) * u64::from(u32::MAX);
        let fits = self.sum.as_flattened().iter().all(|limb| limb.unsigned_abs() <= most);
        let squares = self.squares.as_flattened().iter().all(|limb| *limb >= 0 && limb.unsigned_abs() <= most);
        let most_lowest = [6, 6, 6, 15, 15, 15];
        let lowest = (0..).step_by(EXACT_LOWEST_BITS as usize).zip(most_lowest);
        let windows = lowest.into_iter().all(|(at, most)| self.lowest >> at & ((1 << EXACT_LOWEST_BITS) - 1) <= most);
        fits && squares && windows && self.lowest >> (6 * EXACT_LOWEST_BITS) == 0
    }
}
