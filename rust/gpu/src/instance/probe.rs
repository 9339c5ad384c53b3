// SPDX-License-Identifier: Apache-2.0
//! Reads the properties and capabilities of an instance's devices. It changes nothing. Any thread.

use std::ffi::CStr;

use ash::vk;

use crate::error::GpuError;
use crate::instance::capabilities::{DeviceCapabilities, probe_features};
use crate::instance::lane::{QueueChoices, choose_queues};
use crate::instance::memory_type::{BUFFER_USAGES, EXPORTED_KIND, is_all_mapped};
use crate::instance::report::{DeviceKind, DeviceReport, HeapReport};
use crate::instance::vulkan::{Instance, vulkan_error};

/// A device with everything that is needed to open it.
pub(crate) struct ProbedDevice {
    pub(crate) physical: vk::PhysicalDevice,
    pub(crate) report: DeviceReport,
    pub(crate) properties: vk::PhysicalDeviceProperties,
    pub(crate) max_allocation_bytes: u64,
    /// Alignment of the address and the size of pages that are lent to the driver; 0 = it takes none.
    pub(crate) lent_granule: u64,
    pub(crate) subgroup_size: u32,
    pub(crate) queues: QueueChoices,
    pub(crate) device_uuid: [u8; vk::UUID_SIZE],
}

/// Reads every device of the instance, in the driver's order.
pub(crate) fn probe_all(instance: &Instance) -> Result<Vec<ProbedDevice>, GpuError> {
    // SAFETY: no preconditions beyond a live instance.
    let physicals = unsafe { instance.raw.enumerate_physical_devices() }
        .map_err(|code| vulkan_error("vkEnumeratePhysicalDevices", code))?;
    physicals.into_iter().enumerate().map(|(index, physical)| probe(instance, index, physical)).collect()
}

fn probe(instance: &Instance, index: usize, physical: vk::PhysicalDevice) -> Result<ProbedDevice, GpuError> {
    // SAFETY: `physical` comes from this instance.
    let properties = unsafe { instance.raw.get_physical_device_properties(physical) };
    let modern = properties.api_version >= vk::API_VERSION_1_2;
    let mut v11 = vk::PhysicalDeviceVulkan11Properties::default();
    let mut v12 = vk::PhysicalDeviceVulkan12Properties::default();
    let mut capabilities = DeviceCapabilities::default();
    if modern {
        let mut chain = vk::PhysicalDeviceProperties2::default().push_next(&mut v11).push_next(&mut v12);
        // SAFETY: the device speaks 1.2, so it knows both chained structures.
        unsafe { instance.raw.get_physical_device_properties2(physical, &mut chain) };
        capabilities = probe_features(&instance.raw, physical, &v11);
    }
    // SAFETY: `physical` comes from this instance.
    let families = unsafe { instance.raw.get_physical_device_queue_family_properties(physical) };
    let queues = choose_queues(&families);
    capabilities.compute_queue = queues.is_some();
    let queues = queues.unwrap_or_default();
    capabilities.timestamps = queues[0].timestamp_bits > 0 && properties.limits.timestamp_period > 0.0;
    capabilities.memory_budget = modern && has_extension(instance, physical, ash::ext::memory_budget::NAME)?;
    let lends = modern && has_extension(instance, physical, ash::ext::external_memory_host::NAME)?;
    let lent_granule = if lends { lent_granule(instance, physical) } else { 0 };
    capabilities.external_memory_host = lent_granule > 0;
    capabilities.external_memory_fd = modern
        && has_extension(instance, physical, ash::khr::external_memory_fd::NAME)?
        && exports_buffers(instance, physical);
    #[cfg(feature = "faults")]
    crate::instance::capabilities::hide(&mut capabilities);
    let version = properties.api_version;
    let kind = kind_of(properties.device_type);
    // SAFETY: `physical` comes from this instance.
    let memory_types = unsafe { instance.raw.get_physical_device_memory_properties(physical) };
    let text = |bytes: Result<&CStr, _>| -> String {
        bytes.map(|text| text.to_string_lossy().into_owned()).unwrap_or_default()
    };
    let report = DeviceReport {
        index,
        name: text(properties.device_name_as_c_str()),
        kind,
        uuid: v11.device_uuid,
        driver: format!("{} {}", text(v12.driver_name_as_c_str()), text(v12.driver_info_as_c_str())).trim().to_owned(),
        api: format!(
            "{}.{}.{}",
            vk::api_version_major(version),
            vk::api_version_minor(version),
            vk::api_version_patch(version)
        ),
        heaps: read_heaps(instance, physical, capabilities.memory_budget),
        host_memory: kind == DeviceKind::Cpu && is_all_mapped(memory_types.memory_types_as_slice()),
        missing: [capabilities.missing(), miscompiles(&v12)].concat(),
        capabilities,
        chosen: false,
        why: String::new(),
    };
    Ok(ProbedDevice {
        physical,
        report,
        properties,
        max_allocation_bytes: v11.max_memory_allocation_size,
        lent_granule,
        subgroup_size: v11.subgroup_size,
        queues,
        device_uuid: v11.device_uuid,
    })
}

