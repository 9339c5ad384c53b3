// SPDX-License-Identifier: Apache-2.0
//! Pictures that go on with the samples that are there: the same bits as at once, and nothing is traced twice; and the
//! changes after which a picture begins again.

use crate::error_estimate::{mirror, view as color_view};
use crate::lights::TestFiles;
use crate::scenes::{features, nested};
use crate::support::{TIMEOUT, filtering, perspective, read, read_all, render, request, settings};
use glam::DVec3;
use oocpt_core::scene::SceneDb;
use oocpt_core::settings::{FilmEffect, SettingValue, Settings, TraversalKind};
use oocpt_core::stats::ErrorRow;
use oocpt_render::{AovKind, RenderRequest, Session, SessionOptions};
use std::sync::Arc;
use std::time::Instant;

fn view() -> RenderRequest {
    request(perspective(DVec3::new(3.0, 4.0, 6.0), DVec3::new(0.0, 0.5, 0.0), 0.7, [45, 31]))
}

fn open(build: fn(&mut SceneDb), settings: Settings, streams: bool) -> Session {
    let options = SessionOptions { validation: true, force_streaming: streams, ..SessionOptions::default() };
    let session = Session::with_options(settings, options);
    session.set_light_files(Arc::new(TestFiles));
    session.with_scene(build);
    session
}

fn set(session: &Session, key: &str, value: SettingValue) {
    assert!(session.set_setting(key, value).is_ok(), "{key}");
}

fn set_samples(session: &Session, samples: u32) {
    set(session, "oocpt:samplesPerPixel", SettingValue::Int(samples.into()));
}

/// The parts of a row that do not tell the time.
fn told(row: Option<ErrorRow>) -> impl PartialEq + std::fmt::Debug {
    let row = row.expect("the error is told");
    (row.samples, row.estimate, row.worst, row.is_last)
}

fn by(traversal: TraversalKind, samples: u32) -> Settings {
    Settings { traversal, chunk_size_kib: 16, ..settings(samples, 3) }
}

/// Renders numbers of samples one after the other; each picture is that of a session that renders it at once.
fn goes_on(what: &str, build: fn(&mut SceneDb), settings: &Settings, streams: bool) {
    let session = open(build, settings.clone(), streams);
    let (pixels, mut before, mut rays) = (view().pixels(), 0, 0);
    for samples in [4, 6, 7, 16] {
        set_samples(&session, samples);
        render(&session, &view());
        let at_once = open(build, Settings { samples_per_pixel: samples, ..settings.clone() }, streams);
        render(&at_once, &view());
        assert!(read_all(&session, &view()) == read_all(&at_once, &view()), "{what}: other bits at {samples} samples");
        let (stats, whole) = (session.stats(), at_once.stats());
        assert_eq!(session.timings().paths, u64::from(samples - before) * pixels, "{what}: no other paths, {samples}");
        assert_eq!((stats.samples_completed, stats.samples_kept), (samples, before), "{what}: both are told");
        assert_eq!(told(stats.error), told(whole.error), "{what}: the error at {samples} samples");
        rays += session.timings().closest_rays;
        if !streams {
            // A streamed ray that waits is counted each time that it is traced.
            assert_eq!(rays, at_once.timings().closest_rays, "{what}: each ray once until {samples} samples");
        }
        before = samples;
    }
}

#[test]
fn more_samples_go_on_with_the_same_bits_in_core() {
    goes_on("compute", features, &by(TraversalKind::Compute, 4), false);
    goes_on("native", features, &by(TraversalKind::Auto, 4), false);
}

#[test]
fn more_samples_go_on_with_the_same_bits_while_streaming() {
    goes_on("compute", nested, &by(TraversalKind::Compute, 4), true);
    let small = Settings { geometry_budget_kib: 96, ..by(TraversalKind::Auto, 4) };
    goes_on("native, little memory", nested, &small, true);
}

