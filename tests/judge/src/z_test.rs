// SPDX-License-Identifier: Apache-2.0
//! The verdict on a Monte Carlo picture: a z-test of every pixel against a reference with known variance.
//!
//! Method of Mitsuba 3's `test_renders.py` (Jakob et al.; after Subr and Arvo 2007): two-sided z-test per pixel and
//! channel, significance level corrected for the number of pixels after Sidak (1967), accepted if at least 99.75 % of
//! the pixels pass. To that comes one test of the mean of the whole picture, which sees a small bias that no single
//! pixel can show.

use std::path::Path;

use crate::JudgeError;
use crate::image::{Image, single};
use crate::path_tracer::Reference;

/// Chance of refusing a correct picture.
const SIGNIFICANCE: f64 = 0.01;
/// Least share of pixels that must pass.
const PASS_SHARE: f64 = 0.9975;
/// Relative error of the sum of a pixel in f32, below any bias a test should find.
const ROUNDING: f64 = 1e-5;
/// Least variance of one sample for one pixel: keeps features too rare for the reference's samples from deciding.
const MIN_VARIANCE: f64 = 1e-4;

/// What the z-test found.
#[derive(Debug, Clone)]
pub struct ZReport {
    /// Share of pixels and channels that pass.
    pub pass_share: f64,
    /// Largest |z| of the means of the whole picture, over the channels.
    pub mean_z: f64,
    /// The |z| above which the picture's mean is refused.
    pub mean_z_limit: f64,
    /// Per pixel and channel.
    pub p_values: Image,
    accepted: bool,
}

impl ZReport {
    /// Whether the picture agrees with the reference.
    #[must_use]
    pub fn accepted(&self) -> bool {
        self.accepted
    }

    /// Writes image, reference, difference and p-values under `folder` when the picture was refused.
    ///
    /// # Errors
    /// [`JudgeError::Write`] when it cannot, [`JudgeError::Shape`] if the images do not belong to this report.
    pub fn write_if_refused(
        &self,
        folder: &Path,
        name: &str,
        image: &Image,
        reference: &Reference,
    ) -> Result<(), JudgeError> {
        if self.accepted {
            return Ok(());
        }
        image.same_shape(&reference.mean)?;
        let mut error = image.clone();
        for (error, reference) in error.data.iter_mut().zip(&reference.mean.data) {
            *error = (*error - reference).abs();
        }
        let parts = [("image", image), ("reference", &reference.mean), ("error", &error), ("p_value", &self.p_values)];
        parts.iter().try_for_each(|(part, image)| image.write_exr(&folder.join(format!("{name}-{part}.exr"))))
    }
}

impl std::fmt::Display for ZReport {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let verdict = if self.accepted { "accepted" } else { "refused" };
        let share = 100.0 * self.pass_share;
        write!(
            f,
            "{verdict}: {share:.3} % of pixels pass, z of the mean {:.2} (limit {:.2})",
            self.mean_z, self.mean_z_limit
        )
    }
}

/// Tests an RGBA picture made with `samples` samples per pixel. Non-finite pixels always fail.
///
/// # Errors
/// [`JudgeError::Shape`] when the pictures differ in shape.
pub fn z_test(image: &Image, samples: u32, reference: &Reference) -> Result<ZReport, JudgeError> {
    image.same_shape(&reference.mean)?;
    let count = image.data.len();
    // Variance of the difference of both means, per unit of one-sample variance.
    let spread = 1.0 / f64::from(samples.max(1)) + 1.0 / f64::from(reference.samples.max(1));
    let alpha = sidak(count);
    let mut p_values = Image::new(image.width, image.height, image.channels);
    let mut passed = 0;
    let mut sums = vec![(0.0, 0.0, 0.0); image.channels];
    for index in 0..count {
        let (value, mean) = (f64::from(image.data[index]), f64::from(reference.mean.data[index]));
        let variance = f64::from(reference.variance.data[index]);
        let rounding = ROUNDING * mean.abs();
        let deviation = (variance.max(MIN_VARIANCE) * spread + rounding * rounding).sqrt();
        let p_value = two_sided((value - mean) / deviation);
        p_values.data[index] = single(p_value);
        passed += usize::from(p_value > alpha);
        let sum = &mut sums[index % image.channels];
        *sum = (sum.0 + value - mean, sum.1 + variance * spread, sum.2 + rounding);
    }
    let z_of = |&(difference, variance, rounding): &(f64, f64, f64)| {
        let excess = f64::max(f64::abs(difference) - rounding, 0.0);
        if difference.is_nan() {
            f64::INFINITY
        } else if excess == 0.0 {
            0.0
        } else {
            excess / f64::sqrt(variance)
        }
    };
    let mean_z = sums.iter().map(z_of).fold(0.0, f64::max);
    let mean_z_limit = quantile(sidak(image.channels.max(1)));
    let pass_share = passed as f64 / count.max(1) as f64;
    let accepted = count > 0 && pass_share >= PASS_SHARE && mean_z <= mean_z_limit;
    Ok(ZReport { pass_share, mean_z, mean_z_limit, p_values, accepted })
}

