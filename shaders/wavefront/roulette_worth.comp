// SPDX-License-Identifier: Apache-2.0
// Roulette on loads only. Adds up, unit by unit, the second moment of what the rays that wait for it first contribute
// to a pixel together, relative to the pixel, over the pixels: one thread per deferred ray,
// WavefrontCounters::deferred_args. Reads: deferred, rays, shadow_rays, paths, pending lists, segments, ended_radiance,
// film, RouletteStats. Adds to: worth, worth_sums.
//
// All rays of a load end together, so m rays of a pixel that contribute c each add m^2 c^2 to its variance. Each adds
// its part to a sum of its unit and pixel, and to the unit by how much that grows the sum's square. Two sums that share
// an element by their hash overestimate it, never underestimate it.
//
// A shadow ray adds its contribution. The contribution of a closest ray is its path's throughput times an unknown
// radiance: its moments are taken to be those of the paths so far, and its deviation from the mean to be independent of
// all others. Errors are relative to the pixel: the mean that the film and its other paths know, or that drawn towards
// the picture's mean if this is less.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "wavefront/wavefront.glsl"
#include "wavefront/roulette.glsl"
#include "math/sampler.glsl"

const int OTHERS = 8;             // samples of a pixel before and behind
const float PRIOR_SAMPLES = 4.0;  // of the picture's mean
const float SUM_ONE = 1024.0;        // one in worth_sums
const float MAX_RAY_WORTH = 16.0;     // what one ray may bring: more is worth a load
const float MAX_WORTH = 64.0;          // what it may add to its unit
const float MIN_WORTH = 1.0;          // in 1 / WORTH_ONE

float pixel_level(uint path) {
    const uvec2 position = pixel_position(path_pixel(path));
    const uint pixel = position.y * FRAME.width + position.x;
    float samples = float(ConstFilm(FRAME.film).v[pixel].samples);
    float sum = average(ConstFilm(FRAME.film).v[pixel].sum.rgb);
    const uint place = path_place(path);
    Sample of_path;
    if (sample_of_place(place, of_path)) {
        for (int i = -OTHERS; i <= OTHERS; ++i) {
            float radiance;
            if (i == 0 || !radiance_of_other(place, of_path, i, radiance)) continue;
            sum += radiance;
            samples += 1.0;
        }
    }
    const float drawn = (sum + PRIOR_SAMPLES * ROULETTE.mean) / (samples + PRIOR_SAMPLES);
    return samples > 0.0 ? min(sum / samples, drawn) : drawn;
}

void main() {
    if (!HAS_ROULETTE) return;
    const uint at = thread_index();
    const uint list = COUNTERS.deferred_parity;
    if (at >= COUNTERS.deferred_count[list]) return;
    const uint entry = ConstUints(STREAMING.deferred[list]).v[at];
    uint unit;
    if (!waits_for_geometry(entry, unit)) return;
    const uint path = path_of_entry(entry);
    const bool is_shadow = (entry & SHADOW_BIT) != 0u;
    float part = -1.0; // relative
    float own = 0.0;   // squared, independent of all others
    if (is_played(entry)) {
        const float level = pixel_level(path);
        const float squared = level * level + ROULETTE_EPSILON;
        const float factor =
            average(is_shadow ? shadow_contribution(shadow_ray_address(path)) : load_path(path).throughput);
        const float mean = is_shadow ? 1.0 : max(ROULETTE.mean, level);
        part = factor * mean / sqrt(squared);
        own = is_shadow ? 0.0 : factor * factor * max(ROULETTE.second_moment - ROULETTE.mean * ROULETTE.mean,
                                                      0.0) / squared;
    }
    if (!(part >= 0.0 && part < MAX_RAY_WORTH)) {
        atomicOr(Uints(STREAMING.worth).v[unit], WORTH_MUST);
        return;
    }
    const uint key = hash_u32(hash_combine(unit, path_pixel(path))) & (WORTH_SUMS - 1u);
    const float before = float(atomicAdd(Uints(STREAMING.worth_sums).v[key], uint(part * SUM_ONE + 0.5))) / SUM_ONE;
    const float added = part * (2.0 * before + part) + own;
    if (added < MAX_WORTH) {
        atomicAdd(Uints(STREAMING.worth).v[unit], uint(max(added * float(WORTH_ONE), MIN_WORTH)));
    } else {
        atomicOr(Uints(STREAMING.worth).v[unit], WORTH_MUST);
    }
}
