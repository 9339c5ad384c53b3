// SPDX-License-Identifier: Apache-2.0
//! Windows of a picture: the pixels inside are those of the whole picture, nothing else is traced, sampled, counted or
//! held, and what is outside is clear.

use crate::lights::TestFiles;
use crate::motion::mill;
use crate::scenes::{dome, features, nested, prim, sphere};
use crate::support::{
    TIMEOUT, color_request, filtering, perspective, read, read_all, render, render_with_messages, request, settings,
};
use glam::{DMat4, DVec3};
use oocpt_abi::sampler::hash;
use oocpt_core::scene::SceneDb;
use oocpt_core::settings::{SettingValue, Settings, TraversalKind};
use oocpt_render::{AovKind, PixelWindow, PlantedFaults, RenderRequest, Session, SessionOptions, Severity, picture};
use std::path::PathBuf;
use std::sync::Arc;

/// No multiple of the sides of the tiles in which pixels are traced.
const SIZE: [u32; 2] = [53, 37];

fn view() -> RenderRequest {
    request(perspective(DVec3::new(3.0, 4.0, 6.0), DVec3::new(0.0, 0.5, 0.0), 0.7, SIZE))
}

fn within(window: PixelWindow, request: &RenderRequest) -> RenderRequest {
    RenderRequest { window: Some(window), ..request.clone() }
}

fn session(build: fn(&mut SceneDb), settings: Settings, options: SessionOptions) -> Session {
    let session = Session::with_options(settings, SessionOptions { validation: true, ..options });
    session.set_light_files(Arc::new(TestFiles));
    session.with_scene(build);
    session
}

/// Whether images of the window are those of the whole picture inside, and clear outside.
fn expect_window(window: PixelWindow, request: &RenderRequest, whole: &[Vec<u8>], images: &[Vec<u8>], what: &str) {
    for ((aov, whole), image) in request.aovs.iter().zip(whole).zip(images) {
        let bytes = aov.kind.pixel_bytes();
        let clear = match aov.kind {
            kind if kind.is_id() => (-1_i32).to_ne_bytes(),
            _ => aov.clear[0].to_ne_bytes(),
        };
        for (number, (have, want)) in (0..).zip(image.chunks_exact(bytes).zip(whole.chunks_exact(bytes))) {
            let (x, y) = (number % request.width, number / request.width);
            let inside =
                (window.x..window.x + window.width).contains(&x) && (window.y..window.y + window.height).contains(&y);
            let kind = aov.kind;
            if inside {
                // The error of a pixel is its share of that of what is rendered.
                let is_same = have == want || kind == AovKind::Error;
                assert!(is_same, "{what}, {window:?}: {kind:?} at {x}, {y} is not that of the whole picture");
            } else {
                assert_eq!(have[..4], clear, "{what}, {window:?}: {kind:?} at {x}, {y} is not clear");
            }
        }
    }
}

/// Renders windows one after the other in one session, and compares them with the whole picture of another one.
fn same_pixels(what: &str, build: fn(&mut SceneDb), settings: &Settings, streams: bool, windows: &[PixelWindow]) {
    let request = view();
    let options = SessionOptions { force_streaming: streams, ..SessionOptions::default() };
    let alone = session(build, settings.clone(), options);
    render(&alone, &request);
    let whole = read_all(&alone, &request);
    let all = alone.timings();
    let moving = session(build, settings.clone(), options);
    for window in windows {
        render(&moving, &within(*window, &request));
        expect_window(*window, &request, &whole, &read_all(&moving, &request), what);
        let paths = window.pixels() * u64::from(settings.samples_per_pixel);
        assert_eq!(moving.timings().paths, paths, "{what}, {window:?}: nothing else is sampled");
        assert!(window.pixels() == view().pixels() || moving.timings().closest_rays < all.closest_rays, "{what}");
    }
    render(&moving, &request);
    assert!(read_all(&moving, &request) == whole, "{what}: the whole picture after windows");
}

/// Corners, single pixels, a row and a column, and random ones.
fn windows(number: u32) -> Vec<PixelWindow> {
    let of = |x, y, width, height| PixelWindow { x, y, width, height };
    let [width, height] = SIZE;
    let mut windows = vec![
        of(0, 0, 1, 1),
        of(width - 1, height - 1, 1, 1),
        of(0, 17, width, 1),
        of(29, 0, 1, height),
        of(3, 5, 31, 22),
    ];
    windows.extend((0..number).map(|n| {
        let random = |dimension: u32, below: u32| hash(hash(n) ^ dimension) % below;
        let (x, y) = (random(0, width), random(1, height));
        of(x, y, 1 + random(2, width - x), 1 + random(3, height - y))
    }));
    windows
}

fn by(traversal: TraversalKind) -> Settings {
    filtering(Settings { traversal, chunk_size_kib: 16, ..settings(3, 3) })
}

