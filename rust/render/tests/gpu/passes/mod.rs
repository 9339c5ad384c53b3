// SPDX-License-Identifier: Apache-2.0
//! The passes by themselves, with chunks and meshes that come and go without any loader: the same bits as with
//! everything resident.

mod exact_sums;
mod handmade_scene;
mod pass_runner;
mod placing;
mod roulette;
mod streamed;

use glam::DVec3;
use handmade_scene::{CHUNKS, FAR, Scene};
use oocpt_abi::{FAULT_ALL, Features, FilmPixel, WavefrontCounters};
use oocpt_gpu::{Gpu, OpenOptions};
use pass_runner::{Images, PATHS, Tracer};
use std::sync::Arc;
use streamed::Totals;

const IN_CORE: Features = Features::DOME
    .union(Features::DISTANT)
    .union(Features::OPACITY)
    .union(Features::INSTANCING)
    .union(Features::DOME_SHADOW_RAYS);
const STREAMING: Features = IN_CORE.union(Features::STREAMING).union(Features::CHUNK_COUNTS);

fn open() -> Arc<Gpu> {
    let selector = std::env::var("OOCPT_TEST_DEVICE").ok();
    Gpu::open(&OpenOptions { selector, validation: true, ..OpenOptions::default() }).expect("a device")
}

fn close_device(gpu: &Gpu) {
    let messages = gpu.take_validation_messages();
    assert!(messages.is_empty(), "Vulkan validation: {messages:?}");
}

fn in_core(gpu: &Arc<Gpu>, scene: &Scene) -> (Images, WavefrontCounters) {
    let mut tracer = Tracer::new(gpu, scene, IN_CORE);
    let images = tracer.wave();
    let ids: &[i32] = bytemuck::cast_slice(&images.ids);
    let hits = ids.iter().filter(|id| **id >= 0).count();
    assert!(hits > 200 && hits < 600, "the scene is seen, and so is the background: {hits} of 640 pixels");
    (images, tracer.read("counters")[0])
}

fn check(totals: &Totals, wave: &WavefrontCounters) {
    let rays = |counters: &WavefrontCounters| (counters.closest_rays, counters.shadow_rays);
    assert_eq!(rays(&totals.counters), rays(wave), "a ray that waits counts once");
    assert!(totals.counters.chunk_misses > 0, "rays had to wait: {totals:?}");
    assert_eq!(totals.counters.stack_overflows, 0, "the stack suffices");
    let visits: u64 = totals.unit_rays.iter().take(CHUNKS as usize).map(|rays| u64::from(*rays)).sum();
    assert!(visits >= totals.counters.chunk_visits, "visits of the samples are among those of chunks: {totals:?}");
}

#[test]
fn loading_and_evicting_units_changes_no_bit() {
    let gpu = open();
    let scene = Scene::new(&gpu, 1, FAR);
    let (expected, wave) = in_core(&gpu, &scene);
    for (resident, rounds) in [(1, 1), (5, 3), (36, 2)] {
        let (images, totals) = Tracer::new(&gpu, &scene, STREAMING).stream(resident, rounds, 3);
        check(&totals, &wave);
        assert!(images.ids == expected.ids, "ids with {resident} chunks at a time");
        assert!(images.depth == expected.depth, "depth with {resident} chunks at a time");
        assert!(images.film == expected.film, "colour with {resident} chunks at a time");
    }
    close_device(&gpu);
}

#[test]
fn a_picture_that_is_given_up_traces_no_more_rays() {
    let gpu = open();
    let scene = Scene::new(&gpu, 1, FAR);
    let (expected, _) = in_core(&gpu, &scene);
    assert!(Tracer::new(&gpu, &scene, IN_CORE).cancelled_by(0).wave() == expected, "it goes on until then");
    let mut tracer = Tracer::new(&gpu, &scene, IN_CORE).cancelled_by(1);
    tracer.wave();
    let counters: WavefrontCounters = tracer.read("counters")[0];
    assert_eq!((counters.closest_rays, counters.shadow_rays), (0, 0), "no ray");
    assert_eq!((counters.trace_args.x, counters.shadow_args.x), (0, 0), "no walk");
    assert_eq!((counters.surface_args.x, counters.escaped_args.x), (0, 0), "nothing to shade");
    close_device(&gpu);
}

#[test]
fn persistent_threads_change_no_bit() {
    let gpu = open();
    let scene = Scene::new(&gpu, 1, FAR);
    let (expected, wave) = in_core(&gpu, &scene);
    for walkers in [1, 128, 1000] {
        let mut tracer = Tracer::new(&gpu, &scene, IN_CORE).with_walkers(walkers);
        assert!(tracer.wave() == expected, "{walkers} threads for {PATHS} rays, in core");
        let counters: WavefrontCounters = tracer.read("counters")[0];
        assert_eq!(
            counters.trace_args.x,
            walkers.min(counters.ray_args.x * 64).div_ceil(64),
            "{walkers} threads at most"
        );
    }
    let (images, totals) = Tracer::new(&gpu, &scene, STREAMING).with_walkers(128).stream(36, 2, 3);
    check(&totals, &wave);
    assert!(images == expected, "128 threads, streaming");
    close_device(&gpu);
}

#[test]
fn overflowing_demand_lists_change_no_bit() {
    let gpu = open();
    let scene = Scene::new(&gpu, 1, FAR);
    let (expected, wave) = in_core(&gpu, &scene);
    for capacities in [[3, 37], [37, 2], [2, 2]] {
        let mut tracer = Tracer::new(&gpu, &scene, STREAMING).with_demand_capacities(capacities);
        let (images, totals) = tracer.stream(5, 3, 3);
        check(&totals, &wave);
        assert!(images == expected, "room for {capacities:?} units");
    }
    close_device(&gpu);
}

#[test]
fn a_skipped_chunk_is_noticed() {
    let gpu = open();
    let scene = Scene::new(&gpu, 1, FAR);
    let (expected, _) = in_core(&gpu, &scene);
    let mut tracer = Tracer::new(&gpu, &scene, STREAMING);
    tracer.fault = FAULT_ALL;
    let (images, totals) = tracer.stream(5, 3, 3);
    assert_eq!(totals.counters.chunk_misses, 0, "nobody waits");
    assert!(images.film != expected.film, "a picture without the absent chunks is another one");
    close_device(&gpu);
}

#[test]
fn a_scene_far_from_the_origin_looks_the_same() {
    let gpu = open();
    let [here, there] = [DVec3::ZERO, FAR].map(|at| in_core(&gpu, &Scene::new(&gpu, 1, at)).0);
    let differ = |a: &[u8], b: &[u8]| a.chunks_exact(4).zip(b.chunks_exact(4)).filter(|(a, b)| a != b).count();
    let ids = differ(&here.ids, &there.ids);
    assert!(ids <= 2, "{ids} pixels see something else");
    let [here, there] = [&here, &there].map(|images| bytemuck::pod_collect_to_vec::<u8, FilmPixel>(&images.film));
    let close = |(a, b): &(&FilmPixel, &FilmPixel)| (a.sum[1] - b.sum[1]).abs() <= 1e-3 * a.sum[1];
    let alike = here.iter().zip(&there).filter(close).count();
    assert!(alike >= 600, "only {alike} of 640 pixels have the same colour");
    close_device(&gpu);
}
