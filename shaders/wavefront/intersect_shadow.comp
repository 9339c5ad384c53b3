// SPDX-License-Identifier: Apache-2.0
// Adds the contribution of every shadow ray that meets nothing, and of others the share that the light's shadow colour tells: one thread per shadow ray, Counters::shadow_args.
// Reads: shadow_queue, shadow_rays, the scene. Writes: radiance of the ray's path (a path has at most one shadow ray at a time).
// With streaming also: shadow_rays (flags), shadow_pending, progress; pushes to deferred, and finished paths to surface_queue or
// escaped_queue.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "include/wavefront.glsl"
#define ANY_HIT 1
#include "traversal/traverse.glsl"
#include "include/opacity_seed.glsl"

// Pushes paths that wait for their shadow ray only, and rays that wait.
void store_progress(uint path, bool in_range, bool hit) {
    const bool waits = in_range && !hit && pending_count > 0u;
    if (waits) {
        Uints(shadow_ray_address(path)).v[11] = pending_flags();
        store_pending(path);
    }
    push_deferred(path | SHADOW_BIT, waits);
    push_finished(path, in_range && !waits ? finish(path, SHADOW_DONE) : 0u);
    ADD_EACH(visits, in_range ? walk.visits : 0u);
}

void main() {
    const uint at = thread_index();
    const bool in_range = at < COUNTERS.shadow_count;
    bool hit = false;
    uint path = 0u;
    if (in_range) {
        path = ConstUints(FRAME.shadow_queue).v[at];
        const uint64_t ray = shadow_ray_address(path);
        const uint linked = ConstUints(ray).v[3];
        const uint bounce = HAS_LIGHT_LINKS ? linked & BOUNCE_MASK : linked;
        walk.shadow_link = HAS_LIGHT_LINKS ? linked >> SHADOW_LINK_SHIFT : 0u;
        const uint flags = HAS_STREAMING ? ConstUints(ray).v[11] : 0u;
        const bool ended = HAS_ROULETTE && (flags & RAY_ENDED) != 0u;
        Found found;
        if (ended) {
            no_walk();
        } else {
            hit = traverse(ray, path, ConstFloats(ray).v[7], opacity_seed(path, 2u * bounce + 1u), flags, found);
        }
        const uint shadow_color = HAS_LIGHT_TABLE ? ConstUints(ray).v[15] : 0u;
        if (hit ? shadow_color != 0u : !(ended || (HAS_STREAMING && pending_count > 0u))) {
            vec3 contribution = ConstVec4s(ray).v[3].xyz;
            if (hit) contribution *= vec3(uvec3(shadow_color, shadow_color >> 10, shadow_color >> 20) & 1023u) / 1023.0;
            const uint place = path_place(path);
            const vec4 before = ConstVec4s(FRAME.radiance).v[place];
            Vec4s(FRAME.radiance).v[place] = vec4(before.xyz + contribution, before.w);
        }
    }
    if (HAS_STREAMING) store_progress(path, in_range, hit);
}
