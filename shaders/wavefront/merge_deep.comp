// SPDX-License-Identifier: Apache-2.0
// Adds samples to the deep samples of their pixels, in ascending order, before `accumulate` adds their light to the
// film: one thread per pixel of the wave or segment, as there. A sample counts as one also where its filter is
// negative. In core, with textures: does nothing while a path of the wave lacks a tile. Reads:
// FrameConstants::plane_values, radiance, streaming: ended_radiance. Reads and writes: FrameConstants::deep_slots.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "wavefront/deep.glsl"
#include "texture/feedback.glsl"

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
    const uint pixel = film_pixel(pixel_position(index)) + stream * FRAME.width * FRAME.height;
    const uint64_t slots = deep_list(FRAME.deep_slots, pixel);
    const uint64_t ended = HAS_STREAMING ? STREAMING.ended_radiance : FRAME.radiance;
    for (uint path = thread; path < push.path_count; path += pixels) {
        vec4 light = ConstVec4s(ended).v[push.arg0 + path];
        if (!is_finite(light.rgb)) light.rgb = vec3(0.0); // as in the film
        if (all(equal(light, vec4(0.0)))) continue;
        const uint64_t values = FRAME.plane_values + uint64_t(push.arg0 + path) * (4u * FRAME.plane_words);
        const uint64_t words = values + 4u * FRAME.deep_at;
        merge_deep(slots, DeepSlot(ConstUints(words).v[0], ConstUints(words).v[1], 1.0, ConstFloats(words).v[2],
                                   light.rgb, light.a));
    }
}
