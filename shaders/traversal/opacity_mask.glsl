// SPDX-License-Identifier: Apache-2.0
// The coverage of a cutout around a place, without its texture (decisions/0058). Only with OPACITY_MASKS. Made by
// rust/core/src/texture/opacity_mask.rs, which documents the layout. Reads: the mask of a material. Writes nothing.
#ifndef OOCPT_OPACITY_MASK_GLSL
#define OOCPT_OPACITY_MASK_GLSL

#include "texture/near_width.glsl"
#include "texture/texture.glsl"

// In place of a coverage in 255 parts: the finest level of the texture has to decide.
const uint COVERAGE_UNKNOWN = 256u;
// In place of a coordinate: outside of a picture that is not continued.
const float AROUND_IMAGE = -1.0;

// A coordinate in the image, or AROUND_IMAGE. `narrow`: set if the edge of the image is continued.
float inside_image(float s, uint wrap, inout bool narrow) {
    s = near_image(s, wrap);
    if (s >= 0.0 && s <= 1.0) return s;
    if (wrap == WRAP_REPEAT) return s - floor(s);
    if (wrap == WRAP_MIRROR) return s < 0.0 ? -s : 2.0 - s;
    if (wrap == WRAP_BLACK) return AROUND_IMAGE;
    narrow = true;
    return clamp(s, 0.0, 1.0);
}

// The coverage at st, for a lookup as wide as `width` texels. `head`: the first two words of the mask.
uint coverage_in_mask(uint64_t mask, uvec2 head, vec2 st, float width) {
    const uint level = (head.y >> 8) & 31u;
    bool narrow = width < uintBitsToFloat((127u + max(level, 1u)) << 23);
    st = vec2(inside_image(st.x, head.y & 3u, narrow), inside_image(st.y, (head.y >> 2) & 3u, narrow));
    if (min(st.x, st.y) < 0.0) return narrow ? COVERAGE_UNKNOWN : head.y >> 24;
    const uvec2 sides = max(uvec2(head.x & 0xffffu, head.x >> 16) >> level, uvec2(1u)) << ((head.y >> 4) & 7u);
    const uvec2 at = min(uvec2(st * vec2(sides)), sides - 1u);
    const uint byte = 8u + at.y * sides.x + at.x;
    const uint coverage = (ConstUints(mask).v[byte >> 2] >> ((byte & 3u) * 8u)) & 0xffu;
    return narrow && coverage - 1u < 254u ? COVERAGE_UNKNOWN : coverage;
}

// The coverage at a hit, uv, of a triangle with edges e and f, whose corners have coordinates a, b and c, for a ray
// along d with a cone as wide as `cone` times the length of d.
uint coverage_at(GpuCutout cutout, vec2 a, vec2 b, vec2 c, vec2 uv, vec3 e, vec3 f, vec3 d, float cone) {
    const vec2 st = a * (1.0 - uv.x - uv.y) + b * uv.x + c * uv.y;
    vec2 place = vec2(cutout.row_s.x * st.x + cutout.row_s.y * st.y + cutout.row_s.z,
                      cutout.row_t.x * st.x + cutout.row_t.y * st.y + cutout.row_t.z);
    uint64_t mask = cutout.mask;
    uvec2 head = uvec2(cutout.size, cutout.modes);
    if ((head.y & MASK_SET) != 0u) {
        const vec2 part = floor(place);
        if (!(min(part.x, part.y) >= 0.0 && max(part.x, part.y) < 10.0)) return COVERAGE_UNKNOWN;
        const int away = int(ConstUints(mask).v[2u + uint(part.x) + 10u * uint(part.y)]);
        if (away == 0) return COVERAGE_UNKNOWN;
        place -= part;
        mask += uint64_t(int64_t(away) * 16l);
        head = ConstUVec2s(mask).v[0];
    }
    const vec2 along_e = b - a;
    const vec2 along_f = c - a;
    const vec2 size = vec2(head.x & 0xffffu, head.x >> 16);
    const vec2 at_e = size * vec2(fused_dot(cutout.row_s.xy, along_e), fused_dot(cutout.row_t.xy, along_e));
    const vec2 at_f = size * vec2(fused_dot(cutout.row_s.xy, along_f), fused_dot(cutout.row_t.xy, along_f));
    return coverage_in_mask(mask, head, place, near_lookup_width(e, f, at_e, at_f, d, cone));
}

#endif
