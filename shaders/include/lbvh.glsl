// SPDX-License-Identifier: Apache-2.0
// What every LBVH pass starts with: push constants, typed arrays, thread index.
#ifndef OOCPT_LBVH_GLSL
#define OOCPT_LBVH_GLSL

#include "include/abi.glsl"

layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform PushBlock { LbvhPush push; };

layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer BoundsArray { LbvhBounds v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 8) buffer Keys { uint64_t v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer Words { uint v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) coherent buffer Nodes { LbvhNode v[]; };

const uint SORT_DIGITS = 256u;
const uint SORT_ROWS = 16u;
const uint SORT_TILE = SORT_ROWS * WORKGROUP_SIZE;

uint group_index() {
    return gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
}

uint thread_index() {
    return group_index() * WORKGROUP_SIZE + gl_LocalInvocationIndex;
}

uint sort_digit(uint64_t key) {
    return uint(key >> push.shift) & (SORT_DIGITS - 1u);
}

#endif
