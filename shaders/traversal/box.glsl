// SPDX-License-Identifier: Apache-2.0
// Ray against a box: the robust slab test of Ize 2013, "Robust BVH Ray Traversal". Trees of meshes and instances:
// traversal/node.glsl.
#ifndef OOCPT_BOX_GLSL
#define OOCPT_BOX_GLSL

#include "abi/constants.glsl"

const float MAX_FLOAT = 3.402823466e38;

// No component counts as smaller than 2^-60 of the largest one: distances up to 1e20, in units of d, have a finite
// product with the reciprocal, hence no infinity and no 0 * inf; and a ray leaves its line by at most 1e-18 of its
// length.
vec3 safe_reciprocal(vec3 d) {
    const float tiny = max(largest_of(d) * 8.673617e-19, 1.0e-37);
    const bvec3 small = lessThan(abs(d), vec3(tiny));
    const uvec3 signs = floatBitsToUint(d) & 0x80000000u;
    return 1.0 / mix(d, uintBitsToFloat(signs | floatBitsToUint(tiny)), small);
}

// Entry distance, or a negative number for a miss. A ray leaves an empty box (+inf, -inf) at infinity, and only such a
// one. Distances to the lower planes are taken from `o_lower`, to the upper ones from `o_upper`: equal, or apart to pad
// the box.
float hit_box(vec3 lower, vec3 upper, vec3 o_lower, vec3 o_upper, vec3 reciprocal, float limit) {
    const vec3 a = (lower - o_lower) * reciprocal;
    const vec3 b = (upper - o_upper) * reciprocal;
    const vec3 entry = min(a, b);
    const vec3 leave = max(a, b);
    const float near = max(max(entry.x, entry.y), max(entry.z, 0.0));
    const float far = min(min(leave.x, leave.y), leave.z) * SLAB_PAD;
    return near <= min(far, limit) && far <= MAX_FLOAT ? near : -1.0;
}

#endif
