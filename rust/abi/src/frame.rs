// SPDX-License-Identifier: Apache-2.0
//! What a pass is given: the frame block, specialisation constants, and how to launch ([`super::PushConstants`] has the
//! push constants).
//!
//! Guarantees: plain data, of which the build makes the structs of the shaders. Any thread.

use bitflags::bitflags;
use bytemuck::{Pod, Zeroable};

/// Threads in every workgroup of every pass, along x.
pub const WORKGROUP_SIZE: u32 = 64;

/// Largest workgroup count along x that [`groups`] and `prepare_dispatch` ask for; more go along y.
/// 2^15 keeps below the 65535 that every device grants.
pub const MAX_DIRECT_GROUPS: u32 = 1 << 15;

/// Specialisation constant: instance records on the longest chain from a chunk's record to a mesh, 1..=16. The chunk
/// instance itself does not count.
pub const SPEC_MAX_LEVELS: u32 = 0;
/// Specialisation constant: traversal stack entries: the depth of the top level's tree, plus the sum, over the levels
/// of the deepest chain, of the depth of the deepest instance tree at that level (the chunk's first), plus the depth of
/// the deepest mesh tree, plus `MAX_LEVELS` + 2, plus [`crate::MAX_PENDING`] with streaming.
pub const SPEC_STACK_SIZE: u32 = 1;
/// Specialisation constant of a build with the feature `faults`: with streaming, n > 0 has rays forget absent chunk
/// instances whose number is n - 1, modulo [`FAULT_ONE_IN`], and go on without them; [`FAULT_ALL`] has them forget all.
#[cfg(feature = "faults")]
pub const SPEC_FAULT: u32 = 4;
/// See [`SPEC_FAULT`].
#[cfg(feature = "faults")]
pub const FAULT_ONE_IN: u32 = 100;
/// See [`SPEC_FAULT`].
#[cfg(feature = "faults")]
pub const FAULT_ALL: u32 = u32::MAX;

/// `arg0` of `prepare_dispatch`: queues for `intersect_closest` and `intersect_shadow`.
pub const PREPARE_TRACE: u32 = 0;
/// `arg0` of `prepare_dispatch`: queues for `shade_surface` and `shade_background`.
pub const PREPARE_SHADE: u32 = 1;
/// `arg0` of `prepare_dispatch`, streaming: arguments for what reads the deferred rays.
pub const PREPARE_DEMAND: u32 = 2;
/// `arg0` of `prepare_dispatch`, streaming with textures: arguments for `resolve_materials`.
pub const PREPARE_RESOLVE: u32 = 3;
/// `arg0` of `prepare_dispatch`, deferred cutouts: arguments for `settle_closest` and `settle_shadow`.
pub const PREPARE_SETTLE: u32 = 4;
/// `arg0` of `sort_deferred_scan`: blocks of [`SCAN_BLOCK`] counts, each for itself.
pub const SCAN_BLOCKS: u32 = 0;
/// `arg0` of `sort_deferred_scan`: the sums of the blocks.
pub const SCAN_SUMS: u32 = 1;
/// Counts that a workgroup of `sort_deferred_scan` takes.
pub const SCAN_BLOCK: u32 = 1024;
/// `arg0` of `shade_aovs`: the rays that met something.
pub const AOV_SURFACES: u32 = 0;
/// `arg0` of `shade_aovs`: the rays that left the scene.
pub const AOV_ESCAPED: u32 = 1;

bitflags! {
    /// Switches of a frame that do not need another pipeline (`FrameConstants::flags`).
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
    pub struct FrameFlags: u32 {
        /// A camera ray that escapes sees `FrameConstants::dome_background` with alpha 1; else it leaves (0, 0, 0, 0).
        const DOME_CAMERA_VISIBLE = 1;
    }
}

