// SPDX-License-Identifier: Apache-2.0
// Closest hit of every ray of a round: one thread per ray, Counters::ray_args.
// Reads: ray_queue[round & 1], rays, the scene. Writes: hits of the rays that hit; pushes the path to surface_queue or
// escaped_queue.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "include/wavefront.glsl"
#include "include/queue.glsl"
#define ANY_HIT 0
#include "traversal/traverse.glsl"
#include "include/hit.glsl"
#include "include/opacity_seed.glsl"

void store_hit(uint path, Found found) {
    uvec3 first = uvec3(found_chain[0], 0u, 0u);
    if (MAX_LEVELS > 1u) first.y = found_chain[1u % MAX_LEVELS];
    if (MAX_LEVELS > 2u) first.z = found_chain[2u % MAX_LEVELS];
    store_hit_header(path, HitHeader(found.uv, found.triangle, found.chunk_instance, found.t), first);
    for (uint level = 3u; level < MAX_LEVELS; ++level) store_hit_level(path, level, found_chain[level]);
}

void main() {
    const uint at = thread_index();
    const bool in_range = at < COUNTERS.ray_count[push.round & 1u];
    bool hit = false;
    uint path = 0u;
    if (in_range) {
        path = ConstUints(FRAME.ray_queue[push.round & 1u]).v[at];
        const uint64_t ray = ray_address(path);
        const uint bounce = ConstUints(ray).v[3];
        Found found;
        hit = traverse(ray, ConstFloats(ray).v[7], opacity_seed(path, 2u * bounce), found);
        if (hit) store_hit(path, found);
    }
    uint to;
    QUEUE_SLOT(to, surface_count, in_range && hit);
    if (in_range && hit) Uints(FRAME.surface_queue).v[to] = path;
    QUEUE_SLOT(to, escaped_count, in_range && !hit);
    if (in_range && !hit) Uints(FRAME.escaped_queue).v[to] = path;
}
