// SPDX-License-Identifier: Apache-2.0
// Specialisation constants, features and other numbers that host and shaders share. A part of abi.glsl.
#ifndef OOCPT_ABI_CONSTANTS_GLSL
#define OOCPT_ABI_CONSTANTS_GLSL

layout(constant_id = 0) const uint MAX_LEVELS = 1u;
layout(constant_id = 1) const uint STACK_SIZE = 64u;
layout(constant_id = 2) const uint FEATURES = 0xffffffffu;
layout(constant_id = 3) const uint LOBES = 0u; // of the BSDF, beyond FEATURES
layout(constant_id = 4) const uint FEATURES_HIGH = 0u; // bits 32 to 63

const bool HAS_DOME = (FEATURES & 1u) != 0u;
const bool HAS_DISTANT = (FEATURES & 2u) != 0u;
const bool HAS_OPACITY = (FEATURES & 4u) != 0u;
const bool HAS_NORMALS = (FEATURES & 8u) != 0u;
const bool HAS_COLORS = (FEATURES & 16u) != 0u;
const bool HAS_LENS = (FEATURES & 32u) != 0u;
const bool HAS_INSTANCING = (FEATURES & 64u) != 0u && MAX_LEVELS > 1u;
const bool HAS_DOME_SHADOW_RAYS = (FEATURES & 128u) != 0u && HAS_DOME;

const bool HAS_STREAMING = (FEATURES & 256u) != 0u;
const bool HAS_CHUNK_COUNTS = (FEATURES & 512u) != 0u && HAS_STREAMING;
const bool PLANT_SKIP_DEFERRED = (FEATURES & 1024u) != 0u;
const bool HAS_MATERIALS = (FEATURES & (1u << 11)) != 0u;
const bool HAS_TEXTURES = (FEATURES & (1u << 12)) != 0u && HAS_MATERIALS;
const bool HAS_PTEX = (FEATURES_HIGH & 1u) != 0u && HAS_TEXTURES;
const bool HAS_CUTOUTS = (FEATURES & (1u << 13)) != 0u && HAS_MATERIALS;
const bool HAS_TRANSMISSION = (FEATURES & (1u << 14)) != 0u && HAS_MATERIALS;
const bool HAS_ROUGH_TRANSMISSION = (FEATURES & (1u << 28)) != 0u && HAS_TRANSMISSION;
const bool HAS_COAT = (FEATURES & (1u << 15)) != 0u && HAS_MATERIALS;
const bool HAS_SHEEN = (LOBES & 1u) != 0u && HAS_MATERIALS;
const bool HAS_LOCAL_LIGHTS = (FEATURES & (1u << 17)) != 0u;
const bool HAS_SHAPING = (FEATURES & (1u << 18)) != 0u;
const bool HAS_IES = (FEATURES & (1u << 19)) != 0u && HAS_SHAPING;
const bool HAS_DOME_TEXTURE = (FEATURES & (1u << 20)) != 0u && HAS_DOME;
const bool HAS_LIGHT_LINKS = (FEATURES & (1u << 21)) != 0u;
const bool HAS_INSTANCE_PRIMVARS = (FEATURES & (1u << 23)) != 0u;
const bool HAS_INSTANCE_OPACITY = (FEATURES & (1u << 16)) != 0u && HAS_INSTANCE_PRIMVARS && HAS_OPACITY;
const bool HAS_EMISSION = (FEATURES & (1u << 22)) != 0u && HAS_MATERIALS;
const bool HAS_LIGHT_TABLE = (FEATURES & (1u << 25)) != 0u;
const bool HAS_MESH_LIGHTS = (FEATURES & (1u << 27)) != 0u && HAS_EMISSION;
const bool HAS_ROULETTE = (FEATURES & (1u << 26)) != 0u && HAS_STREAMING;
const bool HAS_MESH_LIGHT_VALUES = (FEATURES & (1u << 29)) != 0u && HAS_MESH_LIGHTS;
const bool HAS_ADAPTIVE = (FEATURES & (1u << 30)) != 0u;
const bool HAS_LIGHT_LOBES = (FEATURES & (1u << 31)) != 0u;
const bool HAS_LIGHT_TEXTURE = (FEATURES & (1u << 24)) != 0u && HAS_LOCAL_LIGHTS;

