// SPDX-License-Identifier: Apache-2.0
//! An open device: the logical one with its queues and its heaps, whose memory is reclaimed when the GPU has finished.
//!
//! Shared by [`Gpu`](crate::Gpu), heaps, staging rings and views; the objects that command lists keep alive hold only
//! the logical device, so nothing in flight refers to this type. Any thread.

use std::sync::{Arc, Mutex, PoisonError, Weak};

use crate::device::logical::LogicalDevice;
use crate::device::raw_buffer::RawBuffer;
use crate::error::GpuError;
use crate::instance::lane::{LANES, QueueLane, TimelinePoints};
use crate::instance::memory_type::BufferUsage;
use crate::memory::allocate::NewBuffer;
use crate::memory::arena::HeapArenas;
use crate::memory::block::MemoryBlock;
use crate::submit::queue::{InFlight, Queue};

/// Decides if an allocation may wait while the budget is full.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum BudgetWait {
    /// Takes back memory that is free already, but does not wait for the GPU.
    Now,
    /// Waits for the GPU to release retired memory before giving up.
    WaitForRetired,
}

/// A logical device with its queues and heaps.
#[derive(Debug)]
pub(crate) struct OpenDevice {
    queues: [Queue; LANES],
    heaps: Mutex<Vec<Weak<HeapArenas>>>,
    /// Dropped last, because the queues are made from it.
    pub(crate) device: Arc<LogicalDevice>,
}

impl OpenDevice {
    pub(crate) fn new(device: Arc<LogicalDevice>) -> Self {
        Self { queues: Queue::of_lanes(&device), heaps: Mutex::new(Vec::new()), device }
    }

    pub(crate) fn queue(&self, lane: QueueLane) -> &Queue {
        &self.queues[lane.index()]
    }

    /// Adds a heap, whose empty arenas are freed if memory is short.
    pub(crate) fn add_heap(&self, arenas: &Arc<HeapArenas>) {
        self.heaps.lock().unwrap_or_else(PoisonError::into_inner).push(Arc::downgrade(arenas));
    }

    /// Heaps that still exist.
    fn heaps(&self) -> Vec<Arc<HeapArenas>> {
        let mut heaps = self.heaps.lock().unwrap_or_else(PoisonError::into_inner);
        heaps.retain(|heap| heap.strong_count() > 0);
        heaps.iter().filter_map(Weak::upgrade).collect()
    }

    /// Releases everything that finished submissions used.
    pub(crate) fn collect(&self) {
        let completed = self.device.completed();
        for lane in QueueLane::ALL {
            let queue = self.queue(lane);
            for InFlight { slot, kept, timer, .. } in queue.take_finished(&self.device, completed.of(lane)) {
                queue.recycle(&self.device, slot);
                // Objects that the submission kept alive may be retired by this drop.
                drop((kept, timer));
            }
        }
        self.device.release(completed);
        for heap in self.heaps() {
            heap.release(completed);
        }
    }

    /// Makes room: collects, empties heaps of unused arenas and, if allowed, waits for retired memory.
    pub(crate) fn reclaim(&self, patience: BudgetWait) -> Result<(), GpuError> {
        self.collect();
        self.trim_heaps();
        if patience == BudgetWait::WaitForRetired
            && let Some(points) = self.last_retired()
        {
            self.device.wait_for(points)?;
            self.collect();
            self.trim_heaps();
        }
        Ok(())
    }

    fn trim_heaps(&self) {
        for heap in self.heaps() {
            heap.trim(0);
        }
    }

    /// The points after which everything retired now can be destroyed; `None` if nothing is retired.
    fn last_retired(&self) -> Option<TimelinePoints> {
        let of_heaps = self.heaps().into_iter().filter_map(|heap| heap.last_retired());
        self.device.last_retired().into_iter().chain(of_heaps).reduce(TimelinePoints::later)
    }

    /// Makes a buffer of at least `bytes` with its own memory, mapped unless `usage` is one of device memory. On
    /// a shortage it takes back retired memory, and tries once more.
    ///
    /// # Errors
    /// `TooLarge`, `OutOfMemory` (nothing is held then), `DeviceLost`, or another failed call.
    pub(crate) fn allocate(
        &self,
        name: &str,
        bytes: u64,
        usage: BufferUsage,
        patience: BudgetWait,
    ) -> Result<RawBuffer, GpuError> {
        let usage = match usage {
            // Memory that cannot be lent is made by the driver.
            BufferUsage::Shared => match self.lent(name, bytes)? {
                Some(lent) => return Ok(lent),
                None => BufferUsage::Readback,
            },
            BufferUsage::Exported if self.device.exporting.is_none() => BufferUsage::Device,
            usage => usage,
        };
        let mut new = NewBuffer::new(&self.device, name, bytes, usage)?;
        match new.take_memory() {
            Err(GpuError::OutOfMemory { .. }) => {
                self.reclaim(patience)?;
                new.take_memory()?;
            }
            taken => taken?,
        }
        new.finish()
    }

    /// A buffer of pages of this process; `None` if the driver takes none.
    fn lent(&self, name: &str, bytes: u64) -> Result<Option<RawBuffer>, GpuError> {
        let Some(lending) = &self.device.lending else { return Ok(None) };
        let mut new = NewBuffer::new(&self.device, name, bytes, BufferUsage::Shared)?;
        if new.lend(lending)? { new.finish().map(Some) } else { Ok(None) }
    }

    /// The memory of a buffer; waits for retired memory before it gives up.
    pub(crate) fn block(&self, name: &str, bytes: u64, usage: BufferUsage) -> Result<MemoryBlock, GpuError> {
        #[cfg(feature = "faults")]
        self.device.planted(crate::device::watch::DriverCall::Buffer, name, bytes)?;
        Ok(MemoryBlock::new(&self.device, self.allocate(name, bytes, usage, BudgetWait::WaitForRetired)?))
    }
}

impl Drop for OpenDevice {
    fn drop(&mut self) {
        // SAFETY: no other thread can use the queues: this is their last holder.
        if let Err(code) = unsafe { self.device.raw.device_wait_idle() } {
            tracing::debug!("vkDeviceWaitIdle failed while closing: {code:?}");
        }
        for queue in &self.queues {
            queue.close(&self.device);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::open;

    #[test]
    fn host_pages_are_imported_where_the_driver_supports_it() {
        let gpu = open();
        let takes = gpu.report().capabilities.external_memory_host;
        for bytes in [1, 100_000, 40 << 20] {
            let before = gpu.memory().host_used;
            let raw = gpu.opened().allocate("lent", bytes, BufferUsage::Shared, BudgetWait::Now).expect("memory");
            assert!(raw.mapped.is_some() && raw.bytes >= bytes, "{raw:?}");
            assert_eq!(raw.pages.is_some(), takes, "{raw:?}");
            assert!(gpu.memory().host_used >= before + bytes, "counted");
            gpu.device().destroy(raw);
            assert_eq!(gpu.memory().host_used, before, "given back");
        }
        let log = gpu.validation_log();
        drop(gpu);
        assert_eq!(log.take(), Vec::<String>::new(), "validation");
    }
}
