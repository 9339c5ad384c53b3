// SPDX-License-Identifier: Apache-2.0
// Evaluates the masks for a candidate (decisions/0058), in as few loads and instructions as possible: most candidates
// need no more. The result is that of is_cut_in. A part of traverse.glsl; only with DEFERRED_CUTOUTS. Reads: the walk,
// tables of the mesh and its material, masks. Writes nothing.
#ifndef OOCPT_MASKED_PRESENCE_GLSL
#define OOCPT_MASKED_PRESENCE_GLSL

const uint PRESENCE_UNKNOWN = 0u;
const uint PRESENCE_NEVER = 1u;
const uint PRESENCE_ALWAYS = 2u;

// Decides whether the surface is there for this ray, as far as masks tell. v0, v1, v2: corners of the triangle.
uint masked_presence(uint triangle, vec3 v0, vec3 v1, vec3 v2, vec2 uv, float t) {
    // Most meshes have one set of coordinates: it is loaded before the material tells which set it uses.
    const uint64_t primvars = Meshes(FRAME.meshes).v[walk.mesh].primvars;
    GpuAttribute set = GpuAttribute(0ul, NO_NAME, 0u);
    if (Meshes(FRAME.meshes).v[walk.mesh].primvar_count > 0u) set = Attributes(primvars).v[0];
    const uint slot = material_slot(Instances(walk.instances).v[chain[level_index()]].prim_id,
                                    item_subset(walk.pose, triangle));
    if (slot == NO_MATERIAL || (slot & SLOT_PRESENCE) == 0u) return PRESENCE_ALWAYS;
    const GpuCutout cutout = Materials(FRAME.materials).v[material_number(slot)].cutout;
    if (cutout.mask == 0ul || (HAS_LEAF_KINDS && walk.other)) return PRESENCE_UNKNOWN;
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
    const uint coverage = coverage_at(cutout, a, b, c, uv, v1 - v0, v2 - v0, walk.d, ray_cone(walk.path, t));
    if (coverage == COVERAGE_UNKNOWN) return PRESENCE_UNKNOWN;
    return is_covered(coverage, cutout.is_chance != 0u, triangle, false) ? PRESENCE_ALWAYS : PRESENCE_NEVER;
}

#endif
