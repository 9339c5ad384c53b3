// SPDX-License-Identifier: Apache-2.0
// Radix sort, step 1 of a pass: how often each digit occurs in each tile of 1024 keys. One workgroup per tile.
// Reads: keys_in. Writes: histogram[digit][tile].
#version 460
#extension GL_GOOGLE_include_directive : require
#include "include/lbvh.glsl"

shared uint counts[SORT_DIGITS];

void main() {
    const uint tile = group_index();
    const uint local = gl_LocalInvocationIndex;
    for (uint digit = local; digit < SORT_DIGITS; digit += WORKGROUP_SIZE) counts[digit] = 0u;
    barrier();
    for (uint row = 0u; row < SORT_ROWS; ++row) {
        const uint at = tile * SORT_TILE + row * WORKGROUP_SIZE + local;
        if (tile < push.groups && at < push.count) atomicAdd(counts[sort_digit(Keys(push.keys_in).v[at])], 1u);
    }
    barrier();
    if (tile >= push.groups) return;
    for (uint digit = local; digit < SORT_DIGITS; digit += WORKGROUP_SIZE) {
        Words(push.histogram).v[digit * push.groups + tile] = counts[digit];
    }
}
