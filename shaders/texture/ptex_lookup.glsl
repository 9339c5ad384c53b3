// SPDX-License-Identifier: Apache-2.0
// Lookups in Ptex textures. Reads: Ptex directories, page table, tiles. A part of texture.glsl; a lookup can be
// continued as those of images can.
#ifndef OOCPT_TEXTURE_PTEX_GLSL
#define OOCPT_TEXTURE_PTEX_GLSL

// A face of a Ptex texture: log2 of its texels along u and v, and the place there; false for a face that the file does
// not have.
bool ptex_face(GpuTexture t, vec2 st, out uint face, out vec2 uv, out uvec2 log2_size) {
    uv = unpack_ptex(st, face);
    log2_size = uvec2(0u);
    if (face >= t.width) return false;
    const uint word = ConstUints(t.directory).v[face];
    log2_size = uvec2(word & 0xffu, word >> 8);
    return true;
}

uvec2 ptex_size(uint texture, vec2 st) {
    uint face;
    vec2 uv;
    uvec2 log2_size;
    const GpuTexture t = Textures(FRAME.textures).v[texture];
    return t.levels != 0u && ptex_face(t, st, face, uv, log2_size) ? uvec2(1u) << log2_size : uvec2(1u);
}

// A level of a face: the number of the texel left of and below its place among all of the file, the texels of a row,
// and the shares of the texels to the right and above. All texels around it are there, since a block has a border of
// one texel.
struct PtexLevel {
    uint texel;
    uint stride;
    vec2 share;
};

PtexLevel ptex_level(GpuTexture t, uint face, vec2 uv, uvec2 log2_size, uint level) {
    const uvec2 size = uvec2(1u) << uvec2(max(ivec2(log2_size) - int(level), ivec2(0)));
    const uint size_class = max(log2_size.x, log2_size.y) - level;
    const vec2 place = uv * vec2(size) + 0.5; // in the block
    const vec2 whole = floor(place);
    PtexLevel l;
    l.stride = size.x + 2u;
    l.texel = ConstUints(t.directory).v[t.width * (1u + size_class) + face] + uint(whole.y) * l.stride + uint(whole.x);
    l.share = place - whole;
    return l;
}

// continue_lookup of a Ptex texture.
uint continue_ptex(GpuTexture t, vec2 st, float width, inout TextureProgress progress) {
    uint face;
    vec2 uv;
    uvec2 log2_size;
    if (!ptex_face(t, st, face, uv, log2_size)) {
        progress.mean = t.fallback;
        return TEXTURE_FALLBACK;
    }
    float coarse_share;
    const uint finer = select_level(max(log2_size.x, log2_size.y), width, coarse_share);
    float total = 0.0;
    for (uint i = 0u; i < 2u; ++i) {
        const float level_share = i == 0u ? 1.0 - coarse_share : coarse_share;
        if (level_share == 0.0) continue;
        const PtexLevel l = ptex_level(t, face, uv, log2_size, finer + i);
        for (uint k = 0u; k < 4u; ++k) {
            const bool right = (k & 1u) != 0u;
            const bool upper = (k & 2u) != 0u;
            const float weight =
                level_share * ((right ? l.share.x : 1.0 - l.share.x) * (upper ? l.share.y : 1.0 - l.share.y));
            const uint tap = 4u * i + k;
            if (weight == 0.0) continue;
            const bool first = total == 0.0;
            total += weight;
            if (tap < progress.taps) continue;
            const uint index = l.texel + (right ? 1u : 0u) + (upper ? l.stride : 0u);
            const uint page = t.first_page + index / TILE_TEXELS;
            const uint64_t address = TexturePages(FRAME.texture_pages).v[page];
            if (address == 0ul) {
                progress.taps = tap;
                return page;
            }
            if ((uint(address) & PAGE_BROKEN) != 0u) {
                progress.mean = t.fallback;
                return TEXTURE_FALLBACK;
            }
            const vec4 texel = decode_texel(t, address, index % TILE_TEXELS);
            progress.mean = first ? texel : fma(texel - progress.mean, vec4(weight / total), progress.mean);
        }
    }
    return TEXTURE_DONE;
}

#endif
