// SPDX-License-Identifier: Apache-2.0
// Multiple scattering of the specular layer: the loss of single scattering, F_ms U1(wo) U1(wi) / (pi avg U1) (Kulla and
// Conty 2017). U1 falls with the square of alpha / cosine, so directions have a density of 1 / (cosine + alpha).
#ifndef OOCPT_BSDF_LOBES_SCATTER_GLSL
#define OOCPT_BSDF_LOBES_SCATTER_GLSL

#include "material/bsdf/lobe.glsl"

bool scatter_exists(const Bsdf b) {
    return largest(b.f0) > 0.0;
}

float scatter_albedo(inout Bsdf b, const LobeInputs x) {
    return mean(x.color) * x.lost;
}

vec3 scatter_evaluate(const Bsdf b, const LobeDirection d, out float kept) {
    kept = min(d.cosine, 1.0);
    return b.scatter * (d.lost * d.broad);
}

float scatter_density(const Bsdf b, const LobeDirection d, float kept) {
    return b.chance.scatter * spread_density(b.alpha, kept);
}

bool scatter_sample(const Bsdf b, vec3 u, out LobeSample s) {
    s = LobeSample(spread_sample(b, b.alpha, 1.0, u.xy), false, vec3(0.0));
    return true;
}

#endif
