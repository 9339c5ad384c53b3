// SPDX-License-Identifier: Apache-2.0
// Estimates the film's own error: at most ERROR_GROUPS workgroups, each sums the pixels of its threads, which are
// interleaved. The sums are taken in one order: same film, same bits. Of the film path_count pixels count, from
// first_pixel on. Reads: film. Writes: ErrorSums of each workgroup, behind the film's pixels.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "wavefront/pixel_error.glsl"

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
    const uint end = push.first_pixel + push.path_count;
    for (uint pixel = push.first_pixel + gl_GlobalInvocationID.x; pixel < end; pixel += stride) {
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
