// SPDX-License-Identifier: Apache-2.0
// Roulette on loads only. Adds up, chunk by chunk, what the rays that wait for it first may bring to their pixels, squared and relative: one
// thread per deferred ray, Counters::deferred_args.
// Reads: deferred, rays, shadow_rays, paths, pending lists, film, Roulette. Adds to: worth.
//
// A shadow ray brings its contribution. What a closest ray brings is its path's throughput times a radiance nobody knows; its second
// moment is taken for that of the paths so far. Errors are relative to the pixel, of which the film knows something and the other paths more
// as long as it has few samples (the mean is shrunk towards theirs).
#version 460
#extension GL_GOOGLE_include_directive : require
#include "include/wavefront.glsl"
#include "include/roulette.glsl"

const float EPSILON = 1e-2;       // as in measure_error
const float PRIOR_SAMPLES = 4.0;  // of the picture's mean
const float MOST = 16.0;          // what one ray may count
const float LEAST = 1.0;          // in 1 / WORTH_ONE

float average(vec3 v) {
    return (v.x + v.y + v.z) * (1.0 / 3.0);
}

float pixel_level(uint path) {
    const uvec2 position = pixel_position(path_pixel(path));
    const uint pixel = position.y * FRAME.width + position.x;
    const float samples = float(ConstFilm(FRAME.film).v[pixel].samples);
    const float sum = average(ConstFilm(FRAME.film).v[pixel].sum.rgb);
    return (sum + PRIOR_SAMPLES * ROULETTE.mean) / (samples + PRIOR_SAMPLES);
}

float worth_of(uint entry) {
    const uint path = path_of_entry(entry);
    const bool is_shadow = (entry & SHADOW_BIT) != 0u;
    const float factor = average(is_shadow ? ConstVec4s(shadow_ray_address(path)).v[3].xyz : load_path(path).throughput);
    const float moment = factor * factor * (is_shadow ? 1.0 : ROULETTE.second_moment);
    const float level = pixel_level(path);
    const float worth = moment / (level * level + EPSILON);
    return worth < MOST ? worth : MOST; // MOST for what is no number
}

void main() {
    if (!HAS_ROULETTE) return;
    const uint at = thread_index();
    const uint list = COUNTERS.deferred_parity;
    if (at >= COUNTERS.deferred_count[list]) return;
    const uint entry = ConstUints(STREAMING.deferred[list]).v[at];
    uint chunk;
    if (!waits_for_chunk(entry, chunk)) return;
    if (is_played(entry)) {
        atomicAdd(Uints(STREAMING.worth).v[chunk], uint(max(worth_of(entry) * float(WORTH_ONE), LEAST)));
    } else {
        atomicOr(Uints(STREAMING.worth).v[chunk], WORTH_MUST);
    }
}
