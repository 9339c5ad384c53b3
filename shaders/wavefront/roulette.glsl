// SPDX-License-Identifier: Apache-2.0
// Roulette on loads only: the waiting rays that take part, and the statistics of their pixels.
// oocpt_core::residency::roulette decides.
#ifndef OOCPT_ROULETTE_GLSL
#define OOCPT_ROULETTE_GLSL

#include "wavefront/deferred.glsl"

#define ROULETTE RouletteBlock(STREAMING.roulette).r

const float ROULETTE_EPSILON = 1e-2; // as in measure_error

// Returns true if an entry of the list of deferred rays waits for a chunk or mesh; `unit` is the first one.
bool waits_for_geometry(uint entry, out uint unit) {
    unit = STREAMING.first_tile;
    if ((entry & MATERIAL_BIT) != 0u) return false;
    unit = pending_unit(entry, path_of_entry(entry), 0u);
    return unit < STREAMING.first_tile;
}

// Returns true if the ray takes part. Camera rays do not: their radiance has no weight, nor has alpha. Shadow rays of
// shadow catchers do not: they contribute nothing and are needed nevertheless.
bool is_played(uint entry) {
    if (HAS_SHADOW_SUMS && (entry & SHADOW_BIT) != 0u) {
        return max_component(shadow_contribution(shadow_ray_address(path_of_entry(entry)))) > 0.0;
    }
    return (entry & SHADOW_BIT) != 0u || ray_bounce(ray_address(path_of_entry(entry))) != 0u;
}

float average(vec3 v) {
    return (v.x + v.y + v.z) * (1.0 / 3.0);
}

// Pixel and sample of the path of a place in the segments.
struct Sample {
    uint pixel;  // with its stream, if there are some
    uint number;
    uint stride; // places from there to the next sample of the pixel, if it is under way too
};

// False if there was no path since the host zeroed the segments. One that has gone into the film already may be found
// again.
bool sample_of_place(uint place, out Sample of_path) {
    const uint segment = place / STREAMING.segment_size;
    const uint i = place - segment * STREAMING.segment_size;
    const PathSegment s = Segments(STREAMING.segments).v[segment];
    of_path = Sample(0u, 0u, 0u);
    if (i >= s.count) return false;
    if (has_entries()) {
        of_path.stride = band_width(s.first_sample);
        const uvec2 entry = entry_from(s.first_pixel, s.first_sample, i);
        of_path.pixel = entry.x;
        of_path.number = entry.y;
    } else {
        of_path.stride = FRAME.width * FRAME.height;
        of_path.pixel = pixel_from(s.first_pixel, i);
        of_path.number = sample_from(s.first_sample, s.first_pixel, i);
    }
    return true;
}

// Radiance of the path that is `steps` samples of its pixel on from a place, if it is found and has ended.
bool radiance_of_other(uint place, Sample from, int steps, out float radiance) {
    const int64_t places = int64_t(STREAMING.segment_count) * int64_t(STREAMING.segment_size);
    int64_t other = (int64_t(place) + int64_t(steps) * int64_t(from.stride)) % places;
    if (other < 0l) other += places;
    Sample found;
    radiance = 0.0;
    if (!sample_of_place(uint(other), found)) return false;
    if (found.pixel != from.pixel || found.number != from.number + uint(steps)) return false;
    const vec4 ended = ConstVec4s(STREAMING.ended_radiance).v[uint(other)];
    radiance = average(ended.rgb);
    return ended.a >= 0.0;
}

#endif
