// SPDX-License-Identifier: Apache-2.0
// The BSDF interface over plain Lambert, for scenes without materials. Same signatures as bsdf.glsl.
//
// wo and wi point away from the surface, world. bsdf_evaluate: rgb = f * |cos|, a = density of bsdf_sample per solid
// angle. Lambert has no delta lobe, so densities are above 0 wherever something is reflected.
#ifndef OOCPT_BSDF_LAMBERT_GLSL
#define OOCPT_BSDF_LAMBERT_GLSL

#include "material/lambert.glsl"

struct Bsdf {
    Lambert lambert;
    vec3 albedo;
};

// Both normals are turned to the viewer, who looks along `d`.
Bsdf make_bsdf(vec3 geometric_normal, vec3 shading_normal, vec3 albedo, vec3 d) {
    return Bsdf(make_lambert(geometric_normal, shading_normal, d), albedo);
}

// Unit, on the viewer's side.
vec3 bsdf_normal(Bsdf b) {
    return b.lambert.g;
}

vec4 bsdf_evaluate(Bsdf b, vec3 wo, vec3 wi) {
    const float density = lambert_density(b.lambert, wi);
    return vec4(b.albedo * density, density);
}

void bsdf_evaluate_lobes(Bsdf b, vec3 wo, vec3 wi, out vec3 diffuse, out vec3 specular, out float pdf) {
    pdf = lambert_density(b.lambert, wi);
    diffuse = b.albedo * pdf;
    specular = vec3(0.0);
}

bool bsdf_sample(Bsdf b, vec3 wo, vec4 u, out vec3 wi, out vec3 weight, out float pdf) {
    wi = lambert_sample(b.lambert, u.xy);
    pdf = lambert_density(b.lambert, wi);
    weight = b.albedo;
    return pdf > 0.0;
}

#endif
