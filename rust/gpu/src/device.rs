// SPDX-License-Identifier: Apache-2.0
//! The logical device and everything that must live as long as any object made from it.
//!
//! `Device` is shared by `Arc` from every buffer, heap, pipeline and submission; [`Gpu`](crate::Gpu) is the public handle.
//! Work in flight (held by the queue) and retired ranges point back at the device: `Gpu`'s Drop waits and clears them, after which
//! nothing can be submitted and retiring frees at once, so no cycle outlives the last public object. Any thread.

use std::sync::{Arc, Mutex, OnceLock, PoisonError, Weak};

use ash::vk;

use crate::arena::RetiredRange;
use crate::budget::{Budget, automatic_budget};
use crate::capabilities::FeatureChain;
use crate::error::GpuError;
use crate::gpu::{Limits, OpenOptions};
use crate::heap::HeapCore;
use crate::instance::{Instance, vulkan_error};
use crate::markers::Markers;
use crate::memory::{Patience, RawBuffer};
use crate::names::Names;
use crate::queue::{CommandSlot, InFlight, Queue};
use crate::report::{DeviceReport, Probed, read_heaps};
use crate::retire::RetireQueue;
use crate::timer::POOL_QUERIES;

/// Something to destroy or free once the GPU no longer uses it.
#[derive(Debug)]
pub(crate) enum Retired {
    /// A buffer with its memory.
    Memory(RawBuffer),
    /// A range of a heap's arena.
    Range(RetiredRange),
}

/// See the module.
pub(crate) struct Device {
    pub(crate) raw: ash::Device,
    pub(crate) physical: vk::PhysicalDevice,
    pub(crate) memory_types: vk::PhysicalDeviceMemoryProperties,
    pub(crate) report: DeviceReport,
    pub(crate) limits: Limits,
    pub(crate) timestamp_bits: u32,
    /// All memory is one kind: the host shares it with the device.
    pub(crate) unified: bool,
    pub(crate) names: Names,
    pub(crate) budget: Budget,
    pub(crate) queue: Queue,
    pub(crate) pipeline_cache: vk::PipelineCache,
    /// Timestamps are wanted by default.
    pub(crate) profile: bool,
    pub(crate) markers: Option<Markers>,
    pub(crate) heaps: Mutex<Vec<Weak<HeapCore>>>,
    retired: RetireQueue<Retired>,
    slots: Mutex<Vec<CommandSlot>>,
    query_pools: Mutex<Vec<vk::QueryPool>>,
    lost: OnceLock<String>,
    /// Last: everything above is made from it.
    pub(crate) instance: Arc<Instance>,
}

impl Device {
    /// Opens a probed device that lacks nothing.
    pub(crate) fn new(instance: Arc<Instance>, probed: Probed, options: &OpenOptions) -> Result<Self, GpuError> {
        let raw = create_raw(&instance, &probed)?;
        // SAFETY: the family exists, and one queue of it was asked for.
        let queue = unsafe { raw.get_device_queue(probed.queue_family, 0) };
        // SAFETY: the physical device comes from this instance.
        let memory_types = unsafe { instance.raw.get_physical_device_memory_properties(probed.physical) };
        let heaps = &probed.report.heaps;
        let unified = heaps.iter().all(|heap| heap.device_local);
        let names = Names::new(&instance.raw, &raw, instance.names);
        let mut device = Self {
            physical: probed.physical,
            memory_types,
            limits: Limits::of(&probed),
            timestamp_bits: probed.timestamp_bits,
            unified,
            names,
            budget: Budget::new(0),
            queue: Queue::new(queue, probed.queue_family),
            pipeline_cache: vk::PipelineCache::null(),
            profile: options.profile && probed.report.capabilities.timestamps,
            markers: None,
            heaps: Mutex::new(Vec::new()),
            retired: RetireQueue::new(),
            slots: Mutex::new(Vec::new()),
            query_pools: Mutex::new(Vec::new()),
            lost: OnceLock::new(),
            report: probed.report,
            raw,
            instance,
        };
        device.budget.set_budget(options.budget_bytes.unwrap_or_else(|| device.automatic_budget()));
        device.queue.create_timeline(&device.raw, &device.names)?;
        let info = vk::PipelineCacheCreateInfo::default();
        // SAFETY: the device is alive; an empty cache has no data to be valid.
        let cache = unsafe { device.raw.create_pipeline_cache(&info, None) };
        device.pipeline_cache = cache.map_err(|code| vulkan_error("vkCreatePipelineCache", code))?;
        if options.crash_markers {
            device.markers = Some(Markers::new(&device)?);
        }
        Ok(device)
    }

