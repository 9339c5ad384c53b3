// SPDX-License-Identifier: Apache-2.0
// Meshes that emit light, sampled as lights (Features::MESH_LIGHTS): a tree over their placements, below it one over
// the faces of each mesh in the mesh's own frame, then a triangle by area times weight, then a uniform point of it
// (Pharr et al. 2023, 12.6.3).
//
// The density per solid angle of a point is a function of what a hit there knows: prim, instance, mesh, face, material
// and normal. The tree of a mesh is walked with the receiver transformed into its frame: the side of a plane on which
// it lies is the same there, so nothing that shines on the receiver is left out; distances may be off under uneven
// scales, which costs noise only. With M the placement's linear map and N the unit normal in the world, areas grow by
// |det M| / |M^T N|. All tables are always on the device: the choice does not depend on which chunks are resident.
// Placements that are not in the table are met by BSDF rays alone. A moving placement is used at its position at the
// time of the path, for choosing faces and points, for densities and for hits; the tree over placements bounds it at
// all times (book, design/motion). With HAS_MESH_LIGHT_VALUES some emissions are not constant. The emission of a point
// is computed as at a hit there: a primvar between its values at the corners, a texture through the same lookup and
// with the cone that a BSDF ray in this direction would have, so that both strategies see one function. Weights are
// means over faces, computed by the host (see the book, design/lights); they only affect what is chosen. With streaming
// the texture is looked up before the surface is shaded, as one more lookup of its own (resolve_lights). Emission goes
// to both sides, as it does for rays that meet it.
#ifndef OOCPT_LIGHT_MESH_GLSL
#define OOCPT_LIGHT_MESH_GLSL

#include "geometry/surface_material.glsl"

// A point of a mesh light, seen from a receiver.
struct MeshLightPoint {
    vec3 direction;
    float distance;
    float reach; // where the shadow ray ends: before the mesh itself, wherever rounding puts it
    vec3 emission;
    float density; // per solid angle, of all there is to choose
    vec3 normal;   // unit, either side
    uint light;
    uint face;
    // With HAS_MESH_LIGHT_VALUES, `emission` is not known yet, and these describe its lookup:
    uint material;
    uint triangle;
    uint subset;
    vec2 place; // weights of the second and the third corner
    vec3 edges[2]; // to these corners, in the world
};

// Loads a mesh light as it is placed at the time of the path.
GpuMeshLight load_mesh_light(uint index) {
    GpuMeshLight light = MeshLights(LIGHTING.mesh_lights).v[index];
    if (HAS_MOVING_MESH_LIGHTS) move_mesh_light(index, light);
    return light;
}

GpuLightLeaf load_light_leaf(uint index) {
    return LightLeaves(LIGHTING.light_leaves).v[index];
}

// Share of the local lights among the lights with a place; negative if no light with a place contributes.
float mesh_light_first(Receiver r) {
    return HAS_LOCAL_LIGHTS ? first_share(load_light_node(LIGHTING.joint), r) : 0.0;
}

// The weight of an emission in choosing: luminance, but not 0 for pure colours. `emission_weight` of the host.
float emission_weight(vec3 emission) {
    return max(dot(emission, vec3(0.2126, 0.7152, 0.0722)), 0.01 * (emission.x + emission.y + emission.z));
}

// The emission of a material, if it is a constant that makes its mesh a light; else 0.
vec3 constant_emission(uint material) {
    if (material == NO_MATERIAL) return vec3(0.0);
    Materials materials = Materials(FRAME.materials);
    if ((materials.v[material].inputs[INPUT_EMISSIVE_COLOR].kind & 3u) != INPUT_CONSTANT) return vec3(0.0);
    if ((materials.v[material].flags & MATERIAL_PRESENCE) != 0u) return vec3(0.0);
    return max(materials.v[material].inputs[INPUT_EMISSIVE_COLOR].value.xyz, 0.0);
}

// The receiver in a placement's frame. `origin` is its position in two floats.
Receiver receiver_inside(GpuMeshLight light, Double3 origin, vec3 n) {
    const vec3 place = difference(origin, Double3(light.position, light.position_lo));
    const vec3 yz = cross3(light.y, light.z);
    const vec3 zx = cross3(light.z, light.x);
    const vec3 xy = cross3(light.x, light.y);
    const float determinant = dot3(light.x, yz);
    const vec3 normal = vec3(dot3(light.x, n), dot3(light.y, n), dot3(light.z, n));
    const float squared = dot3(normal, normal);
    return Receiver(vec3(dot3(yz, place), dot3(zx, place), dot3(xy, place)) / determinant,
                    squared > 0.0 ? normal * inversesqrt(squared) : vec3(0.0));
}

