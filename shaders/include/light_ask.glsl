// SPDX-License-Identifier: Apache-2.0
// Which light a shadow ray asks, where, and what it brings (Features::LIGHT_TABLE): see light_sample.glsl for the strategies that the
// densities are weighed against.
#ifndef OOCPT_LIGHT_ASK_GLSL
#define OOCPT_LIGHT_ASK_GLSL

// A shadow ray to be: `contribution` leaves out the path's throughput; 0: nothing to ask. Until ask_light has looked at the BSDF it
// leaves that out too, and the members below say how it comes in.
struct Ask {
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
    float diffuse; // the light's multipliers
    float specular;
};

Ask no_ask() {
    return Ask(vec3(0.0), INFINITE, vec3(0.0), 0u, 0u, 0u, 0.0, 1.0, false, false, false, 1.0, 1.0);
}

// BSDF times cosine with the light's multipliers; `pdf` of the BSDF's own sampling.
vec3 reflected(Bsdf bsdf, vec3 wo, vec3 wi, float diffuse, float specular, out float pdf) {
    if (!HAS_LIGHT_LOBES || diffuse == specular) {
        const vec4 value = bsdf_evaluate(bsdf, wo, wi);
        pdf = value.w;
        return value.xyz * diffuse;
    }
    vec3 d, s;
    bsdf_evaluate_lobes(bsdf, wo, wi, d, s, pdf);
    return d * diffuse + s * specular;
}

// Share of the BSDF's value that is diffuse, by colour. Not asked for where every light has one multiplier for both.
vec3 diffuse_share(Bsdf bsdf, vec3 wo, vec3 wi, float pdf) {
    if (!HAS_LIGHT_LOBES || !(pdf > 0.0)) return vec3(0.0);
    vec3 d, s;
    float unused;
    bsdf_evaluate_lobes(bsdf, wo, wi, d, s, unused);
    const vec3 all = d + s;
    return vec3(all.x > 0.0 ? d.x / all.x : 0.0, all.y > 0.0 ? d.y / all.y : 0.0, all.z > 0.0 ? d.z / all.z : 0.0);
}

// `share`: probability of asking a local light.
Ask ask_local(Double3 origin, uint link_set, Receiver receiver, vec4 u, bool last, float share) {
    Ask ask = no_ask();
    uint index;
    float chosen;
    if (!choose_local_light(receiver, u.x, u.w, index, chosen)) return ask;
    chosen *= share;
    const GpuLocalLight light = load_local_light(index);
    if (!is_linked(light.light_link, link_set)) return ask;
    const uint kind = light_kind(light.flags);
    const vec3 place = difference(origin, Double3(light.position, light.position_lo));
    const vec3 o = apply_rows(light.row_x, light.row_y, light.row_z, place);
    vec3 q;
    if (!shape_point(kind, o, u.yz, q)) return ask;
    const vec3 towards = light.x * q.x + light.y * q.y + light.z * q.z - place;
    const float distance = sqrt(dot3(towards, towards));
    if (!(distance > 0.0)) return ask;
    ask.direction = towards / distance;
    ask.distance = distance * SHADOW_END;
    ask.flags = light.flags;
    ask.shadow_color = light.shadow_color;
    ask.shadow_link = light.shadow_link;
    ask.diffuse = light.diffuse;
    ask.specular = light.specular;
    ask.contribution = local_emission(light, q, -ask.direction);
    ask.thin = is_thin(kind);
    if (ask.thin) {
        ask.scale = 1.0 / (distance * distance * chosen);
        if (kind == LIGHT_LINE) {
            const float half_length = sqrt(dot3(light.x, light.x));
            const vec3 across = cross3(light.x / half_length, ask.direction);
            ask.scale *= 2.0 * half_length * sqrt(dot3(across, across));
        }
        return ask;
    }
    const vec3 d = apply_rows(light.row_x, light.row_y, light.row_z, ask.direction);
    ask.density = chosen * shape_density(kind, light.determinant, o, d, q, distance);
    ask.weighs = !(last || is_shadow_only(light.flags));
    return ask;
}

// The light at infinity that u in [0, 1) falls on, of those that shine on the set; `linked` is the sum of their probabilities.
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

