// SPDX-License-Identifier: Apache-2.0
//! The two trace passes, on all threads: `wavefront/intersect_closest.comp` and `wavefront/intersect_shadow.comp`.
//!
//! A thread takes blocks of a queue, one after the other. The results of a block are pushed to the queues with one
//! atomic, as those of a subgroup are.

mod light_parts;
mod load_waits;
mod rays;
mod shadow_sums;

#[cfg(target_arch = "x86_64")]
use crate::InstructionSet;
use crate::deferred_tests::{load_alpha_test, store_alpha_test};
use crate::passes::light_parts::LightParts;
use crate::passes::load_waits::LoadWaits;
use crate::passes::rays::{ClosestRays, QueuedRays, RayBlock, ShadowRays};
use crate::passes::shadow_sums::ShadowSums;
use crate::pending::{ListedItems, PendingItem};
use crate::scene::TraversalScene;
#[cfg(target_arch = "x86_64")]
use crate::simd::Avx2Simd;
use crate::simd::{PortableSimd, Simd};
use crate::vector::V3;
use crate::walk::{RayTraversal, WorldRay};
use crate::{TraceError, TraversalConstants};
use oocpt_abi::{
    Features, PathProgress, PendingItems, PushConstants, RAY_WORD_IN_SHADOW, Ray, RayFlags, ShadowRay,
    WavefrontCounters, hit_stride, unpack_color,
};
use oocpt_gpu::{HostView, HostWords};
use rayon::prelude::*;
use std::mem::offset_of;

/// Number of rays of a block.
const BLOCK: u32 = 128;
/// Number of rays that a thread walks at once.
const RAYS_AT_ONCE: usize = 8;
/// Number of words of a ray; of a shadow ray and of a pending list below.
const RAY_WORDS: usize = size_of::<Ray>() / 4;
const SHADOW_WORDS: usize = size_of::<ShadowRay>() / 4;
const PENDING_WORDS: usize = size_of::<PendingItems>() / 4;

macro_rules! counter {
    ($member:ident) => {
        offset_of!(WavefrontCounters, $member) / 4
    };
}

/// The state that the threads of a pass share.
struct PassContext<'s, 'v> {
    scene: &'s TraversalScene<'v>,
    counters: HostWords<'v>,
    /// Rays, with their flags.
    rays: HostWords<'v>,
    pending: HostWords<'v>,
    /// Deferred alpha tests; streaming.
    alpha_tests: HostWords<'v>,
    /// Where it is counted how often paths wait.
    waits: Option<LoadWaits<'v>>,
}

/// The queue entries that a block pushes.
#[derive(Default)]
struct QueuePushes {
    surfaces: Vec<u32>,
    escaped: Vec<u32>,
    deferred: Vec<u32>,
    ended: Vec<u32>,
    visits: u32,
}

/// Traces the closest hits of a round.
///
/// # Errors
/// [`TraceError::NoMemory`] if a table of the frame is missing.
pub fn closest(view: &HostView, push: PushConstants, special: TraversalConstants) -> Result<(), TraceError> {
    let scene = TraversalScene::new(view, push, special)?;
    let rays = view.words(scene.frame.rays);
    let shared = PassContext::new(&scene, rays, [scene.streaming.pending, scene.streaming.alpha_tests]);
    let parity = (push.round & 1) as usize;
    let queue = view.bytes(scene.frame.ray_queue[parity]);
    let hits = view.words(scene.frame.hits);
    let count = shared.counters.load(counter!(ray_count) + parity);
    shared.trace(count, &ClosestRays { shared: &shared, queue, hits });
    Ok(())
}

/// Traces the shadow rays of a round, and adds their contributions.
///
/// # Errors
/// As [`closest`].
pub fn shadow(view: &HostView, push: PushConstants, special: TraversalConstants) -> Result<(), TraceError> {
    let scene = TraversalScene::new(view, push, special)?;
    let rays = view.words(scene.frame.shadow_rays);
    let shared = PassContext::new(&scene, rays, [scene.streaming.shadow_pending, scene.streaming.shadow_alpha_tests]);
    let queue = view.bytes(scene.frame.shadow_queue);
    let radiance = view.words(scene.frame.radiance);
    let (parts, shadows) = (LightParts::new(&scene), ShadowSums::new(&scene));
    let count = shared.counters.load(counter!(shadow_count));
    shared.trace(count, &ShadowRays { shared: &shared, queue, radiance, parts, shadows });
    Ok(())
}

