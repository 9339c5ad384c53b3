// SPDX-License-Identifier: Apache-2.0
//! The inputs of a pass: the frame block, specialisation constants, and launch parameters ([`super::PushConstants`] has
//! the push constants).
//!
//! Guarantees: plain data, from which the build makes the structs of the shaders. Any thread.

use bitflags::bitflags;
use bytemuck::{Pod, Zeroable};

/// Threads in every workgroup of every pass, along x.
pub const WORKGROUP_SIZE: u32 = 64;

/// Largest workgroup count along x that [`groups`] and `prepare_dispatch` ask for; more go along y. 2^15 keeps below
/// the 65535 that every device grants.
pub const MAX_DIRECT_GROUPS: u32 = 1 << 15;

/// Specialisation constant: number of instance records on the longest chain from a chunk's record to a mesh, 1..=16,
/// without the chunk instance itself.
pub const SPEC_MAX_LEVELS: u32 = 0;
/// Specialisation constant: traversal stack entries: the depth of the top level's tree, plus the sum, over the levels
/// of the deepest chain, of the depth of the deepest instance tree at that level (the chunk's first), plus the depth of
/// the deepest mesh tree, plus `MAX_LEVELS` + 2, plus [`crate::MAX_PENDING`] with streaming.
pub const SPEC_STACK_SIZE: u32 = 1;
/// Specialisation constant of a build with the feature `faults`: with streaming, n > 0 has rays forget absent chunk
/// instances whose number is n - 1, modulo [`FAULT_ONE_IN`], and continue without them; [`FAULT_ALL`] has them forget
/// all.
#[cfg(feature = "faults")]
pub const SPEC_FAULT: u32 = 4;
/// Modulus of the numbers of chunk instances that [`SPEC_FAULT`] compares with its value.
#[cfg(feature = "faults")]
pub const FAULT_ONE_IN: u32 = 100;
/// Value of [`SPEC_FAULT`] with which rays forget all absent chunk instances.
#[cfg(feature = "faults")]
pub const FAULT_ALL: u32 = u32::MAX;

/// Value of `arg0` of `prepare_dispatch`: queues for `intersect_closest` and `intersect_shadow`.
pub const PREPARE_TRACE: u32 = 0;
/// Value of `arg0` of `prepare_dispatch`: queues for `shade_surface` and `shade_background`.
pub const PREPARE_SHADE: u32 = 1;
/// Value of `arg0` of `prepare_dispatch`, streaming: arguments of the passes that read the deferred rays.
pub const PREPARE_DEMAND: u32 = 2;
/// Value of `arg0` of `prepare_dispatch`, streaming with textures: arguments for `resolve_materials`.
pub const PREPARE_RESOLVE: u32 = 3;
/// Value of `arg0` of `prepare_dispatch`, deferred cutouts: arguments for `settle_closest` and `settle_shadow`.
pub const PREPARE_SETTLE: u32 = 4;
/// Value of `arg0` of `sort_deferred_scan`: blocks of [`SCAN_BLOCK`] counts, each by itself.
pub const SCAN_BLOCKS: u32 = 0;
/// Value of `arg0` of `sort_deferred_scan`: it scans the sums of the blocks.
pub const SCAN_SUMS: u32 = 1;
/// Number of counts that a workgroup of `sort_deferred_scan` takes.
pub const SCAN_BLOCK: u32 = 1024;
/// Value of `arg0` of `shade_aovs`: the rays that met a surface.
pub const AOV_SURFACES: u32 = 0;
/// Value of `arg0` of `shade_aovs`: the rays that left the scene.
pub const AOV_ESCAPED: u32 = 1;

bitflags! {
    /// Switches of a frame that do not need another pipeline (`FrameConstants::flags`).
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
    pub struct FrameFlags: u32 {
        /// A camera ray that escapes sees `FrameConstants::dome_background` with alpha 1; otherwise it gives (0, 0, 0,
        /// 0).
        const DOME_CAMERA_VISIBLE = 1;
        /// Samples end where they meet something first: no image of light is wanted.
        const FIRST_HITS = 2;
        /// Some prim is in the way of shadow rays and not of others, or the other way round: shadow rays alone find
        /// lights for diffuse lobes. With `Features::PRIM_MASKS` only.
        const PARTED_SHADOWS = 4;
    }
}

