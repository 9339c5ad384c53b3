// SPDX-License-Identifier: Apache-2.0
// Directional albedos of GGX, looked up. Twin of rust/render/src/bsdf_tables.rs, which computes them in f64.
//
// For a Schlick Fresnel f0 + (f90 - f0) (1 - c)^5 the single-scattering directional albedo is f0 (1 - L - B) + f90 B; L is what is
// lost with F = 1, itself in the table since it is small where it is a difference. Tables, one after the other:
//   L, B        vec2 [TABLE_ROUGHNESS][TABLE_COSINE], bilinear at row (table_row) and cosine^(1/3)
//   averages    vec2 [TABLE_ROUGHNESS]: of L and B over the hemisphere, cosine weighted
//   products    vec4 [TABLE_ROUGHNESS][TABLE_ROUGHNESS]: averages of L L', L B', B L', B B' for two roughnesses
// and with HAS_ROUGH_TRANSMISSION, after them (twin: bsdf_tables/glass.rs):
//   U           vec2 [GLASS_IOR][GLASS_ROUGHNESS][GLASS_COSINE]: what single scattering by glass loses, seen from the side of the lower
//               index and from the other; trilinear at ((ior - 1) / (ior + 1))^0.4, row and cosine^(1/3)
//   averages    vec2 [GLASS_IOR][GLASS_ROUGHNESS]: of both over their hemispheres
// Averages are those of the interpolated albedos, so what is normalised by them is normalised to rounding.
#ifndef OOCPT_BSDF_TABLES_GLSL
#define OOCPT_BSDF_TABLES_GLSL

#include "include/memory.glsl"

const float SHARP_ROUGHNESS = 0.01;
const uint TABLE_COSINE = 64u;
const uint TABLE_ROUGHNESS = 48u;
const uint GLASS_COSINE = 48u;
const uint GLASS_ROUGHNESS = 40u;
const uint GLASS_IOR = 20u;

#ifndef BSDF_TABLES
#define BSDF_TABLES FRAME.bsdf_tables
#endif

layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer ConstVec2s { vec2 v[]; };

const uint64_t TABLE_AVERAGES = uint64_t(8u * TABLE_ROUGHNESS * TABLE_COSINE);
const uint64_t TABLE_PRODUCTS = TABLE_AVERAGES + uint64_t(8u * TABLE_ROUGHNESS);
const uint64_t TABLE_GLASS = TABLE_PRODUCTS + uint64_t(16u * TABLE_ROUGHNESS * TABLE_ROUGHNESS);
const uint64_t TABLE_GLASS_AVERAGES = TABLE_GLASS + uint64_t(8u * GLASS_IOR * GLASS_ROUGHNESS * GLASS_COSINE);

// Index of the cell's lower end, and how far into the cell, 0..1; x in 0..1, or past it by what pow is off.
uint table_cell(float x, uint size, out float part) {
    const float at = x * float(size - 1u);
    const uint index = min(uint(at), size - 2u);
    part = min(at - float(index), 1.0);
    return index;
}

// Where a roughness of SHARP_ROUGHNESS..1 is among the rows, 0..1; alpha is its square.
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

// Where an index of refraction >= 1 is among those of glass, 0..1.
float glass_place(float ior) {
    return clamp(pow(max((ior - 1.0) / (ior + 1.0), 1.0e-12), 0.4), 0.0, 1.0);
}

// U of glass on the side of the lower index and on the other.
vec2 table_glass(float ior, float row, float cosine) {
    float x, y, z;
    const uint column = table_cell(pow(max(cosine, 1.0e-12), 1.0 / 3.0), GLASS_COSINE, x);
    const uint line = table_cell(row, GLASS_ROUGHNESS, y);
    const uint at = (table_cell(glass_place(ior), GLASS_IOR, z) * GLASS_ROUGHNESS + line) * GLASS_COSINE + column;
    ConstVec2s table = ConstVec2s(BSDF_TABLES + TABLE_GLASS);
    vec2 part[2];
    for (uint i = 0u; i < 2u; ++i) {
        const uint from = at + i * GLASS_ROUGHNESS * GLASS_COSINE;
        const vec2 low = mix(table.v[from], table.v[from + 1u], x);
        const vec2 high = mix(table.v[from + GLASS_COSINE], table.v[from + GLASS_COSINE + 1u], x);
        part[i] = mix(low, high, y);
    }
    return clamp(mix(part[0], part[1], z), 0.0, 1.0);
}

// Their averages, each over its own hemisphere.
vec2 table_glass_average(float ior, float row) {
    float y, z;
    const uint line = table_cell(row, GLASS_ROUGHNESS, y);
    const uint at = table_cell(glass_place(ior), GLASS_IOR, z) * GLASS_ROUGHNESS + line;
    ConstVec2s table = ConstVec2s(BSDF_TABLES + TABLE_GLASS_AVERAGES);
    const vec2 low = mix(table.v[at], table.v[at + 1u], y);
    const vec2 high = mix(table.v[at + GLASS_ROUGHNESS], table.v[at + GLASS_ROUGHNESS + 1u], y);
    return clamp(mix(low, high, z), 0.0, 1.0);
}

#endif
