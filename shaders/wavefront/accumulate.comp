// SPDX-License-Identifier: Apache-2.0
// Adds the samples of a wave, or of a segment whose first place is arg0, to the film, each pixel's in ascending order: one thread
// per pixel of it, at least min(path_count, width * height).
// Reads: radiance. Reads and writes: film.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "include/wavefront.glsl"

const float LARGEST = 3.0e38;

void main() {
    const uint thread = thread_index();
    const uint pixels = FRAME.width * FRAME.height;
    if (thread >= min(pixels, push.path_count)) return;
    const uvec2 position = pixel_position(pixel_from(push.first_pixel, thread));
    const uint pixel = position.y * FRAME.width + position.x;
    FilmPixel film = Film(FRAME.film).v[pixel];
    for (uint path = thread; path < push.path_count; path += pixels) {
        const vec4 value = ConstVec4s(FRAME.radiance).v[push.arg0 + path];
        const vec3 mean = film.sum.rgb / float(max(film.samples, 1u));
        const vec3 deviation = film.samples == 0u ? vec3(0.0) : value.rgb - mean;
        if ((film.samples & (film.samples - 1u)) == 0u) film.earlier = mean;
        precise const vec4 term = value - film.compensation;
        precise const vec4 sum = film.sum + term;
        precise const vec4 compensation = (sum - film.sum) - term;
        film.compensation = compensation;
        film.sum = sum;
        film.samples += 1u;
        precise const vec3 square = deviation * (value.rgb - sum.rgb / float(film.samples)) - film.m2_compensation;
        precise const vec3 m2 = film.m2 + square;
        precise const vec3 lost = (m2 - film.m2) - square;
        // Squares of radiances above 1e19 are no floats: from there on the variance is as large as a float can say.
        const bvec3 fits = lessThan(m2, vec3(LARGEST));
        film.m2_compensation = mix(vec3(0.0), lost, fits);
        film.m2 = mix(vec3(LARGEST), m2, fits);
    }
    Film(FRAME.film).v[pixel] = film;
}