fn load_v3(words: HostWords<'_>, at: usize) -> V3 {
    V3([0, 1, 2].map(|i| f32::from_bits(words.load(at + i))))
}

impl<'s, 'v> PassContext<'s, 'v> {
    fn new(scene: &'s TraversalScene<'v>, rays: HostWords<'v>, [pending, alpha_tests]: [u64; 2]) -> Self {
        let view = scene.view;
        let counters = view.words(scene.frame.counters);
        let waits = LoadWaits::new(scene);
        Self { scene, counters, rays, pending: view.words(pending), alpha_tests: view.words(alpha_tests), waits }
    }

    /// Traces `count` entries of a queue.
    fn trace<const ANY_HIT: bool>(&self, count: u32, rays: &impl QueuedRays<'s, 'v, ANY_HIT>) {
        #[cfg(target_arch = "x86_64")]
        if self.scene.special.instructions == InstructionSet::Widest
            && let Some(simd) = Avx2Simd::try_new()
        {
            return self.trace_by(simd, count, rays);
        }
        self.trace_by(PortableSimd, count, rays);
    }

    fn trace_by<const ANY_HIT: bool>(&self, simd: impl Simd, count: u32, rays: &impl QueuedRays<'s, 'v, ANY_HIT>) {
        let blocks = (0..count.div_ceil(BLOCK)).into_par_iter();
        blocks.for_each_init(
            || ([(); RAYS_AT_ONCE].map(|()| RayTraversal::<ANY_HIT>::new(self.scene)), QueuePushes::default()),
            |(walks, pushes), block| {
                let first = block * BLOCK;
                let range = first..count.min(first + BLOCK);
                simd.vectorize(RayBlock { simd, walks: &mut *walks, pushes: &mut *pushes, rays, range });
                self.push_all(pushes);
                let overflows = walks.iter_mut().map(|walk| std::mem::take(&mut walk.overflows)).sum();
                if overflows > 0 {
                    self.count(counter!(stack_overflows), overflows);
                }
            },
        );
    }

    fn count(&self, counter: usize, more: u32) -> u32 {
        self.counters.add(counter, more).unwrap_or(0)
    }

    fn push_all(&self, pushes: &mut QueuePushes) {
        let TraversalScene { frame, streaming, view, .. } = self.scene;
        let is_streaming = self.scene.has(Features::STREAMING);
        let (surface_queue, surface_count) = if is_streaming && self.scene.has(Features::TEXTURES) {
            (streaming.resolve_queue, counter!(resolve_count))
        } else {
            (frame.surface_queue, counter!(surface_count))
        };
        self.push_to(surface_queue, surface_count, &mut pushes.surfaces);
        self.push_to(frame.escaped_queue, counter!(escaped_count), &mut pushes.escaped);
        if is_streaming {
            let list = (self.counters.load(counter!(deferred_parity)) & 1) as usize;
            let waiting = u32::try_from(pushes.deferred.len()).unwrap_or(0);
            if waiting > 0 {
                self.count(counter!(misses), waiting);
                if let Some(waits) = &self.waits {
                    pushes.deferred.iter().for_each(|entry| waits.count(*entry));
                }
            }
            self.push_to(streaming.deferred[list], counter!(deferred_count) + list, &mut pushes.deferred);
            self.count(counter!(visits), std::mem::take(&mut pushes.visits));
            for path in pushes.ended.drain(..) {
                let segment = self.scene.path_place(path) / streaming.segment_size.max(1);
                let alive = view.words(streaming.segments).add(segment as usize * 4 + 3, u32::MAX);
                if alive.is_some() {
                    let to = self.count(counter!(freed), 1) % streaming.slots.max(1);
                    view.words(streaming.free_slots).store(to as usize, path);
                }
            }
        }
    }

    fn push_to(&self, queue: u64, counter: usize, entries: &mut Vec<u32>) {
        if let Ok(count) = u32::try_from(entries.len())
            && count > 0
        {
            let first = self.count(counter, count) as usize;
            let queue = self.scene.view.words(queue);
            for (at, entry) in (first..).zip(entries.drain(..)) {
                queue.store(at, entry);
            }
        }
    }

