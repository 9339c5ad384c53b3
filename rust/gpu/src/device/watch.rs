// SPDX-License-Identifier: Apache-2.0
//! Stands between this crate and the driver, for tests: counts every byte of `vkAllocateMemory`, fills host-writable
//! memory with [`POISON`], and makes calls that allocate memory fail. Compiled only with the feature `faults`.
//!
//! The calls are taken over in the device's table of functions, so that none goes by, wherever it is made. Any thread.

use std::collections::BTreeMap;
use std::ffi::c_void;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use ash::vk::{self, Handle as _};

/// Contents of new memory: no zeros, which drivers give though they need not. As a count it is too large for anything,
/// as a float it is -431 602 080.
pub(crate) const POISON: u8 = 0xCD;
/// Bytes of an allocation that are poisoned at most, from its start: the rest is not worth the time.
const MAX_POISONED_BYTES: u64 = 64 << 20;

/// A call that can be made to fail.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DriverCall {
    /// Calls of [`Buffer::new`](crate::Buffer::new), [`Heap::alloc`](crate::Heap::alloc) and
    /// [`Heap::try_alloc`](crate::Heap::try_alloc), from whatever memory.
    Request,
    /// Calls of [`Buffer::new`](crate::Buffer::new).
    Buffer,
    /// Calls of [`Heap::alloc`](crate::Heap::alloc) and [`Heap::try_alloc`](crate::Heap::try_alloc).
    Range,
    /// Calls of `vkAllocateMemory`.
    Memory,
    /// Calls of `vkMapMemory`.
    Mapping,
    /// Calls of `vkCreateComputePipelines`.
    Pipeline,
    /// Calls of `vkCreateCommandPool`.
    CommandPool,
    /// Calls of `vkQueueSubmit`: the device is lost with it.
    Submit,
}

/// A failure that a test plants: a lack of memory, except for [`DriverCall::Submit`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PlantedFailure {
    /// Call that fails.
    pub call: DriverCall,
    /// Number of calls that succeed before; 0 = the next one fails.
    pub after: u64,
    /// Number of consecutive calls that fail then.
    pub times: u32,
}

/// Bytes of all memory that the driver gave, of every type.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DriverMemory {
    /// Bytes held now.
    pub held: u64,
    /// Maximum of bytes held so far.
    pub peak: u64,
    /// Calls of `vkAllocateMemory` that succeeded.
    pub calls: u64,
}

/// Intercepts the calls of a device.
pub(crate) struct DriverWatch {
    driver: ash::DeviceFnV1_0,
    /// Memory types that the host can map, one bit each.
    mappable: u32,
    state: Mutex<DriverWatchState>,
}

#[derive(Default)]
struct DriverWatchState {
    memory: DriverMemory,
    sizes: BTreeMap<u64, u64>,
    planted: Option<PlantedFailure>,
    struck: u64,
    /// True after a submission was made to fail: all later ones fail too.
    is_lost: bool,
}

/// The watches of open devices by handle, which is all that a driver function knows.
static WATCHES: Mutex<BTreeMap<u64, Arc<DriverWatch>>> = Mutex::new(BTreeMap::new());

fn watches() -> MutexGuard<'static, BTreeMap<u64, Arc<DriverWatch>>> {
    WATCHES.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The same device, with its calls intercepted.
pub(crate) fn taken_over(
    raw: &ash::Device,
    types: &vk::PhysicalDeviceMemoryProperties,
) -> (ash::Device, Arc<DriverWatch>) {
    let mut table = raw.fp_v1_0().clone();
    let is_mappable = |of: &vk::MemoryType| of.property_flags.contains(vk::MemoryPropertyFlags::HOST_VISIBLE);
    let types = types.memory_types_as_slice().iter().enumerate();
    let mappable = types.filter(|(_, of)| is_mappable(of)).fold(0, |bits, (index, _)| bits | 1 << index);
    let watch = Arc::new(DriverWatch { driver: table.clone(), mappable, state: Mutex::default() });
    watches().insert(raw.handle().as_raw(), Arc::clone(&watch));
    table.allocate_memory = allocate_memory;
    table.free_memory = free_memory;
    table.map_memory = map_memory;
    table.create_compute_pipelines = create_compute_pipelines;
    table.create_command_pool = create_command_pool;
    table.destroy_device = destroy_device;
    let (v11, v12, v13) = (raw.fp_v1_1().clone(), raw.fp_v1_2().clone(), raw.fp_v1_3().clone());
    (ash::Device::from_parts_1_3(raw.handle(), table, v11, v12, v13), watch)
}

