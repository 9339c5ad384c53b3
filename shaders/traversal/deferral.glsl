// SPDX-License-Identifier: Apache-2.0
// Candidates that no mask decides (decisions/0058): a walk goes on as if they were not there, and keeps the nearest
// one. If no other one may be the hit, settle_closest or settle_shadow looks that one up, without a walk; else they
// walk the ray again. A part of traverse.glsl; only with DEFERRED_CUTOUTS.
#ifndef OOCPT_DEFERRAL_GLSL
#define OOCPT_DEFERRAL_GLSL

#include "traversal/hit.glsl"

// Flag in FrameConstants::settle_queue above the number of a path: its candidate is in FrameConstants::settle_hits, and
// the closest certain hit is in FrameConstants::hits.
const uint SETTLE_KEPT = 1u << 31;
const uint SETTLE_HIT = 1u << 30;
const uint SETTLE_PATH = SETTLE_HIT - 1u;

void begin_unsure() {
    if (!DEFERS_CUTOUTS) return;
    walk.unsure = MAX_FLOAT;
    walk.next_unsure = MAX_FLOAT;
}

// Keeps the current candidate, which no mask decides.
void keep_candidate(uint triangle, vec2 uv, float t) {
    walk.next_unsure = min(walk.next_unsure, max(walk.unsure, t));
    if (!(t < walk.unsure)) return;
    walk.unsure = t;
    keep_word(0u, triangle);
    keep_word(1u, floatBitsToUint(uv.x));
    keep_word(2u, floatBitsToUint(uv.y));
    keep_word(3u, walk.chunk_instance);
    for (uint i = 0u; i < MAX_LEVELS; ++i) keep_word(4u + i, i <= level_index() ? chain[i] : 0u);
}

// Another thread has met a candidate that no mask decides: it is not kept, so the ray has to be walked again.
void merge_unsure(float t) {
    if (t == MAX_FLOAT) return;
    walk.next_unsure = min(walk.next_unsure, max(walk.unsure, t));
    if (t <= walk.unsure) {
        walk.unsure = t;
        walk.next_unsure = t;
    }
}

// Pushes the path of a walk that has ended, if `unsure`, to queue `of` of those to settle. `limit`: candidates behind
// it do not matter. Call with as many threads active as possible.
#define PUSH_UNSURE(of, unsure, limit)                                                                                 \
    do {                                                                                                               \
        uint to;                                                                                                       \
        QUEUE_SLOT(to, settle_count[of], unsure);                                                                      \
        if (unsure) store_unsure(of, to, limit);                                                                       \
    } while (false)

void store_unsure(uint of, uint to, float limit) {
    const uint records = uint(FRAME.settle_hits[1] - FRAME.settle_hits[0]) / (HIT_STRIDE * 16u);
    const bool keeps = walk.next_unsure > limit && to < records;
    if (keeps) {
        const vec2 uv = uintBitsToFloat(uvec2(kept_word(1u), kept_word(2u)));
        uvec3 first = uvec3(kept_word(4u), 0u, 0u);
        if (MAX_LEVELS > 1u) first.y = kept_word(5u);
        if (MAX_LEVELS > 2u) first.z = kept_word(6u);
        store_hit_header(FRAME.settle_hits[of], to, HitHeader(uv, kept_word(0u), kept_word(3u), walk.unsure), first);
        for (uint i = 3u; i < MAX_LEVELS; ++i) store_hit_level(FRAME.settle_hits[of], to, i, kept_word(4u + i));
    }
    const uint flags = (keeps ? SETTLE_KEPT : 0u) | (keeps && walk.hit ? SETTLE_HIT : 0u);
    Uints(FRAME.settle_queue[of]).v[to] = walk.path | flags;
}

uint enter_chunk(uint reference);
uint enter(uint record);

// After begin_walk(): sets the walk to the candidate that entry `at` of queue `of` depends on.
void stand_at_kept(uint of, uint at) {
    const HitHeader kept = load_hit_header(FRAME.settle_hits[of], at);
    enter_chunk(LEAF | kept.chunk_instance);
    for (uint i = 0u; i < MAX_LEVELS && !walk.in_mesh; ++i) enter(load_hit_level(FRAME.settle_hits[of], at, i));
    candidate = Candidate(kept.t, kept.uv, kept.triangle, kept.triangle + 1u);
    reference = ASK;
}

#endif
