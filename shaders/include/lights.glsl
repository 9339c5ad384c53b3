// SPDX-License-Identifier: Apache-2.0
// Choosing a light for a shadow ray, and the densities that multiple importance sampling needs.
#ifndef OOCPT_LIGHTS_GLSL
#define OOCPT_LIGHTS_GLSL

GpuDistantLight load_light(uint index) {
    return Lights(FRAME.lights).v[index];
}

// Probability that a shadow ray goes to the dome, given that the dome takes part.
float dome_probability() {
    if (!HAS_DOME) return 0.0;
    return HAS_DISTANT ? FRAME.dome_select : 1.0;
}

// The distant light that u in [0, 1) falls on.
uint choose_distant(float u) {
    uint low = 0u;
    uint high = FRAME.light_count - 1u;
    while (low < high) {
        const uint middle = (low + high) / 2u;
        if (u < Lights(FRAME.lights).v[middle].cumulative) {
            high = middle;
        } else {
            low = middle + 1u;
        }
    }
    return low;
}

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
