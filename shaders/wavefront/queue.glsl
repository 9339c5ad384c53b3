// SPDX-License-Identifier: Apache-2.0
// Pushes to queues, one atomic per subgroup. Queues hold all paths, so they cannot overflow; their order is not
// deterministic and nothing may depend on it.
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

// Adds 1, or `step`, to words[key] for each thread that wants to; threads of one key (the first one's) share an atomic.
void add_each(uint64_t words, uint key, uint step, bool wanted) {
    if (!wanted) return;
    const uint first = subgroupBroadcastFirst(key);
    const uvec4 same = subgroupBallot(key == first);
    if (key != first) {
        atomicAdd(Uints(words).v[key], step);
    } else if (subgroupElect()) {
        atomicAdd(Uints(words).v[key], step * subgroupBallotBitCount(same));
    }
}

// As add_each by 1; returns true if this thread made the number and found 0.
bool add_to_nothing(uint64_t words, uint key, bool wanted) {
    if (!wanted) return false;
    const uint first = subgroupBroadcastFirst(key);
    const uvec4 same = subgroupBallot(key == first);
    if (key != first) return atomicAdd(Uints(words).v[key], 1u) == 0u;
    return subgroupElect() && atomicAdd(Uints(words).v[key], subgroupBallotBitCount(same)) == 0u;
}

// Adds every thread's value to COUNTERS.member. Call with as many threads active as possible.
#define ADD_EACH(member, value)                                                                                        \
    do {                                                                                                               \
        uint rest = value;                                                                                             \
        uint sum = 0u;                                                                                                 \
        for (uint bit = 0u; subgroupBallotBitCount(subgroupBallot(rest != 0u)) != 0u; ++bit) {                         \
            sum += subgroupBallotBitCount(subgroupBallot((rest & 1u) != 0u)) << bit;                                   \
            rest >>= 1u;                                                                                               \
        }                                                                                                              \
        if (subgroupElect() && sum != 0u) atomicAdd(COUNTERS.member, sum);                                             \
    } while (false)

#endif
