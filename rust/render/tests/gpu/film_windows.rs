// SPDX-License-Identifier: Apache-2.0
//! Pictures whose film takes too much of the device's memory: rendered window by window, they have the bits and the
//! error of pictures that are rendered at once.

use crate::lights::TestFiles;
use crate::scenes::{dome, features, nested};
use crate::support::{
    color_request, filtering, perspective, read, read_all, render, render_with_messages, request, settings,
};
use glam::DVec3;
use oocpt_core::scene::{DomeFormat, SceneDb};
use oocpt_core::settings::{Settings, TraversalKind};
use oocpt_core::stats::{ErrorRow, RenderStats};
use oocpt_core::{LightDesc, LightKind};
use oocpt_render::{
    AovKind, PixelWindow, PlantedFaults, RenderRequest, Session, SessionOptions, Severity, error_report::ErrorReport,
    picture,
};
use std::path::PathBuf;
use std::sync::Arc;

/// No multiple of the sides of the tiles in which pixels are traced.
const SIZE: [u32; 2] = [53, 37];
/// Pixels of a window: nine rows of that picture, of which seven are shown.
const PIXELS: u32 = 53 * 9;
/// Windows of the picture, and pixels that they trace.
const WINDOWS: (u32, u64) = (5, 5 * 53 * 9);

fn view(size: [u32; 2]) -> RenderRequest {
    request(perspective(DVec3::new(3.0, 4.0, 6.0), DVec3::new(0.0, 0.5, 0.0), 0.7, size))
}

fn session(build: fn(&mut SceneDb), settings: Settings, windows: Option<u32>, streams: bool) -> Session {
    let faults = PlantedFaults { film_window: windows, ..PlantedFaults::default() };
    let options = SessionOptions { validation: true, force_streaming: streams, faults, ..SessionOptions::default() };
    let session = Session::with_options(settings, options);
    session.set_light_files(Arc::new(TestFiles));
    session.with_scene(build);
    session
}

fn row(stats: &RenderStats) -> ErrorRow {
    stats.error.clone().expect("the error is told")
}

/// Whether two numbers are the same but for sums in another order.
fn is_near(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-5 * a.abs().max(b.abs())
}

/// Whether two pictures have the same bits, and the errors of their pixels are the same to rounding.
fn expect_same(request: &RenderRequest, [whole, parts]: [&Session; 2], what: &str) {
    let [whole, parts] = [whole, parts].map(|session| read_all(session, request));
    for ((aov, whole), parts) in request.aovs.iter().zip(&whole).zip(&parts) {
        if aov.kind == AovKind::Error {
            let floats = |bytes: &[u8]| bytemuck::pod_collect_to_vec::<u8, f32>(bytes);
            let pairs: Vec<_> =
                floats(whole).into_iter().map(f64::from).zip(floats(parts).into_iter().map(f64::from)).collect();
            assert!(pairs.iter().all(|(a, b)| is_near(*a, *b)), "{what}: errors of pixels");
            assert!(pairs.iter().any(|(a, _)| *a > 0.0), "{what}: some pixel has an error");
        } else {
            assert!(whole == parts, "{what}: {:?} has other bits", aov.kind);
        }
    }
}

/// Whether what is told of the error is the same to rounding, at the same samples.
fn expect_same_error(whole: &ErrorRow, parts: &ErrorRow, what: &str) {
    assert_eq!(whole.samples, parts.samples, "{what}");
    let numbers = |row: &ErrorRow| row.estimate.map(|e| [e.rel_mse, e.low, e.high]);
    match (numbers(whole), numbers(parts)) {
        (Some(whole), Some(parts)) => {
            assert!(whole.iter().zip(&parts).all(|(a, b)| is_near(*a, *b)), "{what}: {whole:?}, {parts:?}");
        }
        (whole, parts) => assert_eq!(whole, parts, "{what}"),
    }
    // One of each workgroup is looked at, and windows have others.
    let worst = |row: &ErrorRow| row.worst.first().map(|pixel| (pixel.x, pixel.y, pixel.error.to_bits()));
    assert_eq!(worst(whole), worst(parts), "{what}: the worst pixel");
}

