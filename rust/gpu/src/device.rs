// SPDX-License-Identifier: Apache-2.0
//! The logical device and everything that must live as long as any object made from it.
//!
//! `Device` is shared by `Arc` from every buffer, heap, pipeline and submission; [`Gpu`](crate::Gpu) is the public
//! handle. Work in flight (held by the queue) and retired ranges point back at the device: `Gpu`'s Drop waits and
//! clears them, after which nothing can be submitted and retiring frees at once, so no cycle outlives the last public
//! object. Any thread.

use std::sync::{Arc, Mutex, OnceLock, PoisonError, Weak};

use ash::vk;

use crate::arena::RetiredRange;
use crate::budget::{Budget, automatic_budget};
use crate::cache_file::CacheFile;
use crate::capabilities::FeatureChain;
use crate::error::GpuError;
use crate::gpu::{Limits, OpenOptions};
use crate::heap::HeapCore;
use crate::heap_counters::HeldBytes;
use crate::host_view::HostMemory;
use crate::instance::{Instance, vulkan_error};
use crate::lane::{LANES, Lane, Points, QueueChoices};
use crate::markers::Markers;
use crate::memory::{Patience, RawBuffer};
use crate::names::Names;
use crate::probe::{Probed, read_heaps};
use crate::queue::{InFlight, Queue};
use crate::report::DeviceReport;
use crate::retire::RetireQueue;
use crate::timer::POOL_QUERIES;

/// Something to destroy or free once the GPU no longer uses it.
#[derive(Debug)]
pub(crate) enum Retired {
    /// A buffer with its memory, and the memory's place in the count of a heap.
    Memory(RawBuffer, Option<HeldBytes>),
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
    /// All memory is one kind: the host shares it with the device.
    pub(crate) unified: bool,
    pub(crate) names: Names,
    pub(crate) budget: Budget,
    pub(crate) queues: [Queue; LANES],
    pub(crate) pipeline_cache: vk::PipelineCache,
    pub(crate) cache_file: Option<CacheFile>,
    /// Timestamps are wanted by default.
    pub(crate) profile: bool,
    pub(crate) markers: Option<Markers>,
    pub(crate) heaps: Mutex<Vec<Weak<HeapCore>>>,
    retired: RetireQueue<Retired>,
    pub(crate) host_memory: HostMemory,
    query_pools: Mutex<Vec<vk::QueryPool>>,
    lost: OnceLock<String>,
    #[cfg(feature = "faults")]
    pub(crate) watch: Arc<crate::watch::Watch>,
    /// Last: everything above is made from it.
    pub(crate) instance: Arc<Instance>,
}

