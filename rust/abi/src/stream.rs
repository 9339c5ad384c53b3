// SPDX-License-Identifier: Apache-2.0
//! State of paths while chunks and meshes may be absent: lists of items that rays wait for, surfaces that outlive their
//! chunk, segments of paths, and the demand that the host reads.
//!
//! Guarantees: plain data, from which the build makes the structs of the shaders. Any thread.

use super::SCAN_BLOCK;
use bytemuck::{Pod, Zeroable};
use core::mem::offset_of;

/// Number of items that a ray remembers because something is absent ([`PendingItems`]); of further ones it only knows
/// that they exist.
pub const MAX_PENDING: u32 = 4;

/// Bit of an entry of `StreamingPointers::deferred` that is set if the path's shadow ray waits; else its closest ray
/// does.
pub const SHADOW_BIT: u32 = 1 << 31;

/// Bit of an entry of `StreamingPointers::deferred` that is set if neither ray waits but the path's material, for a
/// tile of a texture.
pub const MATERIAL_BIT: u32 = 1 << 30;

/// Number of further elements of `StreamingPointers::sort_counts` with textures: paths whose materials wait are sorted
/// by tile modulo this.
pub const TILE_KEYS: u32 = 256;

shared! {
    /// Addresses of the data that streaming adds to a frame. `slots` paths are in flight; the segments have
    /// `segments * segment_size` *places*, at least as many, one radiance each. Both below 2^31.
    #[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Pod, Zeroable)]
    pub struct StreamingPointers {
        /// [`PathSegment`] array: places `s * segment_size ..` belong to segment `s`. Written by `generate_*`, read by
        /// the host.
        pub segments: u64,
        /// u32 per slot: [`super::PathProgress`].
        pub progress: u64,
        /// [`PendingItems`] per slot, of the closest ray. 16-byte aligned.
        pub pending: u64,
        /// [`PendingItems`] per slot, of the shadow ray. 16-byte aligned.
        pub shadow_pending: u64,
        /// [`GpuSurface`] per slot. 16-byte aligned.
        pub surfaces: u64,
        /// Two lists of rays that wait, u32 each (slot, [`SHADOW_BIT`]), `2 * slots` entries each.
        pub deferred: [u64; 2],
        /// u32 `waiting[unit_count]`, then u32 `next[unit_count]`: the counters of `count_demand`; then u32
        /// `is_demanded[unit_count]`: 1 once the unit was pushed to `demanded`; then u32 `partner[unit_count]`. Zero at
        /// first; `list_demand` leaves it zero.
        pub demand: u64,
        /// Two u32: number of entries pushed to `demanded`, and to `demand_list`; entries beyond their capacities are
        /// only counted. The host zeroes both before demand is counted.
        pub demand_counts: u64,
        /// u32 `[demanded_capacity]`: units that rays wait for, each once.
        pub demanded: u64,
        /// [`UnitDemand`] `[demand_capacity]`: output of `list_demand`, in any order.
        pub demand_list: u64,
        /// u32 `[2 * chunk_count]`, with textures [`TILE_KEYS`] more. The host zeroes it before `sort_deferred_count`.
        pub sort_counts: u64,
        /// u32 per block, see [`sort_blocks`]. Any contents.
        pub sort_sums: u64,
        /// u32 `[first_tile]`: rays that entered each chunk and mesh since the host zeroed it; those of meshes are
        /// estimated from one in [`COUNTED_PATHS`] paths. May be 0 without `Features::CHUNK_COUNTS`.
        pub unit_rays: u64,
        /// u32 per slot: the place of its path in the segments, to which its radiance is written when it ends.
        pub places: u64,
        /// f32x4 (rgb, alpha) per place: radiance of paths that have ended; in host memory if the device has memory of
        /// its own. 16-byte aligned. With `Features::ROULETTE` alpha is below 0 if the path has not ended.
        pub ended_radiance: u64,
        /// u32 per slot, a ring: slots that ended paths gave back, `WavefrontCounters::freed` of them since the host
        /// zeroed it.
        pub free_slots: u64,
        /// [`crate::GpuSurfaceMaterial`] by slot; 0 without `Features::MATERIALS`.
        pub surface_materials: u64,
        /// [`DeferredAlphaTest`] per slot, of the closest ray. 16-byte aligned; 0 without `Features::CUTOUTS`, as the
        /// next.
        pub alpha_tests: u64,
        /// Deferred alpha test of the shadow ray, per slot.
        pub shadow_alpha_tests: u64,
        /// u32 per slot: paths whose material is to be resolved; this and the next two are 0 without
        /// `Features::TEXTURES`.
        pub resolve_queue: u64,
        /// f32x4 `[lookups]` per slot: results of texture lookups. 16-byte aligned.
        pub resolved: u64,
        /// u32 per slot: progress of the material, 0 = not begun.
        pub resolve_progress: u64,
        /// One [`RouletteStats`]; 0 without `Features::ROULETTE`, as the next three.
        pub roulette: u64,
        /// u32 `[first_tile]`: possible contribution of the rays that wait for each chunk or mesh first, see
        /// [`WORTH_ONE`]. The host zeroes it before.
        pub worth: u64,
        /// u32 `[WORTH_SUMS]`: contributions of the rays that wait for a unit and belong to a pixel, by a hash of both.
        /// The host zeroes it before.
        pub worth_sums: u64,
        /// Two tables of f32 `[first_tile]`, used in turn: 0 = nothing, above 0: a weight for the rays that wait for
        /// the unit first, below 0: they end. Written by the host.
        pub verdicts: [u64; 2],
        /// Number of places of a segment; the last one may be used in part.
        pub segment_size: u32,
        /// Number of elements of `FrameConstants::chunks`, at most 2^30.
        pub chunk_count: u32,
        /// Largest number of paths in flight; a power of two.
        pub slots: u32,
        /// Units of the planner: chunks, then meshes, then tiles of textures.
        pub unit_count: u32,
        /// Largest number of texture lookups of a material, at most 16.
        pub lookups: u32,
        /// Number of elements of `segments`.
        pub segment_count: u32,
        /// Largest number of units in `demanded`.
        pub demanded_capacity: u32,
        /// Largest number of entries of `demand_list`.
        pub demand_capacity: u32,
        /// The unit of the first tile of a texture: `chunk_count` and the number of meshes.
        pub first_tile: u32,
        /// Unused; 0.
        pub unused: u32,
    }
}

