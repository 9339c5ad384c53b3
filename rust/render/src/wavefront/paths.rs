// SPDX-License-Identifier: Apache-2.0
//! The arrays and queues of paths, in core and streaming alike: one entry for each path in flight.
//!
//! [`PathArray`] lists them: allocation, the estimate of memory and the inventory are derived from it.

use oocpt_abi::{
    FrameConstants, GpuPathStates, LIGHT_PATH_BYTES, MAX_LEVELS, PathState, Ray, ShadowRay, WavefrontCounters,
    hit_stride,
};
use oocpt_core::inventory::RenderInventory;
use oocpt_gpu::{Buffer, BufferUsage, Gpu, GpuError};
use std::sync::Arc;

/// Bytes of a ray's cone.
const CONE_BYTES: u64 = 8;
/// One in so many paths can keep the candidate that its ray depends on, and one that of its shadow ray; others are
/// walked again.
const PATHS_TO_KEPT: u32 = 8;

/// The memory of paths that only some scenes need.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct PathNeeds {
    /// Shadow rays: some light needs them.
    pub(crate) shadows: bool,
    /// Ray cones: something reads a texture.
    pub(crate) textures: bool,
    /// The data of the surface that a ray left, for lights.
    pub(crate) light_paths: bool,
    /// A flag per path that lacks a texture tile: in core, tiles are loaded on demand.
    pub(crate) feedback: bool,
    /// Queues of the rays that depend on cutouts that no mask decides.
    pub(crate) deferred_cutouts: bool,
    /// Counts of bounces by kind: some kind has a limit of its own.
    pub(crate) bounce_kinds: bool,
    /// Values that a sample has for filtered images, in core: while streaming they are in the segments.
    pub(crate) plane_words: u32,
    /// Values of light path expressions and shadows, while streaming: in core they are among those of filtered images.
    pub(crate) light_words: u32,
    /// States of paths, and of shadow rays, in the automaton of light path expressions.
    pub(crate) path_states: bool,
}

impl PathNeeds {
    /// Bytes of device memory for `capacity` paths of scenes of so many instance levels, with one set of counters.
    pub(crate) fn bytes(self, capacity: u32, max_levels: u32) -> u64 {
        let arrays = PathArray::ALL.into_iter().filter(|array| array.is_needed(self));
        arrays.map(|array| array.bytes(capacity, max_levels, self)).sum()
    }

    /// Bytes of device memory that each of many paths takes.
    pub(crate) fn bytes_a_path(self, max_levels: u32) -> u64 {
        self.bytes(PATHS_TO_KEPT, max_levels).div_ceil(u64::from(PATHS_TO_KEPT))
    }
}

/// An array by path, or a queue that has room for all paths.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum PathArray {
    Rays,
    ShadowRays,
    Hits,
    Paths,
    Radiance,
    RayQueue0,
    RayQueue1,
    ShadowQueue,
    SurfaceQueue,
    EscapedQueue,
    Cones,
    LightPaths,
    IncompletePaths,
    /// The queue of rays with undecided cutouts: for rays, then as much for shadow rays.
    SettleQueue,
    /// The candidates of these rays.
    SettleHits,
    BounceKinds,
    PlaneValues,
    LightValues,
    PathStates,
    ShadowStates,
}

impl PathArray {
    const ALL: [Self; 20] = [
        Self::Rays,
        Self::ShadowRays,
        Self::Hits,
        Self::Paths,
        Self::Radiance,
        Self::RayQueue0,
        Self::RayQueue1,
        Self::ShadowQueue,
        Self::SurfaceQueue,
        Self::EscapedQueue,
        Self::Cones,
        Self::LightPaths,
        Self::IncompletePaths,
        Self::SettleQueue,
        Self::SettleHits,
        Self::BounceKinds,
        Self::PlaneValues,
        Self::LightValues,
        Self::PathStates,
        Self::ShadowStates,
    ];

