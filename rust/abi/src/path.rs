// SPDX-License-Identifier: Apache-2.0
//! Path state and queues of the wavefront.
//!
//! Guarantees: plain data, from which the build makes the structs of the shaders. Any thread.

use bytemuck::{Pod, Zeroable};
use core::mem::offset_of;

shared! {
    /// A ray whose closest hit is wanted, 48 B; one per path.
    #[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
    pub struct Ray {
        /// Origin, world, high part.
        pub o: [f32; 3],
        /// Number of the bounce; 0 = camera ray. With `Features::PRIM_MASKS` as [`super::unpack_ray_bounce`] reads it.
        pub bounce: u32,
        /// Direction, world, unit up to rounding.
        pub d: [f32; 3],
        /// Upper limit of the distance of a hit; +inf.
        pub t_max: f32,
        /// Origin, low part: at most half an ulp of `o`, component by component.
        pub o_lo: [f32; 3],
        /// With streaming: state of the ray ([`super::RayFlags`]). 0 for a ray not yet traced.
        pub flags: u32,
    }
}

shared! {
    /// State of a path between bounces, 16 B.
    #[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
    pub struct PathState {
        /// Product of BSDF weights and roulette so far.
        pub throughput: [f32; 3],
        /// Density per solid angle with which the last bounce chose the ray's direction.
        pub pdf: f32,
    }
}

shared! {
    /// A ray that adds `contribution` to its path's radiance unless a prim blocks it, 64 B; one per path. It starts
    /// with the members of [`Ray`].
    #[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
    pub struct ShadowRay {
        /// Origin, world, high part.
        pub o: [f32; 3],
        /// Bounce of the ray that met the surface from which this one starts. With `Features::LIGHT_LINKS` it has the
        /// low 16 bits; above them is the category of the prims that block the ray, 0 for all:
        /// [`super::unpack_shadow_bounce`].
        pub bounce: u32,
        /// Direction, world, unit up to rounding.
        pub d: [f32; 3],
        /// Upper limit of the distance of blockers; +inf for lights at infinity.
        pub t_max: f32,
        /// Origin, low part.
        pub o_lo: [f32; 3],
        /// Flags, as [`Ray::flags`].
        pub flags: u32,
        /// Contribution of the light to the path, linear rgb.
        pub contribution: [f32; 3],
        /// Share of the contribution that remains in shadow, of [`pack_color`].
        pub in_shadow: u32,
    }
}

/// Bits of a word of `FrameConstants::bounce_kinds` for each of three kinds.
pub const BOUNCE_KIND_BITS: u32 = 10;

/// Packs a colour in ten bits for each channel, from 0 to 1; `unpack_color` of the shaders unpacks it.
#[must_use]
pub fn pack_color(color: [f32; 3]) -> u32 {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to ten bits")]
    let [r, g, b] = color.map(|c| (c.clamp(0.0, 1.0) * 1023.0).round() as u32);
    r | g << 10 | b << 20
}

/// Unpacks a colour, as `unpack_color` of the shaders.
#[must_use]
pub fn unpack_color(color: u32) -> [f32; 3] {
    #[allow(clippy::cast_precision_loss, reason = "ten bits")]
    [color, color >> 10, color >> 20].map(|bits| (bits & 1023) as f32 / 1023.0)
}

/// Bytes of a [`Ray`].
#[allow(clippy::cast_possible_truncation, reason = "small")]
pub const RAY_BYTES: u32 = size_of::<Ray>() as u32;
/// Bytes of a [`ShadowRay`].
#[allow(clippy::cast_possible_truncation, reason = "small")]
pub const SHADOW_RAY_BYTES: u32 = size_of::<ShadowRay>() as u32;
/// Words of a [`Ray`], and of the same members of a [`ShadowRay`], that traversal reads and writes.
pub const RAY_WORD_BOUNCE: u32 = word(offset_of!(Ray, bounce), offset_of!(ShadowRay, bounce));
/// Word of `t_max` in both structs, as [`RAY_WORD_BOUNCE`].
pub const RAY_WORD_T_MAX: u32 = word(offset_of!(Ray, t_max), offset_of!(ShadowRay, t_max));
/// Word of `flags` in both structs, as [`RAY_WORD_BOUNCE`].
pub const RAY_WORD_FLAGS: u32 = word(offset_of!(Ray, flags), offset_of!(ShadowRay, flags));
/// Word of [`ShadowRay::in_shadow`].
pub const RAY_WORD_IN_SHADOW: u32 = word(offset_of!(ShadowRay, in_shadow), offset_of!(ShadowRay, in_shadow));

