// SPDX-License-Identifier: Apache-2.0
//! The queue of a lane: numbered submissions, what each keeps alive, and waiting for them.
//!
//! Submission n is done when the lane's timeline semaphore has reached n. Submissions of a lane run in order (each
//! command list begins with a full barrier); those of different lanes do not, unless one waits for the other. Any
//! thread.
//!
//! Locks: a lane's own before the Vulkan queue's, which lanes without a queue of their own share.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use ash::vk;

use crate::commands::Kept;
use crate::device::Device;
use crate::error::GpuError;
use crate::instance::vulkan_error;
use crate::lane::{Lane, Points, QueueChoice};
use crate::markers::Mark;
use crate::names::Names;
use crate::timer::Timer;

/// One command pool with its one buffer.
#[derive(Debug)]
pub(crate) struct CommandSlot {
    lane: Lane,
    pool: vk::CommandPool,
    pub(crate) buffer: vk::CommandBuffer,
}

impl CommandSlot {
    fn new(device: &Device, lane: Lane) -> Result<Self, GpuError> {
        let info = vk::CommandPoolCreateInfo::default()
            .flags(vk::CommandPoolCreateFlags::TRANSIENT)
            .queue_family_index(device.queue(lane).choice.family);
        // SAFETY: the family is one the device was made with.
        let pool = device.check("vkCreateCommandPool", unsafe { device.raw.create_command_pool(&info, None) })?;
        let mut slot = Self { lane, pool, buffer: vk::CommandBuffer::null() };
        let info = vk::CommandBufferAllocateInfo::default()
            .command_pool(pool)
            .level(vk::CommandBufferLevel::PRIMARY)
            .command_buffer_count(1);
        // SAFETY: the pool was just created, and nobody else uses it.
        match device.check("vkAllocateCommandBuffers", unsafe { device.raw.allocate_command_buffers(&info) }) {
            Ok(buffers) => {
                slot.buffer = buffers.first().copied().unwrap_or_default();
                Ok(slot)
            }
            Err(error) => {
                slot.destroy(&device.raw);
                Err(error)
            }
        }
    }

    /// Destroys the pool with its buffer, which no submission uses.
    pub(crate) fn destroy(self, device: &ash::Device) {
        // SAFETY: the slot is owned, and its buffer is not pending.
        unsafe { device.destroy_command_pool(self.pool, None) };
    }
}

/// Everything a submission needs until it has finished.
#[derive(Debug)]
pub(crate) struct InFlight {
    pub(crate) value: u64,
    pub(crate) label: String,
    pub(crate) slot: CommandSlot,
    pub(crate) kept: Vec<Kept>,
    pub(crate) timer: Option<Arc<Timer>>,
    pub(crate) marks: Vec<Mark>,
    /// What other lanes must have finished before it runs.
    pub(crate) waits: Points,
}

#[derive(Debug)]
struct State {
    in_flight: VecDeque<InFlight>,
    /// Label of the newest submission known to have finished.
    last_finished: String,
}

#[derive(Debug)]
pub(crate) struct Queue {
    lane: Lane,
    pub(crate) choice: QueueChoice,
    timeline: vk::Semaphore,
    submitted: AtomicU64,
    raw: Arc<Mutex<vk::Queue>>,
    state: Mutex<State>,
    slots: Mutex<Vec<CommandSlot>>,
}

impl Queue {
    pub(crate) fn new(lane: Lane, choice: QueueChoice, raw: Arc<Mutex<vk::Queue>>) -> Self {
        let state = State { in_flight: VecDeque::new(), last_finished: "none".to_owned() };
        Self {
            lane,
            choice,
            timeline: vk::Semaphore::null(),
            submitted: AtomicU64::new(0),
            raw,
            state: Mutex::new(state),
            slots: Mutex::new(Vec::new()),
        }
    }

