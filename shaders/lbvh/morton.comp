// SPDX-License-Identifier: Apache-2.0
// Morton keys from the centres of the boxes: one thread per item.
// Reads: bounds. Writes: keys_in, items_in (what the first sort pass reads).
#version 460
#extension GL_GOOGLE_include_directive : require
#include "include/lbvh.glsl"
#include "include/morton.glsl"

void main() {
    const uint item = thread_index();
    if (item >= push.count) return;
    Keys(push.keys_in).v[item] = morton_key(item);
    Words(push.items_in).v[item] = item;
}
