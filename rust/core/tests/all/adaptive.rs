// SPDX-License-Identifier: Apache-2.0
//! Adaptive sampling: every sample is taken once, no more samples than allowed, where they reduce the error most, and
//! without bias.

use oocpt_abi::sampler::{pixel_seed, sample_4d};
use oocpt_core::adaptive::{AdaptiveSchedule, FIRST_OCTAVE, OCTAVE_SPAN, STREAMS, VarianceEstimate, pixel_position};
use proptest::prelude::*;
use std::collections::BTreeMap;

/// Samples that an epoch gives: (pixel in trace order, stream) -> (first, how many), checked to be without gaps.
fn given(schedule: &AdaptiveSchedule, begin: u64) -> BTreeMap<(u32, u32), (u32, u32)> {
    let epoch = schedule.epoch();
    let mut given: BTreeMap<(u32, u32), (u32, u32)> = BTreeMap::new();
    let (mut path, mut row) = (begin, 0);
    for band in &epoch.bands {
        assert_eq!((band.first, band.row), (path, row), "bands follow each other");
        for [entry, first] in &epoch.entries[..band.width as usize] {
            let (_, count) = given.entry((entry & 0x7fff_ffff, entry >> 31)).or_insert((*first, 0));
            assert_eq!(*count, band.row, "rows follow each other");
            *count += band.rows;
        }
        (path, row) = (band.end(), row + band.rows);
    }
    assert_eq!(path, epoch.end, "and end with the epoch");
    assert!(epoch.bands.len() <= 32, "as many as the passes know");
    given
}

fn said(words: &[(f32, f32)], pixels: usize) -> Vec<VarianceEstimate> {
    words.iter().cycle().take(pixels).map(|&(spread, change)| VarianceEstimate { spread, change }).collect()
}

proptest! {
    #[test]
    fn every_sample_index_is_issued_once_within_the_budget(
        width in 1_u32..40, height in 1_u32..30, samples in 1_u32..3000,
        words in prop::collection::vec((prop::num::f32::ANY, 0.0_f32..1e6), 2..60),
    ) {
        let pixels = (width * height) as usize;
        let mut schedule = AdaptiveSchedule::new([width, height], samples);
        let mut have: BTreeMap<(u32, u32), u32> = BTreeMap::new();
        let (mut begin, mut turn) = (0, 0);
        loop {
            for (key, (first, count)) in given(&schedule, begin) {
                let had = have.entry(key).or_default();
                prop_assert_eq!(*had, first, "samples of a pixel follow each other");
                *had += count;
                prop_assert!(had.is_power_of_two());
            }
            begin = schedule.epoch().end;
            let counts = || have.values().copied();
            let (fewest, most) = (counts().min().unwrap_or(0), counts().max().unwrap_or(0));
            let decides = 1 << schedule.deciding_octave();
            prop_assert!(have.len() == pixels * STREAMS && fewest >= decides, "every pixel has what decides");
            prop_assert!(most <= decides << OCTAVE_SPAN, "what was said is kept");
            prop_assert!(turn == 0 || begin <= pixels as u64 * u64::from(samples), "no more than there may be");
            let usage = schedule.usage();
            prop_assert!(usage.fewest >= 2 * fewest && usage.most <= 2 * most && (0.0..1.0).contains(&usage.decided));
            turn += 1;
            let other = said(&words[1..], pixels);
            if !schedule.advance([&said(&words, pixels), &other]) {
                break;
            }
        }
        prop_assert!(turn < 30, "it ends");
    }

    #[test]
    fn trace_order_visits_every_pixel_once(width in 1_u32..70, height in 1_u32..70) {
        let mut met = vec![false; (width * height) as usize];
        for index in 0..width * height {
            let [x, y] = pixel_position(index, [width, height]);
            prop_assert!(x < width && y < height);
            prop_assert!(!std::mem::replace(&mut met[(y * width + x) as usize], true));
        }
    }
}

#[test]
fn each_half_stream_steers_only_the_other() {
    let size = [24, 16];
    let said = |phase: u32| -> Vec<VarianceEstimate> {
        (0..24 * 16_u32)
            .map(|p| VarianceEstimate { spread: 0.1, change: if p / 24 % 8 < 4 + phase { 1.0 } else { 0.01 } })
            .collect()
    };
    let entries = |one: u32, other: u32, stream: u32| {
        let mut schedule = AdaptiveSchedule::new(size, 256);
        assert!(schedule.advance([&said(one), &said(other)]), "there are samples left");
        let mut all: Vec<_> =
            given(&schedule, schedule.epoch().bands[0].first).into_iter().filter(|(key, _)| key.1 == stream).collect();
        all.sort_unstable();
        all
    };
    assert_eq!(entries(0, 1, 0), entries(3, 1, 0), "its own word is not asked");
    assert_ne!(entries(0, 1, 0), entries(0, 2, 0), "the other's is");
    assert_eq!(entries(0, 1, 1), entries(0, 3, 1), "nor for the second stream");
    assert_ne!(entries(0, 1, 1), entries(2, 1, 1));
}

