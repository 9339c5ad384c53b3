// SPDX-License-Identifier: Apache-2.0
// Streaming only: the treatment of listed items and absent meshes in a walk (traversal/pending.glsl). A part of
// traverse.glsl: reads the walk, the pending list of its path and the tables of chunks and meshes; remembers items, and
// adds to the counts of rays by mesh.
#ifndef OOCPT_RESUME_GLSL
#define OOCPT_RESUME_GLSL

// Lists the items of a chunk instance again whose chunk was evicted: the finished ones stay finished.
void remember_again(uint chunk_instance) {
    for (uint i = 0u; i < walk.listed; ++i) {
        const Item item = listed_item(walk.path, i);
        if (item.chunk_instance == chunk_instance) remember(item);
    }
}

// Returns true if a listed chunk instance was absent when the ray reached it: none of it is done.
bool is_listed_whole(uint chunk_instance) {
    bool whole = false;
    for (uint i = 0u; i < walk.listed; ++i) {
        const Item item = listed_item(walk.path, i);
        whole = whole || (item.chunk_instance == chunk_instance && item.mesh == NO_MESH);
    }
    return whole;
}

// The item of the records of a mesh that the walk reaches. Streaming only.
Item current_item(uint mesh) {
    return Item(walk.chunk_entry, walk.chunk_instance, walk.entry, mesh);
}

// Streaming: returns true if the walk skips a record of a mesh: its item is done, or it is absent and remembered.
bool skips_mesh(uint mesh) {
    const Item item = current_item(mesh);
    if (walk.filters && !is_due(walk.path, walk.listed, walk.resumed, item)) return true;
    if (Meshes(FRAME.meshes).v[mesh].nodes == 0ul) {
        remember(item);
        return true;
    }
    if (HAS_CHUNK_COUNTS && (walk.path & (COUNTED_PATHS - 1u)) == 0u) {
        atomicAdd(Uints(STREAMING.unit_rays).v[STREAMING.chunk_count + mesh], COUNTED_PATHS);
    }
    walk.record_entry = walk.entry;
    return false;
}

bool is_chunk_there(uint chunk_instance) {
    const uint chunk = ChunkInstances(FRAME.chunk_instances).v[chunk_instance].chunk;
    return Chunks(FRAME.chunks).v[chunk].nodes != 0ul;
}

// Puts the items that a ray which has waited is to visit on the stack; returns the first reference.
uint begin_resumed(uint flags) {
    walk.listed = waiting_count(flags);
    walk.resumed = (flags & RAY_MORE) != 0u;
    Item item = listed_item(walk.path, walk.listed - 1u);
    // Everything behind the last item begins in its chunk: it waits until that one is resident again.
    if (walk.resumed && item.mesh != NO_MESH && !is_chunk_there(item.chunk_instance)) {
        walk.resumed = false;
        pending_more = true;
    }
    if (walk.resumed) push_reference(0u, 0.0);
    for (uint i = walk.listed; i > 0u; --i) {
        item = listed_item(walk.path, i - 1u);
        if (i > 1u && listed_item(walk.path, i - 2u).chunk_instance == item.chunk_instance) continue;
        push_reference(LEAF | LISTED | item.chunk_instance, item.entry);
    }
    return pop();
}

#endif
