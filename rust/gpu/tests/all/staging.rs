// SPDX-License-Identifier: Apache-2.0
//! The staging ring: bytes arrive complete, space is reused, no thread waits for ever.

use std::sync::mpsc;
use std::time::Duration;

use oocpt_gpu::{Buffer, BufferUsage, GpuError, Heap, StagingRing, StagingSlice};

use crate::support::{self, finish};

/// Pseudorandom numbers below a bound.
fn random(seed: u64) -> impl FnMut(u64) -> u64 {
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    move |below| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) % below
    }
}

/// Byte `i` of a piece.
fn pattern(piece: u64, i: usize) -> u8 {
    let mixed = (piece ^ (i as u64 >> 3)).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    mixed.to_le_bytes()[i & 7]
}

#[test]
fn bytes_of_many_threads_arrive_whole() {
    const MAX_BYTES: u64 = 100_000;
    let gpu = support::open();
    let before = gpu.memory();
    let ring = StagingRing::new(&gpu, 256 << 10).expect("a ring");
    let heap = Heap::new(&gpu, "heap", 8 << 20).expect("a heap");
    std::thread::scope(|scope| {
        for thread in 0..8_u64 {
            let (gpu, ring, heap) = (&*gpu, &ring, &heap);
            scope.spawn(move || {
                let mut next = random(thread);
                let readback = Buffer::new(gpu, "readback", MAX_BYTES, BufferUsage::Readback).expect("memory");
                for round in 0..40 {
                    let (bytes, align) = (4 * (1 + next(MAX_BYTES / 4)), 4 << next(8));
                    let piece = thread * 1000 + round;
                    let range = heap.alloc("range", bytes, 16).expect("memory");
                    let mut slice = ring.reserve(bytes, align).expect("space");
                    slice.bytes_mut().iter_mut().enumerate().for_each(|(i, byte)| *byte = pattern(piece, i));
                    // In two copies, some on the main queue.
                    let lists = [gpu.transfer_commands("bring"), gpu.commands("bring")];
                    let [transfer, main] = lists.map(|list| list.expect("a command list"));
                    let mut commands = if next(4) == 0 { main } else { transfer };
                    let half = bytes / 8 * 4;
                    // Something that takes a while before the bytes are read.
                    commands.fill(&range, 0, bytes, 0);
                    slice.copy_to(&mut commands, 0, &range, 0, half);
                    slice.copy_to(&mut commands, half, &range, half, bytes - half);
                    let brought = commands.submit().expect("submitted");
                    drop(slice);
                    let mut commands = gpu.commands("look").expect("a command list");
                    commands.wait_for(&brought);
                    commands.copy(&range, 0, &readback, 0, bytes);
                    finish(&commands.submit().expect("submitted"));
                    let mut arrived = vec![0; usize::try_from(bytes).expect("small")];
                    readback.read(0, &mut arrived).expect("fits");
                    let wrong = arrived.iter().enumerate().find(|&(i, &byte)| byte != pattern(piece, i));
                    assert!(wrong.is_none(), "piece {piece} of {bytes} bytes: {wrong:?} is not its own");
                }
            });
        }
    });
    gpu.wait_idle().expect("alive");
    assert_eq!((ring.used(), heap.stats().used_bytes), (0, 0), "all space came back");
    drop((ring, heap));
    let after = gpu.memory();
    assert_eq!((after.used, after.host_used), (before.used, before.host_used), "all memory too");
}

#[test]
fn unused_space_comes_back_at_once() {
    let gpu = support::open();
    let ring = StagingRing::new(&gpu, 1000).expect("a ring");
    let target = Buffer::new(&gpu, "target", 1000, BufferUsage::Device).expect("memory");
    for _ in 0..10 {
        let slice = ring.try_reserve(1000, 256).expect("alive").expect("all is free");
        assert!(ring.try_reserve(1, 1).expect("alive").is_none(), "full");
        drop(slice);
        let slice = ring.try_reserve(1000, 1).expect("alive").expect("free again");
        let mut commands = gpu.transfer_commands("discarded").expect("a command list");
        slice.copy_to(&mut commands, 0, &target, 0, 1000);
        drop(slice);
        assert_eq!(ring.used(), 1000, "the list holds it");
        drop(commands);
        assert_eq!(ring.used(), 0, "a discarded list does not");
    }
    let empty = ring.reserve(0, 1).expect("nothing is not much").bytes_mut().len();
    assert_eq!(empty, 0, "as asked for");
}

#[test]
fn a_waiting_thread_gets_space_another_frees() {
    let gpu = support::open();
    let ring = StagingRing::new(&gpu, 1000).expect("a ring");
    let first = ring.reserve(600, 1).expect("free");
    let (tell, told) = mpsc::channel();
    std::thread::scope(|scope| {
        let ring = &ring;
        scope.spawn(move || {
            let mut whole = ring.reserve(1000, 1).expect("free in the end");
            tell.send(whole.bytes_mut().len()).expect("the test listens");
        });
        // Others may take the rest until the large request waits; then they must not, or it would wait for ever.
        let mut tries = 0;
        while ring.try_reserve(100, 1).expect("alive").is_some() {
            tries += 1;
            assert!(tries < 30_000, "small requests overtake the large one");
            std::thread::sleep(Duration::from_millis(1));
        }
        assert!(told.try_recv().is_err(), "600 bytes are still held");
        drop(first);
        assert_eq!(told.recv_timeout(Duration::from_secs(60)), Ok(1000), "served");
    });
    assert_eq!(ring.used(), 0, "all came back");
}

#[test]
fn slices_cross_threads_and_outlive_the_ring() {
    fn sent<T: Send>(value: T) -> T {
        value
    }
    let gpu = support::open();
    let ring = StagingRing::new(&gpu, 64).expect("a ring");
    let mut slice: StagingSlice = sent(ring.reserve(64, 4).expect("free"));
    drop(ring);
    slice.bytes_mut().fill(5);
    let readback = Buffer::new(&gpu, "readback", 64, BufferUsage::Readback).expect("memory");
    let mut commands = gpu.transfer_commands("late").expect("a command list");
    slice.copy_to(&mut commands, 0, &readback, 0, 64);
    drop(slice);
    finish(&commands.submit().expect("submitted"));
    assert_eq!(support::read_words(&readback, 16), [0x0505_0505; 16], "still valid");
}

#[test]
fn wrong_requests_are_refused() {
    let gpu = support::open();
    let ring = StagingRing::new(&gpu, 1000).expect("a ring");
    for (bytes, align) in [(1001, 1), (u64::MAX, 1), (10, 0), (10, 3)] {
        let [waits, tries] = [ring.reserve(bytes, align), ring.try_reserve(bytes, align).map(|_| unreachable!())];
        for error in [waits.expect_err("refused"), tries.expect_err("refused")] {
            assert!(matches!(error, GpuError::Usage { .. }), "{bytes} bytes, align {align}: {error}");
        }
    }
    assert!(matches!(StagingRing::new(&gpu, 0), Err(GpuError::Usage { .. })), "an empty ring");
    let slice = ring.reserve(8, 4).expect("free");
    let target = Buffer::new(&gpu, "target", 64, BufferUsage::Device).expect("memory");
    let mut commands = gpu.transfer_commands("outside").expect("a command list");
    slice.copy_to(&mut commands, 4, &target, 0, 8);
    let error = commands.submit().expect_err("outside of the slice, though inside of the ring");
    assert!(error.to_string().contains("8 bytes at 4 do not fit in 8 bytes"), "{error}");
}
