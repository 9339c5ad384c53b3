// SPDX-License-Identifier: Apache-2.0
// Streaming with textures only. Works out the materials of the surfaces that are to be shaded, as far as tiles of textures are there:
// one thread per path, Counters::resolve_args.
// Reads: resolve_queue, surfaces, textures and tiles. Reads and writes: resolved, resolve_progress. Pushes what is finished to surface_queue,
// what waits for a tile to deferred, with a pending list of tiles: first the one that
// it waits for, then others that it will need.
#version 460
#extension GL_GOOGLE_include_directive : require
#define NOTE_TILES
#include "include/wavefront.glsl"
#include "include/progress.glsl"
#include "include/path_surface.glsl"
#include "include/material.glsl"

void main() {
    if (!HAS_STREAMING || !HAS_TEXTURES) return;
    const uint at = thread_index();
    const bool in_range = at < COUNTERS.resolve_count;
    uint path = 0u;
    uint said = TEXTURE_DONE;
    if (in_range) {
        path = ConstUints(STREAMING.resolve_queue).v[at];
        noted_count = 0u;
        make_shading(path, stored_surface(path), said);
    }
    const bool waits = in_range && said < TEXTURE_FALLBACK;
    if (waits) {
        PendingLists(STREAMING.pending).v[path].chunk_instance[0] = said;
        for (uint k = 0u; k < noted_count; ++k) PendingLists(STREAMING.pending).v[path].chunk_instance[k + 1u] = noted_units[k];
        Uints(ray_address(path)).v[11] = RAY_WAITED | (1u + noted_count) << RAY_COUNT_SHIFT;
    }
    push_deferred(path | MATERIAL_BIT, waits);
    uint to;
    QUEUE_SLOT(to, surface_count, in_range && !waits);
    if (in_range && !waits) Uints(FRAME.surface_queue).v[to] = path;
    ADD_EACH(tile_misses, waits ? 1u : 0u);
}