/// The word of a member that has the same offset in both structs.
#[allow(clippy::cast_possible_truncation, reason = "within a struct of 64 bytes")]
const fn word(of_ray: usize, of_shadow_ray: usize) -> u32 {
    assert!(of_ray == of_shadow_ray && of_ray.is_multiple_of(4), "a shadow ray begins as a ray");
    (of_ray / 4) as u32
}

/// Bytes of a hit record: f32 u, f32 v, u32 triangle, u32 chunk instance, f32 t, then `max_levels` u32 instance
/// records, the chunk's first, rounded up to 16. Barycentrics: `p = (1 - u - v) v0 + u v1 + v v2`.
#[must_use]
pub const fn hit_stride(max_levels: u32) -> u32 {
    (20 + 4 * max_levels).next_multiple_of(16)
}

shared! {
    /// Arguments of an indirect dispatch.
    #[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Pod, Zeroable)]
    pub struct IndirectArgs {
        /// Workgroups along x.
        pub x: u32,
        /// Workgroups along y.
        pub y: u32,
        /// Workgroups along z, 1.
        pub z: u32,
    }
}

shared! {
    /// Queue lengths, the dispatch arguments that `prepare_dispatch` computes from them, and totals.
    ///
    /// The host zeroes all of it once before the first wave of a render; between waves nothing needs zeroing. The
    /// totals grow until the host zeroes them again (between waves, at the offsets up to
    /// [`WavefrontCounters::TOTALS_BYTES`]).
    #[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Pod, Zeroable)]
    pub struct WavefrontCounters {
        /// Total: closest-hit rays traced (without those of AOVs). A ray that waited and continued counts once.
        pub closest_rays: u64,
        /// Total: shadow rays traced, without rays that continue.
        pub shadow_rays: u64,
        /// Total, streaming: visits of chunk instances whose chunk was resident.
        pub chunk_visits: u64,
        /// Total, streaming: number of times that a ray was deferred.
        pub chunk_misses: u64,
        /// Total: contributions, and samples of their sums, that were NaN or infinite and were dropped.
        pub nonfinite: u32,
        /// Total: rays for which traversal ran out of stack and left nodes out; must stay 0, else `STACK_SIZE` is too
        /// small.
        pub stack_overflows: u32,
        /// Paths in `FrameConstants::ray_queue[i]`. After a submission of streaming that ended before round `r`,
        /// `ray_count[r & 1]` rays and `shadow_count` shadow rays are ready to be traced.
        pub ray_count: [u32; 2],
        /// Number of paths in `FrameConstants::surface_queue`.
        pub surface_count: u32,
        /// Number of paths in `FrameConstants::escaped_queue`.
        pub escaped_count: u32,
        /// Number of paths in `FrameConstants::shadow_queue`.
        pub shadow_count: u32,
        /// The one of the two lists of deferred rays that is in use: `deferred_count[deferred_parity]` rays wait.
        pub deferred_parity: u32,
        /// Number of entries in `StreamingPointers::deferred[i]`.
        pub deferred_count: [u32; 2],
        /// Visits that are not yet in `chunk_visits`.
        pub visits: u32,
        /// Misses that are not yet in `chunk_misses`.
        pub misses: u32,
        /// Number of rays in the queue that continued after a wait, which are not counted again.
        pub resumed_rays: u32,
        /// Number of shadow rays that continue.
        pub resumed_shadows: u32,
        /// First sorted ray in the ray queue.
        pub ray_base: u32,
        /// First sorted ray in the shadow queue.
        pub shadow_base: u32,
        /// Arguments of `record_surfaces`.
        pub ray_args: IndirectArgs,
        /// Arguments of `shade_surface`.
        pub surface_args: IndirectArgs,
        /// Arguments of `shade_background`.
        pub escaped_args: IndirectArgs,
        /// Arguments of `intersect_shadow`.
        pub shadow_args: IndirectArgs,
        /// Arguments of `count_demand`, `sort_deferred_count` and `sort_deferred_scatter`.
        pub deferred_args: IndirectArgs,
        /// Total number of slots that ended paths gave back; wraps.
        pub freed: u32,
        /// Total, streaming with textures: number of times that a material was deferred; wraps.
        pub tile_misses: u32,
        /// Number of paths in `StreamingPointers::resolve_queue`; 0 between submissions.
        pub resolve_count: u32,
        /// First sorted path in the queue of `resolve_materials`.
        pub resolve_base: u32,
        /// Arguments of `resolve_materials`.
        pub resolve_args: IndirectArgs,
        /// Total: rounds that had a ray to trace or a material to resolve; wraps.
        pub busy_rounds: u32,
        /// Arguments of `intersect_closest`.
        pub trace_args: IndirectArgs,
        /// First ray of the ray queue that no thread has begun.
        pub ray_next: u32,
        /// First ray of the shadow queue that no thread has begun.
        pub shadow_next: u32,
        /// Arguments of `retire_paths`.
        pub retire_args: IndirectArgs,
        /// Beginning of the range of retired paths: number of those of [`WavefrontCounters::freed`] that `retire_paths`
        /// has moved before.
        pub retired_from: u32,
        /// End of the range of retired paths.
        pub retired_to: u32,
        /// Number of paths in `FrameConstants::settle_queue[i]`.
        pub settle_count: [u32; 2],
        /// First path of those queues that no thread has begun.
        pub settle_next: [u32; 2],
        /// Arguments of `settle_closest` and `settle_shadow`.
        pub settle_args: [IndirectArgs; 2],
        /// Total: complement of the least `y * width + x` of the pixels of [`WavefrontCounters::nonfinite`], whatever
        /// their order; 0 = none.
        pub nonfinite_pixel: u32,
    }
}

