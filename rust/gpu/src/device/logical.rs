// SPDX-License-Identifier: Apache-2.0
//! The logical device and the state that every object made from it needs: the budget, the progress of its lanes,
//! retired buffers.
//!
//! Knows nothing of queues, heaps and pipelines: those hold a `LogicalDevice` by `Arc`, and it holds none of them, so
//! that the last one closes it. Any thread.

use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use ash::vk;

use crate::device::budget::{MemoryBudget, automatic_budget};
use crate::device::host_memory::HostMemory;
use crate::device::lending::PageLender;
use crate::device::markers::OperationMarkers;
use crate::device::names::DebugNames;
use crate::device::options::OpenOptions;
use crate::device::passes::SubmissionLog;
use crate::device::raw_buffer::{RawBuffer, RetiredBuffer};
use crate::device::retire::RetireQueue;
use crate::device::timeline::TimelineSemaphore;
use crate::error::GpuError;
use crate::instance::capabilities::FeatureChain;
use crate::instance::lane::{LANES, QueueChoice, QueueChoices, QueueLane, TimelinePoints};
use crate::instance::limits::DeviceLimits;
use crate::instance::probe::{ProbedDevice, read_heaps};
use crate::instance::report::DeviceReport;
use crate::instance::vulkan::{Instance, vulkan_error};

/// Number of queries in one pool.
pub(crate) const POOL_QUERIES: u32 = 256;

/// A Vulkan device with its budget, lanes and retired buffers.
pub(crate) struct LogicalDevice {
    pub(crate) raw: ash::Device,
    pub(crate) physical: vk::PhysicalDevice,
    pub(crate) memory_types: vk::PhysicalDeviceMemoryProperties,
    pub(crate) report: DeviceReport,
    pub(crate) limits: DeviceLimits,
    /// True if all memory is of one kind, which the host shares with the device.
    pub(crate) unified: bool,
    pub(crate) names: DebugNames,
    pub(crate) budget: MemoryBudget,
    /// Queue of each lane.
    pub(crate) choices: QueueChoices,
    timelines: [TimelineSemaphore; LANES],
    passes: [SubmissionLog; LANES],
    /// True if timestamps are wanted by default.
    pub(crate) profile: bool,
    /// Markers; set once before the device is shared.
    pub(crate) markers: Option<OperationMarkers>,
    retired: RetireQueue<RetiredBuffer>,
    pub(crate) host_memory: HostMemory,
    /// Lends pages of the process as host memory, if the driver accepts them.
    pub(crate) lending: Option<PageLender>,
    /// Exports memory, if the driver can.
    pub(crate) exporting: Option<ash::khr::external_memory_fd::Device>,
    query_pools: Mutex<Vec<vk::QueryPool>>,
    lost: OnceLock<String>,
    #[cfg(feature = "faults")]
    pub(crate) watch: Arc<crate::device::watch::DriverWatch>,
    /// Dropped last, because everything above is made from it.
    pub(crate) instance: Arc<Instance>,
}

impl LogicalDevice {
    /// Opens a probed device that lacks nothing.
    pub(crate) fn new(instance: Arc<Instance>, probed: ProbedDevice, options: &OpenOptions) -> Result<Self, GpuError> {
        let mut choices = probed.queues;
        if !options.transfer_queue {
            choices[QueueLane::Transfer.index()] = choices[QueueLane::Main.index()];
        }
        let raw = create_raw(&instance, &probed, &choices)?;
        // SAFETY: the physical device comes from this instance.
        let memory_types = unsafe { instance.raw.get_physical_device_memory_properties(probed.physical) };
        #[cfg(feature = "faults")]
        let (raw, watch) = crate::device::watch::taken_over(&raw, &memory_types);
        let granule = probed.lent_granule;
        let lending = (granule > 0).then(|| PageLender::new(&instance, &raw, granule));
        let exports = probed.report.capabilities.external_memory_fd;
        let exporting = exports.then(|| ash::khr::external_memory_fd::Device::new(&instance.raw, &raw));
        let heaps = &probed.report.heaps;
        let unified = heaps.iter().all(|heap| heap.device_local);
        let names = DebugNames::new(&instance.raw, &raw, instance.names);
        let mut device = Self {
            physical: probed.physical,
            memory_types,
            limits: DeviceLimits::of(&probed),
            unified,
            names,
            budget: MemoryBudget::new(0),
            choices,
            timelines: Default::default(),
            passes: Default::default(),
            profile: options.profile && probed.report.capabilities.timestamps,
            markers: None,
            retired: RetireQueue::new(),
            host_memory: HostMemory::default(),
            lending,
            exporting,
            query_pools: Mutex::new(Vec::new()),
            lost: OnceLock::new(),
            #[cfg(feature = "faults")]
            watch,
            report: probed.report,
            raw,
            instance,
        };
        device.budget.set_budget(options.budget_bytes.unwrap_or_else(|| device.automatic_budget()));
        for (lane, timeline) in QueueLane::ALL.into_iter().zip(&mut device.timelines) {
            timeline.create(&device.raw, &device.names, lane)?;
        }
        Ok(device)
    }

