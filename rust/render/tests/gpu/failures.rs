// SPDX-License-Identifier: Apache-2.0
//! Fails well: one clear message, a converged session, and the next render works.

use crate::materials::{Ramps, board, coordinates, textured, with};
use crate::scenes::{dome, nested, prim, sphere};
use crate::support::{perspective, read, read_all, render, render_with_messages, request, session, settings};
use glam::{DMat4, DVec3};
use oocpt_core::mesh::{LOST_FOR_GOOD, MeshFiles, PayloadError, PayloadSource, StoredEntry};
use oocpt_core::scene::{AssetRef, Interpolation};
use oocpt_core::settings::{SettingValue, Settings};
use oocpt_render::textures::{ImageError, ImageInfo, ImageLibrary, SourceImage};
use oocpt_render::{AovKind, PlantedFaults, RenderRequest, Session, SessionOptions, Severity};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

fn view(size: [u32; 2]) -> RenderRequest {
    request(perspective(DVec3::new(3.0, 4.0, 6.0), DVec3::ZERO, 0.7, size))
}

#[test]
fn a_budget_too_small_is_one_error_and_a_larger_one_renders() {
    let session = session(Settings { memory_budget_mib: 4, ..settings(1, 0) });
    session.with_scene(|db| {
        db.upsert_mesh(sphere(prim("/ball", DMat4::IDENTITY), 1, 150, 0.5));
        db.upsert_light(dome([1.0; 3]));
    });
    let messages = render_with_messages(&session, &view([32, 32]));
    assert_eq!(messages.len(), 1, "one error: {messages:?}");
    assert_eq!(messages[0].severity, Severity::Error, "it is an error");
    assert!(messages[0].text.contains("budget"), "it names the budget: {}", messages[0].text);
    let changed = session.set_setting("oocpt:memoryBudget", SettingValue::Int(2048)).expect("a valid budget");
    assert!(changed, "the budget is another one");
    render(&session, &view([32, 32]));
    let stats = session.stats();
    assert!(stats.gpu_bytes <= stats.gpu_budget_bytes, "the budget is kept: {stats:?}");
}

#[test]
fn an_unknown_device_is_one_error() {
    let session = session(Settings { device: "no such device".into(), ..settings(1, 0) });
    let messages = render_with_messages(&session, &view([8, 8]));
    assert_eq!(messages.len(), 1, "one error: {messages:?}");
    assert!(messages[0].text.contains("no such device"), "it repeats the name: {}", messages[0].text);
}

#[test]
fn absurd_image_sizes_are_refused() {
    let session = session(settings(1, 0));
    for (width, height) in [(0, 8), (8, 0), (u32::MAX, 1), (1 << 16, 1 << 16)] {
        let messages = render_with_messages(&session, &RenderRequest { width, height, ..view([8, 8]) });
        assert_eq!(messages.len(), 1, "{width} x {height}: {messages:?}");
        assert!(messages[0].text.contains("pixels"), "{}", messages[0].text);
    }
    render(&session, &view([8, 8]));
}

#[test]
fn a_camera_without_inverse_is_one_error() {
    let session = session(settings(1, 0));
    let mut request = view([8, 8]);
    request.camera.world_from_view = DMat4::ZERO;
    let messages = render_with_messages(&session, &request);
    assert_eq!(messages.len(), 1, "one error: {messages:?}");
    assert!(messages[0].text.contains("camera"), "{}", messages[0].text);
    session.with_scene(nested);
    render(&session, &view([8, 8]));
    assert!(!read_all(&session, &view([8, 8])).is_empty(), "the next render works");
}

#[test]
fn bad_geometry_is_dropped_with_one_warning_and_the_rest_renders() {
    let session = session(settings(1, 1));
    session.with_scene(|db| {
        nested(db);
        let mut bad = sphere(prim("/bad", DMat4::IDENTITY), 9, 6, 0.5);
        bad.points = oocpt_core::TypedArray::of(vec![[f32::NAN; 3]; bad.points.len()]);
        db.upsert_mesh(bad);
    });
    let messages = render_with_messages(&session, &view([24, 16]));
    assert_eq!(messages.len(), 1, "one warning: {messages:?}");
    assert_eq!(messages[0].severity, Severity::Warning, "dropping is a warning");
    assert!(messages[0].text.contains("/bad"), "with the prim path: {}", messages[0].text);
    session.restart();
    assert!(render_with_messages(&session, &view([24, 16])).is_empty(), "each problem is reported once");
}

