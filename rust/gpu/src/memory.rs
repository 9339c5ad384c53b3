// SPDX-License-Identifier: Apache-2.0
//! One Vulkan buffer with memory of its own: made under the budget, destroyed when nothing uses it.
//!
//! `Device::allocate` is the only place that calls `vkAllocateMemory`. Any thread.

use std::ptr::NonNull;

use ash::vk;

use crate::budget::Account;
use crate::device::Device;
use crate::error::GpuError;
pub use crate::memory_type::Usage;
use crate::memory_type::{HOST_FLAGS, choose_type};
use crate::probe::read_heaps;

/// The address of mapped memory.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Mapped(NonNull<u8>);

// SAFETY: a mapped address may be used from any thread; who may access the bytes when is decided by the owner (`Buffer`
// locks).
unsafe impl Send for Mapped {}
// SAFETY: as for Send: sharing the address gives no access by itself.
unsafe impl Sync for Mapped {}

impl Mapped {
    pub(crate) fn as_ptr(self) -> *mut u8 {
        self.0.as_ptr()
    }
}

/// Raw parts of a buffer. Plain handles: whoever holds the last copy passes it to `Device::destroy_raw` exactly once.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RawBuffer {
    pub(crate) buffer: vk::Buffer,
    memory: vk::DeviceMemory,
    /// Bytes counted in the budget, 0 = none yet.
    reserved: u64,
    account: Account,
    pub(crate) address: u64,
    /// Bytes of the buffer.
    pub(crate) bytes: u64,
    pub(crate) mapped: Option<Mapped>,
    /// Where the host sees it on devices whose memory is the host's (`host_view`); else none.
    pub(crate) seen: Option<Mapped>,
}

/// Smallest buffer, and what sizes are rounded up to: Vulkan has no empty buffers, and addresses stay aligned for
/// vectors.
const SIZE_STEP: u64 = 16;

/// Whether a full budget may be waited out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Patience {
    /// Take back what is free already, but do not wait for the GPU.
    Now,
    /// Wait for the GPU to release retired memory before giving up.
    WaitForRetired,
}

impl Device {
    /// Makes a buffer of at least `bytes` with its own memory, mapped unless `usage` is `Device`.
    ///
    /// # Errors
    /// `TooLarge`, `OutOfMemory` (nothing is held then), `DeviceLost`, or another failed call.
    pub(crate) fn allocate(
        &self,
        name: &str,
        bytes: u64,
        usage: Usage,
        patience: Patience,
    ) -> Result<RawBuffer, GpuError> {
        self.check_alive()?;
        let limit = self.limits.max_allocation_bytes;
        let size = bytes.max(1).checked_next_multiple_of(SIZE_STEP).filter(|&size| size <= limit);
        let size = size.ok_or_else(|| GpuError::TooLarge { name: name.to_owned(), bytes, limit })?;
        let families = self.queues.each_ref().map(|queue| queue.choice.family);
        let mut info = vk::BufferCreateInfo::default().size(size).sharing_mode(vk::SharingMode::EXCLUSIVE).usage(
            vk::BufferUsageFlags::STORAGE_BUFFER
                | vk::BufferUsageFlags::INDIRECT_BUFFER
                | vk::BufferUsageFlags::TRANSFER_SRC
                | vk::BufferUsageFlags::TRANSFER_DST
                | vk::BufferUsageFlags::SHADER_DEVICE_ADDRESS,
        );
        if families[0] != families[1] {
            // Shaders reach memory by address, so no command list knows all that it touches, and what it would have to
            // hand over from family to family. Sharing changes how images are laid out; for buffers drivers do nothing
            // with it.
            info = info.sharing_mode(vk::SharingMode::CONCURRENT).queue_family_indices(&families);
        }
        // SAFETY: the device is alive, the size is not zero, the families differ and are the device's, and
        // bufferDeviceAddress is enabled.
        let buffer = self.check("vkCreateBuffer", unsafe { self.raw.create_buffer(&info, None) })?;
        let mut raw = RawBuffer {
            buffer,
            memory: vk::DeviceMemory::null(),
            reserved: 0,
            account: Account::Device,
            address: 0,
            bytes: size,
            mapped: None,
            seen: None,
        };
        match self.back(&mut raw, name, usage, patience) {
            Ok(()) => {
                self.host_memory.add(&raw);
                Ok(raw)
            }
            Err(error) => {
                self.destroy_raw(raw);
                Err(error)
            }
        }
    }

