// SPDX-License-Identifier: Apache-2.0
// Morton keys of 63 bits from the centres of the boxes: one thread per item.
// Reads: bounds. Writes: keys_in, items_in (what the first sort pass reads).
#version 460
#extension GL_GOOGLE_include_directive : require
#include "include/lbvh.glsl"

// Spreads 21 bits so that two zero bits follow each.
uint64_t spread(uint v) {
    uint64_t x = uint64_t(v) & 0x1ffffful;
    x = (x | (x << 32)) & 0x001f00000000fffful;
    x = (x | (x << 16)) & 0x001f0000ff0000fful;
    x = (x | (x << 8)) & 0x100f00f00f00f00ful;
    x = (x | (x << 4)) & 0x10c30c30c30c30c3ul;
    x = (x | (x << 2)) & 0x1249249249249249ul;
    return x;
}

void main() {
    const uint item = thread_index();
    if (item >= push.count) return;
    const LbvhBounds box = BoundsArray(push.bounds).v[item];
    const vec3 centre = box.min + 0.5 * (box.max - box.min);
    const vec3 cell = clamp((centre - push.origin) * push.scale, vec3(0.0), vec3(2097151.0));
    const uvec3 q = uvec3(cell);
    Keys(push.keys_in).v[item] = (spread(q.x) << 2) | (spread(q.y) << 1) | spread(q.z);
    Words(push.items_in).v[item] = item;
}
