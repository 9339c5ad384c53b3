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
        /// Padding; 0.
        pub pad1: u32,
    }
}

/// Bytes of a [`FilmPixel`].
#[allow(clippy::cast_possible_truncation, reason = "small")]
pub const FILM_PIXEL_BYTES: u32 = size_of::<FilmPixel>() as u32;

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
