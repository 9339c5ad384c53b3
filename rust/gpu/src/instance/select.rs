// SPDX-License-Identifier: Apache-2.0
//! Selects the physical device. Pure: takes reports, gives an index and the reasons.
//!
//! Devices are ordered by kind (discrete GPU, integrated, virtual, CPU, other), then by device memory, larger first,
//! then by index. A selector (an index, or a part of the name in any case) narrows the list first.

use crate::error::GpuError;
use crate::instance::report::DeviceReport;
use std::cmp::Reverse;

/// What stands for all devices that are alike.
const ALL: &str = "all";
/// Most devices of a picture.
const MOST_TOGETHER: usize = 64;

/// The index into `reports` of the device to use.
///
/// # Errors
/// [`GpuError::NoDevice`] when nothing matches or nothing is usable, [`GpuError::MissingCapability`] when the user
/// named a device and every match lacks something.
pub(crate) fn choose(reports: &[DeviceReport], selector: Option<&str>) -> Result<usize, GpuError> {
    if reports.is_empty() {
        return Err(GpuError::NoDevice {
            reason: "no Vulkan driver offers a device (on Debian, mesa-vulkan-drivers has a software one)".to_owned(),
        });
    }
    let selector = selector.map(str::trim).filter(|text| !text.is_empty());
    let matches: Vec<usize> = match selector {
        None => (0..reports.len()).collect(),
        Some(text) => matching_devices(reports, text),
    };
    let (usable, unusable): (Vec<_>, Vec<_>) = matches.iter().partition(|&&i| reports[i].missing.is_empty());
    let order = |&&i: &&usize| (reports[i].kind, Reverse(reports[i].device_bytes()), reports[i].index);
    let best = usable.into_iter().min_by_key(order);
    match (best, unusable.first(), selector) {
        (Some(&best), _, _) => Ok(best),
        (None, Some(&&i), Some(_)) => {
            Err(GpuError::MissingCapability { device: reports[i].name.clone(), missing: reports[i].missing.join(", ") })
        }
        (None, _, Some(text)) => Err(GpuError::NoDevice {
            reason: format!("\"{text}\" names no device; the devices are {}", list_names(reports)),
        }),
        (None, _, None) => Err(GpuError::NoDevice { reason: format!("none can be used: {}", list_missing(reports)) }),
    }
}

/// The indices into `reports` of the devices that render one picture together. `devices` is `all`, which is the device
/// that [`choose`] gives for the selector and all of its name and driver, or a list of selectors between commas: one
/// device each, and one that is named twice is opened twice.
///
/// # Errors
/// As [`choose`]; [`GpuError::NoDevice`] for an empty entry, or for too many.
pub(crate) fn choose_together(
    reports: &[DeviceReport],
    devices: &str,
    selector: Option<&str>,
) -> Result<Vec<usize>, GpuError> {
    if devices.trim().eq_ignore_ascii_case(ALL) {
        let first = choose(reports, selector)?;
        let kin = |other: &DeviceReport| (&other.name, &other.driver) == (&reports[first].name, &reports[first].driver);
        let others = (0..reports.len()).filter(|&i| i != first && kin(&reports[i]) && reports[i].missing.is_empty());
        return Ok(std::iter::once(first).chain(others).collect());
    }
    let named = |entry: &str| match entry.trim() {
        "" => Err(GpuError::NoDevice { reason: format!("\"{devices}\" has an entry that names no device") }),
        entry => choose(reports, Some(entry)),
    };
    let entries = devices.split(',').count();
    if entries > MOST_TOGETHER {
        let reason = format!("{entries} devices are named, and a picture is rendered on {MOST_TOGETHER} at most");
        return Err(GpuError::NoDevice { reason });
    }
    devices.split(',').map(named).collect()
}

