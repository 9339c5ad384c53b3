// SPDX-License-Identifier: Apache-2.0
// The light tree: choosing a local light in proportion to what it may bring to a receiver, and finding the lights on a
// ray.
//
// A BVH2 whose children carry a box, a cone of directions and a power (Conty Estevez and Kulla 2018, "Importance
// Sampling of Many Lights with Adaptive Tree Splitting"; Pharr et al. 2023, 12.6.3). The probability of a light is the
// product of the shares on its way from the root; the walk along a ray carries that product along, so it is the very
// number that choosing gives.
#ifndef OOCPT_LIGHT_TREE_GLSL
#define OOCPT_LIGHT_TREE_GLSL

#include "traversal/box.glsl"

// A receiver of light: a position, and the normal above which light counts; a normal of 0: light from all sides counts.
struct Receiver {
    vec3 p;
    vec3 n;
};

// The rounding that importance allows for before it takes a cone for invisible.
const float CONE_SLACK = 1.0e-3;

// cos(max(0, a - b)).
float cos_minus(float sin_a, float cos_a, float sin_b, float cos_b) {
    return cos_a > cos_b ? 1.0 : cos_a * cos_b + sin_a * sin_b;
}

// sin(max(0, a - b)).
float sin_minus(float sin_a, float cos_a, float sin_b, float cos_b) {
    return cos_a > cos_b ? 0.0 : sin_a * cos_b - cos_a * sin_b;
}

float sine(float cosine) {
    return sqrt(max(1.0 - cosine * cosine, 0.0));
}

// Cosine of the least angle between a direction of child `i`'s cone and the way from a point of its box, of half angle
// b, to the receiver; `cos_w`: of the angle between the cone's axis and the way from the box's middle.
float cos_outwards(GpuLightNode node, uint i, float cos_w, float sin_b, float cos_b) {
    const float sin_w = sine(cos_w);
    const float cos_o = node.cos_axis[i];
    const float sin_o = sine(cos_o);
    const float cos_x = cos_minus(sin_w, cos_w, sin_o, cos_o);
    const float sin_x = sin_minus(sin_w, cos_w, sin_o, cos_o);
    return cos_minus(sin_x, cos_x, sin_b, cos_b);
}

// The most that the lights of child `i` may contribute to the receiver, up to a factor.
float importance(GpuLightNode node, uint i, Receiver r) {
    if (!(node.power[i] > 0.0)) return 0.0;
    const vec3 center = 0.5 * node.min[i] + 0.5 * node.max[i];
    const vec3 half_size = 0.5 * node.max[i] - 0.5 * node.min[i];
    const vec3 towards = center - r.p;
    const float radius2 = dot3(half_size, half_size);
    const float distance2 = dot3(towards, towards);
    // Half angle of the sphere around the box; inside of it the box may be anywhere.
    const bool inside = distance2 <= radius2 * 1.0001 || !(distance2 > 0.0);
    const float cos_b = inside ? -1.0 : sqrt(max(1.0 - radius2 / distance2, 0.0));
    const float sin_b = inside ? 0.0 : sine(cos_b);
    const vec3 w = inside ? vec3(0.0, 0.0, 1.0) : towards * inversesqrt(distance2);
    float value = node.power[i] / max(distance2, max(radius2, 1.0e-30));
    // Angle between the lights' directions and the receiver, less their cone and the box's.
    const float cos_w = clamp(-dot3(node.axis[i], w), -1.0, 1.0);
    const float cos_out = inside ? 1.0 : cos_outwards(node, i, cos_w, sin_b, cos_b);
    float outwards = cos_out < node.cos_emission[i] - CONE_SLACK ? 0.0 : max(cos_out, 0.05);
    if (HAS_MESH_LIGHTS && node.back[i] > 0.0 && !inside) {
        const float cos_back = cos_outwards(node, i, -cos_w, sin_b, cos_b);
        if (!(cos_back < node.cos_emission[i] - CONE_SLACK)) {
            outwards = max(outwards, node.back[i] * max(cos_back, 0.05));
        }
    }
    if (!(outwards > 0.0)) return 0.0;
    value *= outwards;
    if (!inside && dot3(r.n, r.n) > 0.0) {
        const float cos_i = clamp(dot3(w, r.n), -1.0, 1.0);
        const float cos_in = cos_minus(sine(cos_i), cos_i, sin_b, cos_b);
        if (cos_in < -CONE_SLACK) return 0.0;
        value *= max(cos_in, 0.05);
    }
    return min(value, 1.0e36);
}

