// SPDX-License-Identifier: Apache-2.0
// Streaming only. Lists the units that rays wait for, with their demand, for the host: what it reads is in proportion
// to what was asked for, not to the scene. Any number of threads. Where `demanded` could not hold all, every unit is
// looked at, so that none keeps the demand of this step. What does not fit the list asks again in the next step.
// Reads: demanded, demand_counts. Pushes to: demand_list. Reads and zeroes: demand.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "wavefront/wavefront.glsl"

void main() {
    if (!HAS_STREAMING) return;
    Uints counts = Uints(STREAMING.demand_counts);
    Uints demand = Uints(STREAMING.demand);
    const uint threads = gl_NumWorkGroups.y * gl_NumWorkGroups.x * gl_WorkGroupSize.x;
    const bool is_whole = counts.v[0] <= STREAMING.demanded_capacity;
    const uint count = is_whole ? counts.v[0] : STREAMING.unit_count;
    for (uint i = thread_index(); i < count; i += threads) {
        const uint unit = is_whole ? ConstUints(STREAMING.demanded).v[i] : i;
        const uint waiting = demand.v[unit];
        const uint next = demand.v[unit + STREAMING.unit_count];
        if ((waiting | next) == 0u) continue;
        const uint partner = demand.v[unit + 3u * STREAMING.unit_count];
        for (uint part = 0u; part < 4u; ++part) demand.v[unit + part * STREAMING.unit_count] = 0u;
        const uint entry = atomicAdd(counts.v[1], 1u);
        if (entry >= STREAMING.demand_capacity) continue;
        DemandList(STREAMING.demand_list).v[entry] = UnitDemand(unit, waiting, next, partner);
    }
}
