// SPDX-License-Identifier: Apache-2.0
// Streaming only. Keeps the surface of every hit that this round has found, while its chunk is there: one thread per
// ray, WavefrontCounters::ray_args. Reads: ray_queue[round & 1], rays (flags), hits, the scene. Writes: surfaces; with
// textures, resolve_progress; with MOTION_VECTORS, of rays through pixel centres, the plane FrameConstants::aov.motion;
// with SHADED_AOVS primvars of first hits: later the chunk may be gone.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "wavefront/wavefront.glsl"
#include "wavefront/progress.glsl"
#include "wavefront/path_surface.glsl"
#include "camera/motion_vector.glsl"
#include "wavefront/shown_primvars.glsl"

void main() {
    const uint at = thread_index();
    if (!HAS_STREAMING || at >= COUNTERS.ray_count[push.round & 1u]) return;
    const uint path = ConstUints(FRAME.ray_queue[push.round & 1u]).v[at];
    if ((ray_flags(ray_address(path)) & RAY_CHANGED) == 0u) return;
    store_surface(path, surface_of_hit(path));
    const bool is_first = (push.flags & PUSH_AOVS) != 0u || ray_bounce(ray_address(path)) == 0u;
    if (HAS_SHADED_AOVS && is_first) store_primvars(path, true);
    if (HAS_MOTION_VECTORS && (push.flags & PUSH_AOVS) != 0u) {
        vec4 both;
        const vec3 motion = motion_over_image(path, both);
        store_motion(path, motion, both);
    }
    if (HAS_TEXTURES) Uints(STREAMING.resolve_progress).v[path] = 0u;
}
