// SPDX-License-Identifier: Apache-2.0
// Primvars that images are wanted of: their values at what the closest ray of a path met. A primvar of the mesh wins
// over those of the instances that place it, as in materials.
#ifndef OOCPT_SHOWN_PRIMVARS_GLSL
#define OOCPT_SHOWN_PRIMVARS_GLSL

#include "wavefront/path_surface.glsl"

vec4 shown_primvar(HitHeader hit, uint mesh, uint name) {
    vec4 value;
    const uint entry = find_primvar(mesh, name);
    if (entry != NO_NAME) {
        return primvar_value(mesh, entry, hit.triangle, vec3(1.0 - hit.uv.x - hit.uv.y, hit.uv));
    }
    return instance_primvar(name, value) ? value : vec4(0.0);
}

// Stores those of a sample's first hit that are filtered, or those of a ray through a pixel centre. With `hit`: after
// surface_of_hit(path).
void store_primvars(uint path, bool hit) {
    if (FRAME.primvar_images[0] == 0ul) return;
    const bool is_sample = (push.flags & PUSH_AOVS) == 0u;
    HitHeader header;
    uint mesh = 0u;
    if (hit) {
        uint instance_id;
        int prim_id;
        header = load_hit_header(FRAME.hits, path);
        follow_chain(header.chunk_instance, mesh, prim_id, instance_id);
    }
    for (uint i = 0u; i < MAX_SHOWN_PRIMVARS && FRAME.primvar_images[i] != 0ul; ++i) {
        const uint first = FRAME.primvar_at[i];
        if (is_sample != (first != NO_INDEX)) continue;
        vec4 value = vec4(0.0);
        if (hit) value = shown_primvar(header, mesh, FRAME.primvar_names[i]);
        if (is_sample) {
            const uint place = HAS_STREAMING ? path_place(path) : path;
            const uint64_t values = FRAME.plane_values + uint64_t(place) * (4u * FRAME.plane_words) + 4u * first;
            Vec3s(values).v[0] = value.xyz;
            Floats(values).v[3] = value.w;
        } else {
            Vec4s(FRAME.primvar_images[i]).v[film_pixel(pixel_position(path_pixel(path)))] = value;
        }
    }
}

#endif
