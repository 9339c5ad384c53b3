// SPDX-License-Identifier: Apache-2.0
// Attributes of a mesh at a point of a triangle. `weights` are those of the three corners.
#ifndef OOCPT_ATTRIBUTE_GLSL
#define OOCPT_ATTRIBUTE_GLSL

// Indices of the three values to interpolate; all the same for a rate without corners.
uvec3 attribute_indices(uint64_t corner_indices, uint rate, uint triangle) {
    if (rate == RATE_CONSTANT) return uvec3(0u);
    if (rate == RATE_UNIFORM) return uvec3(triangle);
    const uint first = triangle * 3u;
    if (rate == RATE_FACE_VARYING) return uvec3(first, first + 1u, first + 2u);
    ConstUints corners = ConstUints(corner_indices);
    return uvec3(corners.v[first], corners.v[first + 1u], corners.v[first + 2u]);
}

vec3 attribute_vec3(uint64_t values, uint64_t corner_indices, uint rate, uint triangle, vec3 weights) {
    const uvec3 i = attribute_indices(corner_indices, rate, triangle);
    ConstVec3s a = ConstVec3s(values);
    if (i.x == i.y && i.y == i.z) return a.v[i.x];
    return a.v[i.x] * weights.x + a.v[i.y] * weights.y + a.v[i.z] * weights.z;
}

float attribute_float(uint64_t values, uint64_t corner_indices, uint rate, uint triangle, vec3 weights) {
    const uvec3 i = attribute_indices(corner_indices, rate, triangle);
    ConstFloats a = ConstFloats(values);
    if (i.x == i.y && i.y == i.z) return a.v[i.x];
    return a.v[i.x] * weights.x + a.v[i.y] * weights.y + a.v[i.z] * weights.z;
}

#endif