/// Significance of one of `tests` tests such that all of them together have [`SIGNIFICANCE`].
fn sidak(tests: usize) -> f64 {
    -f64::exp_m1(f64::ln_1p(-SIGNIFICANCE) / tests.max(1) as f64)
}

/// Chance of a standard normal number beyond `z` on either side; 0 for NaN.
fn two_sided(z: f64) -> f64 {
    if z.is_nan() { 0.0 } else { libm::erfc(z.abs() * std::f64::consts::FRAC_1_SQRT_2) }
}

/// The `z` with `two_sided(z) == p`, by bisection.
fn quantile(p: f64) -> f64 {
    let (mut low, mut high) = (0.0, 40.0);
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if two_sided(middle) > p { low = middle } else { high = middle }
    }
    high
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    const SIZE: usize = 48;
    const SAMPLES: u32 = 256;

    /// A smooth picture with noise: each sample of a pixel is uniform in `[0, 2 mean]`.
    fn picture(seed: u64, bias: f64, shift: usize) -> Reference {
        let mut mean = Image::new(SIZE, SIZE, 4);
        let mut variance = Image::new(SIZE, SIZE, 4);
        for index in 0..mean.data.len() {
            let (x, y) = ((index / 4) % SIZE, (index / 4) / SIZE);
            let edge = if (x + shift) % 16 < 8 { 0.6 } else { 0.2 };
            let level = bias * (edge + 0.3 * y as f64 / SIZE as f64);
            let mut random = Random::new(seed, index as u64, 0);
            let sum: f64 = (0..SAMPLES).map(|_| 2.0 * level * random.uniform()).sum();
            mean.data[index] = single(sum / f64::from(SAMPLES));
            variance.data[index] = single(level * level / 3.0);
        }
        Reference { mean, variance, samples: SAMPLES }
    }

    #[test]
    fn an_honest_picture_is_accepted() {
        let reference = picture(1, 1.0, 0);
        for seed in 2..12 {
            let report = z_test(&picture(seed, 1.0, 0).mean, SAMPLES, &reference).unwrap();
            assert!(report.accepted(), "seed {seed}: {report}");
        }
    }

    #[test]
    fn planted_faults_are_refused() {
        let reference = picture(1, 1.0, 0);
        let test = |image: &Image| z_test(image, SAMPLES, &reference).unwrap();
        let biased = test(&picture(2, 1.02, 0).mean);
        assert!(!biased.accepted(), "a bias of 2 % must be seen: {biased}");
        let shifted = test(&picture(3, 1.0, 1).mean);
        assert!(!shifted.accepted(), "a shift by one pixel must be seen: {shifted}");
        let mut spoiled = picture(4, 1.0, 0).mean;
        spoiled.data[123] = f32::NAN;
        assert!(!test(&spoiled).accepted(), "a NaN must be seen");
        let black = test(&Image::new(SIZE, SIZE, 4));
        assert!(!black.accepted(), "a black picture must be seen: {black}");
    }

    #[test]
    fn a_noiseless_picture_is_held_to_rounding() {
        let mut reference = picture(1, 1.0, 0);
        reference.variance.data.fill(0.0);
        assert!(z_test(&reference.mean.clone(), SAMPLES, &reference).unwrap().accepted(), "equal pictures");
        let mut darker = reference.mean.clone();
        darker.data.iter_mut().for_each(|value| *value *= 0.999);
        assert!(!z_test(&darker, SAMPLES, &reference).unwrap().accepted(), "a bias of 0.1 % without noise");
    }

    #[test]
    fn refused_pictures_leave_files_to_look_at() {
        let reference = picture(1, 1.0, 0);
        let image = picture(2, 1.5, 0).mean;
        let report = z_test(&image, SAMPLES, &reference).unwrap();
        let folder = std::env::temp_dir().join(format!("oocpt-judge-{}", std::process::id()));
        report.write_if_refused(&folder, "planted", &image, &reference).unwrap();
        for part in ["image", "reference", "error", "p_value"] {
            assert!(folder.join(format!("planted-{part}.exr")).is_file(), "no {part} written");
        }
        std::fs::remove_dir_all(folder).unwrap();
    }
}
