// SPDX-License-Identifier: Apache-2.0
// The inputs that a material needs of its mesh at a hit: the material's number, texture coordinates, primvars, and the
// direction in which u grows. All of it is geometry: it is gathered while the chunk is resident, and the textures may
// be loaded later (material.glsl).
#ifndef OOCPT_SURFACE_MATERIAL_GLSL
#define OOCPT_SURFACE_MATERIAL_GLSL

#include "math/affine.glsl"
#include "geometry/attribute.glsl"
#include "texture/footprint.glsl"
#include "geometry/pose.glsl"
#include "texture/ptex.glsl"
#include "geometry/edges.glsl"

// With HAS_MESH_LIGHTS: the shift of the mesh in GpuSurfaceMaterial::flags, up to MAX_LIGHT_MESH of the host.
const uint SURFACE_MESH_SHIFT = 8u;

// The word of a prim's slot: NO_MATERIAL, or the number of a material with SLOT_PRESENCE.
uint material_slot(int prim_id, uint subset) {
    const uint index = uint(prim_id + 1);
    if (index > MAX_PRIM_ID) return NO_MATERIAL;
    const GpuPrim prim = Prims(FRAME.prims).v[index];
    return subset < prim.slot_count ? ConstUints(FRAME.material_slots).v[prim.first_slot + subset] : NO_MATERIAL;
}

uint material_number(uint slot) {
    return slot == NO_MATERIAL ? NO_MATERIAL : slot & ~SLOT_PRESENCE;
}

// The entry of a primvar in its mesh's table; NO_NAME when it has none.
uint find_primvar(uint mesh, uint name) {
    if (name == NO_NAME) return NO_NAME;
    const uint count = Meshes(FRAME.meshes).v[mesh].primvar_count;
    const uint64_t table = Meshes(FRAME.meshes).v[mesh].primvars;
    for (uint i = 0u; i < count; ++i) {
        if (Attributes(table).v[i].name == name) return i;
    }
    return NO_NAME;
}

// Value `index`, of `width` floats, of those at `values`: a single float fills all components, else missing ones are 0,
// and alpha 1.
vec4 primvar_at(uint64_t values, uint index, uint width) {
    const uint at = index * width;
    ConstFloats v = ConstFloats(values);
    if (width == 1u) return vec4(v.v[at]);
    if (width == 2u) return vec4(v.v[at], v.v[at + 1u], 0.0, 1.0);
    if (width == 3u) return vec4(v.v[at], v.v[at + 1u], v.v[at + 2u], 1.0);
    return vec4(v.v[at], v.v[at + 1u], v.v[at + 2u], v.v[at + 3u]);
}

// The value that a primvar, which the mesh does not have, has at the current instance; false if no instancer has it.
// Defined by instance_primvars.glsl, which needs to know the instance.
bool instance_primvar(uint name, out vec4 value);

// The values of a primvar at the corners of a triangle.
void primvar_corners(uint mesh, uint entry, uint triangle, out vec4 a, out vec4 b, out vec4 c) {
    const uint64_t table = Meshes(FRAME.meshes).v[mesh].primvars;
    const uint rate_and_width = Attributes(table).v[entry].rate_and_width;
    const uint width = rate_and_width >> 8;
    const uint64_t values = table + Attributes(table).v[entry].values;
    const uvec3 i = attribute_indices(Meshes(FRAME.meshes).v[mesh].corner_indices, rate_and_width & 3u, triangle);
    a = primvar_at(values, i.x, width);
    b = a;
    c = a;
    if (i.x != i.y || i.y != i.z) {
        b = primvar_at(values, i.y, width);
        c = primvar_at(values, i.z, width);
    }
}

vec4 primvar_value(uint mesh, uint entry, uint triangle, vec3 weights) {
    vec4 a, b, c;
    primvar_corners(mesh, entry, triangle, a, b, c);
    if (a == b && b == c) return a;
    return a * weights.x + b * weights.y + c * weights.z;
}

// The texture coordinates of an input, given those of its set.
vec2 map_place(GpuInput i, vec2 st) {
    if (HAS_PTEX && (i.kind & INPUT_PTEX) != 0u) return st;
    return vec2(i.row_s.x * st.x + i.row_s.y * st.y + i.row_s.z, i.row_t.x * st.x + i.row_t.y * st.y + i.row_t.z);
}

