// SPDX-License-Identifier: Apache-2.0
// The picture so far: one thread per pixel.
// Reads: film. Writes: color, premultiplied, over the clear colour.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "include/wavefront.glsl"

void main() {
    const uint pixel = thread_index();
    if (pixel >= FRAME.width * FRAME.height) return;
    const uint samples = Film(FRAME.film).v[pixel].samples;
    const vec4 mean = Film(FRAME.film).v[pixel].sum / float(max(samples, 1u));
    Vec4s(FRAME.color).v[pixel] = mean + FRAME.clear_color * (1.0 - mean.a);
}
