// SPDX-License-Identifier: Apache-2.0
// Cutouts: whether a material makes a surface be there or not, asked in traversal at every candidate of a hit. Without CUTOUTS none of it
// is compiled in; with it a surface whose material does not ask costs the look at its prim.
#ifndef OOCPT_TRAVERSAL_PRESENCE_GLSL
#define OOCPT_TRAVERSAL_PRESENCE_GLSL

#include "include/cutout.glsl"
#include "include/cone.glsl"

const uint NO_TEXTURE = 0xffffffffu;

// What to ask. Without a texture the opacity is `bias`.
struct Presence {
    bool is_asked;
    uint texture;
    vec2 st;
    float footprint;
    uint channel;
    float scale;
    float bias;
    float threshold; // 0: the opacity is a probability
};

// The width of the ray's cone at distance t. A shadow ray starts as wide as its surface was seen and stays so.
float ray_cone(uint path, float t) {
    if (!HAS_TEXTURES) return 0.0;
#if ANY_HIT
    return cone_width(path, 0.0);
#else
    return cone_width(path, t);
#endif
}

// Nothing asks yet.
Presence presence_of(uint mesh, int prim_id, uint triangle, vec2 uv, float cone) {
    return Presence(false, NO_TEXTURE, vec2(0.0), 0.0, 0u, 1.0, 0.0, 0.0);
}

#endif
