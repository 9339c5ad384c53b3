// SPDX-License-Identifier: Apache-2.0
// The operations of pattern programs (rust/abi/src/pattern.rs, `PatternOp`). The twin is rust/materialx/src/eval.rs:
// the same bits but for division, roots, logarithms, powers and arcs. Operands are normal numbers or +0, as results
// are; results are finite for other operands, too.
#ifndef OOCPT_PATTERN_OPS_GLSL
#define OOCPT_PATTERN_OPS_GLSL

#include "abi/abi.glsl"
#include "material/pattern_noise.glsl"

// Replaces numbers that are not finite, smaller than 2^-126, or -0 by +0. It tests the bits, because comparisons of
// numbers that are not finite are not reliable.
vec4 pattern_number(vec4 v) {
    const uvec4 exponent = floatBitsToUint(v) & 0x7f800000u;
    return mix(vec4(0.0), v, lessThan(exponent - 0x00800000u, uvec4(0x7f000000u)));
}

vec4 pattern_divide(vec4 a, vec4 b) {
    return mix(a / b, vec4(0.0), equal(b, vec4(0.0)));
}

// The quotient may be rounded to the other side of a whole number; the remainder is corrected then.
vec4 pattern_modulo(vec4 a, vec4 b) {
    vec4 rest = a - b * floor(a / b);
    rest = mix(rest, rest + b, lessThan(mix(rest, -rest, lessThan(b, vec4(0.0))), vec4(0.0)));
    rest = mix(rest, rest - b, greaterThanEqual(abs(rest), abs(b)));
    return mix(vec4(0.0), rest, lessThan(abs(rest), abs(b)));
}

// (-1)^parity sin(x - halves pi), where that angle is within a quarter of a turn but for rounding. pi is in three parts
// whose products with `halves` are exact up to 2^12; the polynomial is off by 4e-9.
vec4 pattern_sine(vec4 x, vec4 halves, vec4 parity) {
    const vec4 limit = vec4(1.58);
    const vec4 r = clamp(x - halves * 3.140625 - halves * 0.0009675026 - halves * 1.509958e-7, -limit, limit);
    const vec4 u = r * r;
    const vec4 p = ((2.604814e-6 * u - 0.0001980889) * u + 0.008333049) * u - 0.16666658;
    const vec4 sine = clamp(r + r * u * p, vec4(-1.0), vec4(1.0));
    return mix(-sine, sine, equal(parity * 0.5, floor(parity * 0.5)));
}

vec4 pattern_sin(vec4 x) {
    const vec4 halves = floor(x * 0.31830987 + 0.5);
    return pattern_sine(x, halves, halves);
}

vec4 pattern_cos(vec4 x) {
    const vec4 halves = floor(x * 0.31830987);
    return pattern_sine(x, halves + 0.5, halves + 1.0);
}

// 1 where b = 0, else 0 where a = 0; of a negative a only with a whole b.
vec4 pattern_power(vec4 a, vec4 b) {
    const vec4 zero = vec4(0.0);
    const bvec4 negative = lessThan(a, zero);
    const vec4 size = pow(mix(abs(a), vec4(1.0), equal(a, zero)), b);
    const bvec4 odd = notEqual(b * 0.5, floor(b * 0.5));
    const bvec4 whole = equal(b, floor(b));
    const vec4 signed_size = mix(size, mix(zero, mix(size, -size, odd), whole), negative);
    return mix(mix(signed_size, zero, equal(a, zero)), vec4(1.0), equal(b, zero));
}

vec4 pattern_smoothstep(vec4 a, vec4 low, vec4 high) {
    const vec4 t = (a - low) / (high - low);
    const vec4 inside = t * t * (3.0 - 2.0 * t);
    return mix(mix(inside, vec4(0.0), lessThanEqual(a, low)), vec4(1.0), greaterThanEqual(a, high));
}

// Arcs of 0 or of a point on an axis are exact.
vec4 pattern_atan2(vec4 y, vec4 x) {
    const vec4 zero = vec4(0.0);
    const bvec4 on_axis = equal(y, zero);
    const vec4 axis = mix(zero, vec4(3.1415927), lessThan(x, zero));
    return mix(atan(mix(y, vec4(1.0), on_axis), x), axis, on_axis);
}

float pattern_dot(vec4 a, vec4 b) {
    return a.x * b.x + a.y * b.y + a.z * b.z + a.w * b.w;
}

// The first `count` components times a power of two that keeps squares in range; its inverse.
vec4 pattern_scaled(vec4 a, uint count, out float inverse) {
    const float big = 1.1805916e21; // 2^70
    a = mix(vec4(0.0), a, lessThan(uvec4(0u, 1u, 2u, 3u), uvec4(count)));
    const vec4 size = abs(a);
    const float most = max(max(size.x, size.y), max(size.z, size.w));
    const bool above = most > 1.1529215e18;
    const bool below = most < 8.6736174e-19;
    inverse = above ? big : below ? 1.0 / big : 1.0;
    return a * (above ? 1.0 / big : below ? big : 1.0);
}