/// Renders a picture at once and in windows, and compares all of both.
fn same_picture(what: &str, build: fn(&mut SceneDb), settings: &Settings, streams: bool, request: &RenderRequest) {
    let whole = session(build, settings.clone(), None, streams);
    render(&whole, request);
    let parts = session(build, settings.clone(), Some(PIXELS), streams);
    render(&parts, request);
    expect_same(request, [&whole, &parts], what);
    let [one, many] = [&whole, &parts].map(Session::stats);
    assert_eq!((one.film_windows, many.samples_completed), (0, settings.samples_per_pixel), "{what}");
    assert_eq!((one.percent_done, many.percent_done), (100.0, 100.0), "{what}");
    assert!(many.film_windows > 1, "{what}: in windows");
    expect_same_error(&row(&one), &row(&many), what);
    // Rows that two windows trace are traced twice.
    assert!(many.rays_traced > one.rays_traced && many.rays_traced < 2 * one.rays_traced, "{what}");
}

fn by(traversal: TraversalKind, samples: u32) -> Settings {
    filtering(Settings { traversal, chunk_size_kib: 16, ..settings(samples, 3) })
}

#[test]
fn a_film_of_windows_has_the_bits_and_the_error_of_the_whole_one() {
    let view = view(SIZE);
    same_picture("native", features, &by(TraversalKind::Auto, 8), false, &view);
    same_picture("between octaves", features, &by(TraversalKind::Auto, 6), false, &view);
    same_picture("compute", features, &by(TraversalKind::Compute, 4), false, &view);
    let window = Some(PixelWindow { x: 3, y: 5, width: 41, height: 30 });
    same_picture("a crop window", features, &by(TraversalKind::Auto, 8), false, &RenderRequest { window, ..view });
}

#[test]
fn a_film_of_windows_has_the_bits_of_the_whole_one_while_streaming() {
    let small = Settings { geometry_budget_kib: 96, ..by(TraversalKind::Auto, 4) };
    same_picture("streaming", nested, &small, true, &view(SIZE));
}

#[test]
fn every_window_traces_its_rows_and_one_beside_them() {
    let parts = session(nested, by(TraversalKind::Auto, 4), Some(PIXELS), false);
    render(&parts, &view(SIZE));
    let (windows, pixels) = WINDOWS;
    assert_eq!((parts.stats().film_windows, parts.timings().paths), (windows, 4 * pixels));
    // A picture that one window holds is rendered as ever.
    let small = color_request(perspective(DVec3::new(3.0, 4.0, 6.0), DVec3::Y * 0.5, 0.7, [20, 20]));
    render(&parts, &small);
    assert_eq!((parts.stats().film_windows, parts.timings().paths), (0, 4 * 400));
}

#[test]
fn a_target_error_ends_all_windows_at_the_samples_of_the_whole_picture() {
    let request = view(SIZE);
    for target in [1e-2, 1.2e-3, 1e-9] {
        let settings = Settings { target_error: target, ..by(TraversalKind::Auto, 96) };
        let whole = session(features, settings.clone(), None, false);
        render(&whole, &request);
        let parts = session(features, settings, Some(PIXELS), false);
        render(&parts, &request);
        let what = format!("{target}");
        expect_same(&request, [&whole, &parts], &what);
        let samples = row(&whole.stats()).samples;
        expect_same_error(&row(&whole.stats()), &row(&parts.stats()), &what);
        // Films are gone on with from round to round.
        assert_eq!(parts.timings().paths, WINDOWS.1 * u64::from(samples), "{what}: no sample is taken twice");
        let expected = match target {
            5e-3.. => 16..=16,
            1e-4.. => 32..=64,
            _ => 96..=96,
        };
        assert!(expected.contains(&samples), "{what}: {samples} samples");
    }
}