// `whole`: the contribution holds the BSDF already.
Ask ask_infinite(Bsdf bsdf, vec3 wo, uint link_set, float linked, vec4 u, bool last, out bool whole) {
    whole = false;
    Ask ask = no_ask();
    const GpuInfiniteLight light = load_infinite_light(choose_infinite(u.x, link_set, linked));
    const uint kind = light_kind(light.flags);
    const float chosen = (1.0 - LIGHTING.local_share) * light.probability / linked;
    ask.flags = light.flags;
    ask.shadow_color = light.shadow_color;
    ask.shadow_link = light.shadow_link;
    ask.diffuse = light.diffuse;
    ask.specular = light.specular;
    const bool alone = last || is_shadow_only(light.flags);
    if (HAS_DOME_SHADOW_RAYS && kind == LIGHT_DOME) {
        whole = true;
        vec3 weight;
        float pdf;
        if (!bsdf_sample(bsdf, wo, u.yzwx, ask.direction, weight, pdf)) return ask;
        if (HAS_LIGHT_LOBES && light.diffuse != light.specular) {
            weight *= multiplied(light.diffuse, light.specular, diffuse_share(bsdf, wo, ask.direction, pdf));
        } else {
            weight *= light.diffuse;
        }
        // Delta lobes of shadow-only lights are left to the rays.
        if (pdf > 0.0 || !alone) ask.contribution = light.radiance * weight / (alone ? chosen : 1.0 + chosen);
        return ask;
    }
    ask.density = chosen;
    ask.contribution = light.radiance;
    const bool is_map = HAS_DOME_TEXTURE && kind == LIGHT_DOME_MAP;
    const bool is_direction = !is_map && light.one_minus_cos <= 0.0;
    if (is_map) {
        // Where no light is to be chosen the first number is free: the first two are the best spread.
        ask.direction = sample_dome(light.map, LIGHTING.infinite_count == 1u ? u.xy : u.yz);
        ask.density *= dome_density(light.map, ask.direction);
        ask.contribution *= dome_color(light.map, ask.direction);
    } else if (is_direction) {
        ask.direction = light.direction;
    } else {
        ask.direction = sample_cone(light.direction, light.one_minus_cos, u.yz);
        ask.density *= cone_density(light.one_minus_cos);
    }
    ask.weighs = !(alone || is_direction);
    return ask;
}

// The point that was chosen on a mesh light.
MeshLightPoint ask_point;

// A mesh light.
Ask ask_mesh(Double3 origin, Receiver receiver, vec4 u, vec4 u_mesh, bool last, float share) {
    Ask ask = no_ask();
    if (!sample_mesh_light(receiver, origin, u, u_mesh, share, ask_point)) return ask;
    ask.of_mesh = true;
    ask.direction = ask_point.direction;
    ask.distance = ask_point.reach;
    ask.contribution = ask_point.emission;
    ask.density = ask_point.density;
    ask.weighs = !last;
    return ask;
}

// A light near by: a lamp or a mesh. `share`: probability of asking one.
Ask ask_near(Double3 origin, uint link_set, Receiver receiver, vec4 u, vec4 u_mesh, bool last, float share) {
    if (!HAS_MESH_LIGHTS) return ask_local(origin, link_set, receiver, u, last, share);
    const float first = mesh_light_first(receiver);
    if (first < 0.0) return no_ask();
    if (HAS_LOCAL_LIGHTS && u.x < first) {
        u.x = min(u.x / first, 0.99999994);
        return ask_local(origin, link_set, receiver, u, last, share * first);
    }
    u.x = min((u.x - first) / (1.0 - first), 0.99999994);
    return ask_mesh(origin, receiver, u, u_mesh, last, share * (1.0 - first));
}

// One light for a shadow ray. `last`: no ray follows that could meet the lights, so shadow rays bring all of it. `u_mesh` counts with
// HAS_MESH_LIGHTS. The BSDF is evaluated in one place for all lights: it is the largest part of this code.
Ask ask_light(Bsdf bsdf, vec3 wo, Double3 origin, uint link_set, Receiver receiver, vec4 u, vec4 u_mesh, bool last) {
    const float linked = linked_infinite(link_set);
    const float near = HAS_LOCAL_LIGHTS || HAS_MESH_LIGHTS ? local_share(linked) : 0.0;
    Ask ask = no_ask();
    bool whole = false;
    if ((HAS_LOCAL_LIGHTS || HAS_MESH_LIGHTS) && u.x < near) {
        u.x = min(u.x / near, 0.99999994);
        ask = ask_near(origin, link_set, receiver, u, u_mesh, last, near);
    } else if (LIGHTING.infinite_count != 0u && linked > 0.0) {
        u.x = min((u.x - near) / (1.0 - near), 0.99999994);
        ask = ask_infinite(bsdf, wo, link_set, linked, u, last, whole);
    }
    const bool is_looked_up = HAS_MESH_LIGHT_VALUES && ask.of_mesh;
    if (whole || !(max_component(ask.contribution) > 0.0 || is_looked_up)) return ask;
    float density;
    const vec3 f = reflected(bsdf, wo, ask.direction, ask.diffuse, ask.specular, density);
#ifdef OOCPT_MATERIAL_GLSL
    if (is_looked_up && max_component(f) > 0.0) ask.contribution = point_emission(ask_point, density);
#endif
    if (ask.thin) {
        ask.contribution = ask.contribution * f * ask.scale;
    } else {
        ask.contribution *= f / (ask.weighs ? ask.density + density : ask.density);
    }
    return ask;
}

#endif
