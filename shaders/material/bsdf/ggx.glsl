// SPDX-License-Identifier: Apache-2.0
// GGX in the frame of its normal (z), isotropic or not: density of normals, height-correlated Smith masking, sampling
// of visible normals; Fresnel reflectances.
//
// Half vectors are not normalised, and sines are sums of squares, not 1 - cos^2: so alpha may be as small as 1e-4 in
// f32. (Walter et al. 2007; Heitz 2014, 2018; Dupuy and Benyoub 2023, "Sampling visible GGX normals with spherical
// caps".)
#ifndef OOCPT_BSDF_GGX_GLSL
#define OOCPT_BSDF_GGX_GLSL

const float GGX_PI = 3.14159265358979;

// Density of normals at h / |h|.
float ggx_density(float alpha, vec3 h) {
    const float sine2 = h.x * h.x + h.y * h.y;
    const float length2 = sine2 + h.z * h.z;
    const float spread = sine2 + alpha * alpha * h.z * h.z;
    const float x = alpha * length2 / spread;
    return spread > 0.0 ? x * x / GGX_PI : 0.0;
}

// sqrt(alpha^2 + (1 - alpha^2) c^2) for a direction w of cosine c = w.z: c (1 + 2 Lambda(w)).
float ggx_slope(float alpha, vec3 w) {
    return sqrt(w.z * w.z + alpha * alpha * (w.x * w.x + w.y * w.y));
}

// BRDF * cosine of wi without Fresnel, and `pdf`, the density of wi; both directions above the surface.
float ggx_reflect(float alpha, vec3 wo, vec3 wi, out float pdf) {
    const float density = ggx_density(alpha, wo + wi);
    const float out_slope = ggx_slope(alpha, wo);
    pdf = density / (2.0 * (wo.z + out_slope));
    return density * wi.z / (2.0 * (wo.z * ggx_slope(alpha, wi) + wi.z * out_slope));
}

// A normal that is visible from wo, unit, with density G1 max(0, wo.h) D / wo.z.
vec3 ggx_sample(float alpha, vec3 wo, vec2 u) {
    const vec3 stretched = normalize(vec3(alpha * wo.xy, wo.z));
    const float angle = 2.0 * GGX_PI * u.x;
    const float z = fma(1.0 - u.y, 1.0 + stretched.z, -stretched.z);
    const float sine = sqrt(clamp(1.0 - z * z, 0.0, 1.0));
    const vec3 h = vec3(sine * cos(angle), sine * sin(angle), z) + stretched;
    return normalize(vec3(alpha * h.xy, max(h.z, 1.0e-12)));
}

// An anisotropic lobe (Walter et al. 2007, 5.2; Heitz 2014, eq. 85 to 88; OpenPBR 1.1, "Microfacet model"): its
// alphas along the axes of the frame turned by an angle. Alphas are those of a roughness that is the root of the
// mean of their squares, so the tables of that roughness are about right. Equal alphas: isotropic.
struct Stretch {
    vec2 alpha;
    vec2 turn; // cosine and sine
};

Stretch no_stretch(float alpha) {
    return Stretch(vec2(alpha), vec2(1.0, 0.0));
}

bool is_stretched(const Stretch s) {
    return HAS_ANISOTROPY && s.alpha.x != s.alpha.y;
}

// `ratio` of the alphas; `turn`: of the lobe against the frame, 1 = a whole one.
Stretch make_stretch(float alpha, float ratio, float turn) {
    if (!HAS_ANISOTROPY || ratio >= 1.0 || alpha <= 0.0) return no_stretch(alpha);
    const float along = alpha * sqrt(2.0 / (1.0 + ratio * ratio));
    const float angle = 2.0 * GGX_PI * (turn - floor(turn));
    return Stretch(max(vec2(along, ratio * along), 1.0e-4), vec2(cos(angle), sin(angle)));
}

vec3 into_stretch(const Stretch s, vec3 w) {
    return vec3(s.turn.x * w.x + s.turn.y * w.y, s.turn.x * w.y - s.turn.y * w.x, w.z);
}

vec3 out_of_stretch(const Stretch s, vec3 w) {
    return vec3(s.turn.x * w.x - s.turn.y * w.y, s.turn.x * w.y + s.turn.y * w.x, w.z);
}

// ggx_reflect of a lobe that may be anisotropic.
float lobe_reflect(float alpha, const Stretch s, vec3 wo, vec3 wi, out float pdf) {
    if (!is_stretched(s)) return ggx_reflect(alpha, wo, wi, pdf);
    const vec3 o = into_stretch(s, wo);
    const vec3 i = into_stretch(s, wi);
    const vec3 h = o + i;
    const vec2 slope = h.xy / s.alpha;
    const float spread = dot(slope, slope) + h.z * h.z;
    const float x = dot(h, h) / spread;
    const float density = spread > 0.0 ? x * x / (GGX_PI * s.alpha.x * s.alpha.y) : 0.0;
    const float out_slope = length(vec3(s.alpha * o.xy, o.z));
    const float in_slope = length(vec3(s.alpha * i.xy, i.z));
    pdf = density / (2.0 * (o.z + out_slope));
    return density * i.z / (2.0 * (o.z * in_slope + i.z * out_slope));
}

// ggx_sample of the same.
vec3 lobe_sample(float alpha, const Stretch s, vec3 wo, vec2 u) {
    if (!is_stretched(s)) return ggx_sample(alpha, wo, u);
    const vec3 o = into_stretch(s, wo);
    const vec3 stretched = normalize(vec3(s.alpha * o.xy, o.z));
    const float angle = 2.0 * GGX_PI * u.x;
    const float z = fma(1.0 - u.y, 1.0 + stretched.z, -stretched.z);
    const float sine = sqrt(clamp(1.0 - z * z, 0.0, 1.0));
    const vec3 h = vec3(sine * cos(angle), sine * sin(angle), z) + stretched;
    return out_of_stretch(s, normalize(vec3(s.alpha * h.xy, max(h.z, 1.0e-12))));
}

float power5(float x) {
    return x * x * x * x * x;
}

// Schlick's approximation; the cosine is that of half vector and direction.
vec3 schlick(vec3 f0, vec3 f90, float cosine) {
    return f0 + (f90 - f0) * power5(1.0 - clamp(cosine, 0.0, 1.0));
}

// The cosine on the other side of a smooth interface, 0 at total reflection; `eta` = index here / index there.
float refracted_cosine(float cosine, float eta) {
    return sqrt(max(0.0, 1.0 - eta * eta * (1.0 - cosine * cosine)));
}

// Exact reflectance of a dielectric, from the cosines on the side of the lower index and on the other; ior >= 1. At
// most 1: the quotient of equal numbers is above 1 where division is only good to 2.5 units in the last place, which
// Vulkan allows.
float dielectric_reflectance(float cosine, float inner, float ior) {
    const float a = (cosine - ior * inner) / max(cosine + ior * inner, 1.0e-30);
    const float b = (ior * cosine - inner) / max(ior * cosine + inner, 1.0e-30);
    return min(0.5 * (a * a + b * b), 1.0);
}

#endif
