// SPDX-License-Identifier: Apache-2.0
//! What paths need when chunks and meshes may be absent: lists of items that rays wait for, surfaces kept while their
//! chunk leaves, segments of paths, and the demand that the host reads.
//!
//! Guarantees: plain data, of which the build makes the structs of the shaders. Any thread.

use super::SCAN_BLOCK;
use bytemuck::{Pod, Zeroable};
use core::mem::offset_of;

/// Items that a ray remembers because something is absent ([`PendingItems`]); of more it only knows that there are
/// some.
pub const MAX_PENDING: u32 = 4;

/// Set in an entry of `StreamingPointers::deferred` when the path's shadow ray waits, else its closest ray does.
pub const SHADOW_BIT: u32 = 1 << 31;

/// Set in an entry of `StreamingPointers::deferred` when neither waits but the path's material, for a tile of a
/// texture.
pub const MATERIAL_BIT: u32 = 1 << 30;

/// With textures, `StreamingPointers::sort_counts` has so many more elements: paths whose materials wait are sorted by
/// tile modulo this.
pub const TILE_KEYS: u32 = 256;

shared! {
    /// Addresses of what streaming adds to a frame. `slots` paths are in flight; the segments have `segments *
    /// segment_size` *places*, at least as many, one radiance each. Both below 2^31.
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
        /// u32 `waiting[unit_count]`, then u32 `next[unit_count]`: what `count_demand` adds to; then u32
        /// `is_demanded[unit_count]`: 1 once the unit was pushed to `demanded`; then u32 `partner[unit_count]`. Zero at
        /// first; `list_demand` leaves it zero.
        pub demand: u64,
        /// Two u32: what was pushed to `demanded`, and to `demand_list`; beyond their capacities it was counted alone.
        /// The host zeroes both before demand is counted.
        pub demand_counts: u64,
        /// u32 `[demanded_capacity]`: units that rays wait for, each once.
        pub demanded: u64,
        /// [`UnitDemand`] `[demand_capacity]`: what `list_demand` found, in no order.
        pub demand_list: u64,
        /// u32 `[2 * chunk_count]`, with textures [`TILE_KEYS`] more. The host zeroes it before `sort_deferred_count`.
        pub sort_counts: u64,
        /// u32 per block, see [`sort_blocks`]. Any contents.
        pub sort_sums: u64,
        /// u32 `[first_tile]`: rays that entered each chunk and mesh since the host zeroed it; those of meshes are
        /// estimated by the paths of which one is in [`COUNTED_PATHS`]. May be 0 without `Features::CHUNK_COUNTS`.
        pub unit_rays: u64,
        /// u32 per slot: the place of its path in the segments, which is where its radiance goes when it ends.
        pub places: u64,
        /// f32x4 (rgb, alpha) per place: radiance of paths that have ended; host memory where the device has memory of
        /// its own. 16-byte aligned. With `Features::ROULETTE` alpha is below 0 where the path has not ended.
        pub ended_radiance: u64,
        /// u32 per slot, a ring: slots that ended paths gave back, `WavefrontCounters::freed` of them since the host
        /// zeroed it.
        pub free_slots: u64,
        /// [`crate::GpuSurfaceMaterial`] by slot; 0 without `Features::MATERIALS`.
        pub surface_materials: u64,
        /// [`DeferredAlphaTest`] per slot, of the closest ray. 16-byte aligned; 0 without `Features::CUTOUTS`, as the
        /// next.
        pub questions: u64,
        /// The same of the shadow ray.
        pub shadow_questions: u64,
        /// u32 per slot: paths whose material is to be resolved; this and the next two are 0 without
        /// `Features::TEXTURES`.
        pub resolve_queue: u64,
        /// f32x4 `[lookups]` per slot: what lookups of textures gave. 16-byte aligned.
        pub resolved: u64,
        /// u32 per slot: how far the material is, 0 = not begun.
        pub resolve_progress: u64,
        /// One [`RouletteStats`]; 0 without `Features::ROULETTE`, as the next three.
        pub roulette: u64,
        /// u32 `[first_tile]`: what the rays that wait for each chunk or mesh first may bring, see [`WORTH_ONE`]. The
        /// host zeroes it before.
        pub worth: u64,
        /// u32 `[WORTH_SUMS]`: what the rays bring that wait for a unit and belong to a pixel, by a hash of both. The
        /// host zeroes it before.
        pub worth_sums: u64,
        /// Two tables of f32 `[first_tile]`, used in turn: 0 = nothing, above 0: a weight for the rays that wait for
        /// the unit first, below: they end. Written by the host.
        pub verdicts: [u64; 2],
        /// Places of a segment; the last one may be used in part.
        pub segment_size: u32,
        /// Elements of `FrameConstants::chunks`, at most 2^30.
        pub chunk_count: u32,
        /// Paths in flight at most; a power of two.
        pub slots: u32,
        /// Units of the planner: chunks, then meshes, then tiles of textures.
        pub unit_count: u32,
        /// Most lookups of textures that a material makes, at most 16.
        pub lookups: u32,
        /// Elements of `segments`.
        pub segment_count: u32,
        /// Most units in `demanded`.
        pub demanded_capacity: u32,
        /// Most entries of `demand_list`.
        pub demand_capacity: u32,
        /// The unit of the first tile of a texture: `chunk_count` and the number of meshes.
        pub first_tile: u32,
        /// Zero.
        pub unused: u32,
    }
}

