// SPDX-License-Identifier: Apache-2.0
// Rays, paths, counters, film; jobs of instance trees. A part of abi.glsl.
#ifndef OOCPT_ABI_PATH_GLSL
#define OOCPT_ABI_PATH_GLSL

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
    uint in_shadow;
};

// A colour of 10 bits a channel (rust/abi/src/path.rs packs it).
vec3 unpack_color(uint color) {
    return vec3(uvec3(color, color >> 10, color >> 20) & 1023u) / 1023.0;
}

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
    uint busy_rounds;
    IndirectArgs trace_args;
    uint ray_next;
    uint shadow_next;
    IndirectArgs retire_args;
    uint retired_from;
    uint retired_to;
    uint settle_count[2];
    uint settle_next[2];
    IndirectArgs settle_args[2];
    uint nonfinite_pixel;
};

struct FilmPixel {
    vec4 sum;
    vec4 compensation;
    vec3 m2;
    uint samples;
    vec3 m2_compensation;
    uint pad0;
    vec3 earlier;
    uint pad1;
};

struct ErrorSums {
    float s;
    float d;
    float ss;
    float sd;
    float dd;
    float doubt;
    float worst;
    uint worst_pixel;
    uint pixels;
    uint fewest;
    uint most;
    uint pad;
};

#endif
