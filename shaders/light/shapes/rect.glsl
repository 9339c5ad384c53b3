// SPDX-License-Identifier: Apache-2.0
// The square |x| <= 1, |y| <= 1 in the plane z = 0; shines to -z. light/shape.glsl specifies the functions.
#ifndef OOCPT_LIGHT_SHAPES_RECT_GLSL
#define OOCPT_LIGHT_SHAPES_RECT_GLSL

bool rect_faces(const vec3 o) {
    return o.z < 0.0;
}

bool rect_hit(const vec3 o, const vec3 d, out vec3 q, out float t) {
    return plane_hit(o, d, q, t) && max(abs(q.x), abs(q.y)) <= 1.0;
}

vec3 rect_point(const vec3 o, const vec2 u) {
    return vec3(2.0 * u - 1.0, 0.0);
}

float rect_density(const float volume, const vec3 o, const vec3 d, const vec3 q, const float t) {
    return area_density(0.25, abs(d.z), volume, t);
}

#endif
