// SPDX-License-Identifier: Apache-2.0
// Streaming only: deferred rays and materials, the units they wait for, and which of them may go on. Units are chunks,
// then meshes, then tiles of textures.
#ifndef OOCPT_DEFERRED_GLSL
#define OOCPT_DEFERRED_GLSL

#include "wavefront/progress.glsl"

uint64_t pending_address(uint path, bool is_shadow) {
    return is_shadow ? STREAMING.shadow_pending : STREAMING.pending;
}

// Length of the pending list of the closest ray, or of the path's material, which waits only when that ray does not.
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

// The mesh of entry i; NO_MESH means the whole chunk instance.
uint pending_mesh(uint64_t pending, uint path, uint i) {
    return PendingLists(pending).v[path].mesh[i];
}

uint64_t alpha_test_list(bool is_shadow) {
    return is_shadow ? STREAMING.shadow_alpha_tests : STREAMING.alpha_tests;
}

// Returns true if the ray has a deferred test about the first of its list.
bool is_asked(uint path, bool is_shadow) {
    const uint64_t ray = is_shadow ? shadow_ray_address(path) : ray_address(path);
    return (ray_flags(ray) & RAY_ASKED) != 0u;
}

bool is_chunk_resident(uint chunk) {
    return Chunks(FRAME.chunks).v[chunk].nodes != 0ul;
}

bool is_mesh_resident(uint mesh) {
    return mesh == NO_MESH || Meshes(FRAME.meshes).v[mesh].nodes != 0ul;
}

// The tile that the i-th entry of a list waits for, or OWN_UNIT: it needs a chunk, and maybe a mesh.
uint pending_tile(uint entry, uint path, uint i) {
    if (!HAS_TEXTURES) return OWN_UNIT;
    const bool is_shadow = (entry & SHADOW_BIT) != 0u;
    if ((entry & MATERIAL_BIT) != 0u) return PendingLists(STREAMING.pending).v[path].chunk_instance[i];
    if (!HAS_CUTOUTS || i != 0u || !is_asked(path, is_shadow)) return OWN_UNIT;
    return DeferredAlphaTests(alpha_test_list(is_shadow)).v[path].unit;
}

// The unit that the i-th entry of a list waits for; of a chunk and a mesh the chunk, unless that is resident.
uint pending_unit(uint entry, uint path, uint i) {
    const uint tile = pending_tile(entry, path, i);
    if (tile != OWN_UNIT) return tile;
    const bool is_shadow = (entry & SHADOW_BIT) != 0u;
    const uint64_t pending = pending_address(path, is_shadow);
    const uint chunk = pending_chunk(pending, path, i);
    const uint mesh = pending_mesh(pending, path, i);
    return mesh == NO_MESH || !is_chunk_resident(chunk) ? chunk : STREAMING.chunk_count + mesh;
}

bool is_tile_resident(uint unit) {
    return TexturePages(FRAME.texture_pages).v[unit - STREAMING.first_tile] != 0ul;
}

uint path_of_entry(uint entry) {
    return entry & ~(SHADOW_BIT | MATERIAL_BIT);
}

const uint NOT_READY = 0xffffffffu;

// The sort key of a ray that goes on: its chunk, shadow rays behind all others, materials behind these. A closest ray
// waits for the first of its units, a shadow ray for any, a material for the first. With cutouts a shadow ray too waits
// for the first: its deferred test is about that one.
uint ready_key(uint entry) {
    const bool is_shadow = (entry & SHADOW_BIT) != 0u;
    const uint path = path_of_entry(entry);
    if (HAS_ROULETTE && (entry & MATERIAL_BIT) == 0u && is_ended(path, is_shadow)) {
        return is_shadow ? STREAMING.chunk_count : 0u;
    }
    const uint length = is_shadow && !HAS_CUTOUTS ? pending_length(path, true) : 1u;
    for (uint i = 0u; i < length; ++i) {
        const uint tile = pending_tile(entry, path, i);
        if (HAS_TEXTURES && (entry & MATERIAL_BIT) != 0u) {
            if (!is_tile_resident(tile)) continue;
            return 2u * STREAMING.chunk_count + (tile - STREAMING.first_tile) % TILE_KEYS;
        }
        // The deferred test is not answered: resolve_cutouts will go on with it.
        if (tile != OWN_UNIT) continue;
        const uint64_t pending = pending_address(path, is_shadow);
        const uint chunk = pending_chunk(pending, path, i);
        if (!is_chunk_resident(chunk) || !is_mesh_resident(pending_mesh(pending, path, i))) continue;
        return chunk + (is_shadow ? STREAMING.chunk_count : 0u);
    }
    return NOT_READY;
}

#endif
