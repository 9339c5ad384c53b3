// SPDX-License-Identifier: Apache-2.0
// Adds what samples have for filtered images to the sums of each pixel, as `accumulate` adds their light to the film
// and before it does: one thread per pixel of the wave or segment, as there. In core, with textures: does nothing while
// a path of the wave lacks a tile. Reads: film (the number of samples), FrameConstants::plane_values. Reads and writes:
// FrameConstants::plane_sums.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "wavefront/weights.glsl"
#include "texture/feedback.glsl"

// Adds a value to a sum of `samples` values.
PlaneSum added(PlaneSum of, uint samples, float value, float weight) {
    if ((samples & (samples - 1u)) == 0u && has_filter_weights()) of.earlier = of.sum / float(max(samples, 1u));
    if (has_filter_weights() && samples > 0u) value = of.earlier + weight * (value - of.earlier);
    if (!is_finite(vec3(value))) value = 0.0;
    precise const float term = value - of.compensation;
    precise const float sum = of.sum + term;
    precise const float compensation = (sum - of.sum) - term;
    return PlaneSum(sum, compensation, of.earlier);
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
    const uint before = ConstFilm(FRAME.film).v[pixel].samples;
    const uint words = FRAME.sum_words;
    const uint64_t sums = FRAME.plane_sums + uint64_t(pixel) * (words * PLANE_SUM_BYTES);
    for (uint word = 0u; word < words; ++word) {
        PlaneSum sum = PlaneSums(sums).v[word];
        uint samples = before;
        for (uint path = thread; path < push.path_count; path += pixels) {
            const uint64_t values = FRAME.plane_values + uint64_t(push.arg0 + path) * (4u * FRAME.plane_words);
            float weight = 1.0;
            if (has_filter_weights() && samples > 0u) weight = sample_weight(samples, path, position);
            sum = added(sum, samples, ConstFloats(values).v[word], weight);
            ++samples;
        }
        PlaneSums(sums).v[word] = sum;
    }
}