#[test]
fn windows_share_a_time_limit_and_all_have_samples() {
    let request = view(SIZE);
    let limited = Settings { time_limit_secs: 1e-3, ..by(TraversalKind::Auto, 1 << 20) };
    let parts = session(nested, limited, Some(PIXELS), false);
    render(&parts, &request);
    let counts: Vec<f32> = read(&parts, &request, AovKind::SampleCount);
    assert!(counts.iter().all(|count| (1.0..1e6).contains(count)), "a sample each, and not all of them");
    let (stats, fewest) = (parts.stats(), counts.iter().copied().fold(f32::MAX, f32::min));
    assert!(f64::from(stats.samples_completed) <= f64::from(fewest), "{} of {fewest}", stats.samples_completed);
}

fn temporary(name: &str) -> PathBuf {
    std::env::temp_dir().join(format!("oocpt-film-windows-{}-{name}", std::process::id()))
}

#[test]
fn the_report_of_windows_has_the_rows_of_the_whole_picture() {
    let request = color_request(view(SIZE).camera);
    let whole = session(features, by(TraversalKind::Auto, 12), None, false);
    render(&whole, &request);
    let color: Vec<f32> = read(&whole, &request, AovKind::Color);
    let reference = temporary("reference.exr");
    picture::write(&reference, SIZE, &color, &picture::PictureAttributes::new()).expect("a temporary file");
    let rows = |windows: Option<u32>, name: &str| {
        let file = temporary(name);
        let [report, reference] = [&file, &reference].map(|path| path.to_string_lossy().into_owned());
        let settings = Settings { report, reference, ..by(TraversalKind::Auto, 12) };
        render(&session(features, settings, windows, false), &request);
        let reports = ErrorReport::read_all(&file).expect("a report");
        std::fs::remove_file(file).expect("it is there");
        assert_eq!(reports.len(), 1, "{name}: one render");
        let report = reports.into_iter().next().expect("one");
        assert!(report.inventory.is_some() && report.usage.is_some(), "{name}: the other lines");
        report.rows
    };
    let (whole, parts) = (rows(None, "whole.jsonl"), rows(Some(PIXELS), "parts.jsonl"));
    std::fs::remove_file(reference).expect("it is there");
    assert_eq!((whole.len(), parts.len()), (5, 5), "1, 2, 4, 8 and 12 samples");
    whole.iter().zip(&parts).for_each(|(whole, parts)| expect_same_error(whole, parts, "a row"));
    assert!(
        parts.windows(2).all(|pair| pair[0].seconds < pair[1].seconds && pair[0].rays < pair[1].rays),
        "{parts:#?}"
    );
    let truth = parts[4].truth.expect("the last picture is compared");
    assert_eq!((truth.rel_mse, truth.rmse, truth.flip), (0.0, 0.0, 0.0), "the same bits");
    assert!(parts[..4].iter().all(|row| row.truth.is_none()) && parts[4].is_last, "there is no picture before");
}

#[test]
fn adaptive_samples_are_decided_in_each_window_and_a_warning_says_so_once() {
    let request = view(SIZE);
    let adaptive =
        Settings { adaptive_sampling: true, checkpoint: "nowhere.film".into(), ..by(TraversalKind::Auto, 64) };
    let parts = session(features, adaptive, Some(PIXELS), false);
    let messages = render_with_messages(&parts, &request);
    let told = |word: &str| messages.iter().filter(|message| message.text.starts_with(word)).count();
    assert_eq!((told("oocpt:adaptiveSampling: "), told("oocpt:checkpoint: ")), (1, 1), "{messages:#?}");
    assert!(messages.len() == 2 && messages.iter().all(|message| message.severity == Severity::Warning));
    let counts: Vec<f32> = read(&parts, &request, AovKind::SampleCount);
    let mean = counts.iter().sum::<f32>() / (SIZE[0] * SIZE[1]) as f32;
    assert!((56.0..=64.0).contains(&mean) && counts.iter().any(|count| *count > 64.0), "{mean} on average");
    assert!(row(&parts.stats()).estimate.is_some(), "the error of all windows");
    assert!(!PathBuf::from("nowhere.film").exists(), "there are no checkpoints");
}