    /// Nine tenths of the free bytes on the largest device-local heap now.
    pub(crate) fn automatic_budget(&self) -> u64 {
        let heaps = read_heaps(&self.instance, self.physical, self.report.capabilities.memory_budget);
        let largest = heaps.iter().filter(|heap| heap.device_local).max_by_key(|heap| heap.bytes);
        let free = largest.map_or(0, |heap| heap.free.unwrap_or(heap.bytes));
        automatic_budget(free.saturating_add(self.budget.counts().used))
    }

    /// Turns a failed call into this crate's error, and notices a lost device.
    pub(crate) fn check<T>(&self, call: &'static str, result: Result<T, vk::Result>) -> Result<T, GpuError> {
        result.map_err(|code| match code {
            vk::Result::ERROR_DEVICE_LOST => self.lose(),
            vk::Result::ERROR_OUT_OF_HOST_MEMORY | vk::Result::ERROR_OUT_OF_DEVICE_MEMORY => {
                self.budget.refused(call, 0)
            }
            other => vulkan_error(call, other),
        })
    }

    /// Records that the device is lost; the error has the last pass.
    fn lose(&self) -> GpuError {
        let last_pass = self.lost.get_or_init(|| {
            let marker = |lane| self.markers.as_ref().map(|markers| markers.read(lane));
            let last_of = |lane| self.passes(lane).last_pass(marker(lane));
            let mut last_pass = last_of(QueueLane::Main);
            if !self.passes(QueueLane::Transfer).is_empty() {
                last_pass = format!("{last_pass}; of the transfers: {}", last_of(QueueLane::Transfer));
            }
            tracing::error!(last_pass, "the GPU was lost");
            last_pass
        });
        GpuError::DeviceLost { last_pass: last_pass.clone() }
    }

    /// Returns the error of a lost device, if it is lost.
    pub(crate) fn check_alive(&self) -> Result<(), GpuError> {
        match self.lost.get() {
            None => Ok(()),
            Some(last_pass) => Err(GpuError::DeviceLost { last_pass: last_pass.clone() }),
        }
    }

    /// Returns an error if a test planted a failure of this request.
    #[cfg(feature = "faults")]
    pub(crate) fn planted(
        &self,
        call: crate::device::watch::DriverCall,
        name: &str,
        bytes: u64,
    ) -> Result<(), GpuError> {
        if self.watch.strikes(call) { Err(self.budget.refused(name, bytes)) } else { Ok(()) }
    }

    /// Queue that serves a lane.
    pub(crate) fn choice(&self, lane: QueueLane) -> &QueueChoice {
        &self.choices[lane.index()]
    }

    pub(crate) fn timeline(&self, lane: QueueLane) -> &TimelineSemaphore {
        &self.timelines[lane.index()]
    }

    /// Log of the submissions that a lane has in flight.
    pub(crate) fn passes(&self, lane: QueueLane) -> &SubmissionLog {
        &self.passes[lane.index()]
    }

