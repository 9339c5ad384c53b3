// SPDX-License-Identifier: Apache-2.0
// Rough diffuse reflection: EON (Portsmouth, Kutz and Hill 2025, "EON: A practical energy-preserving rough diffuse
// BRDF"), as OpenPBR's base_diffuse_roughness has it. For a colour c, a roughness r, cosines m_o and m_i with the
// normal and s = wi . wo - m_i m_o:
//   f pi = c A (1 + r s / t) + c_ms (1 - E(m_o)) (1 - E(m_i)) / (1 - E_avg),   t = max(m_i, m_o) where s > 0, else 1
// with E the albedo of the first term for c = 1 (its closed form), E_avg its average, and c_ms = c^2 E_avg /
// (1 - c (1 - E_avg)). White reflects all; r = 0 is Lambert, bit for bit. Reciprocal. Directions are sampled as
// Lambert's.
#ifndef OOCPT_BSDF_EON_GLSL
#define OOCPT_BSDF_EON_GLSL

// The factors of Lambert's values: c times `single`, c_ms times `multiple`.
struct Eon {
    float roughness; // 0: none of this
    float a;         // A
    vec3 o;          // wo, above the normal
    float cosine;    // m_o
    float below;     // (1 - E(m_o)) / (1 - E_avg)
};

float eon_a(float roughness) {
    return 1.0 / (1.0 + (0.5 - 2.0 / (3.0 * GGX_PI)) * roughness);
}

// E_avg.
float eon_average(float roughness) {
    return eon_a(roughness) * (1.0 + (2.0 / 3.0 - 28.0 / (15.0 * GGX_PI)) * roughness);
}

// E at a cosine in 0..1.
float eon_albedo(float cosine, float roughness) {
    const float m = max(cosine, 1.0e-4);
    const float sine = sqrt(max(0.0, (1.0 - m) * (1.0 + m)));
    const float angle = atan(sine, m);
    // (1 - sine^3) / m without a difference of like numbers: 1 - sine = m^2 / (1 + sine).
    const float rest = m * (1.0 + sine + sine * sine) / (1.0 + sine);
    const float g = sine * (angle - sine * m) + (2.0 / 3.0) * sine * (rest - 1.0);
    return eon_a(roughness) * (1.0 + roughness * g / GGX_PI);
}

Eon make_eon(float roughness, vec3 normal, vec3 wo) {
    Eon e;
    e.roughness = roughness;
    e.a = eon_a(roughness);
    e.o = wo;
    const float least = 1.0e-3;
    const float cosine = dot(normal, wo);
    if (cosine < least) e.o = normalize(wo + (least - cosine) * normal);
    e.cosine = clamp(dot(normal, e.o), least, 1.0);
    const float lost = 1.0 - eon_average(roughness);
    e.below = lost > 0.0 ? max(0.0, 1.0 - eon_albedo(e.cosine, roughness)) / lost : 0.0;
    return e;
}

// c_ms.
vec3 eon_scattered(vec3 color, float roughness) {
    const float average = eon_average(roughness);
    return color * color * average / (1.0 - color * max(0.0, 1.0 - average));
}

// `cosine` of wi with the normal, above 0.
void eon_factors(Eon e, vec3 wi, float cosine, out float single, out float multiple) {
    const float s = dot(wi, e.o) - cosine * e.cosine;
    single = e.a * (1.0 + e.roughness * (s > 0.0 ? s / max(cosine, e.cosine) : s));
    multiple = e.below * max(0.0, 1.0 - eon_albedo(cosine, e.roughness));
}

#endif
