// SPDX-License-Identifier: Apache-2.0
// Streaming only. Counts the deferred rays that may go on, by chunk: one thread per deferred ray,
// WavefrontCounters::deferred_args.
// Reads: deferred, rays and shadow_rays (flags), pending lists, chunks, meshes. Adds to: sort_counts, which the host
// has zeroed.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "wavefront/wavefront.glsl"
#include "wavefront/deferred.glsl"

void main() {
    const uint at = thread_index();
    const uint list = COUNTERS.deferred_parity;
    if (!HAS_STREAMING || at >= COUNTERS.deferred_count[list]) return;
    const uint key = ready_key(ConstUints(STREAMING.deferred[list]).v[at]);
    add_each(STREAMING.sort_counts, key, 1u, key != NOT_READY);
}
