// SPDX-License-Identifier: Apache-2.0
//! Wraps each recorded operation: barrier before, crash marker, label, timestamps.
//!
//! Barriers are full ones between all operations of a lane (compute and transfer only, memory reached by address),
//! except inside a concurrent section, where one comes before the section and one after it. Used by one thread at a
//! time.

use std::sync::Arc;

use ash::vk;

use crate::device::logical::LogicalDevice;
use crate::device::markers::OperationMark;
use crate::error::GpuError;
use crate::instance::lane::QueueLane;
use crate::submit::timer::QueryTimer;

/// Stages in which operations run, and what they write and read there.
#[derive(Clone, Copy, Debug)]
struct SyncScope {
    stages: vk::PipelineStageFlags,
    writes: vk::AccessFlags,
    reads: vk::AccessFlags,
}

impl SyncScope {
    /// A family without compute knows the transfer stage only (VUID-vkCmdPipelineBarrier-srcStageMask-06461).
    fn of(computes: bool) -> Self {
        let (mut stages, mut writes, mut reads) =
            (vk::PipelineStageFlags::TRANSFER, vk::AccessFlags::TRANSFER_WRITE, vk::AccessFlags::TRANSFER_READ);
        if computes {
            stages |= vk::PipelineStageFlags::COMPUTE_SHADER | vk::PipelineStageFlags::DRAW_INDIRECT;
            writes |= vk::AccessFlags::SHADER_WRITE;
            reads |= vk::AccessFlags::SHADER_READ | vk::AccessFlags::INDIRECT_COMMAND_READ;
        }
        Self { stages, writes, reads }
    }
}

/// A command buffer being recorded.
#[derive(Debug)]
pub(crate) struct CommandRecorder {
    pub(crate) device: Arc<LogicalDevice>,
    pub(crate) lane: QueueLane,
    buffer: vk::CommandBuffer,
    scope: SyncScope,
    /// Something before the next operation has to be waited for. True at the start: earlier submissions.
    barrier_pending: bool,
    concurrent_depth: u32,
    has_operations: bool,
    timing: bool,
    pub(crate) timer: Option<QueryTimer>,
    pub(crate) marks: Vec<OperationMark>,
}

impl CommandRecorder {
    /// Begins the buffer, which is one of the lane's.
    pub(crate) fn begin(
        device: &Arc<LogicalDevice>,
        lane: QueueLane,
        buffer: vk::CommandBuffer,
        label: &str,
    ) -> Result<Self, GpuError> {
        let info = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: the buffer is new or its pool was reset, and the caller alone uses it.
        device.check("vkBeginCommandBuffer", unsafe { device.raw.begin_command_buffer(buffer, &info) })?;
        let mut recorder = Self {
            device: Arc::clone(device),
            lane,
            buffer,
            scope: SyncScope::of(device.choice(lane).computes),
            barrier_pending: true,
            concurrent_depth: 0,
            has_operations: false,
            timing: false,
            timer: None,
            marks: Vec::new(),
        };
        recorder.set_timing(device.profile);
        recorder.begin_label(label);
        Ok(recorder)
    }

    /// Debug labels were long allowed on computing queues only (VUID-vkCmdBeginDebugUtilsLabelEXT-commandBuffer-cmdpool
    /// of 1.3).
    fn begin_label(&self, name: &str) {
        if self.device.choice(self.lane).computes {
            self.device.names.begin(self.buffer, name);
        }
    }

    fn end_label(&self) {
        if self.device.choice(self.lane).computes {
            self.device.names.end(self.buffer);
        }
    }

    /// Switches timestamps for what follows; without timestamps on the queue this does nothing.
    pub(crate) fn set_timing(&mut self, on: bool) {
        let bits = self.device.choice(self.lane).timestamp_bits;
        self.timing = on && bits > 0 && self.device.report.capabilities.timestamps;
    }

    pub(crate) fn is_timing(&self) -> bool {
        self.timing
    }

    /// Whether anything is recorded.
    pub(crate) fn has_operations(&self) -> bool {
        self.has_operations
    }

    /// Records one operation.
    pub(crate) fn operation(
        &mut self,
        name: &str,
        record: impl FnOnce(&ash::Device, vk::CommandBuffer),
    ) -> Result<(), GpuError> {
        self.has_operations = true;
        self.barrier(name);
        self.begin_label(name);
        let begin = self.stamp()?;
        record(&self.device.raw, self.buffer);
        let end = self.stamp()?;
        self.end_label();
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
        self.begin_label(name);
        self.stamp()
    }

    pub(crate) fn leave_span(&mut self, name: &str, begin: Option<u32>) -> Result<(), GpuError> {
        let end = self.stamp()?;
        self.end_label();
        self.entry(name, begin, end);
        Ok(())
    }

    /// Makes everything visible to the host and ends the buffer.
    pub(crate) fn finish(&mut self) -> Result<(), GpuError> {
        self.barrier_pending = true;
        self.barrier("end");
        let barrier = [vk::MemoryBarrier::default()
            .src_access_mask(self.scope.writes)
            .dst_access_mask(vk::AccessFlags::HOST_READ)];
        self.pipeline_barrier(vk::PipelineStageFlags::HOST, &barrier);
        self.end_label();
        // SAFETY: the buffer is recording, all labels opened in it are closed.
        let ended = unsafe { self.device.raw.end_command_buffer(self.buffer) };
        self.device.check("vkEndCommandBuffer", ended)
    }

    /// The barrier that the next operation needs, and its crash marker.
    fn barrier(&mut self, name: &str) {
        if !self.barrier_pending {
            return;
        }
        let SyncScope { stages, writes, reads } = self.scope;
        let barrier = [vk::MemoryBarrier::default().src_access_mask(writes).dst_access_mask(writes | reads)];
        self.pipeline_barrier(stages, &barrier);
        if let Some(markers) = &self.device.markers {
            self.marks.push(markers.stamp(&self.device.raw, self.lane, self.buffer, name));
        }
        self.barrier_pending = self.concurrent_depth == 0;
    }

    fn pipeline_barrier(&self, to: vk::PipelineStageFlags, barrier: &[vk::MemoryBarrier<'_>]) {
        let flags = vk::DependencyFlags::empty();
        let from = self.scope.stages;
        // SAFETY: the buffer is recording for a family that has these stages, outside any render pass.
        unsafe { self.device.raw.cmd_pipeline_barrier(self.buffer, from, to, flags, barrier, &[], &[]) };
    }

    fn stamp(&mut self) -> Result<Option<u32>, GpuError> {
        if !self.timing {
            return Ok(None);
        }
        let bits = self.device.choice(self.lane).timestamp_bits;
        let timer = self.timer.get_or_insert_with(|| QueryTimer::new(&self.device, bits));
        timer.stamp(self.buffer).map(Some)
    }

    fn entry(&mut self, name: &str, begin: Option<u32>, end: Option<u32>) {
        if let (Some(begin), Some(end), Some(timer)) = (begin, end, &mut self.timer) {
            timer.add(name.to_owned(), begin, end);
        }
    }
}
