// SPDX-License-Identifier: Apache-2.0
//! Work of the host inside a command list, and device memory as the host sees it. On a device with memory of its own
//! there is no view, and that is what is tested.

use std::time::Duration;

use oocpt_gpu::{Buffer, BufferUsage, Gpu, GpuError, Heap, HostSpan, HostView};

use crate::support::{self, LONG, affine, affine_push, finish, read_words, spin, spin_push};

const TIMEOUT: Duration = Duration::from_secs(60);

/// A view, or none where the device says that there is none.
fn view(gpu: &Gpu, written: &[&Buffer]) -> Option<HostView> {
    let view = gpu.host_view(written);
    assert_eq!(view.is_some(), gpu.has_host_memory(), "as the device says");
    view
}

#[test]
fn host_work_is_ordered_between_device_commands() {
    let gpu = support::open();
    let pipeline = affine(&gpu, 3);
    let data = Buffer::new(&gpu, "data", 256, BufferUsage::Readback).expect("memory");
    let (slow, spinner) = (Buffer::new(&gpu, "slow", 16, BufferUsage::Readback).expect("memory"), spin(&gpu));
    slow.write(0, &[0; 16]).expect("fits");
    let mut commands = gpu.commands("list").expect("a command list");
    commands.dispatch(&spinner, &spin_push(slow.address(), LONG), [1, 1, 1]);
    commands.fill(&data, 0, 256, 1);
    commands.dispatch(&pipeline, &affine_push(data.address(), data.address(), 64, 1), [1, 1, 1]);
    commands.profile(true); // from here on: reading times would wait by itself
    commands.host("in between", TIMEOUT, || {
        assert_ne!(read_words(&slow, 1), [0], "it waits, however long it takes");
        assert_eq!(read_words(&data, 64), vec![4; 64], "3 x 1 + 1 is there");
        data.write(0, bytemuck::cast_slice(&[10_u32; 64]))
    });
    commands.dispatch(&pipeline, &affine_push(data.address(), data.address(), 64, 2), [1, 1, 1]);
    let submission = commands.submit().expect("submitted");
    finish(&submission);
    assert_eq!(read_words(&data, 64), vec![32; 64], "3 x 10 + 2");
    let names: Vec<String> = submission.timings().into_iter().map(|(name, _)| name).collect();
    assert!(names.iter().any(|name| name == "in between"), "{names:?}");
}

#[test]
fn an_error_of_host_work_fails_the_command_list() {
    let gpu = support::open();
    let data = Buffer::new(&gpu, "data", 256, BufferUsage::Readback).expect("memory");
    data.write(0, &[0; 256]).expect("fits");
    let mut commands = gpu.commands("list").expect("a command list");
    commands.host("fails", TIMEOUT, || Err(GpuError::Usage { name: "it".into(), message: "went wrong".into() }));
    commands.host("never", TIMEOUT, || panic!("nothing runs after an error"));
    commands.fill(&data, 0, 256, 1);
    let error = commands.submit().expect_err("the error is kept");
    assert_eq!(error.to_string(), "it: went wrong");
    assert_eq!(read_words(&data, 64), vec![0; 64], "what came after it did not run");
}

