// SPDX-License-Identifier: Apache-2.0
// Owen-scrambled Sobol points, 4 dimensions a set, sets padded by shuffling (Burley 2020, "Practical Hash-based Owen
// Scrambling", JCGT 9(4)). The twin of oocpt_core::sampler, bit for bit.
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

// Direction numbers of dimensions 1 to 3 (Joe and Kuo 2008): degrees 1, 2, 3; a = 0, 1, 1; m = {1}, {1, 3}, {1, 3, 1}.
// Dimension 0 is van der Corput's: the bit reversal.
const uvec3 SOBOL[32] = uvec3[32](
    uvec3(0x80000000u, 0x80000000u, 0x80000000u),
    uvec3(0xc0000000u, 0xc0000000u, 0xc0000000u),
    uvec3(0xa0000000u, 0x60000000u, 0x20000000u),
    uvec3(0xf0000000u, 0x90000000u, 0x50000000u),
    uvec3(0x88000000u, 0xe8000000u, 0xf8000000u),
    uvec3(0xcc000000u, 0x5c000000u, 0x74000000u),
    uvec3(0xaa000000u, 0x8e000000u, 0xa2000000u),
    uvec3(0xff000000u, 0xc5000000u, 0x93000000u),
    uvec3(0x80800000u, 0x68800000u, 0xd8800000u),
    uvec3(0xc0c00000u, 0x9cc00000u, 0x25400000u),
    uvec3(0xa0a00000u, 0xee600000u, 0x59e00000u),
    uvec3(0xf0f00000u, 0x55900000u, 0xe6d00000u),
    uvec3(0x88880000u, 0x80680000u, 0x78080000u),
    uvec3(0xcccc0000u, 0xc09c0000u, 0xb40c0000u),
    uvec3(0xaaaa0000u, 0x60ee0000u, 0x82020000u),
    uvec3(0xffff0000u, 0x90550000u, 0xc3050000u),
    uvec3(0x80008000u, 0xe8808000u, 0x208f8000u),
    uvec3(0xc000c000u, 0x5cc0c000u, 0x51474000u),
    uvec3(0xa000a000u, 0x8e606000u, 0xfbea2000u),
    uvec3(0xf000f000u, 0xc5909000u, 0x75d93000u),
    uvec3(0x88008800u, 0x6868e800u, 0xa0858800u),
    uvec3(0xcc00cc00u, 0x9c9c5c00u, 0x914e5400u),
    uvec3(0xaa00aa00u, 0xeeee8e00u, 0xdbe79e00u),
    uvec3(0xff00ff00u, 0x5555c500u, 0x25db6d00u),
    uvec3(0x80808080u, 0x8000e880u, 0x58800080u),
    uvec3(0xc0c0c0c0u, 0xc0005cc0u, 0xe54000c0u),
    uvec3(0xa0a0a0a0u, 0x60008e60u, 0x79e00020u),
    uvec3(0xf0f0f0f0u, 0x9000c590u, 0xb6d00050u),
    uvec3(0x88888888u, 0xe8006868u, 0x800800f8u),
    uvec3(0xccccccccu, 0x5c009c9cu, 0xc00c0074u),
    uvec3(0xaaaaaaaau, 0x8e00eeeeu, 0x200200a2u),
    uvec3(0xffffffffu, 0xc5005555u, 0x50050093u)
);

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
