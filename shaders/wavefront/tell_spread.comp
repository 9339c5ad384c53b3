// SPDX-License-Identifier: Apache-2.0
// What the film knows of the spread of each pixel: one thread per pixel. arg0: the bits of a float, told relMSE over
// the mean of PixelError::s. Reads: film. Writes: the planes of FrameConstants::aov that are not 0: variance, of a
// sample of the picture; error, the relative standard error, whose mean square is the told relMSE. Both are 0 where a
// pixel has fewer than two samples. Adaptive: variance is the mean of that of both streams.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "wavefront/pixel_error.glsl"

vec3 sample_variance(uint pixel) {
    return stream_variance(pixel) * float(max(ConstFilm(FRAME.film).v[pixel].samples, 2u));
}

void main() {
    const uint pixel = thread_index();
    const uint pixels = FRAME.width * FRAME.height;
    if (pixel >= pixels) return;
    const bool tells = fewest_of(pixel) >= 2u;
    if (FRAME.aov.variance != 0ul) {
        vec3 variance = vec3(0.0);
        if (tells) variance = sample_variance(pixel);
        if (tells && HAS_ADAPTIVE) variance = 0.5 * (variance + sample_variance(pixels + pixel));
        Vec3s(FRAME.aov.variance).v[pixel] = variance * (FRAME.exposure * FRAME.exposure);
    }
    if (FRAME.aov.error != 0ul) {
        float error = 0.0;
        if (tells) error = sqrt(error_of(pixel).s * uintBitsToFloat(push.arg0));
        Floats(FRAME.aov.error).v[pixel] = error;
    }
}
