// SPDX-License-Identifier: Apache-2.0
//! Lists the devices, with the one that is chosen and the reasons. It opens none. Any thread.

use crate::error::GpuError;
use crate::instance::probe::probe_all;
use crate::instance::report::DeviceReport;
use crate::instance::select;
use crate::instance::vulkan::{Instance, ValidationLevel};

/// All devices, with `chosen` and `why` as if opened without a selector.
///
/// # Errors
/// [`GpuError::NoDevice`] when there is no loader or no driver. An empty list of usable devices is not an error here.
pub fn enumerate() -> Result<Vec<DeviceReport>, GpuError> {
    enumerate_for(None)
}

/// The devices that render one picture together: `devices` is `all`, for the device that
/// [`Gpu::open`](crate::Gpu::open) takes with `selector` and all of its name and driver, or a list of selectors between
/// commas. One that is named twice is there twice.
///
/// # Errors
/// As [`Gpu::open`](crate::Gpu::open), for each entry.
pub fn devices_together(devices: &str, selector: Option<&str>) -> Result<Vec<DeviceReport>, GpuError> {
    let instance = Instance::get(ValidationLevel::Off)?;
    let reports: Vec<_> = probe_all(&instance)?.into_iter().map(|probed| probed.report).collect();
    let chosen = select::choose_together(&reports, devices, selector)?;
    Ok(chosen.into_iter().map(|index| reports[index].clone()).collect())
}

/// All devices, with `chosen` and `why` as [`Gpu::open`](crate::Gpu::open) with this selector would decide.
///
/// # Errors
/// As [`enumerate`]. A selector that names no device leaves all unchosen, and says so in each `why`.
pub fn enumerate_for(selector: Option<&str>) -> Result<Vec<DeviceReport>, GpuError> {
    let instance = Instance::get(ValidationLevel::Off)?;
    let mut reports: Vec<_> = probe_all(&instance)?.into_iter().map(|probed| probed.report).collect();
    match select::choose(&reports, selector) {
        Ok(chosen) => select::explain(&mut reports, chosen, selector),
        Err(error) => {
            for report in &mut reports {
                report.why = if report.missing.is_empty() {
                    format!("not used: {error}")
                } else {
                    format!("cannot be used: it lacks {}", report.missing.join(", "))
                };
            }
        }
    }
    Ok(reports)
}