    /// Newest submission of each lane.
    pub(crate) fn submitted(&self) -> TimelinePoints {
        TimelinePoints(QueueLane::ALL.map(|lane| self.timeline(lane).last_submitted()))
    }

    /// The newest submission of each lane that has finished; all submissions, if the device is lost.
    pub(crate) fn completed(&self) -> TimelinePoints {
        let mut completed = TimelinePoints::START;
        for lane in QueueLane::ALL {
            if self.lost.get().is_some() {
                return TimelinePoints::END;
            }
            let value = self.timeline(lane).completed(&self.raw);
            match self.check("vkGetSemaphoreCounterValue", value) {
                Ok(value) => completed.raise(lane, value),
                Err(GpuError::DeviceLost { .. }) => return TimelinePoints::END,
                Err(_) => {}
            }
        }
        completed
    }

    /// Returns `Ok(true)` once submission `value` of a lane has finished, `Ok(false)` after `timeout_ns`.
    pub(crate) fn wait(&self, lane: QueueLane, value: u64, timeout_ns: u64) -> Result<bool, GpuError> {
        self.check_alive()?;
        match self.timeline(lane).wait(&self.raw, value, timeout_ns) {
            Ok(()) => Ok(true),
            Err(vk::Result::TIMEOUT) => Ok(false),
            Err(code) => self.check("vkWaitSemaphores", Err(code)),
        }
    }

    /// Waits until both lanes have reached `points`.
    pub(crate) fn wait_for(&self, points: TimelinePoints) -> Result<(), GpuError> {
        for lane in QueueLane::ALL {
            self.wait(lane, points.of(lane), u64::MAX)?;
        }
        Ok(())
    }

    /// Destroys a buffer after these submissions, or at once if they have finished.
    pub(crate) fn retire(&self, points: TimelinePoints, buffer: RetiredBuffer) {
        self.retired.push(points, buffer);
        self.release(self.completed());
    }

    /// Destroys retired objects that wait for nothing after `completed`.
    pub(crate) fn release(&self, completed: TimelinePoints) {
        for RetiredBuffer { raw, held } in self.host_memory.take_ready(&self.retired, completed) {
            self.destroy(raw);
            drop(held);
        }
    }

    /// The points after which everything retired now can be destroyed; `None` if nothing is retired.
    pub(crate) fn last_retired(&self) -> Option<TimelinePoints> {
        self.retired.last_points()
    }

    /// Destroys a buffer that the GPU no longer uses; `raw` has no other copy that is used later.
    pub(crate) fn destroy(&self, raw: RawBuffer) {
        raw.destroy(&self.raw, &self.budget);
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

/// The logical device with the queues of its lanes and every capability that was found enabled.
fn create_raw(instance: &Instance, probed: &ProbedDevice, choices: &QueueChoices) -> Result<ash::Device, GpuError> {
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
    if probed.report.capabilities.external_memory_host {
        extensions.push(ash::ext::external_memory_host::NAME.as_ptr());
    }
    if probed.report.capabilities.external_memory_fd {
        extensions.push(ash::khr::external_memory_fd::NAME.as_ptr());
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

impl Drop for LogicalDevice {
    fn drop(&mut self) {
        // SAFETY: no other thread can use the queues: this is the last holder of the device.
        if let Err(code) = unsafe { self.raw.device_wait_idle() } {
            tracing::debug!("vkDeviceWaitIdle failed while closing: {code:?}");
        }
        self.release(TimelinePoints::END);
        if let Some(markers) = self.markers.take() {
            self.destroy(markers.into_raw());
        }
        for timeline in &mut self.timelines {
            timeline.destroy(&self.raw);
        }
        for pool in self.query_pools.get_mut().unwrap_or_else(PoisonError::into_inner).drain(..) {
            // SAFETY: the device is idle and every Timer has given its pools back.
            unsafe { self.raw.destroy_query_pool(pool, None) };
        }
        // SAFETY: all objects made from the device are destroyed: each holds an Arc of it or went above.
        unsafe { self.raw.destroy_device(None) };
    }
}

impl std::fmt::Debug for LogicalDevice {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Device").field("name", &self.report.name).finish_non_exhaustive()
    }
}
