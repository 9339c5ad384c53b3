// SPDX-License-Identifier: Apache-2.0
// The disk x^2 + y^2 <= 1 in the plane z = 0; shines to -z. light/shape.glsl specifies the functions.
#ifndef OOCPT_LIGHT_SHAPES_DISK_GLSL
#define OOCPT_LIGHT_SHAPES_DISK_GLSL

bool disk_faces(const vec3 o) {
    return o.z < 0.0;
}

bool disk_hit(const vec3 o, const vec3 d, out vec3 q, out float t) {
    return plane_hit(o, d, q, t) && dot(q.xy, q.xy) <= 1.0;
}

vec3 disk_point(const vec3 o, const vec2 u) {
    return vec3(disk(u), 0.0);
}

float disk_density(const float volume, const vec3 o, const vec3 d, const vec3 q, const float t) {
    return area_density(1.0 / PI, abs(d.z), volume, t);
}

#endif
