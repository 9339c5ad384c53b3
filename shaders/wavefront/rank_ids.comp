// SPDX-License-Identifier: Apache-2.0
// Counts samples in the slots of what they met first, as `sum_planes` adds their values and before `accumulate` adds
// their light: one thread per pixel of the wave or segment, as there. In core, with textures: does nothing while a
// path of the wave lacks a tile. Reads: FrameConstants::plane_values. Reads and writes:
// FrameConstants::id_slots.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "wavefront/wavefront.glsl"
#include "texture/feedback.glsl"

// A sample counts as one also where its filter is negative: a share is one of the filter without its sign.
void add_id(uint64_t slots, uvec2 id) {
    if (id.x == 0u) return;
    uint least = 0u;
    float least_weight = 3.0e38;
    for (uint slot = 0u; slot < ID_SLOTS; ++slot) {
        const IdSlot have = IdSlots(slots).v[slot];
        if (have.id == 0u || (have.id == id.x && have.instance == id.y)) {
            IdSlots(slots).v[slot] = IdSlot(id.x, id.y, have.weight + 1.0);
            return;
        }
        if (have.weight < least_weight) {
            least_weight = have.weight;
            least = slot;
        }
    }
    IdSlots(slots).v[least] = IdSlot(id.x, id.y, 1.0);
}

void main() {
    if (waits_for_tiles()) return;
    const uint thread = thread_index();
    uint pixels = FRAME.width * FRAME.height; // that have paths here, one after the other
    if (HAS_ADAPTIVE) pixels = band_width(push.first_sample);
    if (thread >= min(pixels, push.path_count)) return;
    uint index = pixel_from(push.first_pixel, thread);
    uint stream = 0u;
    if (HAS_ADAPTIVE) {
        const uint entry = entry_from(push.first_pixel, push.first_sample, thread).x;
        index = entry & ~STREAM_BIT;
        stream = entry >> 31;
    }
    const uint pixel = film_pixel(pixel_position(index)) + stream * FRAME.width * FRAME.height;
    const uint ids = FRAME.id_count;
    for (uint id = 0u; id < ids; ++id) {
        const uint64_t slots = FRAME.id_slots + uint64_t(pixel * ids + id) * (ID_SLOTS * ID_SLOT_BYTES);
        for (uint path = thread; path < push.path_count; path += pixels) {
            const uint64_t values = FRAME.plane_values + uint64_t(push.arg0 + path) * (4u * FRAME.plane_words);
            const uint64_t words = values + 4u * (FRAME.sum_words + 2u * id);
            add_id(slots, uvec2(ConstUints(words).v[0], ConstUints(words).v[1]));
        }
    }
}
