// SPDX-License-Identifier: Apache-2.0
// Glass: reflection and refraction by one interface, rough or sharp (Walter et al. 2007, "Microfacet Models for
// Refraction through Rough Surfaces"; visible normals as in ggx.glsl). With N = index there / index here, h the normal
// that refracts o to i:
//   reflection  F(o.h) D G2(o, i) / (4 o.z), height-correlated
//   refraction  (1 - F(o.h)) D G1(o) G1(i) |o.h| |i.h| N^2 / (o.z (o.h + N i.h)^2), times |cosine| F is exact; in the
//               specular workflow it is Schlick's of specular_color, at the cosine on the side of the lower index. It
//               transports basic radiance (L / n^2), so refracted light is not scaled by n^2, and what is symmetric is
//               value / (n^2 |cosine| there).
//
// What single scattering loses, U = 1 - E on either side (table_glass), comes back as a lobe to both sides as Kulla and
// Conty (2017) have it for reflection: U(o) U(i) / (pi (avg U_1 + N^2 avg U_2)), indices of the two sides and light to
// either by n^2: symmetric, and nothing is lost. In the specular workflow E is not known, and single scattering is all
// there is.
//
// Where alpha times what refraction bends is below what f32 directions resolve, the interface is sharp; so is one of
// ior 1, which bends nothing. Thin walls (THIN_WALLS) bend nothing either: what is not reflected goes straight on,
// of rough ones as blurred as what is reflected; what single scattering loses is that of reflection with F = 1
// (tables.glsl), and goes to either side by the mean reflectance of both interfaces. A coat has the index of the
// glass: between the two there is nothing to see, and what shows of it is its roughness. An ior below 1 is a denser
// outside.
#ifndef OOCPT_BSDF_GLASS_GLSL
#define OOCPT_BSDF_GLASS_GLSL

#include "include/bsdf/layers.glsl"
#include "include/bsdf/glass_table.glsl"

const float GLASS_LEAST_ALPHA = 1.0e-4;

// Density of directions of the lobe of multiple scattering.
float scatter_density(float alpha, float cosine) {
    return 1.0 / (2.0 * GGX_PI * (cosine + alpha) * log(1.0 + 1.0 / alpha));
}

// Its cosine, for u in 0..1.
float scatter_cosine(float alpha, float u) {
    return clamp(alpha * (exp(u * log(1.0 + 1.0 / alpha)) - 1.0), 1.0e-7, 1.0);
}

bool is_inside(Bsdf b) {
    return b.glass_eta < 1.0;
}

// A sheet without an inside: OpenPBR's thin walls.
bool is_thin(Bsdf b) {
    return HAS_THIN_WALLS && is(b, BSDF_THIN);
}

// What the interface reflects, with the film on it.
vec3 with_film(Bsdf b, vec3 bare, float outer) {
    if (!HAS_THIN_FILM || b.film.x <= 0.0) return bare;
    return mix(bare, film_reflectance(b.film, b.bare_glass, outer), b.film.x);
}

// Sets what is about glass; b.o is set, `through` > 0. Gives what single and multiple scattering reflect and transmit
// at wo.
vec2 set_glass(inout Bsdf b, Shading s, vec3 wo, float through) {
    const bool inside = (dot(s.geometric_normal, wo) < 0.0) != (s.ior < 1.0);
    b.glass = through;
    b.glass_ior = s.ior < 1.0 ? 1.0 / max(s.ior, 1.0e-3) : s.ior;
    b.glass_eta = inside ? 1.0 / b.glass_ior : b.glass_ior;
    if ((s.flags & SHADING_SPECULAR_WORKFLOW) != 0u) b.flags |= BSDF_SCHLICK;
    if (HAS_THIN_WALLS && (s.flags & SHADING_THIN_WALLED) != 0u) {
        b.flags |= BSDF_THIN;
        b.glass_eta = 1.0;
    }
    if (!HAS_ROUGH_TRANSMISSION) return vec2(through, 0.0);
    const float roughness = HAS_COAT ? mix(s.roughness, s.clearcoat_roughness, s.clearcoat) : s.roughness;
    const float alpha = roughness * roughness;
    if (!(alpha * min(2.0 * (b.glass_ior - 1.0), 1.0) >= GLASS_LEAST_ALPHA)) return vec2(through, 0.0);
    b.glass_alpha = alpha;
    b.glass_row = table_row(roughness);
    if (is_thin(b)) {
        const float average = table_average(b.glass_row).x;
        if (!(average > 1.0e-9)) return vec2(through, 0.0);
        const float lost = table_albedo(b.o.z, b.glass_row).x;
        const float r = mean(b.base_0) + (1.0 - mean(b.base_0)) * (1.0 / 21.0);
        b.glass_scatter = through * lost / average;
        b.glass_stay = 2.0 * r / (1.0 + r);
        return through * vec2(1.0 - lost, lost);
    }
    if (is(b, BSDF_SCHLICK)) return vec2(through, 0.0);
    b.glass_place = glass_place(b.glass_ior, alpha);
    const vec2 average = table_glass_average(b.glass_place, b.glass_row) * vec2(1.0, b.glass_ior * b.glass_ior);
    const float sum = average.x + average.y;
    if (!(sum > 1.0e-9)) return vec2(through, 0.0);
    const float here = table_glass(b.glass_place, b.glass_row, b.o.z, inside);
    b.glass_scatter = through * here / sum;
    b.glass_stay = (inside ? average.y : average.x) / sum;
    return through * vec2(1.0 - here, here);
}

