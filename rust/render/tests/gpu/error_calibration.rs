// SPDX-License-Identifier: Apache-2.0
//! Intervals of the picture's error contain the true error as often as they state, counted over scenes and seeds.

use crate::error_estimate::{SIZE, gloss, lamps, low_sun, mirror, overcast, view, window};
use crate::lights::TestFiles;
use crate::scenes::{features, nested};
use crate::streaming::{SCENES, Scene};
use crate::support::{color_request, few_of, is_full, perspective, read, render, seeds, settings};
use oocpt_core::scene::SceneDb;
use oocpt_core::settings::SettingValue;
use oocpt_core::stats::ErrorRow;
use oocpt_gpu::DeviceKind;
use oocpt_render::{AovKind, RenderRequest, Session, SessionOptions};
use std::sync::Arc;

/// Pictures of a case, and with all tests: each is compared with the mean of the others.
const SEEDS: [u32; 2] = [16, 32];
/// Widest interval that is of use, as the factor from its middle to either end.
const WIDEST: f64 = 3.0;
/// Most paths of one picture on a GPU.
const MAX_PATHS: u64 = 1 << 30;
/// Most paths of one picture on a processor.
const MAX_PATHS_CPU: u64 = 1 << 22;

/// [`WIDEST`] by the samples: below 16 the slope of the error is a guess (decisions/0009).
fn widest_at(samples: u32) -> f64 {
    if samples < 16 { 2.0 * WIDEST } else { WIDEST }
}

/// Scene, view, bounces, samples.
struct Case {
    name: &'static str,
    build: fn(&mut SceneDb),
    view: RenderRequest,
    bounces: u32,
    samples: u32,
}

fn through_a_lens() -> RenderRequest {
    let mut view = view(SIZE);
    (view.camera.lens_radius, view.camera.focus_distance) = (0.15, 5.0);
    view
}

/// Renders the scene with each of so many seeds; returns the pictures and their error estimates.
fn pictures(case: &Case, seeds: u32) -> Vec<(Vec<f32>, ErrorRow)> {
    let session = Session::with_options(settings(case.samples, case.bounces), SessionOptions::default());
    session.set_light_files(Arc::new(TestFiles));
    session.with_scene(case.build);
    let one = |seed| {
        session.set_setting("oocpt:seed", SettingValue::Int(seed)).expect("a seed");
        render(&session, &case.view);
        let row = session.stats().error.expect("every picture's error is told");
        (read::<f32>(&session, &case.view, AovKind::Color), row)
    };
    (0..i64::from(seeds)).map(one).collect()
}

/// relMSE of a picture against the mean of the others. That mean has noise of its own, one part in as many of
/// the picture's as they are.
fn true_error(pictures: &[(Vec<f32>, ErrorRow)], index: usize) -> f64 {
    let mut sum = vec![0.0; pictures[index].0.len()];
    for (other, _) in pictures.iter().enumerate().filter(|(other, _)| *other != index).map(|(_, picture)| picture) {
        sum.iter_mut().zip(other).for_each(|(sum, x)| *sum += f64::from(*x));
    }
    #[expect(clippy::cast_precision_loss, reason = "few")]
    let (others, mut total, mut count) = ((pictures.len() - 1) as f64, 0.0, 0.0);
    for (_, (x, sum)) in pictures[index].0.iter().zip(&sum).enumerate().filter(|(k, _)| k % 4 != 3) {
        let (x, r) = (f64::from(*x), sum / others);
        total += (x - r).powi(2) / (r * r + 1e-2);
        count += 1.0;
    }
    total / count / (1.0 + 1.0 / others)
}

/// Counts over some cases.
#[derive(Default)]
struct Counted {
    /// Pictures whose interval holds the true error.
    inside: i32,
    all: i32,
    /// The widest interval of a case, by the mean of its pictures: the factor from its middle to either end.
    widest: f64,
    /// A line about each case.
    said: String,
}

/// Counts over `seeds` pictures of each case.
#[expect(clippy::print_stdout, reason = "what was measured stands in the log")]
fn count(cases: &[Case], seeds: u32) -> Counted {
    let (mut inside, mut all, mut widest, mut said) = (0, 0, 0.0_f64, String::new());
    for case in cases {
        let pictures = pictures(case, seeds);
        let number = i32::try_from(pictures.len()).expect("few");
        let (mut below, mut above, mut sums) = (0, 0, [0.0; 3]);
        for (index, (_, row)) in pictures.iter().enumerate() {
            let (truth, told) = (true_error(&pictures, index), row.estimate.expect("so many samples tell something"));
            below += i32::from(truth < told.low);
            above += i32::from(truth > told.high);
            let width = (told.high / told.low.max(1e-30)).sqrt();
            [truth, told.rel_mse, width].iter().zip(&mut sums).for_each(|(v, sum)| *sum += v / f64::from(number));
        }
        said += &format!(
            "{:<20} {:>4} x {:<4} {:>4} samples: true {:.3e}, told {:.3e}, interval x / {:.2}; below {below}, above {above} of \
             {number}\n",
            case.name, case.view.width, case.view.height, case.samples, sums[0], sums[1], sums[2]
        );
        inside += number - below - above;
        all += number;
        widest = widest.max(sums[2]);
    }
    said += &format!("{inside} of {all} inside: {:.3}", f64::from(inside) / f64::from(all));
    println!("{said}");
    Counted { inside, all, widest, said }
}

