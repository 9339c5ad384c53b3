// SPDX-License-Identifier: Apache-2.0
// Exact sums of floats, which depend on no order: `oocpt_film::Exact` on the device, bit for bit. Integers only.
#ifndef OOCPT_EXACT_GLSL
#define OOCPT_EXACT_GLSL

#include "abi/abi.glsl"

const uint EXACT_LAST = 2u; // number of a window's highest limb

struct ExactWindow {
    int64_t limbs[3];
    uint lowest; // number of limbs[0]
};

// A float as fraction * 2^(position - EXACT_SUM_BIAS), without its sign.
struct FloatParts {
    uint fraction;
    uint position;
};

FloatParts float_parts(uint bits) {
    const uint exponent = (bits & 0x7fffffffu) >> 23;
    const uint fraction = bits & 0x7fffffu;
    // Subnormal numbers have the place of the smallest normal ones.
    return FloatParts(exponent > 0u ? fraction | 0x800000u : fraction, max(exponent, 1u) - 1u);
}

// Adds magnitude * 2^position, magnitude below 2^48.
void exact_add(inout ExactWindow window, uint64_t magnitude, uint position, bool is_negative) {
    const uint shift = position & 31u;
    const uint first = position >> 5;
    const uint64_t low = magnitude << shift;
    uint chunks[3];
    chunks[0] = uint(low);
    chunks[1] = uint(low >> 32);
    chunks[2] = shift == 0u ? 0u : uint(magnitude >> (64u - shift));
    const uint top = first + (chunks[2] != 0u ? 2u : chunks[1] != 0u ? 1u : 0u);
    const uint least = magnitude == 0ul ? 0u : max(top, EXACT_LAST) - EXACT_LAST;
    // The window moves up: what falls out below is dropped.
    for (; window.lowest < least; ++window.lowest) {
        window.limbs[0] = window.limbs[1];
        window.limbs[1] = window.limbs[2];
        window.limbs[2] = 0l;
    }
    for (uint chunk = 0u; chunk < 3u; ++chunk) {
        const uint number = first + chunk;
        if (number < window.lowest || number > window.lowest + EXACT_LAST) continue;
        const int64_t value = int64_t(uint64_t(chunks[chunk]));
        window.limbs[number - window.lowest] += is_negative ? -value : value;
    }
}

// A sample's alpha in units of 2^-EXACT_ALPHA_BITS, towards zero.
int64_t exact_alpha(float alpha) {
    const uint unit = EXACT_SUM_BIAS - EXACT_ALPHA_BITS;
    const uint bits = floatBitsToUint(alpha);
    const FloatParts parts = float_parts(bits);
    int64_t magnitude;
    if ((bits & 0x7fffffffu) >= (127u + MAX_EXACT_ALPHA) << 23) {
        magnitude = 1l << (MAX_EXACT_ALPHA + EXACT_ALPHA_BITS);
    } else if (parts.position >= unit) {
        magnitude = int64_t(uint64_t(parts.fraction)) << (parts.position - unit);
    } else {
        magnitude = unit - parts.position < 32u ? int64_t(uint64_t(parts.fraction >> (unit - parts.position))) : 0l;
    }
    return bits >> 31 != 0u ? -magnitude : magnitude;
}

ExactWindow exact_window(int64_t limbs[3], uint lowest, uint number) {
    return ExactWindow(limbs, (lowest >> (number * EXACT_LOWEST_BITS)) & ((1u << EXACT_LOWEST_BITS) - 1u));
}

// Adds a sample; one with a component of its colour that is not finite counts as black.
void exact_add_sample(inout ExactPixel pixel, vec4 value) {
    const uvec3 bits = floatBitsToUint(value.rgb);
    if (all(lessThan(bits & 0x7fffffffu, uvec3(0x7f800000u)))) {
        uint lowest = 0u;
        for (uint channel = 0u; channel < 3u; ++channel) {
            const FloatParts parts = float_parts(bits[channel]);
            ExactWindow sum = exact_window(pixel.sum[channel], pixel.lowest, channel);
            exact_add(sum, uint64_t(parts.fraction), parts.position, bits[channel] >> 31 != 0u);
            ExactWindow squares = exact_window(pixel.squares[channel], pixel.lowest, 3u + channel);
            exact_add(squares, uint64_t(parts.fraction) * uint64_t(parts.fraction), 2u * parts.position, false);
            pixel.sum[channel] = sum.limbs;
            pixel.squares[channel] = squares.limbs;
            lowest |= sum.lowest << (channel * EXACT_LOWEST_BITS);
            lowest |= squares.lowest << ((3u + channel) * EXACT_LOWEST_BITS);
        }
        pixel.lowest = lowest;
    }
    pixel.alpha += exact_alpha(value.a);
    pixel.samples += 1u;
}

#endif
