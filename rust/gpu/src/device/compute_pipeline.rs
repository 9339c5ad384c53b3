// SPDX-License-Identifier: Apache-2.0
//! The raw parts of a compute pipeline, which command lists keep alive. Any thread.

use std::sync::Arc;

use ash::vk;

use crate::device::logical::LogicalDevice;
use crate::error::GpuError;

/// A pipeline with its layout, destroyed as soon as the last holder drops it.
#[derive(Debug)]
pub(crate) struct ComputePipeline {
    pub(crate) device: Arc<LogicalDevice>,
    pub(crate) name: String,
    pub(crate) raw: vk::Pipeline,
    pub(crate) layout: vk::PipelineLayout,
    pub(crate) push_bytes: u32,
}

impl ComputePipeline {
    /// Of a module with a compute entry point `main`; `push_bytes` is within the limits, and the cache is alive.
    pub(crate) fn new(
        (device, cache): (&Arc<LogicalDevice>, vk::PipelineCache),
        name: &str,
        module: vk::ShaderModule,
        spec: &[(u32, u32)],
        push_bytes: u32,
    ) -> Result<Self, GpuError> {
        let range = [vk::PushConstantRange::default().stage_flags(vk::ShaderStageFlags::COMPUTE).size(push_bytes)];
        let ranges = if push_bytes == 0 { &[][..] } else { &range[..] };
        let info = vk::PipelineLayoutCreateInfo::default().push_constant_ranges(ranges);
        // SAFETY: the range is within the limit and not empty.
        let layout = unsafe { device.raw.create_pipeline_layout(&info, None) };
        let layout = device.check("vkCreatePipelineLayout", layout)?;
        // From here on Drop cleans up; destroying a null pipeline is allowed.
        let mut made =
            Self { device: Arc::clone(device), name: name.to_owned(), raw: vk::Pipeline::null(), layout, push_bytes };
        let entries: Vec<_> = (0_u32..)
            .zip(spec)
            .map(|(i, &(id, _))| vk::SpecializationMapEntry { constant_id: id, offset: i * 4, size: 4 })
            .collect();
        let values: Vec<u8> = spec.iter().flat_map(|(_, value)| value.to_ne_bytes()).collect();
        let specialization = vk::SpecializationInfo::default().map_entries(&entries).data(&values);
        let stage = vk::PipelineShaderStageCreateInfo::default()
            .stage(vk::ShaderStageFlags::COMPUTE)
            .module(module)
            .name(c"main")
            .specialization_info(&specialization);
        let info = [vk::ComputePipelineCreateInfo::default().stage(stage).layout(layout)];
        // SAFETY: module, layout and cache are alive and of this device; the cache synchronises itself (it was not made
        // with EXTERNALLY_SYNCHRONIZED).
        match unsafe { device.raw.create_compute_pipelines(cache, &info, None) } {
            Ok(pipelines) => made.raw = pipelines.first().copied().unwrap_or_default(),
            Err((_, code)) => return device.check("vkCreateComputePipelines", Err(code)),
        }
        device.names.set(made.raw, name);
        device.names.set(layout, name);
        Ok(made)
    }
}

impl Drop for ComputePipeline {
    fn drop(&mut self) {
        // SAFETY: command lists in flight hold an Arc of this, so no submission uses it. Null is allowed.
        unsafe { self.device.raw.destroy_pipeline(self.raw, None) };
        // SAFETY: as above.
        unsafe { self.device.raw.destroy_pipeline_layout(self.layout, None) };
    }
}
