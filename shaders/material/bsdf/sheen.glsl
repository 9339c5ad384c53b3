// SPDX-License-Identifier: Apache-2.0
// Sheen: fibres that stand up from the surface, on top of the opaque part. With e = 1 / roughness, h the half vector
// and t its angle:
//   value    sheen_color scale (2 + e) sin(t)^e / (2 pi) / (4 (o.z + i.z - o.z i.z)), times cosine
// (Conty and Kulla 2017; Neubelt and Pettineo 2013 for the substitute for masking). It is symmetric; `scale` is below 1
// for roughnesses at which it would reflect more than it receives. The layers below are scaled by the lesser of U at
// either end, U = 1 - E of sheen's strongest colour, except the diffuse lobe and multiple scattering, which lose
// nothing: they have U(o) U(i) over its average (layers.glsl). Directions are sampled by their cosine alone, crowded at
// the horizon: weights are below (2 + e) / 2.
//
// Only with HAS_SHEEN. The table follows those of tables.glsl and glass_table.glsl (twin:
// rust/render/src/device/bsdf_tables/sheen.rs):
//   E           float [SHEEN_ROUGHNESS][SHEEN_COSINE], scaled, bilinear at row and cosine^(1/2)
//   averages    float [SHEEN_ROUGHNESS]
//   scales      float [SHEEN_ROUGHNESS]
//   products    vec2 [TABLE_ROUGHNESS][SHEEN_ROUGHNESS]: averages of L E and B E
#ifndef OOCPT_BSDF_SHEEN_GLSL
#define OOCPT_BSDF_SHEEN_GLSL

#include "material/bsdf/tables.glsl"

const uint SHEEN_COSINE = 80u;
const uint SHEEN_ROUGHNESS = 32u;
const float SHEEN_SHARPEST = 0.1;
const float SHEEN_SPREAD = 0.5; // of the cosines that are sampled

#ifndef BSDF_SHEEN_TABLE
#define BSDF_SHEEN_TABLE FRAME.sheen_tables
#endif

const uint64_t SHEEN_AVERAGES = uint64_t(4u * SHEEN_ROUGHNESS * SHEEN_COSINE);
const uint64_t SHEEN_SCALES = SHEEN_AVERAGES + uint64_t(4u * SHEEN_ROUGHNESS);
const uint64_t SHEEN_PRODUCTS = SHEEN_SCALES + uint64_t(4u * SHEEN_ROUGHNESS);

// The position of a roughness among the rows, 0..1.
float sheen_row(float roughness) {
    const float first = sqrt(SHEEN_SHARPEST);
    return clamp((sqrt(max(roughness, SHEEN_SHARPEST)) - first) / (1.0 - first), 0.0, 1.0);
}

// E at a cosine.
float sheen_albedo(float cosine, float row) {
    float x, y;
    const uint column = table_cell(sqrt(clamp(cosine, 0.0, 1.0)), SHEEN_COSINE, x);
    const uint at = table_cell(row, SHEEN_ROUGHNESS, y) * SHEEN_COSINE + column;
    ConstFloats table = ConstFloats(BSDF_SHEEN_TABLE);
    return mix(mix(table.v[at], table.v[at + 1u], x),
               mix(table.v[at + SHEEN_COSINE], table.v[at + SHEEN_COSINE + 1u], x), y);
}

// Average of E, and the scale of the lobe.
vec2 sheen_average(float row) {
    float y;
    const uint at = table_cell(row, SHEEN_ROUGHNESS, y);
    ConstFloats table = ConstFloats(BSDF_SHEEN_TABLE);
    const uint averages = uint(SHEEN_AVERAGES / 4u);
    const uint scales = uint(SHEEN_SCALES / 4u);
    return vec2(mix(table.v[averages + at], table.v[averages + at + 1u], y),
                mix(table.v[scales + at], table.v[scales + at + 1u], y));
}

// Averages of E times L and B of a row of GGX.
vec2 sheen_product(float row, float ggx_row) {
    float x, y;
    const uint column = table_cell(row, SHEEN_ROUGHNESS, x);
    const uint at = table_cell(ggx_row, TABLE_ROUGHNESS, y) * SHEEN_ROUGHNESS + column;
    ConstVec2s table = ConstVec2s(BSDF_SHEEN_TABLE + SHEEN_PRODUCTS);
    const vec2 low = mix(table.v[at], table.v[at + 1u], x);
    return mix(low, mix(table.v[at + SHEEN_ROUGHNESS], table.v[at + SHEEN_ROUGHNESS + 1u], x), y);
}

// Value times cosine, without colour and scale; directions in the frame, above the surface.
float sheen_value(float roughness, vec3 wo, vec3 wi) {
    const float power = 1.0 / max(roughness, SHEEN_SHARPEST);
    const vec3 h = wo + wi;
    const float across = h.x * h.x + h.y * h.y;
    const float sine2 = across / max(across + h.z * h.z, 1.0e-20);
    const float density = (2.0 + power) * (0.5 / 3.14159265358979) * pow(max(sine2, 1.0e-12), 0.5 * power);
    return density * wi.z / (4.0 * max(wo.z + wi.z - wo.z * wi.z, 1.0e-7));
}

#endif
