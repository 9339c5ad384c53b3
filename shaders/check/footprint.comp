// SPDX-License-Identifier: Apache-2.0
// No pass of a render: footprints of cones and the widths of filters, for tests. One thread per query.
// Reads: at FrameConstants::rays five vec4 a query: u and the cone's width, v and the image's width, n and the image's
// height, d, the map's rows.
// Writes: at FrameConstants::radiance uvec4 (the footprint, as bits the filter's width, and what near_lookup_width says
// of it for a triangle in the plane).
#version 460
#extension GL_GOOGLE_include_directive : require
#include "wavefront/wavefront.glsl"
#include "texture/near_width.glsl"

float near_width(vec3 u, vec3 v, vec3 n, vec3 d, vec4 rows, vec2 size, float cone) {
    const vec3 a = abs(n);
    const vec3 axis = a.x <= min(a.y, a.z) ? vec3(1.0, 0.0, 0.0)
        : a.y <= a.z ? vec3(0.0, 1.0, 0.0) : vec3(0.0, 0.0, 1.0);
    const vec3 e = cross3(n, axis);
    const vec3 f = cross3(n, e) / sqrt(dot3(n, n)) + 0.3 * e;
    const vec2 s = vec2(dot3(u, e), dot3(v, e));
    const vec2 t = vec2(dot3(u, f), dot3(v, f));
    return near_lookup_width(e, f, size * vec2(dot(rows.xy, s), dot(rows.zw, s)),
                             size * vec2(dot(rows.xy, t), dot(rows.zw, t)), d, cone / sqrt(dot3(d, d)));
}

void main() {
    const uint at = thread_index();
    if (at >= push.path_count) return;
    vec4 q[5];
    for (uint i = 0u; i < 5u; ++i) q[i] = ConstVec4s(FRAME.rays).v[5u * at + i];
    const uvec2 footprint = make_footprint(q[0].xyz, q[1].xyz, q[2].xyz, q[3].xyz);
    const float width = footprint_width(footprint, q[0].w, q[4].xy, q[4].zw, uvec2(q[1].w, q[2].w));
    const float near = near_width(q[0].xyz, q[1].xyz, q[2].xyz, q[3].xyz, q[4], vec2(q[1].w, q[2].w), q[0].w);
    UVec4s(FRAME.radiance).v[at] = uvec4(footprint, floatBitsToUint(width),
                                       floatBitsToUint(near));
}
