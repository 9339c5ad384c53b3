// SPDX-License-Identifier: Apache-2.0
//! Windows that move in a live view: pixels that both have keep their samples, nothing else is traced twice, and the
//! bits are those of a view that was there from the beginning.

use crate::lights::TestFiles;
use crate::scenes::{features, nested};
use crate::support::{TIMEOUT, filtering, perspective, read, render, request, settings};
use glam::DVec3;
use oocpt_core::scene::SceneDb;
use oocpt_core::settings::{SettingValue, Settings, TraversalKind};
use oocpt_render::{AovKind, AovRequest, PixelWindow, PlantedFaults, RenderRequest, Session, SessionOptions};
use std::sync::Arc;
use std::time::Instant;

const SIZE: [u32; 2] = [61, 43];

fn of(x: u32, y: u32, width: u32, height: u32) -> PixelWindow {
    PixelWindow { x, y, width, height }
}

/// All images, and those whose samples have ids and depths.
fn within(window: PixelWindow) -> RenderRequest {
    let mut request = request(perspective(DVec3::new(3.0, 4.0, 6.0), DVec3::new(0.0, 0.5, 0.0), 0.7, SIZE));
    request.aovs.push(AovRequest { kind: AovKind::CryptoObject, clear: [0.0; 4] });
    RenderRequest { window: Some(window), ..request }
}

fn open(build: fn(&mut SceneDb), settings: Settings, streams: bool) -> Session {
    // However slow the device is, no coarser picture comes first.
    let faults = PlantedFaults { first_picture: Some(1), ..PlantedFaults::default() };
    let options = SessionOptions { validation: true, force_streaming: streams, faults, ..SessionOptions::default() };
    let session = Session::with_options(settings, options);
    session.set_light_files(Arc::new(TestFiles));
    session.with_scene(build);
    session
}

fn set_samples(session: &Session, samples: u32) {
    let set = session.set_setting("oocpt:samplesPerPixel", SettingValue::Int(samples.into()));
    assert!(set.is_ok(), "a setting that is known: {set:?}");
}

/// Whether two sessions have the same images of a request, but for the error of pixels, which is told of all.
fn same_images(a: &Session, b: &Session, request: &RenderRequest) -> bool {
    let mut kinds = request.aovs.iter().map(|aov| aov.kind).filter(|kind| *kind != AovKind::Error);
    kinds.all(|kind| read::<u8>(a, request, kind) == read::<u8>(b, request, kind))
}

/// Moves the window of a view step by step, with more samples on the way.
fn moves(what: &str, build: fn(&mut SceneDb), settings: &Settings, streams: bool) {
    // Live views refine surfaces at rates of their own.
    let settings = Settings { interactive: true, ..settings.clone() };
    let live = open(build, settings.clone(), streams);
    let mut before: Option<(PixelWindow, u32)> = None;
    let (panned, whole) = (of(9, 6, 33, 29), of(0, 0, SIZE[0], SIZE[1]));
    for (window, samples) in [(of(4, 3, 33, 29), 5), (panned, 5), (of(9, 6, 20, 37), 9), (whole, 9), (panned, 9)] {
        set_samples(&live, samples);
        let request = within(window);
        render(&live, &request);
        let at_once = open(build, Settings { samples_per_pixel: samples, ..settings.clone() }, streams);
        render(&at_once, &request);
        assert!(same_images(&live, &at_once, &request), "{what}: other bits in {window:?}");
        let (timings, stats) = (live.timings(), live.stats());
        let (shared, had) = before.map_or((0, 0), |(before, had)| (shared(window, before), had));
        let fresh = (window.pixels() - shared) * u64::from(had);
        assert_eq!(timings.caught_up_paths, fresh, "{what}: nothing else catches up, {window:?}");
        assert_eq!(timings.paths, window.pixels() * u64::from(samples - had), "{what}: and all go on, {window:?}");
        assert_eq!((stats.samples_kept, stats.samples_completed), (had, samples), "{what}: it is told, {window:?}");
        assert!(stats.error.is_some_and(|row| row.samples == samples), "{what}: so is the error, {window:?}");
        before = Some((window, samples));
    }
}

/// Pixels that two windows have in common.
fn shared(a: PixelWindow, b: PixelWindow) -> u64 {
    let span = |[a, a_size]: [u32; 2], [b, b_size]: [u32; 2]| (a + a_size).min(b + b_size).saturating_sub(a.max(b));
    u64::from(span([a.x, a.width], [b.x, b.width])) * u64::from(span([a.y, a.height], [b.y, b.height]))
}

fn by(traversal: TraversalKind) -> Settings {
    filtering(Settings { traversal, chunk_size_kib: 16, ..settings(5, 2) })
}

