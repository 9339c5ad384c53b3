// SPDX-License-Identifier: Apache-2.0
// Chunks of a live view whose records are placed from the arrays of their instancers, and what changed in these.
#ifndef OOCPT_HELD_CHUNKS_GLSL
#define OOCPT_HELD_CHUNKS_GLSL

#include "abi/memory.glsl"

layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer HeldChunks { GpuHeldChunk v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer ChunkMembers { GpuChunkMember v[]; };

// Whether an array has another element for the instance of a record than when it was placed last.
bool is_changed(GpuHeldChunk chunk, uint record) {
    const uvec2 place = ConstUVec2s(chunk.places).v[record];
    ChunkMembers members = ChunkMembers(chunk.members);
    if (place.y >= members.v[place.x].count) return false;
    for (uint k = 0u; k < 4u; ++k) {
        const uint64_t changed = members.v[place.x].changed[k];
        if (changed == 0ul) continue;
        if (changed == uint64_t(ALL_CHANGED)) return true;
        if ((ConstUints(changed).v[place.y / 32u] >> (place.y % 32u) & 1u) != 0u) return true;
    }
    return false;
}

#endif
