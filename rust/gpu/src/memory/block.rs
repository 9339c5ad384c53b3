// SPDX-License-Identifier: Apache-2.0
//! A buffer with its memory that command lists can keep alive. Any thread.

use std::sync::{Arc, OnceLock};

use ash::vk;

use crate::device::heap_counters::HeldBytes;
use crate::device::logical::LogicalDevice;
use crate::device::raw_buffer::{RawBuffer, RetiredBuffer};
use crate::instance::lane::TimelinePoints;
use crate::instance::memory_type::EXPORTED_KIND;

/// The points after which an object may be destroyed: the newest submissions, of both lanes, at the time when its
/// public handle was dropped.
///
/// Work recorded before that keeps the object itself, so the object outlives such work anyway; this bounds work that
/// only knows the address.
#[derive(Debug, Default)]
pub(crate) struct RetirePoint(OnceLock<TimelinePoints>);

impl RetirePoint {
    /// Fixes the points, unless they are fixed already.
    pub(crate) fn set(&self, points: TimelinePoints) {
        self.0.get_or_init(|| points);
    }

    /// The fixed points, or the newest submissions if none were fixed.
    pub(crate) fn get(&self, device: &LogicalDevice) -> TimelinePoints {
        self.0.get().copied().unwrap_or_else(|| device.submitted())
    }
}

/// A buffer with its memory, retired when the last holder drops it.
#[derive(Debug)]
pub(crate) struct MemoryBlock {
    pub(crate) device: Arc<LogicalDevice>,
    pub(crate) raw: RawBuffer,
    pub(crate) retire_after: RetirePoint,
    /// Its memory in the counters of a heap.
    held: Option<HeldBytes>,
}

impl MemoryBlock {
    pub(crate) fn new(device: &Arc<LogicalDevice>, raw: RawBuffer) -> Self {
        Self { device: Arc::clone(device), raw, retire_after: RetirePoint::default(), held: None }
    }

    /// A block of a heap.
    pub(crate) fn of_heap(device: &Arc<LogicalDevice>, raw: RawBuffer, held: HeldBytes) -> Self {
        let mut block = Self::new(device, raw);
        block.held = Some(held);
        block
    }

    /// Marks it as the memory of one range of its heap.
    pub(crate) fn dedicate(&mut self) {
        if let Some(held) = &mut self.held {
            held.dedicate();
        }
    }

    pub(crate) fn buffer(&self) -> vk::Buffer {
        self.raw.buffer
    }

    /// A file descriptor of the memory for another library, which takes it over, and the bytes of the memory. `None` if
    /// it cannot be exported.
    pub(crate) fn export(&self) -> Option<(i32, u64)> {
        let exporting = self.device.exporting.as_ref().filter(|_| self.raw.exported)?;
        let info = vk::MemoryGetFdInfoKHR::default().memory(self.raw.memory).handle_type(EXPORTED_KIND);
        // SAFETY: the memory is alive, and was allocated to be exported as this kind of handle.
        let exported = unsafe { exporting.get_memory_fd(&info) };
        let exported = exported.inspect_err(|code| tracing::trace!(?code, "memory cannot be exported"));
        Some((exported.ok()?, self.raw.reserved))
    }

    /// Notes that nothing submitted from now on uses this block by its address.
    pub(crate) fn released(&self) {
        self.retire_after.set(self.device.submitted());
    }
}

impl Drop for MemoryBlock {
    fn drop(&mut self) {
        let retired = RetiredBuffer { raw: self.raw, held: self.held.take() };
        self.device.retire(self.retire_after.get(&self.device), retired);
    }
}