/// A picture for which other images are asked goes on with its samples, unless they are means over these.
#[test]
fn other_images_go_on_with_the_samples() {
    for streams in [false, true] {
        let session = open(nested, filtering(settings(4, 2)), streams);
        let asking = |kinds: &[AovKind]| RenderRequest {
            aovs: view().aovs.into_iter().filter(|aov| kinds.contains(&aov.kind)).collect(),
            ..view()
        };
        let step = |kinds: &[AovKind], samples: u32, kept: u32| {
            set_samples(&session, samples);
            let request = asking(kinds);
            render(&session, &request);
            let stats = session.stats();
            assert_eq!((stats.samples_completed, stats.samples_kept), (samples, kept), "{kinds:?}, {streams}");
            let at_once = open(nested, filtering(settings(samples, 2)), streams);
            render(&at_once, &request);
            for kind in kinds {
                let of = |session: &Session| read::<u8>(session, &request, *kind);
                assert!(of(&session) == of(&at_once), "{kinds:?}, {samples} samples, {streams}: another {kind:?}");
            }
        };
        step(&[AovKind::Color], 4, 0);
        step(&[AovKind::Color, AovKind::Depth, AovKind::PrimId], 4, 4);
        step(&[AovKind::Depth, AovKind::Error, AovKind::SampleCount], 6, 4);
        step(&[AovKind::Color, AovKind::Albedo], 6, 0);
        step(&[AovKind::Color, AovKind::Albedo, AovKind::Motion, AovKind::Variance], 9, 6);
        step(&[AovKind::Albedo], 9, 0);
        step(&[AovKind::Albedo, AovKind::ElementId], 11, 9);
        step(&[AovKind::Color, AovKind::Albedo, AovKind::Normal], 11, 0);
    }
}

#[test]
fn a_render_under_way_goes_on() {
    // An interactive render in core would give up the work of the device for another picture.
    for (streams, interactive) in [(false, true), (true, false)] {
        let session = open(nested, Settings { interactive, ..settings(1 << 20, 3) }, streams);
        session.render(view());
        let end = Instant::now() + TIMEOUT;
        while session.stats().samples_completed < 3 {
            assert!(Instant::now() < end, "no sample was done in time: {:?}", session.take_messages());
            std::thread::sleep(std::time::Duration::from_millis(2));
        }
        set_samples(&session, 1 << 10);
        render(&session, &view());
        let (kept, paths) = (session.stats().samples_kept, session.timings().paths);
        let left = ((1 << 10) - u64::from(kept)) * view().pixels();
        assert!(kept >= 3 && paths <= left && paths > left - view().pixels(), "{kept} samples and {paths} paths");
        let at_once = open(nested, settings(1 << 10, 3), streams);
        render(&at_once, &view());
        let [went_on, at_once] = [&session, &at_once].map(|session| read::<u32>(session, &view(), AovKind::Color));
        assert!(went_on == at_once, "other bits, streaming {streams}");
    }
}

#[test]
fn fewer_samples_begin_again() {
    let session = open(nested, settings(8, 3), false);
    render(&session, &view());
    set_samples(&session, 3);
    render(&session, &view());
    assert_eq!((session.timings().paths, session.stats().samples_kept), (3 * view().pixels(), 0));
    session.restart();
    assert!(session.wait_converged(TIMEOUT), "it ends");
    assert_eq!(session.timings().paths, 3 * view().pixels(), "a restart begins again");
}

#[test]
fn another_scene_or_view_begins_again() {
    let session = open(nested, settings(4, 2), false);
    let expect = |what: &str, request: &RenderRequest, paths: u64| {
        render(&session, request);
        assert_eq!(session.timings().paths, paths, "{what}");
    };
    expect("the first", &view(), 4 * view().pixels());
    set_samples(&session, 6);
    session.with_scene(|db| db.upsert_light(crate::scenes::sun(1.0, 3.0, glam::DMat4::IDENTITY)));
    expect("a light", &view(), 6 * view().pixels());
    set_samples(&session, 8);
    let moved = RenderRequest { camera: perspective(DVec3::Z * 7.0, DVec3::ZERO, 0.7, [45, 31]), ..view() };
    expect("a camera", &moved, 8 * view().pixels());
    set_samples(&session, 9);
    let part = oocpt_render::PixelWindow { x: 2, y: 3, width: 20, height: 11 };
    expect("a window", &RenderRequest { window: Some(part), ..moved }, 9 * part.pixels());
}

/// A value that differs from the default, of every setting that another picture, and no file or folder, may have.
fn other_value(key: &str, default: &SettingValue) -> Option<SettingValue> {
    let files = ["Report", "reference", "report", "Cache", "device"];
    Some(match (key, default) {
        ("oocpt:traversal", _) => SettingValue::Text("compute".into()),
        ("oocpt:policy", _) => SettingValue::Text("sweep".into()),
        ("oocpt:hostMappedGeometry", _) => SettingValue::Text("off".into()),
        ("oocpt:memoryBudget" | "oocpt:geometryBudget" | "oocpt:hostMemoryBudget", _) => SettingValue::Int(1 << 20),
        ("oocpt:pixelFilter", _) => SettingValue::Text("mitchell".into()),
        ("oocpt:maxDiffuseBounces" | "oocpt:maxSpecularBounces" | "oocpt:maxTransmissionBounces", _) => {
            SettingValue::Int(1)
        }
        ("oocpt:samplesPerPixel" | "convergedSamplesPerPixel", _) => SettingValue::Int(6),
        ("oocpt:timeLimit", _) => SettingValue::Float(1000.0),
        ("oocpt:targetError", _) => SettingValue::Float(1e-9),
        _ if files.iter().any(|word| key.ends_with(word)) => return None,
        (_, SettingValue::Bool(value)) => SettingValue::Bool(!value),
        (_, SettingValue::Int(value)) => SettingValue::Int(value + 1),
        (_, SettingValue::Float(value)) => SettingValue::Float(value + 1.0),
        (_, SettingValue::Text(_)) => return None,
    })
}

