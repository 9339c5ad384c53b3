// SPDX-License-Identifier: Apache-2.0
//! The public handle of an open device.
//!
//! Several may be open at once, also on the same device. Any thread.

use std::path::PathBuf;
use std::sync::Arc;

use crate::budget::MemoryUse;
use crate::commands::Commands;
use crate::device::Device;
use crate::error::GpuError;
use crate::instance::{Instance, Validation};
use crate::lane::Lane;
use crate::probe::{Probed, device_usage, probe_all};
use crate::report::DeviceReport;
use crate::select;
use crate::validation::ValidationLog;

/// How to open a device. `OpenOptions::default()` is right for rendering.
#[derive(Clone, Debug)]
pub struct OpenOptions {
    /// Index in the driver's list, or a part of the name in any case. None or blank = the best device.
    pub selector: Option<String>,
    /// Check every call with the Khronos validation layer, if it is installed; see [`Gpu::take_validation_messages`].
    pub validation: bool,
    /// With `validation`: also look for hazards between operations. Slow.
    pub sync_validation: bool,
    /// Hard budget for device memory in bytes. None = nine tenths of what the driver says is free when the device is
    /// opened.
    pub budget_bytes: Option<u64>,
    /// Take timestamps around every operation of every command list, if the device can.
    pub profile: bool,
    /// Let each operation stamp its number into host memory, so that [`GpuError::DeviceLost`] names the last pass.
    pub crash_markers: bool,
    /// Let transfer lists run on a queue of their own, if the device has one to spare. False = on the main queue, to
    /// compare.
    pub transfer_queue: bool,
    /// Folder for the compiled pipelines of each device and driver, kept from run to run; made when needed. None = in
    /// memory only. See [`Gpu::save_pipeline_cache`].
    pub pipeline_cache: Option<PathBuf>,
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
        }
    }
}

/// Limits of the open device that callers plan with.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Limits {
    /// Largest buffer, arena or dedicated range in bytes.
    pub max_allocation_bytes: u64,
    /// Most workgroups of a dispatch in each dimension.
    pub max_workgroups: [u32; 3],
    /// Most bytes of push constants.
    pub max_push_bytes: u32,
    /// Bytes of shared memory of a workgroup.
    pub max_shared_bytes: u32,
    /// Invocations that run in lockstep.
    pub subgroup_size: u32,
    /// Nanoseconds of one timestamp tick.
    pub timestamp_period_ns: f32,
}

impl Limits {
    pub(crate) fn of(probed: &Probed) -> Self {
        let limits = &probed.properties.limits;
        Self {
            max_allocation_bytes: probed.max_allocation_bytes,
            max_workgroups: limits.max_compute_work_group_count,
            max_push_bytes: limits.max_push_constants_size,
            max_shared_bytes: limits.max_compute_shared_memory_size,
            subgroup_size: probed.subgroup_size,
            timestamp_period_ns: limits.timestamp_period,
        }
    }
}

/// An open device. Dropping the last `Arc` waits for the GPU; buffers and pipelines that still live stay valid.
#[derive(Debug)]
pub struct Gpu {
    device: Arc<Device>,
}

impl Gpu {
    /// Opens the device that `options.selector` names, or the best one.
    ///
    /// # Errors [`GpuError::NoDevice`] when there is no loader, driver, or match; [`GpuError::MissingCapability`] when
    /// the named device lacks something; [`GpuError::Vulkan`] when the driver refuses.
    pub fn open(options: &OpenOptions) -> Result<Arc<Self>, GpuError> {
        let validation = match (options.validation, options.sync_validation) {
            (false, _) => Validation::Off,
            (true, false) => Validation::On,
            (true, true) => Validation::OnWithSync,
        };
        let instance = Instance::get(validation)?;
        let mut devices = probe_all(&instance)?;
        let selector = options.selector.as_deref();
        let mut reports: Vec<_> = devices.iter().map(|device| device.report.clone()).collect();
        let chosen = select::choose(&reports, selector)?;
        select::explain(&mut reports, chosen, selector);
        let mut probed = devices.swap_remove(chosen);
        probed.report = reports.swap_remove(chosen);
        tracing::info!(device = probed.report.name, why = probed.report.why, "GPU opened");
        Ok(Arc::new(Self { device: Arc::new(Device::new(instance, probed, options)?) }))
    }

