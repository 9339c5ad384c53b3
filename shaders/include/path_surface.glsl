// SPDX-License-Identifier: Apache-2.0
// The surface that the closest ray of a path met.
#ifndef OOCPT_PATH_SURFACE_GLSL
#define OOCPT_PATH_SURFACE_GLSL

#include "include/hit.glsl"
#include "include/surface.glsl"

Surface load_surface(uint path) {
    const HitHeader hit = load_hit_header(path);
    for (uint level = 0u; level < MAX_LEVELS; ++level) surface_chain[level] = load_hit_level(path, level);
    return make_surface(hit.chunk_instance, hit.triangle, hit.uv);
}

#endif
