// SPDX-License-Identifier: Apache-2.0
// Closest hit of every ray of a bounce: one thread per ray, Counters::ray_args.
// Reads: rays[bounce & 1], the scene. Writes: hits of the rays that hit; pushes the ray's slot to surface_hits or
// escaped_rays.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "include/wavefront.glsl"
#include "include/queue.glsl"
#define ANY_HIT 0
#define OPACITY_MODE OPACITY_STOCHASTIC
#include "traversal/traverse.glsl"
#include "include/hit.glsl"
#include "include/opacity_seed.glsl"

void main() {
    const uint slot = thread_index();
    const bool in_range = slot < COUNTERS.ray_count[push.bounce & 1u];
    bool hit = false;
    if (in_range) {
        const Ray ray = load_ray(FRAME.rays[push.bounce & 1u], slot);
        Found found;
        hit = traverse(ray.o, ray.d, ray.t_max, opacity_seed(ray.path, 2u * push.bounce), found);
        if (hit) {
            store_hit_header(slot, found.uv, found.triangle, found_chain[0]);
            for (uint level = 1u; level < MAX_LEVELS; ++level) store_hit_level(slot, level, found_chain[level]);
        }
    }
    uint at;
    QUEUE_SLOT(at, surface_count, in_range && hit);
    if (in_range && hit) Uints(FRAME.surface_hits).v[at] = slot;
    QUEUE_SLOT(at, escaped_count, in_range && !hit);
    if (in_range && !hit) Uints(FRAME.escaped_rays).v[at] = slot;
}
