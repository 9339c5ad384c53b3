// SPDX-License-Identifier: Apache-2.0
// The unit sphere; shines outwards. Points are sampled in the cone that it fills. light/shape.glsl specifies the
// functions.
#ifndef OOCPT_LIGHT_SHAPES_SPHERE_GLSL
#define OOCPT_LIGHT_SHAPES_SPHERE_GLSL

bool sphere_faces(const vec3 o) {
    return dot3(o, o) > 1.0;
}

bool sphere_hit(const vec3 o, const vec3 d, out vec3 q, out float t) {
    return round_hit(o, d, vec3(1.0), q, t);
}

// 1 - cos of the half angle of the cone that the unit sphere fills from o outside of it.
float sphere_cone(const vec3 o) {
    const float sin_squared = 1.0 / dot3(o, o);
    return sin_squared / (1.0 + sqrt(max(1.0 - sin_squared, 0.0)));
}

// Uniform in the cone; the angle at the centre from that at the receiver (Pharr et al. 2023, 6.2.4).
vec3 sphere_point(const vec3 o, const vec2 u) {
    const float distance = sqrt(dot3(o, o));
    const float h = u.x * sphere_cone(o);
    const float sin_squared = h * (2.0 - h);
    const float cos_center = sin_squared * distance
        + (1.0 - h) * sqrt(max(1.0 - sin_squared * distance * distance, 0.0));
    const float sin_center = sqrt(max(1.0 - cos_center * cos_center, 0.0));
    const vec3 axis = o / distance;
    vec3 x, y;
    tangents(axis, x, y);
    const float phi = 2.0 * PI * u.y;
    return axis * cos_center + (x * cos(phi) + y * sin(phi)) * sin_center;
}

float sphere_density(const float volume, const vec3 o, const vec3 d, const vec3 q, const float t) {
    const float size = sqrt(dot3(d, d));
    return 1.0 / (2.0 * PI * sphere_cone(o) * volume * size * size * size);
}

#endif
