// SPDX-License-Identifier: Apache-2.0
// The edges of a leaf's item, along which values by corner change. Those of a triangle start at its first corner;
// another kind defines its own (geometry/leaf.glsl). Reads the mesh's items.
#ifndef OOCPT_EDGES_GLSL
#define OOCPT_EDGES_GLSL

#include "geometry/leaf.glsl"
#include "geometry/attribute.glsl"
#include "geometry/pose.glsl"

void item_edges(Pose pose, uint mesh, uint triangle, out vec3 e, out vec3 f) {
    vec3 v0, v1, v2;
    posed_item(pose, triangle, v0, v1, v2);
    e = v1 - v0;
    f = v2 - v0;
    if (HAS_LEAF_KINDS && (Meshes(FRAME.meshes).v[mesh].flags & MESH_LEAF_MASK) != 0u) {
        leaf_edges(leaf_kind(Meshes(FRAME.meshes).v[mesh].flags), v0, v1, v2, e, f);
    }
}

#endif
