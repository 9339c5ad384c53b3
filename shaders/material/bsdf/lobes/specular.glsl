// SPDX-License-Identifier: Apache-2.0
// Single scattering by the specular layer: GGX with Schlick's Fresnel, or a film's, under coat and sheen.
#ifndef OOCPT_BSDF_LOBES_SPECULAR_GLSL
#define OOCPT_BSDF_LOBES_SPECULAR_GLSL

#include "material/bsdf/lobe.glsl"

bool specular_exists(const Bsdf b) {
    return largest(b.f0) > 0.0;
}

float specular_albedo(inout Bsdf b, const LobeInputs x) {
    return mean(single_scattering(b));
}

vec3 specular_evaluate(const Bsdf b, const LobeDirection d, out float kept) {
    kept = 0.0;
    if (b.alpha <= 0.0) return vec3(0.0);
    const float value = lobe_reflect(b.alpha, b.stretch, b.o, d.i, kept);
    return specular_reflectance(b, half_cosine(b, d.i))
        * (value * through_coat(b, min(d.i.z, 1.0)) * through_sheen(b, d.i.z));
}

float specular_density(const Bsdf b, const LobeDirection d, float kept) {
    return b.chance.specular * kept;
}

bool specular_sample(const Bsdf b, vec3 u, out LobeSample s) {
    if (b.alpha > 0.0) return ggx_layer_sample(b, b.alpha, b.stretch, u.xy, s);
    vec3 all = single_scattering(b);
    if (HAS_THIN_FILM && b.film.x > 0.0) all = b.under_sheen * b.under_coat * specular_reflectance(b, b.o.z);
    s = mirror_sample(b, all / b.chance.specular);
    return true;
}

#endif
