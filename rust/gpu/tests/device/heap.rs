// SPDX-License-Identifier: Apache-2.0
//! Heaps: ranges do not overlap, space comes back, statistics tell the truth.

use oocpt_gpu::{Buffer, GpuError, Heap, HeapRange, Usage};

use crate::support::{self, finish, read_words};

#[test]
fn ranges_are_aligned_and_apart() {
    let gpu = support::open();
    let heap = Heap::new(&gpu, "heap", 4 << 20).expect("a heap");
    let mut ranges: Vec<HeapRange> = Vec::new();
    for i in 0..200_u64 {
        let (bytes, align) = (i * 37 % 5000, 1 << (i % 14));
        let range = heap.alloc("range", bytes, align).expect("fits");
        assert!(range.address().is_multiple_of(align) && range.size() == bytes, "{range:?} for {bytes}, {align}");
        ranges.push(range);
    }
    let mut spans: Vec<_> = ranges.iter().map(|r| (r.address(), r.address() + r.size().max(1))).collect();
    spans.sort_unstable();
    assert!(spans.windows(2).all(|pair| pair[0].1 <= pair[1].0), "ranges overlap");
}

#[test]
fn freed_space_is_found_again_and_fragmentation_is_seen() {
    let gpu = support::open();
    let heap = Heap::new(&gpu, "heap", 1 << 20).expect("a heap");
    let mut ranges: Vec<_> = (0..256).map(|_| Some(heap.alloc("piece", 4096, 16).expect("fits"))).collect();
    let full = heap.stats();
    assert_eq!((full.arenas, full.used_bytes, full.arena_bytes), (1, 1 << 20, 1 << 20), "{full:?}");
    ranges.iter_mut().step_by(2).for_each(|range| *range = None);
    let holes = heap.stats();
    assert_eq!(holes.used_bytes, 512 << 10, "{holes:?}");
    assert!(holes.fragmentation > 0.9, "128 holes of 4 KiB: {holes:?}");
    let refilled: Vec<_> = (0..128).map(|_| heap.alloc("again", 4096, 16).expect("fits")).collect();
    assert_eq!(heap.stats().arenas, 1, "the holes were used: {:?}", heap.stats());
    drop((ranges, refilled));
    let empty = heap.stats();
    assert_eq!((empty.used_bytes, empty.arenas), (0, 1), "one arena is kept");
    assert!(empty.fragmentation < 1e-9, "free space is in one piece again: {empty:?}");
}

#[test]
fn large_requests_have_memory_of_their_own() {
    let gpu = support::open();
    let heap = Heap::new(&gpu, "heap", 1 << 20).expect("a heap");
    let large = heap.alloc("large", 3 << 20, 4096).expect("fits");
    assert_eq!(large.address() % 4096, 0, "aligned");
    let stats = heap.stats();
    assert!(stats.arenas == 0 && stats.dedicated_bytes >= 3 << 20, "{stats:?}");
    drop(large);
    assert_eq!((heap.stats().dedicated_bytes, gpu.memory().used), (0, 0), "given back at once");
}

#[test]
fn a_bad_alignment_is_refused() {
    let gpu = support::open();
    let heap = Heap::new(&gpu, "heap", 1 << 20).expect("a heap");
    for align in [0, 3, 48] {
        assert!(matches!(heap.alloc("odd", 64, align), Err(GpuError::Usage { .. })), "alignment {align}");
    }
}

#[test]
fn ranges_outlive_their_heap() {
    let gpu = support::open();
    let heap = Heap::new(&gpu, "heap", 1 << 20).expect("a heap");
    let range = heap.alloc("survivor", 64, 16).expect("fits");
    drop(heap);
    let readback = Buffer::new(&gpu, "readback", 64, Usage::Readback).expect("memory");
    let mut commands = gpu.commands("after the heap").expect("a command list");
    commands.fill(&range, 0, 64, 5);
    commands.copy(&range, 0, &readback, 0, 64);
    finish(&commands.submit().expect("submitted"));
    assert_eq!(read_words(&readback, 16), [5; 16], "still valid");
    drop(range);
    assert_eq!(gpu.memory().used, 0, "the arena went with its last range");
}