// Fresnel reflectance of the interface at a cosine on the viewer's side; of a sheet that of both of its interfaces,
// as often as light goes back and forth: R + R (1 - R)^2 / (1 - R^2) = 2 R / (1 + R).
vec3 glass_reflectance(Bsdf b, float cosine) {
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

// Adds multiple scattering to a direction of this cosine (> 0), on the viewer's side or beyond.
void add_glass_scatter(Bsdf b, float cosine, bool beyond, inout vec3 specular, inout float pdf) {
    if (!HAS_ROUGH_TRANSMISSION || b.chance_glass.y <= 0.0) return;
    const bool dense = !is_thin(b) && is_inside(b) != beyond;
    const float index2 = dense ? b.glass_ior * b.glass_ior : 1.0;
    const vec3 tint = HAS_OPEN_PBR && beyond ? b.glass_tint : vec3(1.0);
    float loss;
    if (is_thin(b)) {
        loss = table_albedo(min(cosine, 1.0), b.glass_row).x * (beyond ? 1.0 - b.glass_stay : b.glass_stay);
    } else {
        loss = table_glass(b.glass_place, b.glass_row, min(cosine, 1.0), dense);
    }
    specular += tint * (b.glass_scatter * index2 * loss * cosine / GGX_PI);
    pdf += b.chance_glass.y * (beyond ? 1.0 - b.glass_stay : b.glass_stay) * scatter_density(b.glass_alpha, cosine);
}

// Adds rough reflection; i in the frame, above the surface.
void add_glass_reflection(Bsdf b, vec3 i, inout vec3 specular, inout float pdf) {
    if (!HAS_ROUGH_TRANSMISSION || b.glass_alpha <= 0.0) return;
    float density;
    const float value = ggx_reflect(b.glass_alpha, b.o, i, density);
    const vec3 h = b.o + i;
    const vec3 f = glass_reflectance(b, clamp(dot(b.o, h) * inversesqrt(max(dot(h, h), 1.0e-30)), 0.0, 1.0));
    specular += b.glass * value * f;
    pdf += b.chance_glass.x * mean(f) * density;
}

// Adds rough refraction; i in the frame, below the surface. The half vector is not normalised.
void add_glass_refraction(Bsdf b, vec3 i, inout vec3 specular, inout float pdf) {
    if (!HAS_ROUGH_TRANSMISSION || b.glass_alpha <= 0.0) return;
    const bool thin = is_thin(b);
    const vec3 back = vec3(i.xy, -i.z); // of a sheet: where it would have been reflected
    vec3 h = thin ? b.o + back : b.o + b.glass_eta * i;
    if (h.z < 0.0) h = -h;
    const float length2 = dot(h, h);
    const float oh = dot(b.o, h);
    const float ih = thin ? -dot(back, h) : dot(i, h);
    if (!(length2 > 1.0e-14 && oh > 0.0 && ih < 0.0 && h.z > 0.0)) return;
    const vec3 f = glass_reflectance(b, min(oh * inversesqrt(length2), 1.0));
    const vec3 through = HAS_OPEN_PBR ? (1.0 - f) * b.glass_tint : 1.0 - f;
    if (thin) {
        float density;
        specular += b.glass * ggx_reflect(b.glass_alpha, b.o, back, density) * through;
        pdf += b.chance_glass.x * (1.0 - mean(f)) * density;
        return;
    }
    const float jacobian = b.glass_eta * b.glass_eta / length2 * (-ih / length2);
    const float visible = ggx_density(b.glass_alpha, h) * 2.0 * oh / (b.o.z + ggx_slope(b.glass_alpha, b.o));
    const float masking = 2.0 * -i.z / (-i.z + ggx_slope(b.glass_alpha, i));
    specular += b.glass * visible * jacobian * masking * through;
    pdf += b.chance_glass.x * (1.0 - mean(f)) * visible * jacobian;
}

// All of it for a direction beyond the surface, before it is mirrored there, or after.
void add_beyond(Bsdf b, vec3 wi, inout vec3 specular, inout float pdf) {
    const float broad = -dot(b.l, wi);
    if (broad > 0.0) add_glass_scatter(b, broad, true, specular, pdf);
    const vec3 i = vec3(dot(b.t, wi), dot(b.b, wi), dot(b.n, wi));
    if (i.z < 0.0) add_glass_refraction(b, i, specular, pdf);
}

// A sample of single scattering in the frame: u.xy a normal, u.z whether it reflects; false: none. `weight` is that of
// a sharp interface, over the chance of the lobe.
bool sample_glass(Bsdf b, vec3 u, out vec3 i, out vec3 weight) {
    weight = vec3(0.0);
    const bool sharp = b.glass_alpha <= 0.0;
    const vec3 h = sharp ? vec3(0.0, 0.0, 1.0) : ggx_sample(b.glass_alpha, b.o, u.xy);
    const float cosine = clamp(dot(b.o, h), 0.0, 1.0);
    const vec3 f = glass_reflectance(b, cosine);
    const float chance = mean(f);
    if (u.z < chance) {
        i = 2.0 * dot(b.o, h) * h - b.o;
        weight = f / chance;
        return i.z > 0.0;
    }
    if (is_thin(b)) {
        // Straight on, or as it would have been reflected, but behind the sheet.
        i = 2.0 * dot(b.o, h) * h - b.o;
        i = vec3(sharp ? -b.o.xy : i.xy, -i.z);
        weight = (1.0 - f) / (1.0 - chance) * b.glass_tint;
        return i.z < 0.0 && chance < 1.0;
    }
    const float eta = 1.0 / b.glass_eta;
    i = (eta * cosine - refracted_cosine(cosine, eta)) * h - eta * b.o;
    weight = (1.0 - f) / (1.0 - chance);
    if (HAS_OPEN_PBR) weight *= b.glass_tint;
    return i.z < 0.0 && chance < 1.0;
}

#endif
