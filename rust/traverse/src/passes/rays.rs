// SPDX-License-Identifier: Apache-2.0
//! The rays of the two passes: walks a block of them, begins each walk, and stores its result.

use super::light_parts::LightParts;
use super::shadow_sums::ShadowSums;
use super::{PassContext, QueuePushes, RAY_WORDS, RAYS_AT_ONCE, SHADOW_WORDS};
use crate::simd::Simd;
use crate::vector::V3;
use crate::walk::{ClosestHit, MAX_NESTING, RayTraversal, WorldRay};
use oocpt_abi::{
    Features, PathProgress, PrimMask, RAY_WORD_BOUNCE, RAY_WORD_FLAGS, RAY_WORD_IN_SHADOW, RayFlags, SHADOW_BIT,
    unpack_color, unpack_ray_bounce, unpack_shadow_bounce,
};
use oocpt_gpu::{HostBytes, HostWords};
use pulp::NullaryFnOnce;
use std::ops::Range;

/// The steps of a pass for an entry of its queue, before and after the walk.
pub(super) trait QueuedRays<'s, 'v, const ANY_HIT: bool>: Sync {
    /// Begins the walk of entry `at` of the queue; returns the state that [`QueuedRays::end`] needs. `None`: there is
    /// no such ray.
    fn begin(&self, simd: impl Simd, walk: &mut RayTraversal<'s, 'v, ANY_HIT>, at: u32) -> Option<BegunRay>;

    /// Prefetches the ray of entry `at`, if there is one.
    fn prefetch(&self, at: u32);

    /// Stores the result of the walk.
    fn end(&self, walk: &mut RayTraversal<'s, 'v, ANY_HIT>, begun: BegunRay, pushes: &mut QueuePushes);
}

/// Number of queue entries by which a prefetch precedes the walk.
const AHEAD: u32 = 8;

/// A ray whose walk has begun.
#[derive(Clone, Copy)]
pub(super) struct BegunRay {
    path: u32,
    /// True if roulette has ended it, so that it does not walk.
    is_ended: bool,
}

/// A block of rays. A thread traces several at once and takes one step of each in turn, so that the memory that one
/// ray waits for arrives while the others are traced.
pub(super) struct RayBlock<'a, 's, 'v, R, S, const ANY_HIT: bool> {
    pub(super) simd: S,
    pub(super) walks: &'a mut [RayTraversal<'s, 'v, ANY_HIT>],
    pub(super) pushes: &'a mut QueuePushes,
    pub(super) rays: &'a R,
    pub(super) range: Range<u32>,
}

impl<'s, 'v, R: QueuedRays<'s, 'v, ANY_HIT>, S: Simd, const ANY_HIT: bool> NullaryFnOnce
    for RayBlock<'_, 's, 'v, R, S, ANY_HIT>
{
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { simd, walks, pushes, rays, mut range } = self;
        let mut under_way = [None; RAYS_AT_ONCE];
        loop {
            let mut is_done = true;
            for (walk, slot) in walks.iter_mut().zip(&mut under_way) {
                if slot.is_none()
                    && let Some(at) = range.next()
                {
                    rays.prefetch(at + AHEAD);
                    *slot = rays.begin(simd, walk, at);
                    is_done = false;
                }
                if let Some(begun) = *slot {
                    is_done = false;
                    if !walk.step(simd) {
                        rays.end(walk, begun, pushes);
                        *slot = None;
                    }
                }
            }
            if is_done {
                return;
            }
        }
    }
}

/// The rays of [`super::closest`].
pub(super) struct ClosestRays<'a, 's, 'v> {
    pub(super) shared: &'a PassContext<'s, 'v>,
    pub(super) queue: HostBytes<'v>,
    pub(super) hits: HostWords<'v>,
}

