// SPDX-License-Identifier: Apache-2.0
// Makes a surface point from a hit: position with an error bound, normals, albedo, ids, and the inputs of its material.
//
// Self-intersection: a spawned ray is tested against the surface after its origin went through the same chain of maps
// as here. So we run that chain forwards from the computed world position (two floats), into the chunk and on, carry a
// bound on its rounding, and find how far from the triangle's plane it may land in the mesh's frame. The origin is
// moved along the normal by just that much, again in two floats. There is no scene epsilon. (Ideas: Waechter and
// Binder, Ray Tracing Gems ch. 6; NVIDIA 2023, "Solving Self-Intersection Artifacts in DirectX Raytracing".)
#ifndef OOCPT_SURFACE_GLSL
#define OOCPT_SURFACE_GLSL

#include "geometry/leaf.glsl"
#include "math/affine.glsl"
#include "geometry/attribute.glsl"
#include "geometry/motion.glsl"
#include "geometry/pose.glsl"
#include "geometry/surface_material.glsl"

struct Surface {
    Double3 position; // world
    float offset;  // how far along geometric_normal a spawned ray must start, either side
    vec3 geometric_normal; // unit, authored side
    vec3 shading_normal;   // unit, as authored or equal to geometric_normal
    vec3 albedo;
    int prim_id;
    uint instance_id;
    uint face;
    float cone; // width of the ray's cone there; 0 without textures
};

GpuSurfaceMaterial surface_material; // with HAS_MATERIALS: set by make_surface
uint surface_chain[MAX_LEVELS]; // instance records of the hit, the chunk's first: set before make_surface
uint surface_chunk_instance;    // its chunk instance: set by make_surface
float surface_time;             // of the path; with HAS_TIME only: set before make_surface
// True if the pass shades surfaces; a pass that does not defines it before it includes this.
#ifndef SURFACES_ARE_SHADED
#define SURFACES_ARE_SHADED true
#endif

#define INSTANCE_CHUNK surface_chunk_instance
#define INSTANCE_CHAIN surface_chain
#include "geometry/instance_primvars.glsl"

uint64_t chunk_records(uint chunk_instance) {
    const uint chunk = ChunkInstances(FRAME.chunk_instances).v[chunk_instance].chunk;
    return Chunks(FRAME.chunks).v[chunk].instances;
}

// The id of a record's placement, given that of the placement that contains the record.
uint placement_id(uint parent, uint64_t instances, uint record) {
    const uint count = Instances(instances).v[record].prototype_count & ~FLIPS_HANDEDNESS;
    return parent * count + Instances(instances).v[record].index_in_prototype;
}

// Follows the chain from the chunk: the whole map, the mesh, the ids.
Affine follow_chain(uint chunk_instance, out uint mesh, out int prim_id, out uint instance_id) {
    uint64_t instances = chunk_records(chunk_instance);
    uint record = surface_chain[0];
    uint target = Instances(instances).v[record].target;
    Affine map = placed_map(instances, record, target, surface_time);
    instance_id = placement_id(ChunkInstances(FRAME.chunk_instances).v[chunk_instance].instance_id, instances, record);
    if (HAS_NESTING) {
        for (uint level = 1u; level < MAX_LEVELS && (target & TARGET_ASSEMBLY) != 0u; ++level) {
            instances = Assemblies(FRAME.assemblies).v[target & TARGET_NUMBER].instances;
            record = surface_chain[level];
            target = Instances(instances).v[record].target;
            map = compose(placed_map(instances, record, target, surface_time), map);
            instance_id = placement_id(instance_id, instances, record);
        }
    }
    mesh = HAS_MOTION ? target & TARGET_NUMBER : target;
    prim_id = Instances(instances).v[record].prim_id;
    return map;
}

