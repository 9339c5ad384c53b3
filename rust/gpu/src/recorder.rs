// SPDX-License-Identifier: Apache-2.0
//! Wraps each recorded operation: barrier before, crash marker, label, timestamps.
//!
//! Barriers are full ones between all operations (one queue, compute and transfer only, memory reached by address), except inside a
//! concurrent section, where one comes before the section and one after it. Used by one thread at a time.

use std::sync::Arc;

use ash::vk;

use crate::device::Device;
use crate::error::GpuError;
use crate::markers::Mark;
use crate::timer::Timer;

/// Stages in which operations run.
const STAGES: vk::PipelineStageFlags = vk::PipelineStageFlags::from_raw(
    vk::PipelineStageFlags::COMPUTE_SHADER.as_raw()
        | vk::PipelineStageFlags::TRANSFER.as_raw()
        | vk::PipelineStageFlags::DRAW_INDIRECT.as_raw(),
);
/// What operations write.
const WRITES: vk::AccessFlags =
    vk::AccessFlags::from_raw(vk::AccessFlags::SHADER_WRITE.as_raw() | vk::AccessFlags::TRANSFER_WRITE.as_raw());
/// What operations read.
const READS: vk::AccessFlags = vk::AccessFlags::from_raw(
    vk::AccessFlags::SHADER_READ.as_raw()
        | vk::AccessFlags::TRANSFER_READ.as_raw()
        | vk::AccessFlags::INDIRECT_COMMAND_READ.as_raw(),
);

/// A command buffer being recorded.
#[derive(Debug)]
pub(crate) struct Recorder {
    pub(crate) device: Arc<Device>,
    buffer: vk::CommandBuffer,
    /// Something before the next operation has to be waited for. True at the start: earlier submissions.
    barrier_pending: bool,
    concurrent_depth: u32,
    timing: bool,
    pub(crate) timer: Option<Timer>,
    pub(crate) marks: Vec<Mark>,
}

impl Recorder {
    /// Begins the buffer.
    pub(crate) fn begin(device: &Arc<Device>, buffer: vk::CommandBuffer, label: &str) -> Result<Self, GpuError> {
        let info = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: the buffer is new or its pool was reset, and the caller alone uses it.
        device.check("vkBeginCommandBuffer", unsafe { device.raw.begin_command_buffer(buffer, &info) })?;
        device.names.begin(buffer, label);
        Ok(Self {
            device: Arc::clone(device),
            buffer,
            barrier_pending: true,
            concurrent_depth: 0,
            timing: device.profile,
            timer: None,
            marks: Vec::new(),
        })
    }

    /// Switches timestamps for what follows; without timestamps on the device this does nothing.
    pub(crate) fn set_timing(&mut self, on: bool) {
        self.timing = on && self.device.report.capabilities.timestamps;
    }

    /// Records one operation.
    pub(crate) fn operation(
        &mut self,
        name: &str,
        record: impl FnOnce(&ash::Device, vk::CommandBuffer),
    ) -> Result<(), GpuError> {
        self.barrier(name);
        self.device.names.begin(self.buffer, name);
        let begin = self.stamp()?;
        record(&self.device.raw, self.buffer);
        let end = self.stamp()?;
        self.device.names.end(self.buffer);
        self.entry(name, begin, end);
        Ok(())
    }

    /// Starts a section without barriers inside.
    pub(crate) fn enter_concurrent(&mut self) {
        self.concurrent_depth += 1;
    }

    /// Ends it: what follows waits for all of it.
    pub(crate) fn leave_concurrent(&mut self) {
        self.concurrent_depth = self.concurrent_depth.saturating_sub(1);
        if self.concurrent_depth == 0 {
            self.barrier_pending = true;
        }
    }

    /// Starts a named span; pass what this returns to `leave_span`.
    pub(crate) fn enter_span(&mut self, name: &str) -> Result<Option<u32>, GpuError> {
        self.device.names.begin(self.buffer, name);
        self.stamp()
    }

    pub(crate) fn leave_span(&mut self, name: &str, begin: Option<u32>) -> Result<(), GpuError> {
        let end = self.stamp()?;
        self.device.names.end(self.buffer);
        self.entry(name, begin, end);
        Ok(())
    }

    /// Makes everything visible to the host and ends the buffer.
    pub(crate) fn finish(&mut self) -> Result<(), GpuError> {
        self.barrier_pending = true;
        self.barrier("end");
        let barrier =
            [vk::MemoryBarrier::default().src_access_mask(WRITES).dst_access_mask(vk::AccessFlags::HOST_READ)];
        self.pipeline_barrier(vk::PipelineStageFlags::HOST, &barrier);
        self.device.names.end(self.buffer);
        // SAFETY: the buffer is recording, all labels opened in it are closed.
        let ended = unsafe { self.device.raw.end_command_buffer(self.buffer) };
        self.device.check("vkEndCommandBuffer", ended)
    }

    /// The barrier that the next operation needs, and its crash marker.
    fn barrier(&mut self, name: &str) {
        if !self.barrier_pending {
            return;
        }
        let barrier = [vk::MemoryBarrier::default().src_access_mask(WRITES).dst_access_mask(WRITES | READS)];
        self.pipeline_barrier(STAGES, &barrier);
        if let Some(markers) = &self.device.markers {
            self.marks.push(markers.stamp(&self.device, self.buffer, name));
        }
        self.barrier_pending = self.concurrent_depth == 0;
    }

    fn pipeline_barrier(&self, to: vk::PipelineStageFlags, barrier: &[vk::MemoryBarrier<'_>]) {
        let flags = vk::DependencyFlags::empty();
        // SAFETY: the buffer is recording on a queue that computes and transfers, outside any render pass.
        unsafe { self.device.raw.cmd_pipeline_barrier(self.buffer, STAGES, to, flags, barrier, &[], &[]) };
    }

    fn stamp(&mut self) -> Result<Option<u32>, GpuError> {
        if !self.timing {
            return Ok(None);
        }
        let timer = self.timer.get_or_insert_with(|| Timer::new(&self.device));
        timer.stamp(self.buffer).map(Some)
    }

    fn entry(&mut self, name: &str, begin: Option<u32>, end: Option<u32>) {
        if let (Some(begin), Some(end), Some(timer)) = (begin, end, &mut self.timer) {
            timer.add(name.to_owned(), begin, end);
        }
    }
}
