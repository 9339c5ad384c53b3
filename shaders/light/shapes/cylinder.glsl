// SPDX-License-Identifier: Apache-2.0
// The cylinder y^2 + z^2 = 1, |x| <= 1 without caps; shines outwards. Points are sampled on the visible side.
// light/shape.glsl specifies the functions.
#ifndef OOCPT_LIGHT_SHAPES_CYLINDER_GLSL
#define OOCPT_LIGHT_SHAPES_CYLINDER_GLSL

bool cylinder_faces(const vec3 o) {
    return dot(o.yz, o.yz) > 1.0;
}

bool cylinder_hit(const vec3 o, const vec3 d, out vec3 q, out float t) {
    return round_hit(o, d, vec3(0.0, 1.0, 1.0), q, t) && abs(q.x) <= 1.0;
}

// Half the visible angle about the axis: a point is visible if its normal faces the receiver.
float cylinder_seen(const vec3 o) {
    return acos(min(inversesqrt(dot(o.yz, o.yz)), 1.0));
}

vec3 cylinder_point(const vec3 o, const vec2 u) {
    const float phi = atan(o.z, o.y) + (2.0 * u.y - 1.0) * cylinder_seen(o);
    return vec3(2.0 * u.x - 1.0, cos(phi), sin(phi));
}

float cylinder_density(const float volume, const vec3 o, const vec3 d, const vec3 q, const float t) {
    return area_density(0.25 / cylinder_seen(o), abs(dot(q.yz, d.yz)), volume, t);
}

#endif
