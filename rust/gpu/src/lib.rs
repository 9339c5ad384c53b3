// SPDX-License-Identifier: Apache-2.0
//! Vulkan made safe (signatures; bodies follow).
#![allow(missing_docs, clippy::todo, unused_variables, reason = "signatures first; replaced by the implementation")]
use std::sync::Arc;
use std::time::Duration;
mod error;
pub use error::GpuError;

#[derive(Clone, Debug, Default)]
pub struct OpenOptions {
    /// Index, or part of the name (case-insensitive). None or empty = best device.
    pub selector: Option<String>,
    pub validation: bool,
    pub sync_validation: bool,
    /// Hard budget in bytes. None = 90 % of what the driver says is free.
    pub budget_bytes: Option<u64>,
    /// Timestamps around each operation of every Commands.
    pub profile: bool,
}
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeviceKind { Discrete, Integrated, Virtual, Cpu, Other }
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Capabilities { pub memory_budget: bool }
#[derive(Clone, Debug)]
pub struct HeapReport { pub bytes: u64, pub device_local: bool, pub free: Option<u64> }
#[derive(Clone, Debug)]
pub struct DeviceReport {
    pub index: usize, pub name: String, pub kind: DeviceKind, pub driver: String, pub api: String,
    pub heaps: Vec<HeapReport>, pub capabilities: Capabilities, pub missing: Vec<&'static str>, pub chosen: bool, pub why: String,
}
/// All devices; `chosen` and `why` as if opened without a selector.
pub fn enumerate() -> Result<Vec<DeviceReport>, GpuError> { todo!() }
/// All devices; `chosen` and `why` as `Gpu::open` with this selector would decide.
pub fn enumerate_for(selector: Option<&str>) -> Result<Vec<DeviceReport>, GpuError> { todo!() }
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits { pub max_allocation_bytes: u64, pub max_workgroups: [u32; 3], pub max_push_bytes: u32, pub subgroup_size: u32, pub timestamp_period_ns: f32 }
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MemoryUse { pub used: u64, pub peak: u64, pub budget: u64, pub host_used: u64, pub allocations: u64 }
/// Outlives the Gpu, so that leaks reported at destruction can be seen.
#[derive(Clone, Debug)]
pub struct ValidationLog;
impl ValidationLog { pub fn take(&self) -> Vec<String> { todo!() } }

