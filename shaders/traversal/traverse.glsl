// SPDX-License-Identifier: Apache-2.0
// Walk of a ray through the top level, chunks, nested assemblies and meshes: one stack, near child first.
// traversal/rays.glsl has the loop.
//
// Before including, define ANY_HIT as 1 to stop at the first hit, else 0; and SETTLES as 1 to look up the cutouts that
// DEFERRED_CUTOUTS skips because no mask decides them. A surface of opacity a is met with probability a, decided by a
// hash of seed, instances and triangle; for AOVs (PUSH_AOVS) it is met if a > 0. begin_walk(), then descend() and
// visit() until `reference` is DONE, then end_walk(): `found` is the closest hit nearer than t_max if walk.hit; at
// equal distance the hit with the lower (chunk instance, records, triangle) wins, so the result does not depend on the
// order of the walk. Reads the scene, writes nothing but a counter of rays that ran out of stack or levels.
//
// Frames: the top level is walked with the high part of the world origin, boxes padded for the low part; a chunk is
// entered with both parts (math/double.glsl), and all below it with single floats. Distances are in units of the world
// direction throughout. The world ray is read from memory when a walk comes back to the top level, because registers
// cost more.
//
// Distance of a hit: that of the triangle test, but not before the ray has entered every box above it, up to CULL_PAD.
// The two differ by rounding only; the rule makes "closest" the minimum of a number that does not depend on what was
// visited before, since a box is skipped only if everything in it is farther.
#ifndef OOCPT_TRAVERSE_GLSL
#define OOCPT_TRAVERSE_GLSL

#include "math/affine.glsl"
#include "geometry/attribute.glsl"
#include "light/links.glsl"
#include "geometry/prim_masks.glsl"
#include "geometry/motion.glsl"
#include "geometry/pose.glsl"
#include "math/sampler.glsl"
#include "traversal/box.glsl"
#include "traversal/node.glsl"
#include "traversal/stack.glsl"
#include "geometry/triangle.glsl"
#include "geometry/leaf.glsl"
#include "traversal/pending.glsl"
#include "traversal/presence.glsl"

struct Found {
    float t;
    vec2 uv;
    uint triangle;
    uint chunk_instance;
};

// State of the walk: the ray in the frame of the current level or mesh, and the arrays there.
struct Walk {
    vec3 o;
    vec3 d;
    vec3 reciprocal;
    float pad;   // of boxes; 0 between the top level and meshes
    float entry; // where the boxes above the current node are entered, the farthest; for any hit only with streaming
    float limit; // boxes entered behind this hold no closer hit; any hit: t_max
    uint64_t nodes;
    uint64_t instances;
    Pose pose;    // the triangles of the mesh
    uint64_t ray; // address of the world ray
    uint path;
    uint level;   // 0: top level; else trees of instance records from the chunk's down to the current one
    uint chunk_instance;
    uint mesh;
    uint seed;
    float time; // of the path; with HAS_TIME only
    uint shadow_link; // any hit: category of the prims that count; 0: all
    uint passing; // closest hit, with PRIM_MASKS: the bit of the prims that the ray passes
    uint visits;  // of resident chunks; streaming only
    float chunk_entry;  // where the chunk was entered, as its parent said; streaming only, as the next two
    float record_entry; // where the record of the mesh was
    uint listed;   // items of the list that the ray came back with
    bool filters;  // of the chunk, some items are listed: the others are done
    bool in_mesh;
    bool other; // the mesh's items are no triangles, but of walk_kind
    bool resumed; // everything behind the last item of the list is to be visited
    bool hit_before;
    bool hit;
    // Distances of the nearest candidate that no mask decides, and of the next one; with DEFERS_CUTOUTS only.
    float unsure;
    float next_unsure;
};

// True if the last walks of a pass are shared by threads (sharing.glsl). Any hit through one level of instances is
// found in few visits: helpers gain nothing there, and the pass with their code is slower (see the book,
// design/traversal).
#if ANY_HIT
const bool SHARES = !HAS_STREAMING && MAX_LEVELS > 1u;
#else
const bool SHARES = !HAS_STREAMING;
#endif

