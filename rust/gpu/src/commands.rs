// SPDX-License-Identifier: Apache-2.0
//! Command lists: what the GPU is to do, in order.
//!
//! Every operation sees what all earlier ones wrote, in this list and in earlier submissions of its queue; what a
//! submission of another queue wrote is seen after [`CommandList::wait_for`]. A wrong argument is remembered and
//! returned by [`CommandList::submit`]; nothing of the list runs then. A list is recorded by one thread at a time;
//! several threads may each record and submit their own.

mod dispatch;
mod host;

use std::sync::Arc;

use ash::vk;

use crate::device::logical::LogicalDevice;
use crate::error::GpuError;
use crate::gpu::Gpu;
use crate::instance::lane::{QueueLane, TimelinePoints};
use crate::range::DeviceRange;
use crate::submission::Submission;
use crate::submit::kept::HeldResource;
use crate::submit::queue::{CommandSlot, InFlight};
use crate::submit::recorder::CommandRecorder;

/// A command list. Dropping it without [`CommandList::submit`] discards it.
#[derive(Debug)]
#[must_use = "a command list does nothing until it is submitted"]
pub struct CommandList {
    gpu: Arc<Gpu>,
    label: String,
    recorder: CommandRecorder,
    slot: Option<CommandSlot>,
    kept: Vec<HeldResource>,
    waits: TimelinePoints,
    /// The first mistake; nothing is recorded after it.
    error: Option<GpuError>,
    /// A part of it has run already.
    is_flushed: bool,
    /// Of the parts that have run.
    timings: Vec<(String, f64)>,
}

/// Most bytes that [`CommandList::update`] takes (`vkCmdUpdateBuffer`).
pub const MAX_UPDATE_BYTES: usize = 65_536;

impl Gpu {
    /// A new command list. The label is shown by debuggers, errors and crash reports.
    ///
    /// # Errors
    /// [`GpuError::DeviceLost`], or a failed call.
    pub fn commands(self: &Arc<Self>, label: &str) -> Result<CommandList, GpuError> {
        CommandList::new(self, QueueLane::Main, label)
    }

    /// A new command list that only copies, fills and updates. It runs beside other lists where
    /// [`Gpu::has_transfer_queue`], and in any case in no order with them but that of [`CommandList::wait_for`].
    ///
    /// # Errors
    /// [`GpuError::DeviceLost`], or a failed call.
    pub fn transfer_commands(self: &Arc<Self>, label: &str) -> Result<CommandList, GpuError> {
        CommandList::new(self, QueueLane::Transfer, label)
    }
}

impl CommandList {
    fn new(gpu: &Arc<Gpu>, lane: QueueLane, label: &str) -> Result<Self, GpuError> {
        let device = gpu.device();
        device.check_alive()?;
        let slot = gpu.opened().queue(lane).slot(device)?;
        match CommandRecorder::begin(device, lane, slot.buffer, label) {
            Ok(recorder) => Ok(Self {
                gpu: Arc::clone(gpu),
                label: label.to_owned(),
                recorder,
                slot: Some(slot),
                kept: Vec::new(),
                waits: TimelinePoints::START,
                error: None,
                is_flushed: false,
                timings: Vec::new(),
            }),
            Err(error) => {
                slot.destroy(&device.raw);
                Err(error)
            }
        }
    }

    /// Writes the 32-bit `value` over `bytes` at `offset`; both multiples of 4.
    pub fn fill(&mut self, target: &dyn DeviceRange, offset: u64, bytes: u64, value: u32) {
        let Some((buffer, start)) = self.place(target, offset, bytes) else {
            return;
        };
        if !(start | bytes).is_multiple_of(4) {
            return self.misuse(target.name(), format!("fill of {bytes} bytes at {offset}: not multiples of 4"));
        }
        if bytes > 0 {
            // SAFETY: the range lies in the buffer, which has TRANSFER_DST usage and is kept alive; 4-byte steps were
            // checked.
            self.operation("fill", |raw, commands| unsafe {
                raw.cmd_fill_buffer(commands, buffer, start, bytes, value);
            });
        }
    }

