// SPDX-License-Identifier: Apache-2.0
//! Tests with faults that the public interface does not let anyone make: a broken Vulkan rule, a lost device.

use std::sync::Arc;

use ash::vk;

use crate::{Buffer, BufferUsage, CommandList, Gpu, GpuError, Heap, OpenOptions, Pipeline, StagingRing};

fn open(validation: bool) -> Arc<Gpu> {
    let selector = std::env::var("OOCPT_TEST_DEVICE").ok();
    Gpu::open(&OpenOptions { selector, validation, ..OpenOptions::default() }).expect("a device to test on")
}

#[test]
fn the_validation_layer_reports_a_planted_violation() {
    let gpu = open(true);
    if !gpu.is_validating() {
        eprintln!("skipped: VK_LAYER_KHRONOS_validation is not installed");
        return;
    }
    let device = gpu.device();
    assert_eq!(gpu.take_validation_messages(), Vec::<String>::new(), "silent before");
    let info = vk::BufferCreateInfo::default().size(0).usage(vk::BufferUsageFlags::STORAGE_BUFFER);
    // SAFETY: deliberately breaks VUID-VkBufferCreateInfo-size-00912; the layer only reports it, and a software or
    // NVIDIA driver makes an empty buffer.
    if let Ok(buffer) = unsafe { device.raw.create_buffer(&info, None) } {
        // SAFETY: just created, never used.
        unsafe { device.raw.destroy_buffer(buffer, None) };
    }
    let messages = gpu.take_validation_messages();
    assert!(messages.iter().any(|m| m.contains("VUID-VkBufferCreateInfo-size-00912")), "{messages:?}");
}

#[test]
fn a_leak_is_reported_after_closing() {
    let gpu = open(true);
    if !gpu.is_validating() {
        eprintln!("skipped: VK_LAYER_KHRONOS_validation is not installed");
        return;
    }
    let log = gpu.validation_log();
    let info = vk::BufferCreateInfo::default().size(64).usage(vk::BufferUsageFlags::STORAGE_BUFFER);
    // SAFETY: a valid call; the buffer is leaked on purpose.
    let leaked = unsafe { gpu.device().raw.create_buffer(&info, None) };
    assert!(leaked.is_ok(), "{leaked:?}");
    drop(gpu);
    let messages = log.take();
    assert!(messages.iter().any(|m| m.contains("VUID-vkDestroyDevice-device")), "{messages:?}");
}

fn filled(gpu: &Arc<Gpu>, label: &str, buffer: &Buffer) -> CommandList {
    let mut commands = gpu.commands(label).expect("a command list");
    commands.fill(buffer, 0, 64, 1);
    commands.update(buffer, 0, &[0; 4]);
    commands
}

/// As if the driver had answered `VK_ERROR_DEVICE_LOST`.
fn lose(gpu: &Gpu) -> GpuError {
    let result = gpu.device().check::<()>("vkQueueSubmit", Err(vk::Result::ERROR_DEVICE_LOST));
    result.expect_err("a lost device is an error")
}

#[test]
fn a_lost_device_names_the_last_pass() {
    let gpu = open(false);
    let buffer = Buffer::new(&gpu, "buffer", 64, BufferUsage::Device).expect("memory");
    let submission = filled(&gpu, "wave 7", &buffer).enqueue().expect("submitted");
    // Waits without taking the submission off the list, as when the device dies in the middle.
    assert_eq!(gpu.device().wait_for(gpu.device().submitted()), Ok(()), "finished");
    let error = lose(&gpu);
    let last_pass = "update (then end of wave 7 began)".to_owned();
    assert_eq!(error, GpuError::DeviceLost { last_pass }, "by the marker");
    assert!(submission.is_done() && submission.wait(std::time::Duration::ZERO).is_err(), "told by wait");
    assert!(submission.timings().is_empty(), "no timings of a lost device");
}

