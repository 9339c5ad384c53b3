// SPDX-License-Identifier: Apache-2.0
// The width of a lookup in a mask (decisions/0058), in few instructions. It selects the level of the mask, and any
// level has the same coverage, so it need not be exact; but it has the same bits wherever it is computed.
#ifndef OOCPT_NEAR_WIDTH_GLSL
#define OOCPT_NEAR_WIDTH_GLSL

#include "texture/footprint.glsl"

float fused_dot(vec2 a, vec2 b) {
    return fma(a.x, b.x, a.y * b.y);
}

// Width of a lookup, in texels: footprint_width of make_footprint, but for rounding; 0 if it cannot be computed. e, f:
// edges of the triangle; at_e, at_f: the growth of the place in the texture along them, in texels; cone: width of the
// ray's cone over the length of d.
//
// The gradient g on the cone's cross section of a coordinate that grows by a along e and b along f has g.e = a, g.f = b
// and g.d = 0, so it is (a (f x d) - b (e x d)) / (e . (f x d)). The ellipse's longer axis is the square root of the
// larger eigenvalue of their products; the product of both axes is |at_e x at_f| |d| / |e . (f x d)|.
float near_lookup_width(vec3 e, vec3 f, vec2 at_e, vec2 at_f, vec3 d, float cone) {
    const vec3 p = cross3(e, d);
    const vec3 q = cross3(f, d);
    const float dd = dot3(d, d);
    const float across = dot3(e, q);
    const float area = fma(at_e.x, at_f.y, -(at_e.y * at_f.x));
    const vec3 u = fma(vec3(at_e.x), q, -(at_f.x * p));
    const vec3 v = fma(vec3(at_e.y), q, -(at_f.y * p));
    const float a = dot3(u, u);
    const float b = dot3(u, v);
    const float c = dot3(v, v);
    const float half_difference = 0.5 * (a - c);
    const float longer = sqrt(0.5 * (a + c) + sqrt(fma(half_difference, half_difference, b * b)));
    const float shorter = abs(area) * sqrt(dd) / longer;
    const float least = longer / (MAX_ANISOTROPY * abs(across));
    const float width = cone * sqrt(dd) * (shorter > least ? shorter : least);
    // True if squares of squares neither over- nor underflow, and nothing is NaN.
    const bool has_range = across * across > 1.0e-30 && a + c > 1.0e-16 && a + c < 1.0e17;
    return has_range && width < 1.0e9 ? width : 0.0;
}

#endif
