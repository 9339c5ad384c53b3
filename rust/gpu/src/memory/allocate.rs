// SPDX-License-Identifier: Apache-2.0
//! Creates buffers with memory of their own, within the budget.
//!
//! [`NewBuffer::take_memory`] is the only place that calls `vkAllocateMemory`; a caller that can make room calls it
//! again. Any thread.

use std::ptr::NonNull;

use ash::vk;

use crate::device::budget::MemoryAccount;
use crate::device::host_pages::HostPages;
use crate::device::lending::{self, LentPages, PageLender};
use crate::device::logical::LogicalDevice;
use crate::device::mapped::MappedPointer;
use crate::device::raw_buffer::RawBuffer;
use crate::error::GpuError;
use crate::instance::memory_type::{BUFFER_USAGES, BufferUsage, EXPORTED_KIND, HOST_FLAGS, choose_type};
use crate::instance::probe::read_heaps;

/// Smallest size of a buffer, and the multiple to which sizes are rounded up: Vulkan has no empty buffers, and
/// addresses stay aligned for vectors.
const SIZE_STEP: u64 = 16;

/// A buffer under construction: first without memory, then with it, then mapped. It is destroyed if it is dropped
/// before.
pub(crate) struct NewBuffer<'a> {
    device: &'a LogicalDevice,
    name: &'a str,
    usage: BufferUsage,
    raw: RawBuffer,
    /// Requirements of the driver: bytes, and the type chosen for it.
    needs: (u64, u32),
    /// Memory types that it allows, one bit each.
    types: u32,
    is_finished: bool,
}

impl<'a> NewBuffer<'a> {
    /// Creates a buffer of at least `bytes`.
    ///
    /// # Errors
    /// `TooLarge`, `DeviceLost`, or another failed call.
    pub(crate) fn new(
        device: &'a LogicalDevice,
        name: &'a str,
        bytes: u64,
        usage: BufferUsage,
    ) -> Result<Self, GpuError> {
        device.check_alive()?;
        let limit = device.limits.max_allocation_bytes;
        let size = bytes.max(1).checked_next_multiple_of(SIZE_STEP).filter(|&size| size <= limit);
        let size = size.ok_or_else(|| GpuError::TooLarge { name: name.to_owned(), bytes, limit })?;
        let families = device.choices.map(|choice| choice.family);
        let sharing = vk::SharingMode::EXCLUSIVE;
        let mut info = vk::BufferCreateInfo::default().size(size).sharing_mode(sharing).usage(BUFFER_USAGES);
        if families[0] != families[1] {
            // Shaders reach memory by address, so no command list knows all buffers that it touches, nor those whose
            // ownership it would have to transfer between families. Sharing changes the layout of images; for buffers
            // drivers do nothing with it.
            info = info.sharing_mode(vk::SharingMode::CONCURRENT).queue_family_indices(&families);
        }
        // The kind of memory that the buffer will be bound to, and no other.
        let kind = if usage == BufferUsage::Exported { EXPORTED_KIND } else { lending::KIND };
        let mut external = vk::ExternalMemoryBufferCreateInfo::default().handle_types(kind);
        if matches!(usage, BufferUsage::Shared | BufferUsage::Exported) {
            info = info.push_next(&mut external);
        }
        // SAFETY: the device is alive, the size is not zero, the families differ and are the device's, and
        // bufferDeviceAddress is enabled.
        let buffer = device.check("vkCreateBuffer", unsafe { device.raw.create_buffer(&info, None) })?;
        let raw = RawBuffer {
            buffer,
            memory: vk::DeviceMemory::null(),
            reserved: 0,
            account: MemoryAccount::Device,
            address: 0,
            bytes: size,
            mapped: None,
            pages: None,
            exported: usage == BufferUsage::Exported,
            seen: None,
        };
        let mut new = Self { device, name, usage, raw, needs: (0, 0), types: 0, is_finished: false };
        new.choose_memory()?;
        Ok(new)
    }

