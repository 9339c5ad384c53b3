// SPDX-License-Identifier: Apache-2.0
// Limits of bounces by kind, with BOUNCE_KINDS. A bounce is of the kind of the lobe that its ray was sampled from:
// transmission if it goes through the surface, else diffuse or specular as for lights' multipliers; all of hair is
// specular. Beyond its limit, as beyond max_bounces, a ray only looks for lights: they are direct light of the surface
// that it has left.
#ifndef OOCPT_BOUNCE_KINDS_GLSL
#define OOCPT_BOUNCE_KINDS_GLSL

#include "material/bsdf.glsl"

// In the order of the bits from PRIM_NO_DIFFUSE on.
const uint KIND_DIFFUSE = 0u;
const uint KIND_SPECULAR = 1u;
const uint KIND_TRANSMISSION = 2u;
const uint KINDS_USED_UP = 0x80000000u;

// The bounces of a path before its ray met something; 0 without BOUNCE_KINDS.
uint path_kinds(uint path, uint bounce) {
    if (!HAS_BOUNCE_KINDS || bounce == 0u) return 0u;
    return ConstUints(FRAME.bounce_kinds).v[path];
}

uint bounces_of(uint kinds, uint kind) {
    return bitfieldExtract(kinds, int(kind * BOUNCE_KIND_BITS), int(BOUNCE_KIND_BITS));
}

// Returns true if no further bounce of this kind is a surface's.
bool is_used_up(uint kinds, uint kind) {
    return HAS_BOUNCE_KINDS && bounces_of(kinds, kind) >= FRAME.kind_limits[kind];
}

// Returns true if the ray that has met a surface only looks for lights.
bool only_looks_for_lights(uint bounce, uint kinds) {
    return HAS_MATERIALS && (bounce > FRAME.max_bounces || (HAS_BOUNCE_KINDS && (kinds & KINDS_USED_UP) != 0u));
}

// Returns true if paths end at such a surface: a shadow ray accounts for all its light.
bool ends_paths(const Bsdf bsdf, uint bounce, uint kinds) {
    return (bounce >= FRAME.max_bounces || is_used_up(kinds, KIND_DIFFUSE)) && is_plain(bsdf);
}

// The kind of the bounce that `u` has chosen the lobe of (bsdf_choose); `beyond`: it goes through the surface.
uint bounce_kind(const Bsdf bsdf, float u, bool beyond) {
    if (is_hair(bsdf)) return KIND_SPECULAR;
    if (beyond) return KIND_TRANSMISSION;
    float place = u;
    return is_plain(bsdf) || choose_lobe(bsdf.chance, place) == LOBE_DIFFUSE ? KIND_DIFFUSE : KIND_SPECULAR;
}

// Counts the bounce of a kind.
void count_bounce(uint path, uint kind, uint kinds) {
    if (is_used_up(kinds, kind)) {
        kinds |= KINDS_USED_UP;
    } else if (bounces_of(kinds, kind) + 1u < 1u << BOUNCE_KIND_BITS) {
        kinds += 1u << (kind * BOUNCE_KIND_BITS);
    }
    Uints(FRAME.bounce_kinds).v[path] = kinds;
}

#endif
