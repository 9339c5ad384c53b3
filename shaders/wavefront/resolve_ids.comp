// SPDX-License-Identifier: Apache-2.0
// Writes the largest shares of each pixel by id: one thread per pixel. Reads: film (the number of samples),
// FrameConstants::id_slots. Writes: the planes of FrameConstants::aov that PlaneOffsets has ids for. Adaptive: half of
// each stream, as `resolve`.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "wavefront/wavefront.glsl"

const uint STREAMS = HAS_ADAPTIVE ? 2u : 1u;

void rank(uint64_t plane, uint first_word, uint pixel) {
    if (first_word == NO_INDEX) return;
    const uint ids = FRAME.id_count;
    const uint id = (first_word - FRAME.sum_words) / 2u;
    IdSlot shares[2u * ID_SLOTS];
    uint count = 0u;
    for (uint stream = 0u; stream < STREAMS; ++stream) {
        const uint record = pixel + stream * FRAME.width * FRAME.height;
        const float samples = float(max(ConstFilm(FRAME.film).v[record].samples, 1u)) * float(STREAMS);
        const uint64_t slots = FRAME.id_slots + uint64_t(record * ids + id) * (ID_SLOTS * ID_SLOT_BYTES);
        for (uint slot = 0u; slot < ID_SLOTS; ++slot) {
            const IdSlot have = IdSlots(slots).v[slot];
            if (have.id == 0u) break;
            uint at = 0u;
            while (at < count && !(shares[at].id == have.id && shares[at].instance == have.instance)) ++at;
            if (at == count) {
                shares[at] = IdSlot(have.id, have.instance, 0.0);
                ++count;
            }
            shares[at].weight += have.weight / samples;
        }
    }
    for (uint place = 0u; place < ID_RANKS; ++place) {
        uint best = NO_INDEX;
        for (uint at = 0u; at < count; ++at) {
            if (shares[at].weight > 0.0 && (best == NO_INDEX || shares[at].weight > shares[best].weight)) best = at;
        }
        IdSlot ranked = IdSlot(0u, 0u, 0.0);
        if (best != NO_INDEX) {
            ranked = shares[best];
            shares[best].weight = 0.0;
        }
        IdSlots(plane).v[pixel * ID_RANKS + place] = ranked;
    }
}

void main() {
    const uint pixel = thread_index();
    if (pixel >= FRAME.width * FRAME.height) return;
    rank(FRAME.aov.crypto_object, FRAME.plane_at.crypto_object, pixel);
    rank(FRAME.aov.crypto_material, FRAME.plane_at.crypto_material, pixel);
}
