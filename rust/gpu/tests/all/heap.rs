// SPDX-License-Identifier: Apache-2.0
//! Heaps: ranges do not overlap, space comes back, statistics tell the truth.

use oocpt_gpu::{
    Buffer, BufferUsage, DeviceRange, DriverCall, GpuError, Heap, HeapOptions, HeapRange, OpenOptions, PlantedFailure,
};

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
fn a_reserved_arena_serves_requests_above_the_usual_size() {
    const MIB: u64 = 1 << 20;
    let gpu = support::open();
    let heap = Heap::new(&gpu, "heap", MIB).expect("a heap");
    let small = heap.alloc("small", 4096, 16).expect("fits");
    assert_eq!(heap.reserve(8 * MIB).expect("alive"), 8 * MIB);
    let large = [3 * MIB, 2 * MIB].map(|bytes| heap.alloc("large", bytes, 16).expect("fits"));
    let stats = heap.stats();
    assert_eq!((stats.arenas, stats.arena_bytes, stats.dedicated_bytes), (2, 9 * MIB, 0), "{stats:?}");
    assert_eq!(stats.used_bytes, 5 * MIB + 4096, "{stats:?}");
    let larger = heap.alloc("more than half", 4 * MIB + 1, 16).expect("fits");
    assert!(heap.stats().dedicated_bytes > 4 * MIB, "memory of its own: {:?}", heap.stats());
    drop((small, large, larger));
    heap.trim();
    assert_eq!((heap.stats().arenas, gpu.memory().used), (0, 0), "it goes back as any other");
}

/// Arenas change places when empty ones are trimmed.
#[test]
fn a_reserved_arena_serves_large_ranges_wherever_it_is_listed() {
    const MIB: u64 = 1 << 20;
    let gpu = support::open();
    let heap = Heap::new(&gpu, "heap", MIB).expect("a heap");
    assert_eq!(heap.reserve(8 * MIB).expect("alive"), 8 * MIB);
    let all = [4 * MIB, 4 * MIB - 4096].map(|bytes| heap.alloc("large", bytes, 16).expect("fits"));
    let small = heap.alloc("small", MIB / 2, 16).expect("in an arena of its own");
    assert_eq!((heap.stats().arenas, heap.stats().dedicated_bytes), (2, 0));
    drop(all);
    // The reserved one is empty now and goes behind the other.
    drop(heap.alloc("short", 4096, 16).expect("fits"));
    let large = heap.alloc("large", 3 * MIB, 16).expect("fits");
    assert_eq!((heap.stats().arenas, heap.stats().dedicated_bytes), (2, 0), "{:?}", heap.stats());
    drop((small, large));
}

#[test]
fn no_more_is_reserved_than_there_is() {
    const MIB: u64 = 1 << 20;
    let gpu = support::open();
    let options = HeapOptions { arena_bytes: MIB, limit_bytes: Some(5 * MIB), ..HeapOptions::default() };
    let heap = Heap::with_options(&gpu, "limited", options).expect("a heap");
    let first = heap.reserve(8 * MIB).expect("alive");
    assert!((4 * MIB..=5 * MIB).contains(&first), "within an eighth of the limit: {first}");
    assert_eq!(heap.stats().arena_bytes, first);
    let _small = heap.alloc("small", 4096, 16).expect("an arena that is used stays");
    let rest = heap.reserve(8 * MIB).expect("alive");
    assert!(first + rest <= 5 * MIB, "{first} and {rest}");
    heap.set_limit(Some(0));
    assert_eq!(heap.reserve(MIB).expect("alive"), 0, "there is none");
}

