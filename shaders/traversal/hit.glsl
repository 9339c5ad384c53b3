// SPDX-License-Identifier: Apache-2.0
// Hit records, at FRAME.hits one per path: u, v, triangle, chunk instance, t, instance records from the chunk's down,
// hit_stride(MAX_LEVELS) bytes each (rust/abi/src/path.rs).
#ifndef OOCPT_HIT_GLSL
#define OOCPT_HIT_GLSL

// Stride in uvec4s.
const uint HIT_STRIDE = (5u + MAX_LEVELS + 3u) / 4u;

struct HitHeader {
    vec2 uv;
    uint triangle;
    uint chunk_instance;
    float t;
};

// With the first three records, which share their 16 bytes with t.
void store_hit_header(uint64_t hits, uint at, HitHeader hit, uvec3 records) {
    UVec4s(hits).v[at * HIT_STRIDE] = uvec4(floatBitsToUint(hit.uv), hit.triangle, hit.chunk_instance);
    UVec4s(hits).v[at * HIT_STRIDE + 1u] = uvec4(floatBitsToUint(hit.t), records);
}

// Levels from 3 on.
void store_hit_level(uint64_t hits, uint at, uint level, uint record) {
    Uints(hits).v[at * HIT_STRIDE * 4u + 5u + level] = record;
}

HitHeader load_hit_header(uint64_t hits, uint at) {
    const uvec4 a = ConstUVec4s(hits).v[at * HIT_STRIDE];
    const uint t = ConstUints(hits).v[at * HIT_STRIDE * 4u + 4u];
    return HitHeader(uintBitsToFloat(a.xy), a.z, a.w, uintBitsToFloat(t));
}

uint load_hit_level(uint64_t hits, uint at, uint level) {
    return ConstUints(hits).v[at * HIT_STRIDE * 4u + 5u + level];
}

#endif
