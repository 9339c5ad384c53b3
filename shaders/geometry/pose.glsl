// SPDX-License-Identifier: Apache-2.0
// The triangles of a mesh at a time of the shutter, between two keys: each vertex is linear in time
// (oocpt_core::mesh::MeshKeys). One order of operations: the same bits in traversal and wherever surfaces are made, so
// that the test stays watertight and the error bounds of surface.glsl hold. Without HAS_DEFORMATION it is the array of
// triangles.
#ifndef OOCPT_POSE_GLSL
#define OOCPT_POSE_GLSL

#include "geometry/leaf.glsl"
#include "geometry/attribute.glsl"

const bool HAS_TIME = HAS_MOTION || HAS_DEFORMATION;

// With HAS_DEFORMATION, `later` is 0 if the mesh does not deform. With HAS_POINTS, `radii` is 0 if it has none.
struct Pose {
    uint64_t triangles;
    uint64_t later;
    uint64_t radii;
    uint radius_stride; // in bytes; 0: all have the same radius
    uint key;
    float part; // of the way from one to the other
};

Pose pose_of(uint mesh, float time) {
    Pose pose = Pose(Meshes(FRAME.meshes).v[mesh].triangles, 0ul, 0ul, 0u, 0u, 0.0);
    if (!HAS_DEFORMATION && !HAS_POINTS) return pose;
    const uint flags = Meshes(FRAME.meshes).v[mesh].flags;
    const uint keys = (flags >> MESH_KEYS_SHIFT) & 31u;
    const bool has_radii = HAS_POINTS && leaf_kind(flags) == LEAF_POINT;
    const uint item_bytes = has_radii ? POINT_BYTES : TRIANGLE_BYTES;
    const uint64_t stride = uint64_t(Meshes(FRAME.meshes).v[mesh].triangle_count) * item_bytes;
    if (has_radii) {
        pose.radii = pose.triangles + uint64_t(max(keys, 1u)) * stride + uint64_t(4u * keys);
        pose.radius_stride = (flags & MESH_OWN_RADII) != 0u ? 4u * max(keys, 1u) : 0u;
    }
    if (!HAS_DEFORMATION || keys == 0u) return pose;
    ConstFloats times = ConstFloats(pose.triangles + uint64_t(keys) * stride);
    while (pose.key + 2u < keys && times.v[pose.key + 1u] <= time) ++pose.key;
    const float begin = times.v[pose.key];
    pose.part = clamp((time - begin) / (times.v[pose.key + 1u] - begin), 0.0, 1.0);
    pose.triangles += uint64_t(pose.key) * stride;
    pose.later = pose.triangles + stride;
    if (HAS_POINTS && pose.radius_stride != 0u) pose.radii += uint64_t(4u * pose.key);
    return pose;
}

// The corner with the word behind it, which is the same at all keys.
vec4 posed_corner(Pose pose, uint corner) {
    vec4 v = ConstVec4s(pose.triangles).v[corner];
    if (HAS_DEFORMATION && pose.later != 0ul) {
        const vec3 to = ConstVec4s(pose.later).v[corner].xyz;
        v.xyz = v.xyz + pose.part * (to - v.xyz);
    }
    return v;
}

// The radius of a point. Those of its keys are side by side.
float posed_radius(Pose pose, uint item) {
    ConstFloats radii = ConstFloats(pose.radii + uint64_t(item) * pose.radius_stride);
    float radius = radii.v[0];
    if (HAS_DEFORMATION && pose.later != 0ul && pose.radius_stride != 0u) {
        radius = radius + pose.part * (radii.v[1] - radius);
    }
    return radius;
}

// Loads the vertices of an item; returns the number of its face.
uint posed_item(Pose pose, uint item, out vec3 v0, out vec3 v1, out vec3 v2) {
    if (HAS_POINTS && pose.radii != 0ul) {
        const vec4 center = posed_corner(pose, item);
        v0 = center.xyz;
        v1 = center.xyz;
        v2 = vec3(vec2(posed_radius(pose, item)), 0.0);
        return floatBitsToUint(center.w);
    }
    const vec4 first = posed_corner(pose, item * 3u);
    v0 = first.xyz;
    v1 = posed_corner(pose, item * 3u + 1u).xyz;
    v2 = posed_corner(pose, item * 3u + 2u).xyz;
    return floatBitsToUint(first.w);
}

// The number of an item's subset. Points have none.
uint item_subset(Pose pose, uint item) {
    if (HAS_POINTS && pose.radii != 0ul) return 0u;
    return floatBitsToUint(ConstVec4s(pose.triangles).v[item * 3u + 1u].w) & SUBSET_MASK;
}

// The Ptex word of a triangle, and the number of sides of its authored face. Points have none.
uvec2 ptex_word(uint mesh, uint triangle) {
    if (HAS_POINTS && leaf_kind(Meshes(FRAME.meshes).v[mesh].flags) == LEAF_POINT) return uvec2(0u);
    ConstVec4s triangles = ConstVec4s(Meshes(FRAME.meshes).v[mesh].triangles);
    const uint word = floatBitsToUint(triangles.v[triangle * 3u + 2u].w);
    const uint sides = floatBitsToUint(triangles.v[triangle * 3u + 1u].w) >> 16;
    return uvec2(word, sides);
}

// The mesh's own normal, of any length.
vec3 posed_normal(Pose pose, uint mesh, uint triangle, vec3 weights) {
    const uint64_t corners = Meshes(FRAME.meshes).v[mesh].corner_indices;
    const uint64_t normals = Meshes(FRAME.meshes).v[mesh].normals;
    const uint flags = Meshes(FRAME.meshes).v[mesh].flags;
    if (HAS_DEFORMATION && (flags & MESH_KEY_NORMALS) != 0u) {
        const uint64_t stride = uint64_t(Meshes(FRAME.meshes).v[mesh].triangle_count) * 36u;
        const uint64_t own = normals + uint64_t(pose.key) * stride;
        const vec3 from = attribute_vec3(own, corners, RATE_FACE_VARYING, triangle, weights);
        const vec3 to = attribute_vec3(own + stride, corners, RATE_FACE_VARYING, triangle, weights);
        return from + pose.part * (to - from);
    }
    return attribute_vec3(normals, corners, flags & 3u, triangle, weights);
}

#endif