    pub(crate) fn device(&self) -> &Arc<Device> {
        &self.device
    }

    /// What was opened and why.
    #[must_use]
    pub fn report(&self) -> &DeviceReport {
        &self.device.report
    }

    /// Whether all its memory is the host's too: no bus lies between them.
    #[must_use]
    pub fn is_unified(&self) -> bool {
        self.device.unified
    }

    /// Its limits.
    #[must_use]
    pub fn limits(&self) -> &Limits {
        &self.device.limits
    }

    /// Bytes held now, after letting go of what finished work used.
    #[must_use]
    pub fn memory(&self) -> MemoryUse {
        self.device.collect();
        self.device.budget.counts()
    }

    /// Bytes that the driver says this process uses of device-local memory, by whatever it holds: other devices,
    /// pipelines and the driver's own things too. None without `VK_EXT_memory_budget`. Mesa's software renderer
    /// (25.0.7) tells of the whole machine instead.
    #[must_use]
    pub fn driver_usage(&self) -> Option<u64> {
        let device = &self.device;
        let known = device.report.capabilities.memory_budget;
        known.then(|| device_usage(&device.instance, device.physical))
    }

    /// Changes the hard budget; None = nine tenths of what this process could hold now. What is held stays held: below
    /// that, every request fails until enough was dropped.
    pub fn set_budget(&self, budget_bytes: Option<u64>) {
        self.device.budget.set_budget(budget_bytes.unwrap_or_else(|| self.device.automatic_budget()));
    }

    /// Takes the warnings and errors of the validation layer so far. Always empty without validation.
    #[must_use]
    pub fn take_validation_messages(&self) -> Vec<String> {
        self.device.instance.log.take()
    }

    /// The log behind [`Gpu::take_validation_messages`]; it outlives the device and so shows what was leaked.
    #[must_use]
    pub fn validation_log(&self) -> ValidationLog {
        self.device.instance.log.clone()
    }

    /// Whether the validation layer was asked for and found.
    #[must_use]
    pub fn is_validating(&self) -> bool {
        self.device.instance.validating
    }

    /// Waits for all work submitted so far, on all queues, and lets go of what it used.
    ///
    /// # Errors
    /// [`GpuError::DeviceLost`], or a failed call.
    pub fn wait_idle(&self) -> Result<(), GpuError> {
        self.device.wait_for(self.device.submitted())?;
        self.device.collect();
        Ok(())
    }

    /// Writes the pipelines compiled so far to the folder of [`OpenOptions::pipeline_cache`], as closing the device
    /// does: for hosts that end without closing it. Cheap when nothing is new. What fails is logged.
    pub fn save_pipeline_cache(&self) {
        self.device.save_pipeline_cache();
    }

    /// A new command list. The label is shown by debuggers, errors and crash reports.
    ///
    /// # Errors
    /// [`GpuError::DeviceLost`], or a failed call.
    pub fn commands(self: &Arc<Self>, label: &str) -> Result<Commands, GpuError> {
        Commands::new(self, Lane::Main, label)
    }

    /// A new command list that only copies, fills and updates. It runs beside other lists where
    /// [`Gpu::has_transfer_queue`], and in any case in no order with them but that of [`Commands::wait_for`].
    ///
    /// # Errors
    /// [`GpuError::DeviceLost`], or a failed call.
    pub fn transfer_commands(self: &Arc<Self>, label: &str) -> Result<Commands, GpuError> {
        Commands::new(self, Lane::Transfer, label)
    }

    /// Whether transfer lists run on a queue of their own.
    #[must_use]
    pub fn has_transfer_queue(&self) -> bool {
        self.device.queue(Lane::Transfer).choice != self.device.queue(Lane::Main).choice
    }
}

impl Drop for Gpu {
    fn drop(&mut self) {
        // Submissions hold an Arc of this, so none can be waited for later, and no new one can be made.
        if let Err(error) = self.wait_idle() {
            tracing::warn!(%error, "closing the GPU");
            self.device.collect();
        }
    }
}
