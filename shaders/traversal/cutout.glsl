// SPDX-License-Identifier: Apache-2.0
// Cutouts: decides from a lookup whether a surface is there.
#ifndef OOCPT_CUTOUT_GLSL
#define OOCPT_CUTOUT_GLSL

#include "texture/texture.glsl"

// Bits of DeferredAlphaTest::flags.
const uint ALPHA_TEST_TAPS = 15u; // how far the lookup is
const uint ALPHA_TEST_CHANNEL_SHIFT = 4u;
const uint ALPHA_TEST_INCLUSIVE = 64u; // there at the limit too
const uint ALPHA_TEST_PRESENT = 128u;  // the answer
const uint ALPHA_TEST_LOOKUP_SHIFT = 8u; // of a program: which of its lookups, two bits
const uint ALPHA_TEST_OF_PROGRAM = 1024u; // the answer is a texel for the program

// Returns true if the texel makes the surface opaque. `said` as continue_lookup returns it: neither scale nor bias
// apply to a fallback.
bool is_there(vec4 texel, uint status, float scale, float bias, uint flags, float limit) {
    const uint channel = (flags >> ALPHA_TEST_CHANNEL_SHIFT) & 3u;
    const float value = channel == 0u ? texel.x : channel == 1u ? texel.y : channel == 2u ? texel.z : texel.w;
    const float opacity = status == TEXTURE_FALLBACK ? value : value * scale + bias;
    return opacity > limit || ((flags & ALPHA_TEST_INCLUSIVE) != 0u && opacity == limit);
}

#endif
