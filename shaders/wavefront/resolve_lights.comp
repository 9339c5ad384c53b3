// SPDX-License-Identifier: Apache-2.0
// Replaces resolve_materials if meshes are lights that shine with textures (Features::MESH_LIGHT_VALUES): does the
// same, and then looks up the emission of the light that the surface will sample, as one more lookup (see the book,
// design/lights). One thread per path, WavefrontCounters::resolve_args. Reads: resolve_queue, surfaces, rays, cones,
// lights, textures and tiles. Otherwise as resolve_materials.
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
