// SPDX-License-Identifier: Apache-2.0
//! The hard budget by the driver's own figures. It runs in a process of its own because the driver counts all memory of
//! a process.

#[path = "gpu/lights/test_files.rs"]
mod light_files;
mod lights {
    pub(crate) use super::light_files::TestFiles;
}
#[path = "gpu/scenes.rs"]
#[allow(dead_code, reason = "shared with the other tests, which use all of it")]
mod scenes;
#[path = "gpu/streaming/scenes.rs"]
#[allow(dead_code, reason = "shared with the other tests, which use all of it")]
mod streaming_scenes;
#[path = "gpu/support.rs"]
#[allow(dead_code, reason = "shared with the other tests, which use all of it")]
mod support;

use oocpt_core::settings::Settings;
use oocpt_render::{Session, SessionOptions};
use streaming_scenes::{BEACH, Scene};

/// Bytes by which the driver's own memory (its context, pipelines, page tables) may grow between a first small render
/// and the end of a streaming one.
const DRIVERS_OWN: u64 = 32 << 20;

/// Renders under a budget for all memory, MiB; the peaks by the driver's count and by ours.
fn peaks(scene: &Scene, samples: u32, budget_mib: u32) -> (u64, u64) {
    peaks_of(scene, samples, budget_mib, true)
}

fn peaks_of(scene: &Scene, samples: u32, budget_mib: u32, force_streaming: bool) -> (u64, u64) {
    let settings = Settings { chunk_size_kib: 256, memory_budget_mib: budget_mib, ..support::settings(samples, 3) };
    let session = Session::with_options(settings, SessionOptions { force_streaming, ..SessionOptions::default() });
    session.with_scene(scene.build);
    let request = support::request(support::perspective(scene.eye, scene.target, 0.8, [256, 192]));
    support::render(&session, &request);
    let stats = session.stats();
    assert!(stats.gpu_peak_bytes <= stats.gpu_budget_bytes, "above the budget by our own account: {stats:?}");
    assert_eq!(stats.gpu_budget_bytes, u64::from(budget_mib) << 20, "the budget asked for");
    (stats.streaming.driver_peak_bytes, stats.gpu_peak_bytes)
}

#[test]
fn after_every_step_the_driver_counts_no_more_than_the_budget() {
    let (small_driver, small_ours) = peaks(&BEACH, 1, 24);
    if small_driver == 0 {
        // A software renderer, or a driver that does not report its memory: the stats have to say so too, whatever is
        // rendered.
        assert_eq!(peaks(&BEACH, 2, 48).0, 0, "nothing is made up");
        assert_eq!(peaks_of(&BEACH, 2, 1024, false).0, 0, "in core neither");
        return;
    }
    assert!(peaks_of(&BEACH, 2, 1024, false).0 > 0, "it is asked in core, too");
    let own = small_driver.saturating_sub(small_ours);
    // All of them are smaller than the scene and its paths would take.
    for budget_mib in [28, 36, 48] {
        let (driver, ours) = peaks(&BEACH, 16, budget_mib);
        let limit = (u64::from(budget_mib) << 20) + own + DRIVERS_OWN;
        assert!(driver <= limit, "{driver} bytes by the driver's count, {ours} by ours, own {own}, limit {limit}");
        assert!(ours > u64::from(budget_mib) << 19, "the budget is put to use: {ours}");
    }
}
