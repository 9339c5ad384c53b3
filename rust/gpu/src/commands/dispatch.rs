// SPDX-License-Identifier: Apache-2.0
//! Dispatches in a command list.

use std::sync::Arc;

use ash::vk;

use super::CommandList;
use crate::instance::lane::QueueLane;
use crate::pipeline::Pipeline;
use crate::range::DeviceRange;
use crate::submit::kept::HeldResource;

impl CommandList {
    /// Runs `groups` workgroups. `push` has exactly the size that the pipeline was made with. No groups = no operation.
    pub fn dispatch(&mut self, pipeline: &Pipeline, push: &[u8], groups: [u32; 3]) {
        let limit = self.recorder.device.limits.max_workgroups;
        if groups.iter().zip(limit).any(|(&n, most)| n > most) {
            return self.misuse(pipeline.name(), format!("{groups:?} workgroups: {limit:?} are allowed"));
        }
        if !groups.contains(&0) && self.use_pipeline(pipeline, push) {
            let bind = PipelineBinding::new(pipeline, push);
            self.operation(pipeline.name(), |raw, commands| {
                bind.record(raw, commands);
                // SAFETY: a compute pipeline is bound, its push constants are set, and the counts are within the
                // limits.
                unsafe { raw.cmd_dispatch(commands, groups[0], groups[1], groups[2]) };
            });
        }
    }

    /// Dispatches `pipeline` without a workgroup, which does nothing, but for drivers that translate a shader when it
    /// is first dispatched (Mesa's software renderer): they do it in this list.
    pub fn dispatch_nothing(&mut self, pipeline: &Pipeline) {
        let push = vec![0; pipeline.push_bytes() as usize];
        if self.use_pipeline(pipeline, &push) {
            let bind = PipelineBinding::new(pipeline, &push);
            self.operation(pipeline.name(), |raw, commands| {
                bind.record(raw, commands);
                // SAFETY: a compute pipeline is bound and its push constants are set; no invocation reads them.
                unsafe { raw.cmd_dispatch(commands, 0, 0, 0) };
            });
        }
    }

    /// As [`CommandList::dispatch`], with the three counts read by the GPU from `arguments` at `offset` (a multiple of
    /// 4). The counts must be within the device's limits: nobody checks them.
    pub fn dispatch_indirect(&mut self, pipeline: &Pipeline, push: &[u8], arguments: &dyn DeviceRange, offset: u64) {
        let size = size_of::<vk::DispatchIndirectCommand>() as u64;
        let Some((buffer, start)) = self.place(arguments, offset, size) else {
            return;
        };
        if !start.is_multiple_of(4) {
            return self.misuse(arguments.name(), format!("dispatch arguments at {offset}: not a multiple of 4"));
        }
        if self.use_pipeline(pipeline, push) {
            let bind = PipelineBinding::new(pipeline, push);
            self.operation(pipeline.name(), |raw, commands| {
                bind.record(raw, commands);
                // SAFETY: a compute pipeline is bound, its push constants are set; the arguments lie in a buffer with
                // INDIRECT_BUFFER usage that is kept alive.
                unsafe { raw.cmd_dispatch_indirect(commands, buffer, start) };
            });
        }
    }

    /// Checks a pipeline and its push constants, and keeps it alive.
    fn use_pipeline(&mut self, pipeline: &Pipeline, push: &[u8]) -> bool {
        let inner = &pipeline.inner;
        if self.error.is_some() || !self.same_device(&inner.name, Arc::as_ptr(&inner.device)) {
            return false;
        }
        if self.recorder.lane == QueueLane::Transfer {
            self.misuse(&inner.name, "a dispatch in a transfer list".to_owned());
            return false;
        }
        if push.len() != inner.push_bytes as usize {
            let message = format!("{} bytes of push constants, {} expected", push.len(), inner.push_bytes);
            self.misuse(&inner.name, message);
            return false;
        }
        self.kept.push(HeldResource::Pipeline(Arc::clone(inner)));
        true
    }
}

/// A pipeline with its push constants, to be recorded.
struct PipelineBinding<'a> {
    pipeline: vk::Pipeline,
    layout: vk::PipelineLayout,
    push: &'a [u8],
}

impl<'a> PipelineBinding<'a> {
    fn new(pipeline: &Pipeline, push: &'a [u8]) -> Self {
        Self { pipeline: pipeline.inner.raw, layout: pipeline.inner.layout, push }
    }

    fn record(&self, raw: &ash::Device, commands: vk::CommandBuffer) {
        // SAFETY: the pipeline is of this device and is kept alive by the command list.
        unsafe { raw.cmd_bind_pipeline(commands, vk::PipelineBindPoint::COMPUTE, self.pipeline) };
        if !self.push.is_empty() {
            let stage = vk::ShaderStageFlags::COMPUTE;
            // SAFETY: the layout's range for this stage has exactly this size, a multiple of 4.
            unsafe { raw.cmd_push_constants(commands, self.layout, stage, 0, self.push) };
        }
    }
}