#[test]
fn a_view_reads_and_writes_inside_of_buffers_only() {
    let gpu = support::open();
    let read = Buffer::new(&gpu, "read", 64, BufferUsage::Device).expect("memory");
    let written = Buffer::new(&gpu, "written", 64, BufferUsage::Device).expect("memory");
    let more = Buffer::new(&gpu, "more", 64, BufferUsage::Device).expect("memory");
    let mut commands = gpu.commands("fill").expect("a command list");
    commands.fill(&read, 0, 64, 7);
    commands.fill(&more, 0, 64, 0x0403_0201);
    commands.fill(&written, 0, 64, 0);
    finish(&commands.submit().expect("submitted"));
    let Some(view) = view(&gpu, &[&written]) else { return };
    let bytes = view.bytes(read.address() + 16);
    assert_eq!((bytes.get::<[u32; 4]>(2), bytes.get::<[u32; 4]>(3)), (Some([7; 4]), None), "48 bytes are left");
    assert_eq!((bytes.get::<u32>(11), bytes.get::<u32>(12)), (Some(7), None), "to the last word");
    assert_eq!(bytes.get::<u32>(usize::MAX), None, "no index wraps");
    assert_eq!(bytes.get::<[u32; 4]>(usize::MAX / 16 + 1), None, "nor does a product");
    assert_eq!((bytes.item::<[u32; 4]>(2), bytes.item::<[u32; 4]>(3)), (Some([7; 4]), None), "as by `get`");
    assert_eq!((bytes.item::<u32>(12), bytes.item::<[u32; 4]>(u32::MAX)), (None, None), "nothing behind the end");
    let mut near = HostSpan::NONE;
    let (first, other) = (read.address(), more.address());
    for address in [first + 16, first, 0, first + 60, other, other + 8, u64::MAX, first + 63, other + 63, other + 64] {
        let (found, expected) = (view.bytes_near(address, &mut near), view.bytes(address));
        assert_eq!((found.at_byte::<u8>(0), found.is_empty()), (expected.at_byte::<u8>(0), expected.is_empty()));
        for at in [1, 3, 4, 47, 48, 63, 64] {
            assert_eq!(found.at_byte::<u8>(at), expected.at_byte(at), "byte {at} from {address:#x}");
        }
    }
    let behind = read.address() + 64;
    assert_eq!(view.bytes_near(behind, &mut near).is_empty(), view.bytes(behind).is_empty(), "the buffer has ended");
    assert!(view.bytes_near(written.address(), &mut near).is_empty(), "what is written is not read here either");
    assert!(!view.bytes_near(read.address(), &mut near).is_empty(), "and is not remembered");
    for (index, count) in [(usize::MAX, 1), (0, usize::MAX), (5, 2), (0, 6), (0, 0)] {
        bytes.prefetch::<u64>(index, count);
    }
    for nowhere in [0, 1, read.address().wrapping_sub(1 << 46), u64::MAX] {
        assert!(view.bytes(nowhere).is_empty() && view.words(nowhere).add(0, 1).is_none(), "{nowhere:#x}");
    }
    assert!(view.bytes(written.address()).is_empty(), "what is written is not read as bytes");
    assert!(!view.words(read.address()).store(0, 1), "what is read is not written");
    let words = view.words(written.address() + 4);
    assert!(words.store(14, 5) && !words.store(15, 5), "15 words are left");
    assert_eq!((words.add(14, 2), words.or(14, 8), words.load(14)), (Some(5), Some(7), 15), "one after the other");
    assert_eq!((words.load(15), words.add(usize::MAX, 1)), (0, None), "nothing is there");
    assert_eq!((words.load_all(13), words.load_all(14)), ([0, 15], [0, 0]), "all of them or none");
    assert_eq!(words.load_all::<2>(usize::MAX), [0, 0], "no index wraps");
    for (index, count) in [(usize::MAX, 1), (0, usize::MAX), (14, 1), (14, 2), (0, 0)] {
        words.prefetch(index, count);
    }
    assert!(view.words(written.address() + 2).add(0, 1).is_none(), "words are aligned");
}

#[test]
fn buffers_stay_alive_while_a_host_view_exists() {
    let gpu = support::open();
    let data = Buffer::new(&gpu, "data", 1 << 20, BufferUsage::Device).expect("memory");
    let mut commands = gpu.commands("fill").expect("a command list");
    commands.fill(&data, 0, 1 << 20, 9);
    finish(&commands.submit().expect("submitted"));
    let address = data.address();
    let Some(first) = view(&gpu, &[]) else { return };
    let second = gpu.host_view(&[]).expect("as the first");
    let used = gpu.memory().used;
    drop(data);
    assert_eq!(gpu.memory().used, used, "it is still there");
    assert_eq!(first.bytes(address).get::<u32>((1 << 18) - 1), Some(9), "with what it held");
    drop(first);
    assert_eq!((gpu.memory().used, second.bytes(address).get::<u32>(0)), (used, Some(9)), "for the other one too");
    drop(second);
    assert!(gpu.memory().used + (1 << 20) <= used, "then it goes");
    assert!(gpu.host_view(&[]).expect("as before").bytes(address).is_empty(), "and is seen no more");
}

#[test]
fn a_viewed_range_is_not_reused() {
    let gpu = support::open();
    let heap = Heap::new(&gpu, "heap", 1 << 20).expect("a heap");
    let [first, _other] = ["first", "other"].map(|name| heap.alloc(name, 4096, 16).expect("memory"));
    let address = first.address();
    let Some(view) = view(&gpu, &[]) else { return };
    drop(first);
    let meanwhile = heap.alloc("meanwhile", 4096, 16).expect("memory");
    assert_ne!(meanwhile.address(), address, "the view may read it");
    assert_eq!(heap.stats().used_bytes, 3 * 4096, "it still counts");
    drop(view);
    assert_eq!(heap.stats().used_bytes, 2 * 4096, "it went with the view");
    assert_eq!(heap.alloc("after", 4096, 16).expect("memory").address(), address, "and is found again");
}