#[test]
fn a_moved_window_keeps_the_pixels_it_shares() {
    moves("compute", nested, &by(TraversalKind::Compute), false);
    moves("native", features, &by(TraversalKind::Auto), false);
}

#[test]
fn a_moved_window_keeps_the_pixels_it_shares_while_streaming() {
    moves("streaming", nested, &by(TraversalKind::Auto), true);
}

/// Waits until something is so.
fn waits_for(what: &str, session: &Session, is_so: impl Fn() -> bool) {
    let end = Instant::now() + TIMEOUT;
    while !is_so() {
        assert!(Instant::now() < end, "{what}: {:?}", session.take_messages());
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
}

/// Whoever drags a window interrupts what new pixels of the step before catch up.
#[test]
fn a_window_that_is_dragged_keeps_its_samples() {
    let live = open(nested, Settings { interactive: true, ..settings(24, 2) }, false);
    let window = |step: u32| of(step, step / 2, 30, 22);
    render(&live, &within(window(0)));
    for step in 1..12 {
        live.render(within(window(step)));
        waits_for("a picture", &live, || live.shown_generation() == live.generation());
    }
    set_samples(&live, 40);
    render(&live, &within(window(12)));
    let (kept, timings, pixels) = (live.stats().samples_kept, live.timings(), window(0).pixels());
    assert_eq!((kept, timings.paths), (24, 16 * pixels), "all pixels go on together");
    let most = (pixels - shared(window(0), window(12))) * 24;
    assert!(timings.caught_up_paths <= most, "{} of {most} paths catch up", timings.caught_up_paths);
    let at_once = open(nested, settings(40, 2), false);
    render(&at_once, &within(window(12)));
    assert!(same_images(&live, &at_once, &within(window(12))), "other bits");
}

/// The film has a part of a sample then.
#[test]
fn a_window_that_moves_while_it_is_rendered_keeps_its_samples() {
    const MANY: u32 = 1 << 11;
    let live = open(nested, Settings { interactive: true, ..settings(1 << 20, 2) }, false);
    let [first, second] = [of(4, 3, 30, 27), of(9, 5, 30, 27)];
    live.render(within(first));
    waits_for("samples", &live, || live.stats().samples_completed >= 3);
    set_samples(&live, MANY);
    render(&live, &within(second));
    let (kept, timings, pixels) = (live.stats().samples_kept, live.timings(), second.pixels());
    assert!((3..MANY).contains(&kept), "{kept} samples are kept");
    assert_eq!(timings.paths, pixels * u64::from(MANY - kept), "all pixels go on together");
    // A strip of eight rows was under way, and rows above it have a sample less.
    let most = (pixels - shared(first, second) + 8 * 30) * u64::from(kept) + pixels;
    assert!(timings.caught_up_paths <= most, "{} of {most} paths catch up", timings.caught_up_paths);
    let at_once = open(nested, settings(MANY, 2), false);
    render(&at_once, &within(second));
    assert!(same_images(&live, &at_once, &within(second)), "other bits");
}

/// Without memory for the film of the new pixels the view begins again, and is no error.
#[test]
fn a_moved_window_without_memory_for_another_film_begins_again() {
    let faults = PlantedFaults { first_picture: Some(1), has_no_second_film: true, ..PlantedFaults::default() };
    let options = SessionOptions { validation: true, faults, ..SessionOptions::default() };
    let settings = Settings { interactive: true, ..settings(5, 2) };
    let live = Session::with_options(settings.clone(), options);
    live.with_scene(nested);
    let [first, second] = [of(4, 3, 30, 27), of(9, 5, 30, 27)];
    render(&live, &within(first));
    render(&live, &within(second));
    let (timings, kept) = (live.timings(), live.stats().samples_kept);
    assert_eq!((timings.paths, timings.caught_up_paths, kept), (5 * second.pixels(), 0, 0), "all of it");
    let at_once = open(nested, settings, false);
    render(&at_once, &within(second));
    assert!(same_images(&live, &at_once, &within(second)), "other bits");
}

/// Where the error decides, or in a batch render, another window is another picture.
#[test]
fn other_windows_begin_again_where_they_have_to() {
    let settings = settings(4, 2);
    let of_error = Settings { interactive: true, target_error: 1e-9, ..settings.clone() };
    for settings in [settings, of_error] {
        let session = open(nested, settings, false);
        for window in [of(4, 3, 33, 29), of(9, 6, 33, 29)] {
            render(&session, &within(window));
            let timings = session.timings();
            assert_eq!((timings.paths, timings.caught_up_paths), (4 * window.pixels(), 0), "all of it");
        }
    }
}
