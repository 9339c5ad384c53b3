// SPDX-License-Identifier: Apache-2.0
// Walk of a ray through the instance levels and meshes: one loop, one stack, near child first.
//
// Before including, define ANY_HIT as 1 to stop at the first hit, else 0, and OPACITY_MODE as OPACITY_STOCHASTIC (a surface of
// opacity a is met with probability a, decided by a hash of seed, instances and triangle) or OPACITY_NONZERO (met if a > 0).
// traverse() returns the closest hit nearer than t_max; at equal distance the hit with the lower (instances, triangle)
// wins, so the result does not depend on the order of the walk. Reads the scene, writes nothing but a counter of rays that ran
// out of stack.
#ifndef OOCPT_TRAVERSE_GLSL
#define OOCPT_TRAVERSE_GLSL

#include "include/affine.glsl"
#include "include/attribute.glsl"
#include "include/sampler.glsl"
#include "traversal/box.glsl"
#include "traversal/triangle.glsl"

#define OPACITY_STOCHASTIC 0
#define OPACITY_NONZERO 1

// References on the stack: an inner node, or LEAF | (count - 1) << 28 | first.
const uint LEAF = 1u << 31;
const uint RETURN = 0xfffffffeu; // back to the parent level
const uint DONE = 0xffffffffu;

// Boxes are culled only this far behind the closest hit, so that rounding cannot hide an equally close one.
const float CULL_PAD = 1.0000038;

struct Found {
    float t;
    vec2 uv;
    uint triangle;
};

uint stack[STACK_SIZE];
uint chain[MAX_LEVELS];       // instance records from the root to here
uint found_chain[MAX_LEVELS]; // those of the closest hit
// Rays and arrays of the levels below the root; the root's are in registers.
vec3 level_o[MAX_LEVELS];
vec3 level_d[MAX_LEVELS];
uint64_t level_nodes[MAX_LEVELS];
uint64_t level_instances[MAX_LEVELS];

uint child_reference(uint child, uint count) {
    return count == 0u ? child : LEAF | (count - 1u) << 28 | child;
}

// Whether the candidate (chain up to `level`, triangle) comes before the closest hit in the order of ids.
bool precedes(uint level, uint triangle, uint found_triangle) {
    for (uint i = 0u; i <= level; ++i) {
        if (chain[i] != found_chain[i]) return chain[i] < found_chain[i];
    }
    return triangle < found_triangle;
}

// Whether the surface is there for this ray.
bool is_opaque(uint mesh, uint level, uint triangle, vec2 uv, uint seed) {
    Meshes meshes = Meshes(FRAME.meshes);
    const uint flags = meshes.v[mesh].flags;
    if ((flags & MESH_HAS_OPACITIES) == 0u) return true;
    const float opacity = attribute_float(meshes.v[mesh].opacities, meshes.v[mesh].corner_indices, (flags >> 4) & 3u,
                                          triangle, vec3(1.0 - uv.x - uv.y, uv));
#if OPACITY_MODE == OPACITY_STOCHASTIC
    uint h = seed;
    for (uint i = 0u; i <= level; ++i) h = hash_combine(h, chain[i]);
    return float(hash_u32(hash_combine(h, triangle)) >> 8) * 5.9604644775390625e-8 < opacity;
#else
    return opacity > 0.0;
#endif
}

