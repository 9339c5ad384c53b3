// SPDX-License-Identifier: Apache-2.0
// Live views only. Writes the changed elements of an array of an instancer. A thread for each of push.count elements.
// Reads: push.source, of each element its number and its push.words words. Writes: push.target, and of each element
// the bit in push.changed.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "abi/memory.glsl"

layout(buffer_reference, scalar, buffer_reference_align = 4) buffer ChangedElements { uint v[]; };

layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform PushBlock { PlacingPush push; };

void main() {
    const uint group = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    const uint entry = group * WORKGROUP_SIZE + gl_LocalInvocationIndex;
    if (entry >= push.count) return;
    ConstUints changed = ConstUints(push.source);
    Uints target = Uints(push.target);
    const uint at = entry * (push.words + 1u);
    const uint element = changed.v[at];
    atomicOr(ChangedElements(push.changed).v[element / 32u], 1u << (element % 32u));
    for (uint word = 0u; word < push.words; ++word) target.v[element * push.words + word] = changed.v[at + 1u + word];
}
