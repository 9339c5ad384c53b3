// SPDX-License-Identifier: Apache-2.0
// The picture so far: one thread per pixel. Reads: film, with shadow catchers FrameConstants::plane_sums. Writes:
// color, premultiplied, times the camera's exposure, over the clear colour. Adaptive: half of each stream, however many
// samples they have.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "wavefront/wavefront.glsl"
#include "wavefront/shadow_images.glsl"

void main() {
    const uint pixel = thread_index();
    const uint pixels = FRAME.width * FRAME.height;
    if (pixel >= pixels) return;
    const uint samples = Film(FRAME.film).v[pixel].samples;
    vec4 mean = Film(FRAME.film).v[pixel].sum / float(max(samples, 1u));
    if (HAS_ADAPTIVE && Film(FRAME.film).v[pixels + pixel].samples > 0u) {
        const vec4 other = Film(FRAME.film).v[pixels + pixel].sum / float(Film(FRAME.film).v[pixels + pixel].samples);
        mean = 0.5 * (mean + other);
    }
    if (HAS_SHADOW_SUMS && FRAME.catcher_at != NO_INDEX) mean.a += caught_alpha(pixel);
    mean.rgb *= FRAME.exposure;
    Vec4s(FRAME.color).v[pixel] = mean + FRAME.clear_color * (1.0 - mean.a);
}