// Takes p from the world to the chunk's frame as traversal does; `error` bounds the components' errors. A start point
// is p moved by its offset and rounded to two floats (4 u^2), and `difference` drops a few u^2 of both terms and rounds
// once.
vec3 chunk_with_error(ChunkMap m, Double3 p, out vec3 error) {
    const vec3 r = difference(p, m.origin);
    const float u2 = 8.0 * UNIT_ROUNDOFF * UNIT_ROUNDOFF;
    const vec3 before = 2.0 * UNIT_ROUNDOFF * abs(r) + u2 * (abs(p.hi) + abs(m.origin.hi));
    error = apply_rows(abs(m.x), abs(m.y), abs(m.z), before + 4.0 * UNIT_ROUNDOFF * abs(r));
    return apply_rows(m.x, m.y, m.z, r);
}

// Takes p from the chunk's frame to the mesh's as traversal does, and `error`, a bound on its components' errors,
// along.
vec3 forward_with_error(uint chunk_instance, vec3 p, inout vec3 error) {
    uint64_t instances = chunk_records(chunk_instance);
    for (uint level = 0u; level < MAX_LEVELS; ++level) {
        const uint record = surface_chain[level];
        const uint target = Instances(instances).v[record].target;
        const Affine m = placed_map(instances, record, target, surface_time);
        const Affine size = Affine(abs(m.x), abs(m.y), abs(m.z));
        error = apply_vector(size, error) + 4.0 * UNIT_ROUNDOFF * apply_point(size, abs(p));
        p = apply_point(m, p);
        if (!HAS_NESTING || (target & TARGET_ASSEMBLY) == 0u) break;
        instances = Assemblies(FRAME.assemblies).v[target & TARGET_NUMBER].instances;
    }
    return p;
}

// The point p of a plane, moved in the plane to the point where the ray meets it, if that is farther than the rounding
// of the ray itself: barycentrics round by the triangle's size over its height, which for slivers, and for triangles
// much larger than their distance, is a lot.
Double3 on_ray(Double3 p, vec3 normal, Ray ray, float t) {
    const vec3 off = difference(p, add(Double3(ray.o, ray.o_lo), t * ray.d));
    const vec3 aside = off - dot3(off, normal) * normal;
    const float least = 16.0 * UNIT_ROUNDOFF * t;
    if (!(dot3(aside, aside) > least * least)) return p;
    return add(p, -aside);
}

// The point of a ray at distance t, in the frame of the mesh of surface_chain.
vec3 met_by(Ray ray, float t, uint chunk_instance, ChunkMap world) {
    vec3 error;
    const vec3 in_chunk = chunk_with_error(world, add(Double3(ray.o, ray.o_lo), t * ray.d), error);
    return forward_with_error(chunk_instance, in_chunk, error);
}

