// SPDX-License-Identifier: Apache-2.0
// What is known of a cutout without its texture (decisions/0058): for every place and every pair of levels that a
// lookup can mix, whether all that it could give means the surface is there, or not, or neither. Only with
// OPACITY_MASKS. Made by rust/core/src/texture/opacity_mask.rs, which has the layout.
#ifndef OOCPT_OPACITY_MASK_GLSL
#define OOCPT_OPACITY_MASK_GLSL

#include "include/texture.glsl"

// As in rust/core/src/texture/opacity_mask.rs.
const uint PRESENCE_UNKNOWN = 0u;
const uint PRESENCE_NEVER = 1u;
const uint PRESENCE_ALWAYS = 2u;

// A coordinate in the image; negative where the mask does not say.
float inside_image(float s, uint wrap) {
    s = near_image(s, wrap);
    if (s >= 0.0 && s <= 1.0) return s;
    if (wrap == WRAP_REPEAT) return s - floor(s);
    return wrap == WRAP_CLAMP ? clamp(s, 0.0, 1.0) : -1.0;
}

// What a lookup at st says, as wide as `width` texels. `head`: the first two words of the mask.
uint presence_in_mask(uint64_t mask, uvec2 head, vec2 st, float width) {
    st = vec2(inside_image(st.x, head.y & 3u), inside_image(st.y, (head.y >> 2) & 3u));
    float share;
    const uint pair = select_level((head.y >> 16) & 0xffu, width, share);
    const uint first = (head.y >> 8) & 0xffu;
    if (!(min(st.x, st.y) >= 0.0) || pair < first) return PRESENCE_UNKNOWN;
    const uvec2 begin = ConstUVec2s(mask).v[1u + pair - first];
    const uint fine = (begin.y >> 16) & 0xffu;
    const uvec2 sides = max(uvec2(head.x & 0xffffu, head.x >> 16) >> pair, uvec2(1u)) << fine;
    const uvec2 at = uvec2(floor(st * vec2(sides) + (fine == 0u ? 0.5 : 0.0)));
    const uint bin = uint(share * float(1u << (begin.y >> 24)));
    const uint cell = begin.x + (bin * (sides.y + 1u) + at.y) * (begin.y & 0xffffu) + at.x;
    return (ConstUints(mask).v[cell >> 4] >> ((cell & 15u) * 2u)) & 3u;
}

uint known_presence(uint64_t mask, vec2 st, float width) {
    return presence_in_mask(mask, ConstUVec2s(mask).v[0], st, width);
}

#endif