    fn choose_memory(&mut self) -> Result<(), GpuError> {
        let Self { device, name, usage, raw, types: allowed, .. } = self;
        device.names.set(raw.buffer, name);
        // SAFETY: the buffer was just created on this device.
        let needs = unsafe { device.raw.get_buffer_memory_requirements(raw.buffer) };
        let limit = device.limits.max_allocation_bytes;
        if needs.size > limit {
            return Err(GpuError::TooLarge { name: (*name).to_owned(), bytes: needs.size, limit });
        }
        let types = device.memory_types.memory_types_as_slice();
        *allowed = needs.memory_type_bits;
        let kind = choose_type(types, *allowed, *usage).ok_or_else(|| GpuError::MissingCapability {
            device: device.report.name.clone(),
            missing: format!("a memory type for {usage:?} buffers"),
        })?;
        self.needs = (needs.size, kind);
        let local = self.memory_flags().contains(vk::MemoryPropertyFlags::DEVICE_LOCAL);
        let counted = self.usage.is_device() || (local && !self.device.unified);
        self.raw.account = if counted { MemoryAccount::Device } else { MemoryAccount::Host };
        Ok(())
    }

    fn memory_flags(&self) -> vk::MemoryPropertyFlags {
        self.device.memory_types.memory_types_as_slice()[self.needs.1 as usize].property_flags
    }

    /// Reserves in the budget and asks the driver.
    ///
    /// # Errors
    /// `OutOfMemory`: nothing is held then, and it may be called again. `DeviceLost`, or another failed call.
    pub(crate) fn take_memory(&mut self) -> Result<(), GpuError> {
        let Self { device, name, raw, usage, needs: (bytes, memory_type), .. } = self;
        let (bytes, memory_type) = (*bytes, *memory_type);
        let heap = device.memory_types.memory_types_as_slice()[memory_type as usize].heap_index as usize;
        if raw.account == MemoryAccount::Device && device.report.capabilities.memory_budget {
            let free = read_heaps(&device.instance, device.physical, true).get(heap).and_then(|heap| heap.free);
            if free.is_some_and(|free| free < bytes) {
                return Err(device.budget.refused(name, bytes));
            }
        }
        device.budget.reserve(name, bytes, raw.account)?;
        match allocate(device, (bytes, memory_type), None, *usage == BufferUsage::Exported) {
            Ok(memory) => {
                raw.memory = memory;
                raw.reserved = bytes;
                Ok(())
            }
            Err(code) => {
                device.budget.release(bytes, raw.account);
                match code {
                    vk::Result::ERROR_OUT_OF_DEVICE_MEMORY | vk::Result::ERROR_OUT_OF_HOST_MEMORY => {
                        Err(device.budget.refused(name, bytes))
                    }
                    other => device.check("vkAllocateMemory", Err(other)),
                }
            }
        }
    }

    /// Makes the memory of pages of this process. Returns false if there are none, or the driver does not take them.
    ///
    /// # Errors
    /// `DeviceLost`.
    pub(crate) fn lend(&mut self, lending: &PageLender) -> Result<bool, GpuError> {
        let Self { device, name, raw, needs: (bytes, _), types, .. } = self;
        let Some(LentPages { pages, bytes, types: of_pages }) = lending.pages(*bytes) else { return Ok(false) };
        // The pages are freed with the buffer, whatever happens to it.
        raw.pages = Some(pages);
        let known = device.memory_types.memory_types_as_slice();
        let Some(memory_type) = choose_type(known, *types & of_pages, BufferUsage::Shared) else { return Ok(false) };
        if bytes > device.limits.max_allocation_bytes {
            return Ok(false);
        }
        raw.account = MemoryAccount::Host;
        device.budget.reserve(name, bytes, raw.account)?;
        match allocate(device, (bytes, memory_type), Some(pages), false) {
            Ok(memory) => {
                (raw.memory, raw.reserved, self.needs) = (memory, bytes, (bytes, memory_type));
                Ok(true)
            }
            Err(vk::Result::ERROR_DEVICE_LOST) => {
                device.budget.release(bytes, raw.account);
                device.check("vkAllocateMemory", Err(vk::Result::ERROR_DEVICE_LOST))
            }
            Err(code) => {
                device.budget.release(bytes, raw.account);
                tracing::debug!(?code, bytes, "the driver takes no pages of the host");
                Ok(false)
            }
        }
    }