shared! {
    /// The rays that ask for a unit, 16 B.
    #[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Pod, Zeroable)]
    pub struct UnitDemand {
        /// The planner's number of it: a chunk's, then those of meshes and of tiles of textures.
        pub unit: u32,
        /// Rays that wait for it first.
        pub waiting: u32,
        /// Rays that have it further down their list.
        pub next: u32,
        /// 1 + a unit that rays which wait for it first need with it, 0: none.
        pub partner: u32,
    }
}

/// One in `StreamingPointers::worth`; relative squared radiances.
pub const WORTH_ONE: u32 = 1 << 12;

/// Set in `StreamingPointers::worth` where a ray waits that roulette is not played with.
pub const WORTH_MUST: u32 = 1 << 31;

/// Elements of `StreamingPointers::worth_sums`; a power of two.
pub const WORTH_SUMS: u32 = 1 << 20;

shared! {
    /// What roulette on loads knows and counts, 24 B. Radiances are means of the channels; what is known of paths is of
    /// the latest looks at some of them.
    #[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
    pub struct RouletteStats {
        /// Mean radiance of paths.
        pub mean: f32,
        /// Mean of its square.
        pub second_moment: f32,
        /// Paths that were ended since the host zeroed it.
        pub ended_paths: u32,
        /// Shadow rays that were.
        pub ended_shadows: u32,
        /// Relative variance of the mean of a pixel's paths, times their number; 0 = not known.
        pub variance: f32,
        /// How often paths were looked at since the host zeroed it.
        pub looks: u32,
    }
}

shared! {
    /// A contiguous range of paths in flight, 16 B.
    #[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Pod, Zeroable)]
    pub struct PathSegment {
        /// First path: index of its pixel in trace order, as [`crate::PushConstants::first_pixel`].
        pub first_pixel: u32,
        /// First path: its sample number.
        pub first_sample: u32,
        /// Paths.
        pub count: u32,
        /// Paths that are not finished. 0 = the segment can be accumulated and used again.
        pub alive: u32,
    }
}

/// Words of a [`PathSegment`].
#[allow(clippy::cast_possible_truncation, reason = "small")]
pub const SEGMENT_WORDS: u32 = (size_of::<PathSegment>() / 4) as u32;
/// Word of [`PathSegment::alive`].
#[allow(clippy::cast_possible_truncation, reason = "small")]
pub const SEGMENT_WORD_ALIVE: u32 = (offset_of!(PathSegment, alive) / 4) as u32;

/// [`PendingItems::mesh`] of an item that is a whole chunk instance.
pub const NO_MESH: u32 = u32::MAX;

/// Of so many paths one counts its rays that enter meshes, for all: a power of two.
pub const COUNTED_PATHS: u32 = 16;

shared! {
    /// The items that a ray waits for, 64 B, ordered by (entry, chunk instance, record entry, mesh). How many count is
    /// in the ray's flags. An item is a chunk instance whose chunk is absent, or, in one that is not, all records of a
    /// mesh that the ray enters at one distance: the mesh is absent, or a tile that decides about its cutouts.
    #[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
    pub struct PendingItems {
        /// Where the ray enters the chunk instance.
        pub entry: [f32; 4] = "float[4]",
        /// Which it is. Of a material: the unit of a tile that it waits for.
        pub chunk_instance: [u32; 4],
        /// Where the ray enters the records; 0 of a whole chunk instance.
        pub record_entry: [f32; 4] = "float[4]",
        /// Their mesh, or [`NO_MESH`].
        pub mesh: [u32; 4],
    }
}

shared! {
    /// Whether a cutout is there, which a ray could not tell because a tile of its texture is absent, 64 B. It is about
    /// the first item of the ray's list: all its cutouts nearer than this one are known not to be there.
    #[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
    pub struct DeferredAlphaTest {
        /// Where the ray meets it.
        pub t: f32,
        /// Which it is, among those at equal distance.
        pub id: u32,
        /// The chunk instance it is in.
        pub chunk_instance: u32,
        /// Of the shaders' own: how far the lookup is, and its answer.
        pub flags: u32,
        /// Of the lookup.
        pub mean: [f32; 4],
        /// What to look up.
        pub texture: u32,
        /// Where.
        pub st: [f32; 2],
        /// How wide the filter is, in texels.
        pub width: f32,
        /// What the opacity is from the texel.
        pub scale: f32,
        /// See `scale`.
        pub bias: f32,
        /// The opacity from which on it is there.
        pub limit: f32,
        /// The unit of the planner that it waits for; `u32::MAX`: it is answered, and the ray waits for the item
        /// itself.
        pub unit: u32,
    }
}

shared! {
    /// All that shading needs of a hit, 80 B; the same members as the shaders' `Surface`.
    #[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
    pub struct GpuSurface {
        /// World, high part.
        pub position: [f32; 3],
        /// How far along the geometric normal a spawned ray must start.
        pub offset: f32,
        /// World, low part.
        pub position_lo: [f32; 3],
        /// Prim id.
        pub prim_id: i32,
        /// Unit, authored side.
        pub geometric_normal: [f32; 3],
        /// Instance id.
        pub instance_id: u32,
        /// Unit.
        pub shading_normal: [f32; 3],
        /// Element id.
        pub face: u32,
        /// Linear.
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
