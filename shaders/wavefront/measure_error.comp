// SPDX-License-Identifier: Apache-2.0
// Estimates the film's own error: at most ERROR_GROUPS workgroups, each sums the pixels of its threads, which are
// interleaved. The sums are taken in one order: same film, same bits. Reads: film. Writes: ErrorSums of each workgroup,
// behind the film's pixels.
//
// A pixel's error is divided by the square of the pixel's true value, which is unknown. Its own mean would hide a
// firefly (divided by itself, it is 1 at most); so the mean is drawn towards its neighbours' as far as it differs from
// it by no more than its noise explains (positive-part James-Stein).
//
// Adaptive: the change since half as many samples is replaced by half the difference of the two streams.
#version 460
#extension GL_GOOGLE_include_directive : require
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

shared ErrorSums parts[WORKGROUP_SIZE];

ErrorSums joined(ErrorSums a, ErrorSums b) {
    const bool first = a.worst >= b.worst;
    return ErrorSums(a.s + b.s, a.d + b.d, a.ss + b.ss, a.sd + b.sd, a.dd + b.dd, a.doubt + b.doubt,
                     max(a.worst, b.worst), first ? a.worst_pixel : b.worst_pixel, a.pixels + b.pixels,
                     min(a.fewest, b.fewest), max(a.most, b.most), 0u);
}

void main() {
    const uint pixels = FRAME.width * FRAME.height;
    const uint stride = gl_NumWorkGroups.x * WORKGROUP_SIZE;
    ErrorSums mine = ErrorSums(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0u, 0u, 0xffffffffu, 0u, 0u);
    for (uint pixel = gl_GlobalInvocationID.x; pixel < pixels; pixel += stride) {
        uint samples = ConstFilm(FRAME.film).v[pixel].samples;
        PixelError e = PixelError(0.0, 0.0, 0.0);
        const bool tells = fewest_of(pixel) >= 2u;
        if (tells) e = error_of(pixel);
        if (HAS_ADAPTIVE) samples += ConstFilm(FRAME.film).v[pixels + pixel].samples;
        const float doubt = e.s * e.doubt;
        mine = joined(mine, ErrorSums(e.s, e.d, e.s * e.s, e.s * e.d, e.d * e.d, doubt * doubt, e.s, pixel,
                                      tells ? 1u : 0u, samples, samples, 0u));
    }
    parts[gl_LocalInvocationIndex] = mine;
    barrier();
    // A software driver makes a coroutine of barriers, and takes seconds for those of an unrolled loop.
    [[dont_unroll]] for (uint step = WORKGROUP_SIZE / 2u; step > 0u; step /= 2u) {
        const uint at = gl_LocalInvocationIndex;
        if (at < step) parts[at] = joined(parts[at], parts[at + step]);
        barrier();
    }
    if (gl_LocalInvocationIndex == 0u) {
        const uint64_t behind = FRAME.film + uint64_t(pixels) * FILM_PIXEL_BYTES * (HAS_ADAPTIVE ? 2ul : 1ul);
        ErrorParts(behind).v[gl_WorkGroupID.x] = parts[0];
    }
}
