// SPDX-License-Identifier: Apache-2.0
// Streaming only. Puts the deferred rays that may go on into the queues, those of one chunk side by side, and the
// others on the other list: one thread per deferred ray, WavefrontCounters::deferred_args.
// Reads: deferred, rays and shadow_rays (flags), pending lists, chunks, meshes, sort_sums. Writes: sort_counts;
// ray_queue[round & 1] and shadow_queue from where there is room, with textures resolve_queue too; pushes to deferred.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "wavefront/wavefront.glsl"
#include "wavefront/deferred.glsl"

void main() {
    const uint at = thread_index();
    const uint now = COUNTERS.deferred_parity;
    const bool in_range = HAS_STREAMING && at < COUNTERS.deferred_count[now ^ 1u];
    uint entry = 0u;
    uint key = NOT_READY;
    if (in_range) {
        entry = ConstUints(STREAMING.deferred[now ^ 1u]).v[at];
        key = ready_key(entry);
    }
    if (key != NOT_READY) {
        const uint place = atomicAdd(Uints(STREAMING.sort_counts).v[key], 1u) +
                           ConstUints(STREAMING.sort_sums).v[key / SCAN_BLOCK];
        if ((entry & SHADOW_BIT) != 0u) {
            Uints(FRAME.shadow_queue).v[COUNTERS.shadow_base + place] = entry & ~SHADOW_BIT;
        } else if (HAS_TEXTURES && (entry & MATERIAL_BIT) != 0u) {
            Uints(STREAMING.resolve_queue).v[COUNTERS.resolve_base + place] = entry & ~MATERIAL_BIT;
        } else {
            Uints(FRAME.ray_queue[push.round & 1u]).v[COUNTERS.ray_base + place] = entry;
        }
    }
    uint to;
    QUEUE_SLOT(to, deferred_count[now], in_range && key == NOT_READY);
    if (in_range && key == NOT_READY) Uints(STREAMING.deferred[now]).v[to] = entry;
}