/// The rays of [`super::shadow`].
pub(super) struct ShadowRays<'a, 's, 'v> {
    pub(super) shared: &'a PassContext<'s, 'v>,
    pub(super) queue: HostBytes<'v>,
    pub(super) radiance: HostWords<'v>,
    /// Where light is kept apart by light path expressions.
    pub(super) parts: Option<LightParts<'v>>,
    /// Where it is noted how much of the light arrives.
    pub(super) shadows: Option<ShadowSums<'v>>,
}

impl<'s, 'v> QueuedRays<'s, 'v, false> for ClosestRays<'_, 's, 'v> {
    #[inline(always)]
    fn prefetch(&self, at: u32) {
        if let Some(path) = self.queue.item::<u32>(at) {
            self.shared.rays.prefetch(path as usize * RAY_WORDS, RAY_WORDS);
        }
    }

    #[inline(always)]
    fn begin(&self, simd: impl Simd, walk: &mut RayTraversal<'s, 'v, false>, at: u32) -> Option<BegunRay> {
        let Self { shared, queue, hits } = self;
        let path = queue.get::<u32>(at as usize)?;
        let at = path as usize * RAY_WORDS;
        let ray = shared.load_ray(at);
        let is_ended = shared.is_ended(ray.flags);
        if is_ended {
            walk.no_walk();
        } else {
            if ray.flags & RayFlags::HIT.bits() != 0 {
                walk.found = load_hit(*hits, path as usize * shared.hit_words(), shared.scene.special.levels());
            }
            let word = shared.rays.load(at + RAY_WORD_BOUNCE as usize);
            let (bounce, passing) = match shared.scene.has(Features::PRIM_MASKS) {
                true => unpack_ray_bounce(word),
                false => (word, 0),
            };
            let seed = shared.scene.opacity_seed(path, bounce.wrapping_mul(2));
            shared.begin(simd, walk, path, WorldRay { path, seed, time: shared.scene.path_time(path), passing, ..ray });
        }
        Some(BegunRay { path, is_ended })
    }

    #[inline(always)]
    fn end(
        &self,
        walk: &mut RayTraversal<'s, 'v, false>,
        BegunRay { path, is_ended }: BegunRay,
        pushes: &mut QueuePushes,
    ) {
        let Self { shared, hits, .. } = self;
        if walk.hit {
            store_hit(*hits, path as usize * shared.hit_words(), &walk.found, shared.scene.special.levels());
        }
        if !shared.scene.has(Features::STREAMING) {
            if walk.hit { &mut pushes.surfaces } else { &mut pushes.escaped }.push(path);
            return;
        }
        let hit = walk.hit || walk.hit_before;
        let mut flags = RayFlags::empty();
        flags.set(RayFlags::HIT, hit);
        flags.set(RayFlags::CHANGED, walk.hit);
        let at = path as usize * RAY_WORDS + RAY_WORD_FLAGS as usize;
        shared.rays.store(at, flags.bits() | walk.waiting_flags());
        pushes.visits += walk.visits;
        if walk.pending.items().is_empty() {
            let end = if is_ended {
                PathProgress::PATH_ENDS
            } else if hit {
                PathProgress::CLOSEST_HIT
            } else {
                PathProgress::empty()
            };
            shared.finish(path, PathProgress::CLOSEST_DONE | end, pushes);
        } else {
            shared.store_pending(path, walk);
            pushes.deferred.push(path);
        }
    }
}

