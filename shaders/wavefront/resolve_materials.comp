// SPDX-License-Identifier: Apache-2.0
// Streaming with textures only. Works out the materials of the surfaces that are to be shaded, as far as tiles of
// textures are there: one thread per path, WavefrontCounters::resolve_args.
// Reads: resolve_queue, surfaces, textures and tiles. Reads and writes: resolved, resolve_progress. Pushes what is
// finished to surface_queue, what waits for a tile to deferred, with a pending list of tiles: first the one that it
// waits for, then others that it will need.
#version 460
#extension GL_GOOGLE_include_directive : require
#define NOTE_TILES
#include "wavefront/wavefront.glsl"
#include "wavefront/progress.glsl"
#include "wavefront/path_surface.glsl"
#include "material/material.glsl"
#include "material/resolve.glsl"
