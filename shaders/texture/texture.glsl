// SPDX-License-Identifier: Apache-2.0
// Textures: page lookup, texels, bilinear filter, two levels mixed. The twin in f64 is rust/core/src/texture/twin.rs;
// tiles and levels are numbered as in rust/core/src/texture/layout.rs.
//
// st: (0, 0) is the lower left corner of the image. `width`: of the filter, in texels of level 0
// (texture/footprint.glsl). Between 2^l and 2^(l+1) texels levels l and l + 1 are mixed linearly in it.
//
// A lookup takes up to eight texels, one after the other, and keeps the mean of those it has (West 1979: mean += (x -
// mean) * w / W), which for equal texels is that texel exactly. So it can stop at any texel whose tile is absent and go
// on there later, with the same bits as if it had never stopped: each tile that comes is progress, and no two need to
// be there at once.
#ifndef OOCPT_TEXTURE_GLSL
#define OOCPT_TEXTURE_GLSL

#include "wavefront/wavefront.glsl"
#include "texture/footprint.glsl"
#include "wavefront/progress.glsl"
#include "texture/ptex.glsl"
#include "texture/feedback.glsl"

// The result of a finished lookup, in place of the number of a unit that it waits for.
const uint TEXTURE_DONE = 0xffffffffu;
// The image is missing or cannot be read; the value is the fallback, to which no scale or bias applies. With
// TEXTURE_BORDER they do, and the lookup is done.
const uint TEXTURE_FALLBACK = 0xfffffffeu;

const uint TILE_TEXELS = TILE_SIDE * TILE_SIDE;

// The state of a lookup: the mean of the texels so far, and how many of the eight are done.
struct TextureProgress {
    vec4 mean;
    uint taps;
};

// A level: its size, the number of its first tile, and for levels that share the last tile the byte where it begins
// there.
struct TextureLevel {
    uint level;
    uvec2 size;
    uint page;
    uint offset;
    bool in_tail;
};

uvec2 level_size(GpuTexture t, uint level) {
    return max(uvec2(t.width, t.height) >> level, uvec2(1u));
}

uint texel_bytes(GpuTexture t) {
    return (t.flags & TEXTURE_CHANNELS) << ((t.flags >> TEXTURE_FORMAT_SHIFT) & 3u);
}

TextureLevel texture_level(GpuTexture t, uint level) {
    TextureLevel l = TextureLevel(level, level_size(t, level), t.first_page, 0u, false);
    for (uint i = 0u; i < level; ++i) {
        const uvec2 size = level_size(t, i);
        if (max(size.x, size.y) <= TAIL_SIDE) {
            l.offset += (size.x * size.y * texel_bytes(t) + 3u) & ~3u;
        } else {
            const uvec2 tiles = (size + (TILE_SIDE - 1u)) / TILE_SIDE;
            l.page += tiles.x * tiles.y;
        }
    }
    l.in_tail = max(l.size.x, l.size.y) <= TAIL_SIDE;
    return l;
}

// v / 255, correctly rounded for 0 to 255: v * 257 / 65536 is exact and lacks v * (1 / 255 - 257 / 65536). (No fma: a
// driver may split it.)
vec4 byte_to_unit(vec4 v) {
    return v * (257.0 / 65536.0) + v * 5.983839201917363e-8;
}

float linear_from_srgb(float v) {
    return v <= 0.04045 ? v / 12.92 : pow((v + 0.055) / 1.055, 2.4);
}

// (r), (r, a) and (r, g, b, a) to four channels.
vec4 expand_channels(vec4 v, uint channels) {
    if (channels == 1u) return vec4(v.xxx, 1.0);
    return channels == 2u ? v.xxxy : v;
}

