// SPDX-License-Identifier: Apache-2.0
// How many samples each pixel has so far, of both streams where there are two: one thread per pixel. Only where the
// image is wanted.
// Reads: film. Writes: the plane FrameConstants::aov.sample_count.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "wavefront/wavefront.glsl"

void main() {
    const uint pixel = thread_index();
    const uint pixels = FRAME.width * FRAME.height;
    if (pixel >= pixels) return;
    uint samples = ConstFilm(FRAME.film).v[pixel].samples;
    if (HAS_ADAPTIVE) samples += ConstFilm(FRAME.film).v[pixels + pixel].samples;
    Floats(FRAME.aov.sample_count).v[pixel] = float(samples);
}