// `point` and `normal`: of the hit, in the mesh's frame.
GpuSurfaceMaterial gather_material(uint mesh, uint triangle, vec3 weights, uint slot, vec3 point, vec3 normal) {
    GpuSurfaceMaterial m;
    m.material = material_number(slot);
    m.tangent = vec3(0.0);
    m.handedness = 0.0;
    m.flags = HAS_MESH_LIGHTS ? mesh << SURFACE_MESH_SHIFT : 0u;
    for (uint i = 0u; i < 2u; ++i) {
        m.uv[i] = vec2(0.0);
        m.footprints[i] = uvec2(0u);
        m.primvars[i] = vec4(0.0);
    }
    if (m.material == NO_MATERIAL) return m;
    Materials materials = Materials(FRAME.materials);
    [[unroll]] for (uint i = 0u; i < 2u; ++i) {
        const uint set = find_primvar(mesh, materials.v[m.material].names[i]);
        vec4 value;
        m.uv[i] = materials.v[m.material].set_fallback[i];
        if (HAS_PTEX && materials.v[m.material].names[i] == NAME_PTEX) {
            m.uv[i] = ptex_place(ptex_word(mesh, triangle), weights);
        } else if (set != NO_NAME) {
            m.uv[i] = primvar_value(mesh, set, triangle, weights).xy;
        } else if (instance_primvar(materials.v[m.material].names[i], value)) {
            m.uv[i] = value.xy;
        }
        const uint entry = find_primvar(mesh, materials.v[m.material].names[2u + i]);
        if (HAS_PATTERNS && materials.v[m.material].names[2u + i] == NAME_POSITION) {
            m.primvars[i] = vec4(point, 0.0);
        } else if (HAS_PATTERNS && materials.v[m.material].names[2u + i] == NAME_NORMAL) {
            m.primvars[i] = vec4(normal, 0.0);
        } else if (entry != NO_NAME) {
            m.primvars[i] = primvar_value(mesh, entry, triangle, weights);
        } else if (instance_primvar(materials.v[m.material].names[2u + i], value)) {
            m.primvars[i] = value;
        } else {
            continue;
        }
        m.flags |= 1u << i;
    }
    return m;
}

// Gradients of u and v over a triangle with edges e and f, along which they grow by d and g; `n`: a normal, not unit.
bool edge_gradients(vec2 d, vec2 g, vec3 e, vec3 f, out vec3 u, out vec3 v, out vec3 n) {
    const float scale = 1.0 / max(max(abs(e.x), max(abs(e.y), abs(e.z))), max(abs(f.x), max(abs(f.y), abs(f.z))));
    const vec3 x = e * scale;
    const vec3 y = f * scale;
    n = cross3(x, y);
    const float area = dot3(n, n);
    const vec3 along_x = cross3(y, n) * (scale / area); // 1 on e, 0 on f
    const vec3 along_y = cross3(n, x) * (scale / area);
    u = along_x * d.x + along_y * g.x;
    v = along_x * d.y + along_y * g.y;
    return area > 0.0;
}

// The gradients of the set of this name at its place st, in the mesh's frame; false if the mesh does not have it.
bool set_gradients(uint mesh, uint name, uint triangle, vec2 st, vec3 e, vec3 f, out vec3 u, out vec3 v, out vec3 n) {
    if (HAS_PTEX && name == NAME_PTEX) {
        vec2 a, b, c;
        ptex_corners_at(ptex_word(mesh, triangle), st, a, b, c);
        return edge_gradients(b - a, c - a, e, f, u, v, n);
    }
    const uint set = find_primvar(mesh, name);
    if (set == NO_NAME) return false;
    vec4 a, b, c;
    primvar_corners(mesh, set, triangle, a, b, c);
    return edge_gradients(b.xy - a.xy, c.xy - a.xy, e, f, u, v, n);
}

// Sets tangent, handedness and, for a ray along `d`, footprints. Gradients are covectors and go to the world as normals
// do; with n normal to the plane, dP/du is orthogonal to n and to the gradient of v.
void add_tangent(inout GpuSurfaceMaterial m, uint mesh, uint triangle, vec3 e, vec3 f, vec3 n, vec3 d, ChunkMap world,
                 Affine map) {
    Materials materials = Materials(FRAME.materials);
    const uint kind = materials.v[m.material].inputs[INPUT_NORMAL].kind;
    const uint wanted = (kind & 3u) == INPUT_TEXTURE ? (kind >> INPUT_SET_SHIFT) & 3u : 0u;
    [[unroll]] for (uint i = 0u; i < 2u; ++i) {
        vec3 u, v, normal;
        if (!set_gradients(mesh, materials.v[m.material].names[i], triangle, m.uv[i], e, f, u, v, normal)) continue;
        u = combine_rows(world.x, world.y, world.z, apply_transposed(map, u));
        v = combine_rows(world.x, world.y, world.z, apply_transposed(map, v));
        if (HAS_TEXTURES) m.footprints[i] = make_footprint(u, v, n, d);
        const vec3 along = cross3(v, n);
        const float area = dot3(u, along); // in the set per area in the world
        const float squared = dot3(along, along);
        if (i != wanted || !(squared > 1.0e-30 && squared < 1.0e30) || area == 0.0) continue;
        m.handedness = area < 0.0 ? -1.0 : 1.0;
        m.tangent = along * (m.handedness * inversesqrt(squared));
    }
}

