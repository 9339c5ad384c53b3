// SPDX-License-Identifier: Apache-2.0
// The light that rust/book/src/extending.md adds; compiled for tests alone. The triangle x, y >= -1, x + y <= 0 in the
// plane z = 0: half of the square of a rect; shines to -z. light/shape.glsl specifies the functions.
#ifndef OOCPT_LIGHT_SHAPES_TOY_LIGHT_GLSL
#define OOCPT_LIGHT_SHAPES_TOY_LIGHT_GLSL

bool toy_light_faces(const vec3 o) {
    return o.z < 0.0;
}

bool toy_light_hit(const vec3 o, const vec3 d, out vec3 q, out float t) {
    return plane_hit(o, d, q, t) && min(q.x, q.y) >= -1.0 && q.x + q.y <= 0.0;
}

// Points of the square are folded at its diagonal.
vec3 toy_light_point(const vec3 o, const vec2 u) {
    const vec2 v = u.x + u.y > 1.0 ? 1.0 - u : u;
    return vec3(2.0 * v - 1.0, 0.0);
}

float toy_light_density(const float volume, const vec3 o, const vec3 d, const vec3 q, const float t) {
    return area_density(0.5, abs(d.z), volume, t);
}

#endif
