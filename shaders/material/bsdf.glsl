// SPDX-License-Identifier: Apache-2.0
// The layered BSDF: coat over GGX reflection over diffuse and transmission, driven by UsdPreviewSurface.
//
// The surface is a mixture: (1 - metallic) (1 - opacity) of it is glass, bsdf/glass.glsl, the rest is opaque, on either
// side the same. The opaque part from the top, each layer under what the ones above let through; E is a layer's
// directional albedo, U = 1 - E:
//   sheen         bsdf/sheen.glsl, with SHEEN. Below it: min(U(wo), U(wi)) for coat and specular.
//   coat          GGX, white, F0 from ior, times the amount `clearcoat`. Below it: min(U(wo), U(wi)) for the specular
//                 lobe.
//   specular      GGX with Schlick's Fresnel; F0 and F90 are those of UsdPreviewSurface 2.5. The loss of single
//                 scattering comes back as a broad lobe F_ms U1(wo) U1(wi) / (pi avg U1), U1 for F = 1 (Kulla and Conty
//                 2017). U1 falls with the square of alpha / cosine, so this lobe is sampled with a density of
//                 1 / (cosine + alpha), not by the cosine. A half metallic surface is a mixture of two: the light that
//                 goes below, (1 - metallic), went through the dielectric's part.
//   diffuse       with ROUGH_DIFFUSE bsdf/eon.glsl instead of a constant; without
//                 color (1 - metallic) opacity U(wo) U(wi) / (pi avg U): reciprocal, and albedo color * U(wo) exactly.
//
// Anisotropic lobes (ANISOTROPY) keep the tables, which are those of isotropic ones: in a white furnace an albedo is
// off by the difference, up to 0.11 above and, at grazing across the narrow axis, 0.4 below; over all azimuths 0.06.
// Glass and multiple scattering are isotropic. A film (THIN_FILM, bsdf/film.glsl) replaces Schlick's
// Fresnel of single scattering, exactly and at any angle; the rest takes F0 from it.
//
// Each lobe is a file of bsdf/lobes and a row of rust/abi/src/lobes.rs; bsdf/lobe.glsl has their common interface. This
// file computes what all of them use: frames, Fresnel, the transmittance of layers.
//
// A fibre (HAIR) has a BSDF of its own: bsdf/hair.glsl.
//
// Normals: directions that leave on the wrong side of the true surface (geometric normal g) are mirrored at it, in
// density and evaluation alike, so no energy is lost or won (as lambert.glsl does). Only if the viewer is below the
// shading normal's horizon, the normal of the specular layers is bent towards him.
//
// Numbers: lobes of roughness < 0.01 (alpha < 1e-4) are sharp: at 0.01 f32 directions still give the density to 1e-4
// (median) and 5e-3 (worst). Their albedos are the tables' first row, so sums are as exact as for rough ones.
// F90 fades to 0 with F0 below 1e-3: a surface that reflects nothing head on reflects nothing at grazing either, and
// F0 = 0 is plain Lambert.
#ifndef OOCPT_BSDF_GLSL
#define OOCPT_BSDF_GLSL

#include "material/bsdf/lobe.glsl"
#include "generated/lobe_functions.glsl"

const float MIN_VIEW_COSINE = 1.0e-3;

// A normal in the plane of n and wo that wo sees at MIN_VIEW_COSINE at least.
vec3 bent_normal(vec3 n, vec3 wo) {
    const float cosine = dot(n, wo);
    if (cosine >= MIN_VIEW_COSINE) return n;
    const vec3 across = n - cosine * wo;
    const float size2 = dot(across, across);
    if (!(size2 > 1.0e-12)) return wo;
    return normalize(across * (sqrt(1.0 - MIN_VIEW_COSINE * MIN_VIEW_COSINE) * inversesqrt(size2))
                     + MIN_VIEW_COSINE * wo);
}

