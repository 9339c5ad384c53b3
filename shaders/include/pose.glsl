// SPDX-License-Identifier: Apache-2.0
// The triangles of a mesh at a time of the shutter: those of two keys, between which each vertex is linear in time
// (oocpt_core::mesh::MeshKeys). One order of operations: the same bits in traversal and wherever surfaces are made, so
// that the test stays watertight and the error bounds of surface.glsl hold. Without HAS_DEFORMATION it is the array of
// triangles.
#ifndef OOCPT_POSE_GLSL
#define OOCPT_POSE_GLSL

#include "include/attribute.glsl"

const bool HAS_TIME = HAS_MOTION || HAS_DEFORMATION;
const uint TRIANGLE_BYTES = 48u;

// With HAS_DEFORMATION: `later` is 0 for what does not move.
struct Pose {
    uint64_t triangles;
    uint64_t later;
    uint key;
    float part; // of the way from one to the other
};

Pose pose_of(uint mesh, float time) {
    Pose pose = Pose(Meshes(FRAME.meshes).v[mesh].triangles, 0ul, 0u, 0.0);
    if (!HAS_DEFORMATION) return pose;
    const uint keys = (Meshes(FRAME.meshes).v[mesh].flags >> MESH_KEYS_SHIFT) & 31u;
    if (keys == 0u) return pose;
    const uint64_t stride = uint64_t(Meshes(FRAME.meshes).v[mesh].triangle_count) * TRIANGLE_BYTES;
    ConstFloats times = ConstFloats(pose.triangles + uint64_t(keys) * stride);
    while (pose.key + 2u < keys && times.v[pose.key + 1u] <= time) ++pose.key;
    const float begin = times.v[pose.key];
    pose.part = clamp((time - begin) / (times.v[pose.key + 1u] - begin), 0.0, 1.0);
    pose.triangles += uint64_t(pose.key) * stride;
    pose.later = pose.triangles + stride;
    return pose;
}

// With the word behind it, which is the same at all keys.
vec4 posed_corner(Pose pose, uint corner) {
    vec4 v = ConstVec4s(pose.triangles).v[corner];
    if (HAS_DEFORMATION && pose.later != 0ul) {
        const vec3 to = ConstVec4s(pose.later).v[corner].xyz;
        v.xyz = v.xyz + pose.part * (to - v.xyz);
    }
    return v;
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
