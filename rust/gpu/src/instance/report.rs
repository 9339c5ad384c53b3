// SPDX-License-Identifier: Apache-2.0
//! What is told of a device: for `doctor`, logs and the choice.

use crate::instance::capabilities::DeviceCapabilities;

/// What kind of device it is, in the order of preference.
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
    /// Anything else.
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
    /// It is the device's own (or, on a unified device, the only) memory.
    pub device_local: bool,
    /// Bytes that the driver says are free to this process now; None without `VK_EXT_memory_budget`.
    pub free: Option<u64>,
}

/// Everything `doctor` says about one device.
#[derive(Clone, Debug)]
pub struct DeviceReport {
    /// Position in the driver's list; what a selector's number means.
    pub index: usize,
    /// Name as the driver gives it.
    pub name: String,
    /// What kind of device it is.
    pub kind: DeviceKind,
    /// Driver name and version.
    pub driver: String,
    /// Vulkan version of the device, as `major.minor.patch`.
    pub api: String,
    /// All memory heaps.
    pub heaps: Vec<HeapReport>,
    /// Its memory is the host's own: it is a processor, and all that buffers get is mapped.
    pub host_memory: bool,
    /// What it can do.
    pub capabilities: DeviceCapabilities,
    /// Names of the required capabilities it lacks; empty = usable.
    pub missing: Vec<&'static str>,
    /// It is the one to be used.
    pub chosen: bool,
    /// One sentence: why it is or is not the one.
    pub why: String,
}

impl DeviceReport {
    /// Bytes of the largest device-local heap.
    #[must_use]
    pub fn device_bytes(&self) -> u64 {
        self.heaps.iter().filter(|heap| heap.device_local).map(|heap| heap.bytes).max().unwrap_or(0)
    }
}
