// SPDX-License-Identifier: Apache-2.0
// The coat: GGX, white, on top of all but sheen.
#ifndef OOCPT_BSDF_LOBES_COAT_GLSL
#define OOCPT_BSDF_LOBES_COAT_GLSL

#include "material/bsdf/lobe.glsl"

bool coat_exists(const Bsdf b) {
    return b.coat > 0.0;
}

// All of a sharp coat's weight.
float coat_reflected(const Bsdf b) {
    return b.opaque * (1.0 - b.under_coat) * b.under_sheen;
}

float coat_albedo(inout Bsdf b, const LobeInputs x) {
    return coat_reflected(b);
}

vec3 coat_evaluate(const Bsdf b, const LobeDirection d, out float kept) {
    kept = 0.0;
    if (b.coat_alpha <= 0.0) return vec3(0.0);
    const float value = lobe_reflect(b.coat_alpha, b.coat_stretch, b.o, d.i, kept);
    const float cosine = half_cosine(b, d.i);
    const float fresnel = b.coat_f0 + (b.coat_f90 - b.coat_f0) * power5(1.0 - clamp(cosine, 0.0, 1.0));
    return vec3(b.opaque * b.coat * fresnel * value * through_sheen(b, d.i.z));
}

float coat_density(const Bsdf b, const LobeDirection d, float kept) {
    return b.chance.coat * kept;
}

bool coat_sample(const Bsdf b, vec3 u, out LobeSample s) {
    if (b.coat_alpha > 0.0) return ggx_layer_sample(b, b.coat_alpha, b.coat_stretch, u.xy, s);
    s = mirror_sample(b, vec3(coat_reflected(b)) / b.chance.coat);
    return true;
}

#endif
