// SPDX-License-Identifier: Apache-2.0
// The BSDF's parameters, and how much light goes through its layers: U and its averages. bsdf.glsl explains the
// letters.
#ifndef OOCPT_BSDF_LAYERS_GLSL
#define OOCPT_BSDF_LAYERS_GLSL

#include "generated/lobes.glsl"
#include "material/shading.glsl"
#include "material/bsdf/tables.glsl"
#include "material/bsdf/ggx.glsl"
#include "material/bsdf/sheen.glsl"
#include "material/bsdf/film.glsl"
#include "material/bsdf/hair.glsl"
#include "material/bsdf/eon.glsl"

const uint BSDF_SCHLICK = 1u;  // glass of the specular workflow: Schlick's Fresnel from specular_color
const uint BSDF_THIN = 2u;     // glass without an inside
const uint BSDF_PLAIN = 4u;    // Lambert and nothing else
const uint BSDF_HAIR = 8u;     // a fibre and nothing else

struct Bsdf {
    vec3 g;  // geometric normal, viewer's side
    vec3 l;  // shading normal of the diffuse lobe, g's side
    vec3 n;  // that of the specular layers, bent to see the viewer
    vec3 t, b; // completes n
    vec3 o;  // wo in that frame
    vec3 f0, f90;
    vec3 base_0, base_l, base_b; // E of the dielectric with multiple scattering: base_0 + base_l L + base_b B
    vec3 diffuse;     // f * pi is diffuse * U(wi)
    vec3 scatter;     // the same of multiple scattering: scatter * U1(wi)
    float metallic;
    float alpha, row; // of the specular layer; 0: sharp. row: in the tables
    float coat;       // amount
    float coat_f0, coat_f90;
    float coat_alpha, coat_row;
    float under_coat; // U(wo) of the coat
    LobeChances chance; // of a sample to be a lobe's
    float opaque;     // share of all that is not glass
    float glass;      // and of glass, glass.glsl
    float glass_scatter; // multiple scattering, f * pi is this times U(wi) n^2 of its side
    float glass_lost; // what single scattering loses at wo, 0 where nothing makes up for it
    float glass_stay; // share of multiple scattering that stays on the viewer's side
    float glass_alpha, glass_row, glass_place; // 0: sharp; row and place: in the table
    float glass_ior;  // index of the denser side / that of the other, >= 1
    float glass_eta;  // index beyond / index on the viewer's side
    vec3 glass_tint;  // of what is refracted
    vec3 sheen;       // colour, share and scale of its lobe; sheen.glsl
    float sheen_most; // share of what it takes from what is below, per E
    float sheen_roughness, sheen_row;
    float under_sheen; // U(wo) of it
    Stretch stretch, coat_stretch; // with ANISOTROPY
    vec3 film;        // with THIN_FILM: film.glsl
    vec3 bare, bare_glass; // F0 below it: of the specular layer, as f0 is, and of glass
    Eon eon;          // with ROUGH_DIFFUSE
    vec3 diffuse_more; // as diffuse, of its second term
    Hair hair;        // with HAIR and BSDF_HAIR
#ifdef OOCPT_FAULTS
    vec3 toy_lobe;    // with TOY_LOBE
#endif
    uint flags;
};

bool is(const Bsdf b, uint flag) {
    return (b.flags & flag) != 0u;
}

bool is_hair(const Bsdf b) {
    return HAS_HAIR && is(b, BSDF_HAIR);
}

// Lambert and nothing else; known when the passes are compiled if the scene has no materials.
bool is_plain(const Bsdf b) {
    return !HAS_MATERIALS || is(b, BSDF_PLAIN);
}

// The true surface's normal, on the viewer's side. A ray that goes through (dot(wi, this) < 0) starts on its other
// side.
vec3 bsdf_normal(const Bsdf b) {
    return b.g;
}

float mean(vec3 c) {
    return (c.x + c.y + c.z) * (1.0 / 3.0);
}

// U of sheen.
float under_sheen(const Bsdf b, float cosine) {
    if (!HAS_SHEEN || b.sheen_most <= 0.0) return 1.0;
    return clamp(1.0 - b.sheen_most * sheen_albedo(cosine, b.sheen_row), 0.0, 1.0);
}

// U of the coat.
float under_coat(const Bsdf b, float cosine) {
    if (!HAS_COAT || b.coat <= 0.0) return 1.0;
    const vec2 e = table_albedo(cosine, b.coat_row);
    return clamp(1.0 - b.coat * (b.coat_f0 * (1.0 - e.x - e.y) + b.coat_f90 * e.y), 0.0, 1.0);
}

// U of the dielectric; `e`: its L and B.
vec3 under_specular(const Bsdf b, float cosine, out vec2 e) {
    e = table_albedo(cosine, b.row);
    return clamp(1.0 - (b.base_0 + b.base_l * e.x + b.base_b * e.y), 0.0, 1.0);
}

// U of all layers for light that goes down to the diffuse lobe or comes up from it; `lost`: that of sheen and coat
// times U1, the loss of single scattering with F = 1.
vec3 under_all(const Bsdf b, float cosine, out float lost) {
    const float coat = under_coat(b, cosine) * under_sheen(b, cosine);
    vec2 e;
    const vec3 under = under_specular(b, cosine, e);
    lost = coat * e.x;
    return coat * under;
}