shared! {
    /// Where `shade_aovs` writes: device addresses of tightly packed planes, pixel `y * width + x`, row 0 at the
    /// bottom. 0 = not wanted. [`crate::aov_bytes`] gives bytes per pixel.
    #[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Pod, Zeroable)]
    pub struct AovTargets {
        /// f32, clip z/w mapped from [-1, 1] to [0, 1].
        pub depth: u64,
        /// f32, distance along the view axis, positive in front.
        pub camera_depth: u64,
        /// i32, `GpuInstance::prim_id` of the record that holds the mesh.
        pub prim_id: u64,
        /// i32, instances numbered through all instancer levels, outer to inner.
        pub instance_id: u64,
        /// i32, `GpuTriangle::face`.
        pub element_id: u64,
        /// f32x3, world normal, unit, on the authored side of the surface.
        pub normal: u64,
        /// f32x3, the same in view space.
        pub neye: u64,
        /// f32x3, diffuse albedo, linear.
        pub albedo: u64,
        /// f32x3, pixels to the right and up and camera depth that the surface moves by from the shutter's opening to
        /// its closing; written by `record_surfaces` with both `Features::STREAMING` and `Features::MOTION_VECTORS`.
        pub motion: u64,
        /// f32, samples so far; written by `count_samples`.
        pub sample_count: u64,
    }
}

shared! {
    /// What `shade_aovs` writes where nothing is hit, plane by plane.
    #[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
    pub struct AovClear {
        /// Clear value of the plane of this name.
        pub depth: f32,
        /// Clear value of the plane of this name.
        pub camera_depth: f32,
        /// Clear value of the plane of this name.
        pub prim_id: i32,
        /// Clear value of the plane of this name.
        pub instance_id: i32,
        /// Clear value of the plane of this name.
        pub element_id: i32,
        /// Clear value of the plane of this name.
        pub normal: [f32; 3],
        /// Clear value of the plane of this name.
        pub neye: [f32; 3],
        /// Clear value of the plane of this name.
        pub albedo: [f32; 3],
        /// Clear value of the plane of this name.
        pub motion: [f32; 3],
        /// 0.
        pub pad: u32,
    }
}

