// SPDX-License-Identifier: Apache-2.0
//! Command lists: dispatches by address, order, timings, and mistakes.

use std::time::Duration;

use oocpt_gpu::{Buffer, BufferUsage, Gpu, GpuError, Heap, OpenOptions, Pipeline};

use crate::support::{self, AFFINE, affine, affine_push, bytes, compile, finish, read_words, spin, spin_push};

#[test]
fn a_chain_of_dispatches_sees_what_came_before() {
    let gpu = support::open();
    let pipeline = affine(&gpu, 3);
    let heap = Heap::new(&gpu, "heap", 1 << 20).expect("a heap");
    let data = heap.alloc("data", 4 * 1000, 16).expect("memory");
    let readback = Buffer::new(&gpu, "readback", 4 * 1000, BufferUsage::Readback).expect("memory");
    let mut commands = gpu.commands("chain").expect("a command list");
    commands.fill(&data, 0, 4000, 1);
    for add in 0..5 {
        commands.keep(&data);
        commands.dispatch(&pipeline, &affine_push(data.address(), data.address(), 1000, add), [16, 1, 1]);
    }
    commands.copy(&data, 0, &readback, 0, 4000);
    finish(&commands.submit().expect("submitted"));
    let expected = (0..5).fold(1_u32, |x, add| x * 3 + add);
    assert_eq!(read_words(&readback, 1000), vec![expected; 1000], "x = 3 x + i, five times");
}

#[test]
fn later_submissions_see_earlier_ones() {
    let gpu = support::open();
    let pipeline = affine(&gpu, 1);
    let data = Buffer::new(&gpu, "data", 256, BufferUsage::Readback).expect("memory");
    data.write(0, &[0; 256]).expect("fits");
    let submissions: Vec<_> = (0..50)
        .map(|_| {
            let mut commands = gpu.commands("increment").expect("a command list");
            commands.dispatch(&pipeline, &affine_push(data.address(), data.address(), 64, 1), [1, 1, 1]);
            commands.submit().expect("submitted")
        })
        .collect();
    finish(&submissions[49]);
    assert!(submissions.iter().all(oocpt_gpu::Submission::is_done), "in order");
    assert_eq!(read_words(&data, 64), [50; 64], "each added one");
}

#[test]
fn indirect_dispatch_reads_its_counts_from_the_gpu() {
    let gpu = support::open();
    let pipeline = affine(&gpu, 1);
    let data = Buffer::new(&gpu, "data", 4 * 256, BufferUsage::Readback).expect("memory");
    let counts = Buffer::new(&gpu, "counts", 32, BufferUsage::Device).expect("memory");
    let mut commands = gpu.commands("indirect").expect("a command list");
    commands.fill(&data, 0, 4 * 256, 7);
    commands.update(&counts, 8, &bytes(&[2, 1, 1]));
    commands.dispatch_indirect(&pipeline, &affine_push(data.address(), data.address(), 256, 1), &counts, 8);
    commands.update(&counts, 8, &bytes(&[0, 1, 1]));
    commands.dispatch_indirect(&pipeline, &affine_push(data.address(), data.address(), 256, 1), &counts, 8);
    finish(&commands.submit().expect("submitted"));
    let words = read_words(&data, 256);
    assert_eq!((&words[..128], &words[128..]), (&[8; 128][..], &[7; 128][..]), "two workgroups, then none");
}

#[test]
fn a_concurrent_section_is_one_step_in_the_order() {
    let gpu = support::open();
    let pipeline = affine(&gpu, 2);
    let data = Buffer::new(&gpu, "data", 4 * 128, BufferUsage::Readback).expect("memory");
    let push = |part: u64| affine_push(data.address() + part * 256, data.address() + part * 256, 64, 1);
    let mut commands = gpu.commands("sections").expect("a command list");
    commands.concurrent(|c| {
        c.fill(&data, 0, 256, 10);
        c.fill(&data, 256, 256, 20);
    });
    commands.concurrent(|c| (0..2).for_each(|part| c.dispatch(&pipeline, &push(part), [1, 1, 1])));
    commands.dispatch(&pipeline, &push(0), [1, 1, 1]);
    finish(&commands.submit().expect("submitted"));
    let words = read_words(&data, 128);
    assert_eq!((&words[..64], &words[64..]), (&[43; 64][..], &[41; 64][..]), "each half through its own steps");
}

#[test]
fn hazards_inside_a_concurrent_section_are_reported() {
    let gpu = Gpu::open(&support::options()).expect("a device");
    if !gpu.is_validating() {
        eprintln!("skipped: VK_LAYER_KHRONOS_validation is not installed");
        return;
    }
    let data = Buffer::new(&gpu, "data", 64, BufferUsage::Device).expect("memory");
    let mut commands = gpu.commands("hazard").expect("a command list");
    commands.concurrent(|c| (0..2).for_each(|value| c.fill(&data, 0, 64, value)));
    finish(&commands.submit().expect("submitted"));
    let messages = gpu.take_validation_messages();
    assert!(messages.iter().any(|m| m.contains("SYNC-HAZARD-WRITE-AFTER-WRITE")), "canary is silent: {messages:?}");
}

