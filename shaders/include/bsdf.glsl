// SPDX-License-Identifier: Apache-2.0
// The layered BSDF: coat over GGX reflection over diffuse and transmission, driven by UsdPreviewSurface.
//
// The surface is a mixture: (1 - metallic) (1 - opacity) of it is glass, bsdf/glass.glsl, the rest is opaque, on either
// side the same. The opaque part from the top, each layer under what the ones above let through; E is a layer's
// directional albedo, U = 1 - E:
//   sheen         bsdf/sheen.glsl, with SHEEN, which no scene of today has. Below it: min(U(wo), U(wi))
//                 for coat and specular.
//   coat          GGX, white, F0 from ior, times the amount `clearcoat`. Below it: min(U(wo), U(wi)) for the specular
//                 lobe.
//   specular      GGX with Schlick's Fresnel; F0 and F90 as UsdPreviewSurface 2.5 says. What single scattering loses
//                 comes back as a broad lobe F_ms U1(wo) U1(wi) / (pi avg U1), U1 for F = 1 (Kulla and Conty 2017). U1
//                 falls with the square of alpha / cosine, so this lobe is sampled with a density of 1 / (cosine +
//                 alpha), not by the cosine.
//                 A surface half metallic is a mixture of two: what goes below, (1 - metallic), went through the
//                 dielectric's part.
//   diffuse       with ROUGH_DIFFUSE bsdf/eon.glsl instead of a constant; without
//                 color (1 - metallic) opacity U(wo) U(wi) / (pi avg U): reciprocal, and albedo color * U(wo) exactly.
//
// Anisotropic lobes (ANISOTROPY) keep the tables, which are those of isotropic ones: in a white furnace an albedo is
// off by the difference, up to 0.11 above and, at grazing across the narrow axis, 0.4 below; over all azimuths 0.06.
// Glass and what is scattered more than once is isotropic. A film (THIN_FILM, bsdf/film.glsl) replaces Schlick's
// Fresnel of single scattering, exactly and at any angle; the rest takes F0 from it.
//
// A fibre (HAIR) is none of this: bsdf/hair.glsl.
//
// Normals: directions that leave on the wrong side of the true surface (geometric normal g) are mirrored at it, in
// density and evaluation alike, so no energy is lost or won (as lambert.glsl does). Only where the viewer is below the
// shading normal's horizon the normal of the specular layers is bent to see him.
//
// Numbers: lobes of roughness < 0.01 (alpha < 1e-4) are sharp: at 0.01 f32 directions still give the density to 1e-4
// (median) and 5e-3 (worst). Their albedos are the tables' first row, so sums are as exact as for rough ones.
// F90 fades to 0 with F0 below 1e-3: what reflects nothing head on does not at grazing either, and F0 = 0 is plain
// Lambert.
#ifndef OOCPT_BSDF_GLSL
#define OOCPT_BSDF_GLSL

#include "include/lambert.glsl"
#include "include/bsdf/glass.glsl"

const float LEAST_VIEW_COSINE = 1.0e-3;

// A normal in the plane of n and wo that wo sees at LEAST_VIEW_COSINE at least.
vec3 bent_normal(vec3 n, vec3 wo) {
    const float cosine = dot(n, wo);
    if (cosine >= LEAST_VIEW_COSINE) return n;
    const vec3 across = n - cosine * wo;
    const float size2 = dot(across, across);
    if (!(size2 > 1.0e-12)) return wo;
    return normalize(across * (sqrt(1.0 - LEAST_VIEW_COSINE * LEAST_VIEW_COSINE) * inversesqrt(size2))
                     + LEAST_VIEW_COSINE * wo);
}

