// SPDX-License-Identifier: Apache-2.0
// Lookups of the loss of single scattering by rough glass; the table follows those of tables.glsl. Twin of
// rust/render/src/device/bsdf_tables/glass.rs, which computes it and asserts that it is right to 1e-3.
//   nodes       vec4 [GLASS_IOR][GLASS_ROUGHNESS][2]: 1 / alpha, cosine of total reflection, factor and offset of the
//               columns of the side of the lower index; those of the other's, averages of U over the hemispheres of
//               either side
//   U           16 bits [GLASS_IOR][GLASS_ROUGHNESS][GLASS_COSINES], of 0..1: first the columns of the side of the
//               lower index, then the other's
// A lookup is bilinear over the nodes, at the place of the index (glass_place, which follows alpha) and the row of the
// roughness; in each node it is linear over the node's own columns, so averages are bilinear over the nodes, to
// rounding.
#ifndef OOCPT_BSDF_GLASS_TABLE_GLSL
#define OOCPT_BSDF_GLASS_TABLE_GLSL

#include "material/bsdf/tables.glsl"

const uint GLASS_ROUGHNESS = 64u;
const uint GLASS_IOR = 64u;
const uint GLASS_COSINE_LIGHT = 64u;
const uint GLASS_COSINE_DENSE = 96u;
const uint GLASS_COSINES = GLASS_COSINE_LIGHT + GLASS_COSINE_DENSE;

const uint64_t TABLE_GLASS_LOSSES = TABLE_GLASS + uint64_t(32u * GLASS_IOR * GLASS_ROUGHNESS);

// The position of an index of refraction >= 1 among the nodes of this alpha, 0..1.
float glass_place(float ior, float alpha) {
    const float near = 0.3 * alpha;
    const float least = sqrt(min(2.4e-5 / alpha, 0.2));
    const float root = sqrt(max((ior - 1.0) / (ior + 1.0), 0.0));
    return clamp(log((root + near) / (least + near)) / log((1.0 + near) / (least + near)), 0.0, 1.0);
}

// U in one node, at a cosine on the side of the lower index, or on the other (`dense`).
float glass_node_loss(uint index, float cosine, bool dense) {
    ConstVec4s nodes = ConstVec4s(BSDF_TABLES + TABLE_GLASS);
    const vec4 node = nodes.v[2u * index];
    float shape;
    if (dense) {
        const float off = cosine - node.y;
        shape = 2.0 * cosine + 1.3 * log(1.0 + cosine * node.x * (1.0 / 0.02))
              + sign(off) * log(1.0 + abs(off) * node.x * (1.0 / 0.6));
    } else {
        shape = cosine + log(1.0 + cosine * node.x * (1.0 / 0.3));
    }
    const vec2 columns = dense ? nodes.v[2u * index + 1u].xy : node.zw;
    float x;
    const uint column = table_cell(clamp((shape - columns.y) * columns.x, 0.0, 1.0),
                                   dense ? GLASS_COSINE_DENSE : GLASS_COSINE_LIGHT, x);
    const uint at = index * GLASS_COSINES + (dense ? GLASS_COSINE_LIGHT : 0u) + column;
    ConstUints table = ConstUints(BSDF_TABLES + TABLE_GLASS_LOSSES);
    const vec2 low = unpackUnorm2x16(table.v[at >> 1u]);
    const vec2 pair = (at & 1u) == 0u ? low : vec2(low.y, unpackUnorm2x16(table.v[(at >> 1u) + 1u]).x);
    return mix(pair.x, pair.y, x);
}

// U at a cosine on one side.
float table_glass(float place, float row, float cosine, bool dense) {
    float y, z;
    const uint line = table_cell(row, GLASS_ROUGHNESS, y);
    const uint at = table_cell(place, GLASS_IOR, z) * GLASS_ROUGHNESS + line;
    float loss = 0.0;
    [[dont_unroll]] for (uint i = 0u; i < 4u; ++i) {
        const float weight = ((i & 1u) == 0u ? 1.0 - y : y) * (i < 2u ? 1.0 - z : z);
        loss += weight * glass_node_loss(at + (i & 1u) + (i >> 1u) * GLASS_ROUGHNESS, cosine, dense);
    }
    return clamp(loss, 0.0, 1.0);
}

// Averages of U, each over its own hemisphere: on the side of the lower index, and on the other.
vec2 table_glass_average(float place, float row) {
    float y, z;
    const uint line = table_cell(row, GLASS_ROUGHNESS, y);
    const uint at = table_cell(place, GLASS_IOR, z) * GLASS_ROUGHNESS + line;
    const uint above = at + GLASS_ROUGHNESS;
    ConstVec4s nodes = ConstVec4s(BSDF_TABLES + TABLE_GLASS);
    const vec2 low = mix(nodes.v[2u * at + 1u].zw, nodes.v[2u * at + 3u].zw, y);
    const vec2 high = mix(nodes.v[2u * above + 1u].zw, nodes.v[2u * above + 3u].zw, y);
    return clamp(mix(low, high, z), 0.0, 1.0);
}

#endif
