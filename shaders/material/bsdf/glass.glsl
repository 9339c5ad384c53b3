// SPDX-License-Identifier: Apache-2.0
// Glass: reflection and refraction by one interface, rough or sharp (Walter et al. 2007, "Microfacet Models for
// Refraction through Rough Surfaces"; visible normals as in ggx.glsl). The lobes are lobes/glass.glsl, single
// scattering, and lobes/glass_scatter.glsl. With N = index there / index here, h the normal that refracts o to i:
//   reflection  F(o.h) D G2(o, i) / (4 o.z), height-correlated
//   refraction  (1 - F(o.h)) D G1(o) G1(i) |o.h| |i.h| N^2 / (o.z (o.h + N i.h)^2), times |cosine|
// F is exact; in the specular workflow it is Schlick's of specular_color, at the cosine on the side of the lower index.
// The BSDF transports basic radiance (L / n^2), so refracted light is not scaled by n^2, and the symmetric quantity is
// value / (n^2 |cosine| there).
//
// The loss of single scattering, U = 1 - E on either side (table_glass), comes back as a lobe to both sides as Kulla
// and Conty (2017) have it for reflection: U(o) U(i) / (pi (avg U_1 + N^2 avg U_2)), indices of the two sides and light
// to either by n^2: symmetric, and nothing is lost. In the specular workflow E is not known, and there is single
// scattering only.
//
// If alpha times the bending by refraction is below the resolution of f32 directions, the interface is sharp; so is one
// of ior 1, which bends nothing. Thin walls (THIN_WALLS) bend nothing either: transmitted light goes straight on, for
// rough ones as blurred as reflected light; the loss of single scattering is that of reflection with F = 1
// (tables.glsl), and goes to either side by the mean reflectance of both interfaces. A coat has the index of the glass:
// between the two there is no reflection, and only the coat's roughness shows. An ior below 1 is a denser outside.
#ifndef OOCPT_BSDF_GLASS_GLSL
#define OOCPT_BSDF_GLASS_GLSL

#include "material/bsdf/layers.glsl"
#include "material/bsdf/glass_table.glsl"

const float GLASS_MIN_ALPHA = 1.0e-4;

bool is_inside(const Bsdf b) {
    return b.glass_eta < 1.0;
}

// A sheet without an inside: OpenPBR's thin walls.
bool is_thin(const Bsdf b) {
    return HAS_THIN_WALLS && is(b, BSDF_THIN);
}

// The reflectance of the interface with the film on it.
vec3 with_film(const Bsdf b, vec3 bare, float outer) {
    if (!HAS_THIN_FILM || b.film.x <= 0.0) return bare;
    return mix(bare, film_reflectance(b.film, b.bare_glass, outer), b.film.x);
}

// Sets the members for glass; b.o and b.glass must be set.
void set_glass(inout Bsdf b, const Shading s, vec3 wo) {
    const bool inside = (dot(s.geometric_normal, wo) < 0.0) != (s.ior < 1.0);
    b.glass_ior = s.ior < 1.0 ? 1.0 / max(s.ior, 1.0e-3) : s.ior;
    b.glass_eta = inside ? 1.0 / b.glass_ior : b.glass_ior;
    if ((s.flags & SHADING_SPECULAR_WORKFLOW) != 0u) b.flags |= BSDF_SCHLICK;
    if (HAS_THIN_WALLS && (s.flags & SHADING_THIN_WALLED) != 0u) {
        b.flags |= BSDF_THIN;
        b.glass_eta = 1.0;
    }
    if (!HAS_ROUGH_TRANSMISSION) return;
    const float roughness = HAS_COAT ? mix(s.roughness, s.clearcoat_roughness, s.clearcoat) : s.roughness;
    const float alpha = roughness * roughness;
    if (!(alpha * min(2.0 * (b.glass_ior - 1.0), 1.0) >= GLASS_MIN_ALPHA)) return;
    b.glass_alpha = alpha;
    b.glass_row = table_row(roughness);
    if (is_thin(b)) {
        const float average = table_average(b.glass_row).x;
        if (!(average > 1.0e-9)) return;
        const float lost = table_albedo(b.o.z, b.glass_row).x;
        const float r = mean(b.base_0) + (1.0 - mean(b.base_0)) * (1.0 / 21.0);
        b.glass_scatter = b.glass * lost / average;
        b.glass_stay = 2.0 * r / (1.0 + r);
        b.glass_lost = lost;
        return;
    }
    if (is(b, BSDF_SCHLICK)) return;
    b.glass_place = glass_place(b.glass_ior, alpha);
    const vec2 average = table_glass_average(b.glass_place, b.glass_row) * vec2(1.0, b.glass_ior * b.glass_ior);
    const float sum = average.x + average.y;
    if (!(sum > 1.0e-9)) return;
    const float here = table_glass(b.glass_place, b.glass_row, b.o.z, inside);
    b.glass_scatter = b.glass * here / sum;
    b.glass_stay = (inside ? average.y : average.x) / sum;
    b.glass_lost = here;
}

// Fresnel reflectance of the interface at a cosine on the viewer's side; of a sheet that of both of its interfaces,
// as often as light goes back and forth: R + R (1 - R)^2 / (1 - R^2) = 2 R / (1 + R).
vec3 glass_reflectance(const Bsdf b, float cosine) {
    const bool thin = is_thin(b);
    const float there = refracted_cosine(cosine, 1.0 / (thin ? b.glass_ior : b.glass_eta));
    if (is_inside(b) && there <= 0.0) return vec3(1.0);
    const float outer = is_inside(b) ? there : cosine;
    if (is(b, BSDF_SCHLICK)) {
        const vec3 r = schlick(b.base_0, b.base_0 + b.base_b, outer);
        return thin ? 2.0 * r / (1.0 + r) : r;
    }
    const vec3 r = with_film(b, vec3(dielectric_reflectance(outer, is_inside(b) ? cosine : there, b.glass_ior)), outer);
    return thin ? 2.0 * r / (1.0 + r) : r;
}

#endif
