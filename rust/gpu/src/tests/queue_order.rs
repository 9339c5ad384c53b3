// SPDX-License-Identifier: Apache-2.0
//! Tests in which the host holds the GPU back: a list of one lane waits for a submission of the other that is only
//! pretended, until the host says it is done. So both timelines are told apart also on a device with one queue.

use std::sync::Arc;
use std::time::Duration;

use ash::vk;

use crate::instance::lane::QueueLane;
use crate::{Buffer, BufferUsage, CommandList, Gpu, Heap, OpenOptions, StagingRing, Submission};

const SOON: Duration = Duration::from_millis(30);
const LATE: Duration = Duration::from_secs(30);

pub(crate) fn open() -> Arc<Gpu> {
    open_with(&OpenOptions::default())
}

fn open_with(options: &OpenOptions) -> Arc<Gpu> {
    let selector = std::env::var("OOCPT_TEST_DEVICE").ok();
    Gpu::open(&OpenOptions { selector, validation: true, ..options.clone() }).expect("a device to test on")
}

/// Holds back what waits for it. Nothing may be submitted to its lane.
pub(crate) struct Gate {
    lane: QueueLane,
    pretended: Submission,
    gpu: Arc<Gpu>,
}

impl Gate {
    /// A gate for lists of the other lane than `lane`.
    pub(crate) fn of(gpu: &Arc<Gpu>, lane: QueueLane) -> Self {
        Self {
            lane,
            pretended: Submission::new(gpu, (lane, 1), "gate".to_owned(), (Vec::new(), None)),
            gpu: Arc::clone(gpu),
        }
    }

    pub(crate) fn hold(&self, commands: &mut CommandList) {
        commands.wait_for(&self.pretended);
    }

    /// Lets it run: by the drop of `self`.
    pub(crate) fn open(self) {}
}

impl Drop for Gate {
    /// Also when a test fails: closing the device waits for what is held back.
    fn drop(&mut self) {
        let device = self.gpu.device();
        let info = vk::SemaphoreSignalInfo::default().semaphore(device.timeline(self.lane).semaphore()).value(1);
        // SAFETY: the timeline is at 0, and no submission signals it (see `Gate`).
        if let Err(code) = unsafe { device.raw.signal_semaphore(&info) } {
            eprintln!("the gate stays shut: {code:?}");
        }
    }
}

fn list_of(gpu: &Arc<Gpu>, lane: QueueLane) -> CommandList {
    match lane {
        QueueLane::Main => gpu.commands("main list"),
        QueueLane::Transfer => gpu.transfer_commands("transfer list"),
    }
    .expect("a command list")
}

fn finished_silently(gpu: Arc<Gpu>) {
    let log = gpu.validation_log();
    drop(gpu);
    assert_eq!(log.take(), Vec::<String>::new(), "validation");
}

#[test]
fn a_command_list_runs_after_its_dependencies() {
    for [lane, gate] in [[QueueLane::Main, QueueLane::Transfer], [QueueLane::Transfer, QueueLane::Main]] {
        let gpu = open();
        let gate = Gate::of(&gpu, gate);
        let data = Buffer::new(&gpu, "data", 64, BufferUsage::Readback).expect("memory");
        let mut commands = list_of(&gpu, lane);
        commands.fill(&data, 0, 64, 1);
        gate.hold(&mut commands);
        let submission = commands.submit().expect("submitted");
        assert_eq!(submission.wait(SOON), Ok(false), "{lane:?} is held back");
        gate.open();
        assert_eq!(submission.wait(LATE), Ok(true), "{lane:?} runs");
        drop((data, submission));
        finished_silently(gpu);
    }
}

#[test]
fn dropped_objects_are_kept_until_both_queues_finish() {
    for [lane, gate] in [[QueueLane::Main, QueueLane::Transfer], [QueueLane::Transfer, QueueLane::Main]] {
        let gpu = open();
        let gate = Gate::of(&gpu, gate);
        let heap = Heap::new(&gpu, "heap", 1 << 20).expect("a heap");
        // Neither is named by the list: it could know their addresses.
        let buffer = Buffer::new(&gpu, "buffer", 1 << 20, BufferUsage::Device).expect("memory");
        let (shared, own) = (heap.alloc("a", 4096, 16).expect("memory"), heap.alloc("b", 1 << 20, 16).expect("memory"));
        let mut commands = list_of(&gpu, lane);
        gate.hold(&mut commands);
        let submission = commands.submit().expect("submitted");
        drop((buffer, shared, own));
        assert_eq!((gpu.memory().used >> 20, heap.stats().used_bytes), (3, 4096), "held for {lane:?}");
        gate.open();
        assert_eq!(submission.wait(LATE), Ok(true), "{lane:?} runs");
        assert_eq!((gpu.memory().used, heap.stats().used_bytes), (1 << 20, 0), "freed after {lane:?}");
        drop((heap, submission));
        finished_silently(gpu);
    }
}

