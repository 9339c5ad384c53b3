// SPDX-License-Identifier: Apache-2.0
// Adds the contribution of every shadow ray that meets nothing: one thread per shadow ray, Counters::shadow_args.
// Reads: shadow_queue, shadow_rays, the scene. Writes: radiance of the ray's path (a path has at most one shadow ray per bounce).
#version 460
#extension GL_GOOGLE_include_directive : require
#include "include/wavefront.glsl"
#define ANY_HIT 1
#include "traversal/traverse.glsl"
#include "include/opacity_seed.glsl"

void main() {
    const uint at = thread_index();
    if (at >= COUNTERS.shadow_count) return;
    const uint path = ConstUints(FRAME.shadow_queue).v[at];
    const uint64_t ray = shadow_ray_address(path);
    const uint bounce = ConstUints(ray).v[3];
    Found found;
    if (traverse(ray, ConstFloats(ray).v[7], opacity_seed(path, 2u * bounce + 1u), found)) return;
    const vec3 contribution = ConstVec4s(ray).v[3].xyz;
    const vec4 before = ConstVec4s(FRAME.radiance).v[path];
    Vec4s(FRAME.radiance).v[path] = vec4(before.xyz + contribution, before.w);
}
