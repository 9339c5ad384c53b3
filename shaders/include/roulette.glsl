// SPDX-License-Identifier: Apache-2.0
// Roulette on loads only: which waiting rays it is about, and what they may bring. oocpt_core::residency::roulette decides.
#ifndef OOCPT_ROULETTE_GLSL
#define OOCPT_ROULETTE_GLSL

#include "include/deferred.glsl"

#define ROULETTE RouletteBlock(STREAMING.roulette).r

// Whether an entry of the list of deferred rays waits for a chunk; if so for which first.
bool waits_for_chunk(uint entry, out uint chunk) {
    chunk = STREAMING.chunk_count;
    if ((entry & MATERIAL_BIT) != 0u) return false;
    chunk = pending_unit(entry, path_of_entry(entry), 0u);
    return chunk < STREAMING.chunk_count;
}

// Camera rays are not played with: their radiance has no weight, nor has alpha.
bool is_played(uint entry) {
    return (entry & SHADOW_BIT) != 0u || ConstUints(ray_address(path_of_entry(entry))).v[3] != 0u;
}

#endif