/// Memory of the host that the device reaches: the budget does not count it, and what is made ahead stays.
#[test]
fn a_heap_of_host_memory_keeps_its_arenas() {
    const MIB: u64 = 1 << 20;
    let gpu = support::open();
    let before = gpu.memory();
    let options = HeapOptions { usage: BufferUsage::Shared, keeps_arenas: true, ..HeapOptions::default() };
    let heap = Heap::with_options(&gpu, "host", options).expect("a heap");
    for _ in 0..3 {
        assert_eq!(heap.reserve(2 * MIB).expect("alive"), 2 * MIB);
    }
    let memory = gpu.memory();
    assert_eq!((memory.used, memory.peak), (before.used, before.peak), "the device's budget");
    assert!(memory.host_used >= before.host_used + 6 * MIB, "{memory:?}");
    for _ in 0..2 {
        drop(heap.alloc("short", 4096, 16).expect("fits"));
        assert_eq!(heap.stats().arenas, 3, "{:?}", heap.stats());
    }
    heap.trim();
    assert_eq!(heap.stats().arenas, 0, "{:?}", heap.stats());
}

/// The host fills ranges of host memory, each its own; the device sees the bytes.
#[test]
fn the_device_reads_what_the_host_fills() {
    let gpu = support::open();
    for arena_bytes in [64 << 10, 64 << 20] {
        let options = HeapOptions { usage: BufferUsage::Shared, arena_bytes, ..HeapOptions::default() };
        let heap = Heap::with_options(&gpu, "host", options).expect("a heap");
        let words = |seed: u32| -> Vec<u8> { (0..9000_u32).flat_map(|i| (i ^ seed).to_le_bytes()).collect() };
        let ranges = [1, 2, 3].map(|seed| {
            let (range, bytes) = (heap.alloc("range", 36_000, 4096).expect("fits"), words(seed));
            for (first, part) in [(20_000, &bytes[20_000..]), (0, &bytes[..20_000])] {
                let copy = &mut |out: &mut [u8]| out.copy_from_slice(part);
                assert_eq!(range.fill(first, part.len(), copy), Ok(true));
            }
            (range, bytes)
        });
        for (range, bytes) in &ranges {
            let readback = Buffer::new(&gpu, "readback", 36_000, BufferUsage::Readback).expect("memory");
            let mut commands = gpu.commands("copy").expect("commands");
            commands.copy(range, 0, &readback, 0, 36_000);
            finish(&commands.submit().expect("submitted"));
            assert!(readback.map(|seen| seen == &bytes[..]).expect("mapped"), "arenas of {arena_bytes}");
        }
        let (range, _) = &ranges[0];
        for (offset, count) in [(35_999, 2), (36_001, 0), (u64::MAX, 1)] {
            let refused = range.fill(offset, count, &mut |_| unreachable!("it does not fit"));
            assert!(matches!(refused, Err(GpuError::Usage { .. })), "{count} at {offset}: {refused:?}");
        }
        drop(ranges);
    }
    let device = Heap::new(&gpu, "device", 1 << 20).expect("a heap");
    let range = device.alloc("range", 64, 16).expect("fits");
    assert_eq!(range.fill(0, 64, &mut |_| unreachable!("the host does not reach it")), Ok(false));
}

#[test]
fn a_whole_arena_can_be_one_range() {
    const MIB: u64 = 1 << 20;
    let gpu = support::open();
    // 3.3 MiB is no size class.
    let options = HeapOptions { arena_bytes: 33 * MIB / 10, whole_arenas: true, ..HeapOptions::default() };
    let heap = Heap::with_options(&gpu, "heap", options).expect("a heap");
    let whole = heap.largest_shared();
    assert!((29 * MIB / 10..=33 * MIB / 10).contains(&whole), "an eighth at most is lost: {whole}");
    for _ in 0..3 {
        let first = heap.try_alloc("first", whole, 256).expect("alive").expect("fits");
        let stats = heap.stats();
        assert_eq!((stats.arenas, stats.used_bytes, stats.dedicated_bytes), (1, whole, 0), "{stats:?}");
        let second = heap.alloc("second", whole - 100_000, 16).expect("fits");
        assert_eq!((heap.stats().arenas, heap.stats().dedicated_bytes), (2, 0), "one each: {:?}", heap.stats());
        drop((first, second));
        assert_eq!(heap.stats().arenas, 1, "one is kept");
    }
    let large = heap.alloc("large", whole + 1, 16).expect("fits");
    assert!(heap.stats().dedicated_bytes > whole, "memory of its own: {:?}", heap.stats());
    drop(large);
}

