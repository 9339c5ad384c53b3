// SPDX-License-Identifier: Apache-2.0
// Every struct that host and shaders share. The twin of rust/shader_abi/src/abi/*.rs, where the members are documented;
// the build compares names, offsets and sizes in the SPIR-V with the Rust structs. Addresses are uint64_t; see memory.glsl.
#ifndef OOCPT_ABI_GLSL
#define OOCPT_ABI_GLSL

#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference2 : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_EXT_control_flow_attributes : require

layout(constant_id = 0) const uint MAX_LEVELS = 1u;
layout(constant_id = 1) const uint STACK_SIZE = 64u;
layout(constant_id = 2) const uint FEATURES = 0xffffffffu;

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
const bool HAS_CUTOUTS = (FEATURES & (1u << 13)) != 0u && HAS_MATERIALS;
const bool HAS_TRANSMISSION = (FEATURES & (1u << 14)) != 0u && HAS_MATERIALS;
const bool HAS_COAT = (FEATURES & (1u << 15)) != 0u && HAS_MATERIALS;
const bool HAS_SHEEN = (FEATURES & (1u << 16)) != 0u && HAS_MATERIALS;
const bool HAS_LOCAL_LIGHTS = (FEATURES & (1u << 17)) != 0u;
const bool HAS_SHAPING = (FEATURES & (1u << 18)) != 0u;
const bool HAS_IES = (FEATURES & (1u << 19)) != 0u && HAS_SHAPING;
const bool HAS_DOME_TEXTURE = (FEATURES & (1u << 20)) != 0u && HAS_DOME;
const bool HAS_LIGHT_LINKS = (FEATURES & (1u << 21)) != 0u;
const bool HAS_EMISSION = (FEATURES & (1u << 22)) != 0u && HAS_MATERIALS;
const bool HAS_INSTANCE_PRIMVARS = (FEATURES & (1u << 23)) != 0u && HAS_MATERIALS;
const bool HAS_LIGHT_TABLE = (FEATURES & (1u << 25)) != 0u;
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
const uint AOV_SURFACES = 0u;
const uint AOV_ESCAPED = 1u;
const uint PUSH_AOVS = 1u;
const uint PUSH_FRESH = 2u;
const uint PUSH_SEGMENT_SHIFT = 8u;
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

const uint NO_MATERIAL = 0xffffffffu;
const uint SLOT_PRESENCE = 1u << 31;
const uint NO_NAME = 0xffffffffu;
const uint MAX_PRIM_ID = 1u << 24;
const uint INPUT_CONSTANT = 0u;
const uint INPUT_TEXTURE = 1u;
const uint INPUT_PRIMVAR = 2u;
const uint INPUT_CHANNEL_SHIFT = 2u;
const uint INPUT_SET_SHIFT = 5u;
const uint INPUT_NO_SET = 2u;

struct Push {
    uint64_t frame;
    uint first_pixel;
    uint first_sample;
    uint path_count;
    uint round;
    uint arg0;
    uint flags;
};

struct AovTargets {
    uint64_t depth;
    uint64_t camera_depth;
    uint64_t prim_id;
    uint64_t instance_id;
    uint64_t element_id;
    uint64_t normal;
    uint64_t neye;
    uint64_t albedo;
};

struct AovClear {
    float depth;
    float camera_depth;
    int prim_id;
    int instance_id;
    int element_id;
    vec3 normal;
    vec3 neye;
    vec3 albedo;
};

struct Frame {
    uint64_t top_nodes;
    uint64_t chunk_instances;
    uint64_t chunks;
    uint64_t assemblies;
    uint64_t meshes;
    uint64_t lights;
    uint64_t rays;
    uint64_t shadow_rays;
    uint64_t hits;
    uint64_t paths;
    uint64_t radiance;
    uint64_t ray_queue[2];
    uint64_t shadow_queue;
    uint64_t surface_queue;
    uint64_t escaped_queue;
    uint64_t streaming;
    uint64_t counters;
    uint64_t film;
    uint64_t color;
    AovTargets aov;
    AovClear aov_clear;
    vec4 clear_color;
    vec3 ray_o;
    vec3 ray_o_lo;
    vec3 ray_o_x;
    vec3 ray_o_y;
    vec3 ray_d;
    vec3 ray_d_x;
    vec3 ray_d_y;
    vec3 lens_u;
    vec3 lens_v;
    float focus;
    vec4 clip_z;
    vec4 clip_w;
    vec4 view[3];
    vec3 view_normal[3];
    vec3 dome_radiance;
    vec3 dome_background;
    float dome_select;
    vec3 default_albedo;
    float clamp;
    uint width;
    uint height;
    uint seed;
    uint max_bounces;
    uint light_count;
    uint flags;
    uint64_t materials;
    uint64_t prims;
    uint64_t material_slots;
    uint64_t textures;
    uint64_t texture_pages;
    uint64_t cones;
    uint64_t bsdf_tables;
    uint64_t lighting;
    uint64_t light_paths;
};