shared! {
    /// Outputs of `shade_aovs`: device addresses of tightly packed planes, pixel `y * width + x` of the window, row 0
    /// at the bottom. 0 = not wanted.
    #[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Pod, Zeroable)]
    pub struct AovTargets {
        /// f32, clip z/w mapped from [-1, 1] to [0, 1].
        pub depth: u64,
        /// f32, distance along the view axis, positive in front.
        pub camera_depth: u64,
        /// i32, `GpuInstance::prim_id` of the record that holds the mesh.
        pub prim_id: u64,
        /// i32, number of the instance through all instancer levels, outer to inner.
        pub instance_id: u64,
        /// i32, `GpuTriangle::face`.
        pub element_id: u64,
        /// f32x3, world normal, unit, on the authored side of the surface.
        pub normal: u64,
        /// f32x3, the shading normal in view space.
        pub neye: u64,
        /// f32x3, diffuse albedo, linear.
        pub albedo: u64,
        /// f32x3, pixels to the right and up and camera depth by which the surface moves from the shutter's opening to
        /// its closing; written by `record_surfaces` with both `Features::STREAMING` and `Features::MOTION_VECTORS`.
        pub motion: u64,
        /// f32x4, pixels to the right and up from the shutter's opening to its middle, and from there to its closing;
        /// written as `motion` is.
        pub motion_both: u64,
        /// f32, samples so far; written by `count_samples`.
        pub sample_count: u64,
        /// f32x3, the point of the surface in the world, with its origin.
        pub position: u64,
        /// f32x3, the same in view space.
        pub peye: u64,
        /// f32x3, world normal of the surface as it is traced, unit, on the authored side.
        pub geometric_normal: u64,
        /// f32x3, variance of the samples, by channel; written by `tell_spread`, as `error`.
        pub variance: u64,
        /// f32, estimated relative standard error.
        pub error: u64,
        /// [`IdSlot`], [`ID_RANKS`] of them, largest first: shares of the pixel that placements of prims have, by prim
        /// id + 1 and instance id; written by `resolve_ids`, as the next.
        pub crypto_object: u64,
        /// Shares that materials have, by number + 1, and 0.
        pub crypto_material: u64,
        /// i32, number of the material of the surface.
        pub material_id: u64,
        /// f32x4, the share of the light that does not arrive, by channel and of the luminance; written by
        /// `resolve_planes`, as the next.
        pub shadow: u64,
        /// f32, the alpha that shadow catchers have.
        pub shadow_catcher: u64,
        /// f32, how often the paths of the pixel waited for loads, by their number; written by `resolve_planes`.
        pub load_waits: u64,
    }
}

shared! {
    /// Values that `shade_aovs` writes where a ray leaves the scene, plane by plane.
    #[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
    pub struct AovClear {
        /// Clear value of `depth`.
        pub depth: f32,
        /// Clear value of `camera_depth`.
        pub camera_depth: f32,
        /// Clear value of `prim_id`.
        pub prim_id: i32,
        /// Clear value of `instance_id`.
        pub instance_id: i32,
        /// Clear value of `element_id`.
        pub element_id: i32,
        /// Clear value of `normal`.
        pub normal: [f32; 3],
        /// Clear value of `neye`.
        pub neye: [f32; 3],
        /// Clear value of `albedo`.
        pub albedo: [f32; 3],
        /// Clear value of `motion`.
        pub motion: [f32; 3],
        /// Clear value of `position`.
        pub position: [f32; 3],
        /// Clear value of `peye`.
        pub peye: [f32; 3],
        /// Clear value of `geometric_normal`.
        pub geometric_normal: [f32; 3],
        /// Clear value of `material_id`.
        pub material_id: i32,
        /// Padding; 0.
        pub pad: u32,
    }
}

shared! {
    /// Where the values of each filtered image begin among the [`FrameConstants::plane_words`] of a sample; `NO_INDEX`
    /// = the image is not wanted, or traced through pixel centres.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
    pub struct PlaneOffsets {
        /// Of `AovTargets::normal`.
        pub normal: u32,
        /// Of `AovTargets::neye`.
        pub neye: u32,
        /// Of `AovTargets::albedo`.
        pub albedo: u32,
        /// Of `AovTargets::position`.
        pub position: u32,
        /// Of `AovTargets::peye`.
        pub peye: u32,
        /// Of `AovTargets::geometric_normal`.
        pub geometric_normal: u32,
        /// The two words of the id for `AovTargets::crypto_object`, behind all that is summed.
        pub crypto_object: u32,
        /// Those for `AovTargets::crypto_material`.
        pub crypto_material: u32,
    }
}

