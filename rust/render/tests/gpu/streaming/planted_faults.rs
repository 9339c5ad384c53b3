// SPDX-License-Identifier: Apache-2.0
//! Planted faults show, and failures of allocations do not: lost chunks, calls that fail, bytes that nobody counted.

use super::MAX_PICTURES;
use super::scenes::{BEACH, SCENES, Scene};
use super::{Render, TestFiles, options, percent, planting, render, request_of, small_chunks, smallest_budget};
use crate::support::{self, read_all, render_with_messages};
use oocpt_abi::FAULT_ONE_IN;
use oocpt_core::settings::{HostMapped, Settings};
use oocpt_gpu::{DriverCall, PlantedFailure};
use oocpt_render::{Message, PlantedFaults, Session, SessionOptions, Severity};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

/// Settings with a quarter of the geometry's budget.
fn quarter(scene: &Scene, whole: &Render) -> Settings {
    let budget = percent(whole.stats.scene_bytes, 25).max(smallest_budget(scene));
    Settings { geometry_budget_kib: budget, ..small_chunks() }
}

/// Returns true if the picture shows that chunk instances are lost (`SPEC_FAULT`).
fn shows(scene: &Scene, whole: &Render, lost_chunks: u32) -> bool {
    let planted = planting(PlantedFaults { lost_chunks, ..PlantedFaults::default() });
    let part = render(scene, quarter(scene, whole), SessionOptions { force_streaming: true, ..planted });
    part.images != whole.images
}

/// The same in all scenes: passes are compiled for it.
const LOST: u32 = 9;

/// One chunk in a hundred is lost, and one in all of a smaller scene.
#[test]
fn one_lost_chunk_in_a_hundred_is_noticed() {
    for scene in &SCENES {
        let whole = render(scene, small_chunks(), options());
        let instances = u32::try_from(whole.stats.chunk_instances).expect("few");
        assert!(LOST < instances && LOST < FAULT_ONE_IN, "{}: {instances} chunk instances", scene.name);
        let shows = shows(scene, &whole, LOST + 1);
        assert!(shows, "{}: the comparison must see that {LOST} of {instances} is lost", scene.name);
    }
}

/// The outcome of a render in which calls failed, and of the next one of that session.
struct Failed {
    what: String,
    struck: u64,
    /// True if the picture is the same; otherwise the messages.
    outcome: Result<bool, Vec<Message>>,
    /// True if the next one has the same picture, if there was need of one.
    next: bool,
}

/// Returns true for calls that need a new device: what a device has compiled or pooled it does not request again.
fn needs_device(call: DriverCall) -> bool {
    matches!(call, DriverCall::Pipeline | DriverCall::CommandPool)
}

/// Renders with a failure planted, and after an error once more without.
fn failed(scene: &Scene, settings: Settings, streams: bool, failure: PlantedFailure, whole: &Render) -> Failed {
    static DEVICES: AtomicU32 = AtomicU32::new(0);
    let planted = planting(PlantedFaults { failure: Some(failure), ..PlantedFaults::default() });
    let memory_budget_mib =
        if needs_device(failure.call) { 1000 + DEVICES.fetch_add(1, Ordering::Relaxed) } else { 999 };
    let settings = Settings { memory_budget_mib, ..settings };
    let what = format!("{failure:?}, streaming {streams}");
    let session = Session::with_options(settings, SessionOptions { force_streaming: streams, ..planted });
    session.set_light_files(Arc::new(TestFiles));
    session.with_scene(scene.build);
    let request = request_of(scene);
    let messages = render_with_messages(&session, &request);
    let is_same = || read_all(&session, &request) == whole.images;
    let outcome = if messages.is_empty() { Ok(is_same()) } else { Err(messages) };
    let struck = session.witness().struck;
    let again = || {
        session.restart();
        render_with_messages(&session, &request).is_empty() && is_same()
    };
    let next = outcome.is_ok() || again();
    Failed { what, struck, outcome, next }
}

