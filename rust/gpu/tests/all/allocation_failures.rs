// SPDX-License-Identifier: Apache-2.0
//! Calls that fail for lack of memory, and the budget's books against every byte of `vkAllocateMemory`.

use std::sync::Arc;

use oocpt_gpu::{Buffer, BufferUsage, DriverCall, Gpu, GpuError, Heap, OpenOptions, Pipeline, PlantedFailure};

use crate::support::{self, affine, affine_push, finish};

const MIB: u64 = 1 << 20;

fn small() -> support::TestGpu {
    support::open_with(&OpenOptions { budget_bytes: Some(8 * MIB), ..support::options() })
}

/// Uses every call that takes memory; the words that the device computed.
fn work(gpu: &Arc<Gpu>, heap: &Heap, words: &[u32]) -> Result<Vec<u32>, GpuError> {
    let pipeline = Pipeline::new(gpu, "affine", words, &[(0, 3)], 24)?;
    let range = heap.alloc("range", 256, 16)?;
    let readback = Buffer::new(gpu, "readback", 256, BufferUsage::Readback)?;
    // More lists at a time than were ever made: each needs a pool.
    let spare = (0..3).map(|_| gpu.commands("spare")).collect::<Result<Vec<_>, _>>()?;
    let mut commands = gpu.commands("work")?;
    commands.fill(&range, 0, 256, 5);
    commands.dispatch(&pipeline, &affine_push(range.address(), readback.address(), 64, 1), [1, 1, 1]);
    finish(&commands.submit()?);
    drop(spare);
    Ok(support::read_words(&readback, 64))
}

fn books(gpu: &Gpu) -> u64 {
    let memory = gpu.memory();
    memory.used + memory.host_used
}

#[test]
fn a_planted_failure_strikes_the_request_it_was_meant_for() {
    let gpu = small();
    let heap = Heap::new(&gpu, "heap", MIB).expect("a heap");
    gpu.plant_failure(PlantedFailure { call: DriverCall::Request, after: 2, times: 1 });
    let first = heap.alloc("a", 1000, 16);
    let second = Buffer::new(&gpu, "b", 1000, BufferUsage::Device);
    let third = heap.alloc("c", 1000, 16);
    assert!(first.is_ok() && second.is_ok(), "before the failure");
    assert!(matches!(third, Err(GpuError::OutOfMemory { .. })), "{third:?}");
    assert!(heap.alloc("d", 1000, 16).is_ok(), "after it");
    assert_eq!(gpu.failures_struck(), 1, "it struck once");
}

/// Whatever call fails, once or twice in a row: an error for lack of memory, nothing is held that was not held before,
/// and the same work is done by the next try.
#[test]
fn every_allocating_call_survives_out_of_memory() {
    let words = support::compile(support::AFFINE);
    let calls = [
        DriverCall::Buffer,
        DriverCall::Range,
        DriverCall::Memory,
        DriverCall::Mapping,
        DriverCall::Pipeline,
        DriverCall::CommandPool,
    ];
    for (call, times) in calls.into_iter().flat_map(|call| [(call, 1), (call, 2), (call, 100)]) {
        let gpu = support::open();
        let heap = Heap::new(&gpu, "heap", MIB).expect("a heap");
        let before = (books(&gpu), gpu.driver_memory().held);
        // Arenas are mapped where device memory is the host's.
        let is_asked_again = call == DriverCall::Memory || call == DriverCall::Mapping && gpu.has_host_memory();
        gpu.plant_failure(PlantedFailure { call, after: 0, times });
        let mut errors = 0;
        while gpu.failures_struck() < u64::from(times) {
            match work(&gpu, &heap, &words) {
                Err(GpuError::OutOfMemory { .. }) => errors += 1,
                // What the driver refuses once is asked for again, and arenas may be smaller.
                Ok(words) => assert!(is_asked_again && words == [16; 64], "{call:?}, {times}: {words:?}"),
                Err(error) => panic!("{call:?}, {times} times: {error}"),
            }
            heap.trim();
            assert_eq!((books(&gpu), gpu.driver_memory().held), before, "{call:?}, {times} times: something is held");
        }
        assert!(errors == times || (is_asked_again && (errors > 0 || times < 100)), "{call:?}: {errors} of {times}");
        assert_eq!(work(&gpu, &heap, &words).expect("as if nothing had been"), [16; 64], "{call:?}, {times} times");
    }
}

/// The books of the budget against the driver's own function, on any device: what is on the books is what is held, to
/// the byte, and the driver never gave more than was on the books.
#[test]
fn the_budget_counts_every_byte_of_vk_allocate_memory() {
    let gpu = small();
    let opened = gpu.driver_memory();
    assert_eq!(opened.held, books(&gpu), "after opening");
    let heap = Heap::new(&gpu, "heap", MIB).expect("a heap");
    std::thread::scope(|scope| {
        for thread in 0..4_u64 {
            let (gpu, heap) = (&gpu, &heap);
            scope.spawn(move || {
                let mut kept = Vec::new();
                for i in 0..60 {
                    let bytes = 1 + (thread * 7919 + i * 104_729) % 300_000;
                    let usage = [BufferUsage::Device, BufferUsage::Upload, BufferUsage::Readback]
                        [usize::try_from(i % 3).expect("small")];
                    kept.push((Buffer::new(gpu, "buffer", bytes, usage).ok(), heap.alloc("range", bytes, 16).ok()));
                    if i % 40 == 39 {
                        kept.clear();
                    }
                }
            });
        }
    });
    heap.trim();
    let (driver, memory) = (gpu.driver_memory(), gpu.memory());
    assert!(driver.calls > opened.calls + 100, "memory came and went: {driver:?}");
    assert!(driver.peak <= gpu.most_on_the_books(), "more than on the books: {driver:?}, {memory:?}");
    assert!(memory.peak <= memory.budget && memory.peak > memory.budget / 2, "the budget was put to use: {memory:?}");
    assert_eq!(driver.held, memory.used + memory.host_used, "to the byte: {driver:?}, {memory:?}");
    let pipeline = affine(&gpu, 2);
    let held = Buffer::new(&gpu, "odd", 12_345, BufferUsage::Device).expect("memory");
    assert_eq!(gpu.driver_memory().held, books(&gpu), "with a buffer of an odd size");
    drop((held, pipeline));
    assert_eq!(gpu.driver_memory().held, books(&gpu), "and without it");
}
