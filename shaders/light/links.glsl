// SPDX-License-Identifier: Apache-2.0
// Light linking: the prims that a light shines on, and the prims that shadow it.
#ifndef OOCPT_LIGHT_LINKS_GLSL
#define OOCPT_LIGHT_LINKS_GLSL

#define LIGHTING LightingBlock(FRAME.lighting).l

// Returns true if the prims of set `set` are in category `category`.
bool is_linked(uint category, uint set) {
    if (!HAS_LIGHT_LINKS || category == 0u) return true;
    const uint word = ConstUints(LIGHTING.link_bits).v[set * LIGHTING.link_words + category / 32u];
    return ((word >> (category % 32u)) & 1u) != 0u;
}

// The set of categories that a prim is in.
uint prim_link_set(int prim_id) {
    if (!HAS_LIGHT_LINKS) return 0u;
    const uint index = uint(prim_id + 1);
    return index < LIGHTING.prim_count ? ConstUints(LIGHTING.prim_sets).v[index] : 0u;
}

// The prim id that the host knows: a prim below instances with different links has several of its own.
int shown_prim_id(int prim_id) {
    if (!HAS_LIGHT_LINKS) return prim_id;
    const uint index = uint(prim_id + 1);
    if (index >= LIGHTING.prim_count) return prim_id;
    return int(ConstUints(LIGHTING.prim_sets).v[LIGHTING.prim_count + index]);
}

#endif
