// SPDX-License-Identifier: Apache-2.0
//! How far a lane has come: a timeline semaphore that counts its submissions. Submission n is done when it has reached
//! n. Knows nothing of what is submitted. Any thread.

use std::sync::atomic::{AtomicU64, Ordering};

use ash::vk;

use crate::device::names::DebugNames;
use crate::error::GpuError;
use crate::instance::lane::QueueLane;
use crate::instance::vulkan::vulkan_error;

/// The timeline of a lane. Until [`TimelineSemaphore::create`] it is null, which may be destroyed.
#[derive(Debug, Default)]
pub(crate) struct TimelineSemaphore {
    semaphore: vk::Semaphore,
    submitted: AtomicU64,
}

impl TimelineSemaphore {
    pub(crate) fn create(&mut self, device: &ash::Device, names: &DebugNames, lane: QueueLane) -> Result<(), GpuError> {
        let mut kind = vk::SemaphoreTypeCreateInfo::default().semaphore_type(vk::SemaphoreType::TIMELINE);
        let info = vk::SemaphoreCreateInfo::default().push_next(&mut kind);
        // SAFETY: timelineSemaphore is enabled.
        let semaphore = unsafe { device.create_semaphore(&info, None) };
        self.semaphore = semaphore.map_err(|code| vulkan_error("vkCreateSemaphore", code))?;
        names.set(
            self.semaphore,
            match lane {
                QueueLane::Main => "submissions",
                QueueLane::Transfer => "transfers",
            },
        );
        Ok(())
    }

    /// What submissions wait for and signal.
    pub(crate) fn semaphore(&self) -> vk::Semaphore {
        self.semaphore
    }

    /// Number of the newest submission; 0 = none yet.
    pub(crate) fn last_submitted(&self) -> u64 {
        self.submitted.load(Ordering::Acquire)
    }

    /// Submission `value` was made, one above the newest before. The caller lets no other be made meanwhile.
    pub(crate) fn advance(&self, value: u64) {
        self.submitted.store(value, Ordering::Release);
    }

    /// Number of the newest submission that has finished.
    pub(crate) fn completed(&self, device: &ash::Device) -> Result<u64, vk::Result> {
        // SAFETY: the semaphore is a timeline of this device and lives as long as it.
        unsafe { device.get_semaphore_counter_value(self.semaphore) }
    }

    /// Waits until submission `value` has finished; [`vk::Result::TIMEOUT`] when it has not.
    pub(crate) fn wait(&self, device: &ash::Device, value: u64, timeout_ns: u64) -> Result<(), vk::Result> {
        let (semaphores, values) = ([self.semaphore], [value]);
        let info = vk::SemaphoreWaitInfo::default().semaphores(&semaphores).values(&values);
        // SAFETY: the semaphore is a timeline of this device, and `value` was submitted, so that the wait ends.
        unsafe { device.wait_semaphores(&info, timeout_ns) }
    }

    /// Destroys it. The device is idle.
    pub(crate) fn destroy(&mut self, device: &ash::Device) {
        // SAFETY: no submission uses it. Null is allowed.
        unsafe { device.destroy_semaphore(std::mem::take(&mut self.semaphore), None) };
    }
}
