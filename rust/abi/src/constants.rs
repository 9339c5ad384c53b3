// SPDX-License-Identifier: Apache-2.0
//! The constants that host and shaders share, by their names in the shaders. The build writes a `const uint` of each.

use super::*;

/// Declares [`CONSTANTS`]: a constant of this crate by its own name, or `NAME = value`.
macro_rules! constants {
    (@value $name:ident) => { $name };
    (@value $name:ident = $value:expr) => { $value };
    ($($(#[$only:meta])* $name:ident $(= $value:expr)?;)+) => {
        /// Name and value of every `const uint` that the build writes for the shaders.
        pub const CONSTANTS: &[(&str, u32)] =
            &[$($(#[$only])* (stringify!($name), constants!(@value $name $(= $value)?)),)+];
    };
}

constants! {
    LIGHT_DISTANT = GpuLightKind::Distant as u32;
    LIGHT_DOME = GpuLightKind::Dome as u32;
    LIGHT_DOME_MAP = GpuLightKind::DomeMap as u32;
    LIGHT_KIND_MASK;
    LIGHT_LEAF;
    LIGHT_TREE_DEPTH;
    NO_INDEX;
    MAP_HALF;
    MAP_FLOAT;

    PREPARE_TRACE;
    PREPARE_SHADE;
    PREPARE_DEMAND;
    PREPARE_RESOLVE;
    PREPARE_SETTLE;
    SCAN_BLOCKS;
    SCAN_SUMS;
    SCAN_BLOCK;
    TILE_KEYS;
    WORTH_ONE;
    WORTH_MUST;
    WORTH_SUMS;
    AOV_SURFACES;
    AOV_ESCAPED;
    PUSH_SEGMENT_SHIFT;
    RAY_BYTES;
    SHADOW_RAY_BYTES;
    BOUNCE_KIND_BITS;
    EVENT_COUNT;
    STATES_OF_ALL;
    EVENT_LIGHT = PathEvent::Light as u32;
    EVENT_DOME = PathEvent::Dome as u32;
    EVENT_SURFACE = PathEvent::Surface as u32;
    EVENT_GLOSSY = PathEvent::GlossyReflection as u32;
    EVENT_SHARP = PathEvent::SharpReflection as u32;
    EVENT_TRANSMITS = PathEvent::DiffuseTransmission as u32;
    PATH_STATES_BYTES;
    RAY_COUNT_SHIFT;
    SHADOW_LINK_SHIFT;
    RAY_KIND_SHIFT;
    SHADOW_BIT;
    MATERIAL_BIT;
    MAX_PENDING;
    NO_MESH;
    COUNTED_PATHS;
    SEGMENT_WORDS;
    SEGMENT_WORD_ALIVE;
    LEAF;
    LISTED;
    ASK;
    RETURN;
    DONE;
    ABSENT;
    REFIT_THREADS;
    REFIT_CHANGED_WORDS;
    ALL_CHANGED;
    REFIT_LEVELS;
    MEMBER_INSTANCED;
    MEMBER_AFTER;
    MEMBER_HALVES;
    FILM_PIXEL_BYTES;
    PLANE_SUM_BYTES;
    ID_SLOT_BYTES;
    DEEP_SLOT_BYTES;
    ID_SLOTS;
    WAIT_WORDS;
    ID_RANKS;
    MAX_SHOWN_PRIMVARS;
    ERROR_SUMS_BYTES;
    ERROR_GROUPS;
    EXACT_SUM_BIAS;
    EXACT_ALPHA_BITS;
    MAX_EXACT_ALPHA;
    EXACT_LOWEST_BITS;
    FILTER_INTERVALS;
    RAY_WORD_BOUNCE;
    RAY_WORD_T_MAX;
    RAY_WORD_FLAGS;
    RAY_WORD_IN_SHADOW;
    BAND_SHIFT;
    STREAM_BIT;
    STREAM_SEED;
    ESTIMATE_RING;
    ESTIMATE_FIRST;
    MAX_DIRECT_GROUPS;
    WORKGROUP_SIZE;
    #[cfg(feature = "faults")]
    FAULT_ONE_IN;
    #[cfg(feature = "faults")]
    FAULT_ALL;

    TIME_SET;
    TARGET_ASSEMBLY;
    TARGET_MOVING;
    RATE_CONSTANT = AttributeRate::Constant as u32;
    RATE_UNIFORM = AttributeRate::Uniform as u32;
    RATE_VERTEX = AttributeRate::Vertex as u32;
    RATE_FACE_VARYING = AttributeRate::FaceVarying as u32;
    MESH_KEYS_SHIFT;
    MESH_LEAF_SHIFT;
    MESH_LEAF_MASK;
    POINT_BUNDLE;
    POINT_BYTES;
    TRIANGLE_BYTES;
    FLIPS_HANDEDNESS;
    SECOND_SURFACE;
    MASK_SET;

    SUBSET_MASK;
    NO_MATERIAL;
    SLOT_PRESENCE;
    NO_NAME;
    NAME_PTEX;
    NAME_POSITION;
    NAME_NORMAL;
    NAME_FRAME_X;
    NAME_FRAME_Y;
    NAME_DISPLAY_COLOR;
    NAME_DISPLAY_OPACITY;
    NO_VALUE;
    NO_ROW;
    MAX_PRIM_ID;
    INPUT_CONSTANT;
    INPUT_TEXTURE;
    INPUT_PRIMVAR;
    INPUT_CHANNEL_SHIFT;
    INPUT_SET_SHIFT;
    INPUT_NO_SET;
    INPUT_PTEX;
    INPUT_REGISTER;
    INPUT_PLACED;
    CUTOUT_LOOKUPS;
    PROGRAM_REGISTERS;

    TILE_SIDE;
    TAIL_SIDE;
    TABLE_COSINE;
    TABLE_ROUGHNESS;
    TEXTURE_CHANNELS;
    TEXTURE_FORMAT_SHIFT;
    TEXTURE_U8;
    TEXTURE_F16;
    TEXTURE_F32;
    TEXTURE_SRGB;
    TEXTURE_UDIM;
    TEXTURE_PTEX;
    TEXTURE_BORDER;
    TEXTURE_WRAP_S_SHIFT;
    TEXTURE_WRAP_T_SHIFT;
    WRAP_BLACK;
    WRAP_CLAMP;
    WRAP_REPEAT;
    WRAP_MIRROR;
    PAGE_BROKEN = 1;
}