Walk walk;
uint walk_kind; // with HAS_LEAF_KINDS only
Found found;
uint reference; // what the walk comes to next
uint chain[MAX_LEVELS];       // instance records from the chunk to here
#define INSTANCE_CHUNK walk.chunk_instance
#define INSTANCE_CHAIN chain
#include "geometry/instance_primvars.glsl"
uint found_chain[MAX_LEVELS]; // those of the closest hit
// Rays and arrays of the levels from the chunk's down, for the way back.
vec3 level_o[MAX_LEVELS];
vec3 level_d[MAX_LEVELS];
uint64_t level_nodes[MAX_LEVELS];
uint64_t level_instances[MAX_LEVELS];

// Index of the current level, below the top level, in the arrays above.
uint level_index() {
    return MAX_LEVELS == 1u ? 0u : walk.level - 1u;
}

// Returns true if the candidate (chain, triangle) comes before the closest hit in the order of ids.
bool precedes(uint triangle) {
    if (walk.chunk_instance != found.chunk_instance) return walk.chunk_instance < found.chunk_instance;
    for (uint i = 0u; i <= level_index(); ++i) {
        if (chain[i] != found_chain[i]) return chain[i] < found_chain[i];
    }
    return triangle < found.triangle;
}

// Returns true if the candidate is closer than the closest hit so far.
bool is_closest(float t, uint triangle) {
    const bool has_hit = walk.hit || (HAS_STREAMING && walk.hit_before);
    return t < found.t || (has_hit && t == found.t && precedes(triangle));
}

#include "traversal/opacity.glsl"

// The candidate that the walk waits at while `reference` is ASK: it is nearer than the closest hit, and its cutout has
// to be looked up. `end`: of its leaf's items.
struct Candidate {
    float t;
    vec2 uv;
    uint triangle;
    uint end;
};

Candidate candidate;

uint pop() {
    return pop_reference(walk.limit, walk.entry);
}

// Descends from a node to the nearest child that is hit; the others go to the stack, for the closest hit the farthest
// first.
uint descend(uint at) {
    const Node node = load_node(walk.nodes, at, walk.in_mesh, walk.o, walk.reciprocal, walk.pad);
    uvec4 children = node.children;
    if (HAS_POINTS && walk.in_mesh && walk_kind == LEAF_POINT) {
        children = bundle_members(children, Meshes(FRAME.meshes).v[walk.mesh].triangle_count);
    }
    vec4 entries;
    for (uint i = 0u; i < 4u; ++i) entries[i] = hit_child(node, i, walk.limit);
    sort_pair(entries, children, 0u, 1u);
    sort_pair(entries, children, 2u, 3u);
    sort_pair(entries, children, 0u, 2u);
#if !ANY_HIT
    sort_pair(entries, children, 1u, 3u);
    sort_pair(entries, children, 1u, 2u);
#endif
    if (!(entries.x < MISSED)) return pop();
    if (entries.w < MISSED) push_reference(children.w, max(entries.w, walk.entry));
    if (entries.z < MISSED) push_reference(children.z, max(entries.z, walk.entry));
    if (entries.y < MISSED) push_reference(children.y, max(entries.y, walk.entry));
    walk.entry = max(entries.x, walk.entry);
    return children.x;
}

void accept(uint triangle, vec2 uv, float t) {
    walk.hit = true;
    found = Found(t, uv, triangle, walk.chunk_instance);
#if !ANY_HIT
    walk.limit = t * CULL_PAD;
    for (uint i = 0u; i <= level_index(); ++i) found_chain[i] = chain[i];
    if (SHARES) {
        for (uint i = level_index() + 1u; i < MAX_LEVELS; ++i) found_chain[i] = 0u;
    }
#endif
}

#include "traversal/deferral.glsl"
#include "traversal/masked_presence.glsl"
#include "traversal/items.glsl"

