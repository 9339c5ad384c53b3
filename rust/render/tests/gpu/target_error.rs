// SPDX-License-Identifier: Apache-2.0
//! Renders that stop at a target error: whether stopping biases the picture, and how far below its target the true
//! error then is.

use crate::error_estimate::{mirror, view, window};
use crate::scenes::nested;
use crate::support::{read, render, seeds, settings};
use oocpt_core::scene::SceneDb;
use oocpt_core::settings::{SettingValue, Settings};
use oocpt_render::{AovKind, RenderRequest, Session, SessionOptions};

const SIZE: [u32; 2] = [20, 14];
const SEEDS: [u32; 2] = [24, 48];

/// The picture of a seed, its three channels, and its samples.
fn picture(session: &Session, view: &RenderRequest, seed: usize) -> (Vec<f64>, u32) {
    session.set_setting("oocpt:seed", SettingValue::Int(i64::try_from(seed).expect("small"))).expect("a seed");
    render(session, view);
    let words = read::<f32>(session, view, AovKind::Color);
    let channels = words.iter().enumerate().filter(|(k, _)| k % 4 != 3).map(|(_, x)| f64::from(*x));
    (channels.collect(), session.stats().error.expect("its error is told").samples)
}

/// What stopping does, over many seeds.
#[derive(Debug)]
struct Stopped {
    /// Bias of the mean of all pixels: relative, and in standard errors.
    bias: (f64, f64),
    /// Squared relative bias of the pixels, averaged, noise taken off, over the true relMSE of a picture.
    share: f64,
    /// True relMSE over the target: mean, largest.
    ratio: (f64, f64),
    /// Pictures worse than the target.
    worse: usize,
    /// Pictures by samples.
    samples: Vec<(u32, usize)>,
}

#[expect(clippy::cast_precision_loss, reason = "few")]
fn stopped(build: fn(&mut SceneDb), target: f32) -> Stopped {
    let view = view(SIZE);
    let open = |settings: Settings| {
        let session = Session::with_options(settings, SessionOptions::default());
        session.with_scene(build);
        session
    };
    let brute = open(settings(2048, 2));
    let brute: Vec<Vec<f64>> = (0..4).map(|seed| picture(&brute, &view, 90_000 + seed).0).collect();
    let average = |pictures: &[Vec<f64>], k: usize| pictures.iter().map(|p| p[k]).sum::<f64>() / pictures.len() as f64;
    let reference: Vec<f64> = (0..brute[0].len()).map(|k| average(&brute, k)).collect();
    let session = open(Settings { target_error: target, ..settings(1 << 16, 2) });
    let (pictures, counts): (Vec<Vec<f64>>, Vec<u32>) =
        (0..seeds(SEEDS) as usize).map(|seed| picture(&session, &view, seed)).unzip();
    let channels = reference.len() as f64;
    let relative = |x: f64, r: f64| x * x / (r * r + 1e-2);
    let truth = |p: &Vec<f64>| p.iter().zip(&reference).map(|(x, r)| relative(x - r, *r)).sum::<f64>() / channels;
    let truths: Vec<f64> = pictures.iter().map(truth).collect();
    let (mut squares, mut noise) = (0.0, 0.0);
    for (k, r) in reference.iter().enumerate() {
        let mean = average(&pictures, k);
        let variance = |of: &[Vec<f64>], mean: f64| {
            of.iter().map(|p| (p[k] - mean).powi(2)).sum::<f64>() / (of.len() - 1) as f64 / of.len() as f64
        };
        squares += relative(mean - r, *r) / channels;
        noise += (variance(&pictures, mean) + variance(&brute, *r)) / (r * r + 1e-2) / channels;
    }
    let whole = |of: &[Vec<f64>]| {
        let means: Vec<f64> = of.iter().map(|p| p.iter().sum::<f64>() / channels).collect();
        let mean = means.iter().sum::<f64>() / means.len() as f64;
        (mean, means.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / (means.len() - 1) as f64 / means.len() as f64)
    };
    let (ours, theirs) = (whole(&pictures), whole(&brute));
    let rel_mse = truths.iter().sum::<f64>() / truths.len() as f64;
    let target = f64::from(target);
    let mut samples: Vec<(u32, usize)> = Vec::new();
    for octave in 4..16 {
        let with = counts.iter().filter(|count| **count == 1 << octave).count();
        samples.extend((with > 0).then_some((1 << octave, with)));
    }
    Stopped {
        bias: (ours.0 / theirs.0 - 1.0, (ours.0 - theirs.0) / (ours.1 + theirs.1).sqrt()),
        share: (squares - noise) / rel_mse,
        ratio: (rel_mse / target, truths.iter().copied().fold(0.0, f64::max) / target),
        worse: truths.iter().filter(|truth| **truth > target).count(),
        samples,
    }
}

/// Stopping does bias where fireflies are: pictures that have met none stop earlier. The bounds are what decisions/0009
/// states.
#[test]
fn stopping_at_a_target_error_has_bounded_bias() {
    type Case = (&'static str, fn(&mut SceneDb), f32);
    let cases: [Case; 3] = [("nested", nested, 7e-4), ("window", window, 2e-4), ("mirror", mirror, 2e-3)];
    for (name, build, target) in cases {
        let stopped = stopped(build, target);
        println!("{name}: {stopped:.3?}");
        assert!(stopped.samples.len() > 1, "{name}: no choice was made: {stopped:?}");
        assert!(stopped.bias.0.abs() < 5e-3, "{name}: the mean is off: {stopped:?}");
        assert!(stopped.share < 0.05, "{name}: the bias is part of the error: {stopped:?}");
        assert!(
            stopped.worse <= seeds(SEEDS) as usize / 16 && (0.1..0.9).contains(&stopped.ratio.0),
            "{name}: {stopped:?}"
        );
    }
}