    pub(crate) fn create_timeline(&mut self, device: &ash::Device, names: &Names) -> Result<(), GpuError> {
        let mut kind = vk::SemaphoreTypeCreateInfo::default().semaphore_type(vk::SemaphoreType::TIMELINE);
        let info = vk::SemaphoreCreateInfo::default().push_next(&mut kind);
        // SAFETY: timelineSemaphore is enabled.
        let timeline = unsafe { device.create_semaphore(&info, None) };
        self.timeline = timeline.map_err(|code| vulkan_error("vkCreateSemaphore", code))?;
        names.set(
            self.timeline,
            match self.lane {
                Lane::Main => "submissions",
                Lane::Transfer => "transfers",
            },
        );
        Ok(())
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    #[cfg(test)]
    pub(crate) fn timeline(&self) -> vk::Semaphore {
        self.timeline
    }

    /// Number of the newest submission; 0 = none yet.
    pub(crate) fn last_submitted(&self) -> u64 {
        self.submitted.load(Ordering::Acquire)
    }

    /// Number of the newest submission that has finished.
    pub(crate) fn completed(&self, device: &Device) -> Result<u64, GpuError> {
        // SAFETY: the semaphore is a timeline of this device and lives as long as it.
        let value = unsafe { device.raw.get_semaphore_counter_value(self.timeline) };
        device.check("vkGetSemaphoreCounterValue", value)
    }

    /// Number of the oldest submission not known to have finished.
    pub(crate) fn oldest_in_flight(&self) -> Option<u64> {
        self.lock().in_flight.front().map(|work| work.value)
    }

    /// Submits a recorded command buffer and returns its number. On an error nothing runs and `work` is let go.
    pub(crate) fn submit(&self, device: &Device, mut work: InFlight) -> Result<u64, GpuError> {
        let mut state = self.lock();
        let value = self.last_submitted() + 1;
        work.value = value;
        match self.submit_raw(device, &work) {
            Ok(()) => {
                self.submitted.store(value, Ordering::Release);
                state.in_flight.push_back(work);
                Ok(value)
            }
            Err(code) => {
                drop(state);
                device.recycle_slot(work.slot);
                device.check("vkQueueSubmit", Err(code))
            }
        }
    }

    fn submit_raw(&self, device: &Device, work: &InFlight) -> Result<(), vk::Result> {
        let (values, semaphores, buffers) = ([work.value], [self.timeline], [work.slot.buffer]);
        let others = Lane::ALL.into_iter().filter(|&lane| lane != self.lane && work.waits.of(lane) > 0);
        let waits: Vec<_> = others.map(|lane| (device.queue(lane).timeline, work.waits.of(lane))).collect();
        let (wait_semaphores, wait_values): (Vec<_>, Vec<_>) = waits.into_iter().unzip();
        // A signal makes all writes before it available, a wait makes them visible to these stages: no barrier is
        // needed besides.
        let wait_stages = vec![vk::PipelineStageFlags::ALL_COMMANDS; wait_semaphores.len()];
        let mut timeline = vk::TimelineSemaphoreSubmitInfo::default()
            .wait_semaphore_values(&wait_values)
            .signal_semaphore_values(&values);
        let info = [vk::SubmitInfo::default()
            .wait_semaphores(&wait_semaphores)
            .wait_dst_stage_mask(&wait_stages)
            .command_buffers(&buffers)
            .signal_semaphores(&semaphores)
            .push_next(&mut timeline)];
        let queue = self.raw.lock().unwrap_or_else(PoisonError::into_inner);
        // SAFETY: the lock gives this thread alone the queue; the buffer is executable and recorded for its family, the
        // value is one above the newest of this timeline (the caller holds the lane), those waited for were submitted
        // before, and the caller keeps alive what the buffer names.
        unsafe { device.raw.queue_submit(*queue, &info, vk::Fence::null()) }
    }

    /// Ok(true) once submission `value` has finished, Ok(false) after `timeout_ns`.
    pub(crate) fn wait(&self, device: &Device, value: u64, timeout_ns: u64) -> Result<bool, GpuError> {
        device.check_alive()?;
        let (semaphores, values) = ([self.timeline], [value]);
        let info = vk::SemaphoreWaitInfo::default().semaphores(&semaphores).values(&values);
        // SAFETY: the semaphore is a timeline of this device, and `value` was submitted, so that the wait ends.
        match unsafe { device.raw.wait_semaphores(&info, timeout_ns) } {
            Ok(()) => Ok(true),
            Err(vk::Result::TIMEOUT) => Ok(false),
            Err(code) => device.check("vkWaitSemaphores", Err(code)),
        }
    }

    /// Takes what submissions up to `completed` kept alive. The caller drops it without this queue's lock.
    pub(crate) fn take_finished(&self, completed: u64) -> Vec<InFlight> {
        let mut state = self.lock();
        let count = state.in_flight.iter().take_while(|work| work.value <= completed).count();
        let finished: Vec<_> = state.in_flight.drain(..count).collect();
        if let Some(newest) = finished.last() {
            state.last_finished.clone_from(&newest.label);
        }
        finished
    }

    /// What ran last, for the error of a lost device: by the marker if there is one, else the last finished submission.
    pub(crate) fn last_pass(&self, marker: Option<u32>) -> String {
        let state = self.lock();
        let running = state.in_flight.front().map(|work| work.label.as_str());
        let found = marker.and_then(|marker| crate::markers::describe(&state.in_flight, marker));
        match (found, running) {
            (Some(pass), _) => pass,
            (None, Some(running)) => format!("{} (then {running} was submitted)", state.last_finished),
            (None, None) => state.last_finished.clone(),
        }
    }
}

impl Device {
    /// A command pool with its buffer, ready to record for a lane.
    pub(crate) fn command_slot(&self, lane: Lane) -> Result<CommandSlot, GpuError> {
        let recycled = self.queue(lane).slots.lock().unwrap_or_else(PoisonError::into_inner).pop();
        match recycled {
            Some(slot) => Ok(slot),
            None => CommandSlot::new(self, lane),
        }
    }

    /// Takes back a slot that no submission uses.
    pub(crate) fn recycle_slot(&self, slot: CommandSlot) {
        // SAFETY: the caller owns the slot, and its buffer is not pending.
        let reset = unsafe { self.raw.reset_command_pool(slot.pool, vk::CommandPoolResetFlags::empty()) };
        if reset.is_ok() {
            self.queue(slot.lane).slots.lock().unwrap_or_else(PoisonError::into_inner).push(slot);
        } else {
            slot.destroy(&self.raw);
        }
    }

    /// Destroys what the queues are made of. The device is idle and no command list is left.
    pub(crate) fn destroy_queues(&mut self) {
        for queue in &mut self.queues {
            for slot in queue.slots.get_mut().unwrap_or_else(PoisonError::into_inner).drain(..) {
                slot.destroy(&self.raw);
            }
            // SAFETY: the device is idle. Null is allowed.
            unsafe { self.raw.destroy_semaphore(queue.timeline, None) };
        }
    }
}