// Makes (o, d) the ray of the walk, and saves it and the arrays for the way back.
void begin_level(vec3 o, vec3 d, uint64_t nodes, uint64_t instances) {
    ++walk.level;
    walk.o = o;
    walk.d = d;
    walk.reciprocal = safe_reciprocal(d);
    walk.nodes = nodes;
    walk.instances = instances;
    const uint at = level_index();
    level_o[at] = o;
    level_d[at] = d;
    level_nodes[at] = nodes;
    level_instances[at] = instances;
}

#include "traversal/resume.glsl"

// Enters a chunk from the top level; returns its root, or the next reference if it is absent or done or the stack is
// full.
uint enter_chunk(uint reference) {
    const uint chunk_instance = reference & 0x0fffffffu;
    const uint chunk = ChunkInstances(FRAME.chunk_instances).v[chunk_instance].chunk;
    const uint64_t nodes = Chunks(FRAME.chunks).v[chunk].nodes;
    if (HAS_STREAMING) {
        const bool listed = (reference & LISTED) != 0u;
        if (walk.resumed && !listed && in_list_before(walk.path, walk.listed, walk.entry, chunk_instance)) return pop();
        if (nodes == 0ul) {
            if (listed) {
                remember_again(chunk_instance);
            } else {
                remember(chunk_item(walk.entry, chunk_instance));
            }
            return pop();
        }
        ++walk.visits;
        walk.chunk_entry = walk.entry;
        walk.filters = listed && !is_listed_whole(chunk_instance);
        if (HAS_CHUNK_COUNTS) atomicAdd(Uints(STREAMING.unit_rays).v[chunk], 1u);
    }
    if (stack_top >= STACK_SIZE) {
        stack_overflow = true;
        return pop();
    }
    push_reference(RETURN, 0.0);
    walk.chunk_instance = chunk_instance;
    walk.pad = 0.0;
    const ChunkMap map = chunk_map(chunk_instance);
    const vec3 o_lo = ConstVec4s(walk.ray).v[2].xyz;
    const vec3 from = difference(Double3(walk.o, o_lo), map.origin);
    begin_level(apply_rows(map.x, map.y, map.z, from), apply_rows(map.x, map.y, map.z, walk.d), nodes,
                Chunks(FRAME.chunks).v[chunk].instances);
    return 0u;
}

// Enters the target of an instance record; returns its root, or the next reference if the stack is full.
uint enter(uint record) {
    const uint target = Instances(walk.instances).v[record].target;
    const bool nested = HAS_NESTING && (target & TARGET_ASSEMBLY) != 0u;
    const uint mesh = HAS_MOTION ? target & TARGET_NUMBER : target;
#if ANY_HIT
    if (HAS_LIGHT_LINKS && !nested && walk.shadow_link != 0u) {
        if (!is_linked(walk.shadow_link, prim_link_set(Instances(walk.instances).v[record].prim_id))) return pop();
    }
    const uint passing = PRIM_NO_SHADOW;
#else
    const uint passing = walk.passing;
#endif
    if (HAS_PRIM_MASKS && !nested && (prim_mask(Instances(walk.instances).v[record].prim_id) & passing) != 0u) {
        return pop();
    }
    if (HAS_STREAMING && !nested && skips_mesh(mesh)) return pop();
    const Affine map = placed_map(walk.instances, record, target, walk.time);
    if (stack_top >= STACK_SIZE || (nested && walk.level >= MAX_LEVELS)) {
        stack_overflow = true;
        return pop();
    }
    push_reference(RETURN, 0.0);
    chain[level_index()] = record;
    const vec3 o = apply_point(map, walk.o);
    const vec3 d = apply_vector(map, walk.d);
    if (nested) {
        begin_level(o, d, Assemblies(FRAME.assemblies).v[target & TARGET_NUMBER].nodes,
                    Assemblies(FRAME.assemblies).v[target & TARGET_NUMBER].instances);
    } else {
        walk.o = o;
        walk.d = d;
        walk.reciprocal = safe_reciprocal(d);
        walk.in_mesh = true;
        walk.mesh = mesh;
        walk.nodes = Meshes(FRAME.meshes).v[mesh].nodes;
        walk.pad = MESH_PAD * (largest_of(o) + Meshes(FRAME.meshes).v[mesh].reach);
        walk.pose = pose_of(mesh, walk.time);
        walk.other = HAS_LEAF_KINDS && (walk_kind = leaf_kind(Meshes(FRAME.meshes).v[mesh].flags)) != LEAF_TRIANGLE;
    }
    return 0u;
}

