// SPDX-License-Identifier: Apache-2.0
// Cutouts: what a lookup says about whether a surface is there.
#ifndef OOCPT_CUTOUT_GLSL
#define OOCPT_CUTOUT_GLSL

#include "texture/texture.glsl"

// Bits of DeferredAlphaTest::flags.
const uint QUESTION_TAPS = 15u; // how far the lookup is
const uint QUESTION_CHANNEL_SHIFT = 4u;
const uint QUESTION_INCLUSIVE = 64u; // there at the limit too
const uint QUESTION_PRESENT = 128u;  // the answer
const uint QUESTION_LOOKUP_SHIFT = 8u; // of a program: which of its lookups, two bits
const uint QUESTION_OF_PROGRAM = 1024u; // the answer is a texel for the program

// `said` as continue_lookup gives it: neither scale nor bias apply to a fallback.
bool is_there(vec4 texel, uint said, float scale, float bias, uint flags, float limit) {
    const uint channel = (flags >> QUESTION_CHANNEL_SHIFT) & 3u;
    const float value = channel == 0u ? texel.x : channel == 1u ? texel.y : channel == 2u ? texel.z : texel.w;
    const float opacity = said == TEXTURE_FALLBACK ? value : value * scale + bias;
    return opacity > limit || ((flags & QUESTION_INCLUSIVE) != 0u && opacity == limit);
}

#endif