struct Streaming {
    uint64_t segments;
    uint64_t progress;
    uint64_t pending;
    uint64_t shadow_pending;
    uint64_t surfaces;
    uint64_t deferred[2];
    uint64_t demand;
    uint64_t sort_counts;
    uint64_t sort_sums;
    uint64_t chunk_rays;
    uint64_t places;
    uint64_t free_slots;
    uint64_t surface_materials;
    uint64_t questions;
    uint64_t shadow_questions;
    uint64_t resolve_queue;
    uint64_t resolved;
    uint64_t resolve_progress;
    uint segment_size;
    uint chunk_count;
    uint slots;
    uint unit_count;
    uint lookups;
    uint pad;
};

struct Segment {
    uint first_pixel;
    uint first_sample;
    uint count;
    uint alive;
};

struct Pending {
    float entry[4];
    uint chunk_instance[4];
};

struct Question {
    float t;
    uint id;
    uint chunk_instance;
    uint flags;
    vec4 mean;
    uint texture;
    vec2 st;
    float footprint;
    float scale;
    float bias;
    float limit;
    uint unit;
};

struct GpuSurface {
    vec3 position;
    float offset;
    vec3 position_lo;
    int prim_id;
    vec3 geometric_normal;
    uint instance_id;
    vec3 shading_normal;
    uint face;
    vec3 albedo;
    float cone;
};

struct GpuNode {
    vec3 min[2];
    vec3 max[2];
    uint child[2];
    uint count[2];
};

struct GpuTriangle {
    vec3 v0;
    uint face;
    vec3 v1;
    uint pad1;
    vec3 v2;
    uint pad2;
};

struct GpuInstance {
    vec4 object_from_parent[3];
    uint target;
    int prim_id;
    uint index_in_prototype;
    uint prototype_count;
};

struct GpuMesh {
    uint64_t nodes;
    uint64_t triangles;
    uint64_t corner_indices;
    uint64_t normals;
    uint64_t colors;
    uint64_t opacities;
    uint flags;
    uint triangle_count;
    uint64_t primvars;
    uint primvar_count;
    uint pad;
};

struct GpuInput {
    vec4 value;
    vec4 bias;
    vec3 row_s;
    uint kind;
    vec3 row_t;
    uint texture;
};

struct GpuMaterial {
    GpuInput inputs[10];
    uint flags;
    float opacity_threshold;
    uint names[4];
    vec2 set_fallback[2];
    uint pad[2];
};

struct GpuPrim {
    uint first_slot;
    uint slot_count;
    uint link_set;
    uint pad;
};

struct GpuAttribute {
    uint64_t values;
    uint name;
    uint rate_and_width;
};

struct GpuSurfaceMaterial {
    vec2 uv[2];
    vec4 primvars[2];
    vec3 tangent;
    uint material;
    vec2 uv_density;
    float handedness;
    uint flags;
};

struct GpuAssembly {
    uint64_t nodes;
    uint64_t instances;
};

struct GpuChunk {
    uint64_t nodes;
    uint64_t instances;
};

struct GpuChunkInstance {
    vec4 chunk_from_world[3];
    vec3 origin_lo;
    uint chunk;
    uint instance_id;
    uint pad[3];
};

struct GpuLight {
    vec3 direction;
    float one_minus_cos;
    vec3 radiance;
    float probability;
    float cumulative;
};

// Bits of GpuTexture::flags.
const uint TEXTURE_CHANNELS = 7u;
const uint TEXTURE_FORMAT_SHIFT = 4u;
const uint TEXTURE_U8 = 0u;
const uint TEXTURE_F16 = 1u;
const uint TEXTURE_F32 = 2u;
const uint TEXTURE_SRGB = 1u << 6;
const uint TEXTURE_UDIM = 1u << 7;
const uint TEXTURE_WRAP_S_SHIFT = 8u;
const uint TEXTURE_WRAP_T_SHIFT = 10u;
const uint WRAP_BLACK = 0u;
const uint WRAP_CLAMP = 1u;
const uint WRAP_REPEAT = 2u;
const uint WRAP_MIRROR = 3u;

