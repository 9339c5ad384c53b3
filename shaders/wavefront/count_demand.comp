// SPDX-License-Identifier: Apache-2.0
// Streaming only. Counts, unit by unit, the rays that wait for it first and those that have it further down their list:
// one thread per deferred ray, WavefrontCounters::deferred_args. A ray whose first item is a mesh needs its chunk at
// the same time: it counts for both, whether one of them is there or not, and each is noted as a partner of the other.
// A material will need all of its list, whatever comes: each counts as waited for.
// Reads: deferred, rays and shadow_rays (flags), pending lists, chunks. Adds to: demand. Pushes to: demanded, each unit
// once.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "wavefront/wavefront.glsl"
#include "wavefront/deferred.glsl"

void count(uint unit, bool is_first, bool wanted) {
    const uint word = unit + (is_first ? 0u : STREAMING.unit_count);
    if (add_to_nothing(STREAMING.demand, word, wanted)
        && atomicExchange(Uints(STREAMING.demand).v[unit + 2u * STREAMING.unit_count], 1u) == 0u) {
        const uint slot = atomicAdd(Uints(STREAMING.demand_counts).v[0], 1u);
        if (slot < STREAMING.demanded_capacity) Uints(STREAMING.demanded).v[slot] = unit;
    }
}

void main() {
    const uint at = thread_index();
    const uint list = COUNTERS.deferred_parity;
    if (!HAS_STREAMING || at >= COUNTERS.deferred_count[list]) return;
    const uint entry = ConstUints(STREAMING.deferred[list]).v[at];
    const bool is_shadow = (entry & SHADOW_BIT) != 0u;
    const uint path = path_of_entry(entry);
    const uint64_t pending = pending_address(path, is_shadow);
    const uint length = pending_length(path, is_shadow);
    for (uint i = 0u; i < MAX_PENDING; ++i) {
        const bool wanted = i < length;
        const bool is_first = i == 0u || (entry & MATERIAL_BIT) != 0u;
        count(wanted ? pending_unit(entry, path, i) : 0u, is_first, wanted);
    }
    const bool needs_mesh = length > 0u && (entry & MATERIAL_BIT) == 0u && pending_tile(entry, path, 0u) == OWN_UNIT
        && pending_mesh(pending, path, 0u) != NO_MESH;
    const uint chunk = needs_mesh ? pending_chunk(pending, path, 0u) : 0u;
    const uint mesh = needs_mesh ? STREAMING.chunk_count + pending_mesh(pending, path, 0u) : 0u;
    const bool counts_chunk = needs_mesh && is_chunk_resident(chunk); // then the mesh was counted
    count(counts_chunk ? chunk : mesh, true, needs_mesh);
    if (needs_mesh) {
        const uint partners = 3u * STREAMING.unit_count;
        Uints(STREAMING.demand).v[partners + chunk] = mesh + 1u;
        Uints(STREAMING.demand).v[partners + mesh] = chunk + 1u;
    }
}