    fn name(self) -> &'static str {
        match self {
            Self::Rays => "rays",
            Self::ShadowRays => "shadow_rays",
            Self::Hits => "hits",
            Self::Paths => "paths",
            Self::Radiance => "radiance",
            Self::RayQueue0 => "ray_queue 0",
            Self::RayQueue1 => "ray_queue 1",
            Self::ShadowQueue => "shadow_queue",
            Self::SurfaceQueue => "surface_queue",
            Self::EscapedQueue => "escaped_queue",
            Self::Cones => "cones",
            Self::LightPaths => "light_paths",
            Self::IncompletePaths => "incomplete_paths",
            Self::SettleQueue => "settle_queue",
            Self::SettleHits => "settle_hits",
            Self::BounceKinds => "bounce_kinds",
            Self::PlaneValues => "plane_values",
            Self::LightValues => "light_values",
            Self::PathStates => "path_states",
            Self::ShadowStates => "shadow_states",
        }
    }

    fn bytes(self, capacity: u32, max_levels: u32, needs: PathNeeds) -> u64 {
        let hit = u64::from(hit_stride(max_levels));
        let stride = match self {
            Self::Rays => size_of::<Ray>() as u64,
            Self::ShadowRays => size_of::<ShadowRay>() as u64,
            Self::Hits => hit,
            Self::Paths => size_of::<PathState>() as u64,
            Self::Radiance => 16,
            Self::Cones => CONE_BYTES,
            Self::LightPaths => LIGHT_PATH_BYTES,
            Self::SettleQueue => 8,
            Self::PlaneValues => 4 * u64::from(needs.plane_words),
            Self::LightValues => 4 * u64::from(needs.light_words),
            Self::PathStates | Self::ShadowStates => size_of::<GpuPathStates>() as u64,
            Self::SettleHits => return 2 * hit * u64::from(capacity.div_ceil(PATHS_TO_KEPT)),
            Self::RayQueue0
            | Self::RayQueue1
            | Self::ShadowQueue
            | Self::SurfaceQueue
            | Self::EscapedQueue
            | Self::IncompletePaths
            | Self::BounceKinds => 4,
        };
        stride * u64::from(capacity)
    }

    fn is_needed(self, needs: PathNeeds) -> bool {
        match self {
            Self::ShadowRays | Self::ShadowQueue => needs.shadows,
            Self::Cones => needs.textures,
            Self::LightPaths => needs.light_paths,
            Self::IncompletePaths => needs.feedback,
            Self::SettleQueue | Self::SettleHits => needs.deferred_cutouts,
            Self::BounceKinds => needs.bounce_kinds,
            Self::PlaneValues => needs.plane_words > 0,
            Self::LightValues => needs.light_words > 0,
            Self::PathStates => needs.path_states,
            Self::ShadowStates => needs.path_states && needs.shadows,
            Self::Rays
            | Self::Hits
            | Self::Paths
            | Self::Radiance
            | Self::RayQueue0
            | Self::RayQueue1
            | Self::SurfaceQueue
            | Self::EscapedQueue => true,
        }
    }
}

/// The arrays and queues of all paths in flight.
#[derive(Debug)]
pub(crate) struct PathBuffers {
    pub(crate) capacity: u32,
    /// The requested number of paths; memory may have allowed fewer.
    pub(crate) asked: u64,
    pub(crate) max_levels: u32,
    needs: PathNeeds,
    /// Buffers by number of [`PathArray`]; `None` if the scene does not need it.
    arrays: [Option<Buffer>; PathArray::ALL.len()],
    /// One `WavefrontCounters`; also the arguments of the indirect dispatches.
    pub(crate) counters: Buffer,
}

impl PathBuffers {
    /// Allocates memory for `capacity` paths; `needs` names the optional parts.
    pub(crate) fn new(gpu: &Arc<Gpu>, capacity: u32, max_levels: u32, needs: PathNeeds) -> Result<Self, GpuError> {
        let mut arrays = [const { None }; PathArray::ALL.len()];
        for array in PathArray::ALL.into_iter().filter(|array| array.is_needed(needs)) {
            let bytes = array.bytes(capacity, max_levels, needs);
            arrays[array as usize] = Some(Buffer::new(gpu, array.name(), bytes, BufferUsage::Device)?);
        }
        let counters = Buffer::new(gpu, "counters", size_of::<WavefrontCounters>() as u64, BufferUsage::Device)?;
        Ok(Self { capacity, asked: u64::from(capacity), max_levels, needs, arrays, counters })
    }

    fn get(&self, array: PathArray) -> Option<&Buffer> {
        self.arrays[array as usize].as_ref()
    }

    /// Flags of paths that lack a tile, if texture tiles are loaded on demand.
    pub(crate) fn incomplete_paths(&self) -> Option<&Buffer> {
        self.get(PathArray::IncompletePaths)
    }

    /// Lists the buffers, and those that are left out.
    pub(crate) fn list(&self, inventory: &mut RenderInventory) {
        let capacity = u64::from(self.capacity);
        inventory.paths = capacity;
        for array in PathArray::ALL {
            match self.get(array) {
                Some(buffer) => inventory.add(buffer.name(), buffer.size()),
                None => inventory.leave_out(array.name(), array.bytes(self.capacity, self.max_levels, self.needs)),
            }
        }
        inventory.add(self.counters.name(), self.counters.size());
        let deepest = u64::from(hit_stride(MAX_LEVELS)).saturating_sub(u64::from(hit_stride(self.max_levels)));
        inventory.leave_out("hits", deepest * capacity);
    }

