// SPDX-License-Identifier: Apache-2.0
// Diffuse reflection under all layers: Lambert, or EON (bsdf/eon.glsl). The only lobe that may be all of a surface.
#ifndef OOCPT_BSDF_LOBES_DIFFUSE_GLSL
#define OOCPT_BSDF_LOBES_DIFFUSE_GLSL

#include "material/bsdf/lobe.glsl"

bool diffuse_exists(const Bsdf b) {
    return true;
}

float diffuse_albedo(inout Bsdf b, const LobeInputs x) {
    return mean(x.base * x.under);
}

// Diffuse colour towards a direction at this cosine.
vec3 diffuse_towards(const Bsdf b, vec3 wi, float cosine) {
    if (!HAS_ROUGH_DIFFUSE || b.eon.roughness <= 0.0) return b.diffuse;
    float single, multiple;
    eon_factors(b.eon, wi, cosine, single, multiple);
    return b.diffuse * single + b.diffuse_more * multiple;
}

vec3 diffuse_evaluate(const Bsdf b, const LobeDirection d, out float kept) {
    kept = d.broad;
    return diffuse_towards(b, d.w, min(d.cosine, 1.0)) * d.under * d.broad;
}

float diffuse_density(const Bsdf b, const LobeDirection d, float kept) {
    return b.chance.diffuse * kept;
}

bool diffuse_sample(const Bsdf b, vec3 u, out LobeSample s) {
    s = LobeSample(lambert_sample(Lambert(b.g, b.l), u.xy), false, vec3(0.0));
    return true;
}

#endif
