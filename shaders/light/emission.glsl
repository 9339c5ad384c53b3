// SPDX-License-Identifier: Apache-2.0
// The emission of a light by direction: cone, focus, IES profile (UsdLuxShapingAPI), pictures.
#ifndef OOCPT_LIGHT_EMISSION_GLSL
#define OOCPT_LIGHT_EMISSION_GLSL


vec3 map_texel(uint64_t texels, uint format, uint at) {
    if (format == MAP_FLOAT) return ConstVec4s(texels).v[at].xyz;
    const uvec2 packed = uvec2(ConstUints(texels).v[2u * at], ConstUints(texels).v[2u * at + 1u]);
    return vec3(unpackHalf2x16(packed.x), unpackHalf2x16(packed.y).x);
}

// Bilinear; st from the upper left of the picture. `around`: the left edge meets the right one.
vec3 map_color(uint index, vec2 st, bool around) {
    const GpuLightMap map = LightMaps(LIGHTING.maps).v[index];
    const vec2 size = vec2(map.width, map.height);
    const vec2 at = st * size - 0.5;
    const vec2 low = floor(at);
    const vec2 f = at - low;
    const ivec2 last = ivec2(map.width, map.height) - 1;
    ivec2 a = ivec2(low);
    ivec2 b = a + 1;
    if (around) {
        if (a.x < 0) a.x += int(map.width);
        if (b.x > last.x) b.x -= int(map.width);
    }
    a = clamp(a, ivec2(0), last);
    b = clamp(b, ivec2(0), last);
    const uint top = uint(a.y) * map.width;
    const uint bottom = uint(b.y) * map.width;
    const vec3 above = mix(map_texel(map.texels, map.format, top + uint(a.x)),
                           map_texel(map.texels, map.format, top + uint(b.x)), f.x);
    const vec3 below =
        mix(map_texel(map.texels, map.format, bottom + uint(a.x)),
            map_texel(map.texels, map.format, bottom + uint(b.x)), f.x);
    return mix(above, below, f.y);
}

// Index and fraction of x among `count` growing numbers.
uint find_interval(ConstFloats values, uint first, uint count, float x, out float fraction) {
    uint low = 0u;
    uint high = count;
    while (low + 1u < high) {
        const uint middle = (low + high) / 2u;
        if (values.v[first + middle] <= x) {
            low = middle;
        } else {
            high = middle;
        }
    }
    fraction = 0.0;
    if (low + 1u < count) {
        const float a = values.v[first + low];
        fraction = clamp((x - a) / (values.v[first + low + 1u] - a), 0.0, 1.0);
    }
    return low;
}

// Candelas of the profile at word `at`, theta from straight down, both in degrees.
float ies_candela(uint at, float theta, float phi) {
    ConstFloats p = ConstFloats(LIGHTING.ies);
    const uint rows = floatBitsToUint(p.v[at]);
    const uint columns = floatBitsToUint(p.v[at + 1u]);
    const uint vertical = at + 2u;
    const uint horizontal = vertical + rows;
    const uint values = horizontal + columns;
    if (theta < p.v[vertical] - 1.0e-3 || theta > p.v[vertical + rows - 1u] + 1.0e-3) return 0.0;
    float dv, dh;
    const uint v = find_interval(p, vertical, rows, theta, dv);
    const uint h = find_interval(p, horizontal, columns, phi, dh);
    const uint v1 = min(v + 1u, rows - 1u);
    const uint h1 = min(h + 1u, columns - 1u);
    const float a = mix(p.v[values + h * rows + v], p.v[values + h * rows + v1], dv);
    const float b = mix(p.v[values + h1 * rows + v], p.v[values + h1 * rows + v1], dv);
    return mix(a, b, dh);
}

// The factor by which a shaped light's emission is scaled along w (unit, in the light's frame, away from the light).
vec3 shaped(uint index, vec3 w) {
    const GpuLightShaping s = Shapings(LIGHTING.shapings).v[index];
    const float cosine = clamp(dot3(w, s.axis), -1.0, 1.0);
    const float theta = acos(cosine);
    vec3 share = vec3(1.0);
    if (theta > s.cone_angle) return vec3(0.0);
    if (theta > s.smooth_start) {
        const float x = (theta - s.smooth_start) / (s.cone_angle - s.smooth_start);
        share *= 1.0 - x * x * (3.0 - 2.0 * x);
    }
    if (s.focus > 0.0) share *= mix(s.focus_tint, vec3(1.0), pow(abs(cosine), s.focus));
    if (HAS_IES && s.ies != NO_INDEX) {
        // UsdLux: a positive scale is about straight down, a negative one about straight up; 0 turns scaling off.
        float scaled = theta;
        if (s.angle_scale > 0.0) scaled = theta / s.angle_scale;
        if (s.angle_scale < 0.0) scaled = PI - (PI - theta) / -s.angle_scale;
        float phi = atan(dot3(w, s.y), dot3(w, s.x));
        if (phi < 0.0) phi += 2.0 * PI;
        share *= s.ies_scale * ies_candela(s.ies, degrees(clamp(scaled, 0.0, PI)), degrees(phi));
    }
    return share;
}

// Radiance (of a point or line: intensity) that a local light sends from its point q along w.
vec3 local_emission(GpuLocalLight light, vec3 q, vec3 w) {
    vec3 radiance = light.radiance;
    if (HAS_LIGHT_TEXTURE && light.map != NO_INDEX) radiance *= map_color(light.map, 0.5 - 0.5 * q.xy, false);
    if (HAS_SHAPING && light.shaping != NO_INDEX) radiance *= shaped(light.shaping, into_light_frame(w));
    return radiance;
}

#endif
