// SPDX-License-Identifier: Apache-2.0
// What a frame and its passes are given, and what streaming keeps of paths. A part of abi.glsl.
#ifndef OOCPT_ABI_FRAME_GLSL
#define OOCPT_ABI_FRAME_GLSL

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
    uint64_t motion;
    uint64_t sample_count;
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
    vec3 motion;
    uint pad;
};

struct Frame {
    uint64_t top_nodes;
    uint64_t chunk_instances;
    uint64_t chunks;
    uint64_t assemblies;
    uint64_t meshes;
    uint64_t rays;
    uint64_t shadow_rays;
    uint64_t hits;
    uint64_t paths;
    uint64_t radiance;
    uint64_t ray_queue[2];
    uint64_t shadow_queue;
    uint64_t surface_queue;
    uint64_t escaped_queue;
    uint64_t settle_queue[2];
    uint64_t settle_hits[2];
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
    vec3 default_albedo;
    float clamp;
    uint width;
    uint height;
    uint seed;
    uint max_bounces;
    uint flags;
    uint most_walkers;
    uint clip_plane_count;
    uint64_t materials;
    uint64_t prims;
    uint64_t material_slots;
    uint64_t textures;
    uint64_t texture_pages;
    uint64_t cones;
    uint64_t bsdf_tables;
    uint64_t lighting;
    uint64_t light_paths;
    uint64_t placed_values;
    uint64_t adaptive;
    uint64_t texture_feedback;
    uint64_t programs;
    uint64_t sheen_tables;
    uint64_t camera_motion;
    uint64_t clip_planes;
    vec4 pixel_x;
    vec4 pixel_y;
    float exposure;
    float error_floor;
};

struct ClipPlane {
    vec3 begins;
    float lens_x;
    vec3 slope;
    float lens_y;
};

struct TextureFeedback {
    uint64_t requested;
    uint64_t incomplete_paths;
    uint64_t wanted;
    uint wanted_capacity;
    uint wanted_count;
    uint is_incomplete;
    uint pad;
};

struct Adaptive {
    uint64_t entries;
    uint64_t estimates;
    uint width[32];
};

struct Streaming {
    uint64_t segments;
    uint64_t progress;
    uint64_t pending;
    uint64_t shadow_pending;
    uint64_t surfaces;
    uint64_t deferred[2];
    uint64_t demand;
    uint64_t demand_counts;
    uint64_t demanded;
    uint64_t demand_list;
    uint64_t sort_counts;
    uint64_t sort_sums;
    uint64_t unit_rays;
    uint64_t places;
    uint64_t ended_radiance;
    uint64_t free_slots;
    uint64_t surface_materials;
    uint64_t questions;
    uint64_t shadow_questions;
    uint64_t resolve_queue;
    uint64_t resolved;
    uint64_t resolve_progress;
    uint64_t roulette;
    uint64_t worth;
    uint64_t worth_sums;
    uint64_t verdicts[2];
    uint segment_size;
    uint chunk_count;
    uint slots;
    uint unit_count;
    uint lookups;
    uint segment_count;
    uint demanded_capacity;
    uint demand_capacity;
    uint first_tile;
    uint unused;
};

struct UnitDemand {
    uint unit;
    uint waiting;
    uint next;
    uint partner;
};

struct Roulette {
    float mean;
    float second_moment;
    uint ended_paths;
    uint ended_shadows;
    float variance;
    uint looks;
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
    float record_entry[4];
    uint mesh[4];
};

struct Question {
    float t;
    uint id;
    uint chunk_instance;
    uint flags;
    vec4 mean;
    uint texture;
    vec2 st;
    float width;
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

#endif