// Density per world area of the points of a leaf's triangle with weight `weight` and unit normal `n`.
float leaf_density(GpuMeshLight light, GpuLightLeaf leaf, float weight, vec3 n) {
    const float determinant = abs(dot3(light.x, cross3(light.y, light.z)));
    const vec3 covector = vec3(dot3(light.x, n), dot3(light.y, n), dot3(light.z, n));
    return weight / leaf.total * (sqrt(dot3(covector, covector)) / determinant);
}

// The triangle of a leaf that u in [0, 1) selects.
uint choose_triangle(GpuLightLeaf leaf, float u) {
    uint low = leaf.first;
    uint high = leaf.first + leaf.count - 1u;
    while (low < high) {
        const uint middle = (low + high) / 2u;
        if (u < LightTriangles(LIGHTING.light_triangles).v[middle].cumulative) {
            high = middle;
        } else {
            low = middle + 1u;
        }
    }
    return low;
}

// Samples a point of a mesh light. `share`: probability of getting here. u.x and u.w choose the placement, u_mesh the
// leaf and triangle below it, u.yz the point.
bool sample_mesh_light(Receiver r, Double3 origin, vec4 u, vec4 u_mesh, float share, out MeshLightPoint point) {
    float chosen = share;
    if (!choose_mesh_leaf(0u, r, u.x, u.w, point.light, chosen)) return false;
    const GpuMeshLight light = load_mesh_light(point.light);
    const uint root = LightMeshes(LIGHTING.light_meshes).v[light.light_mesh].root;
    uint index;
    if (!choose_mesh_leaf(root, receiver_inside(light, origin, r.n), u_mesh.x, u_mesh.y, index, chosen)) return false;
    const GpuLightLeaf leaf = load_light_leaf(index);
    point.triangle = choose_triangle(leaf, u_mesh.z);
    const GpuLightTriangle t = LightTriangles(LIGHTING.light_triangles).v[point.triangle];
    point.face = t.face;
    point.subset = t.subset;
    point.material = material_number(material_slot(int(light.prim_id), t.subset));
    point.emission = constant_emission(point.material);
    const float weight = HAS_MESH_LIGHT_VALUES ? LightValues(LIGHTING.light_values).v[point.triangle].weight
                                               : emission_weight(point.emission) / light.scale;
    if (!(weight > 0.0)) return false;

    const float s = sqrt(u.y);
    point.place = vec2(s * (1.0 - u.z), s * u.z);
    const vec3 q = combine_rows(t.v0, t.v1, t.v2, vec3(1.0 - s, point.place));
    const vec3 from_center = combine_rows(light.x, light.y, light.z, q);
    const vec3 e = combine_rows(light.x, light.y, light.z, t.v1 - t.v0);
    const vec3 f = combine_rows(light.x, light.y, light.z, t.v2 - t.v0);
    const float size = max(max(max(abs(e.x), abs(e.y)), max(abs(e.z), abs(f.x))), max(abs(f.y), abs(f.z)));
    const vec3 normal = cross3(e / size, f / size);
    const float squared = dot3(normal, normal);
    const vec3 towards = from_center - difference(origin, Double3(light.position, light.position_lo));
    point.distance = sqrt(dot3(towards, towards));
    if (!(squared > 0.0 && point.distance > 0.0)) return false;
    point.edges[0] = e;
    point.edges[1] = f;
    point.normal = normal * inversesqrt(squared);
    point.direction = towards / point.distance;
    const float cosine = abs(dot3(point.normal, point.direction));
    if (!(cosine > 0.0)) return false;
    point.density = chosen * leaf_density(light, leaf, weight, point.normal)
        * (point.distance * point.distance / cosine);
    // The mesh is met up to `error` off its plane; grazing rays keep half of their length.
    const float off = light.error / cosine;
    point.reach = max(point.distance * SHADOW_END - off, 0.5 * point.distance);
    return point.density > 0.0;
}

#ifdef OOCPT_MATERIAL_GLSL
// The ray cone of the receiving surface: its width there, and its growth for a ray of this density.
uint ask_path;
float ask_width;
// The unit that the lookup waits for, as texture_lookup returns it.
uint ask_missing;

#include "light/program.glsl"

