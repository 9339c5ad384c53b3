// SPDX-License-Identifier: Apache-2.0
// Lambertian reflection about an interpolated normal, without loss of energy.
//
// Directions are cosine distributed about the shading normal n; those that fall below the true surface (geometric
// normal g) are mirrored at it. So the density of a direction w above the surface is
//   p(w) = (max(0, n.w) + max(0, n.m(w))) / pi,  m(w) = w - 2 (g.w) g,
// it integrates to 1 over the hemisphere of g, and BSDF * cosine is albedo * p(w). With n = g it is plain Lambert; else
// it differs from the usual truncation only within the angle between n and g of the horizon, and a white surface stays
// white.
#ifndef OOCPT_LAMBERT_GLSL
#define OOCPT_LAMBERT_GLSL

const float PI = 3.14159265358979;

struct Lambert {
    vec3 g; // unit, on the viewer's side
    vec3 n; // unit, on g's side
};

// Both normals turned to the viewer, who looks along `d`.
Lambert make_lambert(vec3 geometric_normal, vec3 shading_normal, vec3 d) {
    const vec3 g = dot(geometric_normal, d) > 0.0 ? -geometric_normal : geometric_normal;
    const vec3 n = dot(shading_normal, g) < 0.0 ? -shading_normal : shading_normal;
    return Lambert(g, n);
}

// Density of w; BSDF * cosine / albedo. Zero below the surface.
float lambert_density(Lambert l, vec3 w) {
    const float cosine = dot(l.g, w);
    if (cosine <= 0.0) return 0.0;
    const vec3 mirrored = w - 2.0 * cosine * l.g;
    return (max(dot(l.n, w), 0.0) + max(dot(l.n, mirrored), 0.0)) / PI;
}

// An orthonormal frame about unit n (Duff et al. 2017, JCGT 6(1)); x and y of the result.
void tangents(vec3 n, out vec3 x, out vec3 y) {
    const float side = n.z < 0.0 ? -1.0 : 1.0;
    const float a = -1.0 / (side + n.z);
    const float b = n.x * n.y * a;
    x = vec3(1.0 + side * n.x * n.x * a, side * b, -side * n.x);
    y = vec3(b, side + n.y * n.y * a, -n.y);
}

// Unit disk from the unit square, concentric (Shirley and Chiu 1997).
vec2 disk(vec2 u) {
    const vec2 s = 2.0 * u - 1.0;
    if (s.x == 0.0 && s.y == 0.0) return vec2(0.0);
    const bool wide = abs(s.x) > abs(s.y);
    const float radius = wide ? s.x : s.y;
    const float angle = wide ? (PI / 4.0) * (s.y / s.x) : PI / 2.0 - (PI / 4.0) * (s.x / s.y);
    return radius * vec2(cos(angle), sin(angle));
}

vec3 lambert_sample(Lambert l, vec2 u) {
    vec3 x, y;
    tangents(l.n, x, y);
    const vec2 p = disk(u);
    // At the rim the disk rounds to a radius of 1 or more (sines are only good to 2^-11 there, says Vulkan): the sample
    // stands for what is half a step of u inside. A cosine of 0 would be a sample lost.
    const vec3 w = normalize(x * p.x + y * p.y + l.n * sqrt(max(1.2e-7, 1.0 - dot(p, p))));
    const float cosine = dot(l.g, w);
    return cosine < 0.0 ? w - 2.0 * cosine * l.g : w;
}

#endif
