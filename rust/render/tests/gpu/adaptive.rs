// SPDX-License-Identifier: Apache-2.0
//! Adaptive sampling: its gain at equal samples, no bias (and that a biased variant is noticed), its error estimate,
//! and the same bits everywhere.

use crate::error_estimate::{gloss, mirror, view, window};
use crate::scenes::{constant, dome, features, nested, prim, square};
use crate::support::{perspective, read, render, seeds, settings};
use glam::{DMat4, DVec3};
use oocpt_core::scene::SceneDb;
use oocpt_core::settings::{SettingValue, Settings};
use oocpt_render::{AovKind, PlantedFaults, RenderRequest, Session, SessionOptions};

/// Mean of `(x - r)^2 / (r^2 + 0.01)` over pixels and colour channels.
fn rel_mse(picture: &[f32], reference: &[f64]) -> f64 {
    let pairs = picture.iter().zip(reference).enumerate().filter(|(k, _)| k % 4 != 3).map(|(_, pair)| pair);
    let errors: Vec<f64> = pairs.map(|(x, r)| (f64::from(*x) - r).powi(2) / (r * r + 1e-2)).collect();
    mean(&errors).0
}

/// The mean, and its variance.
#[expect(clippy::cast_precision_loss, reason = "few")]
fn mean(values: &[f64]) -> (f64, f64) {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    (mean, values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (count - 1.0) / count)
}

fn picture(session: &Session, view: &RenderRequest, seed: usize) -> Vec<f32> {
    session.set_setting("oocpt:seed", SettingValue::Int(i64::try_from(seed).expect("small"))).expect("a seed");
    render(session, view);
    read::<f32>(session, view, AovKind::Color)
}

fn open(settings: Settings, options: SessionOptions, build: fn(&mut SceneDb)) -> Session {
    let session = Session::with_options(settings, options);
    session.with_scene(build);
    session
}

fn adaptive(samples: u32, bounces: u32) -> Settings {
    Settings { adaptive_sampling: true, ..settings(samples, bounces) }
}

/// Pixels' means over pictures of seeds from `first` on.
fn brute_force(build: fn(&mut SceneDb), view: &RenderRequest, pictures: usize, samples: u32) -> Vec<Vec<f32>> {
    let session = open(settings(samples, 2), SessionOptions::default(), build);
    (0..pictures).map(|seed| picture(&session, view, 100_000 + seed)).collect()
}

#[expect(clippy::cast_precision_loss, reason = "few")]
fn average(pictures: &[Vec<f32>]) -> Vec<f64> {
    let sum = |k: usize| pictures.iter().map(|picture| f64::from(picture[k])).sum::<f64>();
    (0..pictures[0].len()).map(|k| sum(k) / pictures.len() as f64).collect()
}

