// SPDX-License-Identifier: Apache-2.0
// Walk of a ray through the instance levels and meshes: one loop, one stack, near child first.
//
// Before including, define ANY_HIT as 1 to stop at the first hit, else 0, and OPACITY_MODE as OPACITY_STOCHASTIC (a surface of
// opacity a is met with probability a, decided by a hash of seed, instances and triangle) or OPACITY_NONZERO (met if a > 0).
// traverse() returns the closest hit nearer than t_max; at equal distance the hit with the lower (instances, triangle)
// wins, so the result does not depend on the order of the walk. Reads the scene, writes nothing but a counter of rays that ran
// out of stack or levels.
#ifndef OOCPT_TRAVERSE_GLSL
#define OOCPT_TRAVERSE_GLSL

#include "include/affine.glsl"
#include "include/attribute.glsl"
#include "include/sampler.glsl"
#include "traversal/box.glsl"
#include "traversal/stack.glsl"
#include "traversal/triangle.glsl"

#define OPACITY_STOCHASTIC 0
#define OPACITY_NONZERO 1

// Boxes are culled only this far behind the closest hit, so that rounding cannot hide an equally close one.
const float CULL_PAD = 1.0000038;

struct Found {
    float t;
    vec2 uv;
    uint triangle;
};

// Where the walk is: the ray in the frame of the current level or mesh, and the arrays there.
struct Walk {
    vec3 o;
    vec3 d;
    vec3 reciprocal;
    float limit; // boxes entered behind this hold no closer hit
    uint64_t nodes;
    uint64_t instances;
    uint64_t triangles;
    uint level; // instance records above the current level
    uint mesh;
    uint seed;
    bool in_mesh;
    bool hit;
};

Walk walk;
uint chain[MAX_LEVELS];       // instance records from the root to here
uint found_chain[MAX_LEVELS]; // those of the closest hit
// Rays and arrays of the levels below the root, to come back to; the root's are at hand.
vec3 level_o[MAX_LEVELS];
vec3 level_d[MAX_LEVELS];
uint64_t level_nodes[MAX_LEVELS];
uint64_t level_instances[MAX_LEVELS];

// Whether the candidate (chain, triangle) comes before the closest hit in the order of ids.
bool precedes(uint triangle, uint found_triangle) {
    for (uint i = 0u; i <= walk.level; ++i) {
        if (chain[i] != found_chain[i]) return chain[i] < found_chain[i];
    }
    return triangle < found_triangle;
}

// Whether the surface is there for this ray.
bool is_opaque(uint triangle, vec2 uv) {
    Meshes meshes = Meshes(FRAME.meshes);
    const uint flags = meshes.v[walk.mesh].flags;
    if ((flags & MESH_HAS_OPACITIES) == 0u) return true;
    const float opacity = attribute_float(meshes.v[walk.mesh].opacities, meshes.v[walk.mesh].corner_indices,
                                          (flags >> 4) & 3u, triangle, vec3(1.0 - uv.x - uv.y, uv));
#if OPACITY_MODE == OPACITY_STOCHASTIC
    uint h = walk.seed;
    for (uint i = 0u; i <= walk.level; ++i) h = hash_combine(h, chain[i]);
    return float(hash_u32(hash_combine(h, triangle)) >> 8) * 5.9604644775390625e-8 < opacity;
#else
    return opacity > 0.0;
#endif
}

// From an inner node to the nearer child that is hit; the other one goes to the stack.
uint descend(uint reference) {
    const uint at = reference * 4u;
    const vec4 a = ConstVec4s(walk.nodes).v[at];
    const vec4 b = ConstVec4s(walk.nodes).v[at + 1u];
    const vec4 c = ConstVec4s(walk.nodes).v[at + 2u];
    const uvec4 links = floatBitsToUint(ConstVec4s(walk.nodes).v[at + 3u]);
    const float t0 = hit_box(a.xyz, vec3(b.zw, c.x), walk.o, walk.reciprocal, walk.limit);
    const float t1 = hit_box(vec3(a.w, b.xy), c.yzw, walk.o, walk.reciprocal, walk.limit);
    const uint first = child_reference(links.x, links.z);
    const uint second = child_reference(links.y, links.w);
    if (t0 >= 0.0 && t1 >= 0.0) {
        const bool swap = t1 < t0;
        push_reference(swap ? first : second, max(t0, t1));
        return swap ? second : first;
    }
    if (t0 >= 0.0) return first;
    if (t1 >= 0.0) return second;
    return pop_reference(walk.limit);
}