vec4 pattern_swizzle(vec4 a, uint places) {
    vec4 result;
    for (uint k = 0u; k < 4u; ++k) {
        const uint place = places >> (3u * k) & 7u;
        result[k] = place < 4u ? a[place] : place == 5u ? 1.0 : 0.0;
    }
    return result;
}

// Foley and van Dam, "Computer Graphics", as MaterialX has it: grey has the hue 0, black the saturation 0.
vec4 pattern_rgb_to_hsv(vec4 c) {
    const float most = max(c.r, max(c.g, c.b));
    const float range = most - min(c.r, min(c.g, c.b));
    const float saturation = most > 0.0 ? range / most : 0.0;
    if (!(saturation > 0.0)) return vec4(0.0, 0.0, most, c.a);
    const bool red = c.r >= most;
    const bool green = c.g >= most;
    const float difference = red ? c.g - c.b : green ? c.b - c.r : c.r - c.g;
    const float sixth = (red ? 0.0 : green ? 2.0 : 4.0) + difference / range;
    const float hue = sixth * (1.0 / 6.0);
    return vec4(hue < 0.0 ? hue + 1.0 : hue, saturation, most, c.a);
}

// The inverse of pattern_rgb_to_hsv; colors of a saturation below 0.0001 are grey.
vec4 pattern_hsv_to_rgb(vec4 c) {
    const float s = c.y;
    const float v = c.z;
    if (s < 0.0001) return vec4(vec3(v), c.a);
    const float hue = 6.0 * (c.x - floor(c.x));
    const float sector = floor(hue);
    const float f = hue - sector;
    const float p = v * (1.0 - s);
    const float q = v * (1.0 - s * f);
    const float t = v * (1.0 - s * (1.0 - f));
    if (sector < 1.0) return vec4(v, t, p, c.a);
    if (sector < 2.0) return vec4(q, v, p, c.a);
    if (sector < 3.0) return vec4(p, v, t, c.a);
    if (sector < 4.0) return vec4(p, q, v, c.a);
    if (sector < 5.0) return vec4(t, p, v, c.a);
    return vec4(v, p, q, c.a);
}

// Noise and fractal sums: one place in the code for all of them. The last component is that of another point.
vec4 pattern_perlin(uint op, vec4 a, vec4 b, uint immediate) {
    const bool solid = op == PATTERN_NOISE3 || op == PATTERN_NOISE3_VECTOR || op == PATTERN_FRACTAL3;
    const bool octaves = op == PATTERN_FRACTAL2 || op == PATTERN_FRACTAL3;
    const uint shape = octaves ? immediate : uint(op == PATTERN_NOISE2_VECTOR || op == PATTERN_NOISE3_VECTOR);
    const vec3 offset = octaves ? vec3(19.0, 193.0, 17.0) : vec3(19.0, 73.0, 29.0);
    const uint count = octaves ? uint(clamp(b.x, 0.0, float(PATTERN_OCTAVES))) : 1u;
    const vec2 factors = octaves ? b.yz : vec2(1.0);
    vec3 p = a.xyz;
    vec3 here = vec3(0.0);
    float there = 0.0;
    for (uint i = 0u; i < (shape == 0u ? 1u : 2u); ++i) {
        const vec3 sum = perlin_sum(p, solid, i == 0u && shape == 1u, count, factors.x, factors.y);
        if (i == 0u) here = sum;
        there = sum.x;
        p += offset;
    }
    if (shape == 0u) return vec4(there);
    return shape == 1u ? vec4(here, there) : vec4(here.x, there, 0.0, 0.0);
}

// Cell noise and cellular noise.
vec4 pattern_cellular(uint op, vec4 a, vec4 b, uint immediate) {
    const bool solid = op == PATTERN_CELL_NOISE3 || op == PATTERN_WORLEY3;
    vec3 p = solid ? a.xyz : vec3(a.xy, 0.0);
    uint shape = 3u;
    if (op == PATTERN_WORLEY2 || op == PATTERN_WORLEY3) {
        vec3 nearest;
        const vec3 distances = worley_noise(p, solid, b.x, nearest);
        if (immediate == 0u) return vec4(distances.x);
        if (immediate <= 2u) return vec4(distances.xy, immediate == 1u ? 0.0 : distances.z, 0.0);
        p = nearest;
        shape = immediate;
    }
    const vec4 random = cell_noise(p, solid);
    return shape == 3u ? vec4(random.w) : vec4(random.xyz, 0.0);
}