const uint LIGHT_RECT = 0u;
const uint LIGHT_DISK = 1u;
const uint LIGHT_SPHERE = 2u;
const uint LIGHT_CYLINDER = 3u;
const uint LIGHT_POINT = 4u;
const uint LIGHT_LINE = 5u;
const uint LIGHT_DISTANT = 6u;
const uint LIGHT_DOME = 7u;
const uint LIGHT_DOME_MAP = 8u;
const uint LIGHT_KIND_MASK = 15u;
const uint LIGHT_CAMERA_VISIBLE = 16u;
const uint LIGHT_NO_SHADOWS = 32u;
const uint LIGHT_SHADOW_COLOR = 64u;
const uint LIGHT_SHADOW_LINK = 128u;
const uint LIGHT_LEAF = 1u << 31;
const uint LIGHT_TREE_DEPTH = 44u;
const uint MAP_HALF = 0u;
const uint MAP_FLOAT = 1u;

const uint FLAG_DOME_CAMERA_VISIBLE = 1u;
const uint PREPARE_TRACE = 0u;
const uint PREPARE_SHADE = 1u;
const uint PREPARE_DEMAND = 2u;
const uint PREPARE_RESOLVE = 3u;
const uint SCAN_BLOCKS = 0u;
const uint SCAN_SUMS = 1u;
const uint SCAN_BLOCK = 1024u;
const uint TILE_KEYS = 256u;
const uint WORTH_ONE = 4096u;
const uint WORTH_MUST = 1u << 31;
const uint WORTH_SUMS = 1u << 20;
const uint AOV_SURFACES = 0u;
const uint AOV_ESCAPED = 1u;
const uint PUSH_AOVS = 1u;
const uint PUSH_FRESH = 2u;
const uint PUSH_RETRACE = 4u;
const uint PUSH_SEGMENT_SHIFT = 8u;
const uint BAND_SHIFT = 26u;
const uint STREAM_BIT = 1u << 31;
const uint STREAM_SEED = 0x5bd1e995u;
const uint SAID_RING = 8u;
const uint SAID_FIRST = 3u;
const uint MAX_DIRECT_GROUPS = 1u << 15;
const uint WORKGROUP_SIZE = 64u;

const uint TARGET_ASSEMBLY = 1u << 31;
const uint RATE_CONSTANT = 0u;
const uint RATE_UNIFORM = 1u;
const uint RATE_VERTEX = 2u;
const uint RATE_FACE_VARYING = 3u;
const uint MESH_LEFT_HANDED = 1u << 9;
const uint MESH_HAS_NORMALS = 1u << 10;
const uint MESH_HAS_COLORS = 1u << 11;
const uint MESH_HAS_OPACITIES = 1u << 12;

const uint SUBSET_MASK = 0xffffu; // of GpuTriangle::subset_and_sides
const uint NO_MATERIAL = 0xffffffffu;
const uint SLOT_PRESENCE = 1u << 31;
const uint NO_NAME = 0xffffffffu;
const uint NAME_PTEX = 0xfffffffeu; // in place of a primvar's: Ptex coordinates
const uint NAME_DISPLAY_COLOR = 0u;
const uint NAME_DISPLAY_OPACITY = 1u;
const uint NO_VALUE = 0x7fc00000u;
const uint NO_ROW = 0xffffffffu;
const uint MAX_PRIM_ID = 1u << 24;
const uint INPUT_CONSTANT = 0u;
const uint INPUT_TEXTURE = 1u;
const uint INPUT_PRIMVAR = 2u;
const uint INPUT_CHANNEL_SHIFT = 2u;
const uint INPUT_SET_SHIFT = 5u;
const uint INPUT_NO_SET = 2u;
const uint INPUT_PTEX = 1u << 7;

#endif
