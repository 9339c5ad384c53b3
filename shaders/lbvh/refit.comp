// SPDX-License-Identifier: Apache-2.0
// Boxes of the tree, leaves to root: one thread per item. Of two threads that meet at a node the second goes on.
// Reads: bounds, items_in (sorted), parents. Reads and writes: nodes, visits. Writes: depth, in levels.
// With fewer than two items it makes the only node itself, with empty boxes for absent children.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "include/lbvh.glsl"

#define INFINITE uintBitsToFloat(0x7f800000u)

void lone_node() {
    const LbvhBounds empty = LbvhBounds(vec3(INFINITE), vec3(-INFINITE));
    LbvhBounds box = empty;
    if (push.count != 0u) box = BoundsArray(push.bounds).v[0];
    Nodes(push.nodes).v[0] = LbvhNode(vec3[2](box.min, empty.min), vec3[2](box.max, empty.max), uint[2](0u, 0u), uint[2](1u, 1u));
    Words(push.depth).v[0] = 1u;
}

void main() {
    const uint thread = thread_index();
    if (push.count < 2u) {
        if (thread == 0u) lone_node();
        return;
    }
    if (thread >= push.count) return;
    LbvhBounds box = BoundsArray(push.bounds).v[Words(push.items_in).v[thread]];
    uint parent = Words(push.parents).v[push.count - 1u + thread];
    uint height = 0u;
    while (true) {
        const uint node = parent & 0x7fffffffu;
        const uint side = parent >> 31;
        Nodes(push.nodes).v[node].min[side] = box.min;
        Nodes(push.nodes).v[node].max[side] = box.max;
        memoryBarrierBuffer();
        const uint other = atomicExchange(Words(push.visits).v[node], height + 1u);
        if (other == 0u) return;
        memoryBarrierBuffer();
        height = max(height, other - 1u) + 1u;
        if (node == 0u) break;
        box.min = min(box.min, Nodes(push.nodes).v[node].min[1u - side]);
        box.max = max(box.max, Nodes(push.nodes).v[node].max[1u - side]);
        parent = Words(push.parents).v[node];
    }
    Words(push.depth).v[0] = height;
}
