// SPDX-License-Identifier: Apache-2.0
// First hits through the pixel centres, pinhole, unaffected by sampling: one thread per pixel of the slice that push names.
// Reads: Frame, the scene. Writes: the planes of Frame::aov that are not 0. Surfaces of opacity 0 are not seen, all others are.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "include/wavefront.glsl"
#define ANY_HIT 0
#define OPACITY_MODE OPACITY_NONZERO
#include "traversal/traverse.glsl"
#include "include/surface.glsl"


AovClear aovs_of(Found found) {
    for (uint level = 0u; level < MAX_LEVELS; ++level) surface_chain[level] = found_chain[level];
    const Surface surface = make_surface(found.triangle, found.uv);
    const vec4 p = vec4(surface.position, 1.0);
    AovClear a;
    a.depth = 0.5 * (dot(FRAME.clip_z, p) / dot(FRAME.clip_w, p)) + 0.5;
    a.camera_depth = -dot(FRAME.view[2], p);
    a.prim_id = surface.prim_id;
    a.instance_id = int(surface.instance_id);
    a.element_id = int(surface.face);
    a.normal = surface.shading_normal;
    a.neye = normalize(vec3(dot(FRAME.view_normal[0], a.normal), dot(FRAME.view_normal[1], a.normal),
                            dot(FRAME.view_normal[2], a.normal)));
    a.albedo = surface.albedo;
    return a;
}

void store(uint pixel, AovClear a) {
    if (FRAME.aov.depth != 0ul) Floats(FRAME.aov.depth).v[pixel] = a.depth;
    if (FRAME.aov.camera_depth != 0ul) Floats(FRAME.aov.camera_depth).v[pixel] = a.camera_depth;
    if (FRAME.aov.prim_id != 0ul) Ints(FRAME.aov.prim_id).v[pixel] = a.prim_id;
    if (FRAME.aov.instance_id != 0ul) Ints(FRAME.aov.instance_id).v[pixel] = a.instance_id;
    if (FRAME.aov.element_id != 0ul) Ints(FRAME.aov.element_id).v[pixel] = a.element_id;
    if (FRAME.aov.normal != 0ul) Vec3s(FRAME.aov.normal).v[pixel] = a.normal;
    if (FRAME.aov.neye != 0ul) Vec3s(FRAME.aov.neye).v[pixel] = a.neye;
    if (FRAME.aov.albedo != 0ul) Vec3s(FRAME.aov.albedo).v[pixel] = a.albedo;
}

void main() {
    const uint thread = thread_index();
    if (thread >= push.path_count) return;
    const uvec2 position = pixel_position(path_pixel(thread));
    const vec2 p = vec2(position) + 0.5;
    const vec3 o = FRAME.ray_o + p.x * FRAME.ray_o_x + p.y * FRAME.ray_o_y;
    const vec3 d = normalize(FRAME.ray_d + p.x * FRAME.ray_d_x + p.y * FRAME.ray_d_y);
    Found found;
    const bool hit = traverse(o, d, uintBitsToFloat(0x7f800000u), 0u, found);
    AovClear a = FRAME.aov_clear;
    if (hit) a = aovs_of(found);
    store(position.y * FRAME.width + position.x, a);
}
