// SPDX-License-Identifier: Apache-2.0
//! Several threads on one device.

use std::sync::Arc;

use oocpt_gpu::{Buffer, BufferUsage, Heap, HeapRange, Pipeline, Submission};

use crate::support::{self, AFFINE, affine, affine_push, bytes, compile, finish, read_words};

#[test]
fn public_types_cross_threads() {
    fn shared<T: Send + Sync>() {}
    fn sent<T: Send>() {}
    shared::<oocpt_gpu::Gpu>();
    shared::<Buffer>();
    shared::<Heap>();
    shared::<HeapRange>();
    shared::<Pipeline>();
    shared::<Submission>();
    shared::<oocpt_gpu::StagingRing>();
    sent::<oocpt_gpu::StagingSlice>();
    sent::<oocpt_gpu::CommandList>();
    let gpu = support::open();
    assert_eq!(Arc::strong_count(&gpu), 1, "nothing holds the device behind our back");
}

#[test]
fn threads_submit_at_once_and_do_not_disturb_each_other() {
    let gpu = support::open();
    let pipeline = affine(&gpu, 1);
    let heap = Heap::new(&gpu, "heap", 1 << 20).expect("a heap");
    std::thread::scope(|scope| {
        for thread in 0..4_u32 {
            let (gpu, pipeline, heap) = (&*gpu, &pipeline, &heap);
            scope.spawn(move || {
                let readback = Buffer::new(gpu, "readback", 256, BufferUsage::Readback).expect("memory");
                for round in 0..30 {
                    let range = heap.alloc("range", 256, 256).expect("memory");
                    let mut commands = gpu.commands("thread").expect("a command list");
                    commands.update(&range, 0, &bytes(&[thread * 1000 + round; 64]));
                    let push = affine_push(range.address(), readback.address(), 64, 7);
                    commands.dispatch(pipeline, &push, [1, 1, 1]);
                    let submission = commands.submit().expect("submitted");
                    drop(range);
                    finish(&submission);
                    assert_eq!(read_words(&readback, 64), [thread * 1000 + round + 7; 64], "thread {thread}");
                }
            });
        }
    });
    assert_eq!(heap.stats().used_bytes, 0, "all ranges came back");
}

#[test]
fn pipelines_are_made_by_several_threads() {
    let gpu = support::open();
    let words = compile(AFFINE);
    let pipelines: Vec<Pipeline> = std::thread::scope(|scope| {
        let make = |scale| Pipeline::new(&gpu, "affine", &words, &[(0, scale)], 24).expect("valid");
        let threads: Vec<_> = (0..8).map(|scale| scope.spawn(move || make(scale))).collect();
        threads.into_iter().map(|thread| thread.join().expect("no panic")).collect()
    });
    let data = Buffer::new(&gpu, "data", 4 * 64 * 8, BufferUsage::Readback).expect("memory");
    let ones = Buffer::new(&gpu, "ones", 256, BufferUsage::Upload).expect("memory");
    ones.write(0, &bytes(&[1; 64])).expect("fits");
    let mut commands = gpu.commands("each").expect("a command list");
    for (i, pipeline) in (0_u64..).zip(&pipelines) {
        commands.dispatch(pipeline, &affine_push(ones.address(), data.address() + i * 256, 64, 0), [1, 1, 1]);
    }
    finish(&commands.submit().expect("submitted"));
    let expected: Vec<u32> = (0..8).flat_map(|scale| [scale; 64]).collect();
    assert_eq!(read_words(&data, 512), expected, "each with its own constant");
}
