// SPDX-License-Identifier: Apache-2.0
// In place of resolve_materials where meshes are lights that shine with textures (Features::MESH_LIGHT_VALUES): the
// same, and then the emission of the light that the surface will ask, as one more lookup (see the book,
// design/lights). One thread per path, WavefrontCounters::resolve_args.
// Reads: resolve_queue, surfaces, rays, cones, lights, textures and tiles. Otherwise as resolve_materials.
#version 460
#extension GL_GOOGLE_include_directive : require
#define NOTE_TILES
#define RESOLVE_LIGHTS
#include "wavefront/wavefront.glsl"
#include "wavefront/progress.glsl"
#include "wavefront/path_surface.glsl"
#include "material/material.glsl"
#include "math/sampler.glsl"
#include "material/bsdf.glsl"
#include "light/sample.glsl"
#include "light/sampling.glsl"
#include "material/resolve.glsl"
