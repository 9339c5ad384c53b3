// SPDX-License-Identifier: Apache-2.0
// Cones of directions: lights at infinity with an extent.
#ifndef OOCPT_LIGHTS_GLSL
#define OOCPT_LIGHTS_GLSL

// Uniform direction in a cone about unit `axis`.
vec3 sample_cone(vec3 axis, float one_minus_cos, vec2 u) {
    const float h = u.x * one_minus_cos;
    const float radius = sqrt(max(0.0, h * (2.0 - h)));
    const float angle = 2.0 * PI * u.y;
    vec3 x, y;
    tangents(axis, x, y);
    return normalize(x * (radius * cos(angle)) + y * (radius * sin(angle)) + axis * (1.0 - h));
}

float cone_density(float one_minus_cos) {
    return 1.0 / (2.0 * PI * one_minus_cos);
}

// 1 - cos of the angle between unit vectors, without cancellation.
float one_minus_dot(vec3 a, vec3 b) {
    const vec3 difference = a - b;
    return 0.5 * dot(difference, difference);
}

#endif
