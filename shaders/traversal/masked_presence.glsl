// SPDX-License-Identifier: Apache-2.0
// What masks say of a candidate (decisions/0058), in as few loads and instructions as it takes: most candidates need no
// more. A mask allows for a width that is a little off, so the width is worked out from what the hit test has loaded. A
// part of traverse.glsl; only with DEFERRED_CUTOUTS.
#ifndef OOCPT_MASKED_PRESENCE_GLSL
#define OOCPT_MASKED_PRESENCE_GLSL

#include "include/near_width.glsl"

// Whether the surface is there for this ray, as far as masks know. v0, v1, v2: corners of the triangle.
uint masked_presence(uint triangle, vec3 v0, vec3 v1, vec3 v2, vec2 uv, float t) {
    // Most meshes have one set of coordinates: it is loaded before the material says which it wants.
    const uint64_t primvars = Meshes(FRAME.meshes).v[walk.mesh].primvars;
    GpuAttribute set = GpuAttribute(0ul, NO_NAME, 0u);
    if (Meshes(FRAME.meshes).v[walk.mesh].primvar_count > 0u) set = Attributes(primvars).v[0];
    const uint slot = material_slot(Instances(walk.instances).v[chain[level_index()]].prim_id,
                                    item_subset(walk.pose, triangle));
    if (slot == NO_MATERIAL || (slot & SLOT_PRESENCE) == 0u) return PRESENCE_ALWAYS;
    const GpuCutout cutout = Materials(FRAME.materials).v[material_number(slot)].cutout;
    if (cutout.mask == 0ul || cutout.is_even == 0u || (HAS_LEAF_KINDS && walk.other)) return PRESENCE_UNKNOWN;
    if (set.name != cutout.set) {
        const uint entry = find_primvar(walk.mesh, cutout.set);
        if (entry == NO_NAME) return PRESENCE_UNKNOWN;
        set = Attributes(primvars).v[entry];
    }
    if ((set.rate_and_width >> 8) != 2u) return PRESENCE_UNKNOWN;
    const uvec3 corners = attribute_indices(Meshes(FRAME.meshes).v[walk.mesh].corner_indices, set.rate_and_width & 3u,
                                            triangle);
    const uint64_t values = primvars + set.values;
    const vec2 a = uintBitsToFloat(ConstUVec2s(values).v[corners.x]);
    const vec2 b = uintBitsToFloat(ConstUVec2s(values).v[corners.y]);
    const vec2 c = uintBitsToFloat(ConstUVec2s(values).v[corners.z]);
    const vec2 along_e = b - a;
    const vec2 along_f = c - a;
    const vec2 size = vec2(cutout.size & 0xffffu, cutout.size >> 16);
    const vec2 at_e = size * vec2(fused_dot(cutout.row_s.xy, along_e), fused_dot(cutout.row_t.xy, along_e));
    const vec2 at_f = size * vec2(fused_dot(cutout.row_s.xy, along_f), fused_dot(cutout.row_t.xy, along_f));
    const float width = near_lookup_width(v1 - v0, v2 - v0, at_e, at_f, walk.d, ray_cone(walk.path, t));
    if (width == UNKNOWN_WIDTH) return PRESENCE_UNKNOWN;
    const vec2 st = a * (1.0 - uv.x - uv.y) + b * uv.x + c * uv.y;
    const vec2 place = vec2(cutout.row_s.x * st.x + cutout.row_s.y * st.y + cutout.row_s.z,
                            cutout.row_t.x * st.x + cutout.row_t.y * st.y + cutout.row_t.z);
    return presence_in_mask(cutout.mask, uvec2(cutout.size, cutout.modes), place, width);
}

#endif
