// SPDX-License-Identifier: Apache-2.0
// Streaming only. Keeps the surface of every hit that this round has found, while its chunk is there: one thread per
// ray, WavefrontCounters::ray_args.
// Reads: ray_queue[round & 1], rays (flags), hits, the scene. Writes: surfaces; with textures, resolve_progress; with
// MOTION_VECTORS, of rays through pixel centres, the plane FrameConstants::aov.motion: later the chunk may be gone.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "wavefront/wavefront.glsl"
#include "wavefront/progress.glsl"
#include "wavefront/path_surface.glsl"
#include "camera/motion_vector.glsl"

void main() {
    const uint at = thread_index();
    if (!HAS_STREAMING || at >= COUNTERS.ray_count[push.round & 1u]) return;
    const uint path = ConstUints(FRAME.ray_queue[push.round & 1u]).v[at];
    if ((ray_flags(ray_address(path)) & RAY_CHANGED) == 0u) return;
    store_surface(path, surface_of_hit(path));
    if (HAS_MOTION_VECTORS && (push.flags & PUSH_AOVS) != 0u) store_motion(path, motion_over_image(path));
    if (HAS_TEXTURES) Uints(STREAMING.resolve_progress).v[path] = 0u;
}