    /// Copies `bytes` from one range to another. Within one buffer the two must not overlap.
    pub fn copy(
        &mut self,
        source: &dyn DeviceRange,
        source_offset: u64,
        target: &dyn DeviceRange,
        target_offset: u64,
        bytes: u64,
    ) {
        let Some((from, src_offset)) = self.place(source, source_offset, bytes) else {
            return;
        };
        let Some((to, dst_offset)) = self.place(target, target_offset, bytes) else {
            return;
        };
        if from == to && src_offset.abs_diff(dst_offset) < bytes {
            return self.misuse(target.name(), format!("copy of {bytes} bytes onto itself: the ranges overlap"));
        }
        if bytes > 0 {
            let region = [vk::BufferCopy { src_offset, dst_offset, size: bytes }];
            // SAFETY: both ranges lie in their buffers, do not overlap, and are kept alive; the usages are there.
            self.operation("copy", |raw, commands| unsafe {
                raw.cmd_copy_buffer(commands, from, to, &region);
            });
        }
    }

    /// Writes `bytes` (at most [`MAX_UPDATE_BYTES`]) at `offset`; length and offset are multiples of 4. The bytes are
    /// copied now.
    pub fn update(&mut self, target: &dyn DeviceRange, offset: u64, bytes: &[u8]) {
        let Some((buffer, start)) = self.place(target, offset, bytes.len() as u64) else {
            return;
        };
        if !start.is_multiple_of(4) || !bytes.len().is_multiple_of(4) || bytes.len() > MAX_UPDATE_BYTES {
            let message = format!(
                "update of {} bytes at {offset}: multiples of 4 up to {MAX_UPDATE_BYTES} are allowed",
                bytes.len()
            );
            return self.misuse(target.name(), message);
        }
        if !bytes.is_empty() {
            // SAFETY: the range lies in the buffer, which has TRANSFER_DST usage and is kept alive; steps and size were
            // checked.
            self.operation("update", |raw, commands| unsafe {
                raw.cmd_update_buffer(commands, buffer, start, bytes);
            });
        }
    }

    /// Records what `f` records without barriers in between: those operations may overlap and must not depend on each
    /// other. What follows waits for all of them.
    pub fn concurrent(&mut self, f: impl FnOnce(&mut Self)) {
        self.recorder.enter_concurrent();
        f(self);
        self.recorder.leave_concurrent();
    }

    /// As [`CommandList::concurrent`] for all that is still to come in this list.
    pub fn all_concurrent(&mut self) {
        self.recorder.enter_concurrent();
    }

    /// Groups what `f` records under a name: a label for debuggers and, when profiling, one more timing around all of
    /// it.
    pub fn span(&mut self, name: &str, f: impl FnOnce(&mut Self)) {
        if self.error.is_some() {
            return;
        }
        match self.recorder.enter_span(name) {
            Err(error) => self.fail(error),
            Ok(begin) => {
                f(self);
                if let Err(error) = self.recorder.leave_span(name, begin) {
                    self.fail(error);
                }
            }
        }
    }

    /// Keeps `range` alive until this work is done although no operation names it: for memory that shaders reach by
    /// address.
    pub fn keep(&mut self, range: &dyn DeviceRange) {
        let parts = range.parts();
        if std::ptr::eq(parts.device, Arc::as_ptr(&self.recorder.device)) {
            self.keep_alive(parts.kept);
        } else {
            self.misuse(range.name(), "belongs to another Gpu".to_owned());
        }
    }

    /// Lets nothing of this list run before `earlier`, a submission of any queue of this device, has finished, and lets
    /// it see all that `earlier` wrote. The host does not wait. It counts for the whole list, wherever it is said;
    /// earlier submissions of the list's own queue need no word.
    pub fn wait_for(&mut self, earlier: &Submission) {
        if self.same_device(earlier.label(), Arc::as_ptr(earlier.gpu().device())) {
            self.waits.raise(earlier.lane, earlier.value);
        }
    }

