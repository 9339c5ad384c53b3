// SPDX-License-Identifier: Apache-2.0
// Streaming only. Counts, unit by unit, the rays that wait for it first and those that have it further down their list:
// one thread per deferred ray, Counters::deferred_args. A material will need all of its list, whatever comes: each
// counts as waited for.
// Reads: deferred, rays and shadow_rays (flags), pending lists. Adds to: demand. Pushes to: demanded, each unit
// once.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "include/wavefront.glsl"
#include "include/deferred.glsl"

void main() {
    const uint at = thread_index();
    const uint list = COUNTERS.deferred_parity;
    if (!HAS_STREAMING || at >= COUNTERS.deferred_count[list]) return;
    const uint entry = ConstUints(STREAMING.deferred[list]).v[at];
    const bool is_shadow = (entry & SHADOW_BIT) != 0u;
    const uint path = path_of_entry(entry);
    const uint length = pending_length(path, is_shadow);
    for (uint i = 0u; i < MAX_PENDING; ++i) {
        const bool wanted = i < length;
        const uint unit = wanted ? pending_unit(entry, path, i) : 0u;
        const uint word = unit + (i == 0u || (entry & MATERIAL_BIT) != 0u ? 0u : STREAMING.unit_count);
        if (add_to_nothing(STREAMING.demand, word, wanted)
            && atomicExchange(Uints(STREAMING.demand).v[unit + 2u * STREAMING.unit_count], 1u) == 0u) {
            const uint slot = atomicAdd(Uints(STREAMING.demand_counts).v[0], 1u);
            if (slot < STREAMING.demanded_capacity) Uints(STREAMING.demanded).v[slot] = unit;
        }
    }
}
