// SPDX-License-Identifier: Apache-2.0
//! The arrays and queues that paths live in, in core and streaming alike: one entry for each path in flight.

use crate::assets::MAX_LEVELS;
use oocpt_core::inventory::Inventory;
use oocpt_gpu::{Buffer, Gpu, GpuError, Usage};
use oocpt_shader_abi::{Counters, Frame, LIGHT_PATH_BYTES, PathState, Ray, ShadowRay, hit_stride};
use std::sync::Arc;

/// Bytes of a ray's cone.
pub(crate) const CONE_BYTES: u64 = 8;
/// Of so many paths one can keep the candidate that its ray depends on, and one that of its shadow ray; others are
/// walked again.
const PATHS_TO_KEPT: u32 = 8;

/// What only some scenes ask of paths.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct PathNeeds {
    /// Ray cones: something reads a texture.
    pub(crate) textures: bool,
    /// What lights ask of the surface that a ray left.
    pub(crate) light_paths: bool,
    /// A flag per path that lacks a texture tile: in core, tiles are loaded on demand.
    pub(crate) feedback: bool,
    /// Queues of the rays that depend on cutouts that no mask knows.
    pub(crate) deferred_cutouts: bool,
}

/// What cutouts need that no mask knows: for rays, then as much for shadow rays.
#[derive(Debug)]
struct Settle {
    queue: Buffer,
    hits: Buffer,
}

impl Settle {
    fn new(gpu: &Arc<Gpu>, capacity: u32, max_levels: u32) -> Result<Self, GpuError> {
        let [queue, hits] = Self::bytes(capacity, max_levels);
        Ok(Self {
            queue: Buffer::new(gpu, "settle_queue", queue, Usage::Device)?,
            hits: Buffer::new(gpu, "settle_hits", hits, Usage::Device)?,
        })
    }

    fn bytes(capacity: u32, max_levels: u32) -> [u64; 2] {
        let kept = u64::from(capacity.div_ceil(PATHS_TO_KEPT)) * u64::from(hit_stride(max_levels));
        [8 * u64::from(capacity), 2 * kept]
    }

    /// Lists it, or what is left out without it.
    fn list(settle: Option<&Self>, (capacity, max_levels): (u32, u32), inventory: &mut Inventory) {
        let names = ["settle_queue", "settle_hits"];
        for (name, bytes) in names.into_iter().zip(Self::bytes(capacity, max_levels)) {
            match settle {
                Some(_) => inventory.add(name, bytes),
                None => inventory.leave_out(name, bytes),
            }
        }
    }
}

/// See the module.
#[derive(Debug)]
pub(crate) struct PathBuffers {
    pub(crate) capacity: u32,
    /// Paths that were asked for; there may have been no memory for so many.
    pub(crate) asked: u64,
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
    /// Only when something reads a texture.
    cones: Option<Buffer>,
    /// Only where lights ask for it.
    light_paths: Option<Buffer>,
    /// Only where these have passes of their own; of rays, then of shadow rays.
    settle: Option<Settle>,
    /// Only where texture tiles are loaded on demand.
    pub(crate) incomplete_paths: Option<Buffer>,
    /// One `Counters`; also the arguments of the indirect dispatches.
    pub(crate) counters: Buffer,
}

impl PathBuffers {
    /// Memory for `capacity` paths; `needs`: and for what not all scenes need.
    pub(crate) fn new(gpu: &Arc<Gpu>, capacity: u32, max_levels: u32, needs: PathNeeds) -> Result<Self, GpuError> {
        let per_path = |name: &str, stride: u64| Buffer::new(gpu, name, u64::from(capacity) * stride, Usage::Device);
        Ok(Self {
            capacity,
            asked: u64::from(capacity),
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
            cones: needs.textures.then(|| per_path("cones", CONE_BYTES)).transpose()?,
            light_paths: needs.light_paths.then(|| per_path("light_paths", LIGHT_PATH_BYTES)).transpose()?,
            settle: needs.deferred_cutouts.then(|| Settle::new(gpu, capacity, max_levels)).transpose()?,
            incomplete_paths: needs.feedback.then(|| per_path("incomplete_paths", 4)).transpose()?,
            counters: Buffer::new(gpu, "counters", size_of::<Counters>() as u64, Usage::Device)?,
        })
    }

    /// Lists the memory there is, and what is left out of it.
    pub(crate) fn list(&self, inventory: &mut Inventory) {
        let Self { rays, shadow_rays, hits, paths, radiance, ray_queue, .. } = self;
        let capacity = u64::from(self.capacity);
        inventory.paths = capacity;
        let always = [rays, shadow_rays, hits, paths, radiance, &ray_queue[0], &ray_queue[1]];
        let queues = [&self.shadow_queue, &self.surface_queue, &self.escaped_queue, &self.counters];
        for buffer in always.into_iter().chain(queues) {
            inventory.add(buffer.name(), buffer.size());
        }
        let deepest = u64::from(hit_stride(MAX_LEVELS)).saturating_sub(u64::from(hit_stride(self.max_levels)));
        inventory.leave_out("hits", deepest * capacity);
        let optional = [
            ("cones", &self.cones, CONE_BYTES),
            ("light_paths", &self.light_paths, LIGHT_PATH_BYTES),
            ("incomplete_paths", &self.incomplete_paths, 4),
        ];
        Settle::list(self.settle.as_ref(), (self.capacity, self.max_levels), inventory);
        for (name, buffer, stride) in optional {
            match buffer {
                Some(buffer) => inventory.add(name, buffer.size()),
                None => inventory.leave_out(name, stride * capacity),
            }
        }
    }

    /// Whether this memory is what scenes of `levels` instance levels need, and no more.
    pub(crate) fn serves(&self, levels: u32, needs: PathNeeds) -> bool {
        let have = PathNeeds {
            textures: self.cones.is_some(),
            light_paths: self.light_paths.is_some(),
            feedback: self.incomplete_paths.is_some(),
            deferred_cutouts: self.settle.is_some(),
        };
        self.max_levels == levels && have == needs
    }

    /// What the trace passes write.
    pub(crate) fn written(&self) -> Vec<&Buffer> {
        let Self { rays, shadow_rays, hits, radiance, surface_queue, escaped_queue, counters, .. } = self;
        vec![rays, shadow_rays, hits, radiance, surface_queue, escaped_queue, counters]
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
        if let Some(Settle { queue, hits }) = &self.settle {
            let halves = |of: &Buffer| [0, of.size() / 2].map(|at| of.address() + at);
            (frame.settle_queue, frame.settle_hits) = (halves(queue), halves(hits));
        }
        frame.cones = self.cones.as_ref().map_or(0, Buffer::address);
        frame.light_paths = self.light_paths.as_ref().map_or(0, Buffer::address);
        frame.counters = self.counters.address();
    }
}
