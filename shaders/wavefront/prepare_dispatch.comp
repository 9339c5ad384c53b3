// SPDX-License-Identifier: Apache-2.0
// Turns queue lengths into indirect arguments and empties the queues that the next passes fill: one thread. arg0 =
// PREPARE_TRACE, round r: for intersect_closest of round r and intersect_shadow of what round r - 1 shaded. arg0 =
// PREPARE_SHADE, round r: for shade_surface and shade_background of round r. arg0 = PREPARE_DEMAND: for what reads the
// deferred rays, and for retire_paths. arg0 = PREPARE_RESOLVE: for resolve_materials. arg0 = PREPARE_SETTLE: for
// settle_closest and settle_shadow. Reads and writes: WavefrontCounters. Totals of rays are counted here, those of AOVs
// left out.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "wavefront/wavefront.glsl"

// Few rays get more threads than rays: up to SPREAD_TO in all, and up to MAX_SPREAD for one ray.
const uint SPREAD_TO = 1u << 17;
const uint MAX_SPREAD = 4u;

IndirectArgs indirect(uint count) {
    const uint needed = (count + WORKGROUP_SIZE - 1u) / WORKGROUP_SIZE;
    const uint x = min(needed, MAX_DIRECT_GROUPS);
    return IndirectArgs(x, x == 0u ? 0u : (needed + x - 1u) / x, 1u);
}

uint threads(IndirectArgs of) {
    return of.x * of.y * WORKGROUP_SIZE;
}

// Threads for the walks of rays: more than rays where there are few, for they are shared (traversal/sharing.glsl).
IndirectArgs walkers(uint rays, uint most) {
    const uint spread = HAS_STREAMING ? 1u : clamp(SPREAD_TO / max(rays, 1u), 1u, MAX_SPREAD);
    return indirect(min(rays * spread, most));
}

// Streaming: adds the counts of the last traversals to the totals.
void add_totals() {
    COUNTERS.chunk_visits += uint64_t(COUNTERS.visits);
    COUNTERS.chunk_misses += uint64_t(COUNTERS.misses);
    COUNTERS.visits = 0u;
    COUNTERS.misses = 0u;
}

void prepare_trace() {
    if (push.round == 0u) COUNTERS.shadow_count = 0u;
    uint rays = COUNTERS.ray_count[push.round & 1u];
    uint shadows = COUNTERS.shadow_count;
    const uint most = max(FRAME.most_walkers, 1u);
    COUNTERS.ray_args = indirect(rays);
    COUNTERS.trace_args = walkers(rays, most);
    COUNTERS.ray_next = threads(COUNTERS.trace_args);
    COUNTERS.shadow_args = walkers(shadows, most);
    COUNTERS.shadow_next = threads(COUNTERS.shadow_args);
    if (rays + shadows + COUNTERS.resolve_count > 0u) COUNTERS.busy_rounds += 1u;
    if (HAS_STREAMING) {
        rays -= COUNTERS.resumed_rays;
        shadows -= COUNTERS.resumed_shadows;
        COUNTERS.resumed_rays = 0u;
        COUNTERS.resumed_shadows = 0u;
    }
    if ((push.flags & PUSH_AOVS) == 0u) COUNTERS.closest_rays += uint64_t(rays);
    COUNTERS.shadow_rays += uint64_t(shadows);
    COUNTERS.surface_count = 0u;
    COUNTERS.escaped_count = 0u;
    for (uint i = 0u; HAS_DEFERRED_CUTOUTS && i < 2u; ++i) COUNTERS.settle_count[i] = 0u;
}

void prepare_shade() {
    COUNTERS.surface_args = indirect(COUNTERS.surface_count);
    COUNTERS.escaped_args = indirect(COUNTERS.escaped_count);
    COUNTERS.ray_count[(push.round + 1u) & 1u] = 0u;
    COUNTERS.shadow_count = 0u;
    if (HAS_STREAMING) add_totals();
    if (HAS_STREAMING && HAS_TEXTURES) COUNTERS.resolve_count = 0u;
}

void prepare_settle() {
    for (uint i = 0u; i < 2u; ++i) {
        COUNTERS.settle_args[i] = walkers(COUNTERS.settle_count[i], max(FRAME.most_walkers, 1u));
        COUNTERS.settle_next[i] = threads(COUNTERS.settle_args[i]);
    }
}

void prepare_demand() {
    COUNTERS.deferred_args = indirect(COUNTERS.deferred_count[COUNTERS.deferred_parity]);
    COUNTERS.retire_args = indirect(COUNTERS.freed - COUNTERS.retired_to);
    COUNTERS.retired_from = COUNTERS.retired_to;
    COUNTERS.retired_to = COUNTERS.freed;
}

void main() {
    if (thread_index() != 0u) return;
    if (push.arg0 == PREPARE_TRACE) prepare_trace();
    if (push.arg0 == PREPARE_SHADE) prepare_shade();
    if (push.arg0 == PREPARE_RESOLVE) COUNTERS.resolve_args = indirect(COUNTERS.resolve_count);
    if (push.arg0 == PREPARE_DEMAND) prepare_demand();
    if (HAS_DEFERRED_CUTOUTS && push.arg0 == PREPARE_SETTLE) prepare_settle();
}