/// A session of which so many devices are lost, each after so many submissions.
fn losing(devices: u32, after: u32, streams: bool, budget: u32) -> Session {
    let faults = PlantedFaults { lost_devices: [devices, after], ..PlantedFaults::default() };
    let options = SessionOptions { validation: true, force_streaming: streams, faults, ..SessionOptions::default() };
    let session = Session::with_options(Settings { memory_budget_mib: budget, ..settings(4, 2) }, options);
    session.with_scene(nested);
    session
}

#[test]
fn a_render_is_retried_once_after_device_loss() {
    let view = view([24, 16]);
    for streams in [false, true] {
        let whole = losing(0, 0, streams, 700);
        render(&whole, &view);
        let whole = read_all(&whole, &view);
        // In the middle of an upload, and of samples.
        for after in [1, 9] {
            let session = losing(1, after, streams, 701);
            let messages = render_with_messages(&session, &view);
            assert_eq!(messages.len(), 1, "after {after}, streaming {streams}: {messages:?}");
            assert_eq!(messages[0].severity, Severity::Warning, "{messages:?}");
            assert!(messages[0].text.contains("lost") && messages[0].text.contains("again"), "{messages:?}");
            assert!(read_all(&session, &view) == whole, "after {after}, streaming {streams}: another picture");
            session.restart();
            assert!(render_with_messages(&session, &view).is_empty(), "the next one is as any");
        }
    }
}

#[test]
fn a_second_device_loss_ends_the_render() {
    let view = view([24, 16]);
    let session = losing(2, 5, false, 702);
    let messages = render_with_messages(&session, &view);
    let severities: Vec<Severity> = messages.iter().map(|message| message.severity).collect();
    assert_eq!(severities, [Severity::Warning, Severity::Error], "{messages:?}");
    assert!(messages[1].text.contains("lost"), "{messages:?}");
    session.restart();
    assert!(render_with_messages(&session, &view).is_empty(), "and the next picture has a device again");
}

/// Takes meshes and gives none back.
#[derive(Debug)]
struct Abyss(u64);

impl PayloadSource for Abyss {
    fn size(&self) -> u64 {
        self.0
    }

    fn read(&self, _parts: &mut [&mut [u8]]) -> Result<(), PayloadError> {
        Err(PayloadError::Read(LOST_FOR_GOOD.into()))
    }
}

impl MeshFiles for Abyss {
    fn lasts(&self) -> bool {
        false
    }

    fn find(&self, _key: u128) -> Option<StoredEntry> {
        None
    }

    fn add(&self, _key: Option<u128>, _head: &[u8], payloads: &[Vec<&[u8]>]) -> Option<Vec<Arc<dyn PayloadSource>>> {
        let size = |parts: &Vec<&[u8]>| parts.iter().map(|part| part.len() as u64).sum();
        Some(payloads.iter().map(|parts| Arc::new(Self(size(parts))) as Arc<dyn PayloadSource>).collect())
    }

    fn damaged(&self, _key: Option<u128>, _error: &PayloadError) {}

    fn wait(&self, _pause: Duration) {}
}