/// Four standard deviations fewer than 95 % of so many.
fn fewest(all: i32) -> i32 {
    let all = f64::from(all);
    #[expect(clippy::cast_possible_truncation, reason = "few")]
    let fewest = (0.95 * all - 4.0 * (0.95 * 0.05 * all).sqrt()).ceil() as i32;
    fewest
}

#[test]
fn confidence_intervals_have_their_stated_coverage() {
    let plain = view(SIZE);
    type Row = (&'static str, fn(&mut SceneDb), RenderRequest, u32);
    let rows: [Row; 10] = [
        ("nested", nested, plain.clone(), 3),
        ("features", features, plain.clone(), 3),
        ("lens", nested, through_a_lens(), 2),
        ("direct", nested, plain.clone(), 0),
        ("overcast", overcast, plain.clone(), 3),
        ("sun", low_sun, plain.clone(), 2),
        ("window", window, plain.clone(), 2),
        ("lamps", lamps, plain.clone(), 2),
        ("mirror", mirror, plain.clone(), 3),
        ("gloss", gloss, plain, 3),
    ];
    let cases = rows.map(|(name, build, view, bounces)| Case { name, build, view, bounces, samples: 64 });
    let Counted { inside, all, widest, said } = count(&cases, seeds(SEEDS));
    let share = f64::from(inside) / f64::from(all);
    assert!(share <= 0.99 && inside >= fewest(all), "a 95 % interval holds {inside} of {all}");
    assert!(widest <= WIDEST, "an interval of x / {widest:.2} says little:\n{said}");
}

/// The estimator was tuned on the scenes above at their sample counts. These are the scenes of streaming, on which
/// nothing was tuned, at two other counts.
#[test]
fn confidence_intervals_hold_on_scenes_not_used_for_tuning() {
    let view = |scene: &Scene| color_request(perspective(scene.eye, scene.target, 0.8, SIZE));
    let scenes = [2, 4, 5, 6, 8].map(|at| &SCENES[at]);
    for samples in [24, 96] {
        let of = |scene: &&Scene| Case { name: scene.name, build: scene.build, view: view(scene), bounces: 1, samples };
        let Counted { inside, all, widest, said } = count(&scenes.iter().map(of).collect::<Vec<_>>(), seeds(SEEDS));
        assert!(inside >= fewest(all), "{samples}: a 95 % interval holds {inside} of {all}");
        assert!(widest <= WIDEST, "an interval of x / {widest:.2} says little:\n{said}");
    }
}

/// Cases of other scenes than above, seen in `size` with so many samples.
fn elsewhere(size: [u32; 2], samples: u32) -> Vec<Case> {
    let of = |at: usize| {
        let scene = &SCENES[at];
        let view = color_request(perspective(scene.eye, scene.target, 0.8, size));
        Case { name: scene.name, build: scene.build, view, bounces: 2, samples }
    };
    let plain = view(size);
    let ours = |name, build: fn(&mut SceneDb), bounces| Case { name, build, view: plain.clone(), bounces, samples };
    vec![of(0), of(7), ours("lamps", lamps, 2), ours("gloss", gloss, 3)]
}

/// Checks the intervals of these cases; `widest` bounds them.
fn are_calibrated(cases: &[Case], pictures: u32, widest: f64) {
    let counted = count(cases, pictures);
    let (inside, all) = (counted.inside, counted.all);
    assert!(inside >= fewest(all), "a 95 % interval holds {inside} of {all}:\n{}", counted.said);
    assert!(counted.widest <= widest, "an interval of x / {:.2} says little:\n{}", counted.widest, counted.said);
}

/// The more pixels a picture has, the narrower its interval, and the less a wrong model is forgiven.
#[test]
fn larger_pictures_of_few_and_of_many_samples_are_calibrated() {
    for &(size, samples) in few_of(&[([32, 20], 4), ([40, 32], 16), ([32, 20], 256)], 2) {
        are_calibrated(&elsewhere(size, samples), seeds([8, 32]), widest_at(samples));
    }
}

/// With all tests: pictures 640 and 1280 pixels wide, from 4 to 1024 samples; on a processor those that it can render.
#[test]
fn pictures_as_large_as_people_render_them_are_calibrated() {
    if !is_full() {
        eprintln!("skipped: only with all tests (OOCPT_TEST_FULL)");
        return;
    }
    let most = if has_gpu() { MAX_PATHS } else { MAX_PATHS_CPU };
    let pictures = seeds([8, 16]);
    for size in [[640, 360], [1280, 720]] {
        for samples in [4, 16, 64, 256, 1024] {
            if u64::from(size[0]) * u64::from(size[1]) * u64::from(samples) > most {
                eprintln!("{size:?} with {samples} samples: left out, too much for this device");
                continue;
            }
            are_calibrated(&elsewhere(size, samples), pictures, widest_at(samples));
        }
    }
}

/// Returns true if pictures are rendered by something else than a processor.
fn has_gpu() -> bool {
    let session = Session::new(settings(1, 0));
    render(&session, &view([4, 4]));
    session.device_report().is_some_and(|device| device.kind != DeviceKind::Cpu)
}