#[test]
fn a_range_that_outlives_its_heap_is_kept_too() {
    let gpu = open();
    let gate = Gate::of(&gpu, QueueLane::Transfer);
    let heap = Heap::new(&gpu, "heap", 1 << 20).expect("a heap");
    let ranges = ["a", "b"].map(|name| heap.alloc(name, 4096, 16).expect("memory"));
    drop(heap);
    let mut commands = list_of(&gpu, QueueLane::Main);
    gate.hold(&mut commands);
    let submission = commands.submit().expect("submitted");
    drop(ranges);
    assert_eq!(gpu.memory().used, 1 << 20, "the list could know their addresses");
    gate.open();
    assert_eq!(submission.wait(LATE), Ok(true), "runs");
    assert_eq!(gpu.memory().used, 0, "freed after it");
    drop(submission);
    finished_silently(gpu);
}

#[test]
fn staging_space_comes_back_when_the_copy_is_done() {
    for [lane, gate] in [[QueueLane::Main, QueueLane::Transfer], [QueueLane::Transfer, QueueLane::Main]] {
        let gpu = open();
        let gate = Gate::of(&gpu, gate);
        let ring = StagingRing::new(&gpu, 100).expect("a ring");
        let target = Buffer::new(&gpu, "target", 80, BufferUsage::Readback).expect("memory");
        let mut slice = ring.reserve(80, 4).expect("all is free");
        slice.bytes_mut().fill(7);
        let mut commands = list_of(&gpu, lane);
        slice.copy_to(&mut commands, 0, &target, 0, 80);
        drop(slice);
        gate.hold(&mut commands);
        assert!(ring.try_reserve(80, 4).expect("alive").is_none(), "an unsubmitted list holds it");
        let submission = commands.submit().expect("submitted");
        assert!(ring.try_reserve(80, 4).expect("alive").is_none(), "a list in flight holds it");
        std::thread::scope(|scope| {
            let waiting = scope.spawn(|| ring.reserve(80, 4).expect("free in the end").bytes_mut().fill(9));
            std::thread::sleep(SOON);
            assert!(!waiting.is_finished(), "{lane:?}: the copy was not done, but its bytes were given away");
            gate.open();
        });
        assert_eq!(submission.wait(LATE), Ok(true), "{lane:?} runs");
        let mut bytes = [0; 80];
        target.read(0, &mut bytes).expect("fits");
        assert_eq!((bytes, ring.used()), ([7; 80], 0), "what was copied, and all is free");
        drop((target, submission, ring));
        finished_silently(gpu);
    }
}

#[test]
fn trying_to_allocate_does_not_wait() {
    const MIB: u64 = 1 << 20;
    let gpu = open_with(&OpenOptions { budget_bytes: Some(5 * MIB), ..OpenOptions::default() });
    let gate = Gate::of(&gpu, QueueLane::Main);
    let heap = Heap::new(&gpu, "heap", 2 * MIB).expect("a heap");
    let (shared, own) = (heap.alloc("shared", MIB, 16).expect("fits"), heap.alloc("own", 2 * MIB, 16).expect("fits"));
    let mut transfer = list_of(&gpu, QueueLane::Transfer);
    transfer.fill(&shared, 0, MIB, 1);
    gate.hold(&mut transfer);
    let submission = transfer.submit().expect("submitted");
    let live = heap.stats().live_bytes;
    assert!(live >= 3 * MIB && heap.stats().retired_bytes == 0, "{:?}", heap.stats());
    drop((shared, own));
    let stats = heap.stats();
    assert_eq!((stats.live_bytes, stats.retired_bytes, stats.used_bytes), (0, live, MIB), "{stats:?}");
    assert!(stats.dedicated_bytes >= 2 * MIB, "until the GPU is done: {stats:?}");
    let (tell, told) = std::sync::mpsc::channel();
    let answer = std::thread::scope(|scope| {
        scope.spawn(|| tell.send((heap.try_alloc("large", 2 * MIB, 16), heap.try_alloc("small", MIB, 16))));
        let answer = told.recv_timeout(LATE);
        // Ends the wait if there was one.
        gate.open();
        answer
    });
    let (large, small) = answer.expect("it waited for the GPU");
    assert!(large.expect("alive").is_none(), "no room now, although there will be");
    let small = small.expect("alive").expect("the other half of the arena is free");
    assert_eq!(submission.wait(LATE), Ok(true), "runs");
    assert!(heap.try_alloc("large", 2 * MIB, 16).expect("alive").is_some(), "room now");
    drop(small);
    let stats = heap.stats();
    assert_eq!((stats.live_bytes, stats.retired_bytes, stats.dedicated_bytes), (0, 0, 0), "{stats:?}");
    drop((heap, submission));
    finished_silently(gpu);
}