// Averages of under_all over the hemisphere.
vec3 average_under(const Bsdf b, out float lost) {
    const vec2 e = table_average(b.row);
    vec3 average = 1.0 - (b.base_0 + b.base_l * e.x + b.base_b * e.y);
    lost = e.x;
    vec3 below_sheen = vec3(1.0);
    float lost_below_sheen = 1.0;
    if (HAS_SHEEN && b.sheen_most > 0.0) {
        const float sheen = b.sheen_most * sheen_average(b.sheen_row).x;
        const vec2 both = b.sheen_most * sheen_product(b.sheen_row, b.row);
        below_sheen = average - (sheen - (b.base_0 * sheen + b.base_l * both.x + b.base_b * both.y));
        lost_below_sheen = e.x - both.x;
    }
    if (HAS_COAT && b.coat > 0.0) {
        const vec2 c = table_average(b.coat_row);
        const vec2 f = b.coat * vec2(-b.coat_f0, b.coat_f90 - b.coat_f0); // E of the coat is f0 + f.x L + f.y B
        const float f0 = b.coat * b.coat_f0;
        const float coat = f0 + dot(f, c);
        const vec4 p = table_product(b.row, b.coat_row);
        const vec2 both = f0 * e + vec2(dot(p.xy, f), dot(p.zw, f)); // averages of L and B times E of the coat
        average = average - coat + b.base_0 * coat + b.base_l * both.x + b.base_b * both.y;
        lost -= both.x;
    }
    if (HAS_SHEEN && b.sheen_most > 0.0) {
        // With a coat too the average of all three is at most that of any two: some is lost, and nothing won.
        average = min(average, below_sheen);
        lost = min(lost, lost_below_sheen);
    }
    return average;
}

// The share of light that a reflection pays to sheen, down and up.
float through_sheen(const Bsdf b, float cosine) {
    return HAS_SHEEN ? min(b.under_sheen, under_sheen(b, cosine)) : 1.0;
}

// The share of light that a reflection pays to the coat, down and up.
float through_coat(const Bsdf b, float cosine) {
    return HAS_COAT ? min(b.under_coat, under_coat(b, cosine)) : 1.0;
}

// F_ms of Kulla and Conty for a layer that loses `lost` on average at F = 1.
vec3 scattered(vec3 f0, vec3 f90, float lost) {
    const vec3 f = f0 + (f90 - f0) * (1.0 / 21.0);
    return f * f * (1.0 - lost) / (1.0 - f * lost);
}

float largest(vec3 c) {
    return max(c.x, max(c.y, c.z));
}

// Sets F0, F90 and the members that depend on them; `color`: F_ms, 0 for sharp lobes; `through`: the share that is
// glass.
void set_fresnel(inout Bsdf b, const Shading s, float opacity, out vec3 color, out float through) {
    const float r = (1.0 - s.ior) / (1.0 + s.ior);
    const float f0 = r * r;
    const bool specular = (s.flags & SHADING_SPECULAR_WORKFLOW) != 0u;
    b.metallic = specular ? 0.0 : s.metallic;
    const vec3 metal = b.metallic * s.diffuse_color;
    through = HAS_TRANSMISSION ? (1.0 - b.metallic) * (1.0 - opacity) : 0.0;
    const float plastic = (1.0 - b.metallic) * opacity;
    b.base_0 = specular ? s.specular_color : vec3(f0);
    if (HAS_THIN_FILM) b.bare = plastic * b.base_0 + metal;
    if (HAS_THIN_FILM) b.bare_glass = b.base_0;
    if (HAS_THIN_FILM && s.film.x > 0.0) b.base_0 = mix(b.base_0, film_reflectance(s.film, b.base_0, 1.0), s.film.x);
    const vec3 f90 = vec3(min(1.0, 1.0e3 * largest(b.base_0)));
    b.f0 = plastic * b.base_0 + metal;
    b.f90 = plastic * f90 + metal;
    b.base_b = f90 - b.base_0;
    b.base_l = -b.base_0;
    color = vec3(0.0);
    if (largest(b.f0) > 0.0 && b.alpha > 0.0) {
        const float lost = table_average(b.row).x;
        const vec3 back = scattered(b.base_0, f90, lost);
        color = plastic * back + b.metallic * scattered(s.diffuse_color, s.diffuse_color, lost);
        b.base_l += back;
    }
    float coat_f0 = f0;
    if (HAS_OPEN_PBR && HAS_COAT && (s.flags & SHADING_OPEN_PBR) != 0u) {
        const float c = (s.coat_ior - 1.0) / (s.coat_ior + 1.0);
        coat_f0 = c * c;
    }
    b.coat = HAS_COAT && coat_f0 > 0.0 ? s.clearcoat : 0.0;
    b.coat_f0 = coat_f0;
    b.coat_f90 = min(1.0, 1.0e3 * coat_f0);
}

// Fresnel reflectance of the specular layer at the cosine of half vector and direction, by the opaque share.
vec3 specular_reflectance(const Bsdf b, float cosine) {
    const vec3 plain = schlick(b.f0, b.f90, cosine);
    if (!HAS_THIN_FILM || b.film.x <= 0.0 || b.opaque <= 0.0) return plain;
    return mix(plain, b.opaque * film_reflectance(b.film, b.bare / b.opaque, clamp(cosine, 0.0, 1.0)), b.film.x);
}

// Albedo of the specular layer at wo without multiple scattering, under coat and sheen: all of a sharp lobe's weight.
vec3 single_scattering(const Bsdf b) {
    const vec2 e = table_albedo(b.o.z, b.row);
    return b.under_sheen * b.under_coat * (b.f0 * (1.0 - e.x - e.y) + b.f90 * e.y);
}

#endif
