// SPDX-License-Identifier: Apache-2.0
// Cutouts by programs: the program for a material's opacity alone, run at a candidate of a hit. A part of opacity.glsl;
// only with CUTOUT_PROGRAMS.
//
// A program may compare the values that it looks up, so its lookups are of the finest level: a value that is filtered
// first gives another share of coverage (decisions/0058).
//
// In core lookups request their tiles as those of shading do. With streaming a program makes at most CUTOUT_LOOKUPS of
// them; the finished ones are stored with the deferred test, so that each tile lets it go on: the lookup under way is
// the deferred test, resolve_cutouts continues it, and the ray comes back and runs the program again with the stored
// values.
#ifndef OOCPT_CUTOUT_PROGRAM_GLSL
#define OOCPT_CUTOUT_PROGRAM_GLSL

// Lookups of the program under way: the number made, and the number known from before.
uint cutout_made;
uint cutout_known;
vec4 cutout_values[CUTOUT_LOOKUPS];
// The lookup that waits, as in a deferred test.
DeferredAlphaTest cutout_wait;

vec4 cutout_lookup(uint texture, vec2 st, float, out uint unit) {
    const float width = 0.0;
    unit = TEXTURE_DONE;
    const uint k = min(cutout_made, CUTOUT_LOOKUPS - 1u);
    ++cutout_made;
    if (!HAS_STREAMING) {
        TextureProgress progress = TextureProgress(UNKNOWN_TEXEL, 0u);
        requested_lookup(walk.path, texture, st, width, progress);
        return progress.mean;
    }
    if (k < cutout_known) return cutout_values[k];
    if (cutout_wait.unit != OWN_UNIT) return vec4(0.0); // another one waits
    TextureProgress progress = TextureProgress(vec4(0.0), 0u);
    const uint status = continue_lookup(texture, st, width, progress);
    cutout_values[k] = progress.mean;
    if (status < TEXTURE_FALLBACK) {
        const uint flags = ALPHA_TEST_OF_PROGRAM | k << ALPHA_TEST_LOOKUP_SHIFT | progress.taps;
        cutout_wait = DeferredAlphaTest(0.0, 0u, walk.chunk_instance, flags, progress.mean, texture, st, width, 1.0,
                                        0.0, 0.0, STREAMING.first_tile + status);
    }
    return progress.mean;
}

#define PATTERN_LOOKUP cutout_lookup
#include "material/pattern.glsl"

// The map of the candidate's record at a level.
Affine candidate_record(uint level) {
    const uint target = Instances(level_instances[level]).v[chain[level]].target;
    return placed_map(level_instances[level], chain[level], target, walk.time);
}

// The map from the chunk's frame to the mesh's.
Affine candidate_map() {
    Affine map = candidate_record(0u);
    if (HAS_NESTING) {
        for (uint i = 1u; i <= level_index(); ++i) map = compose(candidate_record(i), map);
    }
    return map;
}

// The inputs that make_surface and gather_material give for a hit, for the candidate.
GpuSurfaceMaterial candidate_material(uint triangle, vec2 uv, float t, out PatternPoint p) {
    const vec3 world_o = ConstVec4s(walk.ray).v[0].xyz;
    p.view = ConstVec4s(walk.ray).v[1].xyz;
    p.position = world_o + t * p.view;
    p.cone = ray_cone(walk.path, t);
    Meshes meshes = Meshes(FRAME.meshes);
    const uint flags = meshes.v[walk.mesh].flags;
    const vec3 weights = vec3(1.0 - uv.x - uv.y, uv);
    vec3 v0, v1, v2;
    posed_item(walk.pose, triangle, v0, v1, v2);
    vec3 local, normal;
    if (HAS_LEAF_KINDS && walk.other) {
        local = walk.o + t * walk.d;
        leaf_point(walk_kind, v0, v1, v2, uv, local, normal);
    } else {
        local = fma(v0, vec3(weights.x), fma(v1, vec3(weights.y), v2 * weights.z));
        vec3 size;
        const vec3 winding = normal_or(triangle_normal(v0, v1, v2, size), vec3(0.0, 0.0, 1.0));
        normal = (flags & MESH_LEFT_HANDED) != 0u ? -winding : winding;
    }
    const ChunkMap world = chunk_map(walk.chunk_instance);
    const Affine map = candidate_map();
    const vec3 covector = combine_rows(world.x, world.y, world.z, apply_transposed(map, normal));
    const vec3 geometric = normal_or(covector, vec3(0.0, 0.0, 1.0));
    p.normal = geometric;
    if (HAS_NORMALS && (flags & MESH_HAS_NORMALS) != 0u) {
        const vec3 n = posed_normal(walk.pose, walk.mesh, triangle, weights);
        p.normal = normal_or(combine_rows(world.x, world.y, world.z, apply_transposed(map, n)), geometric);
        normal = normal_or(n, normal);
    }
    const int prim_id = Instances(walk.instances).v[chain[level_index()]].prim_id;
    const uint slot = material_slot(prim_id, item_subset(walk.pose, triangle));
    GpuSurfaceMaterial m = gather_material(walk.mesh, triangle, weights, slot, local, normal);
    vec3 e, f;
    item_edges(walk.pose, walk.mesh, triangle, e, f);
    add_tangent(m, walk.mesh, triangle, e, f, geometric, p.view, world, map);
    add_object_frame(m, world, map);
    return m;
}

// Returns true if the program makes the surface opaque: its opacity is above `limit` or, unless `chance`, equal to it.
// `id` as in is_cut_in. Requests an absent tile.
bool is_cut_in_by_program(Presence presence, uint triangle, vec2 uv, float t, uint id, bool chance, float limit) {
    PatternPoint point;
    const GpuSurfaceMaterial m = candidate_material(triangle, uv, t, point);
    cutout_made = 0u;
    cutout_known = 0u;
    cutout_wait.unit = OWN_UNIT;
    if (HAS_STREAMING && is_same(answer_item, visited_item()) && t == answer.t && id == answer.id) {
        const uint asked = (answer.flags >> ALPHA_TEST_LOOKUP_SHIFT) & 3u;
        const uint64_t kept = deferred_values_address(ALPHA_TESTS, walk.path);
        for (uint i = 0u; i < asked; ++i) cutout_values[i] = ConstVec4s(kept).v[i];
        cutout_values[asked] = answer.mean;
        cutout_known = asked + 1u;
    }
    Materials materials = Materials(FRAME.materials);
    const uint64_t own = program_end(material_program(presence.program), materials.v[presence.program].program_sizes);
    uint missing = TEXTURE_DONE;
    run_program(own + 16ul, ConstUints(own).v[0], m, point, missing);
    if (HAS_STREAMING && cutout_wait.unit != OWN_UNIT) {
        cutout_wait.t = t;
        cutout_wait.id = id;
        if (ask(visited_item(), cutout_wait)) {
            for (uint i = 0u; i < CUTOUT_LOOKUPS - 1u; ++i) deferred_values[i] = cutout_values[i];
        }
        remember(visited_item());
        return false;
    }
    const uint to = materials.v[presence.program].inputs[INPUT_OPACITY].texture & (PROGRAM_REGISTERS - 1u);
    const float opacity = pattern_registers[to].x;
    return opacity > limit || (!chance && opacity == limit);
}

#endif