    /// Binds the memory that was taken, and maps it unless the usage is one of device memory.
    ///
    /// # Errors
    /// A failed call; the buffer is destroyed then.
    pub(crate) fn finish(mut self) -> Result<RawBuffer, GpuError> {
        let device = self.device;
        device.names.set(self.raw.memory, self.name);
        // SAFETY: both were just created on this device; size, alignment and type come from the requirements.
        let bound = unsafe { device.raw.bind_buffer_memory(self.raw.buffer, self.raw.memory, 0) };
        device.check("vkBindBufferMemory", bound)?;
        let info = vk::BufferDeviceAddressInfo::default().buffer(self.raw.buffer);
        // SAFETY: the buffer has SHADER_DEVICE_ADDRESS usage and is bound to memory allocated with DEVICE_ADDRESS.
        self.raw.address = unsafe { device.raw.get_buffer_device_address(&info) };
        let is_seen = device.report.host_memory && self.memory_flags().contains(HOST_FLAGS);
        if let Some(pages) = self.raw.pages {
            self.raw.mapped = Some(pages.at);
            self.raw.seen = is_seen.then_some(pages.at);
        } else if !self.usage.is_device() || is_seen {
            let whole = (0, vk::WHOLE_SIZE, vk::MemoryMapFlags::empty());
            // SAFETY: the type is HOST_VISIBLE, and this is the only mapping of this memory.
            let mapped = unsafe { device.raw.map_memory(self.raw.memory, whole.0, whole.1, whole.2) };
            let mapped = NonNull::new(device.check("vkMapMemory", mapped)?.cast()).map(MappedPointer);
            self.raw.mapped = mapped.filter(|_| !self.usage.is_device());
            self.raw.seen = mapped.filter(|_| is_seen);
        }
        device.host_memory.add(&self.raw);
        self.is_finished = true;
        Ok(self.raw)
    }
}

/// Allocates memory of this size, not 0 and within `maxMemoryAllocationSize`, and of this type of the device's list; of
/// pages that the type allows, if there are any; to be exported, which the device can then.
fn allocate(
    device: &LogicalDevice,
    (bytes, memory_type): (u64, u32),
    pages: Option<HostPages>,
    is_exported: bool,
) -> Result<vk::DeviceMemory, vk::Result> {
    let mut flags = vk::MemoryAllocateFlagsInfo::default().flags(vk::MemoryAllocateFlags::DEVICE_ADDRESS);
    let mut import = vk::ImportMemoryHostPointerInfoEXT::default().handle_type(lending::KIND);
    let mut info =
        vk::MemoryAllocateInfo::default().allocation_size(bytes).memory_type_index(memory_type).push_next(&mut flags);
    if let Some(pages) = pages {
        import.p_host_pointer = pages.at.as_ptr().cast();
        info = info.push_next(&mut import);
    }
    let mut export = vk::ExportMemoryAllocateInfo::default().handle_types(EXPORTED_KIND);
    if is_exported {
        info = info.push_next(&mut export);
    }
    // SAFETY: size and type are as the caller says; the pages are mapped until the memory is freed, at a place and of
    // a size that the extension allows.
    unsafe { device.raw.allocate_memory(&info, None) }
}

impl Drop for NewBuffer<'_> {
    fn drop(&mut self) {
        if !self.is_finished {
            self.device.destroy(self.raw);
        }
    }
}
