// SPDX-License-Identifier: Apache-2.0
// Streaming only: the absent chunk instances that a ray has come to. It keeps those
// with the smallest keys (entry distance, chunk instance), in order, and knows whether there were others. A walk goes
// on to the end with everything that is resident; a ray that comes back visits those of the list that are resident now,
// then, if there were others, everything behind the last one. So a chunk instance is done or not begun; visiting one
// twice changes nothing.
#ifndef OOCPT_PENDING_GLSL
#define OOCPT_PENDING_GLSL

#include "include/progress.glsl"

float pending_entry[MAX_PENDING];
uint pending_instance[MAX_PENDING];
uint pending_count;
bool pending_more;

bool key_before(float entry, uint instance, float other_entry, uint other_instance) {
    return entry < other_entry || (entry == other_entry && instance < other_instance);
}

// Cutouts: the nearest one, in the chunk instance with the smallest key, that cannot be answered because a tile is
// absent (unit = OWN_UNIT: there is none), and the answer that the ray came back with.
Question question;
float question_entry; // of its chunk instance
Question answer;

// With CUTOUT_PROGRAMS: what the finished lookups of the question's program gave.
vec4 question_values[CUTOUT_LOOKUPS - 1u];

// Asks, unless something before it was asked already: then false.
bool ask(float entry, Question q) {
    if (question.unit != OWN_UNIT) {
        if (q.chunk_instance == question.chunk_instance) {
            if (!key_before(q.t, q.id, question.t, question.id)) return false;
        } else if (!key_before(entry, q.chunk_instance, question_entry, question.chunk_instance)) {
            return false;
        }
    }
    question = q;
    question_entry = entry;
    return true;
}

#if ANY_HIT
#define PENDING_LISTS STREAMING.shadow_pending
#define QUESTIONS STREAMING.shadow_questions
#else
#define PENDING_LISTS STREAMING.pending
#define QUESTIONS STREAMING.questions
#endif

// Where what the finished lookups of a path's question gave is kept: behind all questions.
uint64_t question_values_address(uint64_t questions, uint path) {
    const uint64_t at = uint64_t(STREAMING.slots) * 64ul + uint64_t(path) * uint64_t(16u * (CUTOUT_LOOKUPS - 1u));
    return questions + at;
}

void remember(float entry, uint instance) {
#ifdef OOCPT_FAULTS
    if (FAULT == FAULT_ALL || (FAULT != 0u && instance % FAULT_ONE_IN == FAULT - 1u)) return;
#endif
    uint at = pending_count;
    if (at == MAX_PENDING) {
        pending_more = true;
        --at;
        if (!key_before(entry, instance, pending_entry[at], pending_instance[at])) return;
    } else {
        ++pending_count;
    }
    for (; at > 0u && key_before(entry, instance, pending_entry[at - 1u], pending_instance[at - 1u]); --at) {
        pending_entry[at] = pending_entry[at - 1u];
        pending_instance[at] = pending_instance[at - 1u];
    }
    pending_entry[at] = entry;
    pending_instance[at] = instance;
}

// Drops what is entered behind `limit`; the rest of the instances is behind all of the list.
void forget_behind(float limit) {
    while (pending_count > 0u && pending_entry[pending_count - 1u] > limit) {
        --pending_count;
        pending_more = false;
    }
}

// Whether what is asked is about the first of the list: then it is kept.
bool keeps_question() {
    return HAS_CUTOUTS && question.unit != OWN_UNIT && question.chunk_instance == pending_instance[0];
}

void store_pending(uint path) {
    if (keeps_question()) {
        Questions(QUESTIONS).v[path] = question;
        if (HAS_CUTOUT_PROGRAMS) {
            const uint64_t kept = question_values_address(QUESTIONS, path);
            for (uint i = 0u; i < CUTOUT_LOOKUPS - 1u; ++i) Vec4s(kept).v[i] = question_values[i];
        }
    }
    for (uint i = 0u; i < pending_count; ++i) {
        PendingLists(PENDING_LISTS).v[path].entry[i] = pending_entry[i];
        PendingLists(PENDING_LISTS).v[path].chunk_instance[i] = pending_instance[i];
    }
}

uint pending_flags() {
    const uint waiting = pack_waiting(pending_count, pending_more);
    return waiting == 0u ? 0u : waiting | (keeps_question() ? RAY_ASKED : 0u);
}

// Whether (entry, instance) is not behind the last key of the list in memory, which was full.
bool in_list_before(uint path, float entry, uint instance) {
    const uint last = MAX_PENDING - 1u;
    return !key_before(PendingLists(PENDING_LISTS).v[path].entry[last],
                       PendingLists(PENDING_LISTS).v[path].chunk_instance[last], entry, instance);
}

#endif