/// Indices into `reports` of the devices that the selector names: by index if there is such a device, else by a part of
/// the name.
fn matching_devices(reports: &[DeviceReport], selector: &str) -> Vec<usize> {
    let by_index = selector.parse::<usize>().ok().and_then(|wanted| reports.iter().position(|r| r.index == wanted));
    if let Some(i) = by_index {
        return vec![i];
    }
    let wanted = selector.to_lowercase();
    (0..reports.len()).filter(|&i| reports[i].name.to_lowercase().contains(&wanted)).collect()
}

fn list_names(reports: &[DeviceReport]) -> String {
    let names: Vec<_> = reports.iter().map(|r| format!("[{}] {}", r.index, r.name)).collect();
    names.join("; ")
}

fn list_missing(reports: &[DeviceReport]) -> String {
    let lines: Vec<_> = reports.iter().map(|r| format!("{} lacks {}", r.name, r.missing.join(", "))).collect();
    lines.join("; ")
}

/// Writes `chosen` and `why` into every report. `chosen` is the result of [`choose`] for the same selector.
pub(crate) fn explain(reports: &mut [DeviceReport], chosen: usize, selector: Option<&str>) {
    let selector = selector.map(str::trim).filter(|text| !text.is_empty());
    let matched = selector.map(|text| matching_devices(reports, text));
    let (chosen_name, chosen_kind) = (reports[chosen].name.clone(), reports[chosen].kind);
    let usable = reports.iter().filter(|r| r.missing.is_empty()).count();
    for (i, report) in reports.iter_mut().enumerate() {
        report.chosen = i == chosen;
        report.why = if !report.missing.is_empty() {
            format!("cannot be used: it lacks {}", report.missing.join(", "))
        } else if i == chosen {
            match selector {
                Some(text) => format!("used: selected by \"{text}\""),
                None if usable == 1 => "used: the only device that has all that is required".to_owned(),
                None => format!("used: first in the order discrete, integrated, virtual, CPU ({})", report.kind),
            }
        } else if matched.as_ref().is_some_and(|matched| !matched.contains(&i)) {
            format!("not used: \"{}\" does not name it", selector.unwrap_or_default())
        } else {
            format!("not used: {chosen_name} ({chosen_kind}) comes first")
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::instance::capabilities::DeviceCapabilities;
    use crate::instance::report::{DeviceKind, HeapReport};

    fn device(index: usize, name: &str, kind: DeviceKind, bytes: u64, missing: &[&'static str]) -> DeviceReport {
        DeviceReport {
            index,
            name: name.to_owned(),
            kind,
            uuid: [0; 16],
            driver: String::new(),
            api: "1.3.0".to_owned(),
            heaps: vec![HeapReport { bytes, device_local: true, free: None }],
            host_memory: false,
            capabilities: DeviceCapabilities::default(),
            missing: missing.to_vec(),
            chosen: false,
            why: String::new(),
        }
    }

    fn machine() -> Vec<DeviceReport> {
        vec![
            device(0, "llvmpipe (LLVM 15)", DeviceKind::Cpu, 64, &[]),
            device(1, "Iris Xe", DeviceKind::Integrated, 32, &[]),
            device(2, "GeForce RTX 4090", DeviceKind::Discrete, 24, &[]),
            device(3, "GeForce RTX 5090", DeviceKind::Discrete, 32, &[]),
            device(4, "GeForce GT 710", DeviceKind::Discrete, 99, &["shaderInt64"]),
        ]
    }

    #[test]
    fn best_kind_then_largest_memory_wins() {
        assert_eq!(choose(&machine(), None), Ok(3), "discrete, usable, most memory");
        assert_eq!(choose(&machine()[..2], Some("  ")), Ok(1), "a blank selector is none; integrated beats CPU");
    }

    #[test]
    fn selector_is_an_index_or_a_name_part() {
        let machine = machine();
        assert_eq!(choose(&machine, Some("0")), Ok(0), "index");
        assert_eq!(choose(&machine, Some("LLVM")), Ok(0), "any case");
        assert_eq!(choose(&machine, Some("4090")), Ok(2), "a number that is no index is a name part");
        assert_eq!(choose(&machine, Some("geforce")), Ok(3), "the best usable of several matches");
    }

    #[test]
    fn all_is_the_devices_that_are_like_the_chosen_one() {
        let gib = |index| device(index, "H200", DeviceKind::Discrete, 140, &[]);
        let old = DeviceReport { driver: "older".to_owned(), ..gib(4) };
        let lacking = device(5, "H200", DeviceKind::Discrete, 140, &["shaderInt64"]);
        let machine = [device(0, "llvmpipe", DeviceKind::Cpu, 999, &[]), gib(1), gib(2), gib(3), old, lacking];
        let together = |devices, selector| choose_together(&machine, devices, selector);
        assert_eq!(together("all", None), Ok(vec![1, 2, 3]), "no processor, no other driver, none that lacks anything");
        assert_eq!(together(" ALL ", Some("3")), Ok(vec![3, 1, 2]), "the one that is named comes first");
        assert_eq!(together("all", Some("llvm")), Ok(vec![0]), "it may be the only one");
        assert!(matches!(together("all", Some("radeon")), Err(GpuError::NoDevice { .. })), "no such device");
    }

    #[test]
    fn a_list_names_a_device_by_each_entry() {
        let machine = machine();
        let together = |devices| choose_together(&machine, devices, Some("llvm"));
        assert_eq!(together("3, iris,3"), Ok(vec![3, 1, 3]), "in the order of the list, one of them twice");
        for (wrong, part) in [("3,,1", "has an entry"), ("3,radeon", "\"radeon\" names no device"), (",", "an entry")] {
            let Err(GpuError::NoDevice { reason }) = together(wrong) else { panic!("{wrong}: expected NoDevice") };
            assert!(reason.contains(part), "{wrong}: {reason}");
        }
        let many = choose_together(&machine, &"0,".repeat(64), None);
        assert!(matches!(many, Err(GpuError::NoDevice { .. })), "too many: {many:?}");
        let lacks = together("0,4");
        assert!(matches!(lacks, Err(GpuError::MissingCapability { .. })), "none is left out in silence: {lacks:?}");
    }

    #[test]
    fn a_bad_selector_lists_the_names() {
        let Err(GpuError::NoDevice { reason }) = choose(&machine(), Some("radeon")) else {
            panic!("expected NoDevice")
        };
        assert!(reason.contains("\"radeon\"") && reason.contains("[1] Iris Xe"), "{reason}");
    }

    #[test]
    fn an_unusable_named_device_lists_what_it_lacks() {
        let error = choose(&machine(), Some("GT 710"));
        let expected = GpuError::MissingCapability { device: "GeForce GT 710".into(), missing: "shaderInt64".into() };
        assert_eq!(error, Err(expected), "no silent fallback to another device");
    }

    #[test]
    fn nothing_usable_lists_all_shortcomings() {
        let Err(GpuError::NoDevice { reason }) = choose(&machine()[4..], None) else { panic!("expected NoDevice") };
        assert!(reason.contains("GT 710 lacks shaderInt64"), "{reason}");
        assert!(matches!(choose(&[], None), Err(GpuError::NoDevice { .. })), "an empty list is an error, not a panic");
    }

    #[test]
    fn every_rejected_device_has_a_reason() {
        let mut machine = machine();
        explain(&mut machine, 3, None);
        assert!(machine[3].chosen && machine[3].why.starts_with("used: first"), "{}", machine[3].why);
        assert!(machine[2].why.contains("5090"), "{}", machine[2].why);
        assert!(machine[4].why.contains("shaderInt64"), "{}", machine[4].why);
        explain(&mut machine, 0, Some("llvm"));
        assert!(machine[0].why.contains("selected") && machine[2].why.contains("does not name"), "{}", machine[2].why);
        assert_eq!(machine.iter().filter(|d| d.chosen).count(), 1, "exactly one is chosen");
    }
}