impl PlaneOffsets {
    /// No image is filtered.
    pub const NONE: Self = Self {
        normal: crate::NO_INDEX,
        neye: crate::NO_INDEX,
        albedo: crate::NO_INDEX,
        position: crate::NO_INDEX,
        peye: crate::NO_INDEX,
        geometric_normal: crate::NO_INDEX,
        crypto_object: crate::NO_INDEX,
        crypto_material: crate::NO_INDEX,
    };
}

shared! {
    /// Sum of a value of a filtered image over the samples of a pixel, 12 B. All zero = no sample yet. As those of
    /// [`crate::FilmPixel`], it is compensated and taken in ascending order.
    #[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
    pub struct PlaneSum {
        /// Sum over the samples.
        pub sum: f32,
        /// Rounding error that `sum` contains so far (to be subtracted).
        pub compensation: f32,
        /// Mean over the first `p` samples, `p` the largest power of two below their number; only if samples have
        /// negative weights.
        pub earlier: f32,
    }
}

shared! {
    /// What samples of a pixel met, and the number of these samples or, in an image, their share of the pixel, 12 B.
    /// All zero = nothing.
    #[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
    pub struct IdSlot {
        /// First word of the id; 0 = there is none.
        pub id: u32,
        /// Second word.
        pub instance: u32,
        /// Number of these samples, or their share.
        pub weight: f32,
    }
}

shared! {
    /// Samples of a pixel that met one thing at about one depth, 32 B. All zero = nothing.
    #[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
    pub struct DeepSlot {
        /// Prim id + 1 of the thing; 0 = it has none, or nothing was met.
        pub id: u32,
        /// Its instance id.
        pub instance: u32,
        /// Number of these samples or, in an image, their share of the pixel.
        pub weight: f32,
        /// Mean of their distances along the view axis; [`crate::DEEP_FAR`] where nothing was met.
        pub depth: f32,
        /// Sum of their radiance; in an image their part of the pixel, times the exposure.
        pub color: [f32; 3],
        /// Sum of their alpha, or their part of it.
        pub alpha: f32,
    }
}

