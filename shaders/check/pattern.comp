// SPDX-License-Identifier: Apache-2.0
// Test shader, not a pass of a render: runs operations of pattern programs for
// rust/render/tests/gpu/materials/patterns.rs. One thread per case of 14 words: operation, immediate, a, b, c. Writes a
// vec4 per case.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "abi/memory.glsl"
#include "material/pattern_ops.glsl"

layout(local_size_x = 64) in;
// Addresses of cases and results, and the number of cases.
layout(push_constant, scalar) uniform PushBlock { uint64_t push[3]; };

uint word(uint at) {
    return ConstUints(push[0]).v[at];
}

vec4 operand(uint at) {
    return uintBitsToFloat(uvec4(word(at), word(at + 1u), word(at + 2u), word(at + 3u)));
}

void main() {
    const uint thread = (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * 64u + gl_LocalInvocationID.x;
    if (thread >= uint(push[2])) return;
    const uint at = 14u * thread;
    Vec4s(push[1]).v[thread] =
        pattern_op(word(at), operand(at + 2u), operand(at + 6u), operand(at + 10u), word(at + 1u));
}
