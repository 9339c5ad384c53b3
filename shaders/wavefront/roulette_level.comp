// SPDX-License-Identifier: Apache-2.0
// Roulette on loads only. How bright paths are and how much they differ: mean radiance, second moment, and what
// variance the means of pixels have. Of some pixels, all their samples that are found and have ended. One workgroup.
// Reads: segments, ended_radiance. Reads and writes: RouletteStats.
//
// The error of a mean of scrambled Sobol points is not told by the variance of the points. The mean of the first half
// of them differs from the mean of all by V(n / 2) - V(n), squared (measure_error); where V falls as n^-r that is V(n)
// times 2^r - 1. Half of it is taken, r = 1.6: between r = 1 (no better than random points) and r = 2 (edges).
#version 460
#extension GL_GOOGLE_include_directive : require
#include "wavefront/wavefront.glsl"
#include "wavefront/roulette.glsl"
#include "math/sampler.glsl"

const uint PIXELS = 4u;          // of a thread
const int SAMPLES = 64;          // of a pixel, at most
const float OF_DIFFERENCE = 0.5;
const uint REMEMBERED = 16u;     // looks that count

shared vec4 sums[WORKGROUP_SIZE]; // radiance, its square, count, variances
shared float pixels[WORKGROUP_SIZE];

// Adds the samples of the pixel of a place.
void look(uint place, inout vec4 sum, inout float count) {
    Sample of_path;
    if (!sample_of_place(place, of_path)) return;
    const int before = int(of_path.number % uint(SAMPLES));
    float total = 0.0, whole = 0.0, first_half = 0.0; // of all, of the first 2^k, of half of these
    uint n = 0u;
    for (int i = 0; i < SAMPLES; ++i) {
        float level;
        if (!radiance_of_other(place, of_path, i - before, level)) continue;
        total += level;
        n += 1u;
        sum.xyz += vec3(level, level * level, 1.0);
        if ((n & (n - 1u)) == 0u) {
            first_half = whole;
            whole = total;
        }
    }
    if (n < 2u) return;
    const float samples = float(1u << findMSB(n));
    const float mean = total / float(n);
    const float difference = (whole - 2.0 * first_half) / samples;
    sum.w += OF_DIFFERENCE * samples * difference * difference / (mean * mean + ROULETTE_EPSILON);
    count += 1.0;
}

void main() {
    if (!HAS_ROULETTE) return;
    const uint places = STREAMING.segment_count * STREAMING.segment_size;
    vec4 sum = vec4(0.0);
    float count = 0.0;
    for (uint i = 0u; i < PIXELS; ++i) {
        const uint key = (push.round * PIXELS + i) * WORKGROUP_SIZE + gl_LocalInvocationIndex;
        look(hash_u32(key ^ 0x5eed0u) % places, sum, count);
    }
    sums[gl_LocalInvocationIndex] = sum;
    pixels[gl_LocalInvocationIndex] = count;
    barrier();
    [[dont_unroll]] for (uint step = WORKGROUP_SIZE / 2u; step > 0u; step /= 2u) {
        if (gl_LocalInvocationIndex < step) {
            sums[gl_LocalInvocationIndex] += sums[gl_LocalInvocationIndex + step];
            pixels[gl_LocalInvocationIndex] += pixels[gl_LocalInvocationIndex + step];
        }
        barrier();
    }
    if (gl_LocalInvocationIndex != 0u || sums[0].z == 0.0) return;
    const float weight = 1.0 / float(min(ROULETTE.looks + 1u, REMEMBERED));
    ROULETTE.looks += 1u;
    ROULETTE.mean = mix(ROULETTE.mean, sums[0].x / sums[0].z, weight);
    ROULETTE.second_moment = mix(ROULETTE.second_moment, sums[0].y / sums[0].z, weight);
    if (pixels[0] > 0.0) ROULETTE.variance = mix(ROULETTE.variance, sums[0].w / pixels[0], weight);
}
