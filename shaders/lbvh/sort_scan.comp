// SPDX-License-Identifier: Apache-2.0
// Radix sort, step 2 of a pass: running sums over the tiles. One workgroup per digit (256).
// Reads and writes: histogram[digit][tile], each replaced by the sum of those before it. Writes: the total of the
// digit, at histogram[256 * tiles + digit].
#version 460
#extension GL_GOOGLE_include_directive : require
#include "include/lbvh.glsl"

const uint PER_THREAD = 4u;

shared uint sums[WORKGROUP_SIZE];

void main() {
    const uint local = gl_LocalInvocationIndex;
    const uint row = gl_WorkGroupID.x * push.groups;
    uint before = 0u;
    for (uint start = 0u; start < push.groups; start += PER_THREAD * WORKGROUP_SIZE) {
        const uint first = start + local * PER_THREAD;
        uint values[PER_THREAD];
        uint sum = 0u;
        for (uint i = 0u; i < PER_THREAD; ++i) {
            values[i] = first + i < push.groups ? Words(push.histogram).v[row + first + i] : 0u;
            sum += values[i];
        }
        sums[local] = sum;
        barrier();
        for (uint step = 1u; step < WORKGROUP_SIZE; step *= 2u) {
            const uint left = local >= step ? sums[local - step] : 0u;
            barrier();
            sums[local] += left;
            barrier();
        }
        uint running = before + sums[local] - sum;
        for (uint i = 0u; i < PER_THREAD; ++i) {
            if (first + i < push.groups) Words(push.histogram).v[row + first + i] = running;
            running += values[i];
        }
        before += sums[WORKGROUP_SIZE - 1u];
        barrier();
    }
    if (local == 0u) Words(push.histogram).v[SORT_DIGITS * push.groups + gl_WorkGroupID.x] = before;
}