vec4 pattern_vector(uint op, vec4 a, vec4 b, uint immediate) {
    float inverse;
    switch (op) {
    case PATTERN_DOT:
        return vec4(pattern_dot(mix(vec4(0.0), a, lessThan(uvec4(0u, 1u, 2u, 3u), uvec4(immediate))), b));
    case PATTERN_CROSS: {
        const vec3 up = a.yzx * b.zxy;
        return vec4(up - a.zxy * b.yzx, 0.0);
    }
    case PATTERN_NORMALIZE: {
        const vec4 v = pattern_scaled(a, immediate, inverse);
        return pattern_divide(v, vec4(sqrt(pattern_dot(v, v))));
    }
    case PATTERN_LENGTH: {
        const vec4 v = pattern_scaled(a, immediate, inverse);
        return vec4(sqrt(pattern_dot(v, v)) * inverse);
    }
    case PATTERN_SWIZZLE: return pattern_swizzle(a, immediate);
    case PATTERN_BLEND: return mix(a, b, notEqual(uvec4(immediate) & uvec4(1u, 2u, 4u, 8u), uvec4(0u)));
    case PATTERN_RGB_TO_HSV: return pattern_rgb_to_hsv(a);
    case PATTERN_HSV_TO_RGB: return pattern_hsv_to_rgb(a);
    default: return vec4(0.0);
    }
}

vec4 pattern_component(uint op, vec4 a, vec4 b, vec4 c) {
    const vec4 zero = vec4(0.0);
    const vec4 one = vec4(1.0);
    switch (op) {
    case PATTERN_MOVE: return a;
    case PATTERN_ADD: return a + b;
    case PATTERN_SUBTRACT: return a - b;
    case PATTERN_MULTIPLY: return a * b;
    case PATTERN_DIVIDE: return pattern_divide(a, b);
    case PATTERN_MODULO: return pattern_modulo(a, b);
    case PATTERN_ABSOLUTE: return abs(a);
    case PATTERN_SIGN: return mix(mix(zero, one, greaterThan(a, zero)), -one, lessThan(a, zero));
    case PATTERN_FLOOR: return floor(a);
    case PATTERN_CEIL: return ceil(a);
    case PATTERN_ROUND: return floor(a) + mix(zero, one, greaterThanEqual(a - floor(a), vec4(0.5)));
    case PATTERN_FRACT: return a - floor(a);
    case PATTERN_POWER: return pattern_power(a, b);
    case PATTERN_SQRT: return sqrt(max(a, zero));
    case PATTERN_LN: return mix(zero, log(mix(one, a, greaterThan(a, zero))), greaterThan(a, zero));
    case PATTERN_EXP: return exp(a);
    case PATTERN_SIN: return pattern_sin(a);
    case PATTERN_COS: return pattern_cos(a);
    case PATTERN_TAN: return pattern_divide(pattern_sin(a), pattern_cos(a));
    case PATTERN_ASIN: return asin(clamp(a, -one, one));
    case PATTERN_ACOS: return acos(clamp(a, -one, one));
    case PATTERN_ATAN2: return pattern_atan2(a, b);
    case PATTERN_MIN: return min(a, b);
    case PATTERN_MAX: return max(a, b);
    case PATTERN_MIX: return a * (one - c) + b * c;
    case PATTERN_CLAMP: return min(max(a, b), c);
    case PATTERN_SMOOTHSTEP: return pattern_smoothstep(a, b, c);
    case PATTERN_MULTIPLY_ADD: return a * b + c;
    case PATTERN_GREATER: return mix(zero, one, greaterThan(a, b));
    case PATTERN_GREATER_EQUAL: return mix(zero, one, greaterThanEqual(a, b));
    case PATTERN_EQUAL: return mix(zero, one, equal(a, b));
    case PATTERN_SELECT: return mix(a, b, equal(c, zero));
    default: return zero;
    }
}

// The result of an operation; 0 for PATTERN_SURFACE and PATTERN_TEXTURE, which the caller evaluates.
vec4 pattern_op(uint op, vec4 a, vec4 b, vec4 c, uint immediate) {
    vec4 result;
    switch (op) {
    case PATTERN_NOISE2:
    case PATTERN_NOISE2_VECTOR:
    case PATTERN_NOISE3:
    case PATTERN_NOISE3_VECTOR:
    case PATTERN_FRACTAL2:
    case PATTERN_FRACTAL3: result = pattern_perlin(op, a, b, immediate); break;
    case PATTERN_CELL_NOISE2:
    case PATTERN_CELL_NOISE3:
    case PATTERN_WORLEY2:
    case PATTERN_WORLEY3: result = pattern_cellular(op, a, b, immediate); break;
    case PATTERN_DOT:
    case PATTERN_CROSS:
    case PATTERN_NORMALIZE:
    case PATTERN_LENGTH:
    case PATTERN_SWIZZLE:
    case PATTERN_BLEND:
    case PATTERN_RGB_TO_HSV:
    case PATTERN_HSV_TO_RGB: result = pattern_vector(op, a, b, immediate); break;
    default: result = pattern_component(op, a, b, c);
    }
    return pattern_number(result);
}

#endif
