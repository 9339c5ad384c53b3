// SPDX-License-Identifier: Apache-2.0
// Light at surfaces: one light for a shadow ray, and the contribution of a BSDF ray, weighted by the balance heuristic.
//
// Lights are in two groups: those with a place (local ones, and meshes that emit light: light/mesh.glsl), chosen by
// light trees, and those at infinity, with fixed probabilities. The group is chosen by what each may contribute to the
// receiver (local_share, decisions/0062). Each light is a strategy of its own against the BSDF's: a ray that meets
// several gets each with its own weight. A constant dome is sampled by the BSDF. Lights without shadows, or with
// coloured or linked ones, are sampled by shadow rays only, and so are points, lines and single directions; a delta
// lobe's rays (density 0) take all that they meet. Needs: Bsdf and its functions (bsdf.glsl or bsdf_lambert.glsl),
// wavefront.glsl.
#ifndef OOCPT_LIGHT_SAMPLE_GLSL
#define OOCPT_LIGHT_SAMPLE_GLSL

#include "math/affine.glsl"
#include "light/links.glsl"
#include "geometry/prim_masks.glsl"
#include "light/lights.glsl"

#include "light/motion.glsl"
#include "light/shape.glsl"
#include "light/emission.glsl"
#include "light/map.glsl"
#include "light/tree.glsl"

#define INFINITE uintBitsToFloat(0x7f800000u)
// A shadow ray ends this much before its light, relative, so that rounding lets no light shadow itself.
const float SHADOW_END = 0.9999995;

#include "light/mesh.glsl"
#include "light/path_states.glsl"

// The data of a surface that the lights met by the ray leaving it need.
struct PreviousVertex {
    Receiver receiver;
    uint link_set;
    vec3 diffuse; // share of the BSDF's value for the ray that is diffuse, by colour
    float pdf;    // density of the ray's direction; 0: delta lobe
};

uint pack_normal(vec3 n) {
    if (!(dot3(n, n) > 0.0)) return NO_INDEX;
    const vec2 p = n.xy / (abs(n.x) + abs(n.y) + abs(n.z));
    const vec2 folded = (1.0 - abs(p.yx)) * vec2(p.x >= 0.0 ? 1.0 : -1.0, p.y >= 0.0 ? 1.0 : -1.0);
    const vec2 q = n.z < 0.0 ? folded : p;
    // The bits are never all ones in both halves: that means none.
    const uvec2 bits = uvec2(clamp(q * 0.5 + 0.5, 0.0, 1.0) * 65534.0 + 0.5);
    return bits.x | bits.y << 16;
}

// A bit pattern always gives the same normal, so that choosing a light and weighing a ray agree.
vec3 unpack_normal(uint bits) {
    if (bits == NO_INDEX) return vec3(0.0);
    const vec2 q = vec2(bits & 0xffffu, bits >> 16) / 32767.0 - 1.0;
    const float z = 1.0 - abs(q.x) - abs(q.y);
    const vec2 folded = (1.0 - abs(q.yx)) * vec2(q.x >= 0.0 ? 1.0 : -1.0, q.y >= 0.0 ? 1.0 : -1.0);
    const vec2 p = z < 0.0 ? folded : q;
    const vec3 n = vec3(p, z);
    return n * inversesqrt(dot3(n, n));
}

const bool HAS_INFINITE_LIGHTS = HAS_DOME || HAS_DISTANT;

// True if a light needs data of the surface that a ray left: its position, its links, its diffuse share.
const bool HAS_PREVIOUS_VERTICES =
    HAS_LOCAL_LIGHTS || HAS_MESH_LIGHTS || HAS_LIGHT_LINKS || HAS_LIGHT_LOBES || HAS_PRIM_MASKS;

void store_previous_vertex(uint path, uint normal, uint link_set, vec3 diffuse) {
    if (!HAS_PREVIOUS_VERTICES) return;
    UVec4s(FRAME.light_paths).v[path] =
        uvec4(normal, link_set, packUnorm2x16(diffuse.xy), packUnorm2x16(vec2(diffuse.z, 0.0)));
}

