// SPDX-License-Identifier: Apache-2.0
// Hit records: uv, triangle, instance records from the root, hit_stride(MAX_LEVELS) bytes each (rust/shader_abi/src/abi/path.rs).
#ifndef OOCPT_HIT_GLSL
#define OOCPT_HIT_GLSL

// In vec4s.
const uint HIT_STRIDE = (3u + MAX_LEVELS + 3u) / 4u;

void store_hit_header(uint slot, vec2 uv, uint triangle, uint record) {
    Vec4s(FRAME.hits).v[slot * HIT_STRIDE] = vec4(uv, uintBitsToFloat(uvec2(triangle, record)));
}

void store_hit_level(uint slot, uint level, uint record) {
    Uints(FRAME.hits).v[slot * HIT_STRIDE * 4u + 3u + level] = record;
}

// uv, and the bits of triangle and of the root's record.
vec4 load_hit_header(uint slot) {
    return ConstVec4s(FRAME.hits).v[slot * HIT_STRIDE];
}

uint load_hit_level(uint slot, uint level) {
    return ConstUints(FRAME.hits).v[slot * HIT_STRIDE * 4u + 3u + level];
}

#endif
