// SPDX-License-Identifier: Apache-2.0
//! The compute queue: numbered submissions, what each keeps alive, and waiting for them.
//!
//! Submission n is done when the timeline semaphore has reached n. Submissions run in order (each command list begins with a full
//! barrier). Any thread; `vkQueueSubmit` is called under the lock. A second queue would be a second `Queue` with its own timeline.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use ash::vk;

use crate::commands::Kept;
use crate::device::Device;
use crate::error::GpuError;
use crate::instance::vulkan_error;
use crate::markers::Mark;
use crate::names::Names;
use crate::timer::Timer;

/// One command pool with its one buffer.
#[derive(Debug)]
pub(crate) struct CommandSlot {
    pub(crate) pool: vk::CommandPool,
    pub(crate) buffer: vk::CommandBuffer,
}

impl CommandSlot {
    pub(crate) fn new(device: &Device) -> Result<Self, GpuError> {
        let info = vk::CommandPoolCreateInfo::default()
            .flags(vk::CommandPoolCreateFlags::TRANSIENT)
            .queue_family_index(device.queue.family);
        // SAFETY: the family is the one the device was made with.
        let pool = device.check("vkCreateCommandPool", unsafe { device.raw.create_command_pool(&info, None) })?;
        let mut slot = Self { pool, buffer: vk::CommandBuffer::null() };
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
}

#[derive(Debug)]
struct State {
    queue: vk::Queue,
    in_flight: VecDeque<InFlight>,
    /// Label of the newest submission known to have finished.
    last_finished: String,
}

#[derive(Debug)]
pub(crate) struct Queue {
    pub(crate) family: u32,
    timeline: vk::Semaphore,
    submitted: AtomicU64,
    state: Mutex<State>,
}

impl Queue {
    pub(crate) fn new(queue: vk::Queue, family: u32) -> Self {
        let state = State { queue, in_flight: VecDeque::new(), last_finished: "none".to_owned() };
        Self { family, timeline: vk::Semaphore::null(), submitted: AtomicU64::new(0), state: Mutex::new(state) }
    }

    pub(crate) fn create_timeline(&mut self, device: &ash::Device, names: &Names) -> Result<(), GpuError> {
        let mut kind = vk::SemaphoreTypeCreateInfo::default().semaphore_type(vk::SemaphoreType::TIMELINE);
        let info = vk::SemaphoreCreateInfo::default().push_next(&mut kind);
        // SAFETY: timelineSemaphore is enabled.
        let timeline = unsafe { device.create_semaphore(&info, None) };
        self.timeline = timeline.map_err(|code| vulkan_error("vkCreateSemaphore", code))?;
        names.set(self.timeline, "submissions");
        Ok(())
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(crate) fn timeline(&self) -> vk::Semaphore {
        self.timeline
    }

    /// Number of the newest submission; 0 = none yet.
    pub(crate) fn last_submitted(&self) -> u64 {
        self.submitted.load(Ordering::Acquire)
    }

    /// Submits a recorded command buffer and returns its number. On an error nothing runs and `work` is let go.
    pub(crate) fn submit(&self, device: &Device, mut work: InFlight) -> Result<u64, GpuError> {
        let mut state = self.lock();
        let value = self.last_submitted() + 1;
        work.value = value;
        let (values, semaphores, buffers) = ([value], [self.timeline], [work.slot.buffer]);
        let mut timeline = vk::TimelineSemaphoreSubmitInfo::default().signal_semaphore_values(&values);
        let info = [vk::SubmitInfo::default()
            .command_buffers(&buffers)
            .signal_semaphores(&semaphores)
            .push_next(&mut timeline)];
        // SAFETY: the lock gives this thread alone the queue; the buffer is executable and recorded on this device, the value is
        // one above the newest, and `work` keeps alive what the buffer names.
        match unsafe { device.raw.queue_submit(state.queue, &info, vk::Fence::null()) } {
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