    /// Nine tenths of what is free on the largest device-local heap now.
    pub(crate) fn automatic_budget(&self) -> u64 {
        let heaps = read_heaps(&self.instance, self.physical, self.report.capabilities.memory_budget);
        let largest = heaps.iter().filter(|heap| heap.device_local).max_by_key(|heap| heap.bytes);
        let free = largest.map_or(0, |heap| heap.free.unwrap_or(heap.bytes));
        automatic_budget(free.saturating_add(self.budget.counts().used))
    }

    /// Turns a failed call into this crate's error, and notices a lost device. Never called with a lock of this crate held.
    pub(crate) fn check<T>(&self, call: &'static str, result: Result<T, vk::Result>) -> Result<T, GpuError> {
        result.map_err(|code| match code {
            vk::Result::ERROR_DEVICE_LOST => self.lose(),
            vk::Result::ERROR_OUT_OF_HOST_MEMORY | vk::Result::ERROR_OUT_OF_DEVICE_MEMORY => {
                self.budget.refused(call, 0)
            }
            other => vulkan_error(call, other),
        })
    }

    /// Records that the device is gone, and what it did last.
    fn lose(&self) -> GpuError {
        let last_pass = self.lost.get_or_init(|| {
            let marker = self.markers.as_ref().map(Markers::read);
            let last_pass = self.queue.last_pass(marker);
            tracing::error!(last_pass, "the GPU was lost");
            last_pass
        });
        GpuError::DeviceLost { last_pass: last_pass.clone() }
    }

    /// The error of a lost device, if it is lost.
    pub(crate) fn check_alive(&self) -> Result<(), GpuError> {
        match self.lost.get() {
            None => Ok(()),
            Some(last_pass) => Err(GpuError::DeviceLost { last_pass: last_pass.clone() }),
        }
    }

    /// The newest submission that has finished; everything, when the device is lost.
    pub(crate) fn completed(&self) -> u64 {
        if self.lost.get().is_some() {
            return u64::MAX;
        }
        // SAFETY: the semaphore is a timeline of this device and lives as long as it.
        let value = unsafe { self.raw.get_semaphore_counter_value(self.queue.timeline()) };
        self.check("vkGetSemaphoreCounterValue", value).unwrap_or_else(|error| match error {
            GpuError::DeviceLost { .. } => u64::MAX,
            _ => 0,
        })
    }

    /// Destroys or frees `item` after submission `point`: at once if that has passed.
    pub(crate) fn retire(&self, point: u64, item: Retired) {
        self.retired.push(point, item);
        self.collect();
    }

    /// Lets go of everything that finished submissions used.
    pub(crate) fn collect(&self) {
        let completed = self.completed();
        for InFlight { slot, kept, timer, .. } in self.queue.take_finished(completed) {
            self.recycle_slot(slot);
            // What the submission kept alive may be retired by this.
            drop((kept, timer));
        }
        for item in self.retired.take_ready(completed) {
            match item {
                Retired::Memory(raw) => self.destroy_raw(raw),
                Retired::Range(range) => range.free(),
            }
        }
    }

    /// Makes room: collects, empties heaps of unused arenas and, if allowed, waits for what is retired.
    pub(crate) fn reclaim(&self, patience: Patience) -> Result<(), GpuError> {
        self.collect();
        self.trim_heaps();
        if patience == Patience::WaitForRetired
            && let Some(point) = self.retired.last_point()
        {
            self.queue.wait(self, point, u64::MAX)?;
            self.collect();
            self.trim_heaps();
        }
        Ok(())
    }

    fn trim_heaps(&self) {
        let mut heaps = self.heaps.lock().unwrap_or_else(PoisonError::into_inner);
        heaps.retain(|heap| heap.strong_count() > 0);
        let live: Vec<_> = heaps.iter().filter_map(Weak::upgrade).collect();
        drop(heaps);
        for heap in live {
            heap.trim(0);
        }
    }

    /// A command pool with its buffer, ready to record.
    pub(crate) fn command_slot(&self) -> Result<CommandSlot, GpuError> {
        let recycled = self.slots.lock().unwrap_or_else(PoisonError::into_inner).pop();
        match recycled {
            Some(slot) => Ok(slot),
            None => CommandSlot::new(self),
        }
    }

