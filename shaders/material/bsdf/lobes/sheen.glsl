// SPDX-License-Identifier: Apache-2.0
// Sheen, bsdf/sheen.glsl, on top of the opaque part.
#ifndef OOCPT_BSDF_LOBES_SHEEN_GLSL
#define OOCPT_BSDF_LOBES_SHEEN_GLSL

#include "material/bsdf/lobe.glsl"

bool sheen_exists(const Bsdf b) {
    return b.sheen_most > 0.0;
}

float sheen_albedo(inout Bsdf b, const LobeInputs x) {
    return b.opaque * mean(x.shading.sheen_color) * sheen_albedo(b.o.z, b.sheen_row);
}

vec3 sheen_evaluate(const Bsdf b, const LobeDirection d, out float kept) {
    kept = min(d.i.z, 1.0);
    return b.sheen * sheen_value(b.sheen_roughness, b.o, d.i);
}

float sheen_density(const Bsdf b, const LobeDirection d, float kept) {
    return b.chance.sheen * spread_density(SHEEN_SPREAD, kept);
}

bool sheen_sample(const Bsdf b, vec3 u, out LobeSample s) {
    const float cosine = spread_cosine(SHEEN_SPREAD, u.x);
    const float sine = sqrt(max(0.0, 1.0 - cosine * cosine));
    const float angle = 2.0 * PI * u.y;
    const vec3 w = from_frame(b, vec3(sine * cos(angle), sine * sin(angle), cosine));
    s = LobeSample(on_side(b, w, 1.0), false, vec3(0.0));
    return true;
}

#endif
