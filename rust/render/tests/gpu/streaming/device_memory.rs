// SPDX-License-Identifier: Apache-2.0
//! All device memory in many sizes: what renders with less renders with more, and gives the same picture.

use super::{BEACH, options, planting, request_of};
use crate::support::{read_all, render, render_with_messages, seeds, settings};
use oocpt_core::settings::Settings;
use oocpt_render::{PlantedFaults, Session};

/// MiB, from what nothing renders with to more than all of the scene and its paths take.
const SIZES: std::ops::RangeInclusive<u32> = 1..=50;
/// Of these, those of a short test: most of them about the smallest in core.
const FEW: [u32; 9] = [1, 4, 7, 9, 10, 11, 12, 14, 24];

#[test]
fn a_scene_that_renders_in_less_memory_renders_in_more() {
    let settings = Settings { chunk_size_kib: 256, ..settings(8, 2) };
    let request = request_of(&BEACH);
    let images = |memory_budget_mib: u32| {
        let session = Session::with_options(Settings { memory_budget_mib, ..settings.clone() }, options());
        session.with_scene(BEACH.build);
        let messages = render_with_messages(&session, &request);
        let stats = session.stats();
        let is_kept = stats.gpu_peak_bytes <= stats.gpu_budget_bytes;
        assert!(is_kept, "{memory_budget_mib} MiB: {} bytes are above the budget", stats.gpu_peak_bytes);
        let images = messages.is_empty().then(|| read_all(&session, &request));
        (images, messages, stats.streaming)
    };
    let (whole, messages, stats) = images(0);
    assert!(whole.is_some() && stats.in_core, "all the memory there is: {messages:?}");
    let (mut streamed, mut in_core, mut least) = (0, 0, None);
    let all = seeds([0, 1]) == 1;
    for size in SIZES.filter(|size| all || FEW.contains(size)) {
        let (got, messages, stats) = images(size);
        assert!(got.is_some() || least.is_none(), "{least:?} MiB are enough, {size} are not: {messages:?}");
        if got.is_none() {
            continue;
        }
        assert!(got == whole, "{size} MiB: the picture differs");
        least = least.or(Some(size));
        *(if stats.in_core { &mut in_core } else { &mut streamed }) += 1;
    }
    println!("from {least:?} MiB: {streamed} streamed, {in_core} in core");
    assert!(streamed > 1 && in_core > 1, "both kinds were there: {streamed}, {in_core}");
}

/// What an earlier scene or a load that ran out has left on the device makes room for paths.
#[test]
fn leftovers_on_the_device_are_evicted_for_paths() {
    let tight = Settings { chunk_size_kib: 256, memory_budget_mib: 10, ..settings(2, 2) };
    let session = Session::with_options(tight, options());
    session.with_scene(BEACH.build);
    let small = request_of(&BEACH);
    render(&session, &small);
    let first = session.stats();
    assert!(first.streaming.in_core, "a small picture leaves room for all: {:?}", first.streaming);
    let large = oocpt_render::RenderRequest { width: 4 * small.width, height: 4 * small.height, ..small.clone() };
    render(&session, &large);
    let second = session.stats();
    let streaming = &second.streaming;
    assert!(!streaming.in_core && streaming.paths_left == 0, "its film takes that room: {streaming:?}");
    assert!(second.gpu_peak_bytes <= second.gpu_budget_bytes, "above the budget: {}", second.gpu_peak_bytes);
}

/// A scene that fits may be rendered while it comes: the same picture, and the next one is in core.
#[test]
fn a_scene_streamed_while_uploading_stays_resident() {
    let settings = Settings { chunk_size_kib: 256, ..settings(8, 2) };
    let request = request_of(&BEACH);
    let images = |streams_first| {
        let options = planting(PlantedFaults { streams_first, ..PlantedFaults::default() });
        let session = Session::with_options(settings.clone(), options);
        session.with_scene(BEACH.build);
        [false, true].map(|again| {
            if again {
                session.restart();
            }
            render(&session, &request);
            let stats = session.stats().streaming;
            assert_eq!(stats.evictions, 0, "there is room for all: {stats:?}");
            (read_all(&session, &request), stats.in_core, stats.loads)
        })
    };
    let [(whole, true, 0), (_, true, 0)] = images(false) else { panic!("in core") };
    let [(first, false, loads), (second, true, 0)] = images(true) else { panic!("streamed first, then in core") };
    assert!(loads > 1, "the chunks came one after the other: {loads} loads");
    assert!(first == whole && second == whole, "the picture differs");
}
