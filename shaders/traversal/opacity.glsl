// SPDX-License-Identifier: Apache-2.0
// Decides whether a surface that a walk meets is there: by displayOpacity, or by its material's cutouts and presence. A
// part of traverse.glsl: reads the walk (`walk`, `chain`) and the scene; with streaming, requests absent tiles.
#ifndef OOCPT_OPACITY_GLSL
#define OOCPT_OPACITY_GLSL

// The item that the walk is in, in a mesh.
Item visited_item() {
    return Item(walk.chunk_entry, walk.chunk_instance, walk.record_entry, walk.mesh);
}

#include "traversal/cutout_program.glsl"

// Items that are not triangles are closed: a ray that passes their first surface meets the second one, whose opacity is
// tested by itself. Without opacity and cutouts none of it is compiled in.

// The number of a surface of an item, of whose opacity a hash decides. All pieces of a curve have the same: where they
// overlap at a joint, a ray meets one surface and not two.
uint surface_number(uint triangle, bool is_second) {
    uint number = triangle;
    if (HAS_ROUND && walk.other && walk_kind == LEAF_ROUND) {
        number = floatBitsToUint(ConstVec4s(walk.pose.triangles).v[triangle * 3u].w);
    }
    return HAS_LEAF_KINDS && is_second ? number | SECOND_SURFACE : number;
}

// A number from 0 up to but not 1 that decides whether this ray meets a surface; the same for every chunk, tile and
// order of the walk.
float opacity_number(uint triangle, bool is_second) {
    uint above = walk.chunk_instance;
    for (uint i = 0u; i <= level_index(); ++i) above = hash_combine(above, chain[i]);
    const uint number = hash_combine(above, surface_number(triangle, is_second));
    return float(hash_u32(hash_combine(walk.seed, number)) >> 8) * 5.9604644775390625e-8;
}

// Returns true if this ray meets a surface of which `coverage` parts of 255 are there. Rays of AOVs have no random
// numbers: by chance, they meet every surface with any coverage; by a threshold, one with at least half.
bool is_covered(uint coverage, bool is_chance, uint triangle, bool is_second) {
    if (coverage == 0u || coverage >= 255u) return coverage != 0u;
    if ((push.flags & PUSH_AOVS) != 0u) return is_chance || coverage >= 128u;
    return opacity_number(triangle, is_second) * 255.0 < float(coverage);
}

// Finds the second surface of an item whose first one, at distance `first`, is not there. It is never before the first
// one, so it is as far behind the entries of boxes.
bool meets_second(uint triangle, float first, out float t, out vec2 uv) {
    vec3 v0, v1, v2;
    posed_item(walk.pose, triangle, v0, v1, v2);
    if (!leaf_exit(walk_kind, v0, v1, v2, walk.o, walk.d, t, uv)) return false;
    t = max(t, first);
#if ANY_HIT
    return t < walk.limit;
#else
    return is_closest(t, triangle);
#endif
}

// Returns true if the surface is there for this ray.
bool is_opaque(uint triangle, vec2 uv, bool is_second) {
    Meshes meshes = Meshes(FRAME.meshes);
    const uint flags = meshes.v[walk.mesh].flags;
    const bool of_mesh = (flags & MESH_HAS_OPACITIES) != 0u;
    if (!of_mesh && !HAS_INSTANCE_OPACITY) return true;
    if (HAS_MATERIALS) {
        // displayOpacity applies to surfaces without a material.
        const uint subset = item_subset(walk.pose, triangle);
        if (material_slot(Instances(walk.instances).v[chain[level_index()]].prim_id, subset) != NO_MATERIAL) {
            return true;
        }
    }
    float opacity;
    if (of_mesh) {
        opacity = attribute_float(meshes.v[walk.mesh].opacities, meshes.v[walk.mesh].corner_indices, (flags >> 4) & 3u,
                                  triangle, vec3(1.0 - uv.x - uv.y, uv));
    } else {
        vec4 value;
        if (!instance_primvar(NAME_DISPLAY_OPACITY, value)) return true;
        opacity = value.x;
    }
    if ((push.flags & PUSH_AOVS) != 0u) return opacity > 0.0;
    uint h = hash_combine(walk.seed, walk.chunk_instance);
    for (uint i = 0u; i <= level_index(); ++i) h = hash_combine(h, chain[i]);
    const uint number = surface_number(triangle, is_second);
    return float(hash_u32(hash_combine(h, number)) >> 8) * 5.9604644775390625e-8 < opacity;
}

// Returns true if the material makes the surface opaque for this ray. With streaming, if a tile of its texture is
// absent, the ray skips the surface, requests the tile, and puts the item on the list of pending ones. Of such an item
// only the nearest undecided cutout becomes a deferred test; resolve_cutouts answers it, without the chunk and the
// mesh; the ray comes back with the answer when these are resident. All nearer ones of the item are not there, or the
// ray would have met them. So each tile or unit that is loaded, by itself, is progress for the ray.
bool is_cut_in(uint triangle, vec2 uv, float t, bool is_second) {
    uint above = walk.chunk_instance;
    for (uint i = 0u; i <= level_index(); ++i) above = hash_combine(above, chain[i]);
    const uint id = hash_combine(above, HAS_LEAF_KINDS && is_second ? triangle | SECOND_SURFACE : triangle);
    if (HAS_STREAMING && is_same(answer_item, visited_item())) {
        if (key_before(t, id, answer.t, answer.id)) return false;
        if (t == answer.t && id == answer.id && (answer.flags & ALPHA_TEST_OF_PROGRAM) == 0u) {
            return (answer.flags & ALPHA_TEST_PRESENT) != 0u;
        }
    }
    const Presence presence = presence_of(walk.pose, walk.mesh,
                                          Instances(walk.instances).v[chain[level_index()]].prim_id, triangle, uv,
                                          ray_cone(walk.path, t), walk.d);
    if (!presence.is_asked) return true;
    const bool chance = presence.threshold <= 0.0;
    if (HAS_OPACITY_MASKS && presence.coverage != COVERAGE_UNKNOWN) {
        return is_covered(presence.coverage, chance, triangle, is_second);
    }
    float limit = presence.threshold;
    if (chance) limit = (push.flags & PUSH_AOVS) != 0u ? 0.0 : opacity_number(triangle, is_second);
    if (HAS_CUTOUT_PROGRAMS && presence.program != NO_MATERIAL) {
        return is_cut_in_by_program(presence, triangle, uv, t, id, chance, limit);
    }
    TextureProgress progress = TextureProgress(HAS_STREAMING ? vec4(0.0) : UNKNOWN_TEXEL, 0u);
    uint status = TEXTURE_FALLBACK;
    if (presence.texture == NO_TEXTURE) {
        progress.mean = vec4(presence.bias);
    } else if (HAS_STREAMING) {
        status = continue_lookup(presence.texture, presence.st, presence.width, progress);
    } else {
        status = requested_lookup(walk.path, presence.texture, presence.st, presence.width, progress);
    }
    const uint flags = presence.channel << ALPHA_TEST_CHANNEL_SHIFT | (chance ? 0u : ALPHA_TEST_INCLUSIVE);
    if (HAS_STREAMING && status < TEXTURE_FALLBACK) {
        ask(visited_item(), DeferredAlphaTest(t, id, walk.chunk_instance, flags | progress.taps, progress.mean,
                                                presence.texture, presence.st, presence.width, presence.scale,
                                                presence.bias, limit, STREAMING.first_tile + status));
        remember(visited_item());
        return false;
    }
    return is_there(progress.mean, status, presence.scale, presence.bias, flags, limit);
}

#endif