bool traverse(vec3 world_o, vec3 world_d, float t_max, uint seed, out Found found) {
    found.t = t_max;
    found.triangle = 0xffffffffu;
    const uint64_t root_nodes = FRAME.root_nodes;
    const uint64_t root_instances = FRAME.root_instances;
    const uint64_t meshes = FRAME.meshes;
    uint64_t nodes = root_nodes;
    uint64_t instances = root_instances;
    uint64_t triangles = 0ul;
    vec3 o = world_o;
    vec3 d = world_d;
    vec3 reciprocal = safe_reciprocal(d);
    float limit = t_max;
    uint level = 0u;
    uint mesh = 0u;
    bool in_mesh = false;
    bool overflow = false;
    bool hit = false;
    stack[0] = DONE;
    uint top = 1u;
    uint reference = 0u;
    while (true) {
        while (reference < LEAF) {
            const uint at = reference * 4u;
            const vec4 a = ConstVec4s(nodes).v[at];
            const vec4 b = ConstVec4s(nodes).v[at + 1u];
            const vec4 c = ConstVec4s(nodes).v[at + 2u];
            const uvec4 links = floatBitsToUint(ConstVec4s(nodes).v[at + 3u]);
            const bvec3 negative = lessThan(reciprocal, vec3(0.0));
            const float t0 = hit_box(a.xyz, vec3(b.zw, c.x), o, reciprocal, negative, limit);
            const float t1 = hit_box(vec3(a.w, b.xy), c.yzw, o, reciprocal, negative, limit);
            const uint first = child_reference(links.x, links.z);
            const uint second = child_reference(links.y, links.w);
            if (t0 >= 0.0 && t1 >= 0.0) {
                const bool swap = t1 < t0;
                reference = swap ? second : first;
                if (top < STACK_SIZE) {
                    stack[top++] = swap ? first : second;
                } else {
                    overflow = true;
                }
            } else if (t0 >= 0.0) {
                reference = first;
            } else if (t1 >= 0.0) {
                reference = second;
            } else {
                reference = stack[--top];
            }
        }
        if (reference == DONE) break;
        if (reference == RETURN) {
            if (MAX_LEVELS > 1u && !in_mesh) --level;
            in_mesh = false;
            if (MAX_LEVELS == 1u || level == 0u) {
                o = world_o;
                d = world_d;
                nodes = root_nodes;
                instances = root_instances;
            } else {
                o = level_o[level];
                d = level_d[level];
                nodes = level_nodes[level];
                instances = level_instances[level];
            }
            reciprocal = safe_reciprocal(d);
            reference = stack[--top];
            continue;
        }
        if (in_mesh) {
            const uint begin = reference & 0x0fffffffu;
            const uint end = begin + ((reference >> 28) & 7u) + 1u;
            for (uint triangle = begin; triangle < end; ++triangle) {
                const vec3 v0 = ConstVec4s(triangles).v[triangle * 3u].xyz;
                const vec3 v1 = ConstVec4s(triangles).v[triangle * 3u + 1u].xyz;
                const vec3 v2 = ConstVec4s(triangles).v[triangle * 3u + 2u].xyz;
                float t;
                vec2 uv;
                if (!hit_triangle(v0, v1, v2, o, d, t, uv)) continue;
#if ANY_HIT
                if (!(t > 0.0 && t < t_max)) continue;
#else
                if (!(t > 0.0 && (t < found.t || (hit && t == found.t && precedes(level, triangle, found.triangle))))) {
                    continue;
                }
#endif
                if (HAS_OPACITY && !is_opaque(mesh, level, triangle, uv, seed)) continue;
                hit = true;
                found.t = t;
                found.uv = uv;
                found.triangle = triangle;
#if ANY_HIT
                break;
#else
                limit = t * CULL_PAD;
                for (uint i = 0u; i <= level; ++i) found_chain[i] = chain[i];
#endif
            }
#if ANY_HIT
            if (hit) break;
#endif
            reference = stack[--top];
            continue;
        }
        const uint record = reference & 0x0fffffffu;
        if (top >= STACK_SIZE) {
            overflow = true;
            reference = stack[--top];
            continue;
        }
        const Affine map = instance_map(instances, record);
        const uint target = Instances(instances).v[record].target;
        stack[top++] = RETURN;
        chain[level] = record;
        o = apply_point(map, o);
        d = apply_vector(map, d);
        reciprocal = safe_reciprocal(d);
        reference = 0u;
        if (HAS_INSTANCING && (target & TARGET_ASSEMBLY) != 0u) {
            ++level;
            nodes = Assemblies(FRAME.assemblies).v[target & ~TARGET_ASSEMBLY].nodes;
            instances = Assemblies(FRAME.assemblies).v[target & ~TARGET_ASSEMBLY].instances;
            level_o[level] = o;
            level_d[level] = d;
            level_nodes[level] = nodes;
            level_instances[level] = instances;
        } else {
            in_mesh = true;
            mesh = target;
            nodes = Meshes(meshes).v[target].nodes;
            triangles = Meshes(meshes).v[target].triangles;
        }
    }
    if (overflow) atomicAdd(COUNTERS.stack_overflows, 1u);
    return hit;
}

#endif