#[test]
fn a_window_has_the_pixels_of_the_whole_picture() {
    same_pixels("features, in core", features, &by(TraversalKind::Compute), false, &windows(20));
    same_pixels("features, native", features, &by(TraversalKind::Auto), false, &windows(20));
    same_pixels("motion", |db| mill(db, 0.0, 1.0), &by(TraversalKind::Auto), false, &windows(4));
}

#[test]
fn a_window_has_the_pixels_of_the_whole_picture_while_streaming() {
    same_pixels("features, streaming", features, &by(TraversalKind::Compute), true, &windows(4));
    same_pixels("features, native and streaming", features, &by(TraversalKind::Auto), true, &windows(4));
    let small = Settings { geometry_budget_kib: 96, ..by(TraversalKind::Auto) };
    same_pixels("nested, little memory", nested, &small, true, &windows(2));
}

/// The ball of a furnace, whose image is the lower left corner of the picture; all else is one colour without noise.
fn ball_in_a_furnace(db: &mut SceneDb) {
    db.upsert_mesh(sphere(prim("/ball", DMat4::from_translation(DVec3::new(-1.4, -1.0, 0.0))), 1, 20, 0.5));
    db.upsert_light(dome([1.0; 3]));
}

#[test]
fn error_and_progress_are_those_of_the_window() {
    let request = color_request(perspective(DVec3::Z * 5.0, DVec3::ZERO, 0.8, SIZE));
    let session = session(ball_in_a_furnace, settings(16, 2), SessionOptions::default());
    render(&session, &request);
    let whole = session.stats();
    let quiet = PixelWindow { x: 30, y: 20, width: 23, height: 17 };
    render(&session, &within(quiet, &request));
    let stats = session.stats();
    let error = |stats: &oocpt_core::stats::RenderStats| {
        stats.error.as_ref().and_then(|row| row.estimate).expect("sixteen samples tell").rel_mse
    };
    assert!(error(&whole) > 1e-9 && error(&stats) <= 1e-12, "{:e}, {:e}", error(&whole), error(&stats));
    assert_eq!((stats.samples_completed, stats.percent_done), (16, 100.0));
    let film = |stats: &oocpt_core::stats::RenderStats| {
        stats.inventory.buffers.iter().find(|buffer| buffer.name == "color").expect("there is colour").bytes
    };
    assert_eq!(film(&stats) * request.pixels(), film(&whole) * quiet.pixels(), "memory is that of the window");
    let noisy = PixelWindow { x: 5, y: 3, width: 20, height: 16 };
    render(&session, &within(noisy, &request));
    let row = session.stats().error.expect("it is told");
    let share = row.estimate.expect("as above").rel_mse / error(&whole);
    assert!(share > 1.5, "the window has more than its share of the error: {share}");
    let inside = |x: u32, y: u32| (5..25).contains(&x) && (SIZE[1] - 19..SIZE[1] - 3).contains(&y);
    assert!(!row.worst.is_empty() && row.worst.iter().all(|pixel| inside(pixel.x, pixel.y)), "{:?}", row.worst);
    let of_whole: Vec<_> = whole.error.expect("it is told").worst.iter().map(|pixel| (pixel.x, pixel.y)).collect();
    assert!(row.worst.iter().any(|pixel| of_whole.contains(&(pixel.x, pixel.y))), "the same places: {of_whole:?}");
}

#[test]
fn adaptive_samples_stay_in_the_window() {
    let mut request = view();
    request.aovs.retain(|aov| matches!(aov.kind, AovKind::Color | AovKind::SampleCount));
    let window = PixelWindow { x: 9, y: 4, width: 30, height: 21 };
    let adaptive = Settings { adaptive_sampling: true, ..settings(64, 2) };
    let in_window = |streams| {
        let options = SessionOptions { force_streaming: streams, ..SessionOptions::default() };
        let session = session(features, adaptive.clone(), options);
        render(&session, &within(window, &request));
        let counts: Vec<f32> = read(&session, &request, AovKind::SampleCount);
        (counts, read::<u32>(&session, &request, AovKind::Color), session.timings().paths)
    };
    let (counts, color, paths) = in_window(false);
    let most = u64::from(adaptive.samples_per_pixel) * window.pixels();
    assert!(paths <= most && paths * 10 >= most * 9, "{paths} of {most}");
    for (number, count) in (0..).zip(&counts) {
        let (x, y) = (number % SIZE[0], number / SIZE[0]);
        let inside = (9..39).contains(&x) && (4..25).contains(&y);
        assert!(if inside { *count >= 16.0 } else { *count == 0.0 }, "{count} samples at {x}, {y}");
    }
    assert!(counts.iter().any(|count| *count > 64.0), "some pixels get more than others");
    assert!(in_window(true).1 == color, "the same while streaming");
}

