// SPDX-License-Identifier: Apache-2.0
//! Chooses the memory type of buffers, and decides if the host sees all of it. Pure, any thread.

use ash::vk;

/// Location and purpose of a buffer's memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BufferUsage {
    /// Device memory, not reachable by the host. It counts against the budget.
    Device,
    /// The same, but other libraries of this process may import it, if the driver can export memory
    /// (`VK_KHR_external_memory_fd`).
    Exported,
    /// Host memory that the host writes and the device reads; always mapped.
    Upload,
    /// Host memory that the device writes and the host reads; always mapped.
    Readback,
    /// Host memory that both read and write, the host through [`DeviceRange::fill`](crate::DeviceRange::fill). If pages
    /// can be lent to the driver (`VK_EXT_external_memory_host`), it is several times faster to allocate than the
    /// others.
    Shared,
}

impl BufferUsage {
    /// Returns true if it is device memory, which the host does not map.
    pub(crate) fn is_device(self) -> bool {
        matches!(self, Self::Device | Self::Exported)
    }
}

/// What Vulkan is told that buffers are for: everything.
pub(crate) const BUFFER_USAGES: vk::BufferUsageFlags = vk::BufferUsageFlags::from_raw(
    vk::BufferUsageFlags::STORAGE_BUFFER.as_raw()
        | vk::BufferUsageFlags::INDIRECT_BUFFER.as_raw()
        | vk::BufferUsageFlags::TRANSFER_SRC.as_raw()
        | vk::BufferUsageFlags::TRANSFER_DST.as_raw()
        | vk::BufferUsageFlags::SHADER_DEVICE_ADDRESS.as_raw(),
);

/// The only kind of handle by which memory is exported.
pub(crate) const EXPORTED_KIND: vk::ExternalMemoryHandleTypeFlags = vk::ExternalMemoryHandleTypeFlags::OPAQUE_FD;

const KNOWN_FLAGS: vk::MemoryPropertyFlags = vk::MemoryPropertyFlags::from_raw(
    vk::MemoryPropertyFlags::DEVICE_LOCAL.as_raw()
        | vk::MemoryPropertyFlags::HOST_VISIBLE.as_raw()
        | vk::MemoryPropertyFlags::HOST_COHERENT.as_raw()
        | vk::MemoryPropertyFlags::HOST_CACHED.as_raw(),
);

/// Properties that memory needs so that the host can read and write it as its own.
pub(crate) const HOST_FLAGS: vk::MemoryPropertyFlags = vk::MemoryPropertyFlags::from_raw(
    vk::MemoryPropertyFlags::HOST_VISIBLE.as_raw() | vk::MemoryPropertyFlags::HOST_COHERENT.as_raw(),
);

/// The memory type for a usage among those in `allowed` (a bit each): required flags, then fewest unwanted and most
/// wanted ones.
pub(crate) fn choose_type(types: &[vk::MemoryType], allowed: u32, usage: BufferUsage) -> Option<u32> {
    type MemoryFlags = vk::MemoryPropertyFlags;
    let host = MemoryFlags::HOST_VISIBLE | MemoryFlags::HOST_COHERENT;
    let (required, wanted, unwanted) = match usage {
        BufferUsage::Device | BufferUsage::Exported => {
            (MemoryFlags::DEVICE_LOCAL, MemoryFlags::empty(), MemoryFlags::HOST_VISIBLE | MemoryFlags::HOST_CACHED)
        }
        BufferUsage::Upload => (host, MemoryFlags::empty(), MemoryFlags::DEVICE_LOCAL | MemoryFlags::HOST_CACHED),
        BufferUsage::Readback | BufferUsage::Shared => (host, MemoryFlags::HOST_CACHED, MemoryFlags::DEVICE_LOCAL),
    };
    let penalty =
        |flags: MemoryFlags| (flags & unwanted).as_raw().count_ones() + (wanted & !flags).as_raw().count_ones();
    (0_u32..)
        .zip(types)
        .filter(|(i, kind)| {
            allowed & (1 << i) != 0
                && kind.property_flags.contains(required)
                && KNOWN_FLAGS.contains(kind.property_flags)
        })
        .min_by_key(|(i, kind)| (penalty(kind.property_flags), *i))
        .map(|(i, _)| i)
}

