// SPDX-License-Identifier: Apache-2.0
// Shares the walks of a pass's last rays among the threads of a subgroup (see the book, design/traversal): otherwise a
// pass would end with a few threads that walk the longest rays alone. An idle thread takes the farthest subtree of
// another's stack, with the state of its walk; the thread that owns the ray gets the hit. The closest hit does not
// depend on the order of visits, so the result is the same. A part of rays.glsl. Not while streaming, where a ray has a
// list of what it waits for; nor in subgroups of more than 32 threads.
#ifndef OOCPT_SHARING_GLSL
#define OOCPT_SHARING_GLSL

#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_KHR_shader_subgroup_shuffle : require

// The thread whose ray this one walks; itself if it helps none.
uint owner;
// Level of the entries at the bottom of the stack.
uint floor_level;

bool shares_walks() {
    return SHARES && gl_SubgroupSize <= 32u;
}

void own_walk() {
    owner = gl_SubgroupInvocationID;
    floor_level = 0u;
}

bool is_helper() {
    return owner != gl_SubgroupInvocationID;
}

// Returns true if other threads still walk parts of this thread's ray. Call with all threads of a subgroup.
bool is_helped() {
    const uint helped = subgroupOr(is_helper() ? 1u << owner : 0u);
    return (helped >> gl_SubgroupInvocationID & 1u) != 0u;
}

// Placements of the hit that another thread hands in.
uint other_chain[MAX_LEVELS];

// Takes a hit of another thread for the same ray, if it is closer than its own.
void merge(bool hit, Found other) {
    if (!hit) return;
#if ANY_HIT
    walk.hit = true;
    reference = DONE;
#else
    bool is_closer = !walk.hit || other.t < found.t;
    if (!is_closer && other.t == found.t) {
        bool differs = other.chunk_instance != found.chunk_instance;
        is_closer = other.chunk_instance < found.chunk_instance;
        for (uint i = 0u; i < MAX_LEVELS; ++i) { // below the hit's own level both have zeros
            is_closer = differs ? is_closer : other_chain[i] < found_chain[i];
            differs = differs || other_chain[i] != found_chain[i];
        }
        // A helper of the thread that walks a mesh may report first what the other had found in it until then.
        if (!differs) is_closer = other.triangle < found.triangle;
    }
    if (!is_closer) return;
    walk.hit = true;
    walk.limit = min(walk.limit, other.t * CULL_PAD);
    found = other;
    for (uint i = 0u; i < MAX_LEVELS; ++i) found_chain[i] = other_chain[i];
#endif
}

// Merges the hits of helpers that are done into the threads that own the rays. Call with all threads of a subgroup.
void hand_in() {
    uint handing = subgroupBallot(reference == DONE && is_helper()).x;
    while (handing != 0u) {
        const uint from = findLSB(handing);
        handing &= handing - 1u;
        const uint to = subgroupShuffle(owner, from);
        const bool hit = subgroupShuffle(walk.hit, from);
        const float unsure = DEFERS_CUTOUTS ? subgroupShuffle(walk.unsure, from) : MAX_FLOAT;
        Found other;
#if !ANY_HIT
        other.t = subgroupShuffle(found.t, from);
        other.uv = subgroupShuffle(found.uv, from);
        other.triangle = subgroupShuffle(found.triangle, from);
        other.chunk_instance = subgroupShuffle(found.chunk_instance, from);
        for (uint i = 0u; i < MAX_LEVELS; ++i) other_chain[i] = subgroupShuffle(found_chain[i], from);
#endif
        if (gl_SubgroupInvocationID == to) {
            if (DEFERS_CUTOUTS) merge_unsure(unsure);
            merge(hit, other);
        }
        if (gl_SubgroupInvocationID == from) {
            end_walk();
            own_walk();
        }
    }
#if ANY_HIT
    if (subgroupShuffle(walk.hit, owner) && is_helper()) reference = DONE;
#else
    walk.limit = min(walk.limit, subgroupShuffle(walk.limit, owner));
#endif
}