/// Drivers that compile our shaders to wrong answers count as lacking a right one.
///
/// Mesa 22.3.6's llvmpipe (stock Debian 12) loses geometry in traversal; 25.0.7's does not. Measured 2026-11-21 by the
/// render tests on both, see the book, design/machine. May go when no supported distribution ships Mesa 22.
fn miscompiles(properties: &vk::PhysicalDeviceVulkan12Properties<'_>) -> Vec<&'static str> {
    let info = properties.driver_info_as_c_str().map(|info| info.to_string_lossy()).unwrap_or_default();
    let is_old = properties.driver_id == vk::DriverId::MESA_LLVMPIPE && is_mesa_22(&info);
    if is_old { vec!["a newer llvmpipe (Mesa 22 computes wrong images; 25 is right)"] } else { Vec::new() }
}

fn is_mesa_22(driver_info: &str) -> bool {
    driver_info.strip_prefix("Mesa ").and_then(|version| version.split('.').next()) == Some("22")
}

fn kind_of(device_type: vk::PhysicalDeviceType) -> DeviceKind {
    match device_type {
        vk::PhysicalDeviceType::DISCRETE_GPU => DeviceKind::Discrete,
        vk::PhysicalDeviceType::INTEGRATED_GPU => DeviceKind::Integrated,
        vk::PhysicalDeviceType::VIRTUAL_GPU => DeviceKind::Virtual,
        vk::PhysicalDeviceType::CPU => DeviceKind::Cpu,
        _ => DeviceKind::Other,
    }
}

fn has_extension(instance: &Instance, physical: vk::PhysicalDevice, name: &CStr) -> Result<bool, GpuError> {
    // SAFETY: `physical` comes from this instance.
    let extensions = unsafe { instance.raw.enumerate_device_extension_properties(physical) }
        .map_err(|code| vulkan_error("vkEnumerateDeviceExtensionProperties", code))?;
    Ok(extensions.iter().any(|extension| extension.extension_name_as_c_str() == Ok(name)))
}

/// Computes [`ProbedDevice::lent_granule`]. The device has `VK_EXT_external_memory_host`.
fn lent_granule(instance: &Instance, physical: vk::PhysicalDevice) -> u64 {
    let mut host = vk::PhysicalDeviceExternalMemoryHostPropertiesEXT::default();
    let mut chain = vk::PhysicalDeviceProperties2::default().push_next(&mut host);
    // SAFETY: `physical` comes from this instance, and the chained structure is one that the device supports.
    unsafe { instance.raw.get_physical_device_properties2(physical, &mut chain) };
    host.min_imported_host_pointer_alignment
}

/// Returns true if memory of buffers can be exported without being dedicated to one: libraries that import it cannot be
/// told that it is. The device speaks at least Vulkan 1.2.
fn exports_buffers(instance: &Instance, physical: vk::PhysicalDevice) -> bool {
    let info = vk::PhysicalDeviceExternalBufferInfo::default().usage(BUFFER_USAGES).handle_type(EXPORTED_KIND);
    let mut found = vk::ExternalBufferProperties::default();
    // SAFETY: `physical` comes from this instance, and the function is one of Vulkan 1.1.
    unsafe { instance.raw.get_physical_device_external_buffer_properties(physical, &info, &mut found) };
    let features = found.external_memory_properties.external_memory_features;
    features.contains(vk::ExternalMemoryFeatureFlags::EXPORTABLE)
        && !features.contains(vk::ExternalMemoryFeatureFlags::DEDICATED_ONLY)
}

/// Reads all heaps; `free` only if the extension is present.
pub(crate) fn read_heaps(instance: &Instance, physical: vk::PhysicalDevice, budget: bool) -> Vec<HeapReport> {
    let (memory, budgets) = query_memory(instance, physical, budget);
    let report = |(heap, (&limit, &usage)): (&vk::MemoryHeap, (&u64, &u64))| HeapReport {
        bytes: heap.size,
        device_local: heap.flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL),
        free: budget.then(|| limit.saturating_sub(usage)),
    };
    memory.memory_heaps_as_slice().iter().zip(budgets.heap_budget.iter().zip(&budgets.heap_usage)).map(report).collect()
}

/// Bytes that this process uses on device-local heaps according to the driver. The device has `VK_EXT_memory_budget`.
pub(crate) fn device_usage(instance: &Instance, physical: vk::PhysicalDevice) -> u64 {
    let (memory, budgets) = query_memory(instance, physical, true);
    let local = |heap: &vk::MemoryHeap| heap.flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL);
    let heaps = memory.memory_heaps_as_slice().iter().zip(budgets.heap_usage);
    heaps.filter(|(heap, _)| local(heap)).map(|(_, usage)| usage).sum()
}

fn query_memory(
    instance: &Instance,
    physical: vk::PhysicalDevice,
    budget: bool,
) -> (vk::PhysicalDeviceMemoryProperties, vk::PhysicalDeviceMemoryBudgetPropertiesEXT<'static>) {
    let mut budgets = vk::PhysicalDeviceMemoryBudgetPropertiesEXT::default();
    let mut memory = vk::PhysicalDeviceMemoryProperties2::default();
    if budget {
        memory = memory.push_next(&mut budgets);
    }
    // SAFETY: `physical` comes from this instance, and the chained structure is one that the device supports.
    unsafe { instance.raw.get_physical_device_memory_properties2(physical, &mut memory) };
    (memory.memory_properties, budgets)
}

#[cfg(test)]
mod tests {
    use super::is_mesa_22;

    #[test]
    fn only_mesa_22_is_refused() {
        assert!(is_mesa_22("Mesa 22.3.6 (LLVM 15.0.6)"), "the stock Mesa of Debian 12");
        assert!(!is_mesa_22("Mesa 25.0.7-2~bpo12+1 (LLVM 15.0.6)"), "its backport");
        assert!(!is_mesa_22("580.159.04"), "not Mesa at all");
    }
}
