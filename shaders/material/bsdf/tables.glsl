// SPDX-License-Identifier: Apache-2.0
// Lookups of directional albedos of GGX. Twin of rust/render/src/device/bsdf_tables.rs, which computes them in f64.
//
// For a Schlick Fresnel f0 + (f90 - f0) (1 - c)^5 the single-scattering directional albedo is f0 (1 - L - B) + f90 B; L
// is the loss with F = 1, which is in the table itself because as a difference it would lose its digits. Tables, one
// after the other:
//   L, B        vec2 [TABLE_ROUGHNESS][TABLE_COSINE], bilinear at row (table_row) and cosine^(1/3)
//   averages    vec2 [TABLE_ROUGHNESS]: of L and B over the hemisphere, cosine weighted
//   products    vec4 [TABLE_ROUGHNESS][TABLE_ROUGHNESS]: averages of L L', L B', B L', B B' for two roughnesses
// Averages are those of the interpolated albedos, so a lobe normalised by them is normalised to rounding. With
// HAS_ROUGH_TRANSMISSION the table of bsdf/glass_table.glsl follows.
#ifndef OOCPT_BSDF_TABLES_GLSL
#define OOCPT_BSDF_TABLES_GLSL

#include "abi/memory.glsl"

#ifndef BSDF_TABLES
#define BSDF_TABLES FRAME.bsdf_tables
#endif

layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer ConstVec2s { vec2 v[]; };

const uint64_t TABLE_AVERAGES = uint64_t(8u * TABLE_ROUGHNESS * TABLE_COSINE);
const uint64_t TABLE_PRODUCTS = TABLE_AVERAGES + uint64_t(8u * TABLE_ROUGHNESS);
const uint64_t TABLE_GLASS = TABLE_PRODUCTS + uint64_t(16u * TABLE_ROUGHNESS * TABLE_ROUGHNESS);

// Index of the cell's lower end, and how far into the cell, 0..1; x in 0..1, or past it by what pow is off.
uint table_cell(float x, uint size, out float part) {
    const float at = x * float(size - 1u);
    const uint index = min(uint(at), size - 2u);
    part = min(at - float(index), 1.0);
    return index;
}

// The position of a roughness of SHARP_ROUGHNESS..1 among the rows, 0..1; alpha is its square.
float table_row(float roughness) {
    const float first = 0.15848932; // SHARP_ROUGHNESS^0.4
    return clamp((pow(max(roughness, 1.0e-3), 0.4) - first) / (1.0 - first), 0.0, 1.0);
}

// L and B.
vec2 table_albedo(float cosine, float row) {
    float x, y;
    const uint column = table_cell(pow(max(cosine, 1.0e-12), 1.0 / 3.0), TABLE_COSINE, x);
    const uint at = table_cell(row, TABLE_ROUGHNESS, y) * TABLE_COSINE + column;
    ConstVec2s table = ConstVec2s(BSDF_TABLES);
    const vec2 low = mix(table.v[at], table.v[at + 1u], x);
    const vec2 high = mix(table.v[at + TABLE_COSINE], table.v[at + TABLE_COSINE + 1u], x);
    return max(mix(low, high, y), 0.0); // mix may round below both ends
}

vec2 table_average(float row) {
    float y;
    const uint at = table_cell(row, TABLE_ROUGHNESS, y);
    ConstVec2s table = ConstVec2s(BSDF_TABLES + TABLE_AVERAGES);
    return mix(table.v[at], table.v[at + 1u], y);
}

vec4 table_product(float row, float other) {
    float x, y;
    const uint column = table_cell(other, TABLE_ROUGHNESS, x);
    const uint at = table_cell(row, TABLE_ROUGHNESS, y) * TABLE_ROUGHNESS + column;
    ConstVec4s table = ConstVec4s(BSDF_TABLES + TABLE_PRODUCTS);
    const vec4 low = mix(table.v[at], table.v[at + 1u], x);
    const vec4 high = mix(table.v[at + TABLE_ROUGHNESS], table.v[at + TABLE_ROUGHNESS + 1u], x);
    return mix(low, high, y);
}

#endif
