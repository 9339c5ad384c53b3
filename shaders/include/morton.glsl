// SPDX-License-Identifier: Apache-2.0
// Morton keys of 63 bits, 21 per axis.
#ifndef OOCPT_MORTON_GLSL
#define OOCPT_MORTON_GLSL

// Spreads 21 bits so that two zero bits follow each.
uint64_t spread_bits(uint v) {
    uint64_t x = uint64_t(v) & 0x1ffffful;
    x = (x | (x << 32)) & 0x001f00000000fffful;
    x = (x | (x << 16)) & 0x001f0000ff0000fful;
    x = (x | (x << 8)) & 0x100f00f00f00f00ful;
    x = (x | (x << 4)) & 0x10c30c30c30c30c3ul;
    x = (x | (x << 2)) & 0x1249249249249249ul;
    return x;
}

// Key of the centre of an item's box.
uint64_t morton_key(uint item) {
    const LbvhBounds box = BoundsArray(push.bounds).v[item];
    const vec3 centre = box.min + 0.5 * (box.max - box.min);
    const uvec3 q = uvec3(clamp((centre - push.origin) * push.scale, vec3(0.0), vec3(2097151.0)));
    return (spread_bits(q.x) << 2) | (spread_bits(q.y) << 1) | spread_bits(q.z);
}

#endif
