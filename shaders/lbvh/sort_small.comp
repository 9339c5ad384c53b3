// SPDX-License-Identifier: Apache-2.0
// Morton keys and their sort in one workgroup, for up to SMALL items: bitonic, by (key, item), which is what the radix
// sort gives too. One workgroup.
// Reads: bounds. Writes: keys_in, items_in, sorted.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "include/lbvh.glsl"
#include "include/morton.glsl"

const uint SMALL = 2048u;

shared uint64_t keys[SMALL];
shared uint items[SMALL];

bool comes_after(uint a, uint b) {
    return keys[a] > keys[b] || (keys[a] == keys[b] && items[a] > items[b]);
}

void exchange(uint a, uint b) {
    const uint64_t key = keys[a];
    const uint item = items[a];
    keys[a] = keys[b];
    items[a] = items[b];
    keys[b] = key;
    items[b] = item;
}

void main() {
    const uint local = gl_LocalInvocationIndex;
    uint size = 2u;
    while (size < push.count) size *= 2u;
    for (uint i = local; i < size; i += WORKGROUP_SIZE) {
        keys[i] = i < push.count ? morton_key(i) : 0xfffffffffffffffful;
        items[i] = i;
    }
    barrier();
    for (uint run = 2u; run <= size; run *= 2u) {
        for (uint gap = run / 2u; gap > 0u; gap /= 2u) {
            for (uint pair = local; pair < size / 2u; pair += WORKGROUP_SIZE) {
                const uint low = 2u * gap * (pair / gap) + pair % gap;
                const bool ascending = (low & run) == 0u;
                if (comes_after(low, low + gap) == ascending) exchange(low, low + gap);
            }
            barrier();
        }
    }
    for (uint i = local; i < push.count; i += WORKGROUP_SIZE) {
        Keys(push.keys_in).v[i] = keys[i];
        Words(push.items_in).v[i] = items[i];
    }
}
