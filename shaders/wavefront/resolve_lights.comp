// SPDX-License-Identifier: Apache-2.0
// In place of resolve_materials where meshes are lights that shine with textures (Features::MESH_LIGHT_VALUES): the
// same, and then the emission of the light that the surface will ask, as one more lookup (see the book,
// design/lights). One thread per path, Counters::resolve_args.
// Reads: resolve_queue, surfaces, rays, cones, lights, textures and tiles. Otherwise as resolve_materials.
#version 460
#extension GL_GOOGLE_include_directive : require
#define NOTE_TILES
#define RESOLVE_LIGHTS
#include "include/wavefront.glsl"
#include "include/progress.glsl"
#include "include/path_surface.glsl"
#include "include/material.glsl"
#include "include/sampler.glsl"
#include "include/bsdf.glsl"
#include "include/light_sample.glsl"
#include "include/light_sampling.glsl"
#include "include/resolve.glsl"
