// SPDX-License-Identifier: Apache-2.0
//! Options for opening a device.

use std::path::PathBuf;

/// Options for opening a device. `OpenOptions::default()` is right for rendering.
#[derive(Clone, Debug)]
pub struct OpenOptions {
    /// Index in the driver's list, or a part of the name in any case. `None` or blank = the best device.
    pub selector: Option<String>,
    /// True to check every call with the Khronos validation layer, if it is installed; see
    /// [`Gpu::take_validation_messages`](crate::Gpu::take_validation_messages).
    pub validation: bool,
    /// True to look for hazards between operations too, with `validation`. Slow.
    pub sync_validation: bool,
    /// Hard budget for device memory in bytes. `None` = nine tenths of the bytes that the driver reports as free when
    /// the device is opened.
    pub budget_bytes: Option<u64>,
    /// True to take timestamps around every operation of every command list, if the device can.
    pub profile: bool,
    /// True to let each operation stamp its number into host memory, so that
    /// [`GpuError::DeviceLost`](crate::GpuError::DeviceLost) names the last pass.
    pub crash_markers: bool,
    /// True to run transfer lists on a queue of their own, if the device has one to spare. False = on the main queue,
    /// for comparison.
    pub transfer_queue: bool,
    /// Folder for the compiled pipelines of each device and driver, kept from run to run and created when needed.
    /// `None` = in memory only. See [`Gpu::save_pipeline_cache`](crate::Gpu::save_pipeline_cache).
    pub pipeline_cache: Option<PathBuf>,
    /// Key of the caller's set of shaders: callers with other shaders have other files in the folder.
    pub pipeline_key: u64,
}

impl Default for OpenOptions {
    fn default() -> Self {
        Self {
            selector: None,
            validation: false,
            sync_validation: false,
            budget_bytes: None,
            profile: false,
            crash_markers: true,
            transfer_queue: true,
            pipeline_cache: None,
            pipeline_key: 0,
        }
    }
}