shared! {
    /// The parameters of a frame that all passes share. It is in device memory, and the host writes it before the first
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
        /// f32x4 (rgb, alpha) per path, its contribution so far.
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
        /// Queues of the paths whose ray, and whose shadow ray, depends on a cutout that no mask decides, wave size; 0
        /// without `Features::DEFERRED_CUTOUTS`.
        pub settle_queue: [u64; 2],
        /// Hit records of the candidate that such a path depends on, by its index in the queue; 16-byte aligned.
        pub settle_hits: [u64; 2],
        /// One [`crate::StreamingPointers`]; 0 without `Features::STREAMING`.
        pub streaming: u64,
        /// One [`crate::WavefrontCounters`].
        pub counters: u64,
        /// [`crate::FilmPixel`] per pixel `y * width + x` of the window. Zero before the first wave. 16-byte aligned.
        pub film: u64,
        /// Output of `resolve`: f32x4 per pixel `y * width + x` of the window, row 0 at the bottom. 16-byte aligned.
        pub color: u64,
        /// Outputs of `shade_aovs`.
        pub aov: AovTargets,
        /// Values that `shade_aovs` writes where a ray leaves the scene.
        pub aov_clear: AovClear,
        /// f32, `plane_words` of them by path, or by place of a segment with `Features::STREAMING`: what the sample's
        /// first hit has for filtered images. 0 without any, as `plane_sums`.
        pub plane_values: u64,
        /// [`PlaneSum`], `sum_words` of them for each [`crate::FilmPixel`]. Zero before the first wave.
        pub plane_sums: u64,
        /// [`IdSlot`], [`ID_SLOTS`] of them for each id of a sample and each [`crate::FilmPixel`]; only with
        /// `Features::ID_RANKS`. Zero before the first wave.
        pub id_slots: u64,
        /// Where the values of each image are among these.
        pub plane_at: PlaneOffsets,
        /// Colour that `resolve` puts under the picture: `color = premultiplied + clear_color * (1 - alpha)`.
        pub clear_color: [f32; 4],
        /// Camera ray of image point (px, py), pixel centres at + 0.5: origin `ray_o + ray_o_lo + px * ray_o_x + py *
        /// ray_o_y`.
        pub ray_o: [f32; 3],
        /// Difference of the camera's position in f64 from `ray_o`, at most half an ulp of it.
        pub ray_o_lo: [f32; 3],
        /// Change of `ray_o` per pixel to the right.
        pub ray_o_x: [f32; 3],
        /// Change of `ray_o` per pixel up.
        pub ray_o_y: [f32; 3],
        /// Direction `ray_d + px * ray_d_x + py * ray_d_y`, of length 1 along the view axis, normalised by the pass.
        pub ray_d: [f32; 3],
        /// Change of `ray_d` per pixel to the right.
        pub ray_d_x: [f32; 3],
        /// Change of `ray_d` per pixel up.
        pub ray_d_y: [f32; 3],
        /// Lens x axis, world, times the lens radius.
        pub lens_u: [f32; 3],
        /// Lens y axis, world, times the lens radius.
        pub lens_v: [f32; 3],
        /// `Snapshot::origin`, which positions in the frame of the user's world are relative to, as two floats.
        pub origin: [f32; 3],
        /// What `origin` leaves of it.
        pub origin_lo: [f32; 3],
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
        /// Width in pixels of what is rendered: of film and planes. It is a window of the picture, often all of it.
        pub width: u32,
        /// Height in pixels of what is rendered.
        pub height: u32,
        /// Lower left pixel of that window in the picture. Image points and pixels that seed samples are those of the
        /// picture, so that a pixel gets the same in every window.
        pub window_x: u32,
        /// Row of that pixel.
        pub window_y: u32,
        /// Width of the picture in pixels.
        pub picture_width: u32,
        /// Height of the picture in pixels.
        pub picture_height: u32,
        /// Seed of the render.
        pub seed: u32,
        /// Indirect bounces; 0 = direct light only.
        pub max_bounces: u32,
        /// Bits of [`FrameFlags`].
        pub flags: u32,
        /// Largest number of threads of a round that trace its rays, rounded up to workgroups: if there are more rays,
        /// each thread takes several, one after the other.
        pub most_walkers: u32,
        /// Number of clipping planes at `clip_planes`.
        pub clip_plane_count: u32,
        /// Table of materials; 0 without `Features::MATERIALS`, as the next two.
        pub materials: u64,
        /// Table of prims, by prim id + 1.
        pub prims: u64,
        /// u32 material numbers, indexed by the slots of the prims.
        pub material_slots: u64,
        /// Table of textures; 0 without `Features::TEXTURES`, as the next.
        pub textures: u64,
        /// Page tables of the textures.
        pub texture_pages: u64,
        /// f32x2 per path: width of the ray's cone at its origin, and its growth per unit of length; 0 without
        /// `Features::TEXTURES`. 8-byte aligned.
        pub cones: u64,
        /// Albedo tables of the BSDF; 0 without `Features::MATERIALS`.
        pub bsdf_tables: u64,
        /// One [`crate::LightTablePointers`].
        pub lighting: u64,
        /// 16 B per path: the data about a ray's origin that lights need when a ray meets them; 0 if none needs them.
        pub light_paths: u64,
        /// Table of values as [`crate::GpuChunk::primvars`], by `GpuChunkInstance::row`; 0 without any.
        pub placed_values: u64,
        /// One [`AdaptiveSampling`]; 0 without `Features::ADAPTIVE`.
        pub adaptive: u64,
        /// One [`crate::TextureFeedback`]; 0 if all tiles are resident, and with `Features::STREAMING`.
        pub texture_feedback: u64,
        /// u32 in host memory, written while passes run: not 0 once the host has given the picture up, and rounds that
        /// have not begun are to be left out. 0 if the host never does, and with `Features::STREAMING`. 4-byte aligned.
        pub cancelled: u64,
        /// Programs of the materials; 0 without `Features::PATTERNS`.
        pub programs: u64,
        /// Tables of sheen; 0 without `Features::SHEEN`.
        pub sheen_tables: u64,
        /// One [`crate::GpuCameraMotion`] and its keys; 0 without `Features::CAMERA_MOTION`. 16-byte aligned.
        pub camera_motion: u64,
        /// [`ClipPlane`]s, `clip_plane_count` of them; 0 without `Features::CLIPPING`. 16-byte aligned.
        pub clip_planes: u64,
        /// u32 per path: the bounces of each kind so far, of [`crate::BOUNCE_KIND_BITS`] each, diffuse lowest, then
        /// specular, then transmission; the highest bit: the ray only looks for lights. 0 without
        /// `Features::BOUNCE_KINDS`. 4-byte aligned.
        pub bounce_kinds: u64,
        /// f32, [`FILTER_INTERVALS`] + 1 of them: pixels from the centre by random numbers in 0..1, for half of an axis
        /// (`oocpt_core::pixel_filter`); 0 without `Features::PIXEL_FILTER`. 4-byte aligned.
        pub pixel_filter: u64,
        /// Pixel x of a point = dot of this with (v, 1), v in view space, over that of `clip_w`.
        pub pixel_x: [f32; 4],
        /// Row that gives the pixel y of a point.
        pub pixel_y: [f32; 4],
        /// Factor of the film's colour in `resolve`.
        pub exposure: f32,
        /// Summand that keeps the relative error of a black pixel finite, in units of the film: 0.01 of the picture's.
        pub error_floor: f32,
        /// Most bounces of each kind of a path; only with `Features::BOUNCE_KINDS`.
        pub kind_limits: [u32; 3],
        /// Weight of a sample where the pixels' filter is positive, minus that where it is negative; only with
        /// `Features::PIXEL_FILTER`, as the next.
        pub filter_weight: f32,
        /// Random number for half of an axis from which on the filter is negative along it; above 1 if it never is.
        pub filter_negative_from: f32,
        /// Number of values that a sample has for filtered images, with those of ids; 0 without any.
        pub plane_words: u32,
        /// The first so many of these are summed.
        pub sum_words: u32,
        /// Number of ids, of two words each, that follow.
        pub id_count: u32,
        /// One [`crate::GpuPathAutomaton`]; 0 without `Features::PATH_EXPRESSIONS`, as the next three.
        pub automaton: u64,
        /// [`crate::GpuPathStates`] per path, of its closest ray. 8-byte aligned, as the next.
        pub path_states: u64,
        /// The same of its shadow ray, with what shines at its end.
        pub shadow_states: u64,
        /// f32x3 for each expression, every `light_stride` floats by path: the light of it that the path has met; then
        /// the floats of shadows (`Features::SHADOW_SUMS`), then the [`WAIT_WORDS`] of waits (`Features::LOAD_WAITS`).
        /// In core they are the last of `plane_values` that are summed; with `Features::STREAMING` they become so when
        /// the path ends.
        pub light_values: u64,
        /// Outputs of `resolve_planes`: f32x3 per pixel for each expression, as those of `aov`.
        pub light_images: [u64; 32],
        /// Outputs of `shade_aovs` or, of filtered images, `resolve_planes`: f32x4 per pixel for each primvar that is
        /// shown, as those of `aov`; none behind the first 0. Only with `Features::SHADED_AOVS`, as the next two.
        pub primvar_images: [u64; 4],
        /// Numbers of the names of these primvars; `NO_NAME` of those that no prim has.
        pub primvar_names: [u32; 4],
        /// The values of a sample at which they begin; `NO_INDEX` of those that are traced through pixel centres.
        pub primvar_at: [u32; 4],
        /// Floats from one path's `light_values` to the next one's.
        pub light_stride: u32,
        /// Number of expressions.
        pub light_count: u32,
        /// [`crate::PrimMask`]s by prim id + 1, four in each u32, the first lowest; 0 without `Features::PRIM_MASKS`.
        pub prim_masks: u64,
        /// Number of prims of `prim_masks`; those behind it have none of its bits.
        pub mask_count: u32,
        /// Floats of a path at `light_values`: three for each expression, then those of shadows and waits.
        pub light_words: u32,
        /// [`DeepSlot`], `deep_samples` of them for each [`crate::FilmPixel`]; 0 without `Features::DEEP`, as the next.
        /// Zero before the first wave.
        pub deep_slots: u64,
        /// Output of `resolve_deep`: as many per pixel, as those of `aov`.
        pub deep_image: u64,
        /// The first of the [`DEEP_WORDS`] words of a sample among the `plane_words`, behind all others.
        pub deep_at: u32,
        /// Most deep samples of a pixel.
        pub deep_samples: u32,
        /// Samples of one thing are one if their depths differ by less than this part of the smaller one,
        pub deep_tolerance: f32,
        /// or by less than this distance.
        pub deep_distance: f32,
        /// The first of the [`SHADOW_WORDS`] floats of a path at `light_values` for `AovTargets::shadow`; `NO_INDEX`
        /// without it, as the next.
        pub shadow_at: u32,
        /// The first of the [`CATCHER_WORDS`] floats for `AovTargets::shadow_catcher`.
        pub catcher_at: u32,
    }
}

