// SPDX-License-Identifier: Apache-2.0
// Streaming only: the items that a ray has reached and could not visit. An item is a chunk instance whose chunk is
// absent (mesh = NO_MESH), or, in one whose chunk is resident, all records of one mesh that the ray enters at one
// distance: the mesh is absent, or a tile that decides about a cutout of it. Tables change between submissions only, so
// these records are all resident or all absent, and no path through nested levels has to be stored. The ray keeps the
// items with the smallest keys (entry distance and number of the chunk instance, entry distance of the record, mesh),
// in order, and a flag that there were others. A walk goes on to the end with everything that is resident; a ray that
// comes back visits the items of the list that are resident now, then, if there were others, everything behind the last
// one. So an item is done or not begun; visiting one twice changes nothing.
#ifndef OOCPT_PENDING_GLSL
#define OOCPT_PENDING_GLSL

#include "wavefront/progress.glsl"

struct Item {
    float entry; // of the chunk instance
    uint chunk_instance;
    float record_entry;
    uint mesh;
};

Item pending[MAX_PENDING];
uint pending_count;
bool pending_more;

bool key_before(float entry, uint number, float other_entry, uint other_number) {
    return entry < other_entry || (entry == other_entry && number < other_number);
}

bool is_same_chunk(Item a, Item b) {
    return a.entry == b.entry && a.chunk_instance == b.chunk_instance;
}

bool is_same(Item a, Item b) {
    return is_same_chunk(a, b) && a.record_entry == b.record_entry && a.mesh == b.mesh;
}

bool is_before(Item a, Item b) {
    if (is_same_chunk(a, b)) return key_before(a.record_entry, a.mesh, b.record_entry, b.mesh);
    return key_before(a.entry, a.chunk_instance, b.entry, b.chunk_instance);
}

Item chunk_item(float entry, uint chunk_instance) {
    return Item(entry, chunk_instance, 0.0, NO_MESH);
}

// Cutouts: the nearest one, in the item with the smallest key, that cannot be decided because a tile is absent (unit =
// OWN_UNIT: there is none), and the answer that the ray came back with.
DeferredAlphaTest deferred_test;
Item deferred_item;
DeferredAlphaTest answer;
Item answer_item;

// With CUTOUT_PROGRAMS: the values of the finished lookups of the deferred test's program.
vec4 deferred_values[CUTOUT_LOOKUPS - 1u];

// Stores a deferred test about an item; returns false if there is one about something before it.
bool ask(Item item, DeferredAlphaTest q) {
    if (deferred_test.unit != OWN_UNIT) {
        if (is_same(item, deferred_item)) {
            if (!key_before(q.t, q.id, deferred_test.t, deferred_test.id)) return false;
        } else if (!is_before(item, deferred_item)) {
            return false;
        }
    }
    deferred_test = q;
    deferred_item = item;
    return true;
}

#if ANY_HIT
#define PENDING_LISTS STREAMING.shadow_pending
#define ALPHA_TESTS STREAMING.shadow_alpha_tests
#else
#define PENDING_LISTS STREAMING.pending
#define ALPHA_TESTS STREAMING.alpha_tests
#endif

// Item `i` of a path's list in memory.
Item listed_item(uint path, uint i) {
    return Item(PendingLists(PENDING_LISTS).v[path].entry[i], PendingLists(PENDING_LISTS).v[path].chunk_instance[i],
                PendingLists(PENDING_LISTS).v[path].record_entry[i], PendingLists(PENDING_LISTS).v[path].mesh[i]);
}

// The address of the values of the finished lookups of a path's deferred test: behind all deferred tests.
uint64_t deferred_values_address(uint64_t alpha_tests, uint path) {
    const uint64_t at = uint64_t(STREAMING.slots) * 64ul + uint64_t(path) * uint64_t(16u * (CUTOUT_LOOKUPS - 1u));
    return alpha_tests + at;
}

void remember(Item item) {
#ifdef OOCPT_FAULTS
    if (FAULT == FAULT_ALL || (FAULT != 0u && item.chunk_instance % FAULT_ONE_IN == FAULT - 1u)) return;
#endif
    uint at = pending_count;
    while (at > 0u && !is_before(pending[at - 1u], item)) --at;
    if (at < pending_count && is_same(pending[at], item)) return;
    if (pending_count < MAX_PENDING) {
        ++pending_count;
    } else {
        pending_more = true;
    }
    for (uint i = pending_count - 1u; i > at; --i) pending[i] = pending[i - 1u];
    if (at < MAX_PENDING) pending[at] = item;
}

// Drops the items that are entered behind `limit`. If other items may begin before it, the last one stays, because it
// marks their beginning.
void forget_behind(float limit) {
    if (pending_count == 0u || pending[pending_count - 1u].entry > limit) pending_more = false;
    uint kept = 0u;
    for (uint i = 0u; i < pending_count; ++i) {
        const bool is_behind = max(pending[i].entry, pending[i].record_entry) > limit;
        if (is_behind && !(pending_more && i + 1u == pending_count)) continue;
        pending[kept] = pending[i];
        ++kept;
    }
    pending_count = kept;
}

// Returns true if the deferred test is about the first item of the list: then it is kept.
bool keeps_alpha_test() {
    return HAS_CUTOUTS && deferred_test.unit != OWN_UNIT && is_same(deferred_item, pending[0]);
}

void store_pending(uint path) {
    if (keeps_alpha_test()) {
        DeferredAlphaTests(ALPHA_TESTS).v[path] = deferred_test;
        if (HAS_CUTOUT_PROGRAMS) {
            const uint64_t kept = deferred_values_address(ALPHA_TESTS, path);
            for (uint i = 0u; i < CUTOUT_LOOKUPS - 1u; ++i) Vec4s(kept).v[i] = deferred_values[i];
        }
    }
    for (uint i = 0u; i < pending_count; ++i) {
        PendingLists(PENDING_LISTS).v[path].entry[i] = pending[i].entry;
        PendingLists(PENDING_LISTS).v[path].chunk_instance[i] = pending[i].chunk_instance;
        PendingLists(PENDING_LISTS).v[path].record_entry[i] = pending[i].record_entry;
        PendingLists(PENDING_LISTS).v[path].mesh[i] = pending[i].mesh;
    }
}

uint pending_flags() {
    const uint waiting = pack_waiting(pending_count, pending_more);
    return waiting == 0u ? 0u : waiting | (keeps_alpha_test() ? RAY_ASKED : 0u);
}

// Returns true if a chunk instance is not behind that of the last of `count` items of the list in memory.
bool in_list_before(uint path, uint count, float entry, uint chunk_instance) {
    return !key_before(PendingLists(PENDING_LISTS).v[path].entry[count - 1u],
                       PendingLists(PENDING_LISTS).v[path].chunk_instance[count - 1u], entry, chunk_instance);
}

// Returns true if records of a chunk instance with listed items are still to be visited: those of an item that is among
// the `count` ones, and with `more` everything behind the last.
bool is_due(uint path, uint count, bool more, Item item) {
    bool due = more && is_before(listed_item(path, count - 1u), item);
    for (uint i = 0u; i < count; ++i) due = due || is_same(listed_item(path, i), item);
    return due;
}

#endif
