// SPDX-License-Identifier: Apache-2.0
// The states of a path in the automaton of light path expressions (Features::PATH_EXPRESSIONS).
//
// Light that a surface scatters is split by lobes: the share of diffuse ones is that of the BSDF's value for the
// direction, by channel, whichever lobe the direction was sampled from. So until the next surface a path has two states
// a channel, and shares of them. There each channel goes on with one of the two, with the probability of its share: a
// part of the light is that of its expression on average, and parts that cover everything add up to the light of each
// sample. Needs wavefront.glsl.
#ifndef OOCPT_LIGHT_PATH_STATES_GLSL
#define OOCPT_LIGHT_PATH_STATES_GLSL

#include "light/parts.glsl"

// The state after an event of what has this label.
uint state_after(uint state, uint event, uint label) {
    const uint labels = AUTOMATON.label_count;
    return ConstUints(AUTOMATON.next).v[(state * EVENT_COUNT + event) * labels + label];
}

// The label of a surface.
uint prim_label(int prim_id) {
    const uint index = uint(prim_id + 1);
    return index < AUTOMATON.prim_count ? ConstUints(AUTOMATON.prim_labels).v[index] : AUTOMATON.default_label;
}

// The states of the path of a ray that has been traced.
GpuPathStates path_states(uint path, uint bounce) {
    if (bounce == 0u) return GpuPathStates(uvec3(AUTOMATON.start | AUTOMATON.start << 16), vec3(1.0));
    return load_states(FRAME.path_states, path);
}

// States where the path ends at what shines.
GpuPathStates states_at_light(GpuPathStates s, uint event, uint label) {
    for (uint c = 0u; c < 3u; ++c) {
        s.states[c] = state_after(s.states[c] & 0xffffu, event, label) |
                      state_after(s.states[c] >> 16, event, label) << 16;
    }
    return s;
}

// The states by channel with which a path goes on at a surface; u in [0, 1).
uvec3 settled_states(GpuPathStates s, float u) {
    uvec3 states;
    for (uint c = 0u; c < 3u; ++c) states[c] = u < s.share[c] ? s.states[c] & 0xffffu : s.states[c] >> 16;
    return states;
}

// States after a surface with this label has scattered a path, `share` of it by diffuse lobes. `sharp`: by a lobe
// without a density.
GpuPathStates scattered_states(uvec3 before, bool transmits, bool sharp, uint label, vec3 share) {
    const uint side = transmits ? EVENT_TRANSMITS : 0u;
    const uint other = side + (sharp ? EVENT_SHARP : EVENT_GLOSSY);
    GpuPathStates s = GpuPathStates(uvec3(0u), share);
    for (uint c = 0u; c < 3u; ++c) {
        s.states[c] = state_after(before[c], side, label) | state_after(before[c], other, label) << 16;
    }
    return s;
}

// Whether what was last found of a light that a ray meets is what others than diffuse lobes scatter alone.
bool brought_specular = false;

// Lights that a ray meets add up to one contribution. These say what of it each light's radiance is: the path, its
// states, and the factor, throughput and clamping together; none while it is 0.
uint part_path;
GpuPathStates part_states;
vec3 part_factor = vec3(0.0);

// Begins to keep apart what lights add to a contribution `kept`, which was `value` before it was clamped.
bool begin_light_parts(uint path, uint bounce, vec3 throughput, vec3 value, vec3 kept) {
    const float most = max_component(value);
    if (!is_finite(value) || !(most > 0.0)) return false;
    part_path = path;
    part_states = path_states(path, bounce);
    part_factor = throughput * (max_component(kept) / most);
    return true;
}

void end_light_parts() {
    part_factor = vec3(0.0);
}

// Adds a light that a ray meets; `light` holds its multipliers already. `asked`: shadow rays ask for it, too.
void add_light_part(uint event, uint64_t labels, uint index, float diffuse, float specular, vec3 light, bool asked) {
    if (!HAS_PATH_EXPRESSIONS || !(max_component(part_factor) > 0.0) || !(max_component(light) > 0.0)) return;
    GpuPathStates s = states_at_light(part_states, event, ConstUints(labels).v[index]);
    if (brought_specular) {
        s.share = vec3(0.0);
    } else if (HAS_LIGHT_LOBES && diffuse != specular) {
        for (uint c = 0u; c < 3u; ++c) {
            const float all = specular + (diffuse - specular) * s.share[c];
            s.share[c] = all > 0.0 ? min(diffuse * s.share[c] / all, 1.0) : 0.0;
        }
    }
    add_light_parts(part_path, s, part_factor * light, parts_found(!asked));
}

// What a shadow ray has been sampled towards: set with LightSample. `sampled_share`: of its contribution, by channel,
// that diffuse lobes scatter.
uint sampled_event = 0u;
uint sampled_label = 0u;
bool sampled_sharp = false;
vec3 sampled_share = vec3(0.0);

#endif