/// Bytes of a [`PlaneSum`].
#[allow(clippy::cast_possible_truncation, reason = "the size of a struct")]
pub const PLANE_SUM_BYTES: u32 = size_of::<PlaneSum>() as u32;

/// Bytes of an [`IdSlot`].
#[allow(clippy::cast_possible_truncation, reason = "the size of a struct")]
pub const ID_SLOT_BYTES: u32 = size_of::<IdSlot>() as u32;

/// Bytes of a [`DeepSlot`].
#[allow(clippy::cast_possible_truncation, reason = "the constant 32 fits u32")]
pub const DEEP_SLOT_BYTES: u32 = size_of::<DeepSlot>() as u32;

/// Words of a sample for a deep image: prim id + 1, instance id, and the distance along the view axis as a float.
pub const DEEP_WORDS: u32 = 3;

/// Floats of a sample for shadows: light that its first shadow ray asks for, by channel, then what of it arrives.
pub const SHADOW_WORDS: u32 = 6;

/// Floats of a sample for shadow catchers: luminance that the shadow ray of a catcher asks for, what of it arrives, and
/// 1 if the sample met a catcher.
pub const CATCHER_WORDS: u32 = 3;

/// Floats of a sample for waits: how often its closest rays and materials waited for loads, and its shadow rays.
pub const WAIT_WORDS: u32 = 2;