#[test]
fn a_lost_device_names_the_last_pass_of_both_queues() {
    let gpu = open(false);
    let buffer = Buffer::new(&gpu, "buffer", 64, BufferUsage::Device).expect("memory");
    filled(&gpu, "wave 7", &buffer).enqueue().expect("submitted");
    let mut transfer = gpu.transfer_commands("bring chunk 3").expect("a command list");
    transfer.fill(&buffer, 0, 64, 1);
    transfer.enqueue().expect("submitted");
    assert_eq!(gpu.device().wait_for(gpu.device().submitted()), Ok(()), "finished");
    let last_pass = "update (then end of wave 7 began); of the transfers: fill (then end of bring chunk 3 began)";
    assert_eq!(lose(&gpu), GpuError::DeviceLost { last_pass: last_pass.to_owned() }, "a marker each");
    assert_eq!(gpu.transfer_commands("more").expect_err("lost"), lose(&gpu), "the same error for transfers");
}

#[test]
fn without_markers_the_last_submission_is_named() {
    let gpu = Gpu::open(&OpenOptions { crash_markers: false, ..OpenOptions::default() }).expect("a device");
    let buffer = Buffer::new(&gpu, "buffer", 64, BufferUsage::Device).expect("memory");
    filled(&gpu, "first", &buffer).submit().expect("submitted");
    gpu.wait_idle().expect("alive");
    filled(&gpu, "second", &buffer).enqueue().expect("submitted");
    assert_eq!(gpu.device().wait_for(gpu.device().submitted()), Ok(()), "finished");
    let GpuError::DeviceLost { last_pass } = lose(&gpu) else { panic!("expected DeviceLost") };
    assert_eq!(last_pass, "first (then second was submitted)", "by what finished");
}

#[test]
fn after_a_loss_everything_fails_and_everything_can_be_dropped() {
    let gpu = open(true);
    let log = gpu.validation_log();
    let heap = Heap::new(&gpu, "heap", 1 << 20).expect("a heap");
    let range = heap.alloc("range", 1000, 16).expect("memory");
    let buffer = Buffer::new(&gpu, "buffer", 64, BufferUsage::Device).expect("memory");
    let commands = filled(&gpu, "too late", &buffer);
    gpu.wait_idle().expect("alive");
    let lost = lose(&gpu);
    assert_eq!(commands.submit().expect_err("submit"), lost, "the same error everywhere");
    assert_eq!(gpu.commands("more").expect_err("commands"), lost, "commands");
    assert_eq!(Buffer::new(&gpu, "more", 64, BufferUsage::Device).expect_err("buffer"), lost, "buffer");
    assert_eq!(heap.alloc("more", 64, 16).expect_err("range"), lost, "range");
    assert_eq!(Heap::new(&gpu, "more", 1).expect_err("heap"), lost, "heap");
    assert_eq!(Pipeline::new(&gpu, "more", &[], &[], 0).expect_err("pipeline"), lost, "pipeline");
    assert_eq!(gpu.wait_idle(), Err(lost), "wait");
    drop((buffer, range, heap));
    assert_eq!(gpu.memory().used, 0, "memory is given back although nothing will ever finish");
    drop(gpu);
    assert_eq!(log.take(), Vec::<String>::new(), "closed without leaks");
}

#[test]
fn a_loss_ends_the_wait_for_staging_space() {
    let gpu = open(false);
    let ring = StagingRing::new(&gpu, 64).expect("a ring");
    let held = ring.reserve(64, 4).expect("free");
    let (tell, told) = std::sync::mpsc::channel();
    let (lost, ends) = std::thread::scope(|scope| {
        for _ in 0..3 {
            let (tell, ring) = (tell.clone(), &ring);
            scope.spawn(move || tell.send(ring.reserve(1, 1).err()));
        }
        std::thread::sleep(std::time::Duration::from_millis(20));
        let lost = lose(&gpu);
        let ends: Vec<_> = (0..3).map(|_| told.recv_timeout(std::time::Duration::from_secs(30))).collect();
        // Ends the wait also when the loss did not.
        drop(held);
        (lost, ends)
    });
    assert_eq!(ends, vec![Ok(Some(lost)); 3], "the first as well as those behind it");
    assert!(ring.try_reserve(1, 1).is_err(), "and all later requests");
    assert_eq!(ring.used(), 0, "slices are given back all the same");
}
