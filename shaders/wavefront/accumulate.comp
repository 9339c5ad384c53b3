// SPDX-License-Identifier: Apache-2.0
// Adds the samples of a wave, or of a segment whose first place is arg0, to the film, each pixel's in ascending order:
// one thread per pixel of it, at least min(path_count, width * height). Adaptive: one thread per entry of it; and
// stores at powers of two the error estimated from the samples so far. In core, with textures: does nothing while a
// path of the wave lacks a tile. Reads: radiance, streaming: ended_radiance. Reads and writes: film. Adaptive: reads
// entries, writes estimates.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "wavefront/wavefront.glsl"
#include "texture/feedback.glsl"
#include "wavefront/weights.glsl"

const float MAX_SQUARE = 3.0e38;
const float MAX_HALF = 6e4;

// The square root of a relative variance of the mean, times the root of the samples.
float root(vec3 variance, vec3 mean, float samples) {
    const vec3 relative = variance / (mean * mean + FRAME.error_floor);
    return min(MAX_HALF, sqrt(max(0.0, (relative.x + relative.y + relative.z) * (samples / 3.0))));
}

void say(uint stream, uint pixel, FilmPixel film) {
    const float n = float(film.samples);
    const vec3 mean = film.sum.rgb / n;
    const vec3 change = mean - film.earlier;
    const float spread = root(film.m2 / (n - 1.0) / n, mean, n);
    const uint octave = uint(findMSB(film.samples));
    const uint at = ((octave % ESTIMATE_RING) * 2u + stream) * (FRAME.width * FRAME.height) + pixel;
    Uints(ADAPTIVE.estimates).v[at] = packHalf2x16(vec2(spread, root(change * change, mean, n)));
}

void main() {
    if (waits_for_tiles()) return;
    const uint thread = thread_index();
    uint pixels = FRAME.width * FRAME.height; // that have paths here, one after the other
    if (HAS_ADAPTIVE) pixels = band_width(push.first_sample);
    if (thread >= min(pixels, push.path_count)) return;
    uint index = pixel_from(push.first_pixel, thread);
    uint stream = 0u;
    if (HAS_ADAPTIVE) {
        const uint entry = entry_from(push.first_pixel, push.first_sample, thread).x;
        index = entry & ~STREAM_BIT;
        stream = entry >> 31;
    }
    const uvec2 position = pixel_position(index);
    const uint pixel = film_pixel(position) + stream * FRAME.width * FRAME.height;
    FilmPixel film = Film(FRAME.film).v[pixel];
    const uint64_t ended = HAS_STREAMING ? STREAMING.ended_radiance : FRAME.radiance;
    for (uint path = thread; path < push.path_count; path += pixels) {
        vec4 value = ConstVec4s(ended).v[push.arg0 + path];
        const vec3 mean = film.sum.rgb / float(max(film.samples, 1u));
        if ((film.samples & (film.samples - 1u)) == 0u) {
            film.earlier = mean;
            if (has_filter_weights()) film.earlier_alpha = film.sum.a / float(max(film.samples, 1u));
        }
        if (has_filter_weights()) {
            const vec4 base = vec4(film.earlier, film.earlier_alpha);
            if (film.samples > 0u) value = base + sample_weight(film.samples, path, position) * (value - base);
        }
        // Sums of finite contributions of a path, or of samples of a pixel, may overflow.
        if (!is_finite(value.rgb) || !is_finite(film.sum.rgb + value.rgb)) {
            note_nonfinite(position);
            value.rgb = vec3(0.0);
        }
        const vec3 deviation = film.samples == 0u ? vec3(0.0) : value.rgb - mean;
        precise const vec4 term = value - film.compensation;
        precise const vec4 sum = film.sum + term;
        precise const vec4 compensation = (sum - film.sum) - term;
        film.compensation = compensation;
        film.sum = sum;
        film.samples += 1u;
        precise const vec3 square = deviation * (value.rgb - sum.rgb / float(film.samples)) - film.m2_compensation;
        precise const vec3 m2 = film.m2 + square;
        precise const vec3 lost = (m2 - film.m2) - square;
        // Squares of radiances above 1e19 overflow: from there on the variance is the largest float.
        const bvec3 fits = lessThan(m2, vec3(MAX_SQUARE));
        film.m2_compensation = mix(vec3(0.0), lost, fits);
        film.m2 = mix(vec3(MAX_SQUARE), m2, fits);
        if (HAS_ADAPTIVE && film.samples >= 1u << ESTIMATE_FIRST && (film.samples & (film.samples - 1u)) == 0u) {
            say(stream, film_pixel(position), film);
        }
    }
    Film(FRAME.film).v[pixel] = film;
}
