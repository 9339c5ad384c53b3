// SPDX-License-Identifier: Apache-2.0
// Streaming only: deferred rays, the chunks they wait for, and which of them may go on.
#ifndef OOCPT_DEFERRED_GLSL
#define OOCPT_DEFERRED_GLSL

#include "include/progress.glsl"

uint64_t pending_address(uint path, bool is_shadow) {
    return is_shadow ? STREAMING.shadow_pending : STREAMING.pending;
}

uint pending_length(uint path, bool is_shadow) {
    const uint64_t ray = is_shadow ? shadow_ray_address(path) : ray_address(path);
    return (ConstUints(ray).v[11] >> RAY_COUNT_SHIFT) & 7u;
}

uint pending_chunk(uint64_t pending, uint path, uint i) {
    const uint instance = PendingLists(pending).v[path].chunk_instance[i];
    return ChunkInstances(FRAME.chunk_instances).v[instance].chunk;
}

const uint NOT_READY = 0xffffffffu;

// Where a ray belongs among those that go on: its chunk, shadow rays behind all others. A closest ray waits for the first of its
// chunks, a shadow ray for any.
uint ready_key(uint entry) {
    const bool is_shadow = (entry & SHADOW_BIT) != 0u;
    const uint path = entry & ~SHADOW_BIT;
    const uint64_t pending = pending_address(path, is_shadow);
    const uint length = is_shadow ? pending_length(path, true) : 1u;
    for (uint i = 0u; i < length; ++i) {
        const uint chunk = pending_chunk(pending, path, i);
        if (Chunks(FRAME.chunks).v[chunk].nodes != 0ul) return chunk + (is_shadow ? STREAMING.chunk_count : 0u);
    }
    return NOT_READY;
}

#endif
