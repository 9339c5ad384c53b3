// SPDX-License-Identifier: Apache-2.0
//! The memory of a wave: path state and queues, sized for the largest wave.

use oocpt_gpu::{Buffer, Gpu, GpuError, Usage};
use oocpt_shader_abi::{Counters, Frame, PathState, Ray, ShadowRay, hit_stride};
use std::sync::Arc;

/// Bytes of device memory that one path of a wave takes.
pub(crate) fn path_bytes(max_levels: u32) -> u64 {
    let radiance = 16;
    let queues = 5 * size_of::<u32>();
    let state = size_of::<Ray>() + size_of::<PathState>() + size_of::<ShadowRay>() + radiance + queues;
    state as u64 + u64::from(hit_stride(max_levels))
}

/// Path state and queues.
#[derive(Debug)]
pub(crate) struct WaveBuffers {
    pub(crate) capacity: u32,
    pub(crate) max_levels: u32,
    rays: Buffer,
    shadow_rays: Buffer,
    hits: Buffer,
    paths: Buffer,
    radiance: Buffer,
    ray_queue: [Buffer; 2],
    shadow_queue: Buffer,
    surface_queue: Buffer,
    escaped_queue: Buffer,
    /// One `Counters`; also the arguments of the indirect dispatches.
    pub(crate) counters: Buffer,
}

impl WaveBuffers {
    /// Memory for waves of up to `capacity` paths.
    pub(crate) fn new(gpu: &Arc<Gpu>, capacity: u32, max_levels: u32) -> Result<Self, GpuError> {
        let per_path = |name: &str, stride: u64| Buffer::new(gpu, name, u64::from(capacity) * stride, Usage::Device);
        Ok(Self {
            capacity,
            max_levels,
            rays: per_path("rays", size_of::<Ray>() as u64)?,
            shadow_rays: per_path("shadow_rays", size_of::<ShadowRay>() as u64)?,
            hits: per_path("hits", u64::from(hit_stride(max_levels)))?,
            paths: per_path("paths", size_of::<PathState>() as u64)?,
            radiance: per_path("radiance", 16)?,
            ray_queue: [per_path("ray_queue 0", 4)?, per_path("ray_queue 1", 4)?],
            shadow_queue: per_path("shadow_queue", 4)?,
            surface_queue: per_path("surface_queue", 4)?,
            escaped_queue: per_path("escaped_queue", 4)?,
            counters: Buffer::new(gpu, "counters", size_of::<Counters>() as u64, Usage::Device)?,
        })
    }

    /// Writes the addresses into a frame block.
    pub(crate) fn bind(&self, frame: &mut Frame) {
        frame.rays = self.rays.address();
        frame.shadow_rays = self.shadow_rays.address();
        frame.hits = self.hits.address();
        frame.paths = self.paths.address();
        frame.radiance = self.radiance.address();
        frame.ray_queue = [self.ray_queue[0].address(), self.ray_queue[1].address()];
        frame.shadow_queue = self.shadow_queue.address();
        frame.surface_queue = self.surface_queue.address();
        frame.escaped_queue = self.escaped_queue.address();
        frame.counters = self.counters.address();
    }
}