shared! {
    /// Everything about a frame that all passes share; lives in device memory, written by the host before the first
    /// wave. World means: relative to `Snapshot::origin`, the frame of the root assembly.
    #[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
    pub struct FrameConstants {
        /// [`crate::LevelNode`] array of the top level: leaves are single chunk instances, boxes are in the world; at
        /// least one node. 16-byte aligned, as all node, triangle and instance arrays are.
        pub top_nodes: u64,
        /// [`crate::GpuChunkInstance`] array; its order decides ties between equally close hits. 16-byte aligned.
        pub chunk_instances: u64,
        /// [`crate::GpuChunk`] by chunk index.
        pub chunks: u64,
        /// [`crate::GpuAssembly`] by assembly index. May be 0 without `Features::INSTANCING`.
        pub assemblies: u64,
        /// [`crate::GpuMesh`] by mesh index.
        pub meshes: u64,
        /// [`crate::Ray`] per path. 16-byte aligned, as are all arrays by path.
        pub rays: u64,
        /// [`crate::ShadowRay`] per path.
        pub shadow_rays: u64,
        /// Hit record per path, `hit_stride(MAX_LEVELS)` bytes each.
        pub hits: u64,
        /// [`crate::PathState`] per path.
        pub paths: u64,
        /// f32x4 (rgb, alpha) per path, of what it has brought so far.
        pub radiance: u64,
        /// Two queues of u32 path numbers, wave size, used in turn: round `r` reads `ray_queue[r & 1]`. 4-byte aligned,
        /// as are all queues.
        pub ray_queue: [u64; 2],
        /// Queue of the paths with a shadow ray to trace, wave size.
        pub shadow_queue: u64,
        /// Queue of the paths whose ray met something, wave size.
        pub surface_queue: u64,
        /// Queue of the paths whose ray left the scene, wave size.
        pub escaped_queue: u64,
        /// Queues of the paths whose ray, and whose shadow ray, depends on a cutout that no mask knows, wave size; 0
        /// without `Features::DEFERRED_CUTOUTS`.
        pub settle_queue: [u64; 2],
        /// Hit records of the candidate that such a path depends on, by its place in the queue; 16-byte aligned.
        pub settle_hits: [u64; 2],
        /// One [`crate::StreamingPointers`]; 0 without `Features::STREAMING`.
        pub streaming: u64,
        /// One [`crate::WavefrontCounters`].
        pub counters: u64,
        /// [`crate::FilmPixel`] per pixel `y * width + x`. Zero before the first wave. 16-byte aligned.
        pub film: u64,
        /// f32x4 per pixel `y * width + x`, row 0 at the bottom: what `resolve` writes. 16-byte aligned.
        pub color: u64,
        /// What `shade_aovs` writes.
        pub aov: AovTargets,
        /// What `shade_aovs` writes where nothing is hit.
        pub aov_clear: AovClear,
        /// What `resolve` puts under the picture: `color = premultiplied + clear_color * (1 - alpha)`.
        pub clear_color: [f32; 4],
        /// Camera ray of image point (px, py), pixel centres at + 0.5: origin `ray_o + ray_o_lo + px * ray_o_x + py *
        /// ray_o_y`.
        pub ray_o: [f32; 3],
        /// What `ray_o` lacks of the camera's place in f64, at most half an ulp of it.
        pub ray_o_lo: [f32; 3],
        /// See `ray_o`.
        pub ray_o_x: [f32; 3],
        /// See `ray_o`.
        pub ray_o_y: [f32; 3],
        /// Direction `ray_d + px * ray_d_x + py * ray_d_y`, of length 1 along the view axis, normalised by the pass.
        pub ray_d: [f32; 3],
        /// See `ray_d`.
        pub ray_d_x: [f32; 3],
        /// See `ray_d`.
        pub ray_d_y: [f32; 3],
        /// Lens axes, world, times the lens radius.
        pub lens_u: [f32; 3],
        /// See `lens_u`.
        pub lens_v: [f32; 3],
        /// Distance of the plane in focus along the view axis.
        pub focus: f32,
        /// Row z of clip-from-view.
        pub clip_z: [f32; 4],
        /// Row w of clip-from-view.
        pub clip_w: [f32; 4],
        /// Rows of view-from-world, for points relative to `ray_o + ray_o_lo`.
        pub view: [[f32; 4]; 3],
        /// Rows of the map of normals from world to view (inverse transpose of `view`).
        pub view_normal: [[f32; 3]; 3],
        /// Albedo of a surface without a colour (`UsdPreviewSurface` and `displayColor` fall back to 0.18).
        pub default_albedo: [f32; 3],
        /// Upper bound on the largest component of an indirect contribution; 0 = off.
        pub clamp: f32,
        /// Image width in pixels.
        pub width: u32,
        /// Image height in pixels.
        pub height: u32,
        /// Seed of the render.
        pub seed: u32,
        /// Indirect bounces; 0 = direct light only.
        pub max_bounces: u32,
        /// Bits of [`FrameFlags`].
        pub flags: u32,
        /// Threads of a round that trace its rays, at most and rounded up to workgroups: where there are more rays,
        /// each takes some, one after the other.
        pub most_walkers: u32,
        /// See `clip_planes`.
        pub clip_plane_count: u32,
        /// Table of materials; 0 without `Features::MATERIALS`, as the next two.
        pub materials: u64,
        /// Table of prims, by prim id + 1.
        pub prims: u64,
        /// u32 material numbers, where the prims say.
        pub material_slots: u64,
        /// Table of textures; 0 without `Features::TEXTURES`, as the next.
        pub textures: u64,
        /// Page tables of the textures.
        pub texture_pages: u64,
        /// f32x2 per path: width of the ray's cone at its origin, and how much it grows per unit of length; 0 without
        /// `Features::TEXTURES`. 8-byte aligned.
        pub cones: u64,
        /// Albedo tables of the BSDF; 0 without `Features::MATERIALS`.
        pub bsdf_tables: u64,
        /// One [`crate::LightTablePointers`].
        pub lighting: u64,
        /// 16 B per path: what lights that a ray meets need to know of where it left; 0 where none asks.
        pub light_paths: u64,
        /// Table of values as [`crate::GpuChunk::primvars`], by `GpuChunkInstance::row`; 0 without any.
        pub placed_values: u64,
        /// One [`AdaptiveSampling`]; 0 without `Features::ADAPTIVE`.
        pub adaptive: u64,
        /// One [`crate::TextureFeedback`]; 0 where all tiles are there, and with `Features::STREAMING`.
        pub texture_feedback: u64,
        /// Programs of the materials; 0 without `Features::PATTERNS`.
        pub programs: u64,
        /// Tables of sheen; 0 without `Features::SHEEN`.
        pub sheen_tables: u64,
        /// One [`crate::GpuCameraMotion`] and its keys; 0 without `Features::CAMERA_MOTION`. 16-byte aligned.
        pub camera_motion: u64,
        /// [`ClipPlane`]s, `clip_plane_count` of them; 0 without `Features::CLIPPING`. 16-byte aligned.
        pub clip_planes: u64,
        /// Pixel x of a point = dot of this with (v, 1), v in view space, over that of `clip_w`.
        pub pixel_x: [f32; 4],
        /// Pixel y, likewise.
        pub pixel_y: [f32; 4],
        /// What `resolve` multiplies the film's colour by.
        pub exposure: f32,
        /// What keeps the relative error of a black pixel finite, in units of the film: 0.01 of the picture's.
        pub error_floor: f32,
    }
}

