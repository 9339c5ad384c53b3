// SPDX-License-Identifier: Apache-2.0
// Shading of surfaces: any BSDF, any light.
//
// At each surface: the contribution of the lights that the ray has met on its way here (weighed against the shadow ray
// of the bounce before), one shadow ray, one BSDF ray. That holds for bounce max_bounces too, where the BSDF ray only
// looks for lights: shadow rays alone find nothing in a mirror and little in a nearly sharp lobe. Only Lambert ends
// there, with a shadow ray that accounts for all light.
#ifndef OOCPT_SHADE_GLSL
#define OOCPT_SHADE_GLSL

#include "wavefront/bounce_kinds.glsl"
#include "geometry/prim_masks.glsl"
#include "light/shadow_sums.glsl"

void add_radiance(uint path, vec3 value) {
    const vec4 before = ConstVec4s(FRAME.radiance).v[path];
    Vec4s(FRAME.radiance).v[path] = vec4(before.xyz + value, before.w);
}

// Adds the lights that the ray has met before it came to the surface.
void add_met_lights(uint path, Ray ray, Surface surface, PathState state) {
    const Double3 origin = Double3(ray.o, ray.o_lo);
    const float t_end = dot3(difference(surface.position, origin), ray.d);
    const bool camera = ray.bounce == 0u;
    PreviousVertex from = PreviousVertex(Receiver(vec3(0.0), vec3(0.0)), 0u, vec3(0.0), 0.0);
    if (!camera) from = load_previous_vertex(path, ray.o, state.pdf);
    bool met;
    set_light_time(path);
    const vec3 lights = lights_along(origin, ray.d, t_end, camera, from, met);
    if (!met) return;
    // Behind a lamp there is no need to see through a matte.
    if (HAS_PRIM_MASKS && camera) Vec4s(FRAME.radiance).v[path].w = 1.0;
    const vec3 contribution = state.throughput * lights;
    const vec3 kept = clamp_contribution(path, contribution, ray.bounce > 1u);
    add_radiance(path, kept);
    if (HAS_PATH_EXPRESSIONS && begin_light_parts(path, ray.bounce, state.throughput, contribution, kept)) {
        lights_along(origin, ray.d, t_end, camera, from, met);
        end_light_parts();
    }
}

// A random number of the surface for settled_states: the fourth scramble of the path's set.
float settling_number(uint path, uint bounce) {
    const uvec2 pixel = pixel_position(path_pixel(path));
    const uint seed = pixel_seed(pixel.x, pixel.y, path_seed(path));
    return sample_4d(path_sample(path), 1u + 2u * bounce, hash_u32(seed + 3u)).x;
}

// With PATH_EXPRESSIONS: the states at the end of the shadow ray.
GpuPathStates shadow_states;

// Stores the shadow ray, or adds its contribution if nothing can be in its way. Returns true if there is a ray. That of
// a shadow catcher contributes nothing, but asks whether the light arrives.
bool store_shadow_ray(uint path, Double3 origin, uint bounce, LightSample ls, vec3 throughput, bool is_caught) {
    vec3 contribution = clamp_contribution(path, throughput * ls.contribution, bounce > 0u);
    if (!(max_component(contribution) > 0.0)) return false;
    // A mesh may be in its own way: its light is none of what shadows are told of.
    if (HAS_SHADOW_SUMS && bounce == 0u && !ls.of_mesh) ask_light(path, throughput * ls.unoccluded, is_caught);
    if (is_caught && ls.of_mesh) return false;
    if (is_caught) contribution = vec3(0.0);
    // A mesh may be in its own way: it keeps its shadows.
    if (HAS_PATH_EXPRESSIONS && ls.of_mesh) shadow_states.states.x |= STATES_OF_ALL;
    if (HAS_PATH_EXPRESSIONS && AUTOMATON.unoccluded != 0u && !ls.of_mesh && !is_caught) {
        const vec3 whole = clamp_contribution(path, throughput * ls.unoccluded, bounce > 0u);
        add_light_parts(path, shadow_states, whole, AUTOMATON.unoccluded);
    }
    if ((ls.flags & LIGHT_NO_SHADOWS) != 0u) {
        add_radiance(path, contribution);
        if (HAS_PATH_EXPRESSIONS) add_light_parts(path, shadow_states, contribution, parts_found(false));
        return false;
    }
    if (HAS_PATH_EXPRESSIONS) store_states(FRAME.shadow_states, path, shadow_states);
    const uint64_t to = shadow_ray_address(path);
    const uint linked = pack_shadow_bounce(bounce, ls.shadow_link);
    store_ray(to, Ray(origin.hi, linked, ls.direction, ls.distance, origin.lo, 0u));
    store_shadow_light(to, contribution, ls.shadow_color);
    return true;
}

