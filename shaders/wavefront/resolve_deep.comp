// SPDX-License-Identifier: Apache-2.0
// Writes the deep samples of each pixel: one thread per pixel. Reads: film (the number of samples),
// FrameConstants::deep_slots. Writes: FrameConstants::deep_image, in which shares are of the pixel and light is times
// the camera's exposure. Adaptive: half of each stream, as `resolve`.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "wavefront/deep.glsl"

void main() {
    const uint pixel = thread_index();
    const uint pixels = FRAME.width * FRAME.height;
    if (pixel >= pixels) return;
    const uint64_t image = deep_list(FRAME.deep_image, pixel);
    for (uint slot = 0u; slot < FRAME.deep_samples; ++slot) {
        DeepSlots(image).v[slot] = DeepSlot(0u, 0u, 0.0, 0.0, vec3(0.0), 0.0);
    }
    const bool has_both = HAS_ADAPTIVE && ConstFilm(FRAME.film).v[pixels + pixel].samples > 0u;
    for (uint stream = 0u; stream < (has_both ? 2u : 1u); ++stream) {
        const uint record = pixel + stream * pixels;
        const float samples = float(max(ConstFilm(FRAME.film).v[record].samples, 1u)) * (has_both ? 2.0 : 1.0);
        const uint64_t slots = deep_list(FRAME.deep_slots, record);
        for (uint slot = 0u; slot < FRAME.deep_samples; ++slot) {
            DeepSlot have = DeepSlots(slots).v[slot];
            if (have.weight == 0.0) break;
            have.weight /= samples;
            have.color *= FRAME.exposure / samples;
            have.alpha /= samples;
            // The slots of one stream are apart from each other already.
            if (stream == 0u) DeepSlots(image).v[slot] = have;
            else merge_deep(image, have);
        }
    }
}
