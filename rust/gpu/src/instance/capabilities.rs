// SPDX-License-Identifier: Apache-2.0
//! The capabilities of a device, probed once, and the features that are enabled.
//!
//! `probe` reads, [`DeviceCapabilities::missing`] decides, `FeatureChain::enable` asks for exactly what was found. Any
//! thread.

use ash::vk;

/// Capabilities found on a device. The first group is required, the second is used if present.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct DeviceCapabilities {
    /// Required: the device speaks Vulkan 1.2 or newer.
    pub vulkan_1_2: bool,
    /// Required: 64-bit integers in shaders.
    pub shader_int64: bool,
    /// Required: memory is reached by address.
    pub buffer_device_address: bool,
    /// Required: structures are laid out as in `#[repr(C)]`.
    pub scalar_block_layout: bool,
    /// Required: submissions are counted by a timeline semaphore.
    pub timeline_semaphore: bool,
    /// Required: timestamp queries are reset by the host.
    pub host_query_reset: bool,
    /// Required: subgroup vote, ballot, arithmetic and shuffle in compute shaders.
    pub subgroup_operations: bool,
    /// Required: a queue family that computes.
    pub compute_queue: bool,

    /// `VK_EXT_memory_budget`: the driver reports free memory.
    pub memory_budget: bool,
    /// `VK_EXT_external_memory_host`: pages of this process can be lent to the driver.
    pub external_memory_host: bool,
    /// `VK_KHR_external_memory_fd`: other libraries of this process can import buffers.
    pub external_memory_fd: bool,
    /// The compute queue writes timestamps.
    pub timestamps: bool,
    /// 64-bit atomics on shared memory.
    pub shader_shared_int64_atomics: bool,
    /// 64-bit floats in shaders.
    pub shader_float64: bool,
    /// 16-bit integers in shaders and buffers.
    pub shader_int16: bool,
    /// 8-bit integers in shaders and buffers.
    pub shader_int8: bool,
    /// 16-bit floats in shaders.
    pub shader_float16: bool,
    /// The Vulkan memory model at device scope.
    pub vulkan_memory_model: bool,
}

impl DeviceCapabilities {
    /// Names of required capabilities that are missing; empty if the device can be used.
    #[must_use]
    pub fn missing(&self) -> Vec<&'static str> {
        if !self.vulkan_1_2 {
            return vec!["Vulkan 1.2"];
        }
        [
            (self.shader_int64, "shaderInt64"),
            (self.buffer_device_address, "bufferDeviceAddress"),
            (self.scalar_block_layout, "scalarBlockLayout"),
            (self.timeline_semaphore, "timelineSemaphore"),
            (self.host_query_reset, "hostQueryReset"),
            (self.subgroup_operations, "subgroup vote, ballot, arithmetic and shuffle in compute shaders"),
            (self.compute_queue, "a compute queue"),
        ]
        .into_iter()
        .filter_map(|(present, name)| (!present).then_some(name))
        .collect()
    }

    /// Name and presence of the capabilities that are used when present, for `doctor`.
    #[must_use]
    pub fn optional(&self) -> [(&'static str, bool); 10] {
        [
            ("memory budget", self.memory_budget),
            ("external host memory", self.external_memory_host),
            ("exported memory", self.external_memory_fd),
            ("timestamps", self.timestamps),
            ("shared int64 atomics", self.shader_shared_int64_atomics),
            ("float64", self.shader_float64),
            ("int16", self.shader_int16),
            ("int8", self.shader_int8),
            ("float16", self.shader_float16),
            ("memory model", self.vulkan_memory_model),
        ]
    }
}

