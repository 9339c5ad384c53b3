// SPDX-License-Identifier: Apache-2.0
// Deep samples of a pixel: a list of at most FrameConstants::deep_samples slots, in no order. Samples that met one
// thing at about one depth share a slot. When all slots are taken the two nearest ones of one thing become one, or the
// sample joins the nearest slot: shares, light and alpha of the pixel stay complete.
#ifndef OOCPT_DEEP_GLSL
#define OOCPT_DEEP_GLSL

#include "wavefront/wavefront.glsl"

// Address of the slots of a record, or of a pixel of the image.
uint64_t deep_list(uint64_t lists, uint record) {
    return lists + uint64_t(record) * (FRAME.deep_samples * DEEP_SLOT_BYTES);
}

bool is_one_thing(DeepSlot a, DeepSlot b) {
    return a.id == b.id && a.instance == b.instance;
}

bool is_one_depth(float a, float b) {
    return abs(a - b) <= max(FRAME.deep_distance, FRAME.deep_tolerance * min(abs(a), abs(b)));
}

// Both slots as one, which is of the thing with the larger share.
DeepSlot together(DeepSlot a, DeepSlot b) {
    const float weight = a.weight + b.weight;
    // What met nothing has no depth that a mean could be taken of.
    const bool is_far = max(a.depth, b.depth) >= DEEP_FAR;
    const float depth = is_far ? min(a.depth, b.depth) : a.depth + (b.depth - a.depth) * (b.weight / weight);
    const bool takes_other = b.weight > a.weight;
    return DeepSlot(takes_other ? b.id : a.id, takes_other ? b.instance : a.instance, weight, depth, a.color + b.color,
                    a.alpha + b.alpha);
}

// Makes one slot of the two nearest of one thing, and returns the slot that becomes free; NO_INDEX if all are of
// different things.
uint free_slot(uint64_t slots) {
    uvec2 pair = uvec2(NO_INDEX);
    float least = 3.0e38;
    for (uint i = 0u; i < FRAME.deep_samples; ++i) {
        const DeepSlot a = DeepSlots(slots).v[i];
        for (uint j = i + 1u; j < FRAME.deep_samples; ++j) {
            const DeepSlot b = DeepSlots(slots).v[j];
            const float apart = abs(a.depth - b.depth);
            if (is_one_thing(a, b) && apart < least) {
                least = apart;
                pair = uvec2(i, j);
            }
        }
    }
    if (pair.x != NO_INDEX) {
        DeepSlots(slots).v[pair.x] = together(DeepSlots(slots).v[pair.x], DeepSlots(slots).v[pair.y]);
    }
    return pair.y;
}

// Adds a slot of at least one sample to a list.
void merge_deep(uint64_t slots, DeepSlot of) {
    uint nearest = 0u;
    bool is_of_thing = false;
    float least = 3.0e38;
    for (uint slot = 0u; slot < FRAME.deep_samples; ++slot) {
        const DeepSlot have = DeepSlots(slots).v[slot];
        const bool is_one = is_one_thing(have, of);
        if (have.weight == 0.0) {
            DeepSlots(slots).v[slot] = of;
            return;
        }
        if (is_one && is_one_depth(have.depth, of.depth)) {
            DeepSlots(slots).v[slot] = together(have, of);
            return;
        }
        const float apart = abs(have.depth - of.depth);
        if ((is_one && !is_of_thing) || (is_one == is_of_thing && apart < least)) {
            nearest = slot;
            least = apart;
            is_of_thing = is_one;
        }
    }
    const uint freed = is_of_thing ? NO_INDEX : free_slot(slots);
    if (freed != NO_INDEX) {
        DeepSlots(slots).v[freed] = of;
    } else {
        DeepSlots(slots).v[nearest] = together(DeepSlots(slots).v[nearest], of);
    }
}

#endif