    /// The world ray at word `at`, without the parts that only one kind of ray has.
    #[inline(always)]
    fn load_ray(&self, at: usize) -> WorldRay {
        let ray: Ray = bytemuck::cast(self.rays.load_all::<RAY_WORDS>(at));
        let flags = if self.scene.has(Features::STREAMING) { ray.flags } else { 0 };
        WorldRay { o: V3(ray.o), d: V3(ray.d), o_lo: V3(ray.o_lo), t_max: ray.t_max, flags, ..WorldRay::default() }
    }

    /// Number of words from one hit record to the next.
    fn hit_words(&self) -> usize {
        hit_stride(self.scene.special.max_levels) as usize / 4
    }

    fn is_ended(&self, flags: u32) -> bool {
        self.scene.has(Features::ROULETTE) && flags & RayFlags::ENDED.bits() != 0
    }

    /// The pending list of a path.
    fn listed(&self, path: u32, flags: u32) -> ListedItems {
        let list: PendingItems = bytemuck::cast(self.pending.load_all::<PENDING_WORDS>(path as usize * PENDING_WORDS));
        let item = |i: usize| PendingItem {
            chunk: (list.entry[i], list.chunk_instance[i]),
            record: (list.record_entry[i], list.mesh[i]),
        };
        ListedItems::new(flags, [0, 1, 2, 3].map(item))
    }

    #[inline(always)]
    fn begin<const ANY_HIT: bool>(
        &self,
        simd: impl Simd,
        walk: &mut RayTraversal<'s, 'v, ANY_HIT>,
        path: u32,
        ray: WorldRay,
    ) {
        let listed = if ray.flags == 0 { ListedItems::default() } else { self.listed(path, ray.flags) };
        if self.scene.has(Features::STREAMING) && self.scene.has(Features::CUTOUTS) {
            let is_asked = ray.flags & RayFlags::ASKED.bits() != 0;
            walk.deferred_tests.begin(is_asked.then(|| (listed.items[0], load_alpha_test(self.alpha_tests, path))));
        }
        walk.begin(simd, ray, listed);
    }

    /// Stores the items that a ray waits for.
    fn store_pending<const ANY_HIT: bool>(&self, path: u32, walk: &RayTraversal<'s, 'v, ANY_HIT>) {
        if let Some(deferred_test) = walk.kept_alpha_test() {
            store_alpha_test(self.alpha_tests, path, deferred_test);
        }
        let mut list = PendingItems::default();
        for (i, item) in walk.pending.items().iter().enumerate() {
            ((list.entry[i], list.chunk_instance[i]), (list.record_entry[i], list.mesh[i])) = (item.chunk, item.record);
        }
        let words: [u32; PENDING_WORDS] = bytemuck::cast(list);
        for (i, word) in words.into_iter().enumerate() {
            self.pending.store(path as usize * PENDING_WORDS + i, word);
        }
    }

    /// Notes that a ray of the path has finished, and pushes the path if the other one had finished too.
    fn finish(&self, path: u32, bits: PathProgress, pushes: &mut QueuePushes) {
        let progress = self.scene.view.words(self.scene.streaming.progress);
        let before = progress.or(path as usize, bits.bits()).unwrap_or(0);
        let all = PathProgress::from_bits_retain(before) | bits;
        if !all.contains(PathProgress::SHADOW_DONE | PathProgress::CLOSEST_DONE) {
            return;
        }
        let list = match all {
            all if all.contains(PathProgress::PATH_ENDS) => &mut pushes.ended,
            all if all.contains(PathProgress::CLOSEST_HIT) => &mut pushes.surfaces,
            _ => &mut pushes.escaped,
        };
        list.push(path);
    }

    /// Adds the contribution of the light if nothing shadows it, or in shadow the share that its shadow colour leaves.
    fn add_light(
        &self,
        (at, path): (usize, u32),
        (hit, waits): (bool, bool),
        radiance: HostWords<'v>,
        parts: Option<&LightParts<'v>>,
    ) {
        let color = self.rays.load(at + RAY_WORD_IN_SHADOW as usize);
        if if hit { color == 0 } else { waits } {
            return;
        }
        let mut light = load_v3(self.rays, at + offset_of!(ShadowRay, contribution) / 4);
        if hit {
            light = light * V3(unpack_color(color));
        }
        let to = path as usize * 4;
        for (i, more) in light.0.into_iter().enumerate() {
            radiance.store(to + i, (f32::from_bits(radiance.load(to + i)) + more).to_bits());
        }
        if let Some(parts) = parts {
            parts.add(path, light);
        }
    }
}
