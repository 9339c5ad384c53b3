// SPDX-License-Identifier: Apache-2.0
// Streaming only. Turns counts into places, in two steps.
// arg0 = SCAN_BLOCKS, a workgroup per block of SCAN_BLOCK counts: each becomes the sum of those before it in its block;
// sort_sums gets the sum of the block.
// arg0 = SCAN_SUMS, one workgroup: each sum becomes that of the blocks before it. Makes room in the queues and turns to
// the other list of deferred rays.
// Reads and writes: sort_counts, sort_sums, WavefrontCounters.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "wavefront/wavefront.glsl"

const uint PER_THREAD = SCAN_BLOCK / WORKGROUP_SIZE;

shared uint sums[WORKGROUP_SIZE];
shared uint watched[2]; // what became of the elements at the indices to watch

// Sum of `value` over the threads before this one; `total` over all. Called by the whole workgroup.
uint before(uint value, out uint total) {
    const uint thread = gl_LocalInvocationIndex;
    sums[thread] = value;
    barrier();
    [[dont_unroll]] for (uint step = 1u; step < WORKGROUP_SIZE; step *= 2u) {
        const uint left = thread >= step ? sums[thread - step] : 0u;
        barrier();
        sums[thread] += left;
        barrier();
    }
    total = sums[WORKGROUP_SIZE - 1u];
    const uint result = sums[thread] - value;
    barrier();
    return result;
}

uint keys() {
    return 2u * STREAMING.chunk_count + (HAS_TEXTURES ? TILE_KEYS : 0u);
}

// Scans words[begin .. begin + SCAN_BLOCK], as far as there are `count`; returns their sum.
uint scan_block(uint64_t address, uint begin, uint count, uint base, uvec2 watch) {
    Uints words = Uints(address);
    const uint mine = begin + gl_LocalInvocationIndex * PER_THREAD;
    uint sum = 0u;
    for (uint i = mine; i < min(mine + PER_THREAD, count); ++i) sum += words.v[i];
    uint total;
    uint place = base + before(sum, total);
    for (uint i = mine; i < min(mine + PER_THREAD, count); ++i) {
        const uint value = words.v[i];
        words.v[i] = place;
        if (i == watch.x) watched[0] = place;
        if (i == watch.y) watched[1] = place;
        place += value;
    }
    return total;
}

void make_room(uint total) {
    // The places of the first shadow ray and of the first material.
    const uint closest = Uints(STREAMING.sort_counts).v[STREAMING.chunk_count] + watched[0];
    const uint rays = HAS_TEXTURES ? Uints(STREAMING.sort_counts).v[2u * STREAMING.chunk_count] + watched[1] : total;
    COUNTERS.ray_base = COUNTERS.ray_count[push.round & 1u];
    COUNTERS.shadow_base = COUNTERS.shadow_count - closest; // places of shadow rays begin at `closest`
    COUNTERS.ray_count[push.round & 1u] += closest;
    COUNTERS.shadow_count += rays - closest;
    COUNTERS.resumed_rays = closest;
    COUNTERS.resumed_shadows = rays - closest;
    if (HAS_TEXTURES) {
        COUNTERS.resolve_base = COUNTERS.resolve_count - rays; // places of materials begin at `rays`
        COUNTERS.resolve_count += total - rays;
    }
    COUNTERS.deferred_parity ^= 1u;
    COUNTERS.deferred_count[COUNTERS.deferred_parity] = 0u;
}

void main() {
    if (!HAS_STREAMING) return;
    const uint group = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    if (push.arg0 == SCAN_BLOCKS) {
        const uint total = scan_block(STREAMING.sort_counts, group * SCAN_BLOCK, keys(), 0u, uvec2(0xffffffffu));
        if (gl_LocalInvocationIndex == 0u) Uints(STREAMING.sort_sums).v[group] = total;
        return;
    }
    const uint blocks = (keys() + SCAN_BLOCK - 1u) / SCAN_BLOCK;
    uint total = 0u;
    for (uint begin = 0u; begin < blocks; begin += SCAN_BLOCK) {
        total += scan_block(STREAMING.sort_sums, begin, blocks, total,
                            uvec2(1u, 2u) * STREAMING.chunk_count / SCAN_BLOCK);
    }
    barrier();
    if (gl_LocalInvocationIndex == 0u) make_room(total);
}