impl WavefrontCounters {
    /// Byte offset of the lengths of the ray queues.
    pub const RAY_COUNT: u64 = offset_of!(Self, ray_count) as u64;
    /// Bytes of the totals, at the start of the struct.
    pub const TOTALS_BYTES: u64 = offset_of!(Self, ray_count) as u64;
    /// Byte offset of the indirect arguments of `count_demand`, `sort_deferred_count` and `sort_deferred_scatter`.
    pub const DEFERRED_ARGS: u64 = offset_of!(Self, deferred_args) as u64;
    /// Byte offset of the indirect arguments of `intersect_closest`.
    pub const TRACE_ARGS: u64 = offset_of!(Self, trace_args) as u64;
    /// Byte offset of the indirect arguments of `settle_closest`.
    pub const SETTLE_CLOSEST_ARGS: u64 = offset_of!(Self, settle_args) as u64;
    /// Byte offset of the indirect arguments of `settle_shadow`.
    pub const SETTLE_SHADOW_ARGS: u64 = Self::SETTLE_CLOSEST_ARGS + size_of::<IndirectArgs>() as u64;
    /// Byte offset of the indirect arguments of `record_surfaces`.
    pub const RAY_ARGS: u64 = offset_of!(Self, ray_args) as u64;
    /// Byte offset of the indirect arguments of `shade_surface`.
    pub const SURFACE_ARGS: u64 = offset_of!(Self, surface_args) as u64;
    /// Byte offset of the indirect arguments of `shade_background`.
    pub const ESCAPED_ARGS: u64 = offset_of!(Self, escaped_args) as u64;
    /// Byte offset of the indirect arguments of `resolve_materials`.
    pub const RESOLVE_ARGS: u64 = offset_of!(Self, resolve_args) as u64;
    /// Byte offset of the indirect arguments of `retire_paths`.
    pub const RETIRE_ARGS: u64 = offset_of!(Self, retire_args) as u64;
    /// Byte offset of the indirect arguments of `intersect_shadow`.
    pub const SHADOW_ARGS: u64 = offset_of!(Self, shadow_args) as u64;
}
