// SPDX-License-Identifier: Apache-2.0
// Samples a light for a shadow ray: which one, which point, and its contribution. light/sample.glsl lists the
// strategies that the densities are weighed against.
#ifndef OOCPT_LIGHT_SAMPLING_GLSL
#define OOCPT_LIGHT_SAMPLING_GLSL

#include "material/dispersion.glsl"
#include "wavefront/bounce_kinds.glsl"

// Whether light samples keep their light without the weight.
const bool KEEPS_UNOCCLUDED = HAS_PATH_EXPRESSIONS || HAS_SHADOW_SUMS;

// A candidate for a shadow ray. `contribution` leaves out the path's throughput; 0: nothing to trace. Until
// finish_light_sample has evaluated the BSDF it leaves that out too, and the members below tell how it comes in.
struct LightSample {
    vec3 direction;
    float distance;
    vec3 contribution;
    uint flags; // of the light
    uint shadow_color;
    uint shadow_link;
    float density; // of the direction
    float scale; // of a thin light's intensity, in place of a density
    bool thin;
    bool of_mesh;
    bool weighs; // against a ray of the BSDF
    bool whole; // `contribution` holds the BSDF already
    float diffuse; // the light's multipliers
    float specular;
    vec3 unoccluded; // with KEEPS_UNOCCLUDED: `contribution` without the weight against the BSDF's ray
};

LightSample no_light_sample() {
    return LightSample(vec3(0.0), INFINITE, vec3(0.0), 0u, 0u, 0u, 0.0, 1.0, false, false, false, false, 1.0, 1.0,
                       vec3(0.0));
}

// With HAS_SHADOW_REACH: a random number of the shadow ray's own, in [0, 1).
float reach_u = 0.0;

// The end of the shadow ray of light `index` of those at `reaches`. At distance t a shadow exists with the share ((d -
// t) / f)^gamma of its strength, at most 1: the probability that a ray of the length d - f u^(1 / gamma) gets as far as
// t. The first occluder decides alone, as the share is largest there.
float shadow_end(uint64_t reaches, uint index, float end) {
    if (!HAS_SHADOW_REACH) return end;
    const vec4 reach = ConstVec4s(reaches).v[index];
    const float faded = reach.y > 0.0 ? reach.y * pow(reach_u, reach.z) : 0.0;
    return min(end, reach.x - faded);
}

// Share of the BSDF's value that is diffuse, by colour. Not needed if every light has one multiplier for both.
vec3 diffuse_share(vec3 diffuse, vec3 specular) {
    const vec3 all = diffuse + specular;
    return vec3(all.x > 0.0 ? diffuse.x / all.x : 0.0, all.y > 0.0 ? diffuse.y / all.y : 0.0,
                all.z > 0.0 ? diffuse.z / all.z : 0.0);
}

// `share`: probability of choosing a local light.
LightSample sample_local_light(Double3 origin, uint link_set, Receiver receiver, vec4 u, bool last, float share) {
    LightSample ls = no_light_sample();
    uint index;
    float chosen;
    if (!choose_local_light(receiver, u.x, u.w, index, chosen)) return ls;
    chosen *= share;
    const GpuLocalLight light = load_local_light(index);
    if (!is_linked(light.light_link, link_set)) return ls;
    const uint kind = light_kind(light.flags);
    const vec3 place = difference(origin, Double3(light.position, light.position_lo));
    const vec3 o = apply_rows(light.row_x, light.row_y, light.row_z, place);
    vec3 q;
    if (!shape_point(kind, o, u.yz, q)) return ls;
    const vec3 towards = light.x * q.x + light.y * q.y + light.z * q.z - place;
    const float distance = sqrt(dot3(towards, towards));
    if (!(distance > 0.0)) return ls;
    ls.direction = towards / distance;
    ls.distance = shadow_end(LIGHTING.local_reaches, index, distance * SHADOW_END);
    ls.flags = light.flags;
    ls.shadow_color = light.shadow_color;
    ls.shadow_link = light.shadow_link;
    ls.diffuse = light.diffuse;
    ls.specular = light.specular;
    if (HAS_PATH_EXPRESSIONS) {
        sampled_event = EVENT_LIGHT;
        sampled_label = ConstUints(AUTOMATON.local_labels).v[index];
    }
    ls.contribution = local_emission(light, q, -ls.direction);
    ls.thin = is_thin(kind);
    if (ls.thin) {
        ls.scale = 1.0 / (distance * distance * chosen) * thin_length(kind, light, ls.direction);
        return ls;
    }
    const vec3 d = apply_rows(light.row_x, light.row_y, light.row_z, ls.direction);
    ls.density = chosen * shape_density(kind, light.determinant, o, d, q, distance);
    ls.weighs = !(last || is_shadow_only(light.flags));
    return ls;
}

