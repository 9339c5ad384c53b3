// SPDX-License-Identifier: Apache-2.0
// The parameters that material evaluation passes to the BSDF: the inputs of UsdPreviewSurface and OpenPBR after
// textures, and the normals.
//
// Guarantee of valid_shading: every number is finite and in its range, so bsdf.glsl need not test again.
#ifndef OOCPT_SHADING_GLSL
#define OOCPT_SHADING_GLSL

const uint SHADING_SPECULAR_WORKFLOW = 1u; // specular_color is F0; else ior and metallic give F0
// Opacity was tested in traversal (opacityThreshold > 0 or opacityMode = presence): it is not used here.
const uint SHADING_PRESENCE = 2u;

// coat_ior and transmission_color count; else the coat has the index of the base, and glass is clear.
const uint SHADING_OPEN_PBR = 4u;

// A sheet without an inside: transmitted light goes straight on.
const uint SHADING_THIN_WALLED = 8u;

// The surface is a fibre (bsdf/hair.glsl), and nothing else: of the rest of Shading normals, tangent, emission and ior
// count.
const uint SHADING_HAIR = 16u;

// True if directions may lead through a surface.
const bool HAS_BEYOND = HAS_TRANSMISSION || HAS_HAIR;

struct HairShading {
    vec3 tint_r, tint_tt, tint_trt; // >= 0, of the lobes
    vec3 absorption; // >= 0, by the fibre's radius
    vec3 variance;   // along the fibre, of R, TT, TRT; 0.001..1, as the next
    vec3 spread;     // across it: scale of the logistic before the factor sqrt(pi / 8)
    float tilt;      // of the cuticle's scales, radians
    float offset;    // where it is met across its width, -1..1, or HAIR_BY_NORMAL
};

struct Shading {
    vec3 geometric_normal; // unit, authored side: outside of what is transmissive
    vec3 normal;           // unit shading normal after the normal map, authored side
    vec3 diffuse_color;    // 0..1
    vec3 specular_color;   // 0..1; with SHADING_SPECULAR_WORKFLOW
    vec3 emission;         // >= 0; not the BSDF's matter
    float metallic;        // 0..1
    float roughness;       // 0..1, of the specular lobe; its alpha is the square
    float ior;             // >= 0
    float clearcoat;       // 0..1
    float clearcoat_roughness; // 0..1
    float opacity;         // 0..1: what is left of it is transmitted
    uint flags;            // SHADING_*
    vec3 sheen_color;      // 0..1; see the book, design/bsdf
    float sheen_roughness; // 0..1
    vec3 transmission_color; // 0..1: of each refraction
    float coat_ior;        // >= 1
    vec3 tangent;          // with ANISOTROPY: unit, where u grows, or 0 where nobody knows
    vec4 anisotropy;       // ratio of the alphas across and along the tangent, 0.02..1, and turn of the tangent, 1 = a
                           // whole one; of the base, then of the coat
    vec3 film;             // weight, 0..1; thickness in nm; index, >= 1
    vec3 absorption;       // per length inside, >= 0; not the BSDF's matter
    float diffuse_roughness; // 0..1; with ROUGH_DIFFUSE
    float dispersion;        // 1 / Abbe number, 0..10; with DISPERSION
    HairShading hair;      // with SHADING_HAIR
};

// A white fibre, with MaterialX's defaults for all else.
HairShading white_hair() {
    return HairShading(vec3(1.0), vec3(1.0), vec3(1.0), vec3(0.0), vec3(0.1, 0.05, 0.2), vec3(0.1, 0.05, 0.2), 0.0,
                       HAIR_BY_NORMAL);
}

// Least ratio of the two alphas of an anisotropic lobe.
const float MIN_ALPHA_RATIO = 0.02;

// The material of a surface that has none: diffuse and nothing else (specular F0 = 0).
Shading diffuse_shading(vec3 geometric_normal, vec3 normal, vec3 color) {
    return Shading(geometric_normal, normal, color, vec3(0.0), vec3(0.0), 0.0, 0.5, 1.5, 0.0, 0.01, 1.0,
                   SHADING_SPECULAR_WORKFLOW, vec3(0.0), 0.5, vec3(1.0), 1.5, vec3(0.0), vec4(1.0, 0.0, 1.0, 0.0),
                   vec3(0.0), vec3(0.0), 0.0, 0.0, white_hair());
}

