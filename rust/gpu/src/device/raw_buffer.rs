// SPDX-License-Identifier: Apache-2.0
//! The raw parts of a buffer: handles, address, mapping, and its share of the budget. Any thread.

use ash::vk;

use crate::device::budget::{MemoryAccount, MemoryBudget};
use crate::device::heap_counters::HeldBytes;
use crate::device::host_pages::HostPages;
use crate::device::mapped::MappedPointer;

/// Raw parts of a buffer, as plain handles: the owner of the last copy destroys it exactly once.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RawBuffer {
    pub(crate) buffer: vk::Buffer,
    pub(crate) memory: vk::DeviceMemory,
    /// Bytes counted in the budget, 0 = none yet.
    pub(crate) reserved: u64,
    pub(crate) account: MemoryAccount,
    pub(crate) address: u64,
    /// Size of the buffer, bytes.
    pub(crate) bytes: u64,
    pub(crate) mapped: Option<MappedPointer>,
    /// Pages of the process, if they are lent to the driver.
    pub(crate) pages: Option<HostPages>,
    /// True if the memory can be exported.
    pub(crate) exported: bool,
    /// Address for the host on devices that share the host's memory (`host_view`); else `None`.
    pub(crate) seen: Option<MappedPointer>,
}

impl RawBuffer {
    /// Destroys the parts and returns the bytes to the budget. The GPU no longer uses them, and no other copy is used
    /// later.
    pub(crate) fn destroy(self, device: &ash::Device, budget: &MemoryBudget) {
        // SAFETY: the caller says that no submission uses it any more; null is allowed.
        unsafe { device.destroy_buffer(self.buffer, None) };
        // SAFETY: as above; freeing unmaps.
        unsafe { device.free_memory(self.memory, None) };
        if let Some(pages) = self.pages {
            pages.free();
        }
        if self.reserved > 0 {
            budget.release(self.reserved, self.account);
        }
    }
}

/// A buffer without an owner that the GPU may still use.
#[derive(Debug)]
pub(crate) struct RetiredBuffer {
    pub(crate) raw: RawBuffer,
    /// Its memory in the counters of a heap.
    pub(crate) held: Option<HeldBytes>,
}