PreviousVertex load_previous_vertex(uint path, vec3 origin, float pdf) {
    if (!HAS_PREVIOUS_VERTICES) return PreviousVertex(Receiver(origin, vec3(0.0)), 0u, vec3(0.0), pdf);
    const uvec4 a = ConstUVec4s(FRAME.light_paths).v[path];
    return PreviousVertex(Receiver(origin, unpack_normal(a.x)), a.y, vec3(unpackUnorm2x16(a.z), unpackUnorm2x16(a.w).x),
                          pdf);
}

// The balance heuristic for a ray of density `pdf` (0: delta) against a light sampled with density `other`.
float ray_weight(float pdf, float other) {
    return pdf > 0.0 ? pdf / (pdf + other) : 1.0;
}

// Sum of the probabilities of the lights at infinity that shine on the prims of a set; shadow rays choose among these
// alone.
float linked_infinite(uint link_set) {
    if (!HAS_LIGHT_LINKS) return 1.0;
    float sum = 0.0;
    for (uint i = 0u; i < LIGHTING.infinite_count; ++i) {
        if (is_linked(InfiniteLights(LIGHTING.infinite_lights).v[i].light_link, link_set)) {
            sum += InfiniteLights(LIGHTING.infinite_lights).v[i].probability;
        }
    }
    return sum;
}

// Least share of the shadow rays for each of two groups that may both contribute.
const float MIN_SHARE = 0.1;

// Rough irradiance by lights at infinity; `linked`: the share of them that shines here.
float irradiance_from_infinity(float linked, Receiver r) {
    float distant = LIGHTING.distant_irradiance;
    // Light from below does not count, but suns all around must not cancel each other.
    if (dot3(r.n, r.n) > 0.0) distant = max(dot3(r.n, LIGHTING.distant_axis), 0.05 * distant);
    return (LIGHTING.dome_irradiance + distant) * linked;
}

// Rough irradiance by lights with a place; 0 if none contributes.
float irradiance_from_near(Receiver r) {
    float sum = 0.0;
    if (HAS_LOCAL_LIGHTS && LIGHTING.local_brightness > 0.0) {
        sum += LIGHTING.local_brightness * importance_below(0u, false, r);
    }
    if (HAS_MESH_LIGHTS && LIGHTING.mesh_brightness > 0.0) {
        sum += LIGHTING.mesh_brightness * importance_below(0u, true, r);
    }
    return sum;
}

// Share of the shadow rays that goes to lights with a place, by what these and those at infinity may contribute to the
// receiver; 1 if none at infinity is linked. A function of what a ray that leaves the receiver carries along, so that
// choosing and weighing agree.
float local_share(float linked, Receiver r) {
    const float given = LIGHTING.local_share;
    if (HAS_LIGHT_LINKS && given > 0.0 && !(linked > 0.0)) return 1.0;
    const bool has_near = HAS_LOCAL_LIGHTS || HAS_MESH_LIGHTS;
    if (!(has_near && HAS_INFINITE_LIGHTS) || given <= 0.0 || given >= 1.0) return given;
    const float near = irradiance_from_near(r);
    if (!(near > 0.0)) return 0.0;
    const float sum = near + irradiance_from_infinity(linked, r);
    return sum < INFINITE ? MIN_SHARE + (1.0 - 2.0 * MIN_SHARE) * (near / sum) : given;
}

bool is_shadow_only(uint flags) {
    return (flags & (LIGHT_NO_SHADOWS | LIGHT_SHADOW_COLOR | LIGHT_SHADOW_LINK | LIGHT_SHADOW_REACH)) !=
           0u;
}

// The light's multipliers on the throughput of a BSDF ray.
vec3 multiplied(float diffuse, float specular, vec3 share) {
    return specular + (diffuse - specular) * share;
}

// The share of a light's radiance that a BSDF ray brings, by its multipliers; `asked`: shadow rays ask for it, too.
vec3 brought_by_ray(float diffuse, float specular, PreviousVertex from, bool asked) {
    brought_specular = shadow_rays_alone() && asked;
    if (brought_specular) return specular * (1.0 - from.diffuse);
    return multiplied(diffuse, specular, from.diffuse);
}

