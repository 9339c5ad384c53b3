// SPDX-License-Identifier: Apache-2.0
// The edges of a leaf's item, along which values by corner change: those of a triangle from its first corner; of a
// round one (traversal/round.glsl) its axis, and one across, along which nothing changes. Reads the mesh's triangles.
#ifndef OOCPT_ROUND_EDGES_GLSL
#define OOCPT_ROUND_EDGES_GLSL

#include "include/attribute.glsl"
#include "include/pose.glsl"

void leaf_edges(Pose pose, uint mesh, uint triangle, out vec3 e, out vec3 f) {
    const vec3 v0 = posed_corner(pose, triangle * 3u).xyz;
    const vec3 v1 = posed_corner(pose, triangle * 3u + 1u).xyz;
    const vec3 v2 = posed_corner(pose, triangle * 3u + 2u).xyz;
    e = v1 - v0;
    f = v2 - v0;
    if (HAS_ROUND && (Meshes(FRAME.meshes).v[mesh].flags & MESH_ROUND) != 0u) {
        const float radius = max(v2.x, v2.y);
        if (!(dot3(e, e) > 0.0)) e = vec3(radius, 0.0, 0.0);
        const vec3 size = abs(e);
        const vec3 least = size.x <= size.y && size.x <= size.z ? vec3(1.0, 0.0, 0.0) : size.y <= size.z ? vec3(0.0,
  1.0, 0.0) : vec3(0.0, 0.0, 1.0);       const vec3 aside = cross3(e, least);
        f = aside * (radius * inversesqrt(max(dot3(aside, aside), 1.0e-38)));
    }
}

#endif
