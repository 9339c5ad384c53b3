// SPDX-License-Identifier: Apache-2.0
// How often a path waits for loads (Features::LOAD_WAITS): the last WAIT_WORDS of its light values. The first counts
// its closest rays and its materials, the other one its shadow rays: these may wait at the same time.
#ifndef OOCPT_LOAD_WAITS_GLSL
#define OOCPT_LOAD_WAITS_GLSL

uint64_t load_waits_of(uint path) {
    return FRAME.light_values + uint64_t(path) * (4u * FRAME.light_stride) + 4u * (FRAME.light_words - WAIT_WORDS);
}

// A path begins.
void clear_load_waits(uint path) {
    for (uint word = 0u; word < WAIT_WORDS; ++word) Floats(load_waits_of(path)).v[word] = 0.0;
}

// `entry`: as on the list of deferred rays.
void count_load_wait(uint entry) {
    const uint64_t waits = load_waits_of(entry & ~(SHADOW_BIT | MATERIAL_BIT));
    Floats(waits).v[(entry & SHADOW_BIT) != 0u ? 1u : 0u] += 1.0;
}

#endif