/// Bytes of the film on the device.
fn film_bytes(stats: &RenderStats) -> u64 {
    let is_film = |name: &str| ["film", "color", "plane_sums"].contains(&name) || name.starts_with("image ");
    stats.inventory.buffers.iter().filter(|buffer| is_film(&buffer.name)).map(|buffer| buffer.bytes).sum()
}

#[test]
fn a_film_that_outgrows_the_budget_becomes_a_picture_within_it() {
    const MIB: u64 = 1 << 20;
    let request = view([400, 300]);
    let with = |mib: u32| {
        let session = session(nested, Settings { memory_budget_mib: mib, ..by(TraversalKind::Auto, 2) }, None, false);
        render(&session, &request);
        session
    };
    let (large, small) = (with(1024), with(48));
    let [one, many] = [&large, &small].map(Session::stats);
    assert!(film_bytes(&one) > 48 * MIB && one.film_windows == 0, "{} bytes", film_bytes(&one));
    assert!(
        many.gpu_peak_bytes <= 48 * MIB && many.film_windows > 4,
        "{} in {}",
        many.gpu_peak_bytes,
        many.film_windows
    );
    let bytes = film_bytes(&many);
    assert!(bytes <= 12 * MIB + MIB / 4 && bytes > 9 * MIB, "a window takes a quarter of it: {bytes}");
    expect_same(&request, [&large, &small], "budgets");
    expect_same_error(&row(&one), &row(&many), "budgets");
}

#[test]
fn images_that_exceed_the_budget_of_host_memory_are_told() {
    let settings = Settings { host_memory_budget_mib: 1, ..by(TraversalKind::Auto, 2) };
    let parts = session(nested, settings, Some(200 * 50), false);
    let messages = render_with_messages(&parts, &view([200, 150]));
    let told = messages.iter().filter(|message| message.text.contains("images of the picture take 6 MiB")).count();
    assert_eq!(told, 1, "{messages:#?}");
}

#[test]
fn what_each_window_warns_of_is_told_once() {
    let told = |windows: Option<u32>| {
        let faults = PlantedFaults { film_window: windows, ..PlantedFaults::default() };
        let options = SessionOptions { validation: true, faults, ..SessionOptions::default() };
        let session = Session::with_options(by(TraversalKind::Auto, 1), options);
        session.set_light_files(Arc::new(TestFiles));
        session.with_scene(nested);
        let texture = Some(TestFiles::asset("nothing"));
        let kind = LightKind::Dome { texture, format: DomeFormat::Automatic };
        session.with_scene(|db| db.upsert_light(LightDesc { kind, ..dome([1.0; 3]) }));
        let told = render_with_messages(&session, &color_request(view(SIZE).camera));
        (told, session.stats().film_windows)
    };
    let ((whole, none), (parts, windows)) = (told(None), told(Some(PIXELS)));
    assert!(!whole.is_empty() && none == 0 && windows > 1, "{whole:#?}");
    assert_eq!(whole, parts);
}

#[test]
fn a_film_that_leaves_too_little_for_the_rest_becomes_a_picture_all_the_same() {
    const MIB: u64 = 1 << 20;
    let request = view([97, 69]);
    let with = |mib: u32| {
        let session = session(nested, Settings { memory_budget_mib: mib, ..by(TraversalKind::Auto, 2) }, None, false);
        render(&session, &request);
        session
    };
    let (large, small) = (with(1024), with(5));
    let [one, many] = [&large, &small].map(Session::stats);
    assert!(4 * film_bytes(&one) < 3 * 5 * MIB, "less than three quarters of the budget: {}", film_bytes(&one));
    assert!(many.film_windows > 4 && many.gpu_peak_bytes <= 5 * MIB, "{} windows", many.film_windows);
    expect_same(&request, [&large, &small], "the last attempt");
    expect_same_error(&row(&one), &row(&many), "the last attempt");
    assert!(many.rays_traced < 2 * one.rays_traced, "attempts that failed are not counted");
}
