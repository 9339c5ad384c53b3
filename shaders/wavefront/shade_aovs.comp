// SPDX-License-Identifier: Apache-2.0
// Writes what images have of what camera rays met: one thread per ray of a queue. arg0 = AOV_SURFACES: surface_queue,
// WavefrontCounters::surface_args; arg0 = AOV_ESCAPED: escaped_queue, WavefrontCounters::escaped_args. Reads: the
// queue, hits, the scene; with streaming, surfaces in place of the last two. Rays of generate_aov_rays (PUSH_AOVS):
// writes the planes of FrameConstants::aov and primvar_images that are not 0 and not filtered; surfaces of opacity 0
// are not seen, all others are. Samples: writes FrameConstants::plane_values of those at bounce 0, where mattes and
// shadow catchers count as nothing. With streaming: ends rays that go no farther, and writes their segments.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "wavefront/wavefront.glsl"
#include "wavefront/progress.glsl"
#include "light/links.glsl"
#include "geometry/prim_masks.glsl"
#define SURFACES_ARE_SHADED HAS_SHADED_AOVS
#include "wavefront/path_surface.glsl"
#include "material/material.glsl"
#include "camera/motion_vector.glsl"
#include "wavefront/shown_primvars.glsl"

// row . (p, 1) of a row in world space, for p relative to FrameConstants::ray_o: far from the world's origin nothing
// cancels.
float row_at(vec4 row, vec3 p) {
    return dot3(row.xyz, p) + row.w;
}

AovClear aovs_of(uint path, Surface surface, out vec4 motion_both) {
    AovClear a = FRAME.aov_clear;
    const vec3 p = difference(surface.position, Double3(FRAME.ray_o, FRAME.ray_o_lo));
    const vec3 v = vec3(row_at(FRAME.view[0], p), row_at(FRAME.view[1], p), row_at(FRAME.view[2], p));
    a.depth = 0.5 * (row_at(FRAME.clip_z, v) / row_at(FRAME.clip_w, v)) + 0.5;
    a.camera_depth = -v.z;
    a.prim_id = shown_prim_id(surface.prim_id);
    a.instance_id = int(surface.instance_id);
    a.element_id = int(surface.face);
    if (HAS_MATERIALS && surface_material.material != NO_MATERIAL) a.material_id = int(surface_material.material);
    if (HAS_SHADED_AOVS) {
        uint missing;
        const Shading shading = make_shading(path, surface, missing);
        a.normal = shading.normal;
        a.neye = normalize(vec3(dot(FRAME.view_normal[0], a.normal), dot(FRAME.view_normal[1], a.normal),
                                dot(FRAME.view_normal[2], a.normal)));
        a.albedo = shading.diffuse_color;
    }
    a.geometric_normal = surface.geometric_normal;
    a.peye = v;
    a.position = add(add(surface.position, FRAME.origin), FRAME.origin_lo).hi;
    a.motion = vec3(0.0);
    motion_both = vec4(0.0);
    if (HAS_MOTION_VECTORS && !HAS_STREAMING) a.motion = motion_over_image(path, motion_both);
    return a;
}

// Returns true if the plane is wanted through pixel centres.
bool is_centred(uint64_t plane, uint filtered) {
    return plane != 0ul && filtered == NO_INDEX;
}

void store(uint pixel, AovClear a) {
    const PlaneOffsets at = FRAME.plane_at;
    if (FRAME.aov.depth != 0ul) Floats(FRAME.aov.depth).v[pixel] = a.depth;
    if (FRAME.aov.camera_depth != 0ul) Floats(FRAME.aov.camera_depth).v[pixel] = a.camera_depth;
    if (FRAME.aov.prim_id != 0ul) Ints(FRAME.aov.prim_id).v[pixel] = a.prim_id;
    if (FRAME.aov.instance_id != 0ul) Ints(FRAME.aov.instance_id).v[pixel] = a.instance_id;
    if (FRAME.aov.element_id != 0ul) Ints(FRAME.aov.element_id).v[pixel] = a.element_id;
    if (FRAME.aov.material_id != 0ul) Ints(FRAME.aov.material_id).v[pixel] = a.material_id;
    if (is_centred(FRAME.aov.normal, at.normal)) Vec3s(FRAME.aov.normal).v[pixel] = a.normal;
    if (is_centred(FRAME.aov.neye, at.neye)) Vec3s(FRAME.aov.neye).v[pixel] = a.neye;
    if (is_centred(FRAME.aov.albedo, at.albedo)) Vec3s(FRAME.aov.albedo).v[pixel] = a.albedo;
    if (is_centred(FRAME.aov.position, at.position)) Vec3s(FRAME.aov.position).v[pixel] = a.position;
    if (is_centred(FRAME.aov.peye, at.peye)) Vec3s(FRAME.aov.peye).v[pixel] = a.peye;
    if (is_centred(FRAME.aov.geometric_normal, at.geometric_normal)) {
        Vec3s(FRAME.aov.geometric_normal).v[pixel] = a.geometric_normal;
    }
}

