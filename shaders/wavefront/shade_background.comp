// SPDX-License-Identifier: Apache-2.0
// Adds the light that rays which leave the scene meet: dome and distant lights, weighted against the shadow rays of the
// bounce before. One thread per escaped ray, WavefrontCounters::escaped_args. Reads: escaped_queue, rays, paths,
// lights. Writes: radiance of the ray's path, with PATH_EXPRESSIONS or SHADOW_SUMS light_values; with streaming,
// segments.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "wavefront/wavefront.glsl"
#include "wavefront/progress.glsl"
#include "wavefront/path_surface.glsl"
#include "material/bsdf_lambert.glsl"
#include "light/sample.glsl"
#include "light/shadow_sums.glsl"

void shade(uint path) {
    const Ray ray = load_ray(ray_address(path));
    const Double3 origin = Double3(ray.o, ray.o_lo);
    set_light_time(path);
    bool met = false;
    if (ray.bounce == 0u) {
        PreviousVertex nowhere = PreviousVertex(Receiver(vec3(0.0), vec3(0.0)), 0u, vec3(0.0), 0.0);
        const float t_end = HAS_CLIPPING ? min(ray.t_max, MAX_FLOAT) : MAX_FLOAT;
        vec3 seen = HAS_LOCAL_LIGHTS ? lights_along(origin, ray.d, t_end, true, nowhere, met) : vec3(0.0);
        if (HAS_DOME && (FRAME.flags & FLAG_DOME_CAMERA_VISIBLE) != 0u) {
            seen += domes_behind(ray.d);
            met = true;
        }
        const vec3 kept = met ? clamp_contribution(path, seen, false) : vec3(0.0);
        Vec4s(FRAME.radiance).v[path] = met ? vec4(kept, 1.0) : vec4(0.0);
        if (HAS_SHADOW_SUMS) clear_shadow_values(path);
        if (HAS_PATH_EXPRESSIONS) {
            clear_light_parts(path);
            if (begin_light_parts(path, 0u, vec3(1.0), seen, kept)) {
                if (HAS_LOCAL_LIGHTS) lights_along(origin, ray.d, t_end, true, nowhere, met);
                if (HAS_DOME && (FRAME.flags & FLAG_DOME_CAMERA_VISIBLE) != 0u) domes_behind(ray.d);
                end_light_parts();
            }
        }
        return;
    }
    const PathState state = load_path(path);
    const PreviousVertex from = load_previous_vertex(path, ray.o, state.pdf);
    vec3 sum = lights_at_infinity(ray.d, from);
    if (HAS_LOCAL_LIGHTS) sum += lights_along(origin, ray.d, MAX_FLOAT, false, from, met);
    const vec3 contribution = clamp_contribution(path, state.throughput * sum, ray.bounce > 1u);
    const vec4 before = ConstVec4s(FRAME.radiance).v[path];
    Vec4s(FRAME.radiance).v[path] = vec4(before.xyz + contribution, before.w);
    if (HAS_PATH_EXPRESSIONS &&
        begin_light_parts(path, ray.bounce, state.throughput, state.throughput * sum, contribution)) {
        lights_at_infinity(ray.d, from);
        if (HAS_LOCAL_LIGHTS) lights_along(origin, ray.d, MAX_FLOAT, false, from, met);
        end_light_parts();
    }
}

void main() {
    const uint at = thread_index();
    if (at >= COUNTERS.escaped_count) return;
    const uint path = ConstUints(FRAME.escaped_queue).v[at];
    shade(path);
    if (HAS_STREAMING) end_path(path, true);
}