// The light at infinity that u in [0, 1) selects among those that shine on the set; `linked` is the sum of their
// probabilities.
uint choose_infinite(float u, uint link_set, float linked) {
    if (HAS_LIGHT_LINKS) {
        float rest = u * linked;
        uint found = 0u;
        for (uint i = 0u; i < LIGHTING.infinite_count; ++i) {
            if (!is_linked(InfiniteLights(LIGHTING.infinite_lights).v[i].light_link, link_set)) continue;
            found = i;
            rest -= InfiniteLights(LIGHTING.infinite_lights).v[i].probability;
            if (rest < 0.0) break;
        }
        return found;
    }
    uint low = 0u;
    uint high = LIGHTING.infinite_count - 1u;
    while (low < high) {
        const uint middle = (low + high) / 2u;
        if (u < InfiniteLights(LIGHTING.infinite_lights).v[middle].cumulative) {
            high = middle;
        } else {
            low = middle + 1u;
        }
    }
    return low;
}

// `share`: probability of choosing a light at infinity.
LightSample sample_infinite_light(const Bsdf bsdf, vec3 wo, uint link_set, float linked, vec4 u, bool last,
                                  float share) {
    LightSample ls = no_light_sample();
    const uint index = choose_infinite(u.x, link_set, linked);
    const GpuInfiniteLight light = load_infinite_light(index);
    const uint kind = light_kind(light.flags);
    const float chosen = share * light.probability / linked;
    ls.distance = shadow_end(LIGHTING.infinite_reaches, index, INFINITE);
    ls.flags = light.flags;
    ls.shadow_color = light.shadow_color;
    ls.shadow_link = light.shadow_link;
    ls.diffuse = light.diffuse;
    ls.specular = light.specular;
    if (HAS_PATH_EXPRESSIONS) {
        sampled_event = infinite_event(kind);
        sampled_label = ConstUints(AUTOMATON.infinite_labels).v[index];
    }
    const bool alone = last || is_shadow_only(light.flags);
    if (HAS_DOME_SHADOW_RAYS && kind == LIGHT_DOME) {
        ls.whole = true;
        vec3 weight;
        float pdf;
        if (!bsdf_sample(bsdf, wo, u.yzwx, ls.direction, weight, pdf)) return ls;
        if (HAS_LIGHT_LOBES && light.diffuse != light.specular) {
            vec3 d = vec3(0.0), s = vec3(0.0);
            float unused;
            if (pdf > 0.0) bsdf_evaluate_lobes(bsdf, wo, ls.direction, d, s, unused);
            weight *= multiplied(light.diffuse, light.specular, diffuse_share(d, s));
        } else {
            weight *= light.diffuse;
        }
        if (HAS_PATH_EXPRESSIONS) {
            sampled_sharp = !(pdf > 0.0);
            vec3 d = vec3(0.0), s = vec3(0.0);
            float unused;
            if (pdf > 0.0) bsdf_evaluate_lobes(bsdf, wo, ls.direction, d, s, unused);
            sampled_share = diffuse_share(d * light.diffuse, s * light.specular);
        }
        // Delta lobes of shadow-only lights are left to the rays.
        if (shadow_rays_alone() && !alone) {
            // Of what other lobes than diffuse ones scatter the ray brings all.
            vec3 d = vec3(0.0), s = vec3(0.0);
            float unused;
            if (pdf > 0.0) bsdf_evaluate_lobes(bsdf, wo, ls.direction, d, s, unused);
            ls.contribution = light.radiance * weight * diffuse_share(d * light.diffuse, s * light.specular) / chosen;
            if (HAS_PATH_EXPRESSIONS) sampled_share = vec3(1.0);
            ls.unoccluded = ls.contribution;
            return ls;
        }
        if (pdf > 0.0 || !alone) ls.contribution = light.radiance * weight / (alone ? chosen : 1.0 + chosen);
        if (KEEPS_UNOCCLUDED && (pdf > 0.0 || !alone)) ls.unoccluded = light.radiance * weight / chosen;
        return ls;
    }
    ls.density = chosen;
    ls.contribution = light.radiance;
    const bool is_map = HAS_DOME_TEXTURE && kind == LIGHT_DOME_MAP;
    const bool is_direction = HAS_DISTANT && !is_map && light.one_minus_cos <= 0.0;
    if (is_map) {
        // If no light has to be chosen the first number is free: the first two are the best distributed.
        ls.direction = sample_dome(light.map, LIGHTING.infinite_count == 1u ? u.xy : u.yz);
        ls.density *= dome_density(light.map, ls.direction);
        ls.contribution *= dome_color(light.map, ls.direction);
    } else if (is_direction) {
        ls.direction = light.direction;
    } else if (HAS_DISTANT) {
        ls.direction = sample_cone(light.direction, light.one_minus_cos, u.yz);
        ls.density *= cone_density(light.one_minus_cos);
    }
    turn_infinite_light(index);
    ls.direction = out_of_light_frame(ls.direction);
    ls.weighs = !(alone || is_direction);
    return ls;
}