/// Allocating calls, and after how many of them one fails: as far as there are so many, in core and streaming.
const FAILURES: [(DriverCall, &[u64]); 6] = [
    (DriverCall::Buffer, &[0, 2, 5, 13]),
    (DriverCall::Range, &[0, 3, 13, 34]),
    (DriverCall::Memory, &[0, 2, 5, 13]),
    (DriverCall::Mapping, &[0, 1, 2]),
    (DriverCall::Pipeline, &[0, 8]),
    (DriverCall::CommandPool, &[0, 1]),
];

/// Fails at `most` of the positions of each call.
fn fail_everywhere(times: u32, most: usize, judge: impl Fn(&Failed)) {
    let scene = &SCENES[0];
    let whole = render(scene, small_chunks(), options());
    let part = quarter(scene, &whole);
    let mut before = 0;
    for (call, places) in FAILURES {
        for (&after, streams) in places.iter().take(most).flat_map(|after| [(after, false), (after, true)]) {
            let settings = if streams { part.clone() } else { small_chunks() };
            let failure = PlantedFailure { call, after, times };
            let found = failed(scene, settings, streams, failure, &whole);
            // Sessions of one device share its count.
            let counted = if needs_device(call) { 0 } else { before };
            assert_eq!(found.struck - counted, u64::from(times), "{}: it has to strike", found.what);
            before = if needs_device(call) { before } else { found.struck };
            judge(&found);
            assert!(found.next, "{}: the next render has another picture", found.what);
        }
    }
}

#[test]
fn any_single_failed_allocation_changes_no_bit() {
    fail_everywhere(1, usize::MAX, |failed| {
        assert!(matches!(failed.outcome, Ok(true)), "{}: {:?}", failed.what, failed.outcome);
    });
}

/// A call that failed twice is given up, with one error, or did not matter.
#[test]
fn two_consecutive_failed_allocations_give_at_most_one_error() {
    fail_everywhere(2, 2, |failed| match &failed.outcome {
        Ok(is_same) => assert!(is_same, "{}: another picture", failed.what),
        Err(messages) => {
            let is_clear = messages.len() == 1 && messages[0].text.contains("memory");
            assert!(is_clear && messages[0].severity == Severity::Error, "{}: {messages:?}", failed.what);
        }
    });
}

/// By the driver's own function, on any device: the budget accounts for every byte, and its figure for the device never
/// exceeds it.
#[test]
fn driver_allocations_never_exceed_the_counted_budget() {
    for host_mapped in [HostMapped::Off, HostMapped::On] {
        books_and_driver(host_mapped);
    }
}

fn books_and_driver(host_mapped: HostMapped) {
    let budget_mib = 5_u32;
    let settings =
        Settings { chunk_size_kib: 256, memory_budget_mib: budget_mib, host_mapped, ..support::settings(2, 2) };
    let session = Session::with_options(settings, options());
    session.with_scene(BEACH.build);
    let request = request_of(&BEACH);
    support::render(&session, &request);
    let maps = host_mapped == HostMapped::On;
    for _ in 1..MAX_PICTURES {
        if !maps || session.stats().streaming.mapped_bytes > 0 {
            break;
        }
        session.restart();
        support::render(&session, &request);
    }
    let (stats, witness) = (session.stats(), session.witness());
    assert!(!stats.streaming.in_core, "it streams: {stats:?}");
    assert!(maps || stats.streaming.evictions > 0, "chunks came and went: {stats:?}");
    assert!(!maps || stats.streaming.mapped_bytes > 0, "host memory was read: {stats:?}");
    assert!(stats.gpu_peak_bytes <= u64::from(budget_mib) << 20, "above the budget: {stats:?}");
    assert!(stats.gpu_peak_bytes > u64::from(budget_mib) << 19, "the budget was put to use: {stats:?}");
    assert!(witness.driver.calls > 10, "memory was asked for: {witness:?}");
    assert!(witness.driver.peak <= witness.peak_budgeted_bytes, "more than on the books: {witness:?}");
    assert_eq!(witness.driver.held, witness.budgeted_bytes, "to the byte: {witness:?}");
}
