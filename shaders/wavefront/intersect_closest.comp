// SPDX-License-Identifier: Apache-2.0
// Closest hit of every ray of a round: WavefrontCounters::trace_args, a thread for one ray or, where there are very
// many, for some.
// Reads: ray_queue[round & 1], rays, the scene. Writes: hits of the rays that hit; pushes the path to surface_queue or
// escaped_queue. With streaming also: rays (flags), pending, progress; pushes to deferred, and to the other two queues
// only when the path's shadow ray has finished too. With DEFERRED_CUTOUTS also: pushes the paths whose hit depends on a
// cutout's texture to settle_queue[0] instead, with the candidate in settle_hits[0].
#version 460
#extension GL_GOOGLE_include_directive : require
#include "wavefront/wavefront.glsl"
#define ANY_HIT 0
#define NEXT ray_next
#include "traversal/closest_rays.glsl"

void main() {
    trace_rays(COUNTERS.ray_count[push.round & 1u]);
}