/// Halves of the picture have standard deviations of 1 to 8: their counts have the same ratio, and all samples are
/// spent.
#[test]
fn counts_follow_standard_deviations() {
    let size = [64_u32, 32];
    let words: Vec<VarianceEstimate> = (0..64 * 32_u32)
        .map(|pixel| {
            if pixel % 64 < 32 {
                VarianceEstimate { spread: 0.01, change: 0.01 }
            } else {
                VarianceEstimate { spread: 0.64, change: 0.64 }
            }
        })
        .collect();
    let mut schedule = AdaptiveSchedule::new(size, 288);
    let mut have = BTreeMap::new();
    loop {
        for (key, (first, count)) in given(&schedule, if have.is_empty() { 0 } else { schedule.epoch().bands[0].first })
        {
            have.insert(key, first + count);
        }
        if !schedule.advance([&words, &words]) {
            break;
        }
    }
    let mean = |x: std::ops::Range<u32>| {
        let of = |(key, _): &(&(u32, u32), &u32)| x.contains(&pixel_position(key.0, size)[0]);
        let counts: Vec<f64> = have.iter().filter(of).map(|(_, count)| f64::from(*count)).collect();
        counts.iter().sum::<f64>() / counts.len() as f64
    };
    // The ideal counts are 32 and 256 of each stream, and these are the result.
    let (easy, hard) = (mean(0..28), mean(36..64));
    assert!((30.0..40.0).contains(&easy) && (200.0..257.0).contains(&hard), "{easy} and {hard}");
    let all: u64 = have.values().map(|count| u64::from(*count)).sum();
    assert!((0.97..=1.0).contains(&(all as f64 / (64.0 * 32.0 * 288.0))), "{all} spent");
}

/// A pixel that is bright in one of 30 samples, besides others like it.
fn value(seed: u32, pixel: u32, stream: u32, sample: u32) -> f64 {
    let u = sample_4d(sample, 1, pixel_seed(pixel, 7, seed ^ (stream * 0x5bd1_e995)));
    if u[0] < 1.0 / 30.0 { 30.0 } else { 0.05 * f64::from(u[1]) }
}

const MEAN: f64 = 1.0 + 0.025 * (29.0 / 30.0);

/// The mean over all pixels of an adaptive picture.
fn adaptive_mean(seed: u32, naive: bool) -> f64 {
    let size = [16, 8];
    let pixels = 128_usize;
    let mut schedule = AdaptiveSchedule::new(size, 64);
    // Sum, sum of squares, samples, what was said; by stream and pixel.
    let mut film = vec![(0.0_f64, 0.0_f64, 0_u32, VarianceEstimate::default()); pixels * STREAMS];
    loop {
        for ((index, stream), (first, count)) in given(&schedule, schedule.epoch().bands[0].first) {
            let [x, y] = pixel_position(index, size);
            let pixel = y * 16 + x;
            let (sum, squares, samples, said) = &mut film[stream as usize * pixels + pixel as usize];
            for sample in first..first + count {
                let v = value(seed, pixel, stream, sample);
                (*sum, *squares, *samples) = (*sum + v, *squares + v * v, sample + 1);
                if *samples == 1 << FIRST_OCTAVE {
                    let mean = *sum / f64::from(*samples);
                    let variance = (*squares / f64::from(*samples) - mean * mean).max(0.0);
                    #[expect(clippy::cast_possible_truncation, reason = "a test")]
                    let spread = (variance / (mean * mean + 0.01)) as f32;
                    *said = VarianceEstimate { spread, change: spread };
                }
            }
        }
        let words: Vec<VarianceEstimate> = film.iter().map(|pixel| pixel.3).collect();
        let words = [&words[..pixels], &words[pixels..]];
        // Decided once more only: the octave that decides is the first.
        if !(if naive { schedule.advance_by(words) } else { schedule.advance(words) }) {
            break;
        }
        assert_eq!(schedule.deciding_octave(), FIRST_OCTAVE, "so few samples are decided by the first octave");
    }
    film.iter().map(|(sum, _, samples, _)| sum / f64::from(*samples)).sum::<f64>() / (pixels * STREAMS) as f64
}

#[test]
fn cross_steered_sampling_is_unbiased_and_naive_steering_is_not() {
    let sigmas = |naive| {
        let means: Vec<f64> = (0..200).map(|seed| adaptive_mean(seed, naive)).collect();
        let mean = means.iter().sum::<f64>() / 200.0;
        let variance = means.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / 199.0 / 200.0;
        println!("naive {naive}: {:.4} of 1, sigma {:.4}", mean / MEAN, variance.sqrt() / MEAN);
        (mean - MEAN) / variance.sqrt()
    };
    let (right, naive) = (sigmas(false), sigmas(true));
    assert!(right.abs() < 3.0, "off by {right} sigma");
    assert!(naive < -5.0, "the test would not notice a bias: {naive} sigma");
}
