// SPDX-License-Identifier: Apache-2.0
// Adds the samples of a wave, or of a segment whose first place is arg0, to the film, each pixel's in ascending order: one thread
// per pixel of it, at least min(path_count, width * height).
// Reads: radiance. Reads and writes: film.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "include/wavefront.glsl"

void main() {
    const uint thread = thread_index();
    const uint pixels = FRAME.width * FRAME.height;
    if (thread >= min(pixels, push.path_count)) return;
    const uvec2 position = pixel_position(pixel_from(push.first_pixel, thread));
    const uint pixel = position.y * FRAME.width + position.x;
    FilmPixel film = Film(FRAME.film).v[pixel];
    for (uint path = thread; path < push.path_count; path += pixels) {
        const vec4 value = ConstVec4s(FRAME.radiance).v[push.arg0 + path];
        const vec3 deviation = film.samples == 0u ? vec3(0.0) : value.rgb - film.sum.rgb / float(film.samples);
        precise const vec4 term = value - film.compensation;
        precise const vec4 sum = film.sum + term;
        precise const vec4 compensation = (sum - film.sum) - term;
        film.compensation = compensation;
        film.sum = sum;
        film.samples += 1u;
        film.m2 += deviation * (value.rgb - sum.rgb / float(film.samples));
    }
    Film(FRAME.film).v[pixel] = film;
}