/// Most pixels are easy: a caustic that few paths find, and the edge of a shadow.
#[test]
fn adaptive_sampling_lowers_error_at_equal_samples() {
    let view = view([48, 32]);
    type Case = (&'static str, fn(&mut SceneDb), f64);
    let cases: [Case; 2] = [("mirror", mirror, 0.65), ("window", window, 0.75)];
    for (name, build, bound) in cases {
        let reference = average(&brute_force(build, &view, 2, 1024));
        let error = |adaptive_sampling| {
            let session = open(Settings { adaptive_sampling, ..settings(128, 2) }, SessionOptions::default(), build);
            let errors: Vec<f64> = (0..4).map(|seed| rel_mse(&picture(&session, &view, seed), &reference)).collect();
            (mean(&errors).0, session.stats())
        };
        let ((uniform, even), (adaptive, uneven)) = (error(false), error(true));
        println!(
            "{name}: uniform {uniform:.3e}, adaptive {adaptive:.3e}: {:.2}; {:?}",
            adaptive / uniform,
            uneven.adaptive
        );
        assert!(even.adaptive.is_none(), "nothing is adaptive without the setting");
        assert_eq!((even.samples_completed, uneven.samples_completed), (128, 128), "as many samples");
        let usage = uneven.adaptive.expect("it is told what was spent");
        assert!(usage.fewest == 32 && usage.most > 128 && usage.epochs == 4, "{usage:?}");
        assert!(adaptive < bound * uniform, "{name}: {adaptive:.3e} against {uniform:.3e}");
    }
}

/// Means of regions of 4 x 4 pixels, of the whole, and of the left half; and the variances of these means.
fn regions(pictures: &[Vec<f32>], size: [u32; 2]) -> Vec<(f64, f64)> {
    let [width, height] = size.map(|n| n as usize);
    let mut regions: Vec<Vec<usize>> = vec![Vec::new(); (width / 4) * (height / 4)];
    for pixel in 0..width * height {
        regions[pixel / width / 4 * (width / 4) + pixel % width / 4].push(pixel);
    }
    regions.push((0..width * height).collect());
    regions.push((0..width * height).filter(|pixel| pixel % width < width / 2).collect());
    let value = |picture: &[f32], pixels: &[usize]| {
        let of = |pixel: &usize| (0..3).map(|channel| f64::from(picture[pixel * 4 + channel])).collect::<Vec<_>>();
        let all: Vec<f64> = pixels.iter().flat_map(of).collect();
        mean(&all).0
    };
    let of = |pixels: &Vec<usize>| mean(&pictures.iter().map(|p| value(p, pixels)).collect::<Vec<_>>());
    regions.iter().map(of).collect()
}

fn adaptive_pictures(build: fn(&mut SceneDb), view: &RenderRequest, naive_sampling: bool) -> Vec<Vec<f32>> {
    let faults = PlantedFaults { naive_sampling, ..PlantedFaults::default() };
    let options = SessionOptions { faults, ..SessionOptions::default() };
    let session = open(adaptive(64, 2), options, build);
    (0..seeds([64, 128]) as usize).map(|seed| picture(&session, view, seed)).collect()
}

/// Black veils before a dome of radiance 30: on the left one sample in 30 goes through, on the right one in two.
fn veils(db: &mut SceneDb) {
    for (number, opacity) in [(-1.0, 29.0 / 30.0), (1.0, 0.5_f32)] {
        let place =
            DMat4::from_translation(DVec3::X * (10.0 * number)) * DMat4::from_rotation_x(std::f64::consts::FRAC_PI_2);
        let path = format!("/veil_{}", opacity > 0.6);
        let mut veil = square(prim(&path, place * DMat4::from_scale(DVec3::splat(10.0))), 1, 0.0);
        veil.display_opacity = constant(opacity);
        db.upsert_mesh(veil);
    }
    db.upsert_light(dome([30.0; 3]));
}

#[test]
fn the_mean_of_many_pictures_is_known_and_a_planted_bias_is_noticed() {
    let size = [16, 12];
    let view = RenderRequest { camera: perspective(DVec3::Z * 5.0, DVec3::ZERO, 0.8, size), ..view(size) };
    let known = |region: usize| match region {
        12 => 8.0,
        13 => 1.0,
        region if region % 4 < 2 => 1.0,
        _ => 15.0,
    };
    let sigmas = |naive| {
        let means = regions(&adaptive_pictures(veils, &view, naive), size);
        let of = |(region, (mean, variance)): (usize, &(f64, f64))| (mean - known(region)) / variance.sqrt();
        let sigmas: Vec<f64> = means.iter().enumerate().map(of).collect();
        println!("naive {naive}: {means:.3?}, sigmas {sigmas:.1?}");
        sigmas
    };
    let (right, naive) = (sigmas(false), sigmas(true));
    assert!(right.iter().all(|sigma| sigma.abs() < 3.0), "biased: {right:.1?}");
    assert!(naive[13] < -4.5, "a bias would not be noticed: {naive:.1?}");
}

#[test]
fn the_mean_of_many_pictures_is_that_of_brute_force() {
    let size = [16, 12];
    let view = view(size);
    let reference = regions(&brute_force(gloss, &view, 32, 512), size);
    let means = regions(&adaptive_pictures(gloss, &view, false), size);
    let of = |(ours, theirs): (&(f64, f64), &(f64, f64))| (ours.0 - theirs.0) / (ours.1 + theirs.1).sqrt();
    let sigmas: Vec<f64> = means.iter().zip(&reference).map(of).collect();
    println!("{sigmas:.1?}");
    assert!(sigmas.iter().all(|sigma| sigma.abs() < 3.0), "biased: {sigmas:.1?}");
}

#[test]
fn bits_do_not_depend_on_budget_or_wave_cuts() {
    let view = view([40, 30]);
    for (build, samples) in [(nested as fn(&mut SceneDb), 72), (features, 32), (nested, 5)] {
        let told = |options: SessionOptions, settings: Settings| {
            let session = open(settings, SessionOptions { validation: true, ..options }, build);
            render(&session, &view);
            let stats = session.stats();
            let error = stats.error.expect("the error is told");
            (read::<u32>(&session, &view, AovKind::Color), error.estimate, error.samples, error.worst, stats.adaptive)
        };
        let settings = Settings { chunk_size_kib: 16, ..adaptive(samples, 2) };
        let plain = told(SessionOptions::default(), settings.clone());
        let streaming = SessionOptions { force_streaming: true, ..SessionOptions::default() };
        let streamed = told(streaming, settings.clone());
        let few = told(SessionOptions::default(), Settings { geometry_budget_kib: 96, ..settings });
        assert!(plain.2 == samples && plain.1.is_some(), "{:?} {:?}", plain.1, plain.2);
        assert_eq!(plain, streamed, "streaming changes nothing");
        assert_eq!(plain, few, "nor does a budget");
    }
}

/// Estimates are those of two halves that share no sample.
#[test]
fn the_confidence_interval_holds_the_true_error() {
    let view = view([20, 14]);
    let (mut inside, mut ratios) = (0, Vec::new());
    let number = seeds([16, 32]);
    let more = f64::from(number - 1);
    for build in [mirror as fn(&mut SceneDb), window, nested] {
        let session = open(adaptive(64, 2), SessionOptions::default(), build);
        let one = |seed| (picture(&session, &view, seed), session.stats().error.and_then(|row| row.estimate));
        let (pictures, told): (Vec<_>, Vec<_>) = (0..number as usize).map(one).unzip();
        let all = average(&pictures);
        for (picture, told) in pictures.iter().zip(told) {
            // Each picture is compared with the mean of the others, whose own noise is smaller by their number.
            let others: Vec<f64> =
                all.iter().zip(picture).map(|(m, x)| (m * (more + 1.0) - f64::from(*x)) / more).collect();
            let (truth, told) = (rel_mse(picture, &others) / (1.0 + 1.0 / more), told.expect("an estimate"));
            inside += u32::from((told.low..=told.high).contains(&truth));
            ratios.push(told.rel_mse / truth);
        }
    }
    let all = f64::from(3 * number);
    println!("{inside} of {all} inside; told / true on average {:.3}", mean(&ratios).0);
    let fewest = 0.95 * all - 2.0 * (0.95 * 0.05 * all).sqrt();
    assert!(f64::from(inside) >= fewest, "a 95 % interval holds {inside} of {all}");
}

#[test]
fn a_target_stops_it_at_the_end_of_an_epoch() {
    let view = view([20, 14]);
    let stop = |options: SessionOptions| {
        let session = open(Settings { target_error: 4e-4, ..adaptive(4096, 1) }, options, nested);
        render(&session, &view);
        let row = session.stats().error.expect("the error is told");
        assert!(row.is_last && row.estimate.is_some_and(|e| e.high <= 4e-4), "{row:?}");
        (row.samples, row.estimate, read::<u32>(&session, &view, AovKind::Color))
    };
    let in_core = stop(SessionOptions { validation: true, ..SessionOptions::default() });
    assert!(in_core.0.is_power_of_two() && in_core.0 < 4096, "an epoch doubles the samples: {}", in_core.0);
    assert_eq!(in_core, stop(SessionOptions { force_streaming: true, ..SessionOptions::default() }), "same samples");
}