#[test]
fn each_setting_goes_on_or_begins_again_as_its_row_says() {
    let (mut went_on, mut began) = (0, 0);
    for setting in Settings::descriptors() {
        let first = Settings { interactive: false, ..settings(3, 2) };
        let default = first.get(setting.key).expect("there is such a setting");
        let Some(value) = other_value(setting.key, &default) else { continue };
        let session = open(nested, first, false);
        render(&session, &color_view([12, 9]));
        set(&session, setting.key, value);
        session.render(color_view([12, 9]));
        assert!(session.wait_converged(TIMEOUT), "{}: it ends", setting.key);
        let kept = session.stats().samples_kept;
        match Settings::film_effect(setting.key).expect("a row") {
            FilmEffect::GoesOn => (went_on, _) = (went_on + 1, assert_eq!(kept, 3, "{} goes on", setting.key)),
            FilmEffect::SameSamples | FilmEffect::BeginsAgain => {
                (began, _) = (began + 1, assert_eq!(kept, 0, "{} begins again", setting.key))
            }
        }
    }
    assert!(went_on == 6 && began > 12, "{went_on} settings go on, {began} begin again");
}

#[test]
fn adaptive_samples_begin_again() {
    let session = open(nested, Settings { adaptive_sampling: true, ..settings(32, 2) }, false);
    render(&session, &color_view([24, 18]));
    set_samples(&session, 64);
    render(&session, &color_view([24, 18]));
    assert_eq!(session.stats().samples_kept, 0, "an epoch depends on the number of all samples");
}

#[test]
fn a_target_error_stops_at_the_samples_of_a_render_at_once() {
    let request = color_view([24, 18]);
    let high = |samples: u32| {
        let session = open(mirror, settings(samples, 2), false);
        render(&session, &request);
        session.stats().error.and_then(|row| row.estimate).expect("it is told").high
    };
    let (early, late) = (high(16), high(64));
    assert!(late < early, "more samples, less error");
    #[expect(clippy::cast_possible_truncation, reason = "a bound")]
    for (target, kept) in [(1.01 * early as f32, 0), (1.01 * late as f32, 20)] {
        let session = open(mirror, settings(20, 2), false);
        render(&session, &request);
        set(&session, "oocpt:targetError", SettingValue::Float(target.into()));
        set_samples(&session, 1 << 12);
        render(&session, &request);
        let at_once = open(mirror, Settings { target_error: target, ..settings(1 << 12, 2) }, false);
        render(&at_once, &request);
        let (stats, whole) = (session.stats(), at_once.stats());
        assert_eq!((stats.samples_completed, stats.samples_kept), (whole.samples_completed, kept), "{target:e}");
        let [a, b] = [&session, &at_once].map(|session| read::<u32>(session, &request, AovKind::Color));
        assert!(a == b, "the same bits at {target:e}");
    }
}

#[test]
fn a_report_of_samples_that_are_there_begins_with_their_error() {
    let file = std::env::temp_dir().join(format!("oocpt-going-on-{}.jsonl", std::process::id()));
    let session = open(mirror, settings(6, 2), false);
    let request = color_view([24, 18]);
    render(&session, &request);
    let before = session.stats().error.expect("it is told");
    set(&session, "oocpt:report", SettingValue::Text(file.to_string_lossy().into()));
    render(&session, &request);
    assert_eq!((session.stats().samples_kept, session.timings().paths), (6, 0), "nothing is traced");
    assert_eq!(session.stats().error.expect("it is told").estimate, before.estimate, "the error is that of before");
    set_samples(&session, 16);
    render(&session, &request);
    let reports = oocpt_render::error_report::ErrorReport::read_all(&file).expect("a report");
    std::fs::remove_file(&file).expect("it is there");
    let rows: Vec<Vec<u32>> =
        reports.iter().map(|report| report.rows.iter().map(|row| row.samples).collect()).collect();
    assert_eq!(rows, [vec![6], vec![6, 8, 16]], "each begins with what is there");
    let [first, .., last] = &*reports[1].rows else { panic!("three rows") };
    assert!(first.rays == 0 && first.seconds == 0.0 && first.estimate == before.estimate, "{first:?}");
    assert!(last.is_last && last.rays > 0, "{last:?}");
}
