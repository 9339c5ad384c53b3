// SPDX-License-Identifier: Apache-2.0
// Streaming only: deferred rays and materials, the units they wait for, and which of them may go on. Units are chunks,
// then tiles of textures.
#ifndef OOCPT_DEFERRED_GLSL
#define OOCPT_DEFERRED_GLSL

#include "include/progress.glsl"

uint64_t pending_address(uint path, bool is_shadow) {
    return is_shadow ? STREAMING.shadow_pending : STREAMING.pending;
}

// Of the closest ray, or of the path's material, which waits only when that ray does not.
uint pending_length(uint path, bool is_shadow) {
    const uint64_t ray = is_shadow ? shadow_ray_address(path) : ray_address(path);
    return waiting_count(ray_flags(ray));
}

bool is_ended(uint path, bool is_shadow) {
    const uint64_t ray = is_shadow ? shadow_ray_address(path) : ray_address(path);
    return (ray_flags(ray) & RAY_ENDED) != 0u;
}

uint pending_chunk(uint64_t pending, uint path, uint i) {
    const uint instance = PendingLists(pending).v[path].chunk_instance[i];
    return ChunkInstances(FRAME.chunk_instances).v[instance].chunk;
}

uint64_t question_list(bool is_shadow) {
    return is_shadow ? STREAMING.shadow_questions : STREAMING.questions;
}

// Whether the ray has a question about the first of its list.
bool is_asked(uint path, bool is_shadow) {
    const uint64_t ray = is_shadow ? shadow_ray_address(path) : ray_address(path);
    return (ray_flags(ray) & RAY_ASKED) != 0u;
}

// What the i-th entry of a list waits for.
uint pending_unit(uint entry, uint path, uint i) {
    const bool is_shadow = (entry & SHADOW_BIT) != 0u;
    const uint64_t pending = pending_address(path, is_shadow);
    if (HAS_TEXTURES) {
        if ((entry & MATERIAL_BIT) != 0u) return PendingLists(pending).v[path].chunk_instance[i];
        if (HAS_CUTOUTS && i == 0u && is_asked(path, is_shadow)) {
            const uint unit = Questions(question_list(is_shadow)).v[path].unit;
            if (unit != OWN_UNIT) return unit;
        }
    }
    return pending_chunk(pending, path, i);
}

bool is_resident(uint unit) {
    if (!HAS_TEXTURES || unit < STREAMING.chunk_count) return Chunks(FRAME.chunks).v[unit].nodes != 0ul;
    return TexturePages(FRAME.texture_pages).v[unit - STREAMING.chunk_count] != 0ul;
}

uint path_of_entry(uint entry) {
    return entry & ~(SHADOW_BIT | MATERIAL_BIT);
}

const uint NOT_READY = 0xffffffffu;

// Where a ray belongs among those that go on: its chunk, shadow rays behind all others, materials behind these. A
// closest ray waits for the first of its units, a shadow ray for any, a material for the first. With cutouts a shadow
// ray too waits for the first: its question is about that one.
uint ready_key(uint entry) {
    const bool is_shadow = (entry & SHADOW_BIT) != 0u;
    const uint path = path_of_entry(entry);
    if (HAS_ROULETTE && (entry & MATERIAL_BIT) == 0u && is_ended(path, is_shadow)) {
        return is_shadow ? STREAMING.chunk_count : 0u;
    }
    const uint length = is_shadow && !HAS_CUTOUTS ? pending_length(path, true) : 1u;
    for (uint i = 0u; i < length; ++i) {
        const uint unit = pending_unit(entry, path, i);
        if (!is_resident(unit)) continue;
        // Not answered: resolve_cutouts is to go on with it.
        if (HAS_CUTOUTS && (entry & MATERIAL_BIT) == 0u && unit >= STREAMING.chunk_count) continue;
        if (HAS_TEXTURES && (entry & MATERIAL_BIT) != 0u) return 2u * STREAMING.chunk_count + unit % TILE_KEYS;
        const uint chunk = pending_chunk(pending_address(path, is_shadow), path, i);
        return chunk + (is_shadow ? STREAMING.chunk_count : 0u);
    }
    return NOT_READY;
}

#endif