struct GpuTexture {
    uint64_t decode;
    uint first_page;
    uint flags;
    uint width;
    uint height;
    uint levels;
    float texels;
    vec4 fallback;
};

struct Lighting {
    uint64_t local_lights;
    uint64_t nodes;
    uint64_t infinite_lights;
    uint64_t shapings;
    uint64_t ies;
    uint64_t maps;
    uint64_t link_bits;
    uint64_t prim_sets;
    uint infinite_count;
    uint link_words;
    float local_share;
    uint prim_count;
};

struct GpuLocalLight {
    vec3 position;
    uint flags;
    vec3 position_lo;
    float determinant;
    vec3 x;
    uint shaping;
    vec3 y;
    uint map;
    vec3 z;
    uint light_link;
    vec3 row_x;
    uint shadow_link;
    vec3 row_y;
    float diffuse;
    vec3 row_z;
    float specular;
    vec3 radiance;
    uint shadow_color;
};

struct GpuInfiniteLight {
    vec3 direction;
    float one_minus_cos;
    vec3 radiance;
    float probability;
    float cumulative;
    float diffuse;
    float specular;
    uint flags;
    uint map;
    uint light_link;
    uint shadow_link;
    uint shadow_color;
};

struct GpuLightNode {
    vec3 min[2];
    vec3 max[2];
    vec3 axis[2];
    float cos_axis[2];
    float cos_emission[2];
    float power[2];
    uint child[2];
    uint pad[2];
};

struct GpuLightShaping {
    vec3 axis;
    float cone_angle;
    vec3 x;
    float smooth_start;
    vec3 y;
    float focus;
    vec3 focus_tint;
    uint ies;
    float angle_scale;
    float ies_scale;
    uint pad[2];
};

struct GpuLightMap {
    uint64_t texels;
    uint64_t alias;
    uint width;
    uint height;
    uint columns;
    uint rows;
    vec3 x;
    uint format;
    vec3 y;
    uint pad0;
    vec3 z;
    uint pad1;
};

struct GpuAlias {
    uint other;
    float threshold;
    float density;
};

struct Ray {
    vec3 o;
    uint bounce;
    vec3 d;
    float t_max;
    vec3 o_lo;
    uint flags;
};

struct PathState {
    vec3 throughput;
    float pdf;
};

struct ShadowRay {
    vec3 o;
    uint bounce;
    vec3 d;
    float t_max;
    vec3 o_lo;
    uint flags;
    vec3 contribution;
    uint pad;
};

struct IndirectArgs {
    uint x;
    uint y;
    uint z;
};

struct Counters {
    uint64_t closest_rays;
    uint64_t shadow_rays;
    uint64_t chunk_visits;
    uint64_t chunk_misses;
    uint nonfinite;
    uint stack_overflows;
    uint ray_count[2];
    uint surface_count;
    uint escaped_count;
    uint shadow_count;
    uint deferred_parity;
    uint deferred_count[2];
    uint visits;
    uint misses;
    uint resumed_rays;
    uint resumed_shadows;
    uint ray_base;
    uint shadow_base;
    IndirectArgs ray_args;
    IndirectArgs surface_args;
    IndirectArgs escaped_args;
    IndirectArgs shadow_args;
    IndirectArgs deferred_args;
    uint freed;
    uint tile_misses;
    uint resolve_count;
    uint resolve_base;
    IndirectArgs resolve_args;
};

struct FilmPixel {
    vec4 sum;
    vec4 compensation;
    vec3 m2;
    uint samples;
};

struct LbvhBounds {
    vec3 min;
    vec3 max;
};

struct LbvhPush {
    uint64_t bounds;
    uint64_t keys_in;
    uint64_t keys_out;
    uint64_t items_in;
    uint64_t items_out;
    uint64_t histogram;
    uint64_t nodes;
    uint64_t parents;
    uint64_t visits;
    uint64_t depth;
    vec3 origin;
    vec3 scale;
    uint count;
    uint shift;
    uint groups;
    uint pad;
};

#endif
