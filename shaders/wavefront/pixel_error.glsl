// SPDX-License-Identifier: Apache-2.0
// The error of a pixel, by the film.
//
// A pixel's error is divided by the square of the pixel's true value, which is unknown. Its own mean would hide a
// firefly (divided by itself, it is 1 at most); so the mean is drawn towards its neighbours' as far as it differs from
// it by no more than its noise explains (positive-part James-Stein).
//
// Adaptive: the change since half as many samples is replaced by half the difference of the two streams.
#ifndef OOCPT_PIXEL_ERROR_GLSL
#define OOCPT_PIXEL_ERROR_GLSL

#include "wavefront/wavefront.glsl"

struct PixelError {
    float s;
    float d;
    float doubt; // relative standard error of the divisor
};

vec3 stream_mean(uint pixel) {
    return ConstFilm(FRAME.film).v[pixel].sum.rgb / float(max(ConstFilm(FRAME.film).v[pixel].samples, 1u));
}

vec3 stream_variance(uint pixel) {
    const float n = float(max(ConstFilm(FRAME.film).v[pixel].samples, 2u));
    return max(ConstFilm(FRAME.film).v[pixel].m2, vec3(0.0)) / (n - 1.0) / n;
}

vec3 mean_of(uint pixel) {
    const vec3 mean = stream_mean(pixel);
    return HAS_ADAPTIVE ? 0.5 * (mean + stream_mean(FRAME.width * FRAME.height + pixel)) : mean;
}

// Fewest samples that a stream of the pixel has.
uint fewest_of(uint pixel) {
    const uint samples = ConstFilm(FRAME.film).v[pixel].samples;
    return HAS_ADAPTIVE ? min(samples, ConstFilm(FRAME.film).v[FRAME.width * FRAME.height + pixel].samples) : samples;
}

float average(vec3 v) {
    // min() takes NaN away as well: it returns its first argument then.
    return min(MAX_PIXEL_ERROR, (v.x + v.y + v.z) * (1.0 / 3.0));
}

// Sum and sum of squares of the neighbours' means; returns their number.
uint neighbours(ivec2 at, out vec3 sum, out vec3 squares) {
    sum = vec3(0.0);
    squares = vec3(0.0);
    uint count = 0u;
    for (int y = max(at.y - 1, 0); y <= min(at.y + 1, int(FRAME.height) - 1); ++y) {
        for (int x = max(at.x - 1, 0); x <= min(at.x + 1, int(FRAME.width) - 1); ++x) {
            if (ivec2(x, y) == at) continue;
            const vec3 mean = mean_of(uint(y) * FRAME.width + uint(x));
            sum += mean;
            squares += mean * mean;
            ++count;
        }
    }
    return count;
}

PixelError error_of(uint pixel) {
    const vec3 mean = mean_of(pixel);
    vec3 variance = stream_variance(pixel);
    vec3 change = mean - ConstFilm(FRAME.film).v[pixel].earlier;
    if (HAS_ADAPTIVE) {
        const uint other = FRAME.width * FRAME.height + pixel;
        variance = 0.25 * (variance + stream_variance(other));
        change = 0.5 * (stream_mean(pixel) - stream_mean(other));
    }
    vec3 level = mean;
    vec3 level_variance = variance;
    vec3 sum, squares;
    const uint count = neighbours(ivec2(pixel % FRAME.width, pixel / FRAME.width), sum, squares);
    if (count > 0u) {
        const vec3 around = sum / float(count);
        const vec3 spread = max(squares / float(count) - around * around, vec3(0.0));
        const vec3 apart = mean - around;
        const vec3 keep = clamp(1.0 - MEAN_TRUST * variance / max(apart * apart, vec3(1e-30)), vec3(0.0), vec3(1.0));
        level = around + keep * apart;
        level_variance = keep * keep * variance + (1.0 - keep) * (1.0 - keep) * spread;
    }
    const vec3 divisor = level * level + FRAME.error_floor;
    const vec3 doubt = 2.0 * abs(level) * sqrt(level_variance) / divisor;
    PixelError error;
    error.s = average(variance / divisor);
    error.d = average(change * change / divisor);
    error.doubt = min(1.0, max_component(doubt));
    return error;
}

#endif
