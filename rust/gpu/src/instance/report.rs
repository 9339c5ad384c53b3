// SPDX-License-Identifier: Apache-2.0
//! Reports about devices, for `doctor`, logs and the choice of a device.

use crate::instance::capabilities::DeviceCapabilities;

/// Kind of a device, in the order of preference.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum DeviceKind {
    /// A GPU with memory of its own.
    Discrete,
    /// A GPU that shares the host's memory.
    Integrated,
    /// A GPU seen through a virtual machine.
    Virtual,
    /// A software renderer on the CPU.
    Cpu,
    /// A device of another kind.
    Other,
}

impl std::fmt::Display for DeviceKind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Discrete => "discrete GPU",
            Self::Integrated => "integrated GPU",
            Self::Virtual => "virtual GPU",
            Self::Cpu => "CPU",
            Self::Other => "other device",
        })
    }
}

/// One memory heap of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HeapReport {
    /// Size in bytes.
    pub bytes: u64,
    /// True if it is the device's own (or, on a unified device, the only) memory.
    pub device_local: bool,
    /// Bytes that are free for this process now according to the driver; `None` without `VK_EXT_memory_budget`.
    pub free: Option<u64>,
}

/// Everything that `doctor` reports about one device.
#[derive(Clone, Debug)]
pub struct DeviceReport {
    /// Position in the driver's list, which a numeric selector means.
    pub index: usize,
    /// Name as the driver gives it.
    pub name: String,
    /// Kind of the device.
    pub kind: DeviceKind,
    /// Its `VkPhysicalDeviceIDProperties::deviceUUID`, by which other interfaces know it, too.
    pub uuid: [u8; 16],
    /// Driver name and version.
    pub driver: String,
    /// Vulkan version of the device, as `major.minor.patch`.
    pub api: String,
    /// All memory heaps.
    pub heaps: Vec<HeapReport>,
    /// True if the device shares the memory of the host: it is a processor, and all memory of buffers is mapped.
    pub host_memory: bool,
    /// Capabilities of the device.
    pub capabilities: DeviceCapabilities,
    /// Names of the required capabilities it lacks; empty = usable.
    pub missing: Vec<&'static str>,
    /// True if it is the chosen one.
    pub chosen: bool,
    /// Reason why it is or is not chosen, one sentence.
    pub why: String,
}

impl DeviceReport {
    /// Bytes of the largest device-local heap.
    #[must_use]
    pub fn device_bytes(&self) -> u64 {
        self.heaps.iter().filter(|heap| heap.device_local).map(|heap| heap.bytes).max().unwrap_or(0)
    }
}
