// SPDX-License-Identifier: Apache-2.0
// The lobe that rust/book/src/extending.md adds; compiled for tests alone. It reflects half of what the diffuse colour
// leaves, alike in all directions: f |cosine| = albedo / (2 pi), wherever the light comes from.
#ifndef OOCPT_BSDF_LOBES_TOY_LOBE_GLSL
#define OOCPT_BSDF_LOBES_TOY_LOBE_GLSL

#include "material/bsdf/lobe.glsl"

bool toy_lobe_exists(const Bsdf b) {
    return b.opaque > 0.0;
}

float toy_lobe_albedo(inout Bsdf b, const LobeInputs x) {
    b.toy_lobe = 0.5 * b.opaque * (1.0 - x.shading.diffuse_color);
    return mean(b.toy_lobe);
}

vec3 toy_lobe_evaluate(const Bsdf b, const LobeDirection d, out float kept) {
    kept = 1.0 / (2.0 * PI);
    return b.toy_lobe * kept;
}

float toy_lobe_density(const Bsdf b, const LobeDirection d, float kept) {
    return b.chance.toy_lobe * kept;
}

bool toy_lobe_sample(const Bsdf b, vec3 u, out LobeSample s) {
    const float sine = sqrt(max(0.0, 1.0 - u.x * u.x));
    const float angle = 2.0 * PI * u.y;
    const vec3 w = from_frame(b, vec3(sine * cos(angle), sine * sin(angle), u.x));
    s = LobeSample(on_side(b, w, 1.0), false, vec3(0.0));
    return true;
}

#endif