shared! {
    /// Number of rays that ask for a unit, 16 B.
    #[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Pod, Zeroable)]
    pub struct UnitDemand {
        /// The planner's number of it: first chunks, then meshes, then tiles of textures.
        pub unit: u32,
        /// Number of rays that wait for it first.
        pub waiting: u32,
        /// Number of rays that have it further down their list.
        pub next: u32,
        /// 1 + a unit that the rays which wait for it first also need, 0: none.
        pub partner: u32,
    }
}

/// One in `StreamingPointers::worth`; relative squared radiances.
pub const WORTH_ONE: u32 = 1 << 12;

/// Bit of `StreamingPointers::worth` that is set if a ray waits with which roulette is not played.
pub const WORTH_MUST: u32 = 1 << 31;

/// Elements of `StreamingPointers::worth_sums`; a power of two.
pub const WORTH_SUMS: u32 = 1 << 20;

shared! {
    /// Inputs and counters of roulette on loads, 24 B. Radiances are means of the channels; the statistics of paths are
    /// of the latest looks at some of them.
    #[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
    pub struct RouletteStats {
        /// Mean radiance of paths.
        pub mean: f32,
        /// Mean of the square of the radiance.
        pub second_moment: f32,
        /// Number of paths that were ended since the host zeroed it.
        pub ended_paths: u32,
        /// Number of shadow rays that were ended since the host zeroed it.
        pub ended_shadows: u32,
        /// Relative variance of the mean of a pixel's paths, times their number; 0 = not known.
        pub variance: f32,
        /// Number of looks at paths since the host zeroed it.
        pub looks: u32,
    }
}

shared! {
    /// A contiguous range of paths in flight, 16 B.
    #[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Pod, Zeroable)]
    pub struct PathSegment {
        /// First path: index of its pixel in trace order, as [`crate::PushConstants::first_pixel`].
        pub first_pixel: u32,
        /// First path, by its sample number.
        pub first_sample: u32,
        /// Number of paths.
        pub count: u32,
        /// Paths that are not finished. 0 = the segment can be accumulated and used again.
        pub alive: u32,
    }
}