    /// Gives a new buffer memory, an address and a mapping. On an error the parts made so far are in `raw`.
    fn back(&self, raw: &mut RawBuffer, name: &str, usage: Usage, patience: Patience) -> Result<(), GpuError> {
        self.names.set(raw.buffer, name);
        // SAFETY: the buffer was just created on this device.
        let needs = unsafe { self.raw.get_buffer_memory_requirements(raw.buffer) };
        let limit = self.limits.max_allocation_bytes;
        if needs.size > limit {
            return Err(GpuError::TooLarge { name: name.to_owned(), bytes: needs.size, limit });
        }
        let types = self.memory_types.memory_types_as_slice();
        let kind = choose_type(types, needs.memory_type_bits, usage).ok_or_else(|| GpuError::MissingCapability {
            device: self.report.name.clone(),
            missing: format!("a memory type for {usage:?} buffers"),
        })?;
        let memory_type = types[kind as usize];
        let local = memory_type.property_flags.contains(vk::MemoryPropertyFlags::DEVICE_LOCAL);
        let counted = usage == Usage::Device || (local && !self.unified);
        raw.account = if counted { Account::Device } else { Account::Host };
        raw.memory = self.take_memory(raw, name, (needs.size, kind), patience)?;
        self.names.set(raw.memory, name);
        // SAFETY: both were just created on this device; size, alignment and type come from the requirements.
        let bound = unsafe { self.raw.bind_buffer_memory(raw.buffer, raw.memory, 0) };
        self.check("vkBindBufferMemory", bound)?;
        let info = vk::BufferDeviceAddressInfo::default().buffer(raw.buffer);
        // SAFETY: the buffer has SHADER_DEVICE_ADDRESS usage and is bound to memory allocated with DEVICE_ADDRESS.
        raw.address = unsafe { self.raw.get_buffer_device_address(&info) };
        let is_seen = self.report.host_memory && memory_type.property_flags.contains(HOST_FLAGS);
        if usage != Usage::Device || is_seen {
            let whole = (0, vk::WHOLE_SIZE, vk::MemoryMapFlags::empty());
            // SAFETY: the type is HOST_VISIBLE, and this is the only mapping of this memory.
            let mapped = unsafe { self.raw.map_memory(raw.memory, whole.0, whole.1, whole.2) };
            let mapped = NonNull::new(self.check("vkMapMemory", mapped)?.cast()).map(Mapped);
            raw.mapped = mapped.filter(|_| usage != Usage::Device);
            raw.seen = mapped.filter(|_| is_seen);
        }
        Ok(())
    }

    /// Reserves in the budget and asks the driver; on a shortage takes back what is retired, and tries once more.
    fn take_memory(
        &self,
        raw: &mut RawBuffer,
        name: &str,
        (bytes, memory_type): (u64, u32),
        patience: Patience,
    ) -> Result<vk::DeviceMemory, GpuError> {
        let first = self.try_take(raw, name, bytes, memory_type);
        if !matches!(first, Err(GpuError::OutOfMemory { .. })) {
            return first;
        }
        self.reclaim(patience)?;
        self.try_take(raw, name, bytes, memory_type)
    }

