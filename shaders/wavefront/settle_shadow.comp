// SPDX-License-Identifier: Apache-2.0
// As intersect_shadow, of the shadow rays that met nothing but what depends on a cutout's texture:
// WavefrontCounters::settle_args[1]. Looks up the candidate that is kept with a ray; without one it walks the ray
// again. Reads: settle_queue[1], settle_hits[1], shadow_rays, the scene. Writes: radiance of the ray's path; requests
// of texture tiles.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "wavefront/wavefront.glsl"
#define ANY_HIT 1
#define SETTLES 1
#define NEXT settle_next[1]
#include "traversal/shadow_rays.glsl"

void main() {
    trace_rays(COUNTERS.settle_count[1]);
}