// Returns true if there is a subtree to give away, at the bottom of the stack.
bool can_give() {
    if (reference == DONE) return false;
    // Of a level that is given away, only the reference back to it is left.
    while (floor_level < walk.level && stack_floor + 1u < stack_top && bottom_reference() == RETURN) {
        drop_bottom();
        ++floor_level;
    }
    return stack_floor + 1u < stack_top && bottom_reference() != RETURN;
}

uint64_t shuffled(uint64_t value, uint from) {
    return packUint2x32(subgroupShuffle(unpackUint2x32(value), from));
}

// Lets idle threads take subtrees of others. `idle`: this thread has no work. Call with all threads of a subgroup.
void share_walks(bool idle) {
    const bool gives = can_give();
    const uvec4 givers = subgroupBallot(gives);
    const uvec4 takers = subgroupBallot(idle);
    const uint pairs = min(subgroupBallotBitCount(givers), subgroupBallotBitCount(takers));
    if (pairs == 0u) return;
    const uint taker = subgroupBallotExclusiveBitCount(takers);
    const bool takes = idle && taker < pairs;
    uint from = gl_SubgroupInvocationID;
    if (takes) {
        uint left = givers.x;
        for (uint i = 0u; i < taker; ++i) left &= left - 1u;
        from = findLSB(left);
    }
    const uint begin = subgroupShuffle(gives ? bottom_reference() : DONE, from);
    const float entry = subgroupShuffle(gives ? bottom_entry() : 0.0, from);
    if (gives && subgroupBallotExclusiveBitCount(givers) < pairs) drop_bottom();

    const uint of = subgroupShuffle(owner, from);
    const uint level = subgroupShuffle(floor_level, from);
    const uint64_t ray = shuffled(walk.ray, from);
    const uint path = subgroupShuffle(walk.path, from);
    const uint seed = subgroupShuffle(walk.seed, from);
    const float time = HAS_TIME ? subgroupShuffle(walk.time, from) : 0.0;
    const uint chunk_instance = subgroupShuffle(walk.chunk_instance, from);
    const float limit = subgroupShuffle(walk.limit, from);
#if ANY_HIT
    const uint shadow_link = subgroupShuffle(walk.shadow_link, from);
#else
    const bool hit = subgroupShuffle(walk.hit, from);
    const uint passing = HAS_PRIM_MASKS ? subgroupShuffle(walk.passing, from) : 0u;
#endif
    Found other;
    other.t = subgroupShuffle(found.t, from);
    other.uv = subgroupShuffle(found.uv, from);
    other.triangle = subgroupShuffle(found.triangle, from);
    other.chunk_instance = subgroupShuffle(found.chunk_instance, from);
    for (uint i = 0u; i < MAX_LEVELS; ++i) {
        const uint record = subgroupShuffle(chain[i], from);
        const uint found_record = subgroupShuffle(found_chain[i], from);
        const vec3 o = subgroupShuffle(level_o[i], from);
        const vec3 d = subgroupShuffle(level_d[i], from);
        const uint64_t nodes = shuffled(level_nodes[i], from);
        const uint64_t instances = shuffled(level_instances[i], from);
        if (takes) {
            chain[i] = record;
            found_chain[i] = found_record;
            level_o[i] = o;
            level_d[i] = d;
            level_nodes[i] = nodes;
            level_instances[i] = instances;
        }
    }
    if (!takes) return;
    owner = of;
    floor_level = level;
    found = other;
    walk.ray = ray;
    walk.path = path;
    walk.seed = seed;
    if (HAS_TIME) walk.time = time;
    walk.chunk_instance = chunk_instance;
    walk.limit = limit;
#if ANY_HIT
    walk.shadow_link = shadow_link;
    walk.hit = false;
#else
    walk.hit = hit;
    if (HAS_PRIM_MASKS) walk.passing = passing;
#endif
    walk.hit_before = false;
    walk.entry = entry;
    walk.level = level;
    begin_unsure();
    if (ASKS_CUTOUTS) candidate.end = 0u;
    clear_stack();
    come_back();
    reference = entry > limit ? DONE : begin;
}

#endif