    /// Returns true if this memory is what scenes of `levels` instance levels need, and no more.
    pub(crate) fn serves(&self, levels: u32, needs: PathNeeds) -> bool {
        self.max_levels == levels && self.needs == needs
    }

    /// The buffers that the trace passes write.
    pub(crate) fn written(&self) -> Vec<&Buffer> {
        let arrays = [
            PathArray::Rays,
            PathArray::ShadowRays,
            PathArray::Hits,
            PathArray::Radiance,
            PathArray::SurfaceQueue,
            PathArray::EscapedQueue,
            PathArray::PlaneValues,
            PathArray::LightValues,
        ];
        arrays.into_iter().filter_map(|array| self.get(array)).chain([&self.counters]).collect()
    }

    /// Writes the addresses into a frame block; 0 for absent buffers, which no pass reads.
    pub(crate) fn bind(&self, frame: &mut FrameConstants) {
        let at = |array: PathArray| self.get(array).map_or(0, Buffer::address);
        frame.rays = at(PathArray::Rays);
        frame.shadow_rays = at(PathArray::ShadowRays);
        frame.hits = at(PathArray::Hits);
        frame.paths = at(PathArray::Paths);
        frame.radiance = at(PathArray::Radiance);
        frame.ray_queue = [at(PathArray::RayQueue0), at(PathArray::RayQueue1)];
        frame.shadow_queue = at(PathArray::ShadowQueue);
        frame.surface_queue = at(PathArray::SurfaceQueue);
        frame.escaped_queue = at(PathArray::EscapedQueue);
        if let (Some(queue), Some(hits)) = (self.get(PathArray::SettleQueue), self.get(PathArray::SettleHits)) {
            let halves = |of: &Buffer| [0, of.size() / 2].map(|at| of.address() + at);
            (frame.settle_queue, frame.settle_hits) = (halves(queue), halves(hits));
        }
        frame.cones = at(PathArray::Cones);
        frame.light_paths = at(PathArray::LightPaths);
        frame.bounce_kinds = at(PathArray::BounceKinds);
        frame.plane_values = at(PathArray::PlaneValues);
        frame.path_states = at(PathArray::PathStates);
        frame.shadow_states = at(PathArray::ShadowStates);
        let words = frame.light_words;
        (frame.light_values, frame.light_stride) = match self.get(PathArray::LightValues) {
            Some(values) => (values.address(), words),
            // The last ones of each path.
            None => (frame.plane_values + 4 * u64::from(frame.sum_words.saturating_sub(words)), frame.plane_words),
        };
        frame.counters = self.counters.address();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use oocpt_gpu::OpenOptions;

    #[test]
    fn arrays_are_numbered_in_their_order() {
        assert!(PathArray::ALL.iter().enumerate().all(|(at, array)| *array as usize == at), "{:?}", PathArray::ALL);
    }

    #[test]
    fn path_buffers_have_the_estimated_size() {
        let selector = std::env::var("OOCPT_TEST_DEVICE").ok();
        let gpu = Gpu::open(&OpenOptions { selector, ..OpenOptions::default() }).expect("a device");
        for bits in 0..64_u32 {
            let [shadows, textures, light_paths, feedback, deferred_cutouts, bounce_kinds] =
                [0, 1, 2, 3, 4, 5].map(|bit| bits >> bit & 1 == 1);
            let (plane_words, light_words, path_states) = (bits % 5 * 3, bits % 7 * 3, bits % 3 == 0);
            let needs = PathNeeds {
                shadows,
                textures,
                light_paths,
                feedback,
                deferred_cutouts,
                bounce_kinds,
                plane_words,
                light_words,
                path_states,
            };
            for (capacity, levels) in [(1 << 12, 1), (5000, 2)] {
                let made = PathBuffers::new(&gpu, capacity, levels, needs).expect("memory");
                let bytes: u64 = made.arrays.iter().flatten().map(Buffer::size).sum();
                assert_eq!(bytes, needs.bytes(capacity, levels), "{needs:?}, {capacity} paths, {levels} levels");
                assert_eq!(bytes, needs.bytes_a_path(levels) * u64::from(capacity), "{needs:?}: the same each");
                let mut listed = RenderInventory::default();
                made.list(&mut listed);
                let listed: u64 = listed.buffers.iter().map(|buffer| buffer.bytes).sum();
                assert_eq!(listed, bytes + made.counters.size(), "{needs:?}: as it is listed");
            }
        }
    }

    #[test]
    fn without_shadow_rays_no_shadow_buffers_are_allocated() {
        let without = PathNeeds::default();
        let with = PathNeeds { shadows: true, ..without };
        assert_eq!(with.bytes_a_path(1) - without.bytes_a_path(1), 68, "64 bytes, and 4 of the queue");
    }
}
