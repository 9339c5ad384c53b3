// SPDX-License-Identifier: Apache-2.0
// The origin; shines the same in all directions. light/shape.glsl specifies the functions.
#ifndef OOCPT_LIGHT_SHAPES_POINT_GLSL
#define OOCPT_LIGHT_SHAPES_POINT_GLSL

vec3 point_point(const vec3 o, const vec2 u) {
    return vec3(0.0);
}

float point_length(const GpuLocalLight light, const vec3 w) {
    return 1.0;
}

#endif
