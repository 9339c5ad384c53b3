// SPDX-License-Identifier: Apache-2.0
// Cutouts: whether a material makes a surface opaque, tested in traversal at every candidate of a hit. Without CUTOUTS
// none of it is compiled in; with it a surface whose material has no cutout costs one load of its prim.
#ifndef OOCPT_TRAVERSAL_PRESENCE_GLSL
#define OOCPT_TRAVERSAL_PRESENCE_GLSL

#include "traversal/cutout.glsl"
#include "texture/cone.glsl"
#include "geometry/surface_material.glsl"
#include "traversal/opacity_mask.glsl"

const uint NO_TEXTURE = 0xffffffffu;

// The alpha test of a material. Without a texture the opacity is `bias`.
struct Presence {
    bool is_asked;
    uint texture;
    uint program; // the material whose program says it, or NO_MATERIAL
    vec2 st;
    float width; // of the lookup's filter, in texels
    uint channel;
    float scale;
    float bias;
    float threshold; // 0: the opacity is a probability
    uint coverage;   // what the mask says, or COVERAGE_UNKNOWN
};

// The width of the ray's cone at distance t. A shadow ray starts as wide as its surface was seen and stays so.
float ray_cone(uint path, float t) {
    if (!HAS_TEXTURES) return 0.0;
#if ANY_HIT
    return cone_width(path, 0.0);
#else
    return cone_width(path, t);
#endif
}

// The alpha test of a triangle's material. `d`: the ray's direction, in the mesh's frame; `cone`: the width of its cone
// there over the length of d. The test uses the finest level, however wide the ray is: only the probability that a Ptex
// file stores is filtered.
Presence presence_of(Pose pose, uint mesh, int prim_id, uint triangle, vec2 uv, float cone, vec3 d) {
    Presence p = Presence(false, NO_TEXTURE, NO_MATERIAL, vec2(0.0), 0.0, 0u, 1.0, 0.0, 0.0, COVERAGE_UNKNOWN);
    const uint slot = material_slot(prim_id, item_subset(pose, triangle));
    if (slot == NO_MATERIAL || (slot & SLOT_PRESENCE) == 0u) return p;
    const uint material = material_number(slot);
    const vec3 weights = vec3(1.0 - uv.x - uv.y, uv);
    Materials materials = Materials(FRAME.materials);
    p.is_asked = true;
    p.threshold = materials.v[material].opacity_threshold;
    const GpuInput i = materials.v[material].inputs[INPUT_OPACITY];
    const uint set = (i.kind >> INPUT_SET_SHIFT) & 3u;
    p.bias = i.value.x;
    if (HAS_CUTOUT_PROGRAMS && (i.kind & 3u) == INPUT_REGISTER) {
        p.program = material;
    } else if ((i.kind & 3u) == INPUT_PRIMVAR) {
        const uint entry = find_primvar(mesh, materials.v[material].names[2u + (set & 1u)]);
        vec4 value;
        if (entry != NO_NAME) {
            p.bias = primvar_value(mesh, entry, triangle, weights).x;
        } else if (instance_primvar(materials.v[material].names[2u + (set & 1u)], value)) {
            p.bias = value.x;
        }
    } else if ((i.kind & 3u) == INPUT_TEXTURE) {
        p.bias = 1.0;
        if (!HAS_TEXTURES) return p; // there are no images: opaque
        vec2 st = vec2(0.0);
        uvec2 footprint = uvec2(0u);
        bool filters = false;
        if (set != INPUT_NO_SET) {
            st = materials.v[material].set_fallback[set & 1u];
            const uint name = materials.v[material].names[set & 1u];
            const bool is_ptex = HAS_PTEX && name == NAME_PTEX;
            const uint entry = find_primvar(mesh, name);
            vec4 value;
            if (entry == NO_NAME && instance_primvar(name, value)) st = value.xy;
            if (is_ptex) st = ptex_place(ptex_word(mesh, triangle), weights);
            if (entry != NO_NAME) st = primvar_value(mesh, entry, triangle, weights).xy;
            const GpuCutout cutout = materials.v[material].cutout;
            const bool has_mask = HAS_OPACITY_MASKS && cutout.mask != 0ul;
            filters = p.threshold <= 0.0 && is_ptex;
            if (has_mask && entry != NO_NAME) {
                vec4 a, b, c;
                primvar_corners(mesh, entry, triangle, a, b, c);
                vec3 e, f;
                item_edges(pose, mesh, triangle, e, f);
                p.coverage = coverage_at(cutout, a.xy, b.xy, c.xy, uv, e, f, d, cone);
            } else if (filters) {
                vec3 e, f, u, v, n;
                item_edges(pose, mesh, triangle, e, f);
                if (set_gradients(mesh, name, triangle, st, e, f, u, v, n)) {
                    footprint = make_footprint(u, v, n, d);
                }
            }
        }
        const uint channel = (i.kind >> INPUT_CHANNEL_SHIFT) & 7u;
        p.channel = channel == 0u ? 0u : channel - 1u;
        p.texture = i.texture;
        p.st = map_place(i, st);
        if (filters) {
            p.width = lookup_width(i.texture, p.st, footprint, cone * sqrt(dot3(d, d)), i.row_s, i.row_t);
        }
        p.scale = i.value[p.channel];
        p.bias = i.bias[p.channel];
    }
    return p;
}

#endif
