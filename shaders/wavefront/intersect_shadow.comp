// SPDX-License-Identifier: Apache-2.0
// Adds the contribution of every shadow ray that meets nothing: one thread per shadow ray, Counters::shadow_args.
// Reads: shadow_rays, the scene. Writes: radiance of the ray's path (a path has at most one shadow ray per bounce).
#version 460
#extension GL_GOOGLE_include_directive : require
#include "include/wavefront.glsl"
#define ANY_HIT 1
#define OPACITY_MODE OPACITY_STOCHASTIC
#include "traversal/traverse.glsl"
#include "include/opacity_seed.glsl"

void main() {
    const uint slot = thread_index();
    if (slot >= COUNTERS.shadow_count) return;
    const vec4 a = ConstVec4s(FRAME.shadow_rays).v[slot * 3u];
    const vec4 b = ConstVec4s(FRAME.shadow_rays).v[slot * 3u + 1u];
    const uint path = floatBitsToUint(a.w);
    Found found;
    if (traverse(a.xyz, b.xyz, b.w, opacity_seed(path, 2u * push.bounce + 1u), found)) return;
    const vec3 contribution = ConstVec4s(FRAME.shadow_rays).v[slot * 3u + 2u].xyz;
    const vec4 before = ConstVec4s(FRAME.radiance).v[path];
    Vec4s(FRAME.radiance).v[path] = vec4(before.xyz + contribution, before.w);
}