    /// Takes back a slot that no submission uses.
    pub(crate) fn recycle_slot(&self, slot: CommandSlot) {
        // SAFETY: the caller owns the slot, and its buffer is not pending.
        let reset = unsafe { self.raw.reset_command_pool(slot.pool, vk::CommandPoolResetFlags::empty()) };
        if reset.is_ok() {
            self.slots.lock().unwrap_or_else(PoisonError::into_inner).push(slot);
        } else {
            slot.destroy(&self.raw);
        }
    }

    /// A pool of reset timestamp queries.
    pub(crate) fn query_pool(&self) -> Result<vk::QueryPool, GpuError> {
        let recycled = self.query_pools.lock().unwrap_or_else(PoisonError::into_inner).pop();
        let pool = match recycled {
            Some(pool) => pool,
            None => {
                let info =
                    vk::QueryPoolCreateInfo::default().query_type(vk::QueryType::TIMESTAMP).query_count(POOL_QUERIES);
                // SAFETY: the device is alive and the count is not zero.
                self.check("vkCreateQueryPool", unsafe { self.raw.create_query_pool(&info, None) })?
            }
        };
        // SAFETY: hostQueryReset is enabled, and a recycled or new pool is used by no submission.
        unsafe { self.raw.reset_query_pool(pool, 0, POOL_QUERIES) };
        Ok(pool)
    }

    /// Takes back pools that no submission uses.
    pub(crate) fn recycle_query_pools(&self, pools: &mut Vec<vk::QueryPool>) {
        self.query_pools.lock().unwrap_or_else(PoisonError::into_inner).append(pools);
    }
}

/// The logical device with one compute queue and everything that was found switched on.
fn create_raw(instance: &Instance, probed: &Probed) -> Result<ash::Device, GpuError> {
    let priorities = [1.0_f32];
    let queues =
        [vk::DeviceQueueCreateInfo::default().queue_family_index(probed.queue_family).queue_priorities(&priorities)];
    let mut extensions = Vec::new();
    if probed.report.capabilities.memory_budget {
        extensions.push(ash::ext::memory_budget::NAME.as_ptr());
    }
    let mut chain = FeatureChain::enable(&probed.report.capabilities);
    let info = vk::DeviceCreateInfo::default()
        .queue_create_infos(&queues)
        .enabled_extension_names(&extensions)
        .enabled_features(&chain.core)
        .push_next(&mut chain.v11)
        .push_next(&mut chain.v12);
    // SAFETY: family, extensions and features were all found by the probe, and `info` points at locals that live on.
    unsafe { instance.raw.create_device(probed.physical, &info, None) }
        .map_err(|code| vulkan_error("vkCreateDevice", code))
}

impl Drop for Device {
    fn drop(&mut self) {
        // SAFETY: no other thread can use the queue: this is the last holder of the device.
        if let Err(code) = unsafe { self.raw.device_wait_idle() } {
            tracing::debug!("vkDeviceWaitIdle failed while closing: {code:?}");
        }
        for item in self.retired.take_ready(u64::MAX) {
            match item {
                Retired::Memory(raw) => self.destroy_raw(raw),
                Retired::Range(range) => range.free(),
            }
        }
        if let Some(markers) = self.markers.take() {
            self.destroy_raw(markers.into_raw());
        }
        for slot in self.slots.get_mut().unwrap_or_else(PoisonError::into_inner).drain(..) {
            slot.destroy(&self.raw);
        }
        for pool in self.query_pools.get_mut().unwrap_or_else(PoisonError::into_inner).drain(..) {
            // SAFETY: the device is idle and every Timer has given its pools back.
            unsafe { self.raw.destroy_query_pool(pool, None) };
        }
        // SAFETY: no pipeline is being made: each making holds the device. Null is allowed.
        unsafe { self.raw.destroy_pipeline_cache(self.pipeline_cache, None) };
        // SAFETY: the device is idle. Null is allowed.
        unsafe { self.raw.destroy_semaphore(self.queue.timeline(), None) };
        // SAFETY: all objects made from the device are destroyed: buffers, pipelines and pools hold an Arc of it or went above.
        unsafe { self.raw.destroy_device(None) };
    }
}

impl std::fmt::Debug for Device {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Device").field("name", &self.report.name).finish_non_exhaustive()
    }
}