// Tests the triangles of a leaf; true ends the walk.
bool visit_triangles(uint begin, uint end, float t_max, inout Found found) {
    for (uint triangle = begin; triangle < end; ++triangle) {
        const vec3 v0 = ConstVec4s(walk.triangles).v[triangle * 3u].xyz;
        const vec3 v1 = ConstVec4s(walk.triangles).v[triangle * 3u + 1u].xyz;
        const vec3 v2 = ConstVec4s(walk.triangles).v[triangle * 3u + 2u].xyz;
        float t;
        vec2 uv;
        if (!hit_triangle(v0, v1, v2, walk.o, walk.d, t, uv) || !(t > 0.0)) continue;
#if ANY_HIT
        if (!(t < t_max)) continue;
#else
        if (!(t < found.t || (walk.hit && t == found.t && precedes(triangle, found.triangle)))) continue;
#endif
        if (HAS_OPACITY && !is_opaque(triangle, uv)) continue;
        walk.hit = true;
        found = Found(t, uv, triangle);
#if ANY_HIT
        return true;
#else
        walk.limit = t * CULL_PAD;
        for (uint i = 0u; i <= walk.level; ++i) found_chain[i] = chain[i];
#endif
    }
    return false;
}

// Into the target of an instance record; returns its root, or the next reference where there is no room.
uint enter(uint record) {
    const Affine map = instance_map(walk.instances, record);
    const uint target = Instances(walk.instances).v[record].target;
    const bool nested = HAS_INSTANCING && (target & TARGET_ASSEMBLY) != 0u;
    if (stack_top >= STACK_SIZE || (nested && walk.level + 1u >= MAX_LEVELS)) {
        stack_overflow = true;
        return pop_reference(walk.limit);
    }
    push_reference(RETURN, 0.0);
    chain[walk.level] = record;
    walk.o = apply_point(map, walk.o);
    walk.d = apply_vector(map, walk.d);
    walk.reciprocal = safe_reciprocal(walk.d);
    if (nested) {
        ++walk.level;
        walk.nodes = Assemblies(FRAME.assemblies).v[target & ~TARGET_ASSEMBLY].nodes;
        walk.instances = Assemblies(FRAME.assemblies).v[target & ~TARGET_ASSEMBLY].instances;
        level_o[walk.level] = walk.o;
        level_d[walk.level] = walk.d;
        level_nodes[walk.level] = walk.nodes;
        level_instances[walk.level] = walk.instances;
    } else {
        walk.in_mesh = true;
        walk.mesh = target;
        walk.nodes = Meshes(FRAME.meshes).v[target].nodes;
        walk.triangles = Meshes(FRAME.meshes).v[target].triangles;
    }
    return 0u;
}

// Back from a mesh to the level that it was entered from, or from an assembly to the level above.
void leave(vec3 world_o, vec3 world_d) {
    if (MAX_LEVELS > 1u && !walk.in_mesh) --walk.level;
    walk.in_mesh = false;
    if (MAX_LEVELS == 1u || walk.level == 0u) {
        walk.o = world_o;
        walk.d = world_d;
        walk.nodes = FRAME.root_nodes;
        walk.instances = FRAME.root_instances;
    } else {
        walk.o = level_o[walk.level];
        walk.d = level_d[walk.level];
        walk.nodes = level_nodes[walk.level];
        walk.instances = level_instances[walk.level];
    }
    walk.reciprocal = safe_reciprocal(walk.d);
}

bool traverse(vec3 world_o, vec3 world_d, float t_max, uint seed, out Found found) {
    found = Found(t_max, vec2(0.0), 0u);
    walk = Walk(world_o, world_d, safe_reciprocal(world_d), t_max, FRAME.root_nodes, FRAME.root_instances, 0ul, 0u, 0u,
                seed, false, false);
    clear_stack();
    uint reference = 0u;
    while (true) {
        while (reference < LEAF) reference = descend(reference);
        if (reference == DONE) break;
        const uint first = reference & 0x0fffffffu;
        if (reference == RETURN) {
            leave(world_o, world_d);
        } else if (!walk.in_mesh) {
            reference = enter(first);
            continue;
        } else if (visit_triangles(first, first + ((reference >> 28) & 7u) + 1u, t_max, found)) {
            break;
        }
        reference = pop_reference(walk.limit);
    }
    if (stack_overflow) atomicAdd(COUNTERS.stack_overflows, 1u);
    return walk.hit;
}

#endif
