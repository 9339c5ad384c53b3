// SPDX-License-Identifier: Apache-2.0
// The code of intersect_closest and settle_closest before and after a ray's walk: they differ in the queue, and in how
// cutouts are looked up. Before including, define what rays.glsl needs, with ANY_HIT as 0.
#ifndef OOCPT_CLOSEST_RAYS_GLSL
#define OOCPT_CLOSEST_RAYS_GLSL

#include "traversal/rays.glsl"
#include "traversal/opacity_seed.glsl"

void store_hit(uint path) {
    uvec3 first = uvec3(found_chain[0], 0u, 0u);
    if (MAX_LEVELS > 1u) first.y = found_chain[1u % MAX_LEVELS];
    if (MAX_LEVELS > 2u) first.z = found_chain[2u % MAX_LEVELS];
    store_hit_header(FRAME.hits, path, HitHeader(found.uv, found.triangle, found.chunk_instance, found.t), first);
    for (uint level = 3u; level < MAX_LEVELS; ++level) store_hit_level(FRAME.hits, path, level, found_chain[level]);
}

void load_hit(uint path) {
    const HitHeader hit = load_hit_header(FRAME.hits, path);
    found = Found(hit.t, hit.uv, hit.triangle, hit.chunk_instance);
    for (uint level = 0u; level < MAX_LEVELS; ++level) found_chain[level] = load_hit_level(FRAME.hits, path, level);
}

// Returns true if the path ends without a closest hit to find.
bool is_path_ended(uint path) {
    return HAS_ROULETTE && (ray_flags(ray_address(path)) & RAY_ENDED) != 0u;
}

void begin_ray(uint at) {
    const uint64_t queue = SETTLES == 1 ? FRAME.settle_queue[0] : FRAME.ray_queue[push.round & 1u];
    const uint entry = ConstUints(queue).v[at];
    const uint path = SETTLES == 1 ? entry & SETTLE_PATH : entry;
    if (is_path_ended(path)) {
        no_walk(path);
        return;
    }
    const uint64_t ray = ray_address(path);
    const uint flags = HAS_STREAMING ? ray_flags(ray) : 0u;
    if (HAS_PRIM_MASKS) walk.passing = passing_bit(ray);
    if (HAS_STREAMING && (flags & RAY_HIT) != 0u) load_hit(path);
    begin_walk(ray, path, ray_t_max(ray), opacity_seed(path, 2u * ray_bounce(ray)), flags);
    if (SETTLES == 1 && (entry & SETTLE_KEPT) != 0u) {
        if ((entry & SETTLE_HIT) != 0u) {
            load_hit(path);
            walk.hit = true;
        }
        stand_at_kept(0u, at);
    }
}

// Pushes finished paths and rays that wait.
void store_progress(uint path, bool ended) {
    const bool hit = walk.hit || walk.hit_before;
    const bool waits = ended && pending_count > 0u;
    uint bits = CLOSEST_DONE;
    if (ended) {
        bits |= is_path_ended(path) ? PATH_ENDS : hit ? CLOSEST_HIT : 0u;
        const uint flags = (hit ? RAY_HIT : 0u) | (walk.hit ? RAY_CHANGED : 0u);
        set_ray_flags(ray_address(path), flags | pending_flags());
    }
    if (waits) store_pending(path);
    push_deferred(path, waits);
    push_finished(path, ended && !waits ? finish(path, bits) : 0u);
    ADD_EACH(visits, ended ? walk.visits : 0u);
}

void end_ray(bool ended) {
    const uint path = walk.path;
    if (DEFERS_CUTOUTS) {
        const bool unsure = ended && walk.unsure < MAX_FLOAT && walk.unsure <= found.t;
        PUSH_UNSURE(0u, unsure, found.t);
        if (unsure && walk.hit) store_hit(path);
        ended = ended && !unsure;
    }
    if (ended && walk.hit) store_hit(path);
    if (HAS_STREAMING) {
        store_progress(path, ended);
        return;
    }
    uint to;
    QUEUE_SLOT(to, surface_count, ended && walk.hit);
    if (ended && walk.hit) Uints(FRAME.surface_queue).v[to] = path;
    QUEUE_SLOT(to, escaped_count, ended && !walk.hit);
    if (ended && !walk.hit) Uints(FRAME.escaped_queue).v[to] = path;
}

#endif