// The texel at `index` of those that begin at `address`.
vec4 decode_texel(GpuTexture t, uint64_t address, uint index) {
    const uint channels = t.flags & TEXTURE_CHANNELS;
    const uint format = (t.flags >> TEXTURE_FORMAT_SHIFT) & 3u;
    const bool srgb = (t.flags & TEXTURE_SRGB) != 0u;
    if (format == TEXTURE_U8) {
        const uint first = index * channels;
        const uint word = ConstUints(address).v[first >> 2] >> ((first & 3u) * 8u);
        const uvec4 bytes = uvec4(word, word >> 8, word >> 16, word >> 24) & 0xffu;
        vec4 v = byte_to_unit(vec4(bytes));
        if (srgb) {
            v.x = ConstFloats(t.decode).v[bytes.x];
            if (channels == 4u) v.yz = vec2(ConstFloats(t.decode).v[bytes.y], ConstFloats(t.decode).v[bytes.z]);
        }
        return expand_channels(v, channels);
    }
    vec4 v;
    if (format == TEXTURE_F16) {
        if (channels == 1u) {
            v = unpackHalf2x16(ConstUints(address).v[index >> 1] >> ((index & 1u) * 16u)).xxxx;
        } else if (channels == 2u) {
            v = unpackHalf2x16(ConstUints(address).v[index]).xyxy;
        } else {
            const uvec2 words = ConstUVec2s(address).v[index];
            v = vec4(unpackHalf2x16(words.x), unpackHalf2x16(words.y));
        }
    } else if (channels == 1u) {
        v = uintBitsToFloat(ConstUints(address).v[index]).xxxx;
    } else if (channels == 2u) {
        v = uintBitsToFloat(ConstUVec2s(address).v[index]).xyxy;
    } else {
        v = uintBitsToFloat(ConstUVec4s(address).v[index]);
    }
    if (srgb) v = vec4(linear_from_srgb(v.x), linear_from_srgb(v.y), linear_from_srgb(v.z), v.w);
    if (srgb && channels == 2u) v.y = v.w;
    return expand_channels(v, channels);
}

// Texel `x` of `size`, or -1 for what lies around the image: transparent black, or with TEXTURE_BORDER the fallback.
int wrap_texel(int x, int size, uint wrap) {
    if (x >= 0 && x < size) return x;
    if (wrap == WRAP_CLAMP) return clamp(x, 0, size - 1);
    if (wrap == WRAP_BLACK) return -1;
    const int period = wrap == WRAP_MIRROR ? 2 * size : size;
    int m = x % period;
    m = m < 0 ? m + period : m;
    return m < size ? m : period - 1 - m;
}

// A coordinate brought near the image, by whole periods if there are any; exact, since small negative numbers stay.
float near_image(float s, uint wrap) {
    if (!(abs(s) < 1.0e9)) return 0.0;
    if (s >= -1.0 && s <= 2.0) return s;
    if (wrap == WRAP_REPEAT) return s - floor(s);
    if (wrap == WRAP_MIRROR) return s - 2.0 * floor(0.5 * s);
    return clamp(s, -1.0, 2.0);
}

// The lower of the two texels around s, and the share of the upper one. s * size - 0.5 is worked out in integers: exact
// but for one rounding of the share, so a wide image is filtered as well as a small one. |s| < 4.
int texel_place(float s, uint size, out float share) {
    const uint bits = floatBitsToUint(s);
    const int shift = 150 - int((bits >> 23) & 0xffu); // s is its mantissa / 2^shift
    if (shift > 60) {
        share = 0.5;
        return -1;
    }
    const int64_t product = int64_t(uint64_t((bits & 0x7fffffu) | 0x800000u) * uint64_t(size));
    const int64_t place = (s < 0.0 ? -product : product) - (1l << (shift - 1));
    share = float(place & ((1l << shift) - 1l)) * uintBitsToFloat(uint(127 - shift) << 23);
    return int(place >> shift);
}

// The finer of two levels up to `coarsest`, and the share of the next one.
uint select_level(uint coarsest, float width, out float share) {
    share = 0.0;
    if (!(width > 1.0)) return 0u;
    const uint bits = floatBitsToUint(width);
    const uint level = (bits >> 23) - 127u;
    if (level >= coarsest) return coarsest;
    share = uintBitsToFloat((bits & 0x007fffffu) | 0x3f800000u) - 1.0;
    return level;
}

