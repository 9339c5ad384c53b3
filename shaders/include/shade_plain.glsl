// SPDX-License-Identifier: Apache-2.0
// Shading of scenes without materials whose lights are constant domes and distant lights only (no
// Features::LIGHT_TABLE).
#ifndef OOCPT_SHADE_PLAIN_GLSL
#define OOCPT_SHADE_PLAIN_GLSL

// Chooses a light and a direction; `contribution` excludes throughput and albedo, and is 0 when there is nothing to
// ask. `last`: no ray follows that could meet the lights, so shadow rays bring all of it.
void sample_light(Lambert lambert, vec4 u, bool last, out vec3 direction, out vec3 contribution) {
    direction = lambert.g;
    contribution = vec3(0.0);
    const float dome = last || HAS_DOME_SHADOW_RAYS ? dome_probability() : 0.0;
    if (HAS_DOME && u.x < dome) {
        direction = lambert_sample(lambert, u.yz);
        contribution = FRAME.dome_radiance / (last ? dome : 1.0 + dome);
        return;
    }
    if (!HAS_DISTANT || FRAME.light_count == 0u) return;
    const GpuDistantLight light = load_light(choose_distant(min((u.x - dome) / (1.0 - dome), 0.99999994)));
    const float chosen = (1.0 - dome) * light.probability;
    if (light.one_minus_cos <= 0.0) {
        direction = light.direction;
        contribution = light.radiance * (lambert_density(lambert, direction) / chosen);
        return;
    }
    direction = sample_cone(light.direction, light.one_minus_cos, u.yz);
    const float density = lambert_density(lambert, direction);
    const float own = chosen * cone_density(light.one_minus_cos);
    contribution = light.radiance * (density / (last ? own : own + density));
}

// Shades a hit: `ask` tells that a shadow ray was stored, `go_on` that the next ray was.
void shade_plain(uint path, out bool ask, out bool go_on) {
    ask = false;
    go_on = false;
    const Ray ray = load_ray(ray_address(path));
    const Surface surface = load_surface(path);
    const Lambert lambert = make_lambert(surface.geometric_normal, surface.shading_normal, ray.d);
    const Double3 origin = add(surface.position, surface.offset * lambert.g);
    const bool last = ray.bounce >= FRAME.max_bounces;
    if (ray.bounce == 0u) Vec4s(FRAME.radiance).v[path] = vec4(0.0, 0.0, 0.0, 1.0);

    const uvec2 pixel = pixel_position(path_pixel(path));
    const uint seed = pixel_seed(pixel.x, pixel.y, path_seed(path));
    const uint index = path_sample(path);
    const vec3 throughput = load_path(path).throughput * surface.albedo;

    if (HAS_DISTANT || last || HAS_DOME_SHADOW_RAYS) {
        vec3 direction, contribution;
        sample_light(lambert, sample_4d(index, 2u + 2u * ray.bounce, seed), last, direction, contribution);
        contribution = clamp_contribution(throughput * contribution, ray.bounce > 0u);
        ask = max_component(contribution) > 0.0;
        if (ask) {
            const uint64_t to = shadow_ray_address(path);
            store_ray(to, Ray(origin.hi, ray.bounce, direction, INFINITE, origin.lo, 0u));
            store_shadow_light(to, contribution, 0u);
        }
    }
    if (!last && max_component(throughput) > 0.0) {
        const vec4 u = sample_4d(index, 1u + 2u * ray.bounce, seed);
        const float survival = ray.bounce >= ROULETTE_FROM ? min(max_component(throughput), 1.0) : 1.0;
        const vec3 direction = lambert_sample(lambert, u.xy);
        const float density = lambert_density(lambert, direction);
        go_on = u.z < survival && density > 0.0;
        if (go_on) {
            store_path(path, PathState(throughput / survival, density));
            store_ray(ray_address(path), Ray(origin.hi, ray.bounce + 1u, direction, INFINITE, origin.lo, 0u));
        }
    }
}

#endif
