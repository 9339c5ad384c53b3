// SPDX-License-Identifier: Apache-2.0
// Images of shadows: the share of the light that does not arrive, of the sums of what light/shadow_sums.glsl has of
// samples. Reads: film (the number of samples), FrameConstants::plane_sums. Adaptive: half of each stream.
#ifndef OOCPT_SHADOW_IMAGES_GLSL
#define OOCPT_SHADOW_IMAGES_GLSL

#include "light/shadow_sums.glsl"

float plane_sum(uint pixel, uint word) {
    const uint64_t sums = FRAME.plane_sums + uint64_t(pixel) * (FRAME.sum_words * PLANE_SUM_BYTES);
    return PlaneSums(sums).v[word].sum;
}

// The mean of a value over the samples of a pixel; 0 without one.
float plane_mean(uint pixel, uint word) {
    const uint samples = ConstFilm(FRAME.film).v[pixel].samples;
    const float mean = plane_sum(pixel, word) / float(max(samples, 1u));
    if (!HAS_ADAPTIVE) return mean;
    const uint other = FRAME.width * FRAME.height + pixel;
    const uint more = ConstFilm(FRAME.film).v[other].samples;
    return more > 0u ? 0.5 * (mean + plane_sum(other, word) / float(more)) : mean;
}

// Between 0 and 1: filters that are negative in part may lead beyond. 0 where all arrives and 1 where nothing does, to
// the bit, however the device rounds quotients.
float shadow_of(float asked, float arrived) {
    if (asked <= 0.0 || arrived >= asked) return 0.0;
    return arrived > 0.0 ? clamp(1.0 - arrived / asked, 0.0, 1.0) : 1.0;
}

// By channel, and of the luminance.
vec4 shadow(uint pixel, uint first) {
    vec3 asked, arrived;
    for (uint c = 0u; c < 3u; ++c) {
        asked[c] = plane_mean(pixel, first + c);
        arrived[c] = plane_mean(pixel, first + 3u + c);
    }
    const float all = shadow_of(dot3(LUMINANCE, asked), dot3(LUMINANCE, arrived));
    return vec4(shadow_of(asked.x, arrived.x), shadow_of(asked.y, arrived.y), shadow_of(asked.z, arrived.z), all);
}

// The alpha that shadow catchers have: their share of the pixel times their shadow.
float caught_alpha(uint pixel) {
    const uint first = FRAME.sum_words - FRAME.light_words + FRAME.catcher_at;
    const float share = clamp(plane_mean(pixel, first + 2u), 0.0, 1.0);
    return share * shadow_of(plane_mean(pixel, first), plane_mean(pixel, first + 1u));
}

#endif
