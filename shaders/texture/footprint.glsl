// SPDX-License-Identifier: Apache-2.0
// The footprint of a ray's cone in a texture: an ellipse, the affine image of the cone's circular cross section
// (Heckbert 1989, 3.5). It is kept for a cone of width 1, in 8 bytes, and computed from those in core as well, so the
// bits are those of streaming. decisions/0018.
//
// A lookup is filtered as wide as the ellipse's shorter axis. Along the longer one the samples of a pixel, which are
// spread over the same ellipse, do the rest; so that a few of them suffice, at most MAX_ANISOTROPY widths go to its
// length. The twin in f64 is rust/core/src/texture/footprint.rs.
#ifndef OOCPT_FOOTPRINT_GLSL
#define OOCPT_FOOTPRINT_GLSL

#include "math/affine.glsl"
#include "abi/constants.glsl"

// Limit of 1 / cos.
const float MAX_SLANT = 1.0e4;
// Below 2^126: Vulkan divides by no more, for the reciprocal may be flushed to 0.
const float MAX_FOOTPRINT = 8.0e37;

// The larger eigenvalue of a symmetric matrix with diagonal (a, c).
float larger_eigenvalue(float a, float b, float c) {
    const float half_difference = 0.5 * (a - c);
    return 0.5 * (a + c) + sqrt(half_difference * half_difference + b * b);
}

// An ellipse: its longer axis, length and direction (of length 1 or more; either end), and the shorter one over the
// longer one. x: the length's bits. y, lower half: x / (|x| + |y|) of the direction's end with y >= 0, in units of 1 /
// 32767; upper half: the ratio with 9 bits of mantissa. Integers round, so that all drivers agree. 0: no footprint, the
// finest level.
uvec2 pack_footprint(float length, vec2 direction, float ratio) {
    const float sum = abs(direction.x) + abs(direction.y);
    const float x = sum > 0.0 ? (direction.y < 0.0 ? -direction.x : direction.x) / sum : 1.0;
    const int steps = int(floor(x * 32767.0 + 0.5));
    const uint share = (floatBitsToUint(clamp(ratio, 0.0, 1.0)) + 0x2000u) >> 14;
    return uvec2(floatBitsToUint(length), (uint(steps) & 0xffffu) | share << 16);
}

// The axes, the longer one first, for a length of 1; `length` is returned apart, since it may be any number.
mat2 unpack_footprint(uvec2 footprint, out float length) {
    length = uintBitsToFloat(footprint.x);
    const float x = float(bitfieldExtract(int(footprint.y), 0, 16)) * (1.0 / 32767.0);
    const vec2 direction = vec2(x, 1.0 - abs(x));
    const vec2 along = direction * inversesqrt(dot(direction, direction));
    return mat2(along, vec2(-along.y, along.x) * uintBitsToFloat((footprint.y >> 16) << 14));
}

// The footprint of a cone of width 1 along d (of any length) that cuts a plane with normal n (of any length) on which a
// texture's coordinates have gradients u and v. 0 if these are 0 or not finite.
uvec2 make_footprint(vec3 u, vec3 v, vec3 n, vec3 d) {
    // Points move along d onto the plane: gradients on the cross section are those on the plane less what is along n,
    // so that nothing is left along d. Their products are those of the rows of the map from the section, in any basis
    // of it.
    const float across = dot3(n, d);
    const float least = sqrt(dot3(n, n)) * sqrt(dot3(d, d)) / MAX_SLANT;
    const float bounded = abs(across) > least ? across : (across < 0.0 ? -least : least);
    if (!(abs(bounded) > 0.0)) return uvec2(0u);
    const vec3 p = u - n * (dot3(u, d) / bounded);
    const vec3 q = v - n * (dot3(v, d) / bounded);
    const vec3 size = max(abs(p), abs(q));
    const float largest = max(size.x, max(size.y, size.z));
    if (!(largest > 0.0)) return uvec2(0u);
    if (largest > MAX_FOOTPRINT) return pack_footprint(MAX_FOOTPRINT, vec2(1.0, 0.0), 1.0);
    const vec3 r = p / largest;
    const vec3 s = q / largest;
    const float a = dot3(r, r);
    const float b = dot3(r, s);
    const float c = dot3(s, s);
    const float most = larger_eigenvalue(a, b, c);
    if (!(most > 0.0)) return uvec2(0u);
    const vec3 area = cross3(r, s);
    const vec2 direction = a >= c ? vec2(most - c, b) : vec2(b, most - a);
    return pack_footprint(min(largest * sqrt(most), MAX_FOOTPRINT), direction, sqrt(dot3(area, area)) / most);
}

// Width of the filter, in texels of level 0, for a cone of width `cone`. `s` and `t`: the linear part of the map from
// the coordinates to the texture's square; `size`: its texels. Never NaN.
float footprint_width(uvec2 footprint, float cone, vec2 s, vec2 t, uvec2 size) {
    float length;
    const mat2 axes = unpack_footprint(footprint, length);
    const vec2 texels = vec2(size);
    const vec2 p = vec2(dot(s, axes[0]), dot(t, axes[0])) * texels;
    const vec2 q = vec2(dot(s, axes[1]), dot(t, axes[1])) * texels;
    const vec2 most = max(abs(p), abs(q));
    const float largest = max(most.x, most.y);
    if (!(largest > 0.0)) return 0.0;
    const vec2 r = p / largest;
    const vec2 l = q / largest;
    const float longer = sqrt(larger_eigenvalue(r.x * r.x + l.x * l.x, r.x * r.y + l.x * l.y, r.y * r.y + l.y * l.y));
    const float shorter = abs(r.x * l.y - r.y * l.x) / longer;
    const float width = cone * length * (largest * max(shorter, longer / MAX_ANISOTROPY));
    return width > 0.0 ? width : 0.0;
}

#endif
