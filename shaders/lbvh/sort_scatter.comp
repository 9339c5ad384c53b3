// SPDX-License-Identifier: Apache-2.0
// Radix sort, step 3 of a pass: every key to its place, stable. One workgroup per tile.
// Reads: keys_in, items_in, histogram as step 2 left it. Writes: keys_out, items_out.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "include/lbvh.glsl"

shared uint places[SORT_DIGITS];  // where the next key of the digit goes
shared uint present[SORT_DIGITS * 2u]; // bit per thread of the row that holds the digit
shared uint sums[WORKGROUP_SIZE];

// places[digit] = keys of lower digits anywhere + keys of the digit in earlier tiles.
void find_places(uint tile) {
    const uint local = gl_LocalInvocationIndex;
    uint totals[4];
    uint sum = 0u;
    for (uint i = 0u; i < 4u; ++i) {
        totals[i] = Words(push.histogram).v[SORT_DIGITS * push.groups + local * 4u + i];
        sum += totals[i];
    }
    sums[local] = sum;
    barrier();
    for (uint step = 1u; step < WORKGROUP_SIZE; step *= 2u) {
        const uint left = local >= step ? sums[local - step] : 0u;
        barrier();
        sums[local] += left;
        barrier();
    }
    uint running = sums[local] - sum;
    for (uint i = 0u; i < 4u; ++i) {
        const uint digit = local * 4u + i;
        places[digit] = running + Words(push.histogram).v[digit * push.groups + tile];
        running += totals[i];
    }
}

void main() {
    const uint tile = min(group_index(), push.groups - 1u); // surplus groups repeat the last tile's work, same values
    const uint local = gl_LocalInvocationIndex;
    const uint word = local >> 5;
    const uint bit = 1u << (local & 31u);
    for (uint i = local; i < SORT_DIGITS * 2u; i += WORKGROUP_SIZE) present[i] = 0u;
    find_places(tile);
    barrier();
    for (uint row = 0u; row < SORT_ROWS; ++row) {
        const uint at = tile * SORT_TILE + row * WORKGROUP_SIZE + local;
        const bool in_range = at < push.count;
        uint64_t key = 0ul;
        uint digit = 0u;
        if (in_range) {
            key = Keys(push.keys_in).v[at];
            digit = sort_digit(key);
            atomicOr(present[digit * 2u + word], bit);
        }
        barrier();
        uint rank = 0u;
        uint row_count = 0u;
        uint place = 0u;
        if (in_range) {
            const uint low = present[digit * 2u];
            const uint high = present[digit * 2u + 1u];
            rank = bitCount((word == 0u ? low : high) & (bit - 1u)) + (word == 0u ? 0u : bitCount(low));
            row_count = bitCount(low) + bitCount(high);
            place = places[digit] + rank;
        }
        barrier();
        if (in_range) {
            if (rank == 0u) {
                places[digit] += row_count;
                present[digit * 2u] = 0u;
                present[digit * 2u + 1u] = 0u;
            }
            Keys(push.keys_out).v[place] = key;
            Words(push.items_out).v[place] = Words(push.items_in).v[at];
        }
        barrier();
    }
}