#[test]
fn timings_name_the_passes_in_order() {
    let gpu = support::open_with(&OpenOptions { profile: true, ..support::options() });
    let (spin, affine) = (spin(&gpu), affine(&gpu, 1));
    let data = Buffer::new(&gpu, "data", 256, BufferUsage::Device).expect("memory");
    let mut commands = gpu.commands("timed").expect("a command list");
    commands.fill(&data, 0, 256, 0);
    commands.span("work", |c| {
        c.dispatch(&spin, &spin_push(data.address(), support::LONG), [1, 1, 1]);
        // More stamps than one query pool holds.
        (0..300).for_each(|_| c.dispatch(&affine, &affine_push(data.address(), data.address(), 64, 1), [1, 1, 1]));
    });
    let submission = commands.submit().expect("submitted");
    finish(&submission);
    let timings = submission.timings();
    if !gpu.report().capabilities.timestamps {
        assert!(timings.is_empty(), "no timestamps, no timings");
        return;
    }
    let names: Vec<_> = timings.iter().map(|(name, _)| name.as_str()).take(4).collect();
    assert_eq!((names, timings.len()), (vec!["fill", "work", "spin", "affine"], 303), "recording order");
    let (span, spin) = (timings[1].1, timings[2].1);
    assert!(spin > 0.0 && span >= spin && span < 600.0, "span {span} s, spin {spin} s");
    let parts: f64 = timings[2..].iter().map(|(_, secs)| secs).sum();
    assert!(parts <= span * 1.001, "parts {parts} s in a span of {span} s");
}

#[test]
fn timings_are_off_unless_asked_for() {
    let gpu = support::open();
    let data = Buffer::new(&gpu, "data", 64, BufferUsage::Device).expect("memory");
    let mut commands = gpu.commands("partly timed").expect("a command list");
    commands.fill(&data, 0, 64, 0);
    commands.profile(true);
    commands.fill(&data, 0, 64, 0);
    commands.profile(false);
    commands.fill(&data, 0, 64, 0);
    let submission = commands.submit().expect("submitted");
    finish(&submission);
    let expected = usize::from(gpu.report().capabilities.timestamps);
    assert_eq!(submission.timings().len(), expected, "only what was recorded while it was on");
}

#[test]
fn waiting_times_out_with_an_error() {
    let gpu = support::open();
    let pipeline = spin(&gpu);
    let data = Buffer::new(&gpu, "data", 64, BufferUsage::Device).expect("memory");
    let mut commands = gpu.commands("long").expect("a command list");
    for _ in 0..20 {
        commands.dispatch(&pipeline, &spin_push(data.address(), support::LONG), [1, 1, 1]);
    }
    let submission = commands.submit().expect("submitted");
    assert_eq!(submission.wait(Duration::ZERO), Ok(false), "not done yet");
    finish(&submission);
    assert!(submission.is_done(), "done");
}

#[test]
fn the_first_mistake_is_returned_and_nothing_runs() {
    let gpu = support::open();
    let pipeline = affine(&gpu, 1);
    let data = Buffer::new(&gpu, "data", 64, BufferUsage::Readback).expect("memory");
    data.write(0, &[7; 64]).expect("fits");
    type Mistake<'a> = (&'a str, Box<dyn Fn(&mut oocpt_gpu::CommandList) + 'a>);
    let mistakes: [Mistake<'_>; 8] = [
        ("68 bytes at 0 do not fit", Box::new(|c| c.fill(&data, 0, 68, 0))),
        ("not multiples of 4", Box::new(|c| c.fill(&data, 2, 4, 0))),
        ("do not fit", Box::new(|c| c.copy(&data, u64::MAX, &data, 0, 2))),
        ("overlap", Box::new(|c| c.copy(&data, 0, &data, 8, 16))),
        ("multiples of 4", Box::new(|c| c.update(&data, 0, &[1, 2, 3]))),
        ("push constants, 24 expected", Box::new(|c| c.dispatch(&pipeline, &[0; 8], [1, 1, 1]))),
        ("workgroups", Box::new(|c| c.dispatch(&pipeline, &[0; 24], [1, 1, u32::MAX]))),
        ("12 bytes at 56 do not fit", Box::new(|c| c.dispatch_indirect(&pipeline, &[0; 24], &data, 56))),
    ];
    for (expected, mistake) in mistakes {
        let mut commands = gpu.commands("mistaken").expect("a command list");
        mistake(&mut commands);
        commands.fill(&data, 0, 64, 0);
        let error = commands.submit().expect_err(expected);
        assert!(matches!(&error, GpuError::Usage { .. }) && error.to_string().contains(expected), "{error}");
    }
    gpu.wait_idle().expect("nothing was submitted");
    assert_eq!(read_words(&data, 16), [0x0707_0707; 16], "untouched");
}

#[test]
fn invalid_spirv_is_refused() {
    let gpu = support::open();
    let words = compile(AFFINE);
    for (words, push) in [(&words[..5], 24), (&[][..], 24), (&words[..], 22), (&words[..], 1 << 20)] {
        let error = Pipeline::new(&gpu, "bad", words, &[], push).expect_err("refused before the driver sees it");
        assert!(matches!(error, GpuError::Usage { .. }), "{error}");
    }
}
