// SPDX-License-Identifier: Apache-2.0
//! Compares the estimated error of a picture with its true error: pixels of known means, sampled as the renderer
//! samples, and independently.

use oocpt_abi::sampler::{pixel_seed, sample_4d};
use oocpt_core::convergence::{ConvergenceEstimator, ErrorEstimate, PictureErrorSums};

const PIXELS: u32 = 256;

/// The films of all pixels at each power of two up to `samples`, and the true relMSE; `value(pixel, sample)` has mean
/// `mean(pixel)`.
fn octaves(
    samples: u32,
    value: &dyn Fn(u32, u32) -> f64,
    mean: &dyn Fn(u32) -> f64,
) -> Vec<(u32, PictureErrorSums, f64)> {
    let mut film = vec![(0.0_f64, 0.0_f64, 0.0_f64); PIXELS as usize];
    let mut octaves = Vec::new();
    for n in 0..samples {
        for (pixel, (sum, m2, earlier)) in (0..).zip(&mut film) {
            let (x, before) = (value(pixel, n), *sum / f64::from(n.max(1)));
            if n.is_power_of_two() {
                *earlier = before;
            }
            *sum += x;
            *m2 += if n == 0 { 0.0 } else { (x - before) * (x - *sum / f64::from(n + 1)) };
        }
        let n = n + 1;
        if !n.is_power_of_two() || n < 2 {
            continue;
        }
        let (mut sums, mut truth) =
            (PictureErrorSums { pixels: f64::from(PIXELS), ..PictureErrorSums::default() }, 0.0);
        for (pixel, (sum, m2, earlier)) in (0..).zip(&film) {
            let (now, mu) = (sum / f64::from(n), mean(pixel));
            let divisor = mu * mu + 1e-2;
            let (s, d) = (m2 / f64::from(n - 1) / f64::from(n) / divisor, (now - earlier).powi(2) / divisor);
            sums.s += s;
            sums.d += d;
            sums.ss += s * s;
            sums.sd += s * d;
            sums.dd += d * d;
            truth += (now - mu).powi(2) / divisor / f64::from(PIXELS);
        }
        octaves.push((n.ilog2(), sums, truth));
    }
    octaves
}

/// The last estimate, the estimate by the variance of samples alone, and the truth.
fn told(octaves: &[(u32, PictureErrorSums, f64)]) -> (ErrorEstimate, f64, f64) {
    let mut convergence = ConvergenceEstimator::default();
    let mut last = None;
    for (octave, sums, truth) in octaves {
        last = convergence.octave(*octave, sums).map(|estimate| (estimate, sums.s / sums.pixels, *truth));
    }
    last.expect("octaves from two samples on")
}

fn uniform(seed: u32, pixel: u32, sample: u32, set: u32) -> [f64; 4] {
    sample_4d(sample, set, pixel_seed(pixel % 16, pixel / 16, seed)).map(f64::from)
}

/// Number of 40 seeds for which the interval contains the truth.
fn held(value: impl Fn(u32, u32, u32) -> f64, mean: &dyn Fn(u32) -> f64) -> (usize, f64, f64) {
    let all: Vec<_> = (0..40).map(|seed| told(&octaves(64, &|pixel, n| value(seed, pixel, n), mean))).collect();
    let inside = all.iter().filter(|(told, _, truth)| (told.low..=told.high).contains(truth)).count();
    let ratio = |of: fn(&(ErrorEstimate, f64, f64)) -> f64| all.iter().map(of).sum::<f64>() / 40.0;
    (inside, ratio(|(told, _, truth)| told.rel_mse / truth), ratio(|(_, naive, truth)| naive / truth))
}

#[test]
fn independent_samples_have_the_error_of_their_variance() {
    // A point of a set of its own for each sample: no stratification.
    let (inside, told, naive) = held(|seed, pixel, n| uniform(seed, pixel, 0, n)[0], &|_| 0.5);
    assert!(inside >= 35, "the interval holds {inside} of 40");
    assert!((0.8..1.25).contains(&told) && (0.9..1.1).contains(&naive), "told {told}, textbook {naive}");
}

#[test]
fn stratified_samples_have_less_error_than_their_variance_says() {
    let step = |seed, pixel: u32, n| {
        let edge = f64::from(pixel) / 256.0;
        if uniform(seed, pixel, n, 0)[0] < edge { 1.0 } else { 0.1 }
    };
    let (inside, told, naive) = held(step, &|pixel| 0.1 + 0.9 * f64::from(pixel) / 256.0);
    assert!(inside >= 35, "edges: the interval holds {inside} of 40");
    assert!((0.7..1.4).contains(&told) && naive > 20.0, "edges: told {told}, textbook {naive}");
    let smooth = |seed, pixel, n| 0.2 + uniform(seed, pixel, n, 0)[0] + 0.3 * uniform(seed, pixel, n, 0)[1];
    let (_, told, naive) = held(smooth, &|_| 0.85);
    assert!((0.5..2.0).contains(&told) && naive > 5000.0, "smooth: told {told}, textbook {naive}");
}

#[test]
fn fireflies_raise_the_error_estimate() {
    let value = |seed, pixel, n| {
        let u = uniform(seed, pixel, n, 1);
        0.3 * (0.5 + u[0]) + if u[1] < 1e-3 { 50.0 * u[2] } else { 0.0 }
    };
    let (inside, told, _) = held(value, &|_| 0.3 + 0.025);
    assert!(inside >= 35, "the interval holds {inside} of 40");
    assert!((0.8..1.25).contains(&told), "told {told}");
}

#[test]
fn the_estimate_is_continuous_at_powers_of_two() {
    let octaves = octaves(64, &|pixel, n| uniform(1, pixel, n, 0)[0], &|_| 0.5);
    let mut convergence = ConvergenceEstimator::default();
    let mut last = None;
    for (octave, sums, _) in &octaves {
        last = convergence.octave(*octave, sums);
    }
    let (last, sums) = (last.expect("an estimate"), octaves.last().expect("some").1);
    let there = convergence.between(64.0, &sums).expect("an estimate");
    assert!((there.rel_mse / last.rel_mse - 1.0).abs() < 0.05, "{there:?} {last:?}");
    let later = convergence.between(100.0, &sums).expect("an estimate");
    assert!(later.high / later.low > there.high / there.low, "between octaves less is known");
    assert_eq!(convergence.between(63.0, &sums), None, "not before the last octave");
}

#[test]
fn non_finite_sums_give_no_estimate() {
    let sums = PictureErrorSums { pixels: 4.0, s: f64::NAN, ..PictureErrorSums::default() };
    assert_eq!(ConvergenceEstimator::default().octave(3, &sums), None, "NaN");
    assert_eq!(
        ConvergenceEstimator::default().octave(3, &PictureErrorSums { s: f64::INFINITY, ..sums }),
        None,
        "infinity"
    );
    let flat = PictureErrorSums { s: 0.0, ..sums };
    let told = ConvergenceEstimator::default().octave(3, &flat).expect("a picture without noise");
    assert!(told.low <= 0.0 && told.rel_mse <= 0.0 && told.high > 0.0, "rounding is left: {told:?}");
}
