// SPDX-License-Identifier: Apache-2.0
// The binary radix tree over the sorted keys (Karras 2012): one thread per item; thread i makes inner node i.
// Equal keys are told apart by their place in the order, which the stable sort made the order of items.
// Reads: keys_in, items_in (sorted). Writes: child and count of nodes, parents, visits = 0.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "include/lbvh.glsl"

// Length of the common prefix of keys i and j; -1 outside of the array.
int common_prefix(int i, int j) {
    if (j < 0 || j >= int(push.count)) return -1;
    const uint64_t difference = Keys(push.keys_in).v[i] ^ Keys(push.keys_in).v[j];
    const uint high = uint(difference >> 32);
    if (high != 0u) return 31 - findMSB(high);
    const uint low = uint(difference);
    if (low != 0u) return 63 - findMSB(low);
    return 95 - findMSB(uint(i) ^ uint(j));
}

// The other end of the keys of inner node i, which grow in direction `step`.
int other_end(int i, int step) {
    const int shortest = common_prefix(i, i - step);
    int reach = 2;
    while (common_prefix(i, i + reach * step) > shortest) reach *= 2;
    int length = 0;
    for (int part = reach / 2; part >= 1; part /= 2) {
        if (common_prefix(i, i + (length + part) * step) > shortest) length += part;
    }
    return i + length * step;
}

// The last key of the first child, for the keys first..last.
int split_of(int first, int last) {
    const int prefix = common_prefix(first, last);
    int split = first;
    int part = last - first;
    do {
        part = (part + 1) / 2;
        if (split + part < last && common_prefix(first, split + part) > prefix) split += part;
    } while (part > 1);
    return split;
}

void link(uint node, uint side, int place, bool leaf) {
    Nodes(push.nodes).v[node].child[side] = leaf ? Words(push.items_in).v[place] : uint(place);
    Nodes(push.nodes).v[node].count[side] = leaf ? 1u : 0u;
    const uint slot = leaf ? push.count - 1u + uint(place) : uint(place);
    Words(push.parents).v[slot] = node | side << 31;
}

void main() {
    const uint thread = thread_index();
    if (push.count < 2u || thread >= push.count - 1u) return;
    const int i = int(thread);
    const int step = common_prefix(i, i + 1) > common_prefix(i, i - 1) ? 1 : -1;
    const int end = other_end(i, step);
    const int first = min(i, end);
    const int last = max(i, end);
    const int split = split_of(first, last);
    link(thread, 0u, split, split == first);
    link(thread, 1u, split + 1, split + 1 == last);
    Words(push.visits).v[thread] = 0u;
}
