// SPDX-License-Identifier: Apache-2.0
// Single scattering by glass, bsdf/glass.glsl: reflection and refraction in one lobe.
#ifndef OOCPT_BSDF_LOBES_GLASS_GLSL
#define OOCPT_BSDF_LOBES_GLASS_GLSL

#include "material/bsdf/lobe.glsl"
#include "material/bsdf/glass.glsl"

bool glass_exists(const Bsdf b) {
    return b.glass > 0.0;
}

float glass_albedo(inout Bsdf b, const LobeInputs x) {
    set_glass(b, x.shading, x.wo);
    return b.glass * (1.0 - b.glass_lost);
}

// Rough refraction; i in the frame, below the surface. The half vector is not normalised.
vec3 glass_refracted(const Bsdf b, vec3 i, out float density) {
    density = 0.0;
    const bool thin = is_thin(b);
    const vec3 back = vec3(i.xy, -i.z); // of a sheet: where it would have been reflected
    vec3 h = thin ? b.o + back : b.o + b.glass_eta * i;
    if (h.z < 0.0) h = -h;
    const float length2 = dot(h, h);
    const float oh = dot(b.o, h);
    const float ih = thin ? -dot(back, h) : dot(i, h);
    if (!(length2 > 1.0e-14 && oh > 0.0 && ih < 0.0 && h.z > 0.0)) return vec3(0.0);
    const vec3 f = glass_reflectance(b, min(oh * inversesqrt(length2), 1.0));
    const vec3 through = HAS_OPEN_PBR ? (1.0 - f) * b.glass_tint : 1.0 - f;
    const float chance = b.chance.glass * (1.0 - mean(f));
    if (thin) {
        const float value = ggx_reflect(b.glass_alpha, b.o, back, density);
        density = chance * density;
        return b.glass * value * through;
    }
    const float jacobian = b.glass_eta * b.glass_eta / length2 * (-ih / length2);
    const float visible = ggx_density(b.glass_alpha, h) * 2.0 * oh / (b.o.z + ggx_slope(b.glass_alpha, b.o));
    const float masking = 2.0 * -i.z / (-i.z + ggx_slope(b.glass_alpha, i));
    density = chance * visible * jacobian;
    return b.glass * visible * jacobian * masking * through;
}

vec3 glass_evaluate(const Bsdf b, const LobeDirection d, out float kept) {
    kept = 0.0;
    if (!HAS_ROUGH_TRANSMISSION || b.glass_alpha <= 0.0) return vec3(0.0);
    if (d.beyond) return glass_refracted(b, d.i, kept);
    float density;
    const float value = ggx_reflect(b.glass_alpha, b.o, d.i, density);
    const vec3 f = glass_reflectance(b, clamp(half_cosine(b, d.i), 0.0, 1.0));
    kept = b.chance.glass * mean(f) * density;
    return b.glass * value * f;
}

// The chance of reflection or refraction is already a factor of `kept`.
float glass_density(const Bsdf b, const LobeDirection d, float kept) {
    return kept;
}

// A sample of single scattering in the frame: u.xy chooses a normal, u.z reflection or refraction; false: none.
// `weight` is that of a sharp interface, over the chance of the lobe.
bool sample_interface(const Bsdf b, vec3 u, out vec3 i, out vec3 weight) {
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
        // Straight on, or mirrored to the other side of the sheet.
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

bool glass_sample(const Bsdf b, vec3 u, out LobeSample s) {
    s = LobeSample(b.g, b.glass_alpha <= 0.0, vec3(0.0));
    vec3 i, weight;
    if (!sample_interface(b, u, i, weight)) return false;
    s.wi = on_side(b, from_frame(b, i), i.z);
    s.weight = weight * (b.glass / b.chance.glass);
    return true;
}

#endif
