// SPDX-License-Identifier: Apache-2.0
// Adds the contribution of every shadow ray that meets nothing, and of others the share that the light's shadow colour
// tells: WavefrontCounters::shadow_args, a thread for one ray or, where there are very many, for some.
// Reads: shadow_queue, shadow_rays, the scene. Writes: radiance of the ray's path (a path has at most one shadow ray at
// a time).
// With streaming also: shadow_rays (flags), shadow_pending, progress; pushes to deferred, and finished paths to
// surface_queue or escaped_queue. With DEFERRED_CUTOUTS also: pushes the paths whose ray meets nothing but what depends
// on a cutout's texture to settle_queue[1] instead, with the candidate in settle_hits[1].
#version 460
#extension GL_GOOGLE_include_directive : require
#include "wavefront/wavefront.glsl"
#define ANY_HIT 1
#define NEXT shadow_next
#include "traversal/shadow_rays.glsl"

void main() {
    trace_rays(COUNTERS.shadow_count);
}