/// Reads the features of a device that speaks at least Vulkan 1.2.
pub(crate) fn probe_features(
    instance: &ash::Instance,
    physical: vk::PhysicalDevice,
    subgroup: &vk::PhysicalDeviceVulkan11Properties<'_>,
) -> DeviceCapabilities {
    let mut v11 = vk::PhysicalDeviceVulkan11Features::default();
    let mut v12 = vk::PhysicalDeviceVulkan12Features::default();
    let mut features = vk::PhysicalDeviceFeatures2::default().push_next(&mut v11).push_next(&mut v12);
    // SAFETY: `physical` comes from `instance`, and the caller checked that both structures of 1.2 are known to it.
    unsafe { instance.get_physical_device_features2(physical, &mut features) };
    let core = features.features;
    let yes = |value: vk::Bool32| value == vk::TRUE;
    let operations = vk::SubgroupFeatureFlags::VOTE
        | vk::SubgroupFeatureFlags::BALLOT
        | vk::SubgroupFeatureFlags::ARITHMETIC
        | vk::SubgroupFeatureFlags::SHUFFLE;
    DeviceCapabilities {
        vulkan_1_2: true,
        shader_int64: yes(core.shader_int64),
        buffer_device_address: yes(v12.buffer_device_address),
        scalar_block_layout: yes(v12.scalar_block_layout),
        timeline_semaphore: yes(v12.timeline_semaphore),
        host_query_reset: yes(v12.host_query_reset),
        compute_queue: false,
        memory_budget: false,
        external_memory_host: false,
        external_memory_fd: false,
        timestamps: false,
        shader_shared_int64_atomics: yes(v12.shader_shared_int64_atomics),
        shader_float64: yes(core.shader_float64),
        shader_int16: yes(core.shader_int16) && yes(v11.storage_buffer16_bit_access),
        shader_int8: yes(v12.shader_int8) && yes(v12.storage_buffer8_bit_access),
        shader_float16: yes(v12.shader_float16) && yes(v11.storage_buffer16_bit_access),
        vulkan_memory_model: yes(v12.vulkan_memory_model) && yes(v12.vulkan_memory_model_device_scope),
        subgroup_operations: subgroup.subgroup_supported_operations.contains(operations)
            && subgroup.subgroup_supported_stages.contains(vk::ShaderStageFlags::COMPUTE),
    }
}

#[cfg(feature = "faults")]
thread_local! {
    static HIDDEN: std::cell::Cell<Option<fn(&mut DeviceCapabilities)>> = const { std::cell::Cell::new(None) };
}

/// For tests: devices that this thread looks for or opens from now on lack the capabilities that `hide` removes.
#[cfg(feature = "faults")]
pub fn hide_capabilities(hide: Option<fn(&mut DeviceCapabilities)>) {
    HIDDEN.set(hide);
}

/// Removes the capabilities that a test wants to be missing.
#[cfg(feature = "faults")]
pub(crate) fn hide(capabilities: &mut DeviceCapabilities) {
    if let Some(hide) = HIDDEN.get() {
        hide(capabilities);
    }
}

/// The structures that enable features, kept together because they are chained by address.
#[derive(Debug)]
pub(crate) struct FeatureChain {
    pub(crate) core: vk::PhysicalDeviceFeatures,
    pub(crate) v11: vk::PhysicalDeviceVulkan11Features<'static>,
    pub(crate) v12: vk::PhysicalDeviceVulkan12Features<'static>,
}

impl FeatureChain {
    /// Enables everything in `found` and nothing else.
    pub(crate) fn enable(found: &DeviceCapabilities) -> Self {
        let sixteen = found.shader_int16 || found.shader_float16;
        Self {
            core: vk::PhysicalDeviceFeatures::default()
                .shader_int64(found.shader_int64)
                .shader_int16(found.shader_int16)
                .shader_float64(found.shader_float64),
            v11: vk::PhysicalDeviceVulkan11Features::default().storage_buffer16_bit_access(sixteen),
            v12: vk::PhysicalDeviceVulkan12Features::default()
                .buffer_device_address(found.buffer_device_address)
                .scalar_block_layout(found.scalar_block_layout)
                .timeline_semaphore(found.timeline_semaphore)
                .shader_shared_int64_atomics(found.shader_shared_int64_atomics)
                .host_query_reset(found.host_query_reset)
                .shader_int8(found.shader_int8)
                .storage_buffer8_bit_access(found.shader_int8)
                .shader_float16(found.shader_float16)
                .vulkan_memory_model(found.vulkan_memory_model)
                .vulkan_memory_model_device_scope(found.vulkan_memory_model),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn missing_is_listed_by_name_and_old_devices_by_version() {
        let none = DeviceCapabilities::default();
        assert_eq!(none.missing(), ["Vulkan 1.2"], "an old device lacks the version, not a list of features");
        let mut all = DeviceCapabilities {
            vulkan_1_2: true,
            shader_int64: true,
            buffer_device_address: true,
            scalar_block_layout: true,
            timeline_semaphore: true,
            host_query_reset: true,
            subgroup_operations: true,
            compute_queue: true,
            ..none
        };
        assert!(all.missing().is_empty(), "optional capabilities are not required");
        all.scalar_block_layout = false;
        all.shader_int64 = false;
        assert_eq!(all.missing(), ["shaderInt64", "scalarBlockLayout"], "all that is missing, in a fixed order");
    }
}