// Weight of the emission of a mesh that the ray has met, against the shadow ray of the bounce before.
vec3 emission_share(uint path, Ray ray, Surface surface, float pdf) {
    brought_specular = false;
    if (ray.bounce == 0u || !(pdf > 0.0)) return vec3(1.0);
    set_light_time(path);
    const PreviousVertex from = load_previous_vertex(path, ray.o, pdf);
    const Double3 origin = Double3(ray.o, ray.o_lo);
    const float distance = dot3(difference(surface.position, origin), ray.d);
    const float facing = dot3(surface.geometric_normal, ray.d);
    const uint mesh = surface_material.flags >> SURFACE_MESH_SHIFT;
    const float share = local_share(linked_infinite(from.link_set), from.receiver);
    const float other = mesh_light_density(from.receiver, origin, share, uint(surface.prim_id), surface.instance_id,
                                           mesh, surface.face,
                                           surface_material.material, surface.geometric_normal, distance, facing);
    return ray_weight(pdf, other) * brought_by_ray(1.0, 1.0, from, other > 0.0);
}

// The offset from the hit on a tube of hair to the point where a direction through it leaves: where the normal of a
// tube a tenth thicker is that of the direction across the fibre. The BSDF includes the whole fibre, so its inside must
// not be met; a tenth is enough at joints of pieces that turn by up to 24 degrees. Other leaves have no inside.
vec3 way_around(const Bsdf bsdf, vec3 w, float offset) {
    const float radius = surface_material.handedness;
    if (!(radius > 0.0)) return -offset * bsdf.g;
    const vec3 across = w - bsdf.hair.x * dot3(bsdf.hair.x, w);
    return radius * (1.1 * normal_or(across, -bsdf.g) - bsdf.g);
}

// Whether the share of diffuse lobes in what a surface has scattered is used.
const bool KEEPS_SHARES = HAS_LIGHT_LOBES || HAS_PATH_EXPRESSIONS || HAS_PRIM_MASKS;

