// SPDX-License-Identifier: Apache-2.0
//! The error of a film against a plain computation from its samples.

use crate::support::{Folder, film, parts, sample};
use oocpt_core::convergence::ConvergenceEstimator;
use oocpt_film::{OctaveError, SampleRange, picture};

const SIZE: [u32; 2] = [23, 14];

/// Mean and variance of the mean of the first samples of a pixel.
fn statistics(pixel: u64, samples: u32, channel: usize) -> (f64, f64) {
    let values: Vec<f64> = (0..samples).map(|index| f64::from(sample(pixel, index)[channel])).collect();
    let n = f64::from(samples);
    let mean = values.iter().sum::<f64>() / n;
    (mean, values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0) / n)
}

/// `s`, `d` and `e` of a pixel, as the book has them.
fn error_of(x: i32, y: i32, samples: u32) -> [f64; 3] {
    let [width, height] = SIZE.map(|side| i32::try_from(side).expect("small"));
    let at = |x: i32, y: i32| u64::try_from(y * width + x).expect("inside");
    let half = (samples - 1).ilog2();
    let mut all = [0.0; 3];
    for channel in 0..3 {
        let (mean, variance) = statistics(at(x, y), samples, channel);
        let (earlier, _) = statistics(at(x, y), 1 << half, channel);
        let near: Vec<f64> = (-1..=1)
            .flat_map(|dy| (-1..=1).map(move |dx| (x + dx, y + dy)))
            .filter(|near| *near != (x, y) && (0..width).contains(&near.0) && (0..height).contains(&near.1))
            .map(|(x, y)| statistics(at(x, y), samples, channel).0)
            .collect();
        let count = near.len() as f64;
        let around = near.iter().sum::<f64>() / count;
        let spread = (near.iter().map(|v| v * v).sum::<f64>() / count - around * around).max(0.0);
        let apart = mean - around;
        let keep = (1.0 - 4.0 * variance / (apart * apart).max(1e-30)).clamp(0.0, 1.0);
        let level = around + keep * apart;
        let level_variance = keep * keep * variance + (1.0 - keep).powi(2) * spread;
        let divisor = level * level + f64::from(0.01_f32);
        all[0] += variance / divisor / 3.0;
        all[1] += (mean - earlier).powi(2) / divisor / 3.0;
        all[2] = f64::max(all[2], 2.0 * level.abs() * level_variance.sqrt() / divisor).min(1.0);
    }
    all
}

fn close(have: f64, expected: f64, what: &str) {
    assert!((have - expected).abs() <= 1e-9 * expected.abs(), "{what}: {have:e} and {expected:e}");
}

fn compare(error: &OctaveError) {
    let [width, height] = SIZE.map(|side| i32::try_from(side).expect("small"));
    let places = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let pixels: Vec<((i32, i32), [f64; 3])> = places.map(|(x, y)| ((x, y), error_of(x, y, error.samples))).collect();
    let sum = |of: fn([f64; 3]) -> f64| pixels.iter().map(|(_, pixel)| of(*pixel)).sum::<f64>();
    close(error.sums.pixels, f64::from(width * height), "pixels");
    close(error.sums.s, sum(|[s, ..]| s), "s");
    close(error.sums.d, sum(|[_, d, _]| d), "d");
    close(error.sums.ss, sum(|[s, ..]| s * s), "ss");
    close(error.sums.sd, sum(|[s, d, _]| s * d), "sd");
    close(error.sums.dd, sum(|[_, d, _]| d * d), "dd");
    close(error.sums.doubt, sum(|[s, _, e]| (s * e).powi(2)), "doubt");
    let mut worst = pixels;
    worst.sort_by(|a, b| b.1[0].total_cmp(&a.1[0]));
    for (have, ((x, y), [s, ..])) in error.worst.iter().zip(&worst) {
        close(have.error, *s, "a worst pixel");
        // The window is at 2, 3 of a picture that is 4 higher than it.
        let place = [2 + x, height + 4 - 1 - (3 + y)].map(|side| u32::try_from(side).expect("inside"));
        assert_eq!([have.x, have.y], place, "from the upper left");
    }
    assert_eq!(error.worst.len(), 8);
}

#[test]
fn errors_are_those_of_the_samples() {
    let film = film(SIZE, SampleRange::new(0, 16));
    assert_eq!(film.errors().iter().map(|error| error.samples).collect::<Vec<_>>(), [2, 4, 8, 16]);
    film.errors().iter().for_each(compare);
}

#[test]
fn between_octaves_the_error_is_that_of_all_samples() {
    let folder = Folder::new("between");
    let picture = picture(&parts(&folder, SIZE, &[0, 3, 11]), false).expect("whole");
    assert_eq!(picture.errors.iter().map(|error| error.samples).collect::<Vec<_>>(), [2, 4, 8, 11]);
    picture.errors.iter().for_each(compare);
    let mut convergence = ConvergenceEstimator::default();
    for (octave, error) in (1..=3).zip(&picture.errors) {
        convergence.octave(octave, &error.sums);
    }
    let expected = convergence.between(11.0, &picture.errors[3].sums);
    assert!(expected.is_some() && picture.error() == expected, "the interval is that of a render");
}
