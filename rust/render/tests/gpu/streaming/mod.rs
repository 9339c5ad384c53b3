// SPDX-License-Identifier: Apache-2.0
//! The central promise: the same bits whatever the budget, under every policy; the budget is never exceeded.

mod device_memory;
mod host_mapped;
mod host_memory;
mod moving_scenes;
mod planted_faults;
mod roulette;
mod scenes;

use crate::lights::TestFiles;
use crate::support::{self, perspective, read_all, render_with_messages, request, settings};
pub(crate) use host_mapped::MAX_PICTURES;
pub(crate) use moving_scenes::{DEFORMING, MOVING, MOVING_BULBS, MOVING_LAMPS};
use oocpt_core::residency::PolicyKind;
use oocpt_core::settings::{HostMapped, Settings};
use oocpt_core::stats::StreamingStats;
use oocpt_render::{PlantedFaults, RenderRequest, Session, SessionOptions};
use scenes::{BEACH, SET};
pub(crate) use scenes::{SCENES, Scene};
use std::sync::Arc;

const POLICIES: [PolicyKind; 3] = [PolicyKind::Sweep, PolicyKind::Priority, PolicyKind::Benefit];

/// The results of one render.
struct Render {
    images: Vec<Vec<u8>>,
    stats: StreamingStats,
}

fn options() -> SessionOptions {
    SessionOptions { validation: true, ..SessionOptions::default() }
}

fn planting(faults: PlantedFaults) -> SessionOptions {
    SessionOptions { faults, ..options() }
}

/// Small chunks, so that a small scene has many.
fn small_chunks() -> Settings {
    support::filtering(Settings { chunk_size_kib: 16, ..settings(4, 3) })
}

fn request_of(scene: &Scene) -> RenderRequest {
    request(perspective(scene.eye, scene.target, 0.8, [48, 32]))
}

fn render(scene: &Scene, settings: Settings, options: SessionOptions) -> Render {
    let session = Session::with_options(settings, options);
    session.set_light_files(Arc::new(TestFiles));
    session.with_scene(scene.build);
    let request = request_of(scene);
    support::render(&session, &request);
    Render { images: read_all(&session, &request), stats: session.stats().streaming }
}

/// The smallest geometry budget, KiB, that the renderer says it can work with.
pub(crate) fn smallest_budget(scene: &Scene) -> u32 {
    let session = Session::with_options(Settings { geometry_budget_kib: 1, ..small_chunks() }, options());
    session.set_light_files(Arc::new(TestFiles));
    session.with_scene(scene.build);
    let messages = render_with_messages(&session, &request_of(scene));
    let text = &messages.first().expect("a budget of one KiB is an error").text;
    let needed = text.split("needs ").nth(1).and_then(|rest| rest.split(" KiB").next());
    needed.and_then(|kib| kib.parse().ok()).expect("the message says what is needed")
}

fn percent(bytes: u64, percent: u64) -> u32 {
    u32::try_from((bytes * percent / 100) >> 10).expect("small")
}

/// Renders `scene` at every budget under every policy and compares with everything resident.
pub(crate) fn same_bits(scene: &Scene) {
    let without = POLICIES.map(|policy| (policy, HostMapped::Off));
    same_bits_under(scene, without.into_iter().chain([(PolicyKind::Benefit, HostMapped::On)]));
}

/// Compares under these policies, with geometry that rays read in host memory or without.
fn same_bits_under(scene: &Scene, policies: impl IntoIterator<Item = (PolicyKind, HostMapped)>) {
    let whole = render(scene, small_chunks(), options());
    assert!(whole.stats.in_core, "{}: the scene fits", scene.name);
    assert!(whole.stats.chunks >= 8, "{}: {} chunks are too few to test anything", scene.name, whole.stats.chunks);
    let smallest = smallest_budget(scene);
    let parts = [100, 50, 25, 10].map(|part| percent(whole.stats.scene_bytes, part).max(smallest));
    for (policy, host_mapped) in policies {
        let mut budgets = parts.to_vec();
        budgets.push(smallest);
        budgets.dedup();
        for budget in budgets {
            let settings = Settings { geometry_budget_kib: budget, policy, host_mapped, ..small_chunks() };
            let forced = SessionOptions { force_streaming: true, ..options() };
            let part = render(scene, settings, forced);
            let of = whole.stats.scene_bytes >> 10;
            let what = format!("{}, {policy}, host-mapped {}, {budget} KiB of {of}", scene.name, host_mapped.name());
            assert!(part.images == whole.images, "{what}: the picture differs");
            let stats = &part.stats;
            assert!(!stats.in_core && stats.loads > 0, "{what}: chunks were loaded: {stats:?}");
            assert_eq!(stats.recompilations, 0, "{what}: the stack was foreseen");
            assert!(stats.geometry_peak_bytes <= u64::from(budget) << 10, "{what}: above the budget: {stats:?}");
            if budget == smallest && smallest < parts[1] && host_mapped == HostMapped::Off {
                assert!(stats.evictions > 0, "{what}: chunks had to go: {stats:?}");
            }
        }
    }
}