impl DriverWatch {
    fn lock(&self) -> MutexGuard<'_, DriverWatchState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Counts a call; returns true if it is to fail.
    pub(crate) fn strikes(&self, call: DriverCall) -> bool {
        let state = &mut *self.lock();
        let is_meant = |failure: &PlantedFailure| {
            failure.call == call
                || (failure.call == DriverCall::Request && matches!(call, DriverCall::Buffer | DriverCall::Range))
        };
        let Some(failure) = state.planted.as_mut().filter(|failure| is_meant(failure)) else { return false };
        if failure.after > 0 {
            failure.after -= 1;
            return false;
        }
        failure.times = failure.times.saturating_sub(1);
        if failure.times == 0 {
            state.planted = None;
        }
        state.struck += 1;
        true
    }
}

impl DriverWatch {
    /// Fills the first `bytes` of new memory that the host can map.
    fn poison(&self, device: vk::Device, memory: vk::DeviceMemory, bytes: u64) {
        let (mut start, flags) = (std::ptr::null_mut(), vk::MemoryMapFlags::empty());
        let Ok(length) = usize::try_from(bytes) else { return };
        // SAFETY: nobody else knows the memory yet, and it has as many bytes.
        let result = unsafe { (self.driver.map_memory)(device, memory, 0, bytes, flags, &raw mut start) };
        if result != vk::Result::SUCCESS {
            return;
        }
        // SAFETY: so many bytes are mapped.
        unsafe { std::ptr::write_bytes(start.cast::<u8>(), POISON, length) };
        // Memory that is not coherent keeps what it has, which is as good.
        // SAFETY: it was mapped above.
        unsafe { (self.driver.unmap_memory)(device, memory) };
    }
}

impl std::fmt::Debug for DriverWatch {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Watch").field("memory", &self.lock().memory).finish_non_exhaustive()
    }
}

/// Queries of tests.
impl DriverWatch {
    /// Makes calls fail, replacing an earlier planted failure.
    pub(crate) fn plant(&self, failure: PlantedFailure) {
        self.lock().planted = Some(failure);
    }

    /// Returns true if the device is lost with this submission, or was with one before.
    pub(crate) fn loses(&self) -> bool {
        let strikes = self.strikes(DriverCall::Submit);
        let state = &mut *self.lock();
        state.is_lost |= strikes;
        state.is_lost
    }

    /// Number of calls that failed because of a planted failure.
    pub(crate) fn struck(&self) -> u64 {
        self.lock().struck
    }

    /// Memory that the driver gave.
    pub(crate) fn memory(&self) -> DriverMemory {
        self.lock().memory
    }
}

/// The watch of a device. Every device of this crate has one until it is destroyed.
fn of(device: vk::Device) -> Option<Arc<DriverWatch>> {
    watches().get(&device.as_raw()).cloned()
}

const NO_HOST_MEMORY: vk::Result = vk::Result::ERROR_OUT_OF_HOST_MEMORY;
const NO_DEVICE_MEMORY: vk::Result = vk::Result::ERROR_OUT_OF_DEVICE_MEMORY;