// The point that was chosen on a mesh light.
MeshLightPoint mesh_point;

// Samples a mesh light.
LightSample sample_near_mesh(Double3 origin, Receiver receiver, vec4 u, vec4 u_mesh, bool last, float share) {
    LightSample ls = no_light_sample();
    if (!sample_mesh_light(receiver, origin, u, u_mesh, share, mesh_point)) return ls;
    ls.of_mesh = true;
    if (HAS_PATH_EXPRESSIONS) {
        sampled_event = EVENT_SURFACE;
        sampled_label = prim_label(int(load_mesh_light(mesh_point.light).prim_id));
    }
    ls.direction = mesh_point.direction;
    ls.distance = mesh_point.reach;
    ls.contribution = mesh_point.emission;
    ls.density = mesh_point.density;
    ls.weighs = !last;
    return ls;
}

// Samples a light with a place: a lamp or a mesh. `share`: probability of choosing one.
LightSample sample_near_light(Double3 origin, uint link_set, Receiver receiver, vec4 u, vec4 u_mesh, bool last,
                              float share) {
    if (!HAS_MESH_LIGHTS) return sample_local_light(origin, link_set, receiver, u, last, share);
    const float first = mesh_light_first(receiver);
    if (first < 0.0) return no_light_sample();
    if (HAS_LOCAL_LIGHTS && u.x < first) {
        u.x = min(u.x / first, 0.99999994);
        return sample_local_light(origin, link_set, receiver, u, last, share * first);
    }
    u.x = min((u.x - first) / (1.0 - first), 0.99999994);
    return sample_near_mesh(origin, receiver, u, u_mesh, last, share * (1.0 - first));
}

// Samples one light for a shadow ray, without the BSDF, which finish_light_sample multiplies in. `last`: no ray follows
// that could meet the lights, so shadow rays account for all of it. `u_mesh` counts with HAS_MESH_LIGHTS.
LightSample sample_light(const Bsdf bsdf, vec3 wo, Double3 origin, uint link_set, Receiver receiver, vec4 u,
                         vec4 u_mesh, bool last) {
    const float linked = linked_infinite(link_set);
    const float near = HAS_LOCAL_LIGHTS || HAS_MESH_LIGHTS ? local_share(linked, receiver) : 0.0;
    if ((HAS_LOCAL_LIGHTS || HAS_MESH_LIGHTS) && u.x < near) {
        u.x = min(u.x / near, 0.99999994);
        return sample_near_light(origin, link_set, receiver, u, u_mesh, last, near);
    }
    if (HAS_INFINITE_LIGHTS && LIGHTING.infinite_count != 0u && linked > 0.0) {
        u.x = min((u.x - near) / (1.0 - near), 0.99999994);
        return sample_infinite_light(bsdf, wo, link_set, linked, u, last, 1.0 - near);
    }
    return no_light_sample();
}

bool is_looked_up(LightSample ls) {
    return HAS_MESH_LIGHT_VALUES && ls.of_mesh;
}