// The part of a UDIM set that st is in, or the texture itself; takes st to the unit square of the part.
uint texture_part(uint texture, inout vec2 st, out bool exists) {
    exists = true;
    const GpuTexture t = Textures(FRAME.textures).v[texture];
    if ((t.flags & TEXTURE_UDIM) == 0u) return texture;
    const vec2 part = floor(st);
    exists = part.x >= 0.0 && part.x < 10.0 && part.y >= 0.0 && part.y < 10.0;
    if (!exists) return texture;
    st -= part;
    return t.first_page + uint(part.x) + 10u * uint(part.y);
}

#include "texture/ptex_lookup.glsl"

// Width of the filter of a lookup at st, in texels, for a cone of width `cone` that covers `footprint` of the
// coordinates before the map with rows s and t.
float lookup_width(uint texture, vec2 st, uvec2 footprint, float cone, vec3 s, vec3 t) {
    bool exists;
    const uint part = texture_part(texture, st, exists);
    uvec2 size = uvec2(Textures(FRAME.textures).v[part].width, Textures(FRAME.textures).v[part].height);
    if (HAS_PTEX && (Textures(FRAME.textures).v[part].flags & TEXTURE_PTEX) != 0u) size = ptex_size(part, st);
    return exists ? footprint_width(footprint, cone, s.xy, t.xy, size) : 0.0;
}

// Continues a lookup until it is done (TEXTURE_DONE, TEXTURE_FALLBACK; the value is progress.mean) or needs an absent
// tile: then returns the number of that tile among all tiles of the scene.
uint continue_lookup(uint texture, vec2 st, float width, inout TextureProgress progress) {
    bool exists;
    const GpuTexture t = Textures(FRAME.textures).v[texture_part(texture, st, exists)];
    // Members of a set have its flag.
    const bool has_border = (t.flags & TEXTURE_BORDER) != 0u;
    if (!exists || t.levels == 0u) {
        progress.mean = exists ? t.fallback : Textures(FRAME.textures).v[texture].fallback;
        return has_border ? TEXTURE_DONE : TEXTURE_FALLBACK;
    }
    if (HAS_PTEX && (t.flags & TEXTURE_PTEX) != 0u) return continue_ptex(t, st, width, progress);
    const uint wrap_s = (t.flags >> TEXTURE_WRAP_S_SHIFT) & 3u;
    const uint wrap_t = (t.flags >> TEXTURE_WRAP_T_SHIFT) & 3u;
    st = vec2(near_image(st.x, wrap_s), near_image(st.y, wrap_t));
    float coarse_share;
    const uint finer = select_level(t.levels - 1u, width, coarse_share);
    float total = 0.0;
    uint page = 0xffffffffu;
    uint64_t address = 0ul;
    for (uint i = 0u; i < 2u; ++i) {
        const float level_share = i == 0u ? 1.0 - coarse_share : coarse_share;
        if (level_share == 0.0) continue;
        const TextureLevel l = texture_level(t, finer + i);
        vec2 share;
        const int x = texel_place(st.x, l.size.x, share.x);
        const int y = texel_place(st.y, l.size.y, share.y);
        for (uint k = 0u; k < 4u; ++k) {
            const bool right = (k & 1u) != 0u;
            const bool upper = (k & 2u) != 0u;
            const float weight =
                level_share * ((right ? share.x : 1.0 - share.x) * (upper ? share.y : 1.0 - share.y));
            const uint tap = 4u * i + k;
            if (weight == 0.0) continue;
            const bool first = total == 0.0;
            total += weight;
            if (tap < progress.taps) continue;
            const ivec2 at = ivec2(wrap_texel(x + (right ? 1 : 0), int(l.size.x), wrap_s),
                                   wrap_texel(y + (upper ? 1 : 0), int(l.size.y), wrap_t));
            vec4 texel = has_border ? t.fallback : vec4(0.0);
            if (at.x >= 0 && at.y >= 0) {
                const uvec2 tile = l.in_tail ? uvec2(0u) : uvec2(at) / TILE_SIDE;
                const uint tiles_x = (l.size.x + TILE_SIDE - 1u) / TILE_SIDE;
                const uint wanted = l.page + (l.in_tail ? 0u : tile.y * tiles_x + tile.x);
                if (wanted != page) {
                    page = wanted;
                    address = TexturePages(FRAME.texture_pages).v[page];
                }
                if (address == 0ul) {
                    progress.taps = tap;
                    return page;
                }
                if ((uint(address) & PAGE_BROKEN) != 0u) {
                    progress.mean = t.fallback;
                    return has_border ? TEXTURE_DONE : TEXTURE_FALLBACK;
                }
                const uvec2 inside = uvec2(at) - tile * TILE_SIDE;
                const uint stride = min(l.size.x - tile.x * TILE_SIDE, TILE_SIDE);
                texel = decode_texel(t, address + uint64_t(l.offset), inside.y * stride + inside.x);
            }
            progress.mean = first ? texel : fma(texel - progress.mean, vec4(weight / total), progress.mean);
        }
    }
    return TEXTURE_DONE;
}

