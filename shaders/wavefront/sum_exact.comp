// SPDX-License-Identifier: Apache-2.0
// Adds the samples that `accumulate` adds to the film to the exact sums behind it too: one thread per pixel of the wave
// or segment, as there. In core, with textures: does nothing while a path of the wave lacks a tile. Reads: radiance,
// streaming: ended_radiance. Reads and writes: ExactPixel of each pixel, behind the film and what measure_error writes.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "wavefront/wavefront.glsl"
#include "texture/feedback.glsl"
#include "math/exact.glsl"

void main() {
    if (waits_for_tiles()) return;
    const uint thread = thread_index();
    const uint pixels = FRAME.width * FRAME.height; // that have paths here, one after the other
    if (thread >= min(pixels, push.path_count)) return;
    const uint pixel = film_pixel(pixel_position(pixel_from(push.first_pixel, thread)));
    const uint64_t behind = FRAME.film + uint64_t(pixels) * FILM_PIXEL_BYTES + ERROR_GROUPS * ERROR_SUMS_BYTES;
    ExactPixel sums = ExactPixels(behind).v[pixel];
    const uint64_t ended = HAS_STREAMING ? STREAMING.ended_radiance : FRAME.radiance;
    for (uint path = thread; path < push.path_count; path += pixels) {
        exact_add_sample(sums, ConstVec4s(ended).v[push.arg0 + path]);
    }
    ExactPixels(behind).v[pixel] = sums;
}