// Returns true if finish_light_sample must be called.
bool needs_bsdf(LightSample ls) {
    return !ls.whole && (max_component(ls.contribution) > 0.0 || is_looked_up(ls));
}

// Multiplies in the BSDF's value towards the light, its diffuse and its specular part, and its density there.
void finish_light_sample(inout LightSample ls, vec3 diffuse, vec3 specular, float density) {
    const bool alike = !HAS_LIGHT_LOBES || ls.diffuse == ls.specular;
    const vec3 f = alike ? (diffuse + specular) * ls.diffuse : diffuse * ls.diffuse + specular * ls.specular;
    if (HAS_PATH_EXPRESSIONS) sampled_share = diffuse_share(diffuse * ls.diffuse, specular * ls.specular);
    if (is_looked_up(ls) && max_component(f) > 0.0) ls.contribution = point_emission(mesh_point, density);
    if (ls.thin) {
        ls.contribution = ls.contribution * f * ls.scale;
        ls.unoccluded = ls.contribution;
        return;
    }
    if (KEEPS_UNOCCLUDED) ls.unoccluded = ls.contribution * f / ls.density;
    if (shadow_rays_alone() && ls.weighs) {
        // All of what diffuse lobes scatter; the rest is weighed against the ray.
        const vec3 d = diffuse * ls.diffuse / ls.density;
        const vec3 s = specular * ls.specular / (ls.density + density);
        if (HAS_PATH_EXPRESSIONS) sampled_share = diffuse_share(d, s);
        ls.contribution *= d + s;
        return;
    }
    ls.contribution *= f / (ls.weighs ? ls.density + density : ls.density);
}

// Samples a light with the random numbers of the path for this bounce.
LightSample sample_one_light(uint path, uint bounce, const Bsdf bsdf, vec3 wo, Double3 origin, uint link_set,
                             uint packed_normal, bool last, float width) {
    const uvec2 pixel = pixel_position(path_pixel(path));
    const uint seed = pixel_seed(pixel.x, pixel.y, path_seed(path));
    const uint index = path_sample(path);
    const Receiver receiver = Receiver(origin.hi, unpack_normal(packed_normal));
    const vec4 u_light = sample_4d(index, 2u + 2u * bounce, seed);
    // Another scramble of the same set: mesh lights take more numbers than one has.
    vec4 u_mesh = vec4(0.0);
    if (HAS_MESH_LIGHTS) u_mesh = sample_4d(index, 2u + 2u * bounce, hash_u32(seed + 1u));
    // A third scramble of the same set.
    if (HAS_SHADOW_REACH) reach_u = sample_4d(index, 2u + 2u * bounce, hash_u32(seed + 2u)).x;
    set_light_time(path);
    ask_path = path;
    ask_width = width;
    ask_missing = TEXTURE_DONE;
    return sample_light(bsdf, wo, origin, link_set, receiver, u_light, u_mesh, last);
}

// With streaming, after make_shading: looks up the emission of the light that the surface will sample, as the lookup
// after those of its material. `missing`: TEXTURE_DONE, or the unit that it waits for.
void resolve_ask(uint path, Surface surface, Shading shading, out uint missing) {
    missing = TEXTURE_DONE;
    const Ray ray = load_ray(ray_address(path));
    const uint kinds = path_kinds(path, ray.bounce);
    if (LIGHTING.textured_mesh_lights == 0u || only_looks_for_lights(ray.bounce, kinds)) return;
    if (HAS_DISPERSION) disperse(path, load_path(path).throughput, shading);
    const vec3 wo = -ray.d;
    const Bsdf bsdf = make_bsdf(shading, wo);
    const vec3 normal = bsdf_normal(bsdf);
    const uint packed_normal = HAS_BEYOND ? NO_INDEX : pack_normal(normal);
    LightSample ls =
        sample_one_light(path, ray.bounce, bsdf, wo, add(surface.position, surface.offset * normal),
                         prim_link_set(surface.prim_id), packed_normal,
                         ends_paths(bsdf, ray.bounce, kinds), surface.cone);
    if (needs_bsdf(ls)) {
        vec3 diffuse, specular;
        float density;
        bsdf_evaluate_lobes(bsdf, wo, ls.direction, diffuse, specular, density);
        finish_light_sample(ls, diffuse, specular, density);
    }
    missing = ask_missing;
}

#endif