void store_value(uint64_t values, uint first, vec3 value) {
    if (first != NO_INDEX) Vec3s(values + 4u * first).v[0] = value;
}

// Stores the two words of an id, of which the first is 0 where nothing is met.
void store_id(uint64_t values, uint first, uvec2 id) {
    if (first == NO_INDEX) return;
    Uints(values + 4u * first).v[0] = id.x;
    Uints(values + 4u * first).v[1] = id.y;
}

void store_sample(uint path, AovClear a, bool hit) {
    const uint place = HAS_STREAMING ? path_place(path) : path;
    const uint64_t values = FRAME.plane_values + uint64_t(place) * (4u * FRAME.plane_words);
    const PlaneOffsets at = FRAME.plane_at;
    store_value(values, at.normal, a.normal);
    store_value(values, at.neye, a.neye);
    store_value(values, at.albedo, a.albedo);
    store_value(values, at.position, a.position);
    store_value(values, at.peye, a.peye);
    store_value(values, at.geometric_normal, a.geometric_normal);
    if (HAS_ID_RANKS) {
        const bool is_seen = hit && a.prim_id >= 0;
        store_id(values, at.crypto_object, is_seen ? uvec2(uint(a.prim_id) + 1u, uint(a.instance_id)) : uvec2(0u));
        uint material = 0u;
        if (HAS_MATERIALS && hit && surface_material.material != NO_MATERIAL) material = surface_material.material + 1u;
        store_id(values, at.crypto_material, uvec2(material, 0u));
    }
    if (HAS_DEEP) {
        const bool is_named = hit && a.prim_id >= 0;
        store_id(values, FRAME.deep_at, is_named ? uvec2(uint(a.prim_id) + 1u, uint(a.instance_id)) : uvec2(0u));
        Floats(values + 4u * FRAME.deep_at).v[2] = hit ? a.camera_depth : DEEP_FAR;
    }
}

void main() {
    const uint at = thread_index();
    const bool hit = push.arg0 == AOV_SURFACES;
    if (at >= (hit ? COUNTERS.surface_count : COUNTERS.escaped_count)) return;
    const uint path = ConstUints(hit ? FRAME.surface_queue : FRAME.escaped_queue).v[at];
    const bool is_sample = (push.flags & PUSH_AOVS) == 0u;
    if (is_sample && ray_bounce(ray_address(path)) != 0u) return;
    AovClear a = FRAME.aov_clear;
    vec4 motion_both = vec4(0.0);
    bool is_seen = hit;
    if (hit) {
        const Surface surface = load_surface(path);
        is_seen = !(is_sample && (prim_mask(surface.prim_id) & (PRIM_MATTE | PRIM_SHADOW_CATCHER)) != 0u);
        if (is_seen) a = aovs_of(path, surface, motion_both);
    }
    // For hits, record_surfaces has written them while their chunk was there.
    if (HAS_SHADED_AOVS && !(HAS_STREAMING && is_seen)) store_primvars(path, is_seen);
    if (is_sample) {
        store_sample(path, a, is_seen);
        if (HAS_STREAMING && (FRAME.flags & FLAG_FIRST_HITS) != 0u) end_path(path, true);
        return;
    }
    store(film_pixel(pixel_position(path_pixel(path))), a);
    // For hits, record_surfaces has written it.
    const bool is_there = HAS_STREAMING && HAS_MOTION_VECTORS && hit;
    if (!is_there) store_motion(path, a.motion, motion_both);
    if (HAS_STREAMING) end_path(path, true);
}