unsafe extern "system" fn allocate_memory(
    device: vk::Device,
    info: *const vk::MemoryAllocateInfo<'_>,
    callbacks: *const vk::AllocationCallbacks<'_>,
    memory: *mut vk::DeviceMemory,
) -> vk::Result {
    let Some(watch) = of(device).filter(|watch| !watch.strikes(DriverCall::Memory)) else { return NO_DEVICE_MEMORY };
    // SAFETY: the arguments are the caller's, who keeps to the rules of the function.
    let result = unsafe { (watch.driver.allocate_memory)(device, info, callbacks, memory) };
    if result == vk::Result::SUCCESS {
        // SAFETY: valid by the rules of the function.
        let bytes = unsafe { (*info).allocation_size };
        // SAFETY: valid by the rules of the function.
        let index = unsafe { (*info).memory_type_index };
        // SAFETY: the driver has written it.
        let memory = unsafe { *memory };
        if watch.mappable >> index & 1 == 1 {
            watch.poison(device, memory, bytes.min(MAX_POISONED_BYTES));
        }
        let handle = memory.as_raw();
        let mut state = watch.lock();
        state.sizes.insert(handle, bytes);
        state.memory.held += bytes;
        state.memory.peak = state.memory.peak.max(state.memory.held);
        state.memory.calls += 1;
    }
    result
}

unsafe extern "system" fn free_memory(
    device: vk::Device,
    memory: vk::DeviceMemory,
    callbacks: *const vk::AllocationCallbacks<'_>,
) {
    let Some(watch) = of(device) else { return };
    let mut state = watch.lock();
    let bytes = state.sizes.remove(&memory.as_raw()).unwrap_or(0);
    state.memory.held -= bytes;
    drop(state);
    // SAFETY: the arguments are the caller's, who keeps to the rules of the function.
    unsafe { (watch.driver.free_memory)(device, memory, callbacks) }
}

unsafe extern "system" fn map_memory(
    device: vk::Device,
    memory: vk::DeviceMemory,
    offset: vk::DeviceSize,
    size: vk::DeviceSize,
    flags: vk::MemoryMapFlags,
    data: *mut *mut c_void,
) -> vk::Result {
    let Some(watch) = of(device).filter(|watch| !watch.strikes(DriverCall::Mapping)) else { return NO_HOST_MEMORY };
    // SAFETY: the arguments are the caller's, who keeps to the rules of the function.
    unsafe { (watch.driver.map_memory)(device, memory, offset, size, flags, data) }
}

unsafe extern "system" fn create_compute_pipelines(
    device: vk::Device,
    cache: vk::PipelineCache,
    count: u32,
    infos: *const vk::ComputePipelineCreateInfo<'_>,
    callbacks: *const vk::AllocationCallbacks<'_>,
    pipelines: *mut vk::Pipeline,
) -> vk::Result {
    let Some(watch) = of(device).filter(|watch| !watch.strikes(DriverCall::Pipeline)) else {
        for place in (0..count as usize).map(|at| pipelines.wrapping_add(at)) {
            // SAFETY: there is room for `count` by the rules of the function; those that failed are null.
            unsafe { place.write(vk::Pipeline::null()) };
        }
        return NO_DEVICE_MEMORY;
    };
    // SAFETY: the arguments are the caller's, who keeps to the rules of the function.
    unsafe { (watch.driver.create_compute_pipelines)(device, cache, count, infos, callbacks, pipelines) }
}

unsafe extern "system" fn create_command_pool(
    device: vk::Device,
    info: *const vk::CommandPoolCreateInfo<'_>,
    callbacks: *const vk::AllocationCallbacks<'_>,
    pool: *mut vk::CommandPool,
) -> vk::Result {
    let Some(watch) = of(device).filter(|watch| !watch.strikes(DriverCall::CommandPool)) else { return NO_HOST_MEMORY };
    // SAFETY: the arguments are the caller's, who keeps to the rules of the function.
    unsafe { (watch.driver.create_command_pool)(device, info, callbacks, pool) }
}

unsafe extern "system" fn destroy_device(device: vk::Device, callbacks: *const vk::AllocationCallbacks<'_>) {
    let Some(watch) = watches().remove(&device.as_raw()) else { return };
    // SAFETY: the arguments are the caller's, who keeps to the rules of the function.
    unsafe { (watch.driver.destroy_device)(device, callbacks) }
}