impl<'s, 'v> QueuedRays<'s, 'v, true> for ShadowRays<'_, 's, 'v> {
    #[inline(always)]
    fn prefetch(&self, at: u32) {
        if let Some(path) = self.queue.item::<u32>(at) {
            self.shared.rays.prefetch(path as usize * SHADOW_WORDS, SHADOW_WORDS);
        }
    }

    #[inline(always)]
    fn begin(&self, simd: impl Simd, walk: &mut RayTraversal<'s, 'v, true>, at: u32) -> Option<BegunRay> {
        let Self { shared, queue, .. } = self;
        let path = queue.get::<u32>(at as usize)?;
        let at = path as usize * SHADOW_WORDS;
        let ray = shared.load_ray(at);
        let is_ended = shared.is_ended(ray.flags);
        if is_ended {
            walk.no_walk();
        } else {
            let linked = shared.rays.load(at + RAY_WORD_BOUNCE as usize);
            let (bounce, shadow_link) = match shared.scene.has(Features::LIGHT_LINKS) {
                true => unpack_shadow_bounce(linked),
                false => (linked, 0),
            };
            let seed = shared.scene.opacity_seed(path, bounce.wrapping_mul(2).wrapping_add(1));
            let (time, passing) = (shared.scene.path_time(path), PrimMask::NO_SHADOW.bits());
            shared.begin(simd, walk, path, WorldRay { path, seed, time, shadow_link, passing, ..ray });
        }
        Some(BegunRay { path, is_ended })
    }

    #[inline(always)]
    fn end(
        &self,
        walk: &mut RayTraversal<'s, 'v, true>,
        BegunRay { path, is_ended }: BegunRay,
        pushes: &mut QueuePushes,
    ) {
        let Self { shared, radiance, parts, shadows, .. } = self;
        let at = path as usize * SHADOW_WORDS;
        let waits = !walk.hit && !walk.pending.items().is_empty();
        if let Some(shadows) = shadows
            && let Some(arrives) = self.arrives(at, walk.hit, is_ended)
        {
            shadows.store(path, arrives);
        }
        shared.add_light((at, path), (walk.hit, waits || is_ended), *radiance, parts.as_ref());
        if !shared.scene.has(Features::STREAMING) {
            return;
        }
        pushes.visits += walk.visits;
        if waits {
            shared.rays.store(at + RAY_WORD_FLAGS as usize, walk.waiting_flags());
            shared.store_pending(path, walk);
            pushes.deferred.push(path | SHADOW_BIT);
        } else {
            shared.finish(path, PathProgress::SHADOW_DONE, pushes);
        }
    }
}

impl ShadowRays<'_, '_, '_> {
    /// What arrives of the light that the ray of `bounce` 0 at this word has asked for, if not all of it.
    fn arrives(&self, at: usize, hit: bool, is_ended: bool) -> Option<V3> {
        let linked = self.shared.rays.load(at + RAY_WORD_BOUNCE as usize);
        let has_links = self.shared.scene.has(Features::LIGHT_LINKS);
        let bounce = if has_links { unpack_shadow_bounce(linked).0 } else { linked };
        let color = if hit { self.shared.rays.load(at + RAY_WORD_IN_SHADOW as usize) } else { 0 };
        (bounce == 0 && (hit || is_ended)).then(|| V3(unpack_color(color)))
    }
}

/// Writes a hit record, as traversal/hit.glsl.
fn store_hit(hits: HostWords<'_>, at: usize, found: &ClosestHit, levels: usize) {
    let header =
        [found.uv[0].to_bits(), found.uv[1].to_bits(), found.triangle, found.chunk_instance, found.t.to_bits()];
    for (i, &word) in header.iter().chain(&found.chain[..levels]).enumerate() {
        hits.store(at + i, word);
    }
    for level in levels..3 {
        hits.store(at + header.len() + level, 0);
    }
}

fn load_hit(hits: HostWords<'_>, at: usize, levels: usize) -> ClosestHit {
    let [u, v, triangle, chunk_instance, t] = [0, 1, 2, 3, 4].map(|i| hits.load(at + i));
    let mut chain = [0; MAX_NESTING];
    for (level, record) in chain.iter_mut().enumerate().take(levels) {
        *record = hits.load(at + 5 + level);
    }
    let uv = [f32::from_bits(u), f32::from_bits(v)];
    ClosestHit { t: f32::from_bits(t), uv, triangle, chunk_instance, chain }
}
