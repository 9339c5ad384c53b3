// SPDX-License-Identifier: Apache-2.0
// Closest hit of the rays of a round whose hit depends on a cutout's texture: WavefrontCounters::settle_args[0]. Looks
// up the candidate that is kept with a ray; without one it walks the ray again.
// Reads: settle_queue[0], settle_hits[0], hits, rays, the scene. Writes: hits of the rays that hit; pushes the path to
// surface_queue or escaped_queue; requests of texture tiles.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "wavefront/wavefront.glsl"
#define ANY_HIT 0
#define SETTLES 1
#define NEXT settle_next[0]
#include "traversal/closest_rays.glsl"

void main() {
    trace_rays(COUNTERS.settle_count[0]);
}
