// SPDX-License-Identifier: Apache-2.0
// Ray against the two boxes of a node: the robust slab test of Ize 2013, "Robust BVH Ray Traversal".
#ifndef OOCPT_BOX_GLSL
#define OOCPT_BOX_GLSL

// 1 + 2 gamma(3), rounded up.
const float SLAB_PAD = 1.00000048;

// Components of a zero direction get a huge finite reciprocal: no infinity, hence no 0 * inf.
vec3 safe_reciprocal(vec3 d) {
    const float tiny = 1.0e-37;
    const bvec3 small = lessThan(abs(d), vec3(tiny));
    const uvec3 signs = floatBitsToUint(d) & 0x80000000u;
    return 1.0 / mix(d, uintBitsToFloat(signs | floatBitsToUint(tiny)), small);
}

// Entry distance, or a negative number for a miss. The planes are chosen by sign, so an inverted (empty) box is missed.
float hit_box(vec3 lower, vec3 upper, vec3 o, vec3 reciprocal, bvec3 negative, float limit) {
    const vec3 entry = (mix(lower, upper, negative) - o) * reciprocal;
    const vec3 leave = (mix(upper, lower, negative) - o) * reciprocal;
    const float near = max(max(entry.x, entry.y), max(entry.z, 0.0));
    const float far = min(min(leave.x, leave.y), leave.z) * SLAB_PAD;
    return near <= far && near <= limit ? near : -1.0;
}

#endif
