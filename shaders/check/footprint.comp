// SPDX-License-Identifier: Apache-2.0
// No pass of a render: footprints of cones and the widths of filters, for tests. One thread per query.
// Reads: at Frame::rays five vec4 a query: u and the cone's width, v and the image's width, n and the image's height,
// d, the map's rows.
// Writes: at Frame::radiance uvec4 (the footprint, the filter's width as bits, 0).
#version 460
#extension GL_GOOGLE_include_directive : require
#include "include/wavefront.glsl"
#include "include/footprint.glsl"

void main() {
    const uint at = thread_index();
    if (at >= push.path_count) return;
    vec4 q[5];
    for (uint i = 0u; i < 5u; ++i) q[i] = ConstVec4s(FRAME.rays).v[5u * at + i];
    const uvec2 footprint = make_footprint(q[0].xyz, q[1].xyz, q[2].xyz, q[3].xyz);
    const float width = footprint_width(footprint, q[0].w, q[4].xy, q[4].zw, uvec2(q[1].w, q[2].w));
    UVec4s(FRAME.radiance).v[at] = uvec4(footprint, floatBitsToUint(width), 0u);
}
