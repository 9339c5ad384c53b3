// SPDX-License-Identifier: Apache-2.0
// Pictures of domes: directions to picture and back, and sampling by an alias table over cells (Vose 1991).
//
// Layout as OpenEXR's latitude-longitude maps, which UsdLux names: +y is the top, +z the middle, +x a quarter from the left.
#ifndef OOCPT_LIGHT_MAP_GLSL
#define OOCPT_LIGHT_MAP_GLSL

vec3 to_dome(GpuLightMap map, vec3 w) {
    return vec3(dot3(map.x, w), dot3(map.y, w), dot3(map.z, w));
}

vec3 from_dome(GpuLightMap map, vec3 d) {
    return combine_rows(map.x, map.y, map.z, d);
}

// Picture coordinates from the upper left.
vec2 dome_st(vec3 d) {
    const float longitude = d.x == 0.0 && d.z == 0.0 ? 0.0 : atan(d.x, d.z);
    return vec2(0.5 - longitude / (2.0 * PI), acos(clamp(d.y, -1.0, 1.0)) / PI);
}

GpuLightMap load_light_map(uint index) {
    return LightMaps(LIGHTING.maps).v[index];
}

vec3 dome_color(uint index, vec3 w) {
    return map_color(index, dome_st(to_dome(load_light_map(index), w)), true);
}

// Sine of the polar angle, bounded away from 0: densities stay finite at the poles.
float dome_sine(float y) {
    return max(sqrt(max((1.0 - y) * (1.0 + y), 0.0)), 1.0e-6);
}

// Density per solid angle with which sample_dome gives w.
float dome_density(uint index, vec3 w) {
    const GpuLightMap map = load_light_map(index);
    const vec3 d = to_dome(map, w);
    const vec2 st = dome_st(d);
    const uint column = min(uint(st.x * float(map.columns)), map.columns - 1u);
    const uint row = min(uint(st.y * float(map.rows)), map.rows - 1u);
    const GpuAlias cell = Aliases(map.alias).v[row * map.columns + column];
    return cell.density / (2.0 * PI * PI * dome_sine(d.y));
}

// A direction, from three random numbers: a cell of a grid, whether to take its alias, a place in it.
vec3 sample_dome(uint index, vec3 u) {
    const GpuLightMap map = load_light_map(index);
    const vec2 size = vec2(map.columns, map.rows);
    const vec2 at = u.xy * size;
    const uvec2 low = min(uvec2(at), uvec2(map.columns, map.rows) - 1u);
    uint cell = low.y * map.columns + low.x;
    const GpuAlias entry = Aliases(map.alias).v[cell];
    if (u.z >= entry.threshold) cell = entry.other;
    const vec2 corner = vec2(cell % map.columns, cell / map.columns);
    const vec2 st = (corner + clamp(at - vec2(low), 0.0, 0.99999994)) / size;
    const float longitude = (0.5 - st.x) * (2.0 * PI);
    const float theta = st.y * PI;
    const float radius = sin(theta);
    return from_dome(map, vec3(radius * sin(longitude), cos(theta), radius * cos(longitude)));
}

#endif