    fn try_take(
        &self,
        raw: &mut RawBuffer,
        name: &str,
        bytes: u64,
        memory_type: u32,
    ) -> Result<vk::DeviceMemory, GpuError> {
        let heap = self.memory_types.memory_types_as_slice()[memory_type as usize].heap_index as usize;
        if raw.account == Account::Device && self.report.capabilities.memory_budget {
            let free = read_heaps(&self.instance, self.physical, true).get(heap).and_then(|heap| heap.free);
            if free.is_some_and(|free| free < bytes) {
                return Err(self.budget.refused(name, bytes));
            }
        }
        self.budget.reserve(name, bytes, raw.account)?;
        let mut flags = vk::MemoryAllocateFlagsInfo::default().flags(vk::MemoryAllocateFlags::DEVICE_ADDRESS);
        let info = vk::MemoryAllocateInfo::default()
            .allocation_size(bytes)
            .memory_type_index(memory_type)
            .push_next(&mut flags);
        // SAFETY: the size is not zero and within maxMemoryAllocationSize; the type index comes from this device's
        // list.
        match unsafe { self.raw.allocate_memory(&info, None) } {
            Ok(memory) => {
                raw.reserved = bytes;
                Ok(memory)
            }
            Err(code) => {
                self.budget.release(bytes, raw.account);
                match code {
                    vk::Result::ERROR_OUT_OF_DEVICE_MEMORY | vk::Result::ERROR_OUT_OF_HOST_MEMORY => {
                        Err(self.budget.refused(name, bytes))
                    }
                    other => self.check("vkAllocateMemory", Err(other)),
                }
            }
        }
    }

    /// Destroys a buffer's parts and gives its bytes back to the budget. The GPU no longer uses it, and `raw` has no
    /// other copy that is used later.
    pub(crate) fn destroy_raw(&self, raw: RawBuffer) {
        self.host_memory.remove(&raw);
        // SAFETY: the caller says that no submission uses it any more; null is allowed.
        unsafe { self.raw.destroy_buffer(raw.buffer, None) };
        // SAFETY: as above; freeing unmaps.
        unsafe { self.raw.free_memory(raw.memory, None) };
        if raw.reserved > 0 {
            self.budget.release(raw.reserved, raw.account);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    type F = vk::MemoryPropertyFlags;

    fn types(flags: &[F]) -> Vec<vk::MemoryType> {
        flags.iter().map(|&property_flags| vk::MemoryType { property_flags, heap_index: 0 }).collect()
    }

    #[test]
    fn discrete_gpus_keep_device_memory_and_staging_apart() {
        let host = F::HOST_VISIBLE | F::HOST_COHERENT;
        let list = types(&[F::empty(), F::DEVICE_LOCAL, host, host | F::HOST_CACHED, F::DEVICE_LOCAL | host]);
        assert_eq!(choose_type(&list, !0, Usage::Device), Some(1), "not the host-visible window");
        assert_eq!(choose_type(&list, !0, Usage::Upload), Some(2), "write-combined host memory");
        assert_eq!(choose_type(&list, !0, Usage::Readback), Some(3), "cached host memory");
        assert_eq!(choose_type(&list, 0b1_0010, Usage::Readback), Some(4), "the window when nothing else is allowed");
        assert_eq!(choose_type(&list, 0b1, Usage::Device), None, "no type fits");
    }

    #[test]
    fn unified_devices_use_their_one_type() {
        let list = types(&[F::DEVICE_LOCAL | F::HOST_VISIBLE | F::HOST_COHERENT | F::HOST_CACHED]);
        for usage in [Usage::Device, Usage::Upload, Usage::Readback] {
            assert_eq!(choose_type(&list, !0, usage), Some(0), "{usage:?}");
        }
    }

    #[test]
    fn types_that_need_a_feature_are_left_alone() {
        let list = types(&[F::DEVICE_LOCAL | F::DEVICE_UNCACHED_AMD, F::DEVICE_LOCAL | F::PROTECTED, F::DEVICE_LOCAL]);
        assert_eq!(choose_type(&list, !0, Usage::Device), Some(2), "plain device memory");
    }
}
