// SPDX-License-Identifier: Apache-2.0
// Shades every hit of a round: a shadow ray towards one light, and the ray of the next bounce. One thread per hit,
// WavefrontCounters::surface_args.
// Reads: surface_queue, hits, rays, paths, the scene. Writes: paths, rays (the next one in place of this one),
// shadow_rays and, at bounce 0, radiance (alpha 1); pushes the path to shadow_queue and ray_queue[(round + 1) & 1].
// With streaming: reads surfaces in place of hits and the scene; writes progress, segments. Where lights ask something
// of the surface that a ray left also: reads and writes light_paths. Adds to radiance what the ray brings of the lights
// that it has met.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "wavefront/wavefront.glsl"
#include "wavefront/progress.glsl"
#include "math/sampler.glsl"
#include "wavefront/path_surface.glsl"
#include "material/material.glsl"
#include "material/bsdf.glsl"
#include "light/sample.glsl"
#include "light/sampling.glsl"

// Russian roulette (Arvo and Kirk 1990) from this bounce on, by the throughput; a path of full throughput always goes
// on, so that no weight exceeds 1 by it.
const uint ROULETTE_FROM = 3u;

#include "wavefront/shade.glsl"

void main() {
    const uint at = thread_index();
    const bool in_range = at < COUNTERS.surface_count;
    bool ask = false;
    bool go_on = false;
    uint path = 0u;
    if (in_range) {
        path = ConstUints(FRAME.surface_queue).v[at];
        shade(path, ask, go_on);
    }
    if (HAS_STREAMING) {
        if (in_range) set_progress(path, (ask ? 0u : SHADOW_DONE) | (go_on ? 0u : CLOSEST_DONE | PATH_ENDS));
        end_path(path, in_range && !ask && !go_on);
    }
    uint to;
    QUEUE_SLOT(to, shadow_count, ask);
    if (ask) Uints(FRAME.shadow_queue).v[to] = path;
    QUEUE_SLOT(to, ray_count[(push.round + 1u) & 1u], go_on);
    if (go_on) Uints(FRAME.ray_queue[(push.round + 1u) & 1u]).v[to] = path;
}