// Tangent and bitangent of the frame in which a normal map is defined, about a unit normal; 0 if the mesh has none, or
// then any frame if `always`.
void normal_frame(GpuSurfaceMaterial m, vec3 normal, bool always, out vec3 x, out vec3 y) {
    x = normal_or(m.tangent - normal * dot3(normal, m.tangent), vec3(0.0));
    y = cross3(normal, x) * m.handedness;
    if (!always || (m.handedness != 0.0 && x != vec3(0.0))) return;
    const vec3 aside = abs(normal.x) < 0.5 ? vec3(0.0, normal.z, -normal.y) : vec3(-normal.z, 0.0, normal.x);
    x = normal_or(aside, vec3(0.0));
    y = cross3(normal, x);
}

// A unit vector as two numbers (Meyer et al. 2010, "On Floating-Point Normal Vectors").
vec2 octahedral(vec3 v) {
    const vec3 p = v / (abs(v.x) + abs(v.y) + abs(v.z));
    if (p.z >= 0.0) return p.xy;
    return (1.0 - abs(p.yx)) * vec2(p.x >= 0.0 ? 1.0 : -1.0, p.y >= 0.0 ? 1.0 : -1.0);
}

// Sets the primvars that tell how normals of the mesh's frame lie in the world (oocpt_materialx::uses::Uses), if the
// material reads them.
void add_object_frame(inout GpuSurfaceMaterial m, ChunkMap world, Affine map) {
    Materials materials = Materials(FRAME.materials);
    [[unroll]] for (uint i = 0u; i < 2u; ++i) {
        const uint name = materials.v[m.material].names[2u + i];
        if (name != NAME_FRAME_X && name != NAME_FRAME_Y) continue;
        const bool along_x = name == NAME_FRAME_X;
        const vec3 own = apply_transposed(map, along_x ? vec3(1.0, 0.0, 0.0) : vec3(0.0, 1.0, 0.0));
        const vec3 up = combine_rows(world.x, world.y, world.z, apply_transposed(map, vec3(0.0, 0.0, 1.0)));
        const vec3 z = normal_or(up, vec3(0.0, 0.0, 1.0));
        const vec2 pair = octahedral(z);
        const float size = dot3(up, z);
        const vec3 to = combine_rows(world.x, world.y, world.z, own) / (size > 0.0 ? size : 1.0);
        m.primvars[i] = vec4(to, along_x ? pair.x : pair.y);
        m.flags |= 1u << i;
    }
}

// Sets tangent and radius for a hair material: the tangent goes along the fibre, and `handedness` is its radius in the
// world, 0 if the leaf is not a tube. Ribbons have a primvar across their width (oocpt_core::material::ACROSS_NAME):
// the tangent is perpendicular to its gradient. `e`: an edge of the leaf; `radial`: from a tube's axis to its surface,
// both in the mesh's frame; `n`: in the world.
void add_fibre(inout GpuSurfaceMaterial m, uint mesh, uint triangle, bool is_tube, vec3 e, vec3 f, vec3 radial, vec3 n,
               ChunkMap world, Affine map) {
    Materials materials = Materials(FRAME.materials);
    if ((materials.v[m.material].flags & MATERIAL_HAIR) == 0u) return;
    m.handedness = 0.0;
    if (is_tube) {
        const vec3 axis = unapply_rows(world.x, world.y, world.z, unapply_rows(map.x.xyz, map.y.xyz, map.z.xyz, e));
        const vec3 reach = unapply_rows(world.x, world.y, world.z,
                                        unapply_rows(map.x.xyz, map.y.xyz, map.z.xyz, radial));
        m.tangent = normal_or(axis, vec3(0.0));
        m.handedness = sqrt(dot3(reach, reach));
        return;
    }
    const uint kind = materials.v[m.material].inputs[INPUT_NORMAL].kind;
    if ((kind & 3u) != INPUT_PRIMVAR) return;
    const uint entry = find_primvar(mesh, materials.v[m.material].names[2u + ((kind >> INPUT_SET_SHIFT) & 1u)]);
    if (entry == NO_NAME) return;
    vec4 a, b, c;
    primvar_corners(mesh, entry, triangle, a, b, c);
    vec3 u, v, normal;
    if (!edge_gradients(vec2(b.x - a.x, 0.0), vec2(c.x - a.x, 0.0), e, f, u, v, normal)) return;
    u = combine_rows(world.x, world.y, world.z, apply_transposed(map, u));
    m.tangent = normal_or(cross3(u, n), m.tangent);
}

#endif
