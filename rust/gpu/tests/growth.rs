// SPDX-License-Identifier: Apache-2.0
//! Many cycles of making and dropping do not grow the process. A program of its own with one test, because it reads the
//! memory of the whole process.

#[path = "all/support.rs"]
#[allow(dead_code, reason = "shared with the other test program, which uses the rest")]
mod support;

use oocpt_gpu::{Buffer, BufferUsage, Gpu, Heap, OpenOptions};

use crate::support::{affine, affine_push};

const MIB: u64 = 1 << 20;

#[test]
fn memory_does_not_grow_over_many_cycles() {
    two_thousand_cycles_do_not_grow();
    devices_open_and_close_without_growth();
}

fn resident_bytes() -> u64 {
    let statm = std::fs::read_to_string("/proc/self/statm").expect("Linux");
    statm.split(' ').nth(1).and_then(|pages| pages.parse::<u64>().ok()).expect("a number of pages") * 4096
}

fn two_thousand_cycles_do_not_grow() {
    // Without the layer: it keeps records of its own.
    let gpu = Gpu::open(&OpenOptions { validation: false, ..support::options() }).expect("a device");
    let pipeline = affine(&gpu, 1);
    let heap = Heap::new(&gpu, "heap", MIB).expect("a heap");
    let cycle = || {
        let buffer = Buffer::new(&gpu, "buffer", 64 << 10, BufferUsage::Device).expect("memory");
        let range = heap.alloc("range", 10_000, 16).expect("memory");
        let mut transfer = gpu.transfer_commands("bring").expect("a command list");
        transfer.update(&range, 0, &[0; 256]);
        let brought = transfer.submit().expect("submitted");
        let mut commands = gpu.commands("cycle").expect("a command list");
        commands.profile(true);
        commands.wait_for(&brought);
        commands.fill(&buffer, 0, 256, 1);
        commands.keep(&range);
        commands.dispatch(&pipeline, &affine_push(buffer.address(), range.address(), 64, 1), [1, 1, 1]);
        commands.submit().expect("submitted")
    };
    // At most 16 in flight: every one more needs a command buffer of its own.
    let run = |cycles: u32| {
        for i in 0..cycles {
            let submission = cycle();
            if i % 16 == 15 {
                support::finish(&submission);
            }
        }
        gpu.wait_idle().expect("the device lives");
    };
    run(200);
    let before = (gpu.memory(), resident_bytes());
    run(2000);
    let after = (gpu.memory(), resident_bytes());
    assert_eq!((after.0.used, after.0.allocations), (before.0.used, before.0.allocations), "device memory grew");
    assert!(after.1 < before.1 + 16 * MIB, "host memory grew from {} to {}", before.1, after.1);
}

fn devices_open_and_close_without_growth() {
    let cycle = || {
        let gpu = Gpu::open(&OpenOptions { validation: false, ..support::options() }).expect("a device");
        let data = Buffer::new(&gpu, "data", 4096, BufferUsage::Device).expect("memory");
        let mut commands = gpu.commands("once").expect("a command list");
        commands.fill(&data, 0, 4096, 1);
        commands.submit().expect("submitted");
    };
    (0..10).for_each(|_| cycle());
    let before = resident_bytes();
    (0..200).for_each(|_| cycle());
    let after = resident_bytes();
    assert!(after < before + 16 * MIB, "grew from {before} to {after}");
}
