// SPDX-License-Identifier: Apache-2.0
// Roulette on loads only. How bright paths are: mean radiance and second moment over at most LEVEL_SAMPLES places, those still under way with
// what they have: one workgroup.
// Reads: segments, radiance. Writes: Roulette.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "include/wavefront.glsl"
#include "include/roulette.glsl"

const uint LEVEL_SAMPLES = 16384u;

shared vec3 sums[WORKGROUP_SIZE]; // radiance, its square, count

void main() {
    if (!HAS_ROULETTE) return;
    const uint places = STREAMING.segment_count * STREAMING.segment_size;
    const uint stride = places / LEVEL_SAMPLES | 1u; // odd: no multiple of a side of tiles or pictures
    vec3 sum = vec3(0.0);
    for (uint place = gl_LocalInvocationIndex * stride; place < places; place += WORKGROUP_SIZE * stride) {
        const uint segment = place / STREAMING.segment_size;
        if (place - segment * STREAMING.segment_size >= Segments(STREAMING.segments).v[segment].count) continue;
        const vec3 rgb = ConstVec4s(FRAME.radiance).v[place].rgb;
        const float level = (rgb.r + rgb.g + rgb.b) * (1.0 / 3.0);
        sum += vec3(level, level * level, 1.0);
    }
    sums[gl_LocalInvocationIndex] = sum;
    barrier();
    for (uint step = WORKGROUP_SIZE / 2u; step > 0u; step /= 2u) {
        if (gl_LocalInvocationIndex < step) sums[gl_LocalInvocationIndex] += sums[gl_LocalInvocationIndex + step];
        barrier();
    }
    if (gl_LocalInvocationIndex == 0u) {
        const float count = max(sums[0].z, 1.0);
        ROULETTE.mean = sums[0].x / count;
        ROULETTE.second_moment = sums[0].y / count;
    }
}
