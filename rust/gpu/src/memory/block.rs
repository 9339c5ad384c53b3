// SPDX-License-Identifier: Apache-2.0
//! A buffer with its memory that command lists can keep alive. Any thread.

use std::sync::{Arc, OnceLock};

use ash::vk;

use crate::device::heap_counters::HeldBytes;
use crate::device::logical::LogicalDevice;
use crate::device::raw_buffer::{RawBuffer, RetiredBuffer};
use crate::instance::lane::TimelinePoints;

/// When something may be destroyed: after the newest submissions, of both lanes, at the time its public handle was
/// dropped.
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
    /// Its memory's place in the count of a heap.
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

    /// Says that it is the memory of one range of its heap.
    pub(crate) fn dedicate(&mut self) {
        if let Some(held) = &mut self.held {
            held.dedicate();
        }
    }

    pub(crate) fn buffer(&self) -> vk::Buffer {
        self.raw.buffer
    }

    /// Says that nothing submitted from now on uses this block by its address.
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
