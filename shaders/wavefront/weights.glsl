// SPDX-License-Identifier: Apache-2.0
// Weights of the samples of a pixel, where the filter has negative ones: not the weighted mean over the sum of the
// weights, which has no bound where they cancel, but a sum of `base + weight * (value - base)`, whose mean is the same,
// as that of the weights is 1. With the mean of the first half of the samples as the base it is as exact: a constant
// picture stays one, and what the film knows of these values' spread is that of the picture.
#ifndef OOCPT_WEIGHTS_GLSL
#define OOCPT_WEIGHTS_GLSL

#include "wavefront/wavefront.glsl"
#include "math/sampler.glsl"
#include "camera/pixel_filter.glsl"

// The number of the sample of a path, and the seed of its pixel.
uvec2 sample_of(uint path, uvec2 position) {
    if (!HAS_ADAPTIVE) {
        return uvec2(sample_from(push.first_sample, push.first_pixel, path),
                     pixel_seed(position.x, position.y, FRAME.seed));
    }
    const uvec2 entry = entry_from(push.first_pixel, push.first_sample, path);
    return uvec2(entry.y, pixel_seed(position.x, position.y, entry_seed(entry.x)));
}

// The weight of the sample of a path whose pixel has `samples` before it, at least one. The first has no base but the
// second: both are weighted then.
float sample_weight(uint samples, uint path, uvec2 position) {
    const uvec2 number = sample_of(path, position);
    float weight = filter_weight(sample_4d(number.x, 0u, number.y).xy);
    if (samples == 1u) weight += 1.0 - filter_weight(sample_4d(0u, 0u, number.y).xy);
    return weight;
}

#endif