// Whether shadow rays ask, too, for the light that local_along has found for the ray.
bool local_asked;

// The contribution of one local light to the ray; 0 if the ray does not meet it before t_end.
vec3 local_along(uint index, float chosen, vec3 o_hi, vec3 o_lo, vec3 d, float t_end, bool camera,
                 PreviousVertex from) {
    const GpuLocalLight light = load_local_light(index);
    const uint kind = light_kind(light.flags);
    local_asked = false;
    if (is_thin(kind)) return vec3(0.0);
    if (camera && (light.flags & LIGHT_CAMERA_VISIBLE) == 0u) return vec3(0.0);
    const vec3 place = difference(Double3(o_hi, o_lo), Double3(light.position, light.position_lo));
    const vec3 o = apply_rows(light.row_x, light.row_y, light.row_z, place);
    const vec3 dd = apply_rows(light.row_x, light.row_y, light.row_z, d);
    vec3 q;
    float t;
    if (!shape_hit(kind, o, dd, q, t) || !(t > 0.0 && t < t_end)) return vec3(0.0);
    const vec3 radiance = local_emission(light, q, -d);
    if (camera) return radiance;
    if (!is_linked(light.light_link, from.link_set)) return vec3(0.0);
    if (from.pdf > 0.0 && is_shadow_only(light.flags)) return vec3(0.0);
    const float other = from.pdf > 0.0 ? chosen * shape_density(kind, light.determinant, o, dd, q, t) : 0.0;
    local_asked = other > 0.0;
    return radiance * brought_by_ray(light.diffuse, light.specular, from, local_asked) * ray_weight(from.pdf, other);
}

// Keeps apart what a local light that the ray has met adds.
void add_local_part(uint index, vec3 light) {
    const GpuLocalLight of = load_local_light(index);
    add_light_part(EVENT_LIGHT, AUTOMATON.local_labels, index, of.diffuse, of.specular, light, local_asked);
}

// The contribution of the local lights that the ray meets before t_end. `met`: at least one of them shines.
vec3 lights_along(Double3 origin, vec3 d, float t_end, bool camera, PreviousVertex from, out bool met) {
    vec3 sum = vec3(0.0);
    met = false;
    const vec3 reciprocal = safe_reciprocal(d);
    const float pad = TOP_PAD * max(abs(origin.hi.x), max(abs(origin.hi.y), abs(origin.hi.z)));
    const vec3 lower = origin.hi + pad;
    const vec3 upper = origin.hi - pad;
    const bool weighs = !camera && from.pdf > 0.0;
    uint top = 0u;
    light_stack[0] = 0u;
    probability_stack[0] = weighs ? local_share(linked_infinite(from.link_set), from.receiver) : 1.0;
    if (HAS_MESH_LIGHTS && weighs) {
        probability_stack[0] *= max(first_share(load_light_node(LIGHTING.joint), from.receiver), 0.0);
    }
    while (true) {
        const uint reference = light_stack[top];
        const float probability = probability_stack[top];
        if ((reference & LIGHT_LEAF) != 0u) {
#ifdef ON_LIGHT
            ON_LIGHT((reference & ~LIGHT_LEAF), probability);
#endif
            const vec3 light =
                local_along(reference & ~LIGHT_LEAF, probability, origin.hi, origin.lo, d, t_end, camera, from);
            met = met || max_component(light) > 0.0;
            sum += light;
            if (HAS_PATH_EXPRESSIONS) add_local_part(reference & ~LIGHT_LEAF, light);
            if (top == 0u) break;
            --top;
            continue;
        }
        const GpuLightNode node = load_light_node(reference);
        bool inside[2];
        for (uint i = 0u; i < 2u; ++i) {
            inside[i] = node.power[i] > 0.0 && hit_box(node.min[i], node.max[i], lower, upper, reciprocal,
                                                       t_end) >= 0.0;
        }
        float share = 1.0;
        if (weighs && (inside[0] || inside[1])) share = max(first_share(node, from.receiver), 0.0);
        const bool none = weighs && share == 0.0 && importance(node, 1u, from.receiver) == 0.0;
        bool replaced = false;
        if (inside[1]) {
            light_stack[top] = node.child[1];
            probability_stack[top] = none ? 0.0 : probability * (1.0 - share);
            replaced = true;
        }
        if (inside[0]) {
            if (replaced) ++top;
            light_stack[top] = node.child[0];
            probability_stack[top] = probability * share;
            replaced = true;
        }
        if (!replaced) {
            if (top == 0u) break;
            --top;
        }
    }
    return sum;
}