// `s` is valid (valid_shading); wo unit, from the surface to the viewer.
Bsdf make_bsdf(const Shading s, vec3 wo) {
    Bsdf b;
    const Lambert lambert = make_lambert(s.geometric_normal, s.normal, -wo);
    b.g = lambert.g;
    b.l = lambert.n;
    b.n = b.l;
    b.t = b.b = b.o = vec3(0.0);
    b.alpha = s.roughness < SHARP_ROUGHNESS ? 0.0 : s.roughness * s.roughness;
    b.row = HAS_MATERIALS ? table_row(s.roughness) : 0.0;
    b.coat_alpha = b.coat_row = 0.0;
    if (HAS_COAT) {
        b.coat_alpha = s.clearcoat_roughness < SHARP_ROUGHNESS ? 0.0 : s.clearcoat_roughness * s.clearcoat_roughness;
        b.coat_row = table_row(s.clearcoat_roughness);
    }
    b.flags = 0u;
    if (HAS_HAIR && (s.flags & SHADING_HAIR) != 0u) {
        b.flags = BSDF_HAIR;
        b.hair = make_hair(s.hair, s.tangent, cross(s.geometric_normal, s.tangent), b.l, s.ior, wo);
        b.chance = no_chances();
        b.opaque = b.glass = b.glass_alpha = 0.0;
        return b;
    }
    vec3 color = vec3(0.0);
    b.metallic = 0.0;
    b.coat = 0.0;
    b.f0 = vec3(0.0);
    const float opacity = HAS_TRANSMISSION && (s.flags & SHADING_PRESENCE) == 0u ? s.opacity : 1.0;
    float through = 0.0;
    if (HAS_MATERIALS) set_fresnel(b, s, opacity, color, through);
    b.opaque = 1.0 - through;
    const vec3 base = s.diffuse_color * ((1.0 - b.metallic) * opacity);
    b.scatter = vec3(0.0);
    b.glass = through;
    b.glass_scatter = b.glass_lost = b.glass_stay = b.glass_alpha = b.glass_row = b.glass_place = 0.0;
    b.glass_ior = b.glass_eta = 1.0;
    b.glass_tint = HAS_OPEN_PBR && (s.flags & SHADING_OPEN_PBR) != 0u ? s.transmission_color : vec3(1.0);
    b.under_coat = b.under_sheen = 1.0;
    b.sheen = vec3(0.0);
    b.sheen_most = b.sheen_roughness = b.sheen_row = 0.0;
    b.stretch = no_stretch(b.alpha);
    b.coat_stretch = no_stretch(b.coat_alpha);
    b.film = HAS_THIN_FILM ? s.film : vec3(0.0);
    vec3 more = vec3(0.0);
    b.diffuse_more = vec3(0.0);
    b.eon.roughness = 0.0;
    if (HAS_ROUGH_DIFFUSE && s.diffuse_roughness > 0.0) {
        b.eon = make_eon(s.diffuse_roughness, b.l, wo);
        more = eon_scattered(s.diffuse_color, s.diffuse_roughness) * ((1.0 - b.metallic) * opacity);
        b.diffuse_more = more;
    }
    if (!HAS_MATERIALS) b.bare = b.bare_glass = vec3(0.0);
    if (HAS_SHEEN) {
        b.sheen_most = b.opaque > 0.0 ? largest(s.sheen_color) : 0.0;
        b.sheen_roughness = s.sheen_roughness;
        b.sheen_row = sheen_row(s.sheen_roughness);
        b.sheen = b.opaque * s.sheen_color * sheen_average(b.sheen_row).y;
    }
    b.chance = no_chances();
    if (!HAS_MATERIALS || !has_lobe_over_diffuse(b)) {
        b.diffuse = base;
        b.chance.diffuse = mean(base) > 0.0 ? 1.0 : 0.0;
        b.flags = BSDF_PLAIN;
        return b;
    }

    b.n = bent_normal(b.l, wo);
    tangents(b.n, b.t, b.b);
    if (HAS_ANISOTROPY && min(s.anisotropy.x, s.anisotropy.z) < 1.0) {
        const vec3 along = s.tangent - b.n * dot(b.n, s.tangent);
        const float size2 = dot(along, along);
        if (size2 > 1.0e-6) {
            b.t = along * inversesqrt(size2);
            b.b = cross(b.n, b.t);
        }
        b.stretch = make_stretch(b.alpha, s.anisotropy.x, s.anisotropy.y);
        if (HAS_COAT) b.coat_stretch = make_stretch(b.coat_alpha, s.anisotropy.z, s.anisotropy.w);
    }
    b.o = vec3(dot(b.t, wo), dot(b.b, wo), clamp(dot(b.n, wo), MIN_VIEW_COSINE, 1.0));
    b.under_sheen = under_sheen(b, b.o.z);
    float lost, average_lost;
    const vec3 under = under_all(b, b.o.z, lost);
    const vec3 average = average_under(b, average_lost);
    const vec3 scale = vec3(average.x > 1.0e-5 ? 1.0 / average.x : 0.0, average.y > 1.0e-5 ? 1.0 / average.y : 0.0,
                            average.z > 1.0e-5 ? 1.0 / average.z : 0.0);
    b.diffuse = base * under * scale;
    if (HAS_ROUGH_DIFFUSE) b.diffuse_more = more * under * scale;
    if (average_lost > 1.0e-9) b.scatter = color * (lost / average_lost);
    else color = vec3(0.0);
    b.under_coat = under_coat(b, b.o.z);
    b.chance = lobe_chances(b, LobeInputs(s, wo, base, color, under, lost));
    return b;
}

