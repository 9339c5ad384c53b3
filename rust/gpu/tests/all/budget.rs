// SPDX-License-Identifier: Apache-2.0
//! The hard budget: refusal, recovery, planted failures.

use oocpt_gpu::{Buffer, BufferUsage, DeviceKind, GpuError, Heap, OpenOptions};

use crate::support;

const MIB: u64 = 1 << 20;

fn small() -> support::TestGpu {
    support::open_with(&OpenOptions { budget_bytes: Some(8 * MIB), ..support::options() })
}

#[test]
fn above_the_budget_is_refused_and_dropping_recovers() {
    let gpu = small();
    let first = Buffer::new(&gpu, "first", 6 * MIB, BufferUsage::Device).expect("fits");
    let error = Buffer::new(&gpu, "second", 4 * MIB, BufferUsage::Device).expect_err("does not fit");
    let GpuError::OutOfMemory { name, bytes, used, budget } = &error else { panic!("{error}") };
    assert_eq!((name.as_str(), *budget), ("second", 8 * MIB), "{error}");
    assert!(*bytes >= 4 * MIB && *used >= 6 * MIB && *used <= 8 * MIB, "{error}");
    assert!(Buffer::new(&gpu, "staging", 4 * MIB, BufferUsage::Upload).is_ok(), "host memory is not bounded by it");
    drop(first);
    let second = Buffer::new(&gpu, "second", 4 * MIB, BufferUsage::Device).expect("fits now");
    let memory = gpu.memory();
    assert_eq!((memory.used, memory.budget), (second.size(), 8 * MIB), "{memory:?}");
    assert!(memory.peak >= 6 * MIB && memory.peak <= memory.budget, "{memory:?}");
}

#[test]
fn the_budget_can_be_moved() {
    let gpu = small();
    let held = Buffer::new(&gpu, "held", 6 * MIB, BufferUsage::Device).expect("fits");
    gpu.set_budget(Some(4 * MIB));
    assert!(Buffer::new(&gpu, "more", 1, BufferUsage::Device).is_err(), "already above the new budget");
    drop(held);
    assert!(Buffer::new(&gpu, "more", 3 * MIB, BufferUsage::Device).is_ok(), "below it again");
    gpu.set_budget(None);
    assert!(gpu.memory().budget > 8 * MIB, "automatic: {:?}", gpu.memory());
}

#[test]
fn a_short_budget_makes_smaller_arenas_and_never_more_than_allowed() {
    let gpu = small();
    let heap = Heap::new(&gpu, "heap", 64 * MIB).expect("a heap");
    let mut ranges = Vec::new();
    let error = loop {
        match heap.alloc("piece", 100_000, 16) {
            Ok(range) => ranges.push(range),
            Err(error) => break error,
        }
        let memory = gpu.memory();
        assert!(memory.used <= memory.budget, "{memory:?}");
    };
    assert!(matches!(error, GpuError::OutOfMemory { .. }), "{error}");
    assert!(ranges.len() > 70, "{} ranges of 100 kB in 8 MiB: {:?}", ranges.len(), heap.stats());
    ranges.clear();
    heap.trim();
    assert_eq!(gpu.memory().used, 0, "all given back");
    assert!(heap.alloc("again", 100_000, 16).is_ok(), "recovered");
}

#[test]
fn idle_arenas_make_room_for_others() {
    let gpu = small();
    let heap = Heap::new(&gpu, "heap", 8 * MIB).expect("a heap");
    drop(heap.alloc("passing", 1000, 16).expect("fits"));
    assert!(gpu.memory().used >= 7 * MIB, "the empty arena is kept for the next range");
    assert!(
        Buffer::new(&gpu, "large", 7 * MIB, BufferUsage::Device).is_ok(),
        "and given up when something else needs it"
    );
}

#[test]
fn the_driver_counts_what_we_hold() {
    let gpu = support::open();
    let Some(before) = gpu.driver_usage() else {
        assert!(!gpu.report().capabilities.memory_budget, "known if the extension is there");
        return;
    };
    let held = Buffer::new(&gpu, "held", 256 * MIB, BufferUsage::Device).expect("memory");
    let mut commands = gpu.commands("touch").expect("a command list");
    commands.fill(&held, 0, 256 * MIB, 1);
    support::finish(&commands.submit().expect("submitted"));
    let with = gpu.driver_usage().expect("still known");
    drop(held);
    let after = gpu.driver_usage().expect("still known");
    let told = format!("{}: {before} bytes before, {with} with 256 MiB, {after} after", gpu.report().name);
    assert!(with > 0 && after > 0, "{told}");
    // Software renderers tell of the whole machine; elsewhere tests beside this one may hold some as well.
    if gpu.report().kind != DeviceKind::Cpu {
        assert!(with >= before + 128 * MIB && after + 128 * MIB <= with, "{told}");
    }
}