/// Ids of a pixel that are kept while it is sampled; beyond these the one of the least weight gives way.
pub const ID_SLOTS: u32 = 16;

/// Primvars that are shown in a frame.
pub const MAX_SHOWN_PRIMVARS: u32 = 4;

/// Ids of a pixel in an image.
pub const ID_RANKS: u32 = 6;

/// Intervals of `FrameConstants::pixel_filter`.
pub const FILTER_INTERVALS: u32 = 512;

shared! {
    /// A clipping plane of the camera as a function of image point, lens point and distance along the ray, 32 B: at
    /// distance t, in units of the direction that goes one unit along the view axis, the ray is kept where
    /// `begins + t * slope >= 0`.
    #[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
    pub struct ClipPlane {
        /// `begins` at image point (0, 0), and its change per pixel to the right and up.
        pub begins: [f32; 3],
        /// Change of `begins`, and of `-slope * FrameConstants::focus`, by the lens point's x.
        pub lens_x: f32,
        /// `slope` at image point (0, 0), and its change per pixel to the right and up.
        pub slope: [f32; 3],
        /// Change by the lens y, as `lens_x` by its x.
        pub lens_y: f32,
    }
}

shared! {
    /// The samples of the paths of an epoch, with `Features::ADAPTIVE`. The film then has a [`crate::FilmPixel`] for
    /// each pixel of stream 0, followed by one for each of stream 1; `PushConstants::first_pixel` is an entry, and
    /// `PushConstants::first_sample` a row, with the band from bit 26 on.
    #[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Pod, Zeroable)]
    pub struct AdaptiveSampling {
        /// u32x2 each: number of the pixel in trace order, with the stream in the highest bit; first sample. 8-byte
        /// aligned.
        pub entries: u64,
        /// u32 by octave & 7, stream, pixel: estimates from the first `2^octave` samples, as two halves
        /// (`oocpt_core::adaptive::VarianceEstimate`).
        pub estimates: u64,
        /// Number of entries of each band.
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
