// SPDX-License-Identifier: Apache-2.0
//! The policies on the simulated device.

use super::simulate::{Device, SceneOptions, Workload, run};
use oocpt_core::residency::PolicyKind;

fn workload() -> Workload {
    Workload::new(SceneOptions { side: 12, paths: 2048, ..SceneOptions::default() }).expect("a good scene")
}

fn device() -> Device {
    Device { segments: 4, segment_slots: 256, ..Device::default() }
}

#[test]
fn all_paths_finish_at_every_budget_and_loads_grow_as_it_shrinks() {
    let workload = workload();
    for kind in PolicyKind::ALL {
        let mut loads = Vec::new();
        for percent in [100, 50, 10, 0] {
            let report = run(&workload, &device(), workload.budget(percent), kind.policy()).expect("it fits");
            assert!(report.finished, "{kind} at {percent} %: {report:?}");
            assert!(report.residency.peak_bytes <= workload.budget(percent), "{kind} at {percent} %");
            loads.push(report.residency.bytes_loaded);
        }
        assert!(loads[0] <= workload.catalog.total_bytes(), "{kind}: everything fits, nothing is loaded twice");
        assert!(loads[0] < loads[1] && loads[1] < loads[3], "{kind}: {loads:?}");
    }
}

#[test]
fn equal_simulations_are_equal() {
    let workload = workload();
    let run = || run(&workload, &device(), workload.budget(20), PolicyKind::Benefit.policy()).expect("it fits");
    assert_eq!(run(), run(), "two runs");
}

#[test]
fn benefit_moves_fewer_bytes_than_a_sweep() {
    let workload = workload();
    let bytes = |kind: PolicyKind| {
        let report = run(&workload, &device(), workload.budget(20), kind.policy()).expect("it fits");
        report.residency.bytes_loaded
    };
    assert!(bytes(PolicyKind::Benefit) < bytes(PolicyKind::Sweep), "at a fifth of the scene");
}