// Emission of a chosen point. `pdf`: density of the direction to it by the BSDF.
vec3 point_emission(MeshLightPoint point, float pdf) {
    if (!HAS_MESH_LIGHT_VALUES || point.material == NO_MATERIAL) return point.emission;
    Materials materials = Materials(FRAME.materials);
    const uint kind = materials.v[point.material].inputs[INPUT_EMISSIVE_COLOR].kind & 3u;
    if (kind == INPUT_CONSTANT) return point.emission;
    if ((materials.v[point.material].flags & MATERIAL_PRESENCE) != 0u) return vec3(0.0);
    if (kind == INPUT_PRIMVAR) {
        const uint first = MeshLights(LIGHTING.mesh_lights).v[point.light].values;
        if (first != NO_INDEX) {
            const vec3 given = ConstVec3s(LIGHTING.light_placed_values).v[first + point.subset];
            if (floatBitsToUint(given.x) != NO_VALUE) return valid_emission(given);
        }
    }
    if (HAS_MESH_LIGHT_PROGRAMS && kind == INPUT_REGISTER) return program_emission(point, pdf);
    const GpuLightValue v = LightValues(LIGHTING.light_values).v[point.triangle];
    vec3 value = v.a;
    if (v.a != v.b || v.b != v.c) {
        value = v.a * (1.0 - point.place.x - point.place.y) + v.b * point.place.x + v.c * point.place.y;
    }
    if (kind == INPUT_PRIMVAR) return valid_emission(value);
    if (!HAS_TEXTURES) return vec3(0.0);
    GpuSurfaceMaterial m;
    m.material = point.material;
    m.flags = 0u;
    vec3 gradient_u, gradient_v, n;
    uvec2 footprint = uvec2(0u);
    if (edge_gradients(v.b.xy - v.a.xy, v.c.xy - v.a.xy, point.edges[0], point.edges[1], gradient_u, gradient_v, n)) {
        footprint = make_footprint(gradient_u, gradient_v, point.normal, point.direction);
    }
    for (uint i = 0u; i < 2u; ++i) {
        m.uv[i] = value.xy;
        m.footprints[i] = footprint;
    }
    last_texture = 0xffffffffu;
    return valid_emission(input_value(m, INPUT_EMISSIVE_COLOR,
                                      fma(next_spread(ask_path, pdf), point.distance, ask_width), ask_missing).xyz);
}
#endif

// The first entry that is not before (prim_id, instance_id, mesh); the number of entries if there is none.
uint find_mesh_light(uint prim_id, uint instance_id, uint mesh) {
    MeshLights lights = MeshLights(LIGHTING.mesh_lights);
    uint low = 0u;
    uint high = LIGHTING.mesh_light_count;
    while (low < high) {
        const uint middle = (low + high) / 2u;
        const uint p = lights.v[middle].prim_id;
        const uint i = lights.v[middle].instance_id;
        const bool before =
            p != prim_id ? p < prim_id : (i != instance_id ? i < instance_id : lights.v[middle].mesh < mesh);
        if (before) {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    return low;
}

// Density per solid angle with which a light would have been chosen at the point of a mesh that a ray has met. `share`:
// probability of choosing a light with a place. `r` and `origin`: the receiver that the ray has left; n: unit normal
// there, `facing`: cosine to the ray.
float mesh_light_density(Receiver r, Double3 origin, float share, uint prim_id, uint instance_id, uint mesh, uint face,
                         uint material, vec3 n, float distance, float facing) {
    const vec3 emission = HAS_MESH_LIGHT_VALUES ? vec3(0.0) : constant_emission(material);
    if (!HAS_MESH_LIGHT_VALUES && !(max(emission.x, max(emission.y, emission.z)) > 0.0)) return 0.0;
    const uint index = find_mesh_light(prim_id, instance_id, mesh);
    if (index >= LIGHTING.mesh_light_count) return 0.0;
    const GpuMeshLight light = load_mesh_light(index);
    if (light.prim_id != prim_id || light.instance_id != instance_id || light.mesh != mesh) return 0.0;
    const GpuLightMesh table = LightMeshes(LIGHTING.light_meshes).v[light.light_mesh];
    ConstUVec2s faces = ConstUVec2s(LIGHTING.light_faces);
    uint low = table.first_face;
    uint high = low + table.face_count;
    const uint end = high;
    while (low < high) {
        const uint middle = (low + high) / 2u;
        if (faces.v[middle].x < face) {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    if (low >= end || faces.v[low].x != face) return 0.0;
    const GpuLightLeaf leaf = load_light_leaf(faces.v[low].y);
    const float first = mesh_light_first(r);
    if (first < 0.0) return 0.0;
    float chosen = share * (1.0 - first);
    chosen = mesh_leaf_probability(0u, uvec2(light.trail[0], light.trail[1]), r, chosen);
    chosen = mesh_leaf_probability(table.root, uvec2(leaf.trail[0], leaf.trail[1]), receiver_inside(light, origin, r.n),
                                   chosen);
    const float weight =
        HAS_MESH_LIGHT_VALUES ? ConstFloats(LIGHTING.light_face_weights).v[low]
            : emission_weight(emission) / light.scale;
    const float density = chosen * leaf_density(light, leaf, weight, n)
        * (distance * distance / max(abs(facing), 1.0e-30));
    return density > 0.0 ? density : 0.0;
}

#endif
