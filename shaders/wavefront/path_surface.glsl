// SPDX-License-Identifier: Apache-2.0
// The surface that the closest ray of a path met: made from the hit or, with streaming, loaded as record_surfaces
// stored it. With materials, `surface_material` is set along with it.
#ifndef OOCPT_PATH_SURFACE_GLSL
#define OOCPT_PATH_SURFACE_GLSL

#include "traversal/hit.glsl"
#include "geometry/surface.glsl"
#include "texture/cone.glsl"

Surface surface_of_hit(uint path) {
    const HitHeader hit = load_hit_header(FRAME.hits, path);
    if (HAS_TIME) surface_time = path_time(path);
    for (uint level = 0u; level < MAX_LEVELS; ++level) surface_chain[level] = load_hit_level(FRAME.hits, path, level);
    Surface s = make_surface(hit.chunk_instance, hit.triangle, hit.uv, load_ray(ray_address(path)), hit.t);
    if (HAS_TEXTURES) s.cone = cone_width(path, hit.t);
    return s;
}

void store_surface(uint path, Surface s) {
    Surfaces(STREAMING.surfaces).v[path] =
        GpuSurface(s.position.hi, s.offset, s.position.lo, s.prim_id, s.geometric_normal, s.instance_id,
                   s.shading_normal, s.face, s.albedo, s.cone);
    if (HAS_MATERIALS) SurfaceMaterials(STREAMING.surface_materials).v[path] = surface_material;
}

Surface stored_surface(uint path) {
    if (HAS_MATERIALS) surface_material = SurfaceMaterials(STREAMING.surface_materials).v[path];
    const GpuSurface s = Surfaces(STREAMING.surfaces).v[path];
    return Surface(Double3(s.position, s.position_lo), s.offset, s.geometric_normal, s.shading_normal, s.albedo,
                   s.prim_id, s.instance_id, s.face, s.cone);
}

Surface load_surface(uint path) {
    if (HAS_STREAMING) return stored_surface(path);
    return surface_of_hit(path);
}

#endif
