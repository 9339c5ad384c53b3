// SPDX-License-Identifier: Apache-2.0
// The code of intersect_shadow and settle_shadow before and after a ray's walk: they differ in the queue, and in how
// cutouts are looked up. Before including, define what rays.glsl needs, with ANY_HIT as 1.
#ifndef OOCPT_SHADOW_RAYS_GLSL
#define OOCPT_SHADOW_RAYS_GLSL

#include "traversal/rays.glsl"
#include "traversal/opacity_seed.glsl"
#include "light/parts.glsl"
#include "light/shadow_sums.glsl"

// Returns true if roulette has ended the ray.
bool is_ray_ended(uint path) {
    return HAS_ROULETTE && (ray_flags(shadow_ray_address(path)) & RAY_ENDED) != 0u;
}

void begin_ray(uint at) {
    const uint entry = ConstUints(SETTLES == 1 ? FRAME.settle_queue[1] : FRAME.shadow_queue).v[at];
    const uint path = SETTLES == 1 ? entry & SETTLE_PATH : entry;
    if (is_ray_ended(path)) {
        no_walk(path);
        return;
    }
    const uint64_t ray = shadow_ray_address(path);
    const uint linked = ray_word(ray);
    walk.shadow_link = shadow_link(linked);
    const uint flags = HAS_STREAMING ? ray_flags(ray) : 0u;
    begin_walk(ray, path, ray_t_max(ray), opacity_seed(path, 2u * shadow_bounce(linked) + 1u), flags);
    if (SETTLES == 1 && (entry & SETTLE_KEPT) != 0u) stand_at_kept(1u, at);
}

// Takes away what does not arrive of the light that a ray of bounce 0 has asked for.
void take_shadow(uint path, uint shadow_color) {
    if (shadow_bounce(ray_word(shadow_ray_address(path))) != 0u) return;
    if (walk.hit) {
        store_shadow(path, unpack_color(shadow_color));
    } else if (is_ray_ended(path)) {
        store_shadow(path, vec3(0.0));
    }
}

// Adds the light's contribution if nothing is in its way, or the share that its shadow colour lets through.
void add_light(uint path) {
    const uint64_t ray = shadow_ray_address(path);
    const uint shadow_color = shadow_in_shadow(ray);
    if (HAS_SHADOW_SUMS) take_shadow(path, shadow_color);
    const bool waits = HAS_STREAMING && (pending_count > 0u || is_ray_ended(path));
    if (walk.hit ? shadow_color == 0u : waits) return;
    vec3 contribution = shadow_contribution(ray);
    if (walk.hit) contribution *= unpack_color(shadow_color);
    const vec4 before = ConstVec4s(FRAME.radiance).v[path];
    Vec4s(FRAME.radiance).v[path] = vec4(before.xyz + contribution, before.w);
    if (HAS_PATH_EXPRESSIONS) {
        GpuPathStates states = load_states(FRAME.shadow_states, path);
        const bool of_all = (states.states.x & STATES_OF_ALL) != 0u;
        states.states.x &= ~STATES_OF_ALL;
        add_light_parts(path, states, contribution, parts_found(of_all));
    }
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
    if (DEFERS_CUTOUTS) {
        const bool unsure = ended && !walk.hit && walk.unsure < MAX_FLOAT;
        PUSH_UNSURE(1u, unsure, ray_t_max(shadow_ray_address(path)));
        ended = ended && !unsure;
    }
    if (ended) add_light(path);
    if (HAS_STREAMING) store_progress(path, ended);
}

#endif
