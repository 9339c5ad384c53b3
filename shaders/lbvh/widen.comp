// SPDX-License-Identifier: Apache-2.0
// The binary tree to one four wide, in place: a node at an even depth takes up its grandchildren, one thread per node.
// Nobody else reads such a node; those at odd depths, which nobody writes, are read by their parent and then used no
// more. Planes are rounded outwards and a little further (core/src/mesh/bvh4.rs, which makes the same nodes on the
// host).
// Reads: parents, depth. Reads and writes: nodes. Writes: depth, as stack entries that a walk may need.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "include/lbvh.glsl"

layout(buffer_reference, scalar, buffer_reference_align = 16) writeonly buffer LevelNodes { GpuLevelNode v[]; };

const float CELLS = 253.0;
// In cells: twice what a walk may round a plane by.
const float MARGIN = 1.0 / 8192.0;
const uint LEAF = 1u << 31;
const uint ABSENT = 0xffffffffu;

struct Children {
    vec3 lower[4];
    vec3 upper[4];
    uint reference[4];
    uint count;
};

void add_child(inout Children children, uint node, uint side) {
    const LbvhNode n = Nodes(push.nodes).v[node];
    if (n.min[side].x > n.max[side].x) return;
    children.lower[children.count] = n.min[side];
    children.upper[children.count] = n.max[side];
    children.reference[children.count] = n.count[side] == 0u ? n.child[side] : LEAF | n.child[side];
    ++children.count;
}

bool is_at_odd_depth(uint node) {
    bool is_odd = false;
    while (node != 0u) {
        node = Words(push.parents).v[node] & 0x7fffffffu;
        is_odd = !is_odd;
    }
    return is_odd;
}

// The biased exponents of the smallest powers of two that are not below, and whose reciprocals are normal.
uvec3 cell_exponents(vec3 edges) {
    const uvec3 bits = floatBitsToUint(edges);
    return clamp((bits >> 23) + uvec3(notEqual(bits & 0x7fffffu, uvec3(0u))), 1u, 253u);
}

void main() {
    const uint node = thread_index();
    if (node >= max(push.count, 2u) - 1u || is_at_odd_depth(node)) return;
    Children children;
    children.count = 0u;
    for (uint side = 0u; side < 2u; ++side) {
        if (Nodes(push.nodes).v[node].count[side] == 0u) {
            const uint below = Nodes(push.nodes).v[node].child[side];
            add_child(children, below, 0u);
            add_child(children, below, 1u);
        } else {
            add_child(children, node, side);
        }
    }
    vec3 lower = vec3(0.0);
    vec3 upper = vec3(0.0);
    for (uint i = 0u; i < children.count; ++i) {
        lower = i == 0u ? children.lower[0] : min(lower, children.lower[i]);
        upper = i == 0u ? children.upper[0] : max(upper, children.upper[i]);
    }
    const vec3 spare = max(max(upper / 256.0 - lower / 256.0, abs(lower) * 2.384185791015625e-7), vec3(1.0e-30));
    const vec3 origin = lower - spare;
    const uvec3 exponents = cell_exponents(upper / CELLS - origin / CELLS);
    const vec3 cells = uintBitsToFloat((254u - exponents) << 23); // in a unit
    GpuLevelNode wide;
    wide.origin = floatBitsToUint(origin);
    wide.cell = exponents.x | exponents.y << 8 | exponents.z << 16;
    wide.lower = uvec3(0u);
    wide.upper = uvec3(0u);
    wide.pad = uint[2](0u, 0u);
    for (uint i = 0u; i < 4u; ++i) {
        wide.child[i] = i < children.count ? children.reference[i] : ABSENT;
        if (i >= children.count) continue;
        const vec3 a = clamp(floor((children.lower[i] - origin) * cells - MARGIN), 0.0, 255.0);
        const vec3 b = clamp(ceil((children.upper[i] - origin) * cells + MARGIN), 0.0, 255.0);
        wide.lower |= uvec3(a) << (8u * i);
        wide.upper |= uvec3(b) << (8u * i);
    }
    LevelNodes(push.nodes).v[node] = wide;
    // Two levels of the binary tree to one here, where three children may wait.
    if (node == 0u) Words(push.depth).v[0] = 3u * ((Words(push.depth).v[0] + 1u) / 2u);
}
