// SPDX-License-Identifier: Apache-2.0
//! The raw parts of a buffer: handles, address, mapping, and what the budget counts for it. Any thread.

use ash::vk;

use crate::device::budget::{MemoryAccount, MemoryBudget};
use crate::device::heap_counters::HeldBytes;
use crate::device::host_pages::HostPages;
use crate::device::mapped::MappedPointer;

/// Raw parts of a buffer. Plain handles: whoever holds the last copy destroys it exactly once.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RawBuffer {
    pub(crate) buffer: vk::Buffer,
    pub(crate) memory: vk::DeviceMemory,
    /// Bytes counted in the budget, 0 = none yet.
    pub(crate) reserved: u64,
    pub(crate) account: MemoryAccount,
    pub(crate) address: u64,
    /// Bytes of the buffer.
    pub(crate) bytes: u64,
    pub(crate) mapped: Option<MappedPointer>,
    /// The process's own pages, where the driver was lent them.
    pub(crate) pages: Option<HostPages>,
    /// Where the host sees it on devices whose memory is the host's (`host_view`); else none.
    pub(crate) seen: Option<MappedPointer>,
}

impl RawBuffer {
    /// Destroys the parts and gives the bytes back to the budget. The GPU no longer uses them, and no other copy is
    /// used later.
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

/// A buffer that nobody holds any more but the GPU may still use.
#[derive(Debug)]
pub(crate) struct RetiredBuffer {
    pub(crate) raw: RawBuffer,
    /// Its memory's place in the count of a heap.
    pub(crate) held: Option<HeldBytes>,
}
