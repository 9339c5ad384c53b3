// SPDX-License-Identifier: Apache-2.0
// Pushes to queues, one atomic per subgroup. Queues hold a wave, so they cannot overflow; their order is not deterministic
// and nothing may depend on it.
#ifndef OOCPT_QUEUE_GLSL
#define OOCPT_QUEUE_GLSL

#extension GL_KHR_shader_subgroup_ballot : require

// Slot for each thread that wants one, taken from COUNTERS.member. Call with as many threads active as possible.
#define QUEUE_SLOT(slot, member, wanted)                                                                               \
    do {                                                                                                               \
        const uvec4 ballot = subgroupBallot(wanted);                                                                   \
        uint first = 0u;                                                                                               \
        if (subgroupElect()) {                                                                                         \
            const uint pushed = subgroupBallotBitCount(ballot);                                                        \
            if (pushed != 0u) first = atomicAdd(COUNTERS.member, pushed);                                              \
        }                                                                                                              \
        slot = subgroupBroadcastFirst(first) + subgroupBallotExclusiveBitCount(ballot);                                \
    } while (false)

#endif