// Makes the surface point that `ray` met at distance `t`.
Surface make_surface(uint chunk_instance, uint triangle, vec2 uv, Ray ray, float t) {
    Surface s;
    uint mesh;
    surface_chunk_instance = chunk_instance;
    const ChunkMap world = chunk_map(chunk_instance);
    const Affine map = follow_chain(chunk_instance, mesh, s.prim_id, s.instance_id);
    Meshes meshes = Meshes(FRAME.meshes);
    const Pose pose = pose_of(mesh, surface_time);
    const uint flags = meshes.v[mesh].flags;
    vec3 v0, v1, v2;
    s.face = posed_item(pose, triangle, v0, v1, v2);
    s.cone = 0.0;
    const vec3 weights = vec3(1.0 - uv.x - uv.y, uv);
    const bool is_other = HAS_LEAF_KINDS && (flags & MESH_LEAF_MASK) != 0u;
    vec3 local, object_normal, size, normal;
    if (HAS_LEAF_KINDS && is_other) {
        const vec3 met = met_by(ray, t, chunk_instance, world);
        local = leaf_point(leaf_kind(flags), v0, v1, v2, uv, met, normal);
        object_normal = normal;
        size = vec3(0.0);
    } else {
        local = fma(v0, vec3(weights.x), fma(v1, vec3(weights.y), v2 * weights.z));
        normal = triangle_normal(v0, v1, v2, size);
        const vec3 winding = normal_or(normal, vec3(0.0, 0.0, 1.0));
        object_normal = (flags & MESH_LEFT_HANDED) != 0u ? -winding : winding;
    }
    const vec3 covector = combine_rows(world.x, world.y, world.z, apply_transposed(map, object_normal));
    s.geometric_normal = normal_or(covector, vec3(0.0, 0.0, 1.0));

    s.position = add(world.origin, unapply_rows(world.x, world.y, world.z, unapply_point(map, local)));
    if (!is_other) s.position = on_ray(s.position, s.geometric_normal, ray, t);
    vec3 error;
    const vec3 in_chunk = chunk_with_error(world, s.position, error);
    const vec3 landed = forward_with_error(chunk_instance, in_chunk, error);
    error += 8.0 * UNIT_ROUNDOFF * max(abs(v0), max(abs(v1), abs(v2)));
    // The triangle test rounds in proportion to the terms of its normal and of the way to a corner.
    float test = 8.0 * UNIT_ROUNDOFF * dot3(size, abs(v0 - landed)) / max(sqrt(dot3(normal, normal)), 1.0e-30);
    float beside = abs(dot3(object_normal, landed - local));
    if (HAS_LEAF_KINDS && is_other) {
        beside = leaf_beside(leaf_kind(flags), v0, v1, v2, uv, normal, landed);
        test = leaf_rounding(leaf_kind(flags), v0, v1, v2, landed);
    }
    const float distance = beside + dot3(abs(object_normal), error) + test;
    s.offset = distance / max(sqrt(dot3(covector, covector)), 1.0e-30);

    s.shading_normal = s.geometric_normal;
    vec3 smooth_normal = object_normal;
    if (HAS_NORMALS && (flags & MESH_HAS_NORMALS) != 0u) {
        const vec3 n = posed_normal(pose, mesh, triangle, weights);
        const vec3 in_world = combine_rows(world.x, world.y, world.z, apply_transposed(map, n));
        s.shading_normal = normal_or(in_world, s.geometric_normal);
        if (HAS_PATTERNS) smooth_normal = normal_or(n, object_normal);
    }
    if (HAS_MATERIALS) {
        const uint subset = item_subset(pose, triangle);
        surface_material = gather_material(mesh, triangle, weights, material_slot(s.prim_id, subset), local,
                                           smooth_normal);
        if (surface_material.material != NO_MATERIAL) {
            vec3 e, f;
            item_edges(pose, mesh, triangle, e, f);
            add_tangent(surface_material, mesh, triangle, e, f, s.geometric_normal, ray.d, world, map);
            if (HAS_PATTERNS && SURFACES_ARE_SHADED) add_object_frame(surface_material, world, map);
            if (HAS_HAIR) {
                bool is_tube = false;
                vec3 radial = vec3(0.0);
                if (HAS_LEAF_KINDS && is_other) {
                    is_tube = leaf_is_tube(leaf_kind(flags));
                    radial = leaf_radius(leaf_kind(flags), v0, v1, v2, uv) * object_normal;
                }
                add_fibre(surface_material, mesh, triangle, is_tube, e, f, radial, s.geometric_normal, world, map);
            }
        }
    }
    s.albedo = FRAME.default_albedo;
    if (HAS_COLORS && (flags & MESH_HAS_COLORS) != 0u) {
        s.albedo = attribute_vec3(meshes.v[mesh].colors, meshes.v[mesh].corner_indices, (flags >> 2) & 3u, triangle,
                                  weights);
    } else if (HAS_INSTANCE_PRIMVARS) {
        vec4 color;
        if (instance_primvar(NAME_DISPLAY_COLOR, color)) s.albedo = color.xyz;
    }
    s.albedo = clamp(s.albedo, vec3(0.0), vec3(1.0));
    return s;
}

#endif