float unit_range(float x) {
    return x > 0.0 ? min(x, 1.0) : 0.0; // NaN is 0
}

vec3 unit_range(vec3 c) {
    return vec3(unit_range(c.x), unit_range(c.y), unit_range(c.z));
}

vec3 valid_emission(vec3 e) {
    return vec3(e.x > 0.0 ? min(e.x, 3.0e38) : 0.0, e.y > 0.0 ? min(e.y, 3.0e38) : 0.0,
                e.z > 0.0 ? min(e.z, 3.0e38) : 0.0);
}

// `x` in the range that a fibre's roughness has, as MaterialX limits it; NaN is its middle.
vec3 hair_range(vec3 x) {
    return vec3(x.x >= 0.0 ? clamp(x.x, 1.0e-3, 1.0) : 0.1, x.y >= 0.0 ? clamp(x.y, 1.0e-3, 1.0) : 0.1,
                x.z >= 0.0 ? clamp(x.z, 1.0e-3, 1.0) : 0.1);
}

HairShading valid_hair(HairShading h) {
    h.tint_r = min(valid_emission(h.tint_r), vec3(1.0e3));
    h.tint_tt = min(valid_emission(h.tint_tt), vec3(1.0e3));
    h.tint_trt = min(valid_emission(h.tint_trt), vec3(1.0e3));
    h.absorption = valid_emission(h.absorption);
    h.variance = hair_range(h.variance);
    h.spread = hair_range(h.spread);
    h.tilt = abs(h.tilt) < 1.0e3 ? h.tilt : 0.0;
    h.offset = abs(h.offset) <= 1.0 ? h.offset : HAIR_BY_NORMAL;
    return h;
}

// Makes any numbers valid; normals are left alone.
Shading valid_shading(Shading s) {
    s.diffuse_color = unit_range(s.diffuse_color);
    s.specular_color = unit_range(s.specular_color);
    s.emission = valid_emission(s.emission);
    s.metallic = unit_range(s.metallic);
    s.roughness = unit_range(s.roughness);
    s.ior = s.ior >= 0.0 ? min(s.ior, 1.0e3) : 1.5;
    s.clearcoat = unit_range(s.clearcoat);
    s.clearcoat_roughness = unit_range(s.clearcoat_roughness);
    s.sheen_color = unit_range(s.sheen_color);
    s.sheen_roughness = unit_range(s.sheen_roughness);
    s.transmission_color = unit_range(s.transmission_color);
    s.coat_ior = s.coat_ior >= 1.0 ? min(s.coat_ior, 1.0e3) : 1.0;
    s.anisotropy.x = s.anisotropy.x < 1.0 ? max(s.anisotropy.x, MIN_ALPHA_RATIO) : 1.0; // NaN is 1
    s.anisotropy.z = s.anisotropy.z < 1.0 ? max(s.anisotropy.z, MIN_ALPHA_RATIO) : 1.0;
    s.anisotropy.y = abs(s.anisotropy.y) < 1.0e6 ? s.anisotropy.y : 0.0;
    s.anisotropy.w = abs(s.anisotropy.w) < 1.0e6 ? s.anisotropy.w : 0.0;
    s.film.x = unit_range(s.film.x);
    s.film.y = s.film.y > 0.0 ? min(s.film.y, 1.0e5) : 0.0;
    s.film.z = s.film.z >= 1.0 ? min(s.film.z, 1.0e2) : 1.0;
    s.absorption = valid_emission(s.absorption);
    s.diffuse_roughness = unit_range(s.diffuse_roughness);
    s.dispersion = s.dispersion > 0.0 ? min(s.dispersion, 10.0) : 0.0;
    s.opacity = s.opacity < 1.0 ? max(s.opacity, 0.0) : 1.0; // NaN is 1
    if (HAS_HAIR && (s.flags & SHADING_HAIR) != 0u) s.hair = valid_hair(s.hair);
    return s;
}

#endif