#[test]
fn flat_scene_same_bits_at_every_budget() {
    same_bits(&SCENES[0]);
}

#[test]
fn lights_and_dome_same_bits_at_every_budget() {
    same_bits(&SCENES[6]);
}

#[test]
fn mesh_lights_same_bits_at_every_budget() {
    same_bits(&SCENES[8]);
}

#[test]
fn curves_and_points_are_the_same_at_every_budget() {
    same_bits(&SCENES[9]);
}

#[test]
fn instance_colours_same_bits_at_every_budget() {
    same_bits(&SCENES[7]);
}

#[test]
fn nested_instances_same_bits_at_every_budget() {
    same_bits(&SCENES[1]);
}

#[test]
fn overlapping_chunks_same_bits_at_every_budget() {
    same_bits(&SCENES[2]);
}

#[test]
fn one_huge_mesh_same_bits_at_every_budget() {
    same_bits(&SCENES[3]);
}

/// Every chunk places every mesh: what a ray needs at once is a chunk's records and one mesh all the same.
#[test]
fn chunks_that_all_place_the_same_meshes_same_bits_at_every_budget() {
    let whole = render(&SET, small_chunks(), options());
    let smallest = u64::from(smallest_budget(&SET)) << 10;
    assert!(8 * smallest < whole.stats.scene_bytes, "{smallest} bytes of {:?}", whole.stats);
    // The other policies wait long for two units that a ray needs at once.
    same_bits_under(&SET, [HostMapped::Off, HostMapped::On].map(|mapped| (PolicyKind::Benefit, mapped)));
}

#[test]
fn camera_inside_chunks_same_bits_at_every_budget() {
    same_bits(&SCENES[4]);
}

#[test]
fn thin_shadow_casters_same_bits_at_every_budget() {
    same_bits(&SCENES[5]);
}

/// Assets that are encoded anew, or copied from the host's store: the bits are the same.
#[test]
fn kept_encodings_change_no_bit() {
    let whole = render(&BEACH, Settings { chunk_size_kib: 256, ..settings(2, 2) }, options());
    for host_memory_budget_mib in [8, 16, 1 << 20] {
        let few = Settings { chunk_size_kib: 256, memory_budget_mib: 5, host_memory_budget_mib, ..settings(2, 2) };
        let streamed = render(&BEACH, few, options());
        assert!(streamed.stats.reloads > 0, "something came again: {:?}", streamed.stats);
        assert!(streamed.images == whole.images, "{host_memory_budget_mib} MiB on the host: the picture differs");
    }
}

#[test]
fn the_budget_of_all_memory_holds_and_the_picture_is_the_same() {
    let settings = Settings { chunk_size_kib: 256, ..settings(2, 2) };
    let whole = render(&BEACH, settings.clone(), options());
    assert!(whole.stats.in_core && whole.stats.scene_bytes > 6 << 20, "a scene of some size: {:?}", whole.stats);
    let budget = 5_u32;
    let session = Session::with_options(Settings { memory_budget_mib: budget, ..settings }, options());
    session.with_scene(BEACH.build);
    let request = request_of(&BEACH);
    support::render(&session, &request);
    let stats = session.stats();
    assert!(read_all(&session, &request) == whole.images, "the picture differs");
    assert!(!stats.streaming.in_core && stats.streaming.evictions > 0, "chunks came and went: {stats:?}");
    assert_eq!(stats.gpu_budget_bytes, u64::from(budget) << 20, "the budget asked for");
    assert!(stats.gpu_peak_bytes <= stats.gpu_budget_bytes, "above the budget: {stats:?}");
}

/// Many more paths than are in flight at a time on any device the tests run on, or nearly so on a large one.
#[test]
fn ended_paths_free_their_slots() {
    let scene = &SCENES[5];
    let many = Settings { samples_per_pixel: 40, ..small_chunks() };
    let whole = render(scene, many.clone(), options());
    let budget = percent(whole.stats.scene_bytes, 25).max(smallest_budget(scene));
    let part = render(scene, Settings { geometry_budget_kib: budget, ..many }, options());
    assert!(part.images == whole.images, "the picture differs");
    assert!(!part.stats.in_core && part.stats.paths_left == 0, "all paths came back: {:?}", part.stats);
}
