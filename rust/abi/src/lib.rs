// SPDX-License-Identifier: Apache-2.0
//! What host and compute shaders agree on, declared once: structs and the table of their layouts, flags, features,
//! constants, the tables of lobes, leaf kinds and light shapes, and the sampler.
//!
//! Guarantees: plain data and pure functions. No Vulkan, no shader compiler, no state: every crate may use it, the
//! build of the shaders too, which writes GLSL from it and compares the structs with the SPIR-V. Any thread.

#![forbid(unsafe_code)]

#[macro_use]
mod layout;

mod constants;
mod features;
mod film;
mod flags;
mod frame;
mod leaves;
mod light;
mod light_shapes;
mod lobes;
mod material;
mod node;
mod numbers;
mod path;
mod pattern;
mod push;
pub mod sampler;
mod scene;
mod stream;
mod texture;

pub use constants::CONSTANTS;
pub use features::{CarryRule, FEATURES, Feature, Features, SPEC_FEATURES, SPEC_FEATURES_HIGH};
pub use film::{ERROR_GROUPS, ErrorSums, FILM_PIXEL_BYTES, FilmPixel, aov_bytes};
pub use flags::{
    ABSENT, ASK, DONE, LEAF, LISTED, MaterialFlags, PathProgress, RAY_COUNT_SHIFT, RETURN, RayFlags, SHADOW_LINK_SHIFT,
    TABLE_COSINE, TABLE_ROUGHNESS, TAIL_SIDE, TILE_SIDE, flag_constants, pack_waiting, unpack_shadow_bounce,
    waiting_count,
};
pub use frame::{
    AOV_ESCAPED, AOV_SURFACES, Adaptive, AovClear, AovTargets, ClipPlane, Frame, FrameFlags, MAX_DIRECT_GROUPS,
    PREPARE_DEMAND, PREPARE_RESOLVE, PREPARE_SETTLE, PREPARE_SHADE, PREPARE_TRACE, SCAN_BLOCK, SCAN_BLOCKS, SCAN_SUMS,
    SPEC_MAX_LEVELS, SPEC_STACK_SIZE, WORKGROUP_SIZE, groups,
};
#[cfg(feature = "faults")]
pub use frame::{FAULT_ALL, FAULT_ONE_IN, SPEC_FAULT};
pub use layout::{LAYOUTS, MemberLayout, StructLayout};
pub use leaves::{LEAF_KINDS, LEAVES, Leaf, MESH_LEAF_MASK, MESH_LEAF_SHIFT};
pub use light::{
    GpuCdf, GpuInfiniteLight, GpuLightKind, GpuLightLeaf, GpuLightMap, GpuLightMesh, GpuLightNode, GpuLightShaping,
    GpuLightTriangle, GpuLightValue, GpuLocalLight, GpuMeshLight, LIGHT_KIND_MASK, LIGHT_LEAF, LIGHT_TREE_DEPTH,
    LightFlags, Lighting, MAP_FLOAT, MAP_HALF, NO_INDEX,
};
pub use light_shapes::{LIGHT_SHAPES, LightShape};
pub use lobes::{
    LOBE_ALONE, LOBES, LOBES_ADDED, LOBES_EVALUATED, Lobe, LobeNormal, LobePart, LobeSides, lobes_in_order,
};
pub use material::{
    GpuAttribute, GpuCutout, GpuInput, GpuMaterial, GpuPrim, GpuSurfaceMaterial, INPUT_CHANNEL_SHIFT, INPUT_CONSTANT,
    INPUT_NO_SET, INPUT_PLACED, INPUT_PRIMVAR, INPUT_PTEX, INPUT_REGISTER, INPUT_SET_SHIFT, INPUT_TEXTURE, MAX_PRIM_ID,
    NAME_FRAME_X, NAME_FRAME_Y, NAME_NORMAL, NAME_POSITION, NAME_PTEX, NO_MATERIAL, NO_NAME, SLOT_PRESENCE,
};
pub use node::{Bvh4Node, Child, LevelNode};
pub use numbers::{
    CULL_PAD, ENTRY_SCALE, FLOATS, GRAZING, HAIR_BY_NORMAL, LONGEST_FOOTPRINT, MASK_SET, MAX_LEVELS, MESH_PAD,
    MOST_ANISOTROPY, PTEX_STEPS, SECOND_SURFACE, SHARP_ROUGHNESS, SLAB_PAD, SLANT_MOST, TIME_SET, TOP_PAD,
};
pub use path::{
    Counters, IndirectArgs, PathState, RAY_BYTES, RAY_WORD_BOUNCE, RAY_WORD_FLAGS, RAY_WORD_IN_SHADOW, RAY_WORD_T_MAX,
    Ray, SHADOW_RAY_BYTES, ShadowRay, hit_stride, pack_color, unpack_color,
};
pub use pattern::{CUTOUT_LOOKUPS, MaterialInput, PROGRAM_REGISTERS, PatternGeometry, PatternOp};
pub use push::{
    BAND_SHIFT, ESTIMATE_FIRST, ESTIMATE_RING, PUSH_SEGMENT_SHIFT, Push, PushFlags, STREAM_BIT, STREAM_SEED, pack_band,
    unpack_band,
};
pub use scene::{
    AttributeRate, FLIPS_HANDEDNESS, GpuAssembly, GpuCameraKey, GpuCameraMotion, GpuChunk, GpuChunkInstance,
    GpuInstance, GpuLightKey, GpuMesh, GpuMotionKey, GpuPoint, GpuTriangle, MESH_KEYS_SHIFT, MeshFlags,
    NAME_DISPLAY_COLOR, NAME_DISPLAY_OPACITY, NO_ROW, NO_VALUE, POINT_BUNDLE, POINT_BYTES, SUBSET_MASK,
    TARGET_ASSEMBLY, TARGET_MOVING, TRIANGLE_BYTES,
};
pub use stream::{
    COUNTED_PATHS, GpuSurface, LIGHT_PATH_BYTES, MATERIAL_BIT, MAX_PENDING, NO_MESH, Pending, Question, Roulette,
    SEGMENT_WORD_ALIVE, SEGMENT_WORDS, SHADOW_BIT, Segment, Streaming, TILE_KEYS, UnitDemand, WORTH_MUST, WORTH_ONE,
    WORTH_SUMS, sort_blocks,
};
pub use texture::{
    GpuTexture, PAGE_BROKEN, TEXTURE_BORDER, TEXTURE_CHANNELS, TEXTURE_F16, TEXTURE_F32, TEXTURE_FORMAT_SHIFT,
    TEXTURE_PTEX, TEXTURE_SRGB, TEXTURE_U8, TEXTURE_UDIM, TEXTURE_WRAP_S_SHIFT, TEXTURE_WRAP_T_SHIFT, TextureFeedback,
    UDIM_PARTS, WRAP_BLACK, WRAP_CLAMP, WRAP_MIRROR, WRAP_REPEAT,
};