/// Returns true if the memory that buffers get is mapped and coherent whatever they are for.
pub(crate) fn is_all_mapped(types: &[vk::MemoryType]) -> bool {
    let seen = |usage| {
        choose_type(types, u32::MAX, usage)
            .and_then(|index| types.get(index as usize))
            .is_some_and(|found| found.property_flags.contains(HOST_FLAGS))
    };
    [BufferUsage::Device, BufferUsage::Upload, BufferUsage::Readback, BufferUsage::Shared].into_iter().all(seen)
}

#[cfg(test)]
mod tests {
    use super::*;

    type MemoryFlags = vk::MemoryPropertyFlags;

    fn types(flags: &[MemoryFlags]) -> Vec<vk::MemoryType> {
        flags.iter().map(|&property_flags| vk::MemoryType { property_flags, heap_index: 0 }).collect()
    }

    #[test]
    fn discrete_gpus_keep_device_memory_and_staging_apart() {
        let host = MemoryFlags::HOST_VISIBLE | MemoryFlags::HOST_COHERENT;
        let list = types(&[
            MemoryFlags::empty(),
            MemoryFlags::DEVICE_LOCAL,
            host,
            host | MemoryFlags::HOST_CACHED,
            MemoryFlags::DEVICE_LOCAL | host,
        ]);
        assert_eq!(choose_type(&list, !0, BufferUsage::Device), Some(1), "not the host-visible window");
        assert_eq!(choose_type(&list, !0, BufferUsage::Upload), Some(2), "write-combined host memory");
        assert_eq!(choose_type(&list, !0, BufferUsage::Readback), Some(3), "cached host memory");
        assert_eq!(
            choose_type(&list, 0b1_0010, BufferUsage::Readback),
            Some(4),
            "the window when nothing else is allowed"
        );
        assert_eq!(choose_type(&list, 0b1, BufferUsage::Device), None, "no type fits");
    }

    #[test]
    fn unified_devices_use_their_one_type() {
        let list = types(&[MemoryFlags::DEVICE_LOCAL
            | MemoryFlags::HOST_VISIBLE
            | MemoryFlags::HOST_COHERENT
            | MemoryFlags::HOST_CACHED]);
        for usage in [BufferUsage::Device, BufferUsage::Upload, BufferUsage::Readback] {
            assert_eq!(choose_type(&list, !0, usage), Some(0), "{usage:?}");
        }
    }

    #[test]
    fn types_that_need_a_feature_are_left_alone() {
        let list = types(&[
            MemoryFlags::DEVICE_LOCAL | MemoryFlags::DEVICE_UNCACHED_AMD,
            MemoryFlags::DEVICE_LOCAL | MemoryFlags::PROTECTED,
            MemoryFlags::DEVICE_LOCAL,
        ]);
        assert_eq!(choose_type(&list, !0, BufferUsage::Device), Some(2), "plain device memory");
    }

    #[test]
    fn memory_is_all_mapped_where_no_buffer_gets_another_kind() {
        let all = MemoryFlags::DEVICE_LOCAL | HOST_FLAGS | MemoryFlags::HOST_CACHED;
        assert!(is_all_mapped(&types(&[all])), "one kind of memory, as processors have");
        assert!(!is_all_mapped(&types(&[all, MemoryFlags::DEVICE_LOCAL])), "device memory is the device's own");
        assert!(!is_all_mapped(&types(&[MemoryFlags::DEVICE_LOCAL | MemoryFlags::HOST_VISIBLE])), "not coherent");
        assert!(!is_all_mapped(&[]), "none");
    }
}
