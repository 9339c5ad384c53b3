// SPDX-License-Identifier: Apache-2.0
//! The public handle of an open device.
//!
//! Several may be open at once, also on the same device. Any thread.

use std::sync::Arc;

use ash::vk;

use crate::device::budget::MemoryUse;
use crate::device::logical::LogicalDevice;
use crate::device::markers::{MARKER_BYTES, OperationMarkers};
use crate::device::options::OpenOptions;
use crate::device::pipeline_cache::{CacheFile, PipelineCache};
use crate::error::GpuError;
use crate::instance::lane::QueueLane;
use crate::instance::limits::DeviceLimits;
use crate::instance::memory_type::BufferUsage;
use crate::instance::probe::{device_usage, probe_all};
use crate::instance::report::DeviceReport;
use crate::instance::select;
use crate::instance::validation::ValidationLog;
use crate::instance::vulkan::{Instance, ValidationLevel};
use crate::memory::allocate::NewBuffer;
use crate::submit::open_device::OpenDevice;

/// An open device. Dropping the last `Arc` waits for the GPU; buffers and pipelines that still live stay valid.
#[derive(Debug)]
pub struct Gpu {
    pipeline_cache: PipelineCache,
    opened: Arc<OpenDevice>,
}

impl Gpu {
    /// Opens the device that `options.selector` names, or the best one.
    ///
    /// # Errors [`GpuError::NoDevice`] when there is no loader, driver, or match; [`GpuError::MissingCapability`] when
    /// the named device lacks something; [`GpuError::Vulkan`] when the driver refuses.
    pub fn open(options: &OpenOptions) -> Result<Arc<Self>, GpuError> {
        let validation = match (options.validation, options.sync_validation) {
            (false, _) => ValidationLevel::Off,
            (true, false) => ValidationLevel::On,
            (true, true) => ValidationLevel::OnWithSync,
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
        let cache_file = options.pipeline_cache.as_ref();
        let cache_file = cache_file.map(|folder| CacheFile::new(folder, &probed, options.pipeline_key));
        let mut device = LogicalDevice::new(instance, probed, options)?;
        if options.crash_markers {
            let mut words = NewBuffer::new(&device, "crash markers", MARKER_BYTES, BufferUsage::Readback)?;
            words.take_memory()?;
            let words = words.finish()?;
            device.markers = Some(OperationMarkers::new(words));
        }
        let device = Arc::new(device);
        let pipeline_cache = PipelineCache::new(&device, cache_file)?;
        Ok(Arc::new(Self { pipeline_cache, opened: Arc::new(OpenDevice::new(device)) }))
    }

    pub(crate) fn device(&self) -> &Arc<LogicalDevice> {
        &self.opened.device
    }

    pub(crate) fn opened(&self) -> &Arc<OpenDevice> {
        &self.opened
    }

    /// What pipelines are made with.
    pub(crate) fn pipeline_cache(&self) -> vk::PipelineCache {
        self.pipeline_cache.raw()
    }

    /// What was opened and why.
    #[must_use]
    pub fn report(&self) -> &DeviceReport {
        &self.device().report
    }

    /// Whether all its memory is the host's too: no bus lies between them.
    #[must_use]
    pub fn is_unified(&self) -> bool {
        self.device().unified
    }

    /// Its limits.
    #[must_use]
    pub fn limits(&self) -> &DeviceLimits {
        &self.device().limits
    }

    /// Bytes held now, after letting go of what finished work used.
    #[must_use]
    pub fn memory(&self) -> MemoryUse {
        self.opened.collect();
        self.device().budget.counts()
    }

    /// Bytes that the driver says this process uses of device-local memory, by whatever it holds: other devices,
    /// pipelines and the driver's own things too. None without `VK_EXT_memory_budget`. Mesa's software renderer
    /// (25.0.7) tells of the whole machine instead.
    #[must_use]
    pub fn driver_usage(&self) -> Option<u64> {
        let device = self.device();
        let known = device.report.capabilities.memory_budget;
        known.then(|| device_usage(&device.instance, device.physical))
    }

    /// Changes the hard budget; None = nine tenths of what this process could hold now. What is held stays held: below
    /// that, every request fails until enough was dropped.
    pub fn set_budget(&self, budget_bytes: Option<u64>) {
        self.device().budget.set_budget(budget_bytes.unwrap_or_else(|| self.device().automatic_budget()));
    }

    /// Takes the warnings and errors of the validation layer so far. Always empty without validation.
    #[must_use]
    pub fn take_validation_messages(&self) -> Vec<String> {
        self.device().instance.log.take()
    }

    /// The log behind [`Gpu::take_validation_messages`]; it outlives the device and so shows what was leaked.
    #[must_use]
    pub fn validation_log(&self) -> ValidationLog {
        self.device().instance.log.clone()
    }

    /// Whether the validation layer was asked for and found.
    #[must_use]
    pub fn is_validating(&self) -> bool {
        self.device().instance.validating
    }

    /// Waits for all work submitted so far, on all queues, and lets go of what it used.
    ///
    /// # Errors
    /// [`GpuError::DeviceLost`], or a failed call.
    pub fn wait_idle(&self) -> Result<(), GpuError> {
        self.device().wait_for(self.device().submitted())?;
        self.opened.collect();
        Ok(())
    }

    /// Writes the pipelines compiled so far to the folder of [`OpenOptions::pipeline_cache`], as closing the device
    /// does: for hosts that end without closing it. Cheap when nothing is new. What fails is logged.
    pub fn save_pipeline_cache(&self) {
        self.pipeline_cache.save();
    }

    /// Whether transfer lists run on a queue of their own.
    #[must_use]
    pub fn has_transfer_queue(&self) -> bool {
        self.device().choice(QueueLane::Transfer) != self.device().choice(QueueLane::Main)
    }
}

impl Drop for Gpu {
    fn drop(&mut self) {
        // Submissions hold an Arc of this, so none can be waited for later, and no new one can be made.
        if let Err(error) = self.wait_idle() {
            tracing::warn!(%error, "closing the GPU");
            self.opened.collect();
        }
    }
}
