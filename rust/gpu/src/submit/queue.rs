// SPDX-License-Identifier: Apache-2.0
//! The queue of a lane: numbered submissions, and what each keeps alive.
//!
//! Submission n is done when the lane's timeline has reached n. Submissions of a lane run in order (each command list
//! begins with a full barrier); those of different lanes do not, unless one waits for the other. Any thread.
//!
//! Locks: a lane's own before the Vulkan queue's, which lanes without a queue of their own share.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use ash::vk;

use crate::device::logical::LogicalDevice;
use crate::device::markers::OperationMark;
use crate::error::GpuError;
use crate::instance::lane::{LANES, QueueLane, TimelinePoints};
use crate::submit::kept::HeldResource;
use crate::submit::timer::QueryTimer;

/// One command pool with its one buffer.
#[derive(Debug)]
pub(crate) struct CommandSlot {
    pool: vk::CommandPool,
    pub(crate) buffer: vk::CommandBuffer,
}

impl CommandSlot {
    fn new(device: &LogicalDevice, lane: QueueLane) -> Result<Self, GpuError> {
        let info = vk::CommandPoolCreateInfo::default()
            .flags(vk::CommandPoolCreateFlags::TRANSIENT)
            .queue_family_index(device.choice(lane).family);
        // SAFETY: the family is one the device was made with.
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
    /// Number of the submission, given when it is made.
    pub(crate) value: u64,
    pub(crate) slot: CommandSlot,
    pub(crate) kept: Vec<HeldResource>,
    pub(crate) timer: Option<Arc<QueryTimer>>,
    /// What other lanes must have finished before it runs.
    pub(crate) waits: TimelinePoints,
}

/// The queue of a lane.
#[derive(Debug)]
pub(crate) struct Queue {
    lane: QueueLane,
    raw: Arc<Mutex<vk::Queue>>,
    /// Oldest first.
    in_flight: Mutex<VecDeque<InFlight>>,
    slots: Mutex<Vec<CommandSlot>>,
}

impl Queue {
    /// The queues of the lanes, which may share one of Vulkan's.
    pub(crate) fn of_lanes(device: &LogicalDevice) -> [Self; LANES] {
        let get = |lane: QueueLane| {
            let choice = device.choice(lane);
            // SAFETY: the device was made with all queues of the choices.
            let queue = unsafe { device.raw.get_device_queue(choice.family, choice.index) };
            Arc::new(Mutex::new(queue))
        };
        let main = get(QueueLane::Main);
        let is_shared = device.choice(QueueLane::Main) == device.choice(QueueLane::Transfer);
        let transfer = if is_shared { Arc::clone(&main) } else { get(QueueLane::Transfer) };
        [Self::new(QueueLane::Main, main), Self::new(QueueLane::Transfer, transfer)]
    }

    fn new(lane: QueueLane, raw: Arc<Mutex<vk::Queue>>) -> Self {
        Self { lane, raw, in_flight: Mutex::new(VecDeque::new()), slots: Mutex::new(Vec::new()) }
    }

    fn lock(&self) -> MutexGuard<'_, VecDeque<InFlight>> {
        self.in_flight.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Number of the oldest submission not known to have finished.
    pub(crate) fn oldest_in_flight(&self) -> Option<u64> {
        self.lock().front().map(|work| work.value)
    }

    /// Submits a recorded command buffer and returns its number; label and marks are for the error of a lost device. On
    /// an error nothing runs and `work` is let go.
    pub(crate) fn submit(
        &self,
        device: &LogicalDevice,
        mut work: InFlight,
        (label, marks): (String, Vec<OperationMark>),
    ) -> Result<u64, GpuError> {
        let mut in_flight = self.lock();
        let timeline = device.timeline(self.lane);
        let value = timeline.last_submitted() + 1;
        work.value = value;
        #[cfg(feature = "faults")]
        let submitted = if device.watch.loses() {
            // What a lost device had is over, and its memory goes at once; this one is at work still.
            device.wait_for(device.submitted()).ok();
            Err(vk::Result::ERROR_DEVICE_LOST)
        } else {
            self.submit_raw(device, &work)
        };
        #[cfg(not(feature = "faults"))]
        let submitted = self.submit_raw(device, &work);
        match submitted {
            Ok(()) => {
                timeline.advance(value);
                device.passes(self.lane).submitted(value, label, marks);
                in_flight.push_back(work);
                Ok(value)
            }
            Err(code) => {
                drop(in_flight);
                self.recycle(device, work.slot);
                device.check("vkQueueSubmit", Err(code))
            }
        }
    }

    fn submit_raw(&self, device: &LogicalDevice, work: &InFlight) -> Result<(), vk::Result> {
        let semaphore = |lane| device.timeline(lane).semaphore();
        let (values, semaphores, buffers) = ([work.value], [semaphore(self.lane)], [work.slot.buffer]);
        let others = QueueLane::ALL.into_iter().filter(|&lane| lane != self.lane && work.waits.of(lane) > 0);
        let waits: Vec<_> = others.map(|lane| (semaphore(lane), work.waits.of(lane))).collect();
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

    /// Takes what submissions up to `completed` kept alive. The caller drops it without this queue's lock.
    pub(crate) fn take_finished(&self, device: &LogicalDevice, completed: u64) -> Vec<InFlight> {
        let mut in_flight = self.lock();
        let count = in_flight.iter().take_while(|work| work.value <= completed).count();
        device.passes(self.lane).finished(completed);
        in_flight.drain(..count).collect()
    }

    /// A command pool with its buffer, ready to record.
    pub(crate) fn slot(&self, device: &LogicalDevice) -> Result<CommandSlot, GpuError> {
        let recycled = self.slots.lock().unwrap_or_else(PoisonError::into_inner).pop();
        match recycled {
            Some(slot) => Ok(slot),
            None => CommandSlot::new(device, self.lane),
        }
    }

    /// Takes back a slot of this lane that no submission uses.
    pub(crate) fn recycle(&self, device: &LogicalDevice, slot: CommandSlot) {
        // SAFETY: the caller owns the slot, and its buffer is not pending.
        let reset = unsafe { device.raw.reset_command_pool(slot.pool, vk::CommandPoolResetFlags::empty()) };
        if reset.is_ok() {
            self.slots.lock().unwrap_or_else(PoisonError::into_inner).push(slot);
        } else {
            slot.destroy(&device.raw);
        }
    }

    /// Destroys the slots, and lets go of all that is in flight. The device is idle and no command list is left.
    pub(crate) fn close(&self, device: &LogicalDevice) {
        for work in self.take_finished(device, u64::MAX) {
            work.slot.destroy(&device.raw);
        }
        let slots = std::mem::take(&mut *self.slots.lock().unwrap_or_else(PoisonError::into_inner));
        for slot in slots {
            slot.destroy(&device.raw);
        }
    }
}