// The inputs that all lobes share for a direction; `w`: it, or it mirrored at the surface.
LobeDirection lobe_direction(const Bsdf b, vec3 w, bool beyond) {
    LobeDirection d;
    d.w = w;
    d.i = vec3(0.0);
    d.beyond = beyond;
    d.broad = max(dot(b.l, w), 0.0) / PI;
    d.cosine = d.broad * PI;
    if (HAS_ROUGH_TRANSMISSION && beyond) d.cosine = -dot(b.l, w);
    d.under = vec3(1.0);
    d.lost = 0.0;
    if (is_plain(b)) return d;
    d.i = to_frame(b, w);
    if (d.broad > 0.0 && (b.chance.diffuse > 0.0 || b.chance.scatter > 0.0)) {
        d.under = under_all(b, min(d.cosine, 1.0), d.lost);
    }
    return d;
}

// f * |cosine|, apart for lights' multipliers; pdf of bsdf_sample. Sharp lobes count nothing. wo is that of make_bsdf.
void bsdf_evaluate_lobes(const Bsdf b, vec3 wo, vec3 wi, out vec3 diffuse, out vec3 specular, out float pdf) {
    diffuse = vec3(0.0);
    specular = vec3(0.0);
    pdf = 0.0;
    if (is_hair(b)) {
        const vec4 value = hair_evaluate(b.hair, wi);
        specular = value.rgb;
        pdf = value.a;
        return;
    }
    const float cosine = dot(b.g, wi);
    const bool beyond = HAS_ROUGH_TRANSMISSION && cosine < 0.0 && b.glass_alpha > 0.0;
    if (!beyond && !(cosine > 0.0)) return;
    const vec3 mirrored = wi - 2.0 * cosine * b.g;
    const float side = HAS_ROUGH_TRANSMISSION && beyond ? -1.0 : 1.0;
    // Two directions share one copy of the code: unrolled, it would be half of the code of a pass that shades.
    vec3 w = wi;
    [[dont_unroll]] for (uint i = 0u; i < 2u; ++i) {
        add_lobes(b, lobe_direction(b, w, beyond), diffuse, specular, pdf);
        if (!(side * dot(b.l, mirrored) > 0.0 || side * dot(b.n, mirrored) > 0.0)) break;
        w = mirrored;
    }
}

vec4 bsdf_evaluate(const Bsdf b, vec3 wo, vec3 wi) {
    vec3 diffuse, specular;
    float pdf;
    bsdf_evaluate_lobes(b, wo, wi, diffuse, specular, pdf);
    return vec4(diffuse + specular, pdf);
}

// A direction, u.xy by the lobe that u.z falls on. False: nothing is reflected. `evaluates`: weight and pdf are for
// bsdf_weigh to find; else they are here, pdf 0 for sharp lobes.
bool bsdf_choose(const Bsdf b, vec3 wo, vec4 u, out vec3 wi, out vec3 weight, out float pdf, out bool evaluates) {
    evaluates = false;
    wi = b.g;
    weight = vec3(0.0);
    pdf = 0.0;
    if (is_hair(b)) {
        evaluates = hair_sample(b.hair, u.xyz, wi);
        return evaluates;
    }
    vec3 place = u.xyz;
    LobeSample s;
    if (!sample_lobe(b, choose_lobe(b.chance, place.z), place, s)) return false;
    wi = s.wi;
    if (is_plain(b)) {
        pdf = lambert_density(Lambert(b.g, b.l), wi);
        weight = b.diffuse;
        evaluates = HAS_ROUGH_DIFFUSE && b.eon.roughness > 0.0 && pdf > 0.0;
        return pdf > 0.0;
    }
    evaluates = !s.sharp;
    weight = s.weight;
    return true;
}

// Weight of a direction that bsdf_choose chose, by its value and density; false if that is not finite.
bool bsdf_weigh(vec3 value, float pdf, out vec3 weight) {
    weight = vec3(0.0);
    if (!(pdf > 0.0 && pdf < 3.0e38)) return false;
    weight = value / pdf;
    return true;
}

// A direction and its weight = f * |cosine| / pdf; pdf 0: sharp, weight holds all of it. u as for bsdf_choose. False:
// nothing is reflected.
bool bsdf_sample(const Bsdf b, vec3 wo, vec4 u, out vec3 wi, out vec3 weight, out float pdf) {
    bool evaluates;
    if (!bsdf_choose(b, wo, u, wi, weight, pdf, evaluates)) return false;
    if (!evaluates) return true;
    const vec4 value = bsdf_evaluate(b, wo, wi);
    pdf = value.a;
    return bsdf_weigh(value.rgb, pdf, weight);
}

#endif
