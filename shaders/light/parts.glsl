// SPDX-License-Identifier: Apache-2.0
// Light that is kept apart by light path expressions (Features::PATH_EXPRESSIONS): adds a contribution to those of
// the expressions that its path is of. Needs wavefront.glsl.
#ifndef OOCPT_LIGHT_PARTS_GLSL
#define OOCPT_LIGHT_PARTS_GLSL

#define AUTOMATON PathAutomatonBlock(FRAME.automaton).a

GpuPathStates load_states(uint64_t states, uint path) {
    return PathStatesBlock(states + uint64_t(path) * uint64_t(PATH_STATES_BYTES)).s;
}

void store_states(uint64_t states, uint path, GpuPathStates s) {
    PathStatesBlock(states + uint64_t(path) * uint64_t(PATH_STATES_BYTES)).s = s;
}

// The expressions that light counts for which was found on its way: all, or not those of unoccluded light, as they have
// counted it when a shadow ray was sent.
uint parts_found(bool of_all) {
    return of_all ? 0xffffffffu : ~AUTOMATON.unoccluded;
}

// Expressions that a path which ends in this state is of, as bits.
uint accepted(uint state) {
    return ConstUints(AUTOMATON.accepts).v[state];
}

uint64_t light_values_of(uint path) {
    return FRAME.light_values + uint64_t(path) * (4u * FRAME.light_stride);
}

// A path begins: none of its light is known.
void clear_light_parts(uint path) {
    const uint64_t values = light_values_of(path);
    for (uint word = 0u; word < 3u * FRAME.light_count; ++word) Floats(values).v[word] = 0.0;
}

// `light`: what the path adds to its radiance. `s`: states after what shines. `counted`: the expressions that it may be
// of, as bits.
void add_light_parts(uint path, GpuPathStates s, vec3 light, uint counted) {
    const uint64_t values = light_values_of(path);
    for (uint c = 0u; c < 3u; ++c) {
        const uint diffuse = accepted(s.states[c] & 0xffffu) & counted;
        const uint other = accepted(s.states[c] >> 16) & counted;
        const float part = light[c] * s.share[c];
        const float rest = light[c] - part;
        for (uint left = diffuse | other; left != 0u; left &= left - 1u) {
            const uint expression = uint(findLSB(left));
            const bool is_diffuse = ((diffuse >> expression) & 1u) != 0u;
            const bool is_other = ((other >> expression) & 1u) != 0u;
            float value = rest;
            if (is_diffuse) value = is_other ? light[c] : part;
            Floats(values).v[3u * expression + c] += value;
        }
    }
}

#endif