// Makes the world ray the ray of the walk, at the top level.
void begin_top() {
    walk.o = ConstVec4s(walk.ray).v[0].xyz;
    walk.d = ConstVec4s(walk.ray).v[1].xyz;
    walk.reciprocal = safe_reciprocal(walk.d);
    walk.pad = TOP_PAD * largest_of(walk.o);
    walk.nodes = FRAME.top_nodes;
}

// Returns to the nodes of `walk.level`, which was entered before.
void come_back() {
    walk.in_mesh = false;
    walk.pad = 0.0;
    if (walk.level == 0u) {
        begin_top();
        return;
    }
    const uint at = level_index();
    walk.o = level_o[at];
    walk.d = level_d[at];
    walk.reciprocal = safe_reciprocal(walk.d);
    walk.nodes = level_nodes[at];
    walk.instances = level_instances[at];
}

// Leaves a mesh for the level that it was entered from, or an assembly or a chunk for the level above.
void leave() {
    if (!walk.in_mesh) --walk.level;
    come_back();
}

// Visits a reference that is not an inner node: enters, leaves or tests it.
uint visit(uint at) {
    const uint first = at & 0x0fffffffu;
    if (at == RETURN) {
        leave();
    } else if (!walk.in_mesh) {
        return walk.level == 0u ? enter_chunk(at) : enter(first);
    } else if (visit_triangles(first, first + ((at >> 28) & 7u) + 1u)) {
        return ASKS_CUTOUTS && candidate.end != 0u ? ASK : DONE;
    }
    return pop();
}

// Replaces a walk: nothing was met, nothing is waited for.
void no_walk(uint path) {
    walk.path = path;
    walk.hit_before = false;
    walk.hit = false;
    begin_unsure();
    walk.visits = 0u;
    pending_count = 0u;
    stack_overflow = false;
    reference = DONE;
}

// Begins with the ray at `ray` (Ray or ShadowRay) in world space. With streaming, a ray that has waited goes on:
// `found` and `found_chain` are its hit so far if its flags say so, else they are cleared.
void begin_walk(uint64_t ray, uint path, float t_max, uint seed, uint flags) {
    walk.hit_before = HAS_STREAMING && (flags & RAY_HIT) != 0u;
    if (!walk.hit_before) found = Found(t_max, vec2(0.0), 0u, 0u);
    walk.ray = ray;
    walk.path = path;
    walk.entry = 0.0;
    walk.limit = walk.hit_before ? found.t * CULL_PAD : t_max;
    walk.level = 0u;
    walk.chunk_instance = 0u;
    walk.seed = seed;
    if (HAS_TIME) walk.time = path_time(path);
    walk.visits = 0u;
    walk.in_mesh = false;
    walk.other = false;
    walk.resumed = false;
    walk.hit = false;
    begin_unsure();
    if (ASKS_CUTOUTS) candidate.end = 0u;
    begin_top();
    clear_stack();
    reference = 0u;
    if (HAS_STREAMING) {
        pending_count = 0u;
        pending_more = false;
        if (HAS_CUTOUTS) {
            deferred_test.unit = OWN_UNIT;
            answer_item = chunk_item(0.0, 0xffffffffu);
            if ((flags & RAY_ASKED) != 0u) {
                answer = DeferredAlphaTests(ALPHA_TESTS).v[path];
                answer_item = listed_item(path, 0u);
            }
        }
        walk.listed = 0u;
        walk.filters = false;
        if ((flags & RAY_WAITED) != 0u) reference = begin_resumed(flags);
    }
}

void end_walk() {
    if (HAS_STREAMING) forget_behind(walk.limit);
    if (stack_overflow) atomicAdd(COUNTERS.stack_overflows, 1u);
}

#endif