GpuInfiniteLight load_infinite_light(uint index) {
    return InfiniteLights(LIGHTING.infinite_lights).v[index];
}

// Radiance of a light at infinity from direction w of its frame, without its single directions; `pdf`: density of
// sampling it, without the probability of the choice.
vec3 infinite_radiance(GpuInfiniteLight light, vec3 w, out float pdf) {
    pdf = 0.0;
    const uint kind = light_kind(light.flags);
    if (kind == LIGHT_DISTANT) {
        if (light.one_minus_cos <= 0.0 || one_minus_dot(w, light.direction) > light.one_minus_cos) return vec3(0.0);
        pdf = cone_density(light.one_minus_cos);
        return light.radiance;
    }
    if (HAS_DOME_TEXTURE && kind == LIGHT_DOME_MAP) {
        pdf = dome_density(light.map, w);
        return light.radiance * dome_color(light.map, w);
    }
    return light.radiance;
}

uint infinite_event(uint kind) {
    return kind == LIGHT_DISTANT ? EVENT_LIGHT : EVENT_DOME;
}

// The contribution of the lights at infinity to a ray that leaves the scene along d.
vec3 lights_at_infinity(vec3 d, PreviousVertex from) {
    vec3 sum = vec3(0.0);
    if (!HAS_INFINITE_LIGHTS) return sum;
    const float linked = linked_infinite(from.link_set);
    const float far = 1.0 - local_share(linked, from.receiver);
    for (uint i = 0u; i < LIGHTING.infinite_count; ++i) {
        const GpuInfiniteLight light = load_infinite_light(i);
        const uint kind = light_kind(light.flags);
        if (!is_linked(light.light_link, from.link_set)) continue;
        if (from.pdf > 0.0 && is_shadow_only(light.flags)) continue;
        float pdf;
        turn_infinite_light(i);
        vec3 radiance = infinite_radiance(light, into_light_frame(d), pdf);
        const float chosen = far * light.probability / linked;
        // A constant dome is sampled by the BSDF, delta lobes included.
        float weight = ray_weight(from.pdf, chosen * pdf);
        const bool whole = is_shadow_only(light.flags) || shadow_rays_alone();
        if (kind == LIGHT_DOME) weight = whole ? 1.0 : 1.0 / (1.0 + chosen);
        radiance *= weight;
        const bool asked = kind == LIGHT_DOME ? !is_shadow_only(light.flags) : weight < 1.0;
        const vec3 shown = radiance * brought_by_ray(light.diffuse, light.specular, from, asked);
        sum += shown;
        if (HAS_PATH_EXPRESSIONS) {
            add_light_part(infinite_event(kind), AUTOMATON.infinite_labels, i, light.diffuse, light.specular, shown,
                           asked && weight < 1.0);
        }
    }
    return sum;
}

// Radiance of the domes that the camera sees.
vec3 domes_behind(vec3 d) {
    vec3 sum = vec3(0.0);
    for (uint i = 0u; i < LIGHTING.infinite_count; ++i) {
        const GpuInfiniteLight light = load_infinite_light(i);
        if (light_kind(light.flags) == LIGHT_DISTANT || (light.flags & LIGHT_CAMERA_VISIBLE) == 0u) continue;
        float pdf;
        turn_infinite_light(i);
        const vec3 radiance = infinite_radiance(light, into_light_frame(d), pdf);
        sum += radiance;
        if (HAS_PATH_EXPRESSIONS) add_light_part(EVENT_DOME, AUTOMATON.infinite_labels, i, 1.0, 1.0, radiance, false);
    }
    return sum;
}

#endif