// In core: a whole lookup. Absent tiles are requested, and the path is traced again when they are there; it goes on for
// now without them, so that it also requests the tiles that it needs later.
const vec4 UNKNOWN_TEXEL = vec4(0.5);

uint requested_lookup(uint path, uint texture, vec2 st, float width, inout TextureProgress progress) {
    uint status = continue_lookup(texture, st, width, progress);
    while (status < TEXTURE_FALLBACK) {
        request_tile(path, status);
        ++progress.taps;
        status = continue_lookup(texture, st, width, progress);
    }
    return status;
}

// With streaming the lookups of a path's material are numbered in the order in which it makes them, and the value of
// each is stored once it is done: a pass that evaluates the material again finds those, and goes on with the first that
// is not done. So core and streaming share the code that uses them, and each tile that is loaded is progress, whichever
// was evicted meanwhile.
uint lookup_path;
uint lookup_number;

// Must be called before the material of a path is evaluated, in core too.
void begin_lookups(uint path) {
    lookup_path = path;
    lookup_number = 0u;
}

// Bits of the word that stores the progress of a path's lookups.
const uint LOOKUPS_TAPS_SHIFT = 8u;      // of the one under way
const uint LOOKUPS_FALLBACK_SHIFT = 16u; // a bit for each that gave the fallback

// Other tiles that a material which waits will need: the first of each level of its lookups that is absent.
const uint MAX_NOTED = MAX_PENDING - 1u;
uint noted_units[MAX_NOTED];
uint noted_count;

#ifdef NOTE_TILES
// Notes a tile, unless it is resident, noted already, or is `but`.
void note_tile(uint page, uint but) {
    const uint unit = page + STREAMING.first_tile;
    bool known = unit == but || noted_count == MAX_NOTED || TexturePages(FRAME.texture_pages).v[page] != 0ul;
    for (uint k = 0u; k < noted_count; ++k) known = known || noted_units[k] == unit;
    if (known) return;
    noted_units[noted_count] = unit;
    ++noted_count;
}

void note_ptex(GpuTexture t, vec2 st, float width, uint but) {
    uint face;
    vec2 uv;
    uvec2 log2_size;
    if (!ptex_face(t, st, face, uv, log2_size)) return;
    float coarse_share;
    const uint finer = select_level(max(log2_size.x, log2_size.y), width, coarse_share);
    const uint end = coarse_share > 0.0 ? 2u : 1u;
    for (uint i = 0u; i < end; ++i) {
        note_tile(t.first_page + ptex_level(t, face, uv, log2_size, finer + i).texel / TILE_TEXELS, but);
    }
}
#endif

