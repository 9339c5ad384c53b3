// SPDX-License-Identifier: Apache-2.0
//! Choosing a device, and what is reported about it.

use oocpt_gpu::{Buffer, BufferUsage, Gpu, GpuError, OpenOptions, enumerate, enumerate_for};

use crate::support;

#[test]
fn one_device_is_chosen_and_every_device_has_a_reason() {
    let reports = enumerate().expect("a driver is installed");
    assert_eq!(reports.iter().filter(|report| report.chosen).count(), 1, "{reports:#?}");
    for report in &reports {
        assert!(!report.why.is_empty() && !report.name.is_empty(), "{report:#?}");
        assert!(report.device_bytes() > 0, "{} has no memory", report.name);
        assert_eq!(report.missing, report.capabilities.missing(), "missing follows from the capabilities");
    }
}

#[test]
fn the_selector_takes_indices_and_name_parts() {
    let name = Gpu::open(&OpenOptions::default()).expect("a device").report().name.clone();
    let part = name.to_uppercase();
    let opened = Gpu::open(&OpenOptions { selector: Some(part.clone()), ..OpenOptions::default() });
    assert_eq!(opened.expect("by name").report().name, name, "any case");
    let by_index = enumerate_for(Some("0")).expect("a driver is installed");
    assert!(by_index[0].chosen && by_index[0].why.contains("selected"), "{}", by_index[0].why);
}

#[test]
fn an_unmatched_selector_lists_the_devices() {
    let options = OpenOptions { selector: Some("voodoo".to_owned()), ..OpenOptions::default() };
    let error = Gpu::open(&options).expect_err("no such device");
    assert!(
        matches!(&error, GpuError::NoDevice { reason } if reason.contains("voodoo") && reason.contains("[0] ")),
        "{error}"
    );
    let reports = enumerate_for(Some("voodoo")).expect("doctor still lists the devices");
    assert!(reports.iter().all(|report| !report.chosen && report.why.contains("not used")), "{reports:#?}");
}

#[test]
fn two_devices_live_side_by_side() {
    let (first, second) = (support::open(), support::open());
    let ours = Buffer::new(&first, "ours", 64, BufferUsage::Upload).expect("memory");
    let theirs = Buffer::new(&second, "theirs", 64, BufferUsage::Upload).expect("memory");
    let mut commands = first.commands("mixed").expect("a command list");
    commands.copy(&ours, 0, &theirs, 0, 64);
    let error = commands.submit().expect_err("buffers of another Gpu are refused");
    assert!(error.to_string().contains("theirs: belongs to another Gpu"), "{error}");
    drop(first);
    assert!(second.memory().host_used > 0, "closing one leaves the other alone");
    drop((ours, theirs));
}

#[test]
fn limits_meet_the_vulkan_minimums() {
    let gpu = support::open();
    let limits = gpu.limits();
    assert!(limits.max_push_bytes >= 128 && limits.max_workgroups[0] >= 65_535, "{limits:?}");
    assert!(limits.max_allocation_bytes >= 1 << 30, "{limits:?}");
    assert!(gpu.report().chosen && gpu.report().missing.is_empty(), "{:?}", gpu.report());
}
