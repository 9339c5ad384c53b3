// SPDX-License-Identifier: Apache-2.0
//! Transfer lists: on a queue of their own where the device has one, in order with others only where that was said.

use std::time::Duration;

use oocpt_gpu::{Buffer, BufferUsage, Gpu, GpuError, Heap, OpenOptions};

use crate::support::{self, affine, affine_push, bytes, finish, read_words, spin, spin_push};

/// Ways to run transfers: on a queue of their own, if there is one, and on the main queue.
fn both_ways() -> [OpenOptions; 2] {
    [true, false].map(|transfer_queue| OpenOptions { transfer_queue, ..support::options() })
}

#[test]
fn dispatches_see_transferred_data() {
    for options in both_ways() {
        let gpu = support::open_with(&options);
        assert!(options.transfer_queue || !gpu.has_transfer_queue(), "switched off");
        let pipeline = affine(&gpu, 3);
        let heap = Heap::new(&gpu, "heap", 32 << 20).expect("a heap");
        let readback = Buffer::new(&gpu, "readback", 256, BufferUsage::Readback).expect("memory");
        let upload = Buffer::new(&gpu, "upload", 4 << 20, BufferUsage::Upload).expect("memory");
        for round in 0..8_u32 {
            upload.write((4 << 20) - 256, &bytes(&[round; 64])).expect("fits");
            let range = heap.alloc("range", 4 << 20, 256).expect("memory");
            let mut transfer = gpu.transfer_commands("bring").expect("a command list");
            transfer.fill(&range, 0, 4 << 20, 0xFFFF);
            // The last bytes of a long copy are what is looked at.
            transfer.copy(&upload, 0, &range, 0, 4 << 20);
            transfer.update(&range, range.size() - 4, &bytes(&[1000 + round]));
            let brought = transfer.submit().expect("submitted");
            let mut commands = gpu.commands("use").expect("a command list");
            commands.keep(&range);
            commands.dispatch(
                &pipeline,
                &affine_push(range.address() + (4 << 20) - 256, readback.address(), 64, 1),
                [1, 1, 1],
            );
            commands.wait_for(&brought);
            finish(&commands.submit().expect("submitted"));
            assert!(brought.is_done(), "waited for");
            let mut expected = [round * 3 + 1; 64];
            expected[63] = (1000 + round) * 3 + 1;
            assert_eq!(read_words(&readback, 64), expected, "round {round}");
        }
    }
}

#[test]
fn transfers_see_data_written_by_a_dispatch() {
    for options in both_ways() {
        let gpu = support::open_with(&options);
        let pipeline = spin(&gpu);
        let data = Buffer::new(&gpu, "data", 64, BufferUsage::Device).expect("memory");
        let readback = Buffer::new(&gpu, "readback", 4, BufferUsage::Readback).expect("memory");
        let mut commands = gpu.commands("slow").expect("a command list");
        commands.fill(&data, 0, 64, 0);
        commands.dispatch(&pipeline, &spin_push(data.address(), support::LONG), [1, 1, 1]);
        let slow = commands.submit().expect("submitted");
        let mut transfer = gpu.transfer_commands("take").expect("a command list");
        transfer.wait_for(&slow);
        transfer.copy(&data, 0, &readback, 0, 4);
        finish(&transfer.submit().expect("submitted"));
        assert!(slow.is_done(), "waited for");
        assert!(read_words(&readback, 1)[0] & 1 == 1, "the dispatch writes an odd number at its end");
    }
}

#[test]
fn transfers_run_beside_a_long_dispatch() {
    let gpu = support::open();
    if !gpu.has_transfer_queue() {
        eprintln!("skipped: {} has one queue", gpu.report().name);
        return;
    }
    let pipeline = spin(&gpu);
    let data = Buffer::new(&gpu, "data", 64, BufferUsage::Device).expect("memory");
    let readback = Buffer::new(&gpu, "readback", 64, BufferUsage::Readback).expect("memory");
    let mut commands = gpu.commands("long").expect("a command list");
    for _ in 0..20 {
        commands.dispatch(&pipeline, &spin_push(data.address(), support::LONG), [1, 1, 1]);
    }
    let long = commands.submit().expect("submitted");
    let mut transfer = gpu.transfer_commands("beside").expect("a command list");
    transfer.fill(&readback, 0, 64, 9);
    finish(&transfer.submit().expect("submitted"));
    assert!(!long.is_done(), "the transfer had to wait for the dispatch, or that was too short");
    assert_eq!(read_words(&readback, 16), [9; 16], "done before");
    finish(&long);
}