// Shades a hit: `asks` is set if a shadow ray was stored, `go_on` if the next ray was.
void shade(uint path, out bool asks, out bool go_on) {
    asks = false;
    go_on = false;
    const Ray ray = load_ray(ray_address(path));
    const Surface surface = load_surface(path);
    PathState state = load_path(path);
    const vec3 arrived = state.throughput;
    if (HAS_CUTOUTS && HAS_TEXTURES) store_next_cone(path, surface.cone, 0.0);
    const uint mask = HAS_PRIM_MASKS && ray.bounce == 0u ? prim_mask(surface.prim_id) : 0u;
    const bool is_unseen = (mask & (PRIM_MATTE | PRIM_SHADOW_CATCHER)) != 0u;
    const bool is_caught = HAS_SHADOW_SUMS && is_unseen && (mask & PRIM_MATTE) == 0u;
    if (ray.bounce == 0u) Vec4s(FRAME.radiance).v[path] = vec4(0.0, 0.0, 0.0, is_unseen ? 0.0 : 1.0);
    if (HAS_PATH_EXPRESSIONS && ray.bounce == 0u) clear_light_parts(path);
    if (HAS_SHADOW_SUMS && ray.bounce == 0u) clear_shadow_values(path);
    if (HAS_LOCAL_LIGHTS) add_met_lights(path, ray, surface, state);
    if (is_unseen && !is_caught) return;
    if (is_caught && FRAME.catcher_at != NO_INDEX) {
        // Where a lamp before it is seen there is no need to see a shadow.
        if (ConstVec4s(FRAME.radiance).v[path].w > 0.0) return;
        meet_catcher(path);
    }
    const uint kinds = path_kinds(path, ray.bounce);
    const bool only_lights = only_looks_for_lights(ray.bounce, kinds);
    if (only_lights && !HAS_EMISSION) return;

    uint missing;
    Shading shading = make_shading(path, surface, missing);
    if (HAS_ABSORPTION && dot3(surface.geometric_normal, ray.d) > 0.0) {
        // The way inside ends here (Beer and Lambert).
        const float way = dot3(difference(surface.position, Double3(ray.o, ray.o_lo)), ray.d);
        state.throughput *= exp(-shading.absorption * max(way, 0.0));
    }
    if (HAS_EMISSION && !is_caught && max_component(shading.emission) > 0.0) {
        vec3 weight = vec3(1.0);
        if (HAS_MESH_LIGHTS) weight = emission_share(path, ray, surface, state.pdf);
        // As for other lights, light that shadow rays could find at bounce 0 is direct.
        const vec3 emitted = clamp_contribution(path, state.throughput * (shading.emission * weight),
                                                ray.bounce > (HAS_MESH_LIGHTS ? 1u : 0u));
        add_radiance(path, emitted);
        if (HAS_PATH_EXPRESSIONS) {
            GpuPathStates states = path_states(path, ray.bounce);
            if (brought_specular) states.share = vec3(0.0);
            add_light_parts(path, states_at_light(states, EVENT_SURFACE,
                                                  prim_label(surface.prim_id)), emitted, parts_found(true));
        }
    }
    if (only_lights) return;
    if (HAS_DISPERSION) state.throughput *= disperse(path, arrived, shading);
    const vec3 wo = -ray.d;
    const Bsdf bsdf = make_bsdf(shading, wo);
    const vec3 normal = bsdf_normal(bsdf);
    const Double3 origin = add(surface.position, surface.offset * normal);
    const bool last = ends_paths(bsdf, ray.bounce, kinds);
    const uvec2 pixel = pixel_position(path_pixel(path));
    const uint seed = pixel_seed(pixel.x, pixel.y, path_seed(path));
    const uint index = path_sample(path);
    const uint link_set = prim_link_set(surface.prim_id);
    const uint packed_normal = HAS_BEYOND ? NO_INDEX : pack_normal(normal);

    // Transmitted rays leave on the other side.
    const Double3 beyond = HAS_BEYOND ? add(surface.position, -surface.offset * normal) : origin;
    LightSample ls = sample_one_light(path, ray.bounce, bsdf, wo, origin, link_set, packed_normal, last, surface.cone);
    const vec4 u = sample_4d(index, 1u + 2u * ray.bounce, seed);
    vec3 wi, weight;
    float pdf;
    bool evaluates = false;
    bool is_sampled = !last && !is_caught && bsdf_choose(bsdf, wo, u, wi, weight, pdf, evaluates);
    // A lobe sampled together with its density is Lambert; one without a density is sharp.
    vec3 share = vec3(0.0);
    if (KEEPS_SHARES && is_sampled && !evaluates && pdf > 0.0) share = vec3(1.0);
    // The light's direction and the next ray's share one copy of the BSDF's code, which is the largest part of this
    // pass.
    [[dont_unroll]] for (uint i = 0u; i < 2u; ++i) {
        if (i == 0u ? !needs_bsdf(ls) : !evaluates) continue;
        vec3 direction = wi;
        if (i == 0u) direction = ls.direction;
        vec3 diffuse, specular;
        float density;
        bsdf_evaluate_lobes(bsdf, wo, direction, diffuse, specular, density);
        if (i == 0u) {
            finish_light_sample(ls, diffuse, specular, density);
        } else {
            pdf = density;
            is_sampled = bsdf_weigh(diffuse + specular, density, weight);
            if (KEEPS_SHARES && density > 0.0) share = diffuse_share(diffuse, specular);
        }
    }
    const bool asks_beyond = HAS_BEYOND && dot(ls.direction, normal) < 0.0;
    Double3 ask_from = origin;
    if (asks_beyond) ask_from = beyond;
    if (asks_beyond && is_hair(bsdf)) {
        const vec3 shift = way_around(bsdf, ls.direction, surface.offset);
        ask_from = add(surface.position, shift);
        if (ls.distance < INFINITE) {
            // The end of the shadow ray stays where it is.
            const vec3 rest = ls.distance * ls.direction - shift;
            ls.distance = sqrt(dot3(rest, rest));
            ls.direction = normal_or(rest, ls.direction);
        }
    }
    uvec3 states = uvec3(0u);
    uint label = 0u;
    if (HAS_PATH_EXPRESSIONS) {
        states = settled_states(path_states(path, ray.bounce), settling_number(path, ray.bounce));
        label = prim_label(surface.prim_id);
        shadow_states = states_at_light(scattered_states(states, asks_beyond, sampled_sharp, label, sampled_share),
                                        sampled_event, sampled_label);
    }
    asks = store_shadow_ray(path, ask_from, ray.bounce, ls, state.throughput, is_caught);
    if (!is_sampled) return;

    const vec3 throughput = state.throughput * weight;
    const float largest = max_component(throughput);
    const float survival = ray.bounce >= ROULETTE_FROM ? min(largest, 1.0) : 1.0;
    go_on = largest > 0.0 && u.w < survival && is_finite(throughput);
    if (!go_on) return;
    store_path(path, PathState(throughput / survival, pdf));
    if (HAS_TEXTURES) store_next_cone(path, surface.cone, pdf);
    store_previous_vertex(path, packed_normal, link_set, share);
    const bool goes_beyond = HAS_BEYOND && dot(wi, normal) < 0.0;
    if (HAS_PATH_EXPRESSIONS) {
        store_states(FRAME.path_states, path, scattered_states(states, goes_beyond, !(pdf > 0.0), label, share));
    }
    uint kind = 0u;
    if (HAS_BOUNCE_KINDS || HAS_PRIM_MASKS) kind = bounce_kind(bsdf, u.z, goes_beyond);
    if (HAS_BOUNCE_KINDS) count_bounce(path, kind, kinds);
    Double3 from = origin;
    if (goes_beyond) from = beyond;
    if (goes_beyond && is_hair(bsdf)) from = add(surface.position, way_around(bsdf, wi, surface.offset));
    const uint bounce = pack_ray_bounce(ray.bounce + 1u, PRIM_NO_DIFFUSE << kind);
    store_ray(ray_address(path), Ray(from.hi, bounce, wi, INFINITE, from.lo, 0u));
}

#endif