// With NOTE_TILES: notes the absent tiles of a lookup, so that they are loaded together and not one after the other. A
// hint: the four texels of a level may lie in other tiles too.
void note_tiles(uint texture, vec2 st, float width, uint but) {
#ifdef NOTE_TILES
    bool exists;
    const GpuTexture t = Textures(FRAME.textures).v[texture_part(texture, st, exists)];
    if (!exists || t.levels == 0u) return;
    if (HAS_PTEX && (t.flags & TEXTURE_PTEX) != 0u) {
        note_ptex(t, st, width, but);
        return;
    }
    const uint wrap_s = (t.flags >> TEXTURE_WRAP_S_SHIFT) & 3u;
    const uint wrap_t = (t.flags >> TEXTURE_WRAP_T_SHIFT) & 3u;
    st = vec2(near_image(st.x, wrap_s), near_image(st.y, wrap_t));
    float coarse_share;
    const uint finer = select_level(t.levels - 1u, width, coarse_share);
    const uint end = coarse_share > 0.0 ? 2u : 1u;
    for (uint i = 0u; i < end; ++i) {
        const TextureLevel l = texture_level(t, finer + i);
        vec2 share;
        const int x = wrap_texel(texel_place(st.x, l.size.x, share.x), int(l.size.x), wrap_s);
        const int y = wrap_texel(texel_place(st.y, l.size.y, share.y), int(l.size.y), wrap_t);
        if (x < 0 || y < 0) continue;
        const uint tiles_x = (l.size.x + TILE_SIDE - 1u) / TILE_SIDE;
        const uint tile = l.in_tail ? 0u : uint(y) / TILE_SIDE * tiles_x + uint(x) / TILE_SIDE;
        note_tile(l.page + tile, but);
    }
#endif
}

vec4 kept_lookup(uint texture, vec2 st, float width, out uint missing_unit) {
    const uint k = lookup_number++;
    const uint word = ConstUints(STREAMING.resolve_progress).v[lookup_path];
    const uint done = word & 0xffu;
    const uint at = lookup_path * STREAMING.lookups + k;
    missing_unit = (word >> (LOOKUPS_FALLBACK_SHIFT + k) & 1u) != 0u ? TEXTURE_FALLBACK : TEXTURE_DONE;
    if (k < done) return ConstVec4s(STREAMING.resolved).v[at];
    if (k > done) { // another one waits
        note_tiles(texture, st, width, 0xffffffffu);
        return vec4(0.0);
    }
    TextureProgress progress = TextureProgress(vec4(0.0), (word >> LOOKUPS_TAPS_SHIFT) & 0xffu);
    if (progress.taps != 0u) progress.mean = ConstVec4s(STREAMING.resolved).v[at];
    const uint status = continue_lookup(texture, st, width, progress);
    Vec4s(STREAMING.resolved).v[at] = progress.mean;
    const uint others = word & ~0xffffu;
    if (status >= TEXTURE_FALLBACK) {
        missing_unit = status;
        const uint fallback = status == TEXTURE_FALLBACK ? 1u << (LOOKUPS_FALLBACK_SHIFT + k) : 0u;
        Uints(STREAMING.resolve_progress).v[lookup_path] = others | fallback | (done + 1u);
    } else {
        missing_unit = status + STREAMING.first_tile;
        Uints(STREAMING.resolve_progress).v[lookup_path] = others | progress.taps << LOOKUPS_TAPS_SHIFT | done;
        noted_count = 0u;
        note_tiles(texture, st, width, missing_unit);
    }
    return progress.mean;
}

// A whole lookup. `missing_unit` is TEXTURE_DONE, TEXTURE_FALLBACK, or with streaming the unit of the planner to wait
// for (the value is then meaningless). With streaming it must follow begin_lookups, and lookups must always come in the
// same order.
vec4 texture_lookup(uint texture, vec2 st, float width, out uint missing_unit) {
    if (HAS_STREAMING) return kept_lookup(texture, st, width, missing_unit);
    TextureProgress progress = TextureProgress(UNKNOWN_TEXEL, 0u);
    missing_unit = requested_lookup(lookup_path, texture, st, width, progress);
    return progress.mean;
}

#endif
