// SPDX-License-Identifier: Apache-2.0
// Pictures of domes: directions to picture and back, and sampling by inverting the distribution of rows, then of the
// cells of a row: the map is monotone in each number, so that well spread numbers give well spread directions (as
// PBRT's PiecewiseConstant2D; an alias table scatters them). A guide makes the inversion a few steps (Chen and Asau
// 1974).
//
// Layout as OpenEXR's latitude-longitude maps, which UsdLux names: +y is the top, +z the middle, +x a quarter from the
// left.
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
    const GpuCdf cell = Cdfs(map.cells).v[row * map.columns + column];
    return cell.density / (2.0 * PI * PI * dome_sine(d.y));
}

// The entry of `count` from `first` that contains u; u becomes the position in it. The result does not depend on the
// guide, which only makes it faster.
uint invert_cdf(uint64_t cells, uint first, uint count, inout float u) {
    const uint step = min(uint(u * float(count)), count - 1u);
    uint low = Cdfs(cells).v[first + step].guide;
    uint high = step + 1u < count ? Cdfs(cells).v[first + step + 1u].guide : count - 1u;
    while (low < high) {
        const uint middle = (low + high + 1u) / 2u;
        if (Cdfs(cells).v[first + middle].start <= u) {
            low = middle;
        } else {
            high = middle - 1u;
        }
    }
    // The product u * count may have rounded across a step.
    while (low > 0u && Cdfs(cells).v[first + low].start > u) --low;
    const float begin = Cdfs(cells).v[first + low].start;
    const float end = low + 1u < count ? Cdfs(cells).v[first + low + 1u].start : 1.0;
    u = clamp((u - begin) / (end - begin), 0.0, 0.99999994);
    return low;
}

// A direction, from two random numbers.
vec3 sample_dome(uint index, vec2 u) {
    const GpuLightMap map = load_light_map(index);
    const uint row = invert_cdf(map.cells, map.columns * map.rows, map.rows, u.y);
    const uint column = invert_cdf(map.cells, map.columns * row, map.columns, u.x);
    const vec2 st = (vec2(column, row) + u) / vec2(map.columns, map.rows);
    const float longitude = (0.5 - st.x) * (2.0 * PI);
    const float theta = st.y * PI;
    const float radius = sin(theta);
    return from_dome(map, vec3(radius * sin(longitude), cos(theta), radius * cos(longitude)));
}

#endif
