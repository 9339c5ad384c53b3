// SPDX-License-Identifier: Apache-2.0
// Multiple scattering of rough glass to both sides, bsdf/glass.glsl.
#ifndef OOCPT_BSDF_LOBES_GLASS_SCATTER_GLSL
#define OOCPT_BSDF_LOBES_GLASS_SCATTER_GLSL

#include "material/bsdf/lobe.glsl"
#include "material/bsdf/glass.glsl"

bool glass_scatter_exists(const Bsdf b) {
    return b.glass > 0.0;
}

// Its share of the light goes to this side.
float glass_scatter_share(const Bsdf b, bool beyond) {
    return beyond ? 1.0 - b.glass_stay : b.glass_stay;
}

// The albedo that glass_albedo has set.
float glass_scatter_albedo(inout Bsdf b, const LobeInputs x) {
    return b.glass * b.glass_lost;
}

vec3 glass_scatter_evaluate(const Bsdf b, const LobeDirection d, out float kept) {
    const bool dense = !is_thin(b) && is_inside(b) != d.beyond;
    const float index2 = dense ? b.glass_ior * b.glass_ior : 1.0;
    const vec3 tint = HAS_OPEN_PBR && d.beyond ? b.glass_tint : vec3(1.0);
    kept = glass_scatter_share(b, d.beyond);
    float loss;
    if (is_thin(b)) {
        loss = table_albedo(min(d.cosine, 1.0), b.glass_row).x * kept;
    } else {
        loss = table_glass(b.glass_place, b.glass_row, min(d.cosine, 1.0), dense);
    }
    return tint * (b.glass_scatter * index2 * loss * d.cosine / GGX_PI);
}

float glass_scatter_density(const Bsdf b, const LobeDirection d, float kept) {
    return b.chance.glass_scatter * kept * spread_density(b.glass_alpha, d.cosine);
}

bool glass_scatter_sample(const Bsdf b, vec3 u, out LobeSample s) {
    const float side = u.z < b.glass_stay ? 1.0 : -1.0;
    s = LobeSample(spread_sample(b, b.glass_alpha, side, u.xy), false, vec3(0.0));
    return true;
}

#endif
