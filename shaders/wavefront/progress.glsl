// SPDX-License-Identifier: Apache-2.0
// Streaming only: the progress of each path's rays. A path is shaded when its closest ray and the shadow ray of the
// bounce before are both finished, so that its radiance is summed in one order; whichever of the two finishes last
// pushes it.
#ifndef OOCPT_PROGRESS_GLSL
#define OOCPT_PROGRESS_GLSL

#include "wavefront/load_waits.glsl"
#include "wavefront/queue.glsl"

const uint OWN_UNIT = 0xffffffffu; // the ray waits for the chunk itself

void set_progress(uint path, uint bits) {
    Uints(STREAMING.progress).v[path] = bits;
}

// Notes that a ray of the path has finished; returns all bits when the other one had too, else 0.
uint finish(uint path, uint bits) {
    const uint all = atomicOr(Uints(STREAMING.progress).v[path], bits) | bits;
    return (all & (SHADOW_DONE | CLOSEST_DONE)) == (SHADOW_DONE | CLOSEST_DONE) ? all : 0u;
}

// Counts paths that have ended in their segments, and gives their slots back.
void end_path(uint path, bool ended) {
    const uint alive = ended ? path_place(path) / STREAMING.segment_size * SEGMENT_WORDS + SEGMENT_WORD_ALIVE : 0u;
    add_each(STREAMING.segments, alive, 0xffffffffu, ended);
    uint to;
    QUEUE_SLOT(to, freed, ended);
    if (ended) Uints(STREAMING.free_slots).v[to % STREAMING.slots] = path;
}

// Pushes paths to be shaded, with textures to have their materials resolved first, and ends those that end; `all` as
// finish returned it.
void push_finished(uint path, uint all) {
    const bool ends = (all & PATH_ENDS) != 0u;
    const bool hit = (all & CLOSEST_HIT) != 0u;
    uint to;
    if (HAS_TEXTURES) {
        QUEUE_SLOT(to, resolve_count, all != 0u && !ends && hit);
        if (all != 0u && !ends && hit) Uints(STREAMING.resolve_queue).v[to] = path;
    } else {
        QUEUE_SLOT(to, surface_count, all != 0u && !ends && hit);
        if (all != 0u && !ends && hit) Uints(FRAME.surface_queue).v[to] = path;
    }
    QUEUE_SLOT(to, escaped_count, all != 0u && !ends && !hit);
    if (all != 0u && !ends && !hit) Uints(FRAME.escaped_queue).v[to] = path;
    end_path(path, ends);
}

// Puts rays that wait on the list of deferred rays.
void push_deferred(uint entry, bool waits) {
    const uint list = COUNTERS.deferred_parity;
    uint to;
    QUEUE_SLOT(to, deferred_count[list], waits);
    if (waits) Uints(STREAMING.deferred[list]).v[to] = entry;
    ADD_EACH(misses, waits ? 1u : 0u);
    if (HAS_LOAD_WAITS && waits) count_load_wait(entry);
}

#endif