// `s` is valid (valid_shading); wo unit, from the surface to the viewer.
Bsdf make_bsdf(Shading s, vec3 wo) {
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
        b.chance = vec4(0.0);
        b.chance_glass = vec2(0.0);
        b.chance_sheen = b.opaque = b.glass = b.glass_alpha = 0.0;
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
    b.glass = b.glass_scatter = b.glass_stay = b.glass_alpha = b.glass_row = b.glass_place = 0.0;
    b.glass_ior = b.glass_eta = 1.0;
    b.chance_glass = vec2(0.0);
    b.glass_tint = HAS_OPEN_PBR && (s.flags & SHADING_OPEN_PBR) != 0u ? s.transmission_color : vec3(1.0);
    b.under_coat = b.under_sheen = 1.0;
    b.sheen = vec3(0.0);
    b.sheen_most = b.sheen_roughness = b.sheen_row = b.chance_sheen = 0.0;
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
    if (!HAS_MATERIALS || (largest(b.f0) <= 0.0 && b.coat <= 0.0 && through <= 0.0 && b.sheen_most <= 0.0)) {
        b.diffuse = base;
        b.chance = vec4(0.0, 0.0, mean(base) > 0.0 ? 1.0 : 0.0, 0.0);
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
    b.o = vec3(dot(b.t, wo), dot(b.b, wo), clamp(dot(b.n, wo), LEAST_VIEW_COSINE, 1.0));
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
    vec4 weight = vec4(0.0, 0.0, mean(base * under), mean(color) * lost);
    b.under_coat = under_coat(b, b.o.z);
    weight.x = b.opaque * (1.0 - b.under_coat) * b.under_sheen;
    weight.y = mean(single_scattering(b));
    vec2 weight_glass = vec2(0.0);
    if (HAS_TRANSMISSION && through > 0.0) weight_glass = set_glass(b, s, wo, through);
    float weight_sheen = 0.0;
    if (HAS_SHEEN && b.sheen_most > 0.0) {
        weight_sheen = b.opaque * mean(s.sheen_color) * sheen_albedo(b.o.z, b.sheen_row);
    }
    const float sum = weight.x + weight.y + weight.z + weight.w + weight_glass.x + weight_glass.y + weight_sheen;
    b.chance = sum > 0.0 ? weight / sum : vec4(0.0);
    b.chance_glass = sum > 0.0 ? weight_glass / sum : vec2(0.0);
    b.chance_sheen = sum > 0.0 ? weight_sheen / sum : 0.0;
    return b;
}

vec3 to_frame(Bsdf b, vec3 w) {
    return vec3(dot(b.t, w), dot(b.b, w), dot(b.n, w));
}

vec3 from_frame(Bsdf b, vec3 w) {
    return normalize(w.x * b.t + w.y * b.b + w.z * b.n);
}

// Diffuse colour towards a direction at this cosine.
vec3 diffuse_towards(Bsdf b, vec3 wi, float cosine) {
    if (!HAS_ROUGH_DIFFUSE || b.eon.roughness <= 0.0) return b.diffuse;
    float single, multiple;
    eon_factors(b.eon, wi, cosine, single, multiple);
    return b.diffuse * single + b.diffuse_more * multiple;
}

// Adds one direction's part before it is mirrored at the surface, or after.
void add_reflection(Bsdf b, vec3 wi, inout vec3 diffuse, inout vec3 specular, inout float pdf) {
    const float broad = max(dot(b.l, wi), 0.0) / PI;
    if (broad > 0.0) {
        if (is_plain(b)) {
            diffuse += diffuse_towards(b, wi, min(broad * PI, 1.0)) * broad;
        } else if (b.chance.z > 0.0 || b.chance.w > 0.0) {
            float lost;
            const float cosine = min(broad * PI, 1.0);
            const vec3 under = under_all(b, cosine, lost);
            diffuse += diffuse_towards(b, wi, cosine) * under * broad;
            specular += b.scatter * (lost * broad);
            if (b.chance.w > 0.0) pdf += b.chance.w * scatter_density(b.alpha, cosine);
        }
        pdf += b.chance.z * broad;
        add_glass_scatter(b, broad * PI, false, specular, pdf);
    }
    if (is_plain(b)) return;
    const vec3 i = to_frame(b, wi);
    if (i.z <= 0.0) return;
    float density;
    if (b.alpha > 0.0 && b.chance.y > 0.0) {
        const float value = lobe_reflect(b.alpha, b.stretch, b.o, i, density);
        const vec3 h = b.o + i;
        const float cosine = dot(b.o, h) * inversesqrt(max(dot(h, h), 1.0e-30));
        specular += specular_reflectance(b, cosine) * (value * through_coat(b, min(i.z, 1.0)) * through_sheen(b, i.z));
        pdf += b.chance.y * density;
    }
    if (HAS_COAT && b.coat_alpha > 0.0 && b.chance.x > 0.0) {
        const float value = lobe_reflect(b.coat_alpha, b.coat_stretch, b.o, i, density);
        const vec3 h = b.o + i;
        const float cosine = dot(b.o, h) * inversesqrt(max(dot(h, h), 1.0e-30));
        specular += b.opaque * b.coat * (b.coat_f0 + (b.coat_f90 - b.coat_f0) * power5(1.0 - clamp(cosine, 0.0, 1.0)))
            * value * through_sheen(b, i.z);
        pdf += b.chance.x * density;
    }
    if (HAS_SHEEN && b.chance_sheen > 0.0) {
        specular += b.sheen * sheen_value(b.sheen_roughness, b.o, i);
        pdf += b.chance_sheen * scatter_density(SHEEN_SPREAD, min(i.z, 1.0));
    }
    add_glass_reflection(b, i, specular, pdf);
}

// f * |cosine|, apart for lights' multipliers; pdf of bsdf_sample. Sharp lobes count nothing. wo is that of make_bsdf.
void bsdf_evaluate_lobes(Bsdf b, vec3 wo, vec3 wi, out vec3 diffuse, out vec3 specular, out float pdf) {
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
    const vec3 mirrored = wi - 2.0 * cosine * b.g;
    if (HAS_ROUGH_TRANSMISSION && cosine < 0.0 && b.glass_alpha > 0.0) {
        add_beyond(b, wi, specular, pdf);
        if (dot(b.l, mirrored) < 0.0 || dot(b.n, mirrored) < 0.0) add_beyond(b, mirrored, specular, pdf);
    }
    if (!(cosine > 0.0)) return;
    // Two directions, one copy of the code: unrolled, it would be half of what a pass that shades is made of.
    vec3 w = wi;
    [[dont_unroll]] for (uint side = 0u; side < 2u; ++side) {
        add_reflection(b, w, diffuse, specular, pdf);
        if (!(dot(b.l, mirrored) > 0.0 || dot(b.n, mirrored) > 0.0)) break;
        w = mirrored;
    }
}

vec4 bsdf_evaluate(Bsdf b, vec3 wo, vec3 wi) {
    vec3 diffuse, specular;
    float pdf;
    bsdf_evaluate_lobes(b, wo, wi, diffuse, specular, pdf);
    return vec4(diffuse + specular, pdf);
}

// Mirrored at the true surface if it left on the wrong side of it; `side` is 1 for reflection, -1 for transmission.
vec3 on_side(Bsdf b, vec3 w, float side) {
    const float cosine = dot(b.g, w);
    return cosine * side < 0.0 ? w - 2.0 * cosine * b.g : w;
}

// A direction of a lobe of multiple scattering, on the viewer's side (1) or beyond (-1).
vec3 scatter_sample(Bsdf b, float alpha, float side, vec2 u) {
    vec3 x, y;
    tangents(b.l, x, y);
    const float cosine = scatter_cosine(alpha, u.x);
    const float sine = sqrt(max(0.0, 1.0 - cosine * cosine));
    const float angle = 2.0 * PI * u.y;
    return on_side(b, normalize(sine * (cos(angle) * x + sin(angle) * y) + side * cosine * b.l), side);
}

// A direction, u.xy by the lobe that u.z falls on. False: nothing is reflected. `evaluates`: weight and pdf are for
// bsdf_weigh to find; else they are here, pdf 0 for sharp lobes.
bool bsdf_choose(Bsdf b, vec3 wo, vec4 u, out vec3 wi, out vec3 weight, out float pdf, out bool evaluates) {
    evaluates = false;
    wi = b.g;
    weight = vec3(0.0);
    pdf = 0.0;
    if (is_hair(b)) {
        evaluates = hair_sample(b.hair, u.xyz, wi);
        return evaluates;
    }
    if (is_plain(b)) {
        const Lambert lambert = Lambert(b.g, b.l);
        wi = lambert_sample(lambert, u.xy);
        pdf = lambert_density(lambert, wi);
        weight = b.diffuse;
        evaluates = HAS_ROUGH_DIFFUSE && b.eon.roughness > 0.0 && pdf > 0.0 && b.chance.z > 0.0;
        return pdf > 0.0 && b.chance.z > 0.0;
    }
    float at = u.z;
    uint lobe = 0u; // 4: sheen or glass
    while (lobe < 4u && at >= b.chance[lobe]) at -= b.chance[lobe++];
    bool is_sheen = false;
    if (HAS_SHEEN && lobe == 4u && b.chance_sheen > 0.0) {
        is_sheen = at < b.chance_sheen || b.chance_glass.x <= 0.0;
        if (!is_sheen) at -= b.chance_sheen;
    }
    if (!is_sheen && lobe == 4u && (!HAS_TRANSMISSION || b.chance_glass.x <= 0.0)) {
        lobe = 3u; // rounding
        while (lobe > 0u && b.chance[lobe] <= 0.0) --lobe;
    }
    if (lobe < 4u && b.chance[lobe] <= 0.0) return false;

    if (HAS_SHEEN && is_sheen) {
        const float cosine = scatter_cosine(SHEEN_SPREAD, u.x);
        const float sine = sqrt(max(0.0, 1.0 - cosine * cosine));
        const float angle = 2.0 * PI * u.y;
        wi = on_side(b, from_frame(b, vec3(sine * cos(angle), sine * sin(angle), cosine)), 1.0);
    } else if (HAS_TRANSMISSION && lobe == 4u) {
        if (!HAS_ROUGH_TRANSMISSION || at < b.chance_glass.x || b.chance_glass.y <= 0.0) {
            vec3 i;
            if (!sample_glass(b, vec3(u.xy, at / b.chance_glass.x), i, weight)) return false;
            wi = on_side(b, from_frame(b, i), i.z);
            weight *= b.glass / b.chance_glass.x;
            if (b.glass_alpha <= 0.0) return true;
        } else {
            const float part = (at - b.chance_glass.x) / b.chance_glass.y;
            const float side = part < b.glass_stay ? 1.0 : -1.0;
            wi = scatter_sample(b, b.glass_alpha, side, u.xy);
        }
    } else if (lobe == 2u) {
        wi = lambert_sample(Lambert(b.g, b.l), u.xy);
    } else if (lobe == 3u) {
        wi = scatter_sample(b, b.alpha, 1.0, u.xy);
    } else {
        const float alpha = lobe == 0u ? b.coat_alpha : b.alpha;
        if (alpha <= 0.0) {
            wi = on_side(b, from_frame(b, vec3(-b.o.xy, b.o.z)), 1.0);
            vec3 all = lobe == 0u ? vec3(b.opaque * (1.0 - b.under_coat) * b.under_sheen) : single_scattering(b);
            if (HAS_THIN_FILM && lobe == 1u && b.film.x > 0.0) {
                all = b.under_sheen * b.under_coat * specular_reflectance(b, b.o.z);
            }
            weight = all / b.chance[lobe];
            return true;
        }
        Stretch stretch = b.stretch;
        if (HAS_COAT && lobe == 0u) stretch = b.coat_stretch;
        const vec3 h = lobe_sample(alpha, stretch, b.o, u.xy);
        const vec3 i = 2.0 * dot(b.o, h) * h - b.o;
        if (!(i.z > 0.0)) return false;
        wi = on_side(b, from_frame(b, i), 1.0);
    }
    evaluates = true;
    weight = vec3(0.0);
    return true;
}

// Weight of a direction that bsdf_choose chose, by its value and density; false where that is no number.
bool bsdf_weigh(vec3 value, float pdf, out vec3 weight) {
    weight = vec3(0.0);
    if (!(pdf > 0.0 && pdf < 3.0e38)) return false;
    weight = value / pdf;
    return true;
}

// A direction and its weight = f * |cosine| / pdf; pdf 0: sharp, weight holds all of it. u as for bsdf_choose. False:
// nothing is reflected.
bool bsdf_sample(Bsdf b, vec3 wo, vec4 u, out vec3 wi, out vec3 weight, out float pdf) {
    bool evaluates;
    if (!bsdf_choose(b, wo, u, wi, weight, pdf, evaluates)) return false;
    if (!evaluates) return true;
    const vec4 value = bsdf_evaluate(b, wo, wi);
    pdf = value.a;
    return bsdf_weigh(value.rgb, pdf, weight);
}

#endif