#[test]
fn a_mesh_that_cannot_be_loaded_is_omitted_with_a_warning() {
    let view = view([24, 16]);
    for streams in [false, true] {
        // Three eighths of two megabytes are for meshes: the ball has more.
        let settings = Settings { host_memory_budget_mib: 16, geometry_cache: "0".into(), ..settings(4, 1) };
        let options = SessionOptions { validation: true, force_streaming: streams, ..SessionOptions::default() };
        let session = Session::with_options(settings, options);
        session.with_scene(|db| {
            db.set_mesh_files(Some(Arc::new(Abyss(0))));
            db.upsert_mesh(sphere(prim("/lost", DMat4::IDENTITY), 1, 80, 0.5));
            db.upsert_light(dome([0.25, 0.5, 1.0]));
        });
        for picture in 0..2 {
            // The first picture also says that building the ball took more than there was for it.
            let messages = render_with_messages(&session, &view);
            assert!(messages.iter().all(|message| message.severity == Severity::Warning), "{messages:?}");
            let told = messages.iter().filter(|message| message.text.contains("left out"));
            let told: Vec<&str> = told.map(|message| &message.text[..]).collect();
            assert!(told.len() == 1 && told[0].contains("/lost"), "streaming {streams}: {messages:?}");
            let colors = read::<[f32; 4]>(&session, &view, AovKind::Color);
            assert!(colors.iter().all(|color| color[..3] == [0.25, 0.5, 1.0]), "the sky alone: {:?}", colors[200]);
            let of_budget = messages.iter().filter(|message| message.text.contains("oocpt:hostMemoryBudget"));
            assert_eq!(of_budget.count(), if picture == 0 { 1 } else { 0 }, "streaming {streams}: {messages:?}");
            session.restart();
        }
    }
}

/// [`Ramps`] on a disk that is busy: reads fail so many times, then take long.
#[derive(Debug)]
struct Far {
    fails: Arc<AtomicU32>,
    takes: Duration,
}

impl ImageLibrary for Far {
    fn open(&self, _: &AssetRef) -> Result<Arc<dyn SourceImage>, ImageError> {
        Ok(Arc::new(Self { fails: Arc::clone(&self.fails), takes: self.takes }))
    }
}

impl SourceImage for Far {
    fn info(&self) -> ImageInfo {
        Ramps.info()
    }

    fn read(&self, level: u32, at: [u32; 2], size: [u32; 2], out: &mut [u8]) -> Result<(), ImageError> {
        if self.fails.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |fails| fails.checked_sub(1)).is_ok() {
            return Err(ImageError("the disk is busy".into()));
        }
        std::thread::sleep(self.takes);
        Ramps.read(level, at, size, out)
    }
}

#[test]
fn textures_on_a_slow_disk_are_waited_for() {
    let view = view([24, 16]);
    let pictured = |images: Arc<dyn ImageLibrary>, faults: PlantedFaults, streams: bool| {
        let options =
            SessionOptions { validation: true, force_streaming: streams, faults, ..SessionOptions::default() };
        let settings = Settings { texture_cache: "0".into(), ..settings(4, 1) };
        let session = Session::with_options(settings, options).with_images(images);
        session.with_scene(|db| {
            db.upsert_material(textured("/material", "diffuseColor", "rgb", &[]));
            let board = with(board("/board", 1, "/material"), "st", Interpolation::Vertex, coordinates(|st| st));
            db.upsert_mesh(board);
            db.upsert_light(dome([1.0; 3]));
        });
        let messages = render_with_messages(&session, &view);
        (messages, read::<f32>(&session, &view, AovKind::Color))
    };
    for streams in [false, true] {
        let (messages, right) = pictured(Arc::new(Ramps), PlantedFaults::default(), streams);
        assert!(messages.is_empty(), "{messages:?}");
        let far = Far { fails: Arc::new(AtomicU32::new(3)), takes: Duration::from_millis(1500) };
        let faults = PlantedFaults { impatient_millis: 600, ..PlantedFaults::default() };
        let (messages, picture) = pictured(Arc::new(far), faults, streams);
        assert!(!messages.is_empty(), "streaming {streams}: it is told");
        for message in &messages {
            assert_eq!(message.severity, Severity::Warning, "streaming {streams}: {messages:?}");
            assert!(message.text.contains("still waiting for 1 "), "streaming {streams}: {messages:?}");
        }
        assert!(picture == right, "streaming {streams}: another picture");
        let lost = Far { fails: Arc::new(AtomicU32::new(u32::MAX)), takes: Duration::ZERO };
        let (messages, picture) = pictured(Arc::new(lost), PlantedFaults::default(), streams);
        assert_eq!(messages.len(), 1, "streaming {streams}: {messages:?}");
        assert!(messages[0].text.contains("ramps") && messages[0].text.contains("fallback"), "{messages:?}");
        assert!(picture != right, "streaming {streams}: the fallback");
    }
}
