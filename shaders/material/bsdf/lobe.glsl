// SPDX-License-Identifier: Apache-2.0
// What a lobe is: a file of bsdf/lobes with five functions, and a row of rust/abi/src/lobes.rs, from which
// the build writes what goes through all lobes (generated/lobe_functions.glsl). Of the lobe NAME:
//   bool NAME_exists(const Bsdf b)
//                                  whether it may reflect anything; where no lobe but the diffuse one does, the surface
//                                  is plain Lambert, and layers are not worked out
//   float NAME_albedo(inout Bsdf b, const LobeInputs x)
//                                  sets what the lobe keeps in b; its albedo at wo, roughly: divided by the sum of all,
//                                  it is the chance that a sample is this lobe's (b.chance.NAME)
//   vec3 NAME_evaluate(const Bsdf b, const LobeDirection d, out float kept)
//                                  f |cosine| for the direction; 0 for sharp lobes. `kept` is for NAME_density, which
//                                  is called next with the same direction: what both are made of is worked out once
//   float NAME_density(const Bsdf b, const LobeDirection d, float kept)
//                                  density of NAME_sample per solid angle, times b.chance.NAME
//   bool NAME_sample(const Bsdf b, vec3 u, out LobeSample s)
//                                  a direction by three random numbers; false: none
// Evaluation and density are only asked for where the chance is above 0, on the side of its normal on which the lobe
// counts, as its row says. `const`: the struct is large, and a parameter that is not is a copy in each call.
#ifndef OOCPT_BSDF_LOBE_GLSL
#define OOCPT_BSDF_LOBE_GLSL

#include "material/lambert.glsl"
#include "material/bsdf/layers.glsl"

// The inputs from which lobes compute their albedos.
struct LobeInputs {
    Shading shading;
    vec3 wo;
    vec3 base;     // colour of the diffuse lobe, below all layers
    vec3 color;    // F_ms of multiple scattering
    vec3 under;    // U of all layers at wo
    float lost;    // that of sheen and coat times U1
};

// A direction to evaluate, before it is mirrored at the surface, or after.
struct LobeDirection {
    vec3 w;       // unit, world
    vec3 i;       // in the frame of the specular layers
    float cosine; // with the shading normal, on the side where the direction is; broad lobes count above 0
    float broad;  // the same over pi
    bool beyond;  // it goes through the surface
    vec3 under;   // U of all layers at this cosine, where diffuse or multiple scattering counts
    float lost;   // that of sheen and coat times U1
};

struct LobeSample {
    vec3 wi;
    bool sharp;  // it has no density
    vec3 weight; // of a sharp one, over its chance
};

vec3 to_frame(const Bsdf b, vec3 w) {
    return vec3(dot(b.t, w), dot(b.b, w), dot(b.n, w));
}

vec3 from_frame(const Bsdf b, vec3 w) {
    return normalize(w.x * b.t + w.y * b.b + w.z * b.n);
}

// Mirrored at the true surface if it left on the wrong side of it; `side` is 1 for reflection, -1 for transmission.
vec3 on_side(const Bsdf b, vec3 w, float side) {
    const float cosine = dot(b.g, w);
    return cosine * side < 0.0 ? w - 2.0 * cosine * b.g : w;
}

// Broad lobes that reflect more at grazing: density of directions by their cosine.
float spread_density(float alpha, float cosine) {
    return 1.0 / (2.0 * GGX_PI * (cosine + alpha) * log(1.0 + 1.0 / alpha));
}

// The cosine that u in 0..1 selects with that density.
float spread_cosine(float alpha, float u) {
    return clamp(alpha * (exp(u * log(1.0 + 1.0 / alpha)) - 1.0), 1.0e-7, 1.0);
}

// A direction of that density about the shading normal, on the viewer's side (1) or beyond (-1).
vec3 spread_sample(const Bsdf b, float alpha, float side, vec2 u) {
    vec3 x, y;
    tangents(b.l, x, y);
    const float cosine = spread_cosine(alpha, u.x);
    const float sine = sqrt(max(0.0, 1.0 - cosine * cosine));
    const float angle = 2.0 * PI * u.y;
    return on_side(b, normalize(sine * (cos(angle) * x + sin(angle) * y) + side * cosine * b.l), side);
}

// Cosine of a direction with the half vector between it and wo.
float half_cosine(const Bsdf b, vec3 i) {
    const vec3 h = b.o + i;
    return dot(b.o, h) * inversesqrt(max(dot(h, h), 1.0e-30));
}

// Samples a reflection by a layer of GGX; false if it would go below the surface.
bool ggx_layer_sample(const Bsdf b, float alpha, const Stretch stretch, vec2 u, out LobeSample s) {
    const vec3 h = lobe_sample(alpha, stretch, b.o, u);
    const vec3 i = 2.0 * dot(b.o, h) * h - b.o;
    s = LobeSample(on_side(b, from_frame(b, i), 1.0), false, vec3(0.0));
    return i.z > 0.0;
}

// The reflection by a sharp lobe, with this weight.
LobeSample mirror_sample(const Bsdf b, vec3 weight) {
    return LobeSample(on_side(b, from_frame(b, vec3(-b.o.xy, b.o.z)), 1.0), true, weight);
}

#endif
