// SPDX-License-Identifier: Apache-2.0
// The segment |x| <= 1 of the x axis; shines with the sine of the angle to it. light/shape.glsl specifies the
// functions.
#ifndef OOCPT_LIGHT_SHAPES_LINE_GLSL
#define OOCPT_LIGHT_SHAPES_LINE_GLSL

vec3 line_point(const vec3 o, const vec2 u) {
    return vec3(2.0 * u.x - 1.0, 0.0, 0.0);
}

float line_length(const GpuLocalLight light, const vec3 w) {
    const float half_length = sqrt(dot3(light.x, light.x));
    const vec3 across = cross3(light.x / half_length, w);
    return 2.0 * half_length * sqrt(dot3(across, across));
}

#endif