#[test]
fn the_first_picture_is_of_the_window() {
    let faults = PlantedFaults { first_picture: Some(3), first_picture_alone: true, ..PlantedFaults::default() };
    let live = Settings { interactive: true, ..settings(1, 2) };
    let session = session(nested, live, SessionOptions { faults, ..SessionOptions::default() });
    let window = PixelWindow { x: 7, y: 5, width: 34, height: 25 };
    session.render(within(window, &view()));
    assert!(session.wait_converged(TIMEOUT) && session.take_messages().is_empty(), "it ends");
    let whole = crate::support::session(settings(1, 2));
    whole.with_scene(nested);
    render(&whole, &view());
    let [coarse, fine] = [&session, &whole].map(|session| read::<i32>(session, &view(), AovKind::PrimId));
    let (mut same, mut middles) = (0, 0);
    for (number, (coarse, fine)) in (0..).zip(coarse.iter().zip(&fine)) {
        let (x, y): (u32, u32) = (number % SIZE[0], number / SIZE[0]);
        let inside = (7..41).contains(&x) && (5..30).contains(&y);
        assert!(inside || *coarse == -1, "clear at {x}, {y}");
        if inside && (x - 7) % 3 == 1 && (y - 5) % 3 == 1 {
            (same, middles) = (same + u32::from(coarse == fine), middles + 1);
        }
    }
    assert!(same * 100 >= middles * 97 && fine.iter().any(|id| *id >= 0), "{same} of {middles}");
}

#[test]
fn a_window_without_pixels_leaves_a_clear_picture() {
    let session = session(nested, settings(4, 2), SessionOptions::default());
    render(&session, &view());
    for window in [PixelWindow::default(), PixelWindow { x: SIZE[0], y: 0, width: 4, height: 4 }] {
        let messages = render_with_messages(&session, &within(window, &view()));
        assert_eq!(messages.len(), 1, "one message: {messages:?}");
        assert!(messages[0].severity == Severity::Warning && messages[0].text.contains("no pixel"), "{messages:?}");
        let images = read_all(&session, &view());
        expect_window(PixelWindow::default(), &view(), &images, &images, "nothing");
        assert_eq!(session.timings().paths, 0, "nothing is traced");
    }
    render(&session, &view());
    assert!(read::<i32>(&session, &view(), AovKind::PrimId).iter().any(|id| *id >= 0), "and then the whole picture");
}

fn temporary(name: &str) -> PathBuf {
    std::env::temp_dir().join(format!("oocpt-windows-{}-{name}", std::process::id()))
}

#[test]
fn only_the_window_is_compared_with_a_reference() {
    let request = color_request(perspective(DVec3::new(3.0, 4.0, 6.0), DVec3::Y * 0.5, 0.7, SIZE));
    let session = session(features, settings(4, 2), SessionOptions::default());
    render(&session, &request);
    let window = PixelWindow { x: 11, y: 6, width: 25, height: 19 };
    let mut reference: Vec<f32> = read(&session, &request, AovKind::Color);
    for (number, pixel) in (0..).zip(reference.chunks_exact_mut(4)) {
        let (x, y) = (number % SIZE[0], number / SIZE[0]);
        if !((11..36).contains(&x) && (6..25).contains(&y)) {
            pixel.fill(1e3);
        }
    }
    let (file, report) = (temporary("reference.exr"), temporary("report.jsonl"));
    picture::write(&file, SIZE, &reference, &picture::PictureAttributes::new()).expect("a temporary file");
    for (key, path) in [("oocpt:reference", &file), ("oocpt:report", &report)] {
        session.set_setting(key, SettingValue::Text(path.to_string_lossy().into())).expect("a setting");
    }
    render(&session, &within(window, &request));
    let truth = session.stats().error.expect("it is told").truth.expect("there is a reference");
    assert_eq!((truth.rel_mse, truth.rmse, truth.flip), (0.0, 0.0, 0.0), "the same pixels");
    let header = std::fs::read_to_string(&report).expect("the report");
    assert!(header.lines().next().is_some_and(|line| line.contains("\"window\":[11,12,36,31]")), "{header}");
    [file, report].iter().for_each(|path| std::fs::remove_file(path).expect("it is there"));
}

#[test]
fn the_report_of_chunks_is_of_the_window() {
    let request = color_request(view().camera);
    let window = PixelWindow { x: 11, y: 6, width: 25, height: 19 };
    let report = |window: Option<PixelWindow>| {
        let file = temporary("chunks.json");
        let settings = Settings { chunk_report: file.to_string_lossy().into(), ..by(TraversalKind::Auto) };
        let session = session(nested, settings, SessionOptions::default());
        render(&session, &RenderRequest { window, ..request.clone() });
        let read = oocpt_render::chunk_report::ChunkReport::read(&file).expect("a report");
        std::fs::remove_file(file).expect("it is there");
        read
    };
    let (whole, part) = (report(None), report(Some(window)));
    assert_eq!([part.width, part.height], window.size());
    for k in 0..3 {
        let camera = &whole.camera;
        let corner = camera.d[k] + 11.0 * camera.d_x[k] + 6.0 * camera.d_y[k];
        assert!((part.camera.d[k] - corner).abs() < 1e-12, "rays of the window's corner");
    }
}