#[test]
fn a_heap_stays_within_its_own_limit() {
    let gpu = support::open();
    let options = HeapOptions { arena_bytes: 1 << 20, limit_bytes: Some(3 << 20), ..HeapOptions::default() };
    let (heap, other) = (Heap::with_options(&gpu, "limited", options), Heap::new(&gpu, "other", 1 << 20));
    let (heap, other) = (heap.expect("a heap"), other.expect("a heap"));
    let held = || heap.stats().arena_bytes + heap.stats().dedicated_bytes;
    let mut ranges = vec![heap.alloc("large", 1_500_000, 16).expect("fits")];
    while let Some(range) = heap.try_alloc("piece", 50_000, 16).expect("alive") {
        ranges.push(range);
        assert!(held() <= 3 << 20, "{:?}", heap.stats());
    }
    assert!(ranges.len() > 27, "{} ranges in 3 MiB: {:?}", ranges.len(), heap.stats());
    let error = heap.alloc("piece", 50_000, 16).expect_err("full");
    assert!(matches!(error, GpuError::OutOfMemory { budget, .. } if budget == 3 << 20), "{error}");
    assert!(other.alloc("elsewhere", 1 << 20, 16).is_ok(), "the device has room");
    heap.set_limit(Some(4 << 20));
    let more = heap.alloc("more", 900_000, 16).expect("fits now");
    heap.set_limit(Some(1 << 20));
    drop((ranges, more));
    heap.trim();
    assert!(heap.try_alloc("too large", 1_100_000, 16).expect("alive").is_none(), "above the new limit");
    assert!(heap.try_alloc("small", 1000, 16).expect("alive").is_some(), "below it");
}

#[test]
fn try_alloc_refuses_when_free_space_is_fragmented() {
    let gpu = support::open_with(&OpenOptions { budget_bytes: Some(1 << 20), ..support::options() });
    let heap = Heap::new(&gpu, "heap", 1 << 20).expect("a heap");
    let take = |bytes| heap.try_alloc("piece", bytes, 16).expect("alive");
    let mut ranges: Vec<_> = (0..16).map(|_| take(64 << 10)).collect();
    assert!(ranges.iter().all(Option::is_some) && take(1).is_none(), "exactly full: {:?}", heap.stats());
    ranges.iter_mut().step_by(2).for_each(|range| *range = None);
    let stats = heap.stats();
    assert_eq!((stats.live_bytes, stats.retired_bytes, stats.used_bytes), (512 << 10, 0, 512 << 10), "{stats:?}");
    assert!(take(65 << 10).is_none(), "half is free, but in pieces");
    assert!(take(64 << 10).is_some(), "a piece");
    drop(ranges);
    assert!(take(512 << 10).is_some(), "half of it in one");
}

#[test]
fn a_planted_failure_makes_a_try_fail() {
    let gpu = support::open();
    let heap = Heap::new(&gpu, "heap", 1 << 20).expect("a heap");
    gpu.plant_failure(PlantedFailure { call: DriverCall::Range, after: 1, times: 1 });
    let tries: Vec<_> = (0..3).map(|_| heap.try_alloc("a", 1000, 16).expect("alive").is_some()).collect();
    assert_eq!(tries, [true, false, true], "the second fails");
    assert!(matches!(heap.try_alloc("odd", 64, 3), Err(GpuError::Usage { .. })), "a mistake stays an error");
    let huge = heap.try_alloc("huge", u64::MAX - 100, 16);
    assert!(matches!(huge, Err(GpuError::TooLarge { .. })), "what can never fit is an error: {huge:?}");
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
    let readback = Buffer::new(&gpu, "readback", 64, BufferUsage::Readback).expect("memory");
    let mut commands = gpu.commands("after the heap").expect("a command list");
    commands.fill(&range, 0, 64, 5);
    commands.copy(&range, 0, &readback, 0, 64);
    finish(&commands.submit().expect("submitted"));
    assert_eq!(read_words(&readback, 16), [5; 16], "still valid");
    drop(range);
    assert_eq!(gpu.memory().used, 0, "the arena went with its last range");
}
