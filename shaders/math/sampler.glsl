// SPDX-License-Identifier: Apache-2.0
// Owen-scrambled Sobol points, 4 dimensions a set, sets padded by shuffling (Burley 2020, "Practical Hash-based Owen
// Scrambling", JCGT 9(4)). The twin of oocpt_abi::sampler, bit for bit.
#ifndef OOCPT_SAMPLER_GLSL
#define OOCPT_SAMPLER_GLSL

uint hash_u32(uint x) {
    x ^= x >> 16;
    x *= 0x21f0aaadu;
    x ^= x >> 15;
    x *= 0xd35a2d97u;
    x ^= x >> 15;
    return x;
}

uint hash_combine(uint seed, uint v) {
    return seed ^ (hash_u32(v) + 0x9e3779b9u + (seed << 6) + (seed >> 2));
}

uint laine_karras(uint x, uint seed) {
    x += seed;
    x ^= x * 0x6c50b47cu;
    x ^= x * 0xb82f1e52u;
    x ^= x * 0xc7afe638u;
    x ^= x * 0x8d22f6e6u;
    return x;
}

uint owen_scramble(uint x, uint seed) {
    return bitfieldReverse(laine_karras(bitfieldReverse(x), seed));
}

// Direction numbers of dimensions 1 to 3 (Joe and Kuo 2008). Dimension 0 is van der Corput's: the bit reversal.
#include "generated/sobol.glsl"

uvec4 sobol_4d(uint index) {
    uvec3 x = uvec3(0u);
    [[unroll]] for (uint bit = 0u; bit < 32u; ++bit) {
        x ^= SOBOL[bit] & uvec3(uint(bitfieldExtract(int(index), int(bit), 1)));
    }
    return uvec4(bitfieldReverse(index), x);
}

// Point `index` of set `set`, each coordinate in [0, 1) with 24 bits.
vec4 sample_4d(uint index, uint set, uint seed) {
    const uint set_seed = hash_u32(hash_combine(seed, set));
    const uvec4 x = sobol_4d(owen_scramble(index, set_seed));
    uvec4 scrambled;
    [[unroll]] for (uint d = 0u; d < 4u; ++d) {
        scrambled[d] = owen_scramble(x[d], hash_u32(hash_combine(set_seed, d)));
    }
    return vec4(scrambled >> 8) * 5.9604644775390625e-8;
}

uint pixel_seed(uint x, uint y, uint seed) {
    return hash_u32(hash_combine(hash_combine(seed, x), y));
}

#endif
