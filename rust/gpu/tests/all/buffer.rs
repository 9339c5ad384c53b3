// SPDX-License-Identifier: Apache-2.0
//! Buffers: what goes in comes out, and nothing goes outside.

use oocpt_gpu::{Buffer, BufferUsage, DeviceRange, GpuError, Heap};

use crate::support::{self, bytes, finish, read_words};

#[test]
fn bytes_make_the_round_trip() {
    let gpu = support::open();
    let words: Vec<u32> = (0..1000).map(|i| i * 7 + 1).collect();
    let upload = Buffer::new(&gpu, "upload", 4000, BufferUsage::Upload).expect("memory");
    let device = Buffer::new(&gpu, "device", 4000, BufferUsage::Device).expect("memory");
    let heap = Heap::new(&gpu, "heap", 1 << 20).expect("a heap");
    let first = heap.alloc("before", 1000, 4).expect("memory");
    let range = heap.alloc("range", 4000, 4).expect("memory");
    let readback = Buffer::new(&gpu, "readback", 4000, BufferUsage::Readback).expect("memory");
    upload.write(0, &bytes(&words)).expect("fits");
    let mut commands = gpu.commands("round trip").expect("a command list");
    commands.fill(&first, 0, 1000, 0xDEAD_BEEF);
    commands.copy(&upload, 0, &device, 0, 4000);
    commands.copy(&device, 0, &range, 0, 4000);
    commands.update(&range, 8, &bytes(&[11, 22]));
    commands.fill(&range, 3996, 4, 99);
    commands.copy(&range, 0, &readback, 0, 4000);
    finish(&commands.submit().expect("submitted"));
    let mut expected = words;
    (expected[2], expected[3], expected[999]) = (11, 22, 99);
    assert_eq!(read_words(&readback, 1000), expected, "upload, buffer, heap range, readback");
}

/// So that tests see what relies on drivers that clear memory.
#[test]
fn new_memory_is_poisoned() {
    let gpu = support::open();
    let readback = Buffer::new(&gpu, "readback", 4000, BufferUsage::Readback).expect("memory");
    assert_eq!(read_words(&readback, 1000), [0xCDCD_CDCD; 1000]);
}

#[test]
fn mapped_bytes_can_be_filled_in_place() {
    let gpu = support::open();
    let upload = Buffer::new(&gpu, "upload", 256, BufferUsage::Upload).expect("memory");
    let length = upload.map(|mapped| {
        mapped.chunks_mut(64).zip(1_u8..).for_each(|(part, value)| part.fill(value));
        mapped.len()
    });
    assert_eq!(length, Ok(256), "all bytes are lent");
    let mut part = [0; 4];
    upload.read(126, &mut part).expect("fits");
    assert_eq!(part, [2, 2, 3, 3], "each chunk where it belongs");
}

#[test]
fn empty_buffers_have_an_address() {
    let gpu = support::open();
    let empty = Buffer::new(&gpu, "empty", 0, BufferUsage::Device).expect("memory");
    assert!(empty.address() != 0 && empty.address().is_multiple_of(16), "{:#x}", empty.address());
    assert_eq!(DeviceRange::size(&empty), 0, "the size asked for");
}

#[test]
fn access_outside_is_refused() {
    let gpu = support::open();
    let buffer = Buffer::new(&gpu, "small", 16, BufferUsage::Upload).expect("memory");
    let device = Buffer::new(&gpu, "hidden", 16, BufferUsage::Device).expect("memory");
    assert!(buffer.write(0, &[0; 16]).is_ok(), "exactly full");
    for offset in [1, 17, u64::MAX] {
        let error = buffer.write(offset, &[0; 16]);
        assert!(matches!(error, Err(GpuError::Usage { .. })), "write at {offset}: {error:?}");
        let error = buffer.read(offset, &mut [0; 16]);
        assert!(matches!(error, Err(GpuError::Usage { .. })), "read at {offset}: {error:?}");
    }
    let error = device.write(0, &[0; 4]).expect_err("not mapped");
    assert!(error.to_string().contains("hidden: a Device buffer is not mapped"), "{error}");
}

#[test]
fn an_oversized_allocation_differs_from_a_full_budget() {
    let gpu = support::open();
    let limit = gpu.limits().max_allocation_bytes;
    for bytes in [limit + 1, u64::MAX] {
        let error = Buffer::new(&gpu, "huge", bytes, BufferUsage::Device).expect_err("too large");
        assert_eq!(error, GpuError::TooLarge { name: "huge".into(), bytes, limit }, "not OutOfMemory");
    }
}
