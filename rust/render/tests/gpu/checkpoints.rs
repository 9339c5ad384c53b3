// SPDX-License-Identifier: Apache-2.0
//! Checkpoints: a render that goes on from a file has the bits and the error of one that was never stopped, wherever it
//! was stopped; files that are not its own stay as they are; and nothing that is wrong with a file ends a render.

use crate::scenes::{features, nested, sun};
use crate::support::{TIMEOUT, perspective, read_all, render, render_with_messages, request, settings};
use glam::{DMat4, DVec3};
use oocpt_core::convergence::ErrorEstimate;
use oocpt_core::scene::SceneDb;
use oocpt_core::settings::{Settings, TraversalKind};
use oocpt_core::stats::{ErrorRow, WorstPixel};
use oocpt_film::FilmReader;
use oocpt_render::{PixelWindow, RenderRequest, Session, SessionOptions};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// A folder for one test, removed at the end.
pub(crate) struct Folder(PathBuf);

impl Folder {
    pub(crate) fn new(name: &str) -> Self {
        let folder = std::env::temp_dir().join(format!("oocpt-checkpoints-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a temporary folder");
        Self(folder)
    }

    pub(crate) fn file(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        std::fs::remove_dir_all(&self.0).expect("own files can be removed");
    }
}

pub(crate) fn view() -> RenderRequest {
    request(perspective(DVec3::new(3.0, 4.0, 6.0), DVec3::new(0.0, 0.5, 0.0), 0.7, [45, 31]))
}

pub(crate) fn open(build: fn(&mut SceneDb), settings: Settings, streams: bool) -> Session {
    let options = SessionOptions { validation: true, force_streaming: streams, ..SessionOptions::default() };
    let session = Session::with_options(settings, options);
    session.with_scene(build);
    session
}

fn with_file(settings: &Settings, samples: u32, file: &Path) -> Settings {
    let checkpoint = file.to_string_lossy().into_owned();
    Settings { checkpoint, checkpoint_secs: 0.0, samples_per_pixel: samples, ..settings.clone() }
}

pub(crate) fn by(traversal: TraversalKind) -> Settings {
    Settings { traversal, chunk_size_kib: 16, ..settings(1, 3) }
}

type ToldError = (u32, Option<ErrorEstimate>, Vec<WorstPixel>, bool);

/// The parts of a row that do not tell the time.
fn told(row: Option<ErrorRow>) -> ToldError {
    let row = row.expect("the error is told");
    (row.samples, row.estimate, row.worst, row.is_last)
}

/// Pictures and error of a render that was never stopped.
fn at_once(build: fn(&mut SceneDb), settings: &Settings, samples: u32, streams: bool) -> (Vec<Vec<u8>>, ToldError) {
    let session = open(build, Settings { samples_per_pixel: samples, ..settings.clone() }, streams);
    render(&session, &view());
    (read_all(&session, &view()), told(session.stats().error))
}

/// Renders in processes of 3, 6 and 7 samples, one after the other, each in a way of its own.
fn goes_on(name: &str, build: fn(&mut SceneDb), ways: &[(Settings, bool)]) {
    let folder = Folder::new(name);
    let file = folder.file("film");
    let mut before = 0;
    for ((way, streams), samples) in ways.iter().cycle().zip([3, 6, 7]) {
        let session = open(build, with_file(way, samples, &file), *streams);
        render(&session, &view());
        let stats = session.stats();
        assert_eq!((stats.samples_completed, stats.samples_kept), (samples, before), "{name}: both are told");
        let paths = u64::from(samples - before) * view().pixels();
        assert_eq!(session.timings().paths, paths, "{name}: no other paths, {samples}");
        let whole = at_once(build, way, samples, *streams);
        assert!(read_all(&session, &view()) == whole.0, "{name}: other bits at {samples} samples");
        assert_eq!(told(stats.error), whole.1, "{name}: the error at {samples} samples");
        before = samples;
    }
    let kept = std::fs::read(&file).expect("a file");
    let again = open(build, with_file(&ways[0].0, 7, &file), ways[0].1);
    render(&again, &view());
    assert_eq!(again.timings().paths, 0, "{name}: nothing is traced twice");
    assert!(std::fs::read(&file).expect("a file") == kept, "{name}: nothing to write");
}

#[test]
fn renders_go_on_from_a_file_in_core() {
    goes_on("compute", features, &[(by(TraversalKind::Compute), false)]);
    goes_on("native", features, &[(by(TraversalKind::Auto), false)]);
}

#[test]
fn renders_go_on_from_a_file_while_streaming() {
    goes_on("streaming", nested, &[(by(TraversalKind::Compute), true)]);
}

#[test]
fn renders_go_on_from_a_file_at_another_budget() {
    let small = Settings { geometry_budget_kib: 96, ..by(TraversalKind::Auto) };
    goes_on("budgets", nested, &[(by(TraversalKind::Auto), false), (small, true), (by(TraversalKind::Compute), false)]);
}

/// Copies the file while a render works, as often as it changes: what a kill at that moment would leave.
fn copies(file: &Path, session: &Session, count: usize) -> Vec<Vec<u8>> {
    let end = Instant::now() + TIMEOUT;
    let mut copies: Vec<Vec<u8>> = Vec::new();
    while copies.len() < count {
        assert!(Instant::now() < end, "too few checkpoints: {:?}", session.take_messages());
        let now = std::fs::read(file).unwrap_or_default();
        if !now.is_empty() && copies.last() != Some(&now) {
            copies.push(now);
        }
        std::thread::sleep(Duration::from_millis(3));
    }
    copies
}

#[test]
fn a_kill_at_any_moment_costs_no_bit() {
    for (name, way, streams) in [
        ("core", by(TraversalKind::Compute), false),
        ("native", by(TraversalKind::Auto), false),
        ("streaming", by(TraversalKind::Compute), true),
    ] {
        let folder = Folder::new(&format!("kill-{name}"));
        let file = folder.file("film");
        let session = open(nested, with_file(&way, 1 << 20, &file), streams);
        session.render(view());
        let copies = copies(&file, &session, 4);
        session.stop(true);
        assert!(session.take_messages().is_empty(), "{name}: all is well");
        let mut kept = Vec::new();
        let samples = session.stats().samples_completed + 3;
        let whole = at_once(nested, &way, samples, streams);
        for (at, bytes) in copies.iter().enumerate() {
            let copy = folder.file(&format!("copy{at}"));
            std::fs::write(&copy, bytes).expect("a file");
            let resumed = open(nested, with_file(&way, samples, &copy), streams);
            render(&resumed, &view());
            kept.push(resumed.stats().samples_kept);
            assert!(read_all(&resumed, &view()) == whole.0, "{name}: other bits after {kept:?} samples");
            assert_eq!(told(resumed.stats().error), whole.1, "{name}: the error after {kept:?} samples");
        }
        assert!(kept.is_sorted() && kept[0] > 0 && kept.last() > kept.first(), "{name}: they grow: {kept:?}");
    }
}

#[test]
fn a_render_that_is_stopped_keeps_what_it_has() {
    let folder = Folder::new("stopped");
    let (file, way) = (folder.file("film"), by(TraversalKind::Compute));
    // More than a fast device has done by then.
    let session = open(nested, Settings { checkpoint_secs: 1e9, ..with_file(&way, 1 << 24, &file) }, false);
    session.render(view());
    let end = Instant::now() + TIMEOUT;
    while session.stats().samples_completed < 3 {
        assert!(Instant::now() < end, "no sample was done in time: {:?}", session.take_messages());
        std::thread::sleep(Duration::from_millis(2));
    }
    let appears = |what: &str| {
        let end = Instant::now() + Duration::from_secs(60);
        while !file.exists() {
            assert!(Instant::now() < end, "{what}: {:?}", session.take_messages());
            std::thread::sleep(Duration::from_millis(2));
        }
    };
    appears("the first checkpoint comes soon, whatever the interval");
    std::fs::remove_file(&file).expect("its own");
    assert!(session.make_checkpoint(), "there is a file to write");
    appears("it was asked for");
    assert!(!session.is_converged(), "it goes on meanwhile");
    assert!(session.finish_early(0).is_some(), "it ends");
    assert!(session.wait_converged(TIMEOUT), "in time");
    let done = session.stats().samples_completed;
    let resumed = open(nested, with_file(&way, done + 1, &file), false);
    render(&resumed, &view());
    assert_eq!(resumed.stats().samples_kept, done, "all that was done");
}

/// What is told, and the scene, settings and request of a render that finds the file of another.
type ForeignCase = (&'static str, fn(&mut SceneDb), Settings, RenderRequest);

#[test]
fn another_film_is_left_alone_and_told_by_name() {
    let folder = Folder::new("foreign");
    let (file, way) = (folder.file("film"), by(TraversalKind::Compute));
    render(&open(nested, with_file(&way, 4, &file), false), &view());
    let bytes = std::fs::read(&file).expect("a file");
    let plain = with_file(&way, 4, &file);
    let moved = RenderRequest { camera: perspective(DVec3::Z * 7.0, DVec3::ZERO, 0.7, [45, 31]), ..view() };
    let part = RenderRequest { window: Some(PixelWindow { x: 2, y: 3, width: 20, height: 11 }), ..view() };
    let mut brighter = view();
    brighter.camera.exposure_scale = 2.0;
    let with_sun = |db: &mut SceneDb| {
        nested(db);
        db.upsert_light(sun(1.0, 3.0, DMat4::IDENTITY));
    };
    let cases: [ForeignCase; 7] = [
        ("oocpt:seed: 0 and 7", nested, Settings { seed: 7, ..plain.clone() }, view()),
        ("oocpt:maxBounces: 3 and 2", nested, Settings { max_bounces: 2, ..plain.clone() }, view()),
        ("camera: at ", nested, plain.clone(), moved),
        ("window: 45 x 31 at 0, 0 and 20 x 11 at 2, 3", nested, plain.clone(), part),
        ("exposure: 1 and 2", nested, plain.clone(), brighter),
        ("scene: ", with_sun, plain.clone(), view()),
        ("has 4 samples of each pixel, more than the 3", nested, with_file(&way, 3, &file), view()),
    ];
    for (what, build, settings, request) in cases {
        let session = open(build, settings.clone(), false);
        let messages = render_with_messages(&session, &request);
        let [message] = &*messages else { panic!("{what}: one message: {messages:?}") };
        assert!(message.text.contains(what) && message.text.contains("stays as it is"), "{what}: {message:?}");
        assert!(message.text.contains("film"), "the file is named: {message:?}");
        assert_eq!(session.stats().samples_kept, 0, "{what}");
        assert!(std::fs::read(&file).expect("a file") == bytes, "{what}: the file is as it was");
        let alone = open(build, Settings { checkpoint: String::new(), ..settings }, false);
        render(&alone, &request);
        assert!(read_all(&session, &request) == read_all(&alone, &request), "{what}: the picture is its own");
    }
}

#[test]
fn damaged_files_are_left_alone() {
    let folder = Folder::new("damaged");
    let (file, way) = (folder.file("film"), by(TraversalKind::Compute));
    render(&open(nested, with_file(&way, 2, &file), false), &view());
    let whole = std::fs::read(&file).expect("a file");
    let mut flipped = whole.clone();
    let middle = flipped.len() / 2;
    flipped[middle] ^= 1;
    for bytes in [&whole[..whole.len() - 1], &whole[..whole.len() / 3], &whole[..7], &[][..], &flipped, b"a text"] {
        std::fs::write(&file, bytes).expect("a file");
        let session = open(nested, with_file(&way, 2, &file), false);
        let messages = render_with_messages(&session, &view());
        let [message] = &*messages else { panic!("one message: {messages:?}") };
        assert!(message.text.starts_with("oocpt:checkpoint: "), "{message:?}");
        assert_eq!((session.stats().samples_completed, session.stats().samples_kept), (2, 0), "it is rendered");
        assert!(std::fs::read(&file).expect("a file") == bytes, "the file is as it was");
    }
}

#[test]
fn crafted_files_are_left_alone() {
    let folder = Folder::new("crafted");
    let (file, way) = (folder.file("film"), by(TraversalKind::Compute));
    render(&open(nested, with_file(&way, 2, &file), false), &view());
    let whole = FilmReader::open(&file).expect("a checkpoint");
    let [state, film] = ["state", "film"].map(|name| whole.block(name, 1 << 30).expect("a block"));
    let state = String::from_utf8(state).expect("a text");
    let one_more = |film: &[u8]| {
        let mut film = film.to_vec();
        film[44] += 1; // `FilmPixel::samples` of the first pixel
        film
    };
    let paths = 2 * view().pixels();
    let told =
        |paths: &str| state.replace(&format!("\"paths\":{}", 2 * view().pixels()), &format!("\"paths\":{paths}"));
    let cases = [
        (state.clone(), one_more(&film), "other numbers of samples"),
        (state.clone(), film[80..].to_vec(), "other numbers of samples"),
        (told("7"), film.clone(), "no checkpoint has"),
        (told(&(paths + 1).to_string()), film.clone(), "more than"),
        (state.replace("\"octaves\":[[0", "\"octaves\":[[99"), film.clone(), "no checkpoint has"),
        (state.replace("\"version\":1", "\"version\":9"), film.clone(), "version 9"),
        ("{".to_owned(), film.clone(), "damaged"),
    ];
    for (state, film, what) in cases {
        oocpt_film::write_film(&file, whole.header(), |writer| {
            writer.block("state", state.as_bytes())?;
            writer.block("film", &film)
        })
        .expect("a file");
        let session = open(nested, with_file(&way, 2, &file), false);
        let messages = render_with_messages(&session, &view());
        assert!(matches!(&*messages, [message] if message.text.contains(what)), "{what}: {messages:?}");
        assert_eq!((session.stats().samples_completed, session.stats().samples_kept), (2, 0), "it is rendered");
    }
}

#[test]
fn a_file_that_cannot_be_written_ends_no_render() {
    let folder = Folder::new("unwritable");
    let way = by(TraversalKind::Compute);
    for (file, what) in [(folder.file("no/folder/film"), "No such file"), (folder.0.clone(), "is a folder")] {
        let session = open(nested, with_file(&way, 3, &file), false);
        let messages = render_with_messages(&session, &view());
        let [message] = &*messages else { panic!("one message: {messages:?}") };
        assert!(message.text.contains(what), "{message:?}");
        assert_eq!(session.stats().samples_completed, 3, "the render lives");
    }
}

#[test]
fn renders_without_checkpoints_say_so() {
    let folder = Folder::new("none");
    let (file, way) = (folder.file("film"), by(TraversalKind::Compute));
    let plain = with_file(&way, 32, &file);
    for (what, settings) in [
        ("adaptiveSampling", Settings { adaptive_sampling: true, ..plain.clone() }),
        ("stragglerRoulette", Settings { straggler_roulette: true, ..plain.clone() }),
        ("shows images on the way", Settings { interactive: true, ..plain }),
    ] {
        let session = open(nested, settings, false);
        let messages = render_with_messages(&session, &view());
        assert!(matches!(&*messages, [message] if message.text.contains(what)), "{what}: {messages:?}");
        assert!(!file.exists(), "{what}");
    }
}