    /// Switches timestamps around the operations that follow. Without timestamps on the device there are no timings.
    pub fn profile(&mut self, on: bool) {
        self.recorder.set_timing(on);
    }

    /// Hands the list to the GPU and returns at once.
    ///
    /// # Errors The first mistake made while recording ([`GpuError::Usage`]), [`GpuError::DeviceLost`], or a failed
    /// call. Nothing runs then.
    pub fn submit(self) -> Result<Submission, GpuError> {
        let opened = Arc::clone(self.gpu.opened());
        let submission = self.enqueue()?;
        opened.collect();
        Ok(submission)
    }

    /// Submits, and lets go of nothing yet.
    pub(crate) fn enqueue(mut self) -> Result<Submission, GpuError> {
        if let Some(error) = self.error.take() {
            return Err(error);
        }
        let device = Arc::clone(&self.recorder.device);
        device.check_alive()?;
        self.recorder.finish()?;
        let Some(slot) = self.slot.take() else {
            return Err(GpuError::Usage { name: self.label.clone(), message: "submitted twice".to_owned() });
        };
        let timer = self.recorder.timer.take().map(Arc::new);
        let work =
            InFlight { value: 0, slot, kept: std::mem::take(&mut self.kept), timer: timer.clone(), waits: self.waits };
        let lane = self.recorder.lane;
        let marks = std::mem::take(&mut self.recorder.marks);
        let value = self.gpu.opened().queue(lane).submit(&device, work, (self.label.clone(), marks))?;
        let timings = std::mem::take(&mut self.timings);
        Ok(Submission::new(&self.gpu, (lane, value), self.label.clone(), (timings, timer)))
    }

    /// Records one operation unless a mistake was made before.
    fn operation(&mut self, name: &str, record: impl FnOnce(&ash::Device, vk::CommandBuffer)) {
        if self.error.is_none()
            && let Err(error) = self.recorder.operation(name, record)
        {
            self.fail(error);
        }
    }

    /// Checks that `bytes` at `offset` lie in `range`, keeps it alive, and says where in which buffer they are.
    fn place(&mut self, range: &dyn DeviceRange, offset: u64, bytes: u64) -> Option<(vk::Buffer, u64)> {
        if self.error.is_some() {
            return None;
        }
        if offset.checked_add(bytes).is_none_or(|end| end > range.size()) {
            let size = range.size();
            self.misuse(range.name(), format!("{bytes} bytes at {offset} do not fit in {size} bytes"));
            return None;
        }
        let parts = range.parts();
        if !self.same_device(range.name(), parts.device) {
            return None;
        }
        self.keep_alive(parts.kept);
        Some((parts.buffer, parts.offset + offset))
    }

    fn keep_alive(&mut self, kept: HeldResource) {
        if let HeldResource::Staging(part) = &kept {
            part.used_on(self.recorder.lane);
        }
        self.kept.push(kept);
    }

    fn same_device(&mut self, name: &str, device: *const LogicalDevice) -> bool {
        let same = std::ptr::eq(device, Arc::as_ptr(&self.recorder.device));
        if !same {
            self.misuse(name, "belongs to another Gpu".to_owned());
        }
        same
    }

    fn misuse(&mut self, name: &str, message: String) {
        let message = format!("{message} (in {})", self.label);
        self.fail(GpuError::Usage { name: name.to_owned(), message });
    }

    fn fail(&mut self, error: GpuError) {
        self.error.get_or_insert(error);
    }
}

impl Drop for CommandList {
    fn drop(&mut self) {
        if let Some(slot) = self.slot.take() {
            self.gpu.opened().queue(self.recorder.lane).recycle(&self.recorder.device, slot);
        }
    }
}