shared! {
    /// A clipping plane of the camera as a function of image point, lens point and distance along the ray, 32 B: at
    /// distance t, in units of the direction that goes one unit along the view axis, the ray is kept where
    /// `begins + t * slope >= 0`.
    #[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
    pub struct ClipPlane {
        /// `begins` at image point (0, 0), and its change per pixel to the right and up.
        pub begins: [f32; 3],
        /// Its change, and that of `-slope * FrameConstants::focus`, by the lens point's x.
        pub lens_x: f32,
        /// `slope` at image point (0, 0), and its change per pixel to the right and up.
        pub slope: [f32; 3],
        /// As `lens_x`, by its y.
        pub lens_y: f32,
    }
}

shared! {
    /// Which samples the paths of an epoch are, with `Features::ADAPTIVE`. The film then has a [`crate::FilmPixel`] for
    /// each pixel of stream 0 and behind all of them one for each of stream 1; `PushConstants::first_pixel` is an
    /// entry, and `PushConstants::first_sample` a row, with the band from bit 26 on.
    #[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Pod, Zeroable)]
    pub struct AdaptiveSampling {
        /// u32x2 each: number of the pixel in trace order, with the stream in the highest bit; first sample. 8-byte
        /// aligned.
        pub entries: u64,
        /// u32 by octave & 7, stream, pixel: estimates by the first `2^octave` samples, as two halves
        /// (`oocpt_core::adaptive::VarianceEstimate`).
        pub estimates: u64,
        /// Entries of each band.
        pub width: [u32; 32],
    }
}

/// Workgroup counts that give at least `threads` threads; the passes find their thread as
/// `(group.y * group_count.x + group.x) * 64 + local`. Zero threads give one group.
#[must_use]
pub fn groups(threads: u64) -> [u32; 3] {
    let needed = threads.div_ceil(u64::from(WORKGROUP_SIZE)).max(1);
    let x = needed.min(u64::from(MAX_DIRECT_GROUPS));
    let y = needed.div_ceil(x);
    [u32::try_from(x).unwrap_or(u32::MAX), u32::try_from(y).unwrap_or(u32::MAX), 1]
}