#[test]
fn threads_submit_transfers_at_once() {
    let gpu = support::open();
    let pipeline = affine(&gpu, 2);
    let heap = Heap::new(&gpu, "heap", 1 << 20).expect("a heap");
    std::thread::scope(|scope| {
        for thread in 0..4_u32 {
            let (gpu, heap, pipeline) = (&*gpu, &heap, &pipeline);
            scope.spawn(move || {
                let readback = Buffer::new(gpu, "readback", 256, BufferUsage::Readback).expect("memory");
                for round in 0..20 {
                    let range = heap.alloc("range", 256, 256).expect("memory");
                    let mut transfer = gpu.transfer_commands("bring").expect("a command list");
                    transfer.update(&range, 0, &bytes(&[thread * 100 + round; 64]));
                    let brought = transfer.submit().expect("submitted");
                    let mut commands = gpu.commands("double").expect("a command list");
                    commands.wait_for(&brought);
                    commands.keep(&range);
                    commands.dispatch(pipeline, &affine_push(range.address(), range.address(), 64, 0), [1, 1, 1]);
                    let doubled = commands.submit().expect("submitted");
                    let mut transfer = gpu.transfer_commands("take").expect("a command list");
                    transfer.wait_for(&doubled);
                    transfer.copy(&range, 0, &readback, 0, 256);
                    drop(range);
                    finish(&transfer.submit().expect("submitted"));
                    assert_eq!(read_words(&readback, 64), [(thread * 100 + round) * 2; 64], "thread {thread}");
                }
            });
        }
    });
    gpu.wait_idle().expect("alive");
    assert_eq!(heap.stats().used_bytes, 0, "all ranges came back");
}

#[test]
fn waiting_for_idle_waits_for_transfers_too() {
    let gpu = support::open();
    let data = Buffer::new(&gpu, "data", 32 << 20, BufferUsage::Device).expect("memory");
    let transfers: Vec<_> = (0..8)
        .map(|value| {
            let mut transfer = gpu.transfer_commands("fill").expect("a command list");
            transfer.fill(&data, 0, 32 << 20, value);
            transfer.submit().expect("submitted")
        })
        .collect();
    gpu.wait_idle().expect("alive");
    assert!(transfers.iter().all(|transfer| transfer.is_done()), "all done");
    drop(data);
    assert_eq!(gpu.memory().used, 0, "nothing is in use any more");
}

#[test]
fn transfers_are_timed_if_their_queue_can() {
    let gpu = support::open_with(&OpenOptions { profile: true, ..support::options() });
    let data = Buffer::new(&gpu, "data", 1 << 20, BufferUsage::Device).expect("memory");
    let mut transfer = gpu.transfer_commands("timed").expect("a command list");
    transfer.span("all", |c| {
        c.fill(&data, 0, 1 << 20, 1);
        c.concurrent(|c| (0..4).for_each(|part| c.copy(&data, part * 4096, &data, (part + 8) * 4096, 4096)));
    });
    let submission = transfer.submit().expect("submitted");
    finish(&submission);
    let names: Vec<_> = submission.timings().into_iter().map(|(name, secs)| (name, secs < 60.0)).collect();
    let expected = ["all", "fill", "copy", "copy", "copy", "copy"].map(|name| (name.to_owned(), true));
    assert!(names.is_empty() || names == expected, "all or nothing: {names:?}");
    assert!(
        !names.is_empty() || gpu.has_transfer_queue() || !gpu.report().capabilities.timestamps,
        "as the main queue"
    );
}

#[test]
fn transfer_lists_refuse_dispatches_and_foreign_resources() {
    let gpu = support::open();
    let pipeline = affine(&gpu, 1);
    let data = Buffer::new(&gpu, "data", 64, BufferUsage::Readback).expect("memory");
    data.write(0, &[7; 64]).expect("fits");
    for indirect in [false, true] {
        let mut transfer = gpu.transfer_commands("mistaken").expect("a command list");
        transfer.fill(&data, 0, 64, 0);
        if indirect {
            transfer.dispatch_indirect(&pipeline, &[0; 24], &data, 0);
        } else {
            transfer.dispatch(&pipeline, &[0; 24], [1, 1, 1]);
        }
        let error = transfer.submit().expect_err("no dispatch in a transfer list");
        assert!(matches!(&error, GpuError::Usage { .. }) && error.to_string().contains("transfer list"), "{error}");
    }
    let other = Gpu::open(&support::options()).expect("a device");
    let foreign = other.transfer_commands("foreign").expect("a command list").submit().expect("submitted");
    let mut transfer = gpu.transfer_commands("waits for a stranger").expect("a command list");
    transfer.fill(&data, 0, 64, 0);
    transfer.wait_for(&foreign);
    let error = transfer.submit().expect_err("a submission of another Gpu");
    assert!(error.to_string().contains("another Gpu"), "{error}");
    assert_eq!(foreign.wait(Duration::from_secs(60)), Ok(true), "done");
    gpu.wait_idle().expect("nothing was submitted");
    assert_eq!(read_words(&data, 16), [0x0707_0707; 16], "untouched");
}
