// SPDX-License-Identifier: Apache-2.0
// Test shader, not a pass of a render: looks textures up. One thread per query. Reads: queries at FrameConstants::rays,
// uvec4 (texture, taps, s, t), then vec4 (width, 0, 0, 0); textures and their tiles. Writes: at
// FrameConstants::radiance, vec4 value, uvec4 (the result of the lookup, taps, 0, 0). A query with taps continues from
// the value there.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "texture/texture.glsl"

void main() {
    const uint at = thread_index();
    if (at >= push.path_count) return;
    const uvec4 query = ConstUVec4s(FRAME.rays).v[2u * at];
    const float width = ConstVec4s(FRAME.rays).v[2u * at + 1u].x;
    TextureProgress progress = TextureProgress(Vec4s(FRAME.radiance).v[2u * at], query.y);
    const uint status = continue_lookup(query.x, uintBitsToFloat(query.zw), width, progress);
    Vec4s(FRAME.radiance).v[2u * at] = progress.mean;
    UVec4s(FRAME.radiance).v[2u * at + 1u] = uvec4(status, progress.taps, 0u, 0u);
}
