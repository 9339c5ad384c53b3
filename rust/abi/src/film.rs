// SPDX-License-Identifier: Apache-2.0
//! The film.
//!
//! Guarantees: plain data, from which the build makes the structs of the shaders. Any thread.

use bytemuck::{Pod, Zeroable};

shared! {
    /// Statistics of the samples of a pixel, 80 B. All zero = no sample yet.
    ///
    /// Sums are compensated (Kahan 1965) and taken in ascending sample order, so they do not depend on the size of the
    /// waves, and hold at 2^24 samples.
    #[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
    pub struct FilmPixel {
        /// Sum of (rgb, alpha) over the samples, premultiplied.
        pub sum: [f32; 4],
        /// Rounding error that `sum` contains so far (to be subtracted).
        pub compensation: [f32; 4],
        /// Sum of squared deviations from the mean, per channel (Welford 1962): the variance of a sample is
        /// `m2 / (samples - 1)`, of the pixel `m2 / (samples - 1) / samples`.
        pub m2: [f32; 3],
        /// Number of samples.
        pub samples: u32,
        /// Rounding error that `m2` contains so far (to be subtracted).
        pub m2_compensation: [f32; 3],
        /// Padding; 0.
        pub pad0: u32,
        /// Mean of rgb over the first `p` samples, `p` the largest power of two below `samples`; 0 up to one sample.
        pub earlier: [f32; 3],
        /// As `earlier`, of alpha; only if samples have negative weights.
        pub earlier_alpha: f32,
    }
}

/// Bytes of a [`FilmPixel`].
#[allow(clippy::cast_possible_truncation, reason = "the size of a struct")]
pub const FILM_PIXEL_BYTES: u32 = size_of::<FilmPixel>() as u32;

/// Bytes of an [`ErrorSums`].
#[allow(clippy::cast_possible_truncation, reason = "the size of a struct")]
pub const ERROR_SUMS_BYTES: u32 = size_of::<ErrorSums>() as u32;

/// Largest number of workgroups of `measure_error`.
pub const ERROR_GROUPS: u32 = 1024;

shared! {
    /// Sums of a workgroup of `measure_error` over its pixels, 48 B. For a pixel `s` is the variance of its mean by
    /// that of its samples, and `d` the square of the mean's change since half as many samples, both divided by the
    /// square of the pixel (+ 0.01), mean of the channels.
    #[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
    pub struct ErrorSums {
        /// Sum of `s`.
        pub s: f32,
        /// Sum of `d`.
        pub d: f32,
        /// Sum of `s * s`.
        pub ss: f32,
        /// Sum of `s * d`.
        pub sd: f32,
        /// Sum of `d * d`.
        pub dd: f32,
        /// Sum of `(s * e)^2`, `e` = the relative standard error of the divisor of `s`.
        pub doubt: f32,
        /// Largest `s`.
        pub worst: f32,
        /// Pixel with the largest `s`, as `y * width + x`.
        pub worst_pixel: u32,
        /// Number of pixels with two samples or more.
        pub pixels: u32,
        /// Fewest samples of a pixel.
        pub fewest: u32,
        /// Most samples of a pixel.
        pub most: u32,
        /// Padding; 0.
        pub pad: u32,
    }
}

/// Limbs that an exact sum keeps.
pub const EXACT_LIMBS: usize = 3;
/// Power of two of the least bit of limb 0 of a sum, negated: the smallest positive float is 2^-149.
pub const EXACT_SUM_BIAS: u32 = 149;
/// As [`EXACT_SUM_BIAS`], of a sum of squares.
pub const EXACT_SQUARE_BIAS: u32 = 2 * EXACT_SUM_BIAS;
/// Fractional bits of `ExactPixel::alpha`.
pub const EXACT_ALPHA_BITS: u32 = 32;
/// Power of two at which the magnitude of a sample's alpha is cut off.
pub const MAX_EXACT_ALPHA: u32 = 20;
/// Bits of an index in `ExactPixel::lowest`; those of the sums of squares are behind those of the sums.
pub const EXACT_LOWEST_BITS: u32 = 4;

shared! {
    /// Exact sums over samples of a pixel, in any order, 160 B. All zero = no sample yet. The same samples give the
    /// same bits, however they are ordered and cut.
    ///
    /// A number is cut into chunks of 32 bits at fixed places: limb `i` counts multiples of `2^(32 i - 149)` in sums,
    /// of `2^(32 i - 298)` in sums of squares. A finite float `m 2^(p - 149)` (`m` of 24 bits, `p` in 0..=253) has
    /// chunks in up to two limbs, its square `m^2 2^(2p - 298)` in up to three. Chunks have the sign of the number.
    /// Each limb is the sum of its chunks, without carries, and holds 2^31 of them.
    ///
    /// Of each sum the three highest limbs are kept: limb `top`, in which the largest number so far has its highest
    /// bit, or limb 2 if that is higher, and the two below. Chunks below are dropped, also those added before: what is
    /// left is what would be there if all numbers had come with the window known, so it depends on no order (the idea:
    /// Demmel and Nguyen 2013, "Fast Reproducible Floating-Point Summation"). What is lost of `n` numbers is below
    /// `n 2^-64` of the largest.
    #[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Pod, Zeroable)]
    pub struct ExactPixel {
        /// Sum of r, g, b, each from its lowest limb kept; a sample with a component that is not finite counts 0.
        pub sum: [[i64; 3]; 3],
        /// Sum of the squares of r, g, b, likewise; limbs are never negative.
        pub squares: [[i64; 3]; 3],
        /// Sum of alpha in units of 2^-32, each sample's towards zero, and magnitudes from 2^20 on (also infinity and
        /// NaN) as 2^20. It wraps; sums below 2^31 hold.
        pub alpha: i64,
        /// Numbers of the lowest limbs kept, `top - 2`, 4 bits each: of the sums from bit 0 (0..=6), of the sums of
        /// squares from bit 12 (0..=15). The rest is 0.
        pub lowest: u32,
        /// Number of samples, at most 2^31.
        pub samples: u32,
    }
}