impl Device {
    /// Opens a probed device that lacks nothing.
    pub(crate) fn new(instance: Arc<Instance>, probed: Probed, options: &OpenOptions) -> Result<Self, GpuError> {
        let mut choices = probed.queues;
        if !options.transfer_queue {
            choices[Lane::Transfer.index()] = choices[Lane::Main.index()];
        }
        let raw = create_raw(&instance, &probed, &choices)?;
        // SAFETY: the physical device comes from this instance.
        let memory_types = unsafe { instance.raw.get_physical_device_memory_properties(probed.physical) };
        #[cfg(feature = "faults")]
        let (raw, watch) = crate::watch::taken_over(&raw, &memory_types);
        let heaps = &probed.report.heaps;
        let unified = heaps.iter().all(|heap| heap.device_local);
        let names = Names::new(&instance.raw, &raw, instance.names);
        let mut device = Self {
            physical: probed.physical,
            memory_types,
            limits: Limits::of(&probed),
            unified,
            names,
            budget: Budget::new(0),
            queues: get_queues(&raw, &choices),
            pipeline_cache: vk::PipelineCache::null(),
            cache_file: options.pipeline_cache.as_ref().map(|folder| CacheFile::new(folder, &probed)),
            profile: options.profile && probed.report.capabilities.timestamps,
            markers: None,
            heaps: Mutex::new(Vec::new()),
            retired: RetireQueue::new(),
            host_memory: HostMemory::default(),
            query_pools: Mutex::new(Vec::new()),
            lost: OnceLock::new(),
            #[cfg(feature = "faults")]
            watch,
            report: probed.report,
            raw,
            instance,
        };
        device.budget.set_budget(options.budget_bytes.unwrap_or_else(|| device.automatic_budget()));
        for queue in &mut device.queues {
            queue.create_timeline(&device.raw, &device.names)?;
        }
        device.create_pipeline_cache()?;
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

    /// Turns a failed call into this crate's error, and notices a lost device. Never called with a lock of this crate
    /// held.
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
            let last_of = |lane| self.queue(lane).last_pass(self.markers.as_ref().map(|markers| markers.read(lane)));
            let mut last_pass = last_of(Lane::Main);
            if self.queue(Lane::Transfer).oldest_in_flight().is_some() {
                last_pass = format!("{last_pass}; of the transfers: {}", last_of(Lane::Transfer));
            }
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

    pub(crate) fn queue(&self, lane: Lane) -> &Queue {
        &self.queues[lane.index()]
    }

    /// The newest submission of each lane.
    pub(crate) fn submitted(&self) -> Points {
        Points(Lane::ALL.map(|lane| self.queue(lane).last_submitted()))
    }

    /// The newest submission of each lane that has finished; everything, when the device is lost.
    pub(crate) fn completed(&self) -> Points {
        let mut completed = Points::START;
        for lane in Lane::ALL {
            if self.lost.get().is_some() {
                return Points::END;
            }
            match self.queue(lane).completed(self) {
                Ok(value) => completed.raise(lane, value),
                Err(GpuError::DeviceLost { .. }) => return Points::END,
                Err(_) => {}
            }
        }
        completed
    }

    /// Waits until both lanes have come as far as `points`.
    pub(crate) fn wait_for(&self, points: Points) -> Result<(), GpuError> {
        for lane in Lane::ALL {
            self.queue(lane).wait(self, points.of(lane), u64::MAX)?;
        }
        Ok(())
    }

    /// Destroys or frees `item` after these submissions: at once if they have passed.
    pub(crate) fn retire(&self, points: Points, item: Retired) {
        self.retired.push(points, item);
        self.collect();
    }

    /// Lets go of everything that finished submissions used.
    pub(crate) fn collect(&self) {
        let completed = self.completed();
        for lane in Lane::ALL {
            for InFlight { slot, kept, timer, .. } in self.queue(lane).take_finished(completed.of(lane)) {
                self.recycle_slot(slot);
                // What the submission kept alive may be retired by this.
                drop((kept, timer));
            }
        }
        self.release(self.retired.take_ready(completed));
    }

    /// Destroys or frees what nothing uses any more.
    pub(crate) fn release(&self, items: Vec<Retired>) {
        if items.is_empty() {
            return;
        }
        for item in self.host_memory.release(items) {
            match item {
                Retired::Memory(raw, held) => {
                    self.destroy_raw(raw);
                    drop(held);
                }
                Retired::Range(range) => range.free(),
            }
        }
    }

    /// Makes room: collects, empties heaps of unused arenas and, if allowed, waits for what is retired.
    pub(crate) fn reclaim(&self, patience: Patience) -> Result<(), GpuError> {
        self.collect();
        self.trim_heaps();
        if patience == Patience::WaitForRetired
            && let Some(points) = self.retired.last_points()
        {
            self.wait_for(points)?;
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

/// The logical device with the queues of its lanes and everything that was found switched on.
fn create_raw(instance: &Instance, probed: &Probed, choices: &QueueChoices) -> Result<ash::Device, GpuError> {
    let priorities = [1.0_f32; LANES];
    let [main, transfer] = *choices;
    let queues_of = |family: u32, count: u32| {
        let priorities = &priorities[..count as usize];
        vk::DeviceQueueCreateInfo::default().queue_family_index(family).queue_priorities(priorities)
    };
    let mut queues = vec![queues_of(main.family, main.index.max(transfer.index) + 1)];
    if transfer.family != main.family {
        queues = vec![queues_of(main.family, main.index + 1), queues_of(transfer.family, transfer.index + 1)];
    }
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

/// The queues of the lanes, which may be one and the same.
fn get_queues(raw: &ash::Device, choices: &QueueChoices) -> [Queue; LANES] {
    let get = |lane: Lane| {
        let choice = choices[lane.index()];
        // SAFETY: the device was made with all queues of the choices.
        let queue = unsafe { raw.get_device_queue(choice.family, choice.index) };
        Arc::new(Mutex::new(queue))
    };
    let main = get(Lane::Main);
    let shared = choices[0] == choices[1];
    let transfer = if shared { Arc::clone(&main) } else { get(Lane::Transfer) };
    [Queue::new(Lane::Main, choices[0], main), Queue::new(Lane::Transfer, choices[1], transfer)]
}

impl Drop for Device {
    fn drop(&mut self) {
        // SAFETY: no other thread can use the queues: this is the last holder of the device.
        if let Err(code) = unsafe { self.raw.device_wait_idle() } {
            tracing::debug!("vkDeviceWaitIdle failed while closing: {code:?}");
        }
        self.release(self.retired.take_ready(Points::END));
        if let Some(markers) = self.markers.take() {
            self.destroy_raw(markers.into_raw());
        }
        self.destroy_queues();
        for pool in self.query_pools.get_mut().unwrap_or_else(PoisonError::into_inner).drain(..) {
            // SAFETY: the device is idle and every Timer has given its pools back.
            unsafe { self.raw.destroy_query_pool(pool, None) };
        }
        self.save_pipeline_cache();
        // SAFETY: no pipeline is being made: each making holds the device. Null is allowed.
        unsafe { self.raw.destroy_pipeline_cache(self.pipeline_cache, None) };
        // SAFETY: all objects made from the device are destroyed: buffers, pipelines and pools hold an Arc of it or
        // went above.
        unsafe { self.raw.destroy_device(None) };
    }
}

impl std::fmt::Debug for Device {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Device").field("name", &self.report.name).finish_non_exhaustive()
    }
}
