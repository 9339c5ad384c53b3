// SPDX-License-Identifier: Apache-2.0
//! Nothing is destroyed while the GPU may use it, and everything is destroyed in the end.

use oocpt_gpu::{Buffer, BufferUsage, Gpu, Heap, OpenOptions, Submission};

use crate::support::{self, affine, affine_push, finish, read_words, spin, spin_push};

const MIB: u64 = 1 << 20;

/// Keeps the GPU busy for a while, writing to `address`.
fn busy(gpu: &std::sync::Arc<Gpu>, address: u64) -> Submission {
    let pipeline = spin(gpu);
    let mut commands = gpu.commands("busy").expect("a command list");
    for _ in 0..10 {
        commands.dispatch(&pipeline, &spin_push(address, support::LONG), [1, 1, 1]);
    }
    commands.submit().expect("submitted")
}

#[test]
fn dropped_buffers_are_held_until_the_gpu_is_done() {
    let gpu = support::open();
    let heap = Heap::new(&gpu, "heap", MIB).expect("a heap");
    let buffer = Buffer::new(&gpu, "target", 2 * MIB, BufferUsage::Device).expect("memory");
    let range = heap.alloc("range", 4096, 16).expect("memory");
    let submission = busy(&gpu, buffer.address());
    drop((buffer, range));
    let (held, used_in_heap) = (gpu.memory().used, heap.stats().used_bytes);
    assert!(!submission.is_done(), "the work was too short to see anything");
    assert!(held >= 3 * MIB && used_in_heap == 4096, "freed too early: {held} bytes, {used_in_heap} in the heap");
    finish(&submission);
    assert_eq!(heap.stats().used_bytes, 0, "freed when done");
    assert!(gpu.memory().used <= MIB, "only the heap's arena is left: {:?}", gpu.memory());
}

#[test]
fn a_full_budget_waits_for_retired_buffers() {
    let gpu = support::open_with(&OpenOptions { budget_bytes: Some(4 * MIB), ..support::options() });
    let first = Buffer::new(&gpu, "first", 3 * MIB, BufferUsage::Device).expect("fits");
    let submission = busy(&gpu, first.address());
    drop(first);
    let second = Buffer::new(&gpu, "second", 3 * MIB, BufferUsage::Device).expect("fits once the first is gone");
    assert!(submission.is_done(), "it had to wait for the GPU");
    drop(second);
}

#[test]
fn command_lists_keep_their_resources_alive() {
    let gpu = support::open();
    let readback = Buffer::new(&gpu, "readback", 256, BufferUsage::Readback).expect("memory");
    let mut commands = gpu.commands("orphans").expect("a command list");
    {
        let pipeline = affine(&gpu, 2);
        let heap = Heap::new(&gpu, "heap", MIB).expect("a heap");
        let range = heap.alloc("range", 256, 16).expect("memory");
        commands.fill(&range, 0, 256, 21);
        commands.dispatch(&pipeline, &affine_push(range.address(), readback.address(), 64, 0), [1, 1, 1]);
    }
    assert!(gpu.memory().used >= MIB, "the arena lives on");
    finish(&commands.submit().expect("submitted"));
    assert_eq!(read_words(&readback, 64), [42; 64], "the orphaned pipeline and range were still there");
    assert_eq!(gpu.memory().used, 0, "and are gone now");
}

#[test]
fn a_discarded_command_list_leaves_nothing() {
    let gpu = support::open();
    let data = Buffer::new(&gpu, "data", 64, BufferUsage::Device).expect("memory");
    for _ in 0..100 {
        let mut commands = gpu.commands("discarded").expect("a command list");
        commands.profile(true);
        commands.fill(&data, 0, 64, 1);
        drop(commands);
    }
    drop(data);
    assert_eq!(gpu.memory().used, 0, "nothing is kept");
}

#[test]
fn objects_may_outlive_the_device_handle() {
    let gpu = support::open();
    let log = gpu.validation_log();
    let heap = Heap::new(&gpu, "heap", MIB).expect("a heap");
    let range = heap.alloc("range", 64, 16).expect("memory");
    let upload = Buffer::new(&gpu, "upload", 64, BufferUsage::Upload).expect("memory");
    let pipeline = affine(&gpu, 1);
    busy(&gpu, range.address());
    drop(gpu);
    upload.write(0, &[1; 64]).expect("still mapped");
    drop((range, heap, pipeline, upload));
    assert_eq!(log.take(), Vec::<String>::new(), "nothing was destroyed too early or leaked");
}