// Share of child 0; negative if neither child contributes.
float first_share(GpuLightNode node, Receiver r) {
    const float a = importance(node, 0u, r);
    const float b = importance(node, 1u, r);
    return a + b > 0.0 ? a / (a + b) : -1.0;
}

GpuLightNode load_light_node(uint index) {
    return LightNodes(LIGHTING.nodes).v[index];
}

GpuLightNode load_mesh_light_node(uint index) {
    return LightNodes(LIGHTING.mesh_nodes).v[index];
}

// Levels that an estimate goes down.
const uint ESTIMATE_DEPTH = 6u;

// The most that the lights below a node may contribute to the receiver, up to a factor: as importance, but refined
// below the child that matters most, so that a light close by counts as close. 0: no light contributes.
float importance_below(uint root, bool of_meshes, Receiver r) {
    float sum = 0.0;
    uint at = root;
    for (uint level = 1u; level <= ESTIMATE_DEPTH; ++level) {
        GpuLightNode node;
        if (of_meshes) {
            node = load_mesh_light_node(at);
        } else {
            node = load_light_node(at);
        }
        const float a = importance(node, 0u, r);
        const float b = importance(node, 1u, r);
        const uint larger = node.child[a >= b ? 0 : 1];
        if (level == ESTIMATE_DEPTH || (larger & LIGHT_LEAF) != 0u) return sum + a + b;
        sum += min(a, b);
        at = larger;
    }
    return sum;
}

// Levels after which the second random number takes over, so that none runs out of digits.
const uint FIRST_DIGITS = 10u;

// A local light, and its probability; false if none contributes.
bool choose_local_light(Receiver r, float u, float spare, out uint light, out float probability) {
    probability = 1.0;
    light = 0u;
    for (uint level = 0u; level <= LIGHT_TREE_DEPTH; ++level) {
        if (level == FIRST_DIGITS) u = spare;
        const GpuLightNode node = load_light_node(light);
        const float share = first_share(node, r);
        if (share < 0.0) return false;
        const bool first = u < share;
        u = min(first ? u / share : (u - share) / (1.0 - share), 0.99999994);
        probability *= first ? share : 1.0 - share;
        const uint child = node.child[first ? 0 : 1];
        light = child & ~LIGHT_LEAF;
        if ((child & LIGHT_LEAF) != 0u) return probability > 0.0;
    }
    return false;
}

// The same among mesh lights, or among the leaves of one: from node `root`, with numbers of its own. `probability` is
// multiplied.
bool choose_mesh_leaf(uint root, Receiver r, float u, float spare, out uint leaf, inout float probability) {
    leaf = root;
    for (uint level = 0u; level <= LIGHT_TREE_DEPTH; ++level) {
        if (level == FIRST_DIGITS) u = spare;
        const GpuLightNode node = load_mesh_light_node(leaf);
        const float share = first_share(node, r);
        if (share < 0.0) return false;
        const bool first = u < share;
        u = min(first ? u / share : (u - share) / (1.0 - share), 0.99999994);
        probability *= first ? share : 1.0 - share;
        const uint child = node.child[first ? 0 : 1];
        leaf = child & ~LIGHT_LEAF;
        if ((child & LIGHT_LEAF) != 0u) return probability > 0.0;
    }
    return false;
}

// The factor of choose_mesh_leaf on the way of `trail`; 0 if that way is never taken.
float mesh_leaf_probability(uint root, uvec2 trail, Receiver r, float probability) {
    uint at = root;
    for (uint level = 0u; level <= LIGHT_TREE_DEPTH; ++level) {
        const GpuLightNode node = load_mesh_light_node(at);
        const float share = first_share(node, r);
        if (share < 0.0) return 0.0;
        const bool first = ((trail[level / 32u] >> (level % 32u)) & 1u) == 0u;
        probability *= first ? share : 1.0 - share;
        const uint child = node.child[first ? 0 : 1];
        at = child & ~LIGHT_LEAF;
        if ((child & LIGHT_LEAF) != 0u) return probability;
    }
    return 0.0;
}

uint light_stack[LIGHT_TREE_DEPTH + 1u];
float probability_stack[LIGHT_TREE_DEPTH + 1u];

#endif
