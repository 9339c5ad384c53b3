// SPDX-License-Identifier: Apache-2.0
// The filter of pixels by importance sampling, with PIXEL_FILTER: the two random numbers that place a sample in the
// square of its pixel place it under the filter instead, axis by axis and without changing their order, so points stay
// stratified. The table is oocpt_core::pixel_filter's.
#ifndef OOCPT_PIXEL_FILTER_GLSL
#define OOCPT_PIXEL_FILTER_GLSL

#include "wavefront/wavefront.glsl"

// Pixels from the pixel's centre along an axis. Intervals are shorter by their share where filters have little left.
float filter_offset(float u) {
    const float farther = 1.0 - abs(2.0 * u - 1.0);
    const float at = (1.0 - sqrt(farther)) * float(FILTER_INTERVALS);
    const uint interval = min(uint(at), FILTER_INTERVALS - 1u);
    const float a = ConstFloats(FRAME.pixel_filter).v[interval];
    const float b = ConstFloats(FRAME.pixel_filter).v[interval + 1u];
    const float offset = a + (at - float(interval)) * (b - a);
    return u < 0.5 ? -offset : offset;
}

// From the pixel's lower left corner.
vec2 filter_place(vec2 u) {
    return vec2(0.5) + vec2(filter_offset(u.x), filter_offset(u.y));
}

// Whether samples have different weights.
bool has_filter_weights() {
    return HAS_PIXEL_FILTER && FRAME.filter_negative_from <= 1.0;
}

// The weight of the sample at the place of these numbers: its mean over all is 1.
float filter_weight(vec2 u) {
    const bvec2 negative = greaterThanEqual(abs(2.0 * u - 1.0), vec2(FRAME.filter_negative_from));
    return negative.x != negative.y ? -FRAME.filter_weight : FRAME.filter_weight;
}

#endif
