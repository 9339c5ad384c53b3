// SPDX-License-Identifier: Apache-2.0
//! Geometry that rays read in host memory: no ray waits for it any more, the picture is the same, and unedited assets
//! stay there after an edit.

use super::{Render, SCENES, options, percent, planting, request_of, small_chunks, smallest_budget};
use crate::support::{self, read_all, settings};
use oocpt_core::settings::{HostMapped, Settings};
use oocpt_gpu::DeviceKind;
use oocpt_render::{PlantedFaults, Session};

/// Most pictures until all that rays ask for is in host memory: a GPU has rendered many before its pages are made.
pub(crate) const MAX_PICTURES: u32 = 400;

/// Renders again until no ray waits; the last picture.
fn until_nobody_waits(session: &Session, at: usize) -> Render {
    let request = request_of(&SCENES[at]);
    let mut picture = 1;
    loop {
        support::render(session, &request);
        let stats = session.stats().streaming;
        assert!(!stats.in_core, "it streams");
        if stats.hit_rate >= 1.0 {
            return Render { images: read_all(session, &request), stats };
        }
        assert!(picture < MAX_PICTURES, "rays still wait: {stats:?}");
        session.restart();
        picture += 1;
    }
}

fn session_at(at: usize, geometry_budget_kib: u32, host_mapped: HostMapped) -> Session {
    let session = Session::with_options(Settings { geometry_budget_kib, host_mapped, ..small_chunks() }, options());
    session.with_scene(SCENES[at].build);
    session
}

#[test]
fn no_ray_waits_for_host_mapped_geometry() {
    for at in [0, 1, 3] {
        let smallest = smallest_budget(&SCENES[at]);
        let whole = super::render(&SCENES[at], small_chunks(), options());
        let budget = percent(whole.stats.scene_bytes, 25).max(smallest);
        let session = session_at(at, budget, HostMapped::On);
        let last = until_nobody_waits(&session, at);
        assert!(last.images == whole.images, "{}: the picture differs", SCENES[at].name);
        assert!(last.stats.geometry_peak_bytes <= u64::from(budget) << 10, "above the budget: {:?}", last.stats);
        let without = session_at(at, budget, HostMapped::Off);
        support::render(&without, &request_of(&SCENES[at]));
        without.restart();
        support::render(&without, &request_of(&SCENES[at]));
        let waited = without.stats().streaming;
        assert!(waited.hit_rate < 1.0, "{}: without it they wait: {waited:?}", SCENES[at].name);
    }
}

/// The budget of host memory limits it: with hardly any, chunks are streamed as usual.
#[test]
fn geometry_beyond_host_memory_is_streamed() {
    let whole = super::render(&SCENES[0], small_chunks(), options());
    let budget = percent(whole.stats.scene_bytes, 25).max(smallest_budget(&SCENES[0]));
    let settings = Settings {
        geometry_budget_kib: budget,
        host_mapped: HostMapped::On,
        host_memory_budget_mib: 8,
        ..small_chunks()
    };
    let session = Session::with_options(settings, options());
    session.with_scene(SCENES[0].build);
    let request = request_of(&SCENES[0]);
    for _ in 0..3 {
        support::render(&session, &request);
        assert!(read_all(&session, &request) == whole.images, "the picture differs");
        session.restart();
    }
}

/// More memory than the scene takes, less, and more again.
#[test]
fn a_scene_that_fits_releases_host_mapped_geometry() {
    let settings = Settings { host_mapped: HostMapped::On, chunk_size_kib: 256, ..settings(4, 2) };
    let session = Session::with_options(settings, options());
    session.with_scene(super::BEACH.build);
    let request = request_of(&super::BEACH);
    let mut images = Vec::new();
    for budget_kib in [0, 2048, 0, 1024] {
        session
            .set_setting("oocpt:geometryBudget", oocpt_core::settings::SettingValue::Int(budget_kib))
            .expect("a setting");
        for _ in 0..2 {
            support::render(&session, &request);
            images.push(read_all(&session, &request));
            session.restart();
        }
    }
    assert!(images.iter().all(|picture| *picture == images[0]), "the picture differs");
}

/// A picture that streams goes on without when all of the scene is there, and the next ones do without from the start:
/// the same bits and as many rays. How many pictures it takes until all is there depends on the device's speed.
#[test]
fn a_fully_resident_scene_leaves_streaming() {
    let (mut switched, mut on_processor) = (0, false);
    for at in [0, 1, 3] {
        let scene = &SCENES[at];
        let long = Settings { samples_per_pixel: 96, ..small_chunks() };
        let picture = |session: &Session| {
            let request = request_of(scene);
            support::render(session, &request);
            let picture = (read_all(session, &request), session.stats());
            session.restart();
            picture
        };
        let whole = Session::with_options(long.clone(), options());
        whole.with_scene(scene.build);
        let (images, in_core) = picture(&whole);
        let budget = percent(in_core.streaming.scene_bytes, 25).max(smallest_budget(scene));
        let settings = Settings { geometry_budget_kib: budget, host_mapped: HostMapped::On, ..long };
        let session =
            Session::with_options(settings, planting(PlantedFaults { leaves_soon: true, ..PlantedFaults::default() }));
        session.with_scene(scene.build);
        on_processor |= session.device_report().is_some_and(|device| device.kind == DeviceKind::Cpu);
        let mut without = 0;
        for number in 0..MAX_PICTURES {
            let (seen, stats) = picture(&session);
            let (name, streaming) = (scene.name, &stats.streaming);
            assert!(seen == images, "{name}, {number}: the picture differs");
            assert_eq!(stats.rays_traced, in_core.rays_traced, "{name}, {number}");
            assert!(!streaming.in_core && streaming.geometry_bytes <= u64::from(budget) << 10, "{streaming:?}");
            assert!(without == 0 || streaming.is_split, "{name}, {number}: streams again: {streaming:?}");
            without += u32::from(streaming.is_split);
            switched += u32::from(streaming.is_split && streaming.loads > 0);
            // Traversal may be native.
            assert!(!streaming.is_split || streaming.compiled_ahead >= 5, "{name}, {number}: {streaming:?}");
            if without == 2 {
                assert!(streaming.mapped_bytes > 0, "{name}: {streaming:?}");
                break;
            }
        }
        assert_eq!(without, 2, "{}: it streams to the end", scene.name);
    }
    // A GPU is done with so small a picture before all of the scene is there.
    assert!(switched > 0 || !on_processor, "no picture changed while it was rendered");
}
