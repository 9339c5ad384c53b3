// SPDX-License-Identifier: Apache-2.0
// Adds the contribution of every shadow ray that meets nothing, and of others the share that the light's shadow colour
// tells: Counters::shadow_args, a thread for one ray or, where there are very many, for some.
// Reads: shadow_queue, shadow_rays, the scene. Writes: radiance of the ray's path (a path has at most one shadow ray at
// a time).
// With streaming also: shadow_rays (flags), shadow_pending, progress; pushes to deferred, and finished paths to
// surface_queue or escaped_queue.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "include/wavefront.glsl"
#define ANY_HIT 1
#define NEXT shadow_next
#include "traversal/rays.glsl"
#include "include/opacity_seed.glsl"

// Whether roulette has ended it.
bool is_ray_ended(uint path) {
    return HAS_ROULETTE && (ray_flags(shadow_ray_address(path)) & RAY_ENDED) != 0u;
}

void begin_ray(uint at) {
    const uint path = ConstUints(FRAME.shadow_queue).v[at];
    if (is_ray_ended(path)) {
        no_walk(path);
        return;
    }
    const uint64_t ray = shadow_ray_address(path);
    const uint linked = ray_bounce(ray);
    walk.shadow_link = shadow_link(linked);
    const uint flags = HAS_STREAMING ? ray_flags(ray) : 0u;
    begin_walk(ray, path, ray_t_max(ray), opacity_seed(path, 2u * shadow_bounce(linked) + 1u), flags);
}

// What the light brings if nothing is in its way, or of a shadow the share that its colour tells.
void add_light(uint path) {
    const uint64_t ray = shadow_ray_address(path);
    const uint shadow_color = shadow_in_shadow(ray);
    const bool waits = HAS_STREAMING && (pending_count > 0u || is_ray_ended(path));
    if (walk.hit ? shadow_color == 0u : waits) return;
    vec3 contribution = shadow_contribution(ray);
    if (walk.hit) contribution *= unpack_color(shadow_color);
    const vec4 before = ConstVec4s(FRAME.radiance).v[path];
    Vec4s(FRAME.radiance).v[path] = vec4(before.xyz + contribution, before.w);
}

// Pushes paths that wait for their shadow ray only, and rays that wait.
void store_progress(uint path, bool ended) {
    const bool waits = ended && !walk.hit && pending_count > 0u;
    if (waits) {
        set_ray_flags(shadow_ray_address(path), pending_flags());
        store_pending(path);
    }
    push_deferred(path | SHADOW_BIT, waits);
    push_finished(path, ended && !waits ? finish(path, SHADOW_DONE) : 0u);
    ADD_EACH(visits, ended ? walk.visits : 0u);
}

void end_ray(bool ended) {
    const uint path = walk.path;
    if (ended) add_light(path);
    if (HAS_STREAMING) store_progress(path, ended);
}

void main() {
    trace_rays(COUNTERS.shadow_count);
}
