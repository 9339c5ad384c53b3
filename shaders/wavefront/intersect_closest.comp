// SPDX-License-Identifier: Apache-2.0
// Closest hit of every ray of a round: one thread per ray, Counters::ray_args.
// Reads: ray_queue[round & 1], rays, the scene. Writes: hits of the rays that hit; pushes the path to surface_queue or
// escaped_queue. With streaming also: rays (flags), pending, progress; pushes to deferred, and to the other two queues only when the path's
// shadow ray has finished too.
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

void load_hit(uint path, out Found found) {
    const HitHeader hit = load_hit_header(path);
    found = Found(hit.t, hit.uv, hit.triangle, hit.chunk_instance);
    for (uint level = 0u; level < MAX_LEVELS; ++level) found_chain[level] = load_hit_level(path, level);
}

// Pushes finished paths and rays that wait; `hit` is the one so far, `changed` tells whether this round found it, `ended` that there
// is none to find: the path ends.
void store_progress(uint path, bool in_range, bool hit, bool changed, bool ended) {
    const bool waits = in_range && pending_count > 0u;
    if (in_range) {
        const uint flags = (hit ? RAY_HIT : 0u) | (changed ? RAY_CHANGED : 0u);
        Uints(ray_address(path)).v[11] = flags | pending_flags();
    }
    if (waits) store_pending(path);
    push_deferred(path, waits);
    const uint found = ended ? PATH_ENDS : hit ? CLOSEST_HIT : 0u;
    push_finished(path, in_range && !waits ? finish(path, CLOSEST_DONE | found) : 0u);
    ADD_EACH(visits, in_range ? walk.visits : 0u);
}

void main() {
    const uint at = thread_index();
    const bool in_range = at < COUNTERS.ray_count[push.round & 1u];
    bool hit = false;
    bool changed = false;
    bool ended = false;
    uint path = 0u;
    if (in_range) {
        path = ConstUints(FRAME.ray_queue[push.round & 1u]).v[at];
        const uint64_t ray = ray_address(path);
        const uint bounce = ConstUints(ray).v[3];
        const uint flags = HAS_STREAMING ? ConstUints(ray).v[11] : 0u;
        ended = HAS_ROULETTE && (flags & RAY_ENDED) != 0u;
        if (ended) {
            no_walk();
        } else {
            Found found;
            if (HAS_STREAMING && (flags & RAY_HIT) != 0u) load_hit(path, found);
            changed = traverse(ray, path, ConstFloats(ray).v[7], opacity_seed(path, 2u * bounce), flags, found);
            hit = changed || (HAS_STREAMING && walk.hit_before);
            if (changed) store_hit(path, found);
        }
    }
    if (HAS_STREAMING) {
        store_progress(path, in_range, hit, changed, ended);
        return;
    }
    uint to;
    QUEUE_SLOT(to, surface_count, in_range && hit);
    if (in_range && hit) Uints(FRAME.surface_queue).v[to] = path;
    QUEUE_SLOT(to, escaped_count, in_range && !hit);
    if (in_range && !hit) Uints(FRAME.escaped_queue).v[to] = path;
}