#[derive(Debug)]
pub struct Gpu;
impl Gpu {
    pub fn open(options: &OpenOptions) -> Result<Arc<Self>, GpuError> { todo!() }
    pub fn report(&self) -> &DeviceReport { todo!() }
    pub fn limits(&self) -> &Limits { todo!() }
    pub fn memory(&self) -> MemoryUse { todo!() }
    pub fn set_budget(&self, budget_bytes: Option<u64>) { todo!() }
    pub fn take_validation_messages(&self) -> Vec<String> { todo!() }
    pub fn validation_log(&self) -> ValidationLog { todo!() }
    /// Waits for all submitted work and frees what was retired.
    pub fn wait_idle(&self) -> Result<(), GpuError> { todo!() }
    /// For tests: the n-th next device memory allocation (0 = the next one) fails with OutOfMemory, once.
    pub fn fail_allocation_after(&self, n: u64) { todo!() }
    /// A new command list; label is shown in debuggers, errors and timings.
    pub fn commands(self: &Arc<Self>, label: &str) -> Result<Commands, GpuError> { todo!() }
}
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Usage { Device, Upload, Readback }
/// Not Clone: put it in an Arc to share. Methods take &self, any thread.
#[derive(Debug)]
pub struct Buffer;
impl Buffer {
    pub fn new(gpu: &Arc<Gpu>, name: &str, bytes: u64, usage: Usage) -> Result<Self, GpuError> { todo!() }
    pub fn address(&self) -> u64 { todo!() }
    pub fn size(&self) -> u64 { todo!() }
    pub fn write(&self, offset: u64, bytes: &[u8]) -> Result<(), GpuError> { todo!() }
    pub fn read(&self, offset: u64, bytes: &mut [u8]) -> Result<(), GpuError> { todo!() }
    /// Closure over the mapped bytes (Upload or Readback); host threads exclude each other meanwhile.
    pub fn map<R>(&self, f: impl FnOnce(&mut [u8]) -> R) -> Result<R, GpuError> { todo!() }
}
#[derive(Debug)]
pub struct Heap;
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HeapStats { pub arenas: u32, pub arena_bytes: u64, pub used_bytes: u64, pub largest_free: u64, pub fragmentation: f64 }
impl Heap {
    pub fn new(gpu: &Arc<Gpu>, name: &str, arena_bytes: u64) -> Result<Self, GpuError> { todo!() }
    pub fn alloc(&self, name: &str, bytes: u64, align: u64) -> Result<HeapRange, GpuError> { todo!() }
    pub fn stats(&self) -> HeapStats { todo!() }
    /// Gives arenas that hold nothing back to the driver.
    pub fn trim(&self) { todo!() }
}
#[derive(Debug)]
pub struct HeapRange;
impl HeapRange { pub fn address(&self) -> u64 { todo!() } pub fn size(&self) -> u64 { todo!() } }
/// A Buffer or a HeapRange (sealed).
pub trait DeviceRange { fn address(&self) -> u64; fn size(&self) -> u64; }
impl DeviceRange for Buffer { fn address(&self) -> u64 { todo!() } fn size(&self) -> u64 { todo!() } }
impl DeviceRange for HeapRange { fn address(&self) -> u64 { todo!() } fn size(&self) -> u64 { todo!() } }
#[derive(Debug)]
pub struct Pipeline;
impl Pipeline {
    /// Entry point "main". spec: (constant id, value). Any thread; several at once.
    pub fn new(gpu: &Arc<Gpu>, name: &str, words: &[u32], spec: &[(u32, u32)], push_bytes: u32) -> Result<Self, GpuError> { todo!() }
    pub fn name(&self) -> &str { todo!() }
}
/// Records operations; each sees what all earlier ones wrote (also of earlier submissions). Mistakes are kept and returned by submit().
#[derive(Debug)]
pub struct Commands;
impl Commands {
    pub fn fill(&mut self, target: &dyn DeviceRange, offset: u64, bytes: u64, value: u32) { todo!() }
    pub fn copy(&mut self, source: &dyn DeviceRange, source_offset: u64, target: &dyn DeviceRange, target_offset: u64, bytes: u64) { todo!() }
    pub fn update(&mut self, target: &dyn DeviceRange, offset: u64, bytes: &[u8]) { todo!() }
    pub fn dispatch(&mut self, pipeline: &Pipeline, push: &[u8], groups: [u32; 3]) { todo!() }
    pub fn dispatch_indirect(&mut self, pipeline: &Pipeline, push: &[u8], arguments: &dyn DeviceRange, offset: u64) { todo!() }
    /// Operations inside have no barrier between each other.
    pub fn concurrent(&mut self, f: impl FnOnce(&mut Self)) { todo!() }
    /// Times all inside as one entry, besides the entries of each operation.
    pub fn span(&mut self, name: &str, f: impl FnOnce(&mut Self)) { todo!() }
    /// Keeps something alive until this work is done although it is reached by address only.
    pub fn keep(&mut self, range: &dyn DeviceRange) { todo!() }
    pub fn profile(&mut self, on: bool) { todo!() }
    pub fn submit(self) -> Result<Submission, GpuError> { todo!() }
}
#[derive(Debug)]
pub struct Submission;
impl Submission {
    /// True when the GPU has finished, also after device loss.
    pub fn is_done(&self) -> bool { todo!() }
    /// Ok(true) = finished, Ok(false) = timeout passed.
    pub fn wait(&self, timeout: Duration) -> Result<bool, GpuError> { todo!() }
    /// (pass name, seconds) in recording order; empty when not done or not profiled.
    pub fn timings(&self) -> Vec<(String, f64)> { todo!() }
}