/// Number of words of a [`PathSegment`].
#[allow(clippy::cast_possible_truncation, reason = "small")]
pub const SEGMENT_WORDS: u32 = (size_of::<PathSegment>() / 4) as u32;
/// Word of [`PathSegment::alive`].
#[allow(clippy::cast_possible_truncation, reason = "small")]
pub const SEGMENT_WORD_ALIVE: u32 = (offset_of!(PathSegment, alive) / 4) as u32;

/// [`PendingItems::mesh`] of an item that is a whole chunk instance.
pub const NO_MESH: u32 = u32::MAX;

/// One in so many paths counts its rays that enter meshes, for all: a power of two.
pub const COUNTED_PATHS: u32 = 16;

shared! {
    /// The items that a ray waits for, 64 B, ordered by (entry, chunk instance, record entry, mesh). Their number is in
    /// the ray's flags. An item is a chunk instance whose chunk is absent, or, in a resident one, all records of a mesh
    /// that the ray enters at one distance: the mesh is absent, or a tile that decides about its cutouts.
    #[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
    pub struct PendingItems {
        /// Distance at which the ray enters the chunk instance.
        pub entry: [f32; 4] = "float[4]",
        /// Index of the chunk instance. For a material: the unit of a tile that it waits for.
        pub chunk_instance: [u32; 4],
        /// Distance at which the ray enters the records; 0 for a whole chunk instance.
        pub record_entry: [f32; 4] = "float[4]",
        /// Mesh of the records, or [`NO_MESH`].
        pub mesh: [u32; 4],
    }
}

shared! {
    /// An alpha test that a ray could not make because a tile of its texture is absent, 64 B. It belongs to the first
    /// item of the ray's list: all its cutouts nearer than this one are known to be missed.
    #[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
    pub struct DeferredAlphaTest {
        /// Distance at which the ray meets it.
        pub t: f32,
        /// Id that distinguishes cutouts at equal distance.
        pub id: u32,
        /// Chunk instance of the cutout.
        pub chunk_instance: u32,
        /// Flags private to the shaders: progress of the lookup, and its result.
        pub flags: u32,
        /// Accumulated value of the lookup.
        pub mean: [f32; 4],
        /// Number of the texture.
        pub texture: u32,
        /// Texture coordinates.
        pub st: [f32; 2],
        /// Width of the filter, texels.
        pub width: f32,
        /// Factor from the texel to the opacity.
        pub scale: f32,
        /// Summand from the texel to the opacity.
        pub bias: f32,
        /// Opacity from which on the surface is hit.
        pub limit: f32,
        /// Unit of the planner that it waits for; `u32::MAX`: the test is answered, and the ray waits for the item
        /// itself.
        pub unit: u32,
    }
}

shared! {
    /// The data of a hit that shading needs, 80 B; the same members as the shaders' `Surface`.
    #[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
    pub struct GpuSurface {
        /// Position, world, high part.
        pub position: [f32; 3],
        /// Distance along the geometric normal at which a spawned ray must start.
        pub offset: f32,
        /// Position, world, low part.
        pub position_lo: [f32; 3],
        /// Prim id.
        pub prim_id: i32,
        /// Geometric normal: unit, authored side.
        pub geometric_normal: [f32; 3],
        /// Instance id.
        pub instance_id: u32,
        /// Shading normal: unit.
        pub shading_normal: [f32; 3],
        /// Element id.
        pub face: u32,
        /// Albedo, linear.
        pub albedo: [f32; 3],
        /// Width of the ray's cone there; 0 without textures.
        pub cone: f32,
    }
}

/// Workgroups of `sort_deferred_scan` with `SCAN_BLOCKS`, and elements of `StreamingPointers::sort_sums`.
#[must_use]
pub const fn sort_blocks(chunk_count: u32) -> u32 {
    (2 * chunk_count).div_ceil(SCAN_BLOCK)
}

/// Bytes of `FrameConstants::light_paths` for a path.
pub const LIGHT_PATH_BYTES: u64 = 16;
