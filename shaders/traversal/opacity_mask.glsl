// SPDX-License-Identifier: Apache-2.0
// What is known of a cutout without its texture (0034): for every place and every pair of levels that a lookup can mix,
// whether all that it could give means the surface is there, or not, or neither. A part of traverse.glsl; only with
// OPACITY_MASKS. Made by rust/core/src/texture/opacity_mask.rs, which has the layout.
#ifndef OOCPT_OPACITY_MASK_GLSL
#define OOCPT_OPACITY_MASK_GLSL

// As in rust/core/src/texture/opacity_mask.rs.
const uint PRESENCE_UNKNOWN = 0u;
const uint PRESENCE_NEVER = 1u;
const uint PRESENCE_ALWAYS = 2u;

// The width of a lookup is worked out to better than this share of it, squared, and both pairs of levels are asked
// where they may differ. Rays that graze a triangle, and needles of triangles, are left to the lookup: squares of sines.
const float WIDTH_SLACK = 0.04;
const float LEAST_SINE = 1.0e-6;

// Square of lookup_width() (include/footprint.glsl) of a triangle with edges e and f, along which the place grows by
// the texels p and q: within WIDTH_SLACK, or negative or no number where that is not sure. A point of the ray's cross
// section moves on the plane by dot(point, b) of e and dot(point, c) of f (Moeller and Trumbore 1997).
float square_of_width(vec3 e, vec3 f, vec2 p, vec2 q, vec3 d, float cone) {
    const vec3 n = cross3(e, f);
    const float across = dot3(n, d);
    const float area = dot3(n, n);
    if (!(area > LEAST_SINE * dot3(e, e) * dot3(f, f)) || !(across * across > LEAST_SINE * area * dot3(d, d))) return -1.0;
    const float scale = 1.0 / across;
    const vec3 b = cross3(f, d) * scale;
    const vec3 c = cross3(d, e) * scale;
    const vec3 s = b * p.x + c * q.x;
    const vec3 t = b * p.y + c * q.y;
    const float ss = dot3(s, s);
    const float tt = dot3(t, t);
    const float st = dot3(s, t);
    const float half_difference = 0.5 * (ss - tt);
    const float longer = 0.5 * (ss + tt) + sqrt(half_difference * half_difference + st * st);
    const vec3 both = cross3(s, t);
    const float shorter = dot3(both, both) / longer;
    if (!(longer > 1.0e-12 && longer < 1.0e12)) return -1.0;
    return cone * cone * max(shorter, longer * (1.0 / (MOST_ANISOTROPY * MOST_ANISOTROPY)));
}

// The pair of levels that a lookup of this width mixes: the finer one's number.
uint pair_of_levels(float square, uint coarsest) {
    return square < 1.0 ? 0u : min(((floatBitsToUint(square) >> 23) - 127u) >> 1, coarsest);
}

// A coordinate that is near the image (near_image()) in it; negative where the mask does not say.
float inside_image(float s, uint wrap) {
    if (s >= 0.0 && s <= 1.0) return s;
    if (wrap == WRAP_REPEAT) return s - floor(s);
    return wrap == WRAP_CLAMP ? clamp(s, 0.0, 1.0) : -1.0;
}

uint mask_at(uint64_t mask, vec2 st, uvec2 size, uint pair, uint first) {
    const uvec2 begin = ConstUVec2s(mask).v[1u + pair - first];
    const vec2 texels = vec2(max(size >> pair, uvec2(1u)));
    const uvec2 at = uvec2(floor(st * texels + 0.5));
    const uint cell = begin.x + at.y * begin.y + at.x;
    return (ConstUints(mask).v[cell >> 4] >> ((cell & 15u) * 2u)) & 3u;
}

// Whether the material says that the surface is there, for all lookups that the candidate can come to. e, f: the edges
// from the triangle's first corner.
uint known_presence(uint triangle, vec3 e, vec3 f, vec2 uv, float t) {
    const uint subset = floatBitsToUint(ConstVec4s(walk.triangles).v[triangle * 3u + 1u].w) & SUBSET_MASK;
    const uint slot = material_slot(Instances(walk.instances).v[chain[level_index()]].prim_id, subset);
    if (slot == NO_MATERIAL || (slot & SLOT_PRESENCE) == 0u) return PRESENCE_ALWAYS;
    Materials materials = Materials(FRAME.materials);
    const uint material = material_number(slot);
    const uint64_t mask = materials.v[material].opacity_mask;
    if (mask == 0ul || (HAS_ROUND && walk.round)) return PRESENCE_UNKNOWN;
    const uint set = (materials.v[material].inputs[INPUT_OPACITY].kind >> INPUT_SET_SHIFT) & 1u;
    const uint entry = find_primvar(walk.mesh, materials.v[material].names[set]);
    if (entry == NO_NAME) return PRESENCE_UNKNOWN;
    vec4 at_0, at_1, at_2;
    primvar_corners(walk.mesh, entry, triangle, at_0, at_1, at_2);
    const uvec2 head = ConstUVec2s(mask).v[0];
    const uvec2 size = uvec2(head.x & 0xffffu, head.x >> 16);
    const uvec2 wrap = uvec2(head.y & 3u, (head.y >> 2) & 3u);
    const uint first = (head.y >> 8) & 0xffu;
    const uint coarsest = head.y >> 16;
    const vec3 row_s = materials.v[material].inputs[INPUT_OPACITY].row_s;
    const vec3 row_t = materials.v[material].inputs[INPUT_OPACITY].row_t;
    const vec2 texels = vec2(size);
    const vec2 p = at_1.xy - at_0.xy;
    const vec2 q = at_2.xy - at_0.xy;
    const float cone = ray_cone(walk.path, t) * length(walk.d);
    const float square = square_of_width(e, f, vec2(dot(row_s.xy, p), dot(row_t.xy, p)) * texels,
                                         vec2(dot(row_s.xy, q), dot(row_t.xy, q)) * texels, walk.d, cone);
    if (!(square >= 0.0 && square < 1.0e18)) return PRESENCE_UNKNOWN;
    const vec2 mean = at_0.xy * (1.0 - uv.x - uv.y) + at_1.xy * uv.x + at_2.xy * uv.y;
    const vec2 place = at_0 == at_1 && at_1 == at_2 ? at_0.xy : mean;
    const vec2 mapped = vec2(row_s.x * place.x + row_s.y * place.y + row_s.z, row_t.x * place.x + row_t.y * place.y + row_t.z);
    const vec2 st = vec2(inside_image(near_image(mapped.x, wrap.x), wrap.x), inside_image(near_image(mapped.y, wrap.y), wrap.y));
    const uint finer = pair_of_levels(square * (1.0 - WIDTH_SLACK), coarsest);
    if (!(min(st.x, st.y) >= 0.0) || finer < first) return PRESENCE_UNKNOWN;
    const uint known = mask_at(mask, st, size, finer, first);
    const uint coarser = pair_of_levels(square * (1.0 + WIDTH_SLACK), coarsest);
    if (coarser != finer && mask_at(mask, st, size, coarser, first) != known) return PRESENCE_UNKNOWN;
    return known;
}

#endif
