// SPDX-License-Identifier: Apache-2.0
// A node of a tree: four children, their boxes in 8 bits per plane (after Ylitie, Karras and Laine 2017). In meshes it
// takes three vectors of 16 bytes, and children lie one after the other; in all levels above four, and children are
// named. Of each box the plane where the ray comes in and the one where it leaves are taken by the signs of its
// direction.
//
// The distance along the ray to a plane is fma(number, cell * reciprocal, (origin of the grid - origin of the ray) *
// reciprocal), give or take the padding. Cells are powers of two; what rounds, by 2^-24 each, are the difference, its
// product, the padding, and the product with the number where a device does not fuse it: of the grid's distance, which
// is at most the plane's and the grid's size, four times in all, and of the sum once. What goes with the plane's
// distance is in SLAB_PAD; what goes with the grid's size, in the padding of meshes and in the margin of all other
// boxes.
#ifndef OOCPT_NODE_GLSL
#define OOCPT_NODE_GLSL

#include "traversal/box.glsl"
#include "traversal/stack.glsl"

// Entry distance of a child that is not met.
const float MISSED = MAX_FLOAT;

struct Node {
    vec3 scale; // distance along the ray from one plane of the grid to the next
    // Distance to the planes of number 0 where the ray enters, reduced by the box's padding.
    vec3 near_from;
    vec3 far_from;
    uvec3 near; // planes where the ray comes in, a byte to a child
    uvec3 far;
    uvec4 children; // references
};

// `counts`: two bits to a child; nodes come first, as many as the highest bits of `first` say.
uvec4 mesh_children(uint counts, uint first, uint first_triangle) {
    const uint inner = first >> 28;
    const uint node = first & 0x0fffffffu;
    uvec4 children;
    uint triangle = first_triangle;
    for (uint i = 0u; i < 4u; ++i) {
        const uint count = (counts >> (2u * i)) & 3u;
        children[i] = i < inner ? node + i : count == 0u ? ABSENT : LEAF | (count - 1u) << 28 | triangle;
        triangle += count;
    }
    return children;
}

// Turns references to leaves that name a bundle of points each into references to its points. All bundles are full but
// the first one, which has the rest of `count` points.
uvec4 bundle_members(uvec4 children, uint count) {
    const uint missing = -count & (POINT_BUNDLE - 1u);
    for (uint i = 0u; i < 4u; ++i) {
        if (children[i] == ABSENT || (children[i] & LEAF) == 0u) continue;
        const uint end = POINT_BUNDLE * ((children[i] & 0x0fffffffu) + 1u) - missing;
        const uint begin = end - min(end, POINT_BUNDLE);
        children[i] = LEAF | (end - begin - 1u) << 28 | begin;
    }
    return children;
}

Node load_node(uint64_t nodes, uint reference, bool in_mesh, vec3 o, vec3 reciprocal, float pad) {
    const uint at = reference * (in_mesh ? 3u : 4u);
    const uvec4 a = ConstUVec4s(nodes).v[at];
    const uvec4 b = ConstUVec4s(nodes).v[at + 1u];
    const uvec4 c = ConstUVec4s(nodes).v[at + 2u];
    const uvec3 lower = b.xyz;
    const uvec3 upper = uvec3(b.w, c.xy);
    const bvec3 is_backward = lessThan(reciprocal, vec3(0.0));
    const vec3 from = (uintBitsToFloat(a.xyz) - o) * reciprocal;
    const vec3 around = pad * abs(reciprocal);
    Node node;
    node.scale = uintBitsToFloat((uvec3(a.w, a.w >> 8, a.w >> 16) & 255u) << 23) * reciprocal;
    node.near_from = from - around;
    node.far_from = from + around;
    node.near = mix(lower, upper, is_backward);
    node.far = mix(upper, lower, is_backward);
    node.children = in_mesh ? mesh_children(a.w >> 24, c.z, c.w) : uvec4(c.zw, ConstUVec4s(nodes).v[at + 3u].xy);
    return node;
}

// The distance at which the ray enters the box of child `i`, or MISSED.
float hit_child(Node node, uint i, float limit) {
    const vec3 a = fma(vec3((node.near >> (8u * i)) & 255u), node.scale, node.near_from);
    const vec3 b = fma(vec3((node.far >> (8u * i)) & 255u), node.scale, node.far_from);
    const float enter = max(max(a.x, a.y), max(a.z, 0.0));
    const float leave = min(min(b.x, b.y), b.z) * SLAB_PAD;
    return node.children[i] != ABSENT && enter <= min(leave, limit) ? enter : MISSED;
}

// Puts the nearer of two children first.
void sort_pair(inout vec4 entries, inout uvec4 children, uint i, uint j) {
    if (entries[j] < entries[i]) {
        const float entry = entries[i];
        const uint child = children[i];
        entries[i] = entries[j];
        children[i] = children[j];
        entries[j] = entry;
        children[j] = child;
    }
}

#endif
