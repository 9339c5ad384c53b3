// SPDX-License-Identifier: Apache-2.0
//! Lends pages of this process to the driver as host memory (`VK_EXT_external_memory_host`). Any thread.

use ash::vk;

use crate::device::host_pages::HostPages;
use crate::instance::vulkan::Instance;

/// The one kind of handle that is used.
pub(crate) const KIND: vk::ExternalMemoryHandleTypeFlags = vk::ExternalMemoryHandleTypeFlags::HOST_ALLOCATION_EXT;

/// See the module.
pub(crate) struct PageLender {
    calls: ash::ext::external_memory_host::Device,
    /// What places and sizes have to be multiples of.
    granule: u64,
}

/// Pages that can be lent.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LentPages {
    pub(crate) pages: HostPages,
    pub(crate) bytes: u64,
    /// Memory types that may be made of them, a bit each.
    pub(crate) types: u32,
}

impl PageLender {
    /// For a device that takes pages at multiples of `granule`, with the extension enabled.
    pub(crate) fn new(instance: &Instance, device: &ash::Device, granule: u64) -> Self {
        Self { calls: ash::ext::external_memory_host::Device::new(&instance.raw, device), granule }
    }

    /// New pages of at least `bytes`, to be freed by the caller; None where there are none or the driver takes none.
    pub(crate) fn pages(&self, bytes: u64) -> Option<LentPages> {
        let bytes = bytes.checked_next_multiple_of(self.granule.max(HostPages::GRANULE))?;
        let pages = HostPages::new(usize::try_from(bytes).ok()?)?;
        let types = self.types(pages);
        if types.is_none() {
            pages.free();
        }
        Some(LentPages { pages, bytes, types: types? })
    }

    fn types(&self, pages: HostPages) -> Option<u32> {
        let at = pages.at.as_ptr();
        if !(at as u64).is_multiple_of(self.granule) {
            return None;
        }
        let mut found = vk::MemoryHostPointerPropertiesEXT::default();
        // SAFETY: the pages are mapped, at a multiple of the granule, and the handle's kind is the one for pages.
        let asked = unsafe {
            (self.calls.fp().get_memory_host_pointer_properties_ext)(self.calls.device(), KIND, at.cast(), &mut found)
        };
        (asked == vk::Result::SUCCESS).then_some(found.memory_type_bits)
    }
}
