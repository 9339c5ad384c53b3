// SPDX-License-Identifier: Apache-2.0
// Test shader, not a pass of a render: runs the BSDF for rust/render/tests/gpu/bsdf. One thread per item.
// A case is 64 floats: geometric normal, normal, wo, wi, u, packed Shading, sheen's colour and roughness, anisotropy,
// film, diffuse roughness, hair (tints, absorption, variances, spreads, tilt, offset). The modes write:
//   CASES     28 floats per case: ok, wi, weight, pdf of its sample; evaluation there; diffuse, specular, pdf at the
//             case's wi; chances of coat, specular, diffuse, multiple scattering, glass, its multiple scattering;
//             transmittance of a smooth interface; glass's alpha; chance of sheen
//   SUMS      4 floats per case and part: sum of weights over POINTS points of a low-discrepancy sequence, count of
//             samples
//   SAMPLES   4 floats per thread, all of case 0: wi, pdf; pdf -1: none, 0: sharp
//   GRID      4 floats per direction (after case 0, 3 floats each): value, pdf
#version 460
#extension GL_GOOGLE_include_directive : require
#define BSDF_TABLES push[0]
#define BSDF_SHEEN_TABLE push[7]
#include "abi/memory.glsl"

const uint CASE = 64u; // floats
const uint CASES = 0u;
const uint SUMS = 1u;
const uint SAMPLES = 2u;

layout(local_size_x = 64) in;
// Tables, cases, results, count, mode, samples, seed, sheen's table.
layout(push_constant, scalar) uniform PushBlock { uint64_t push[8]; };
#define CASES_AT push[1]
#define RESULTS_AT push[2]
#define COUNT uint(push[3])
#define MODE uint(push[4])
#define POINTS uint(push[5])
#define SEED uint(push[6])

#include "material/bsdf.glsl"

float at(uint index) {
    return ConstFloats(CASES_AT).v[index];
}

vec3 at3(uint index) {
    return vec3(at(index), at(index + 1u), at(index + 2u));
}

vec4 at4(uint index) {
    return vec4(at3(index), at(index + 3u));
}

Shading unpack_shading(vec4 packed[4], vec3 geometric_normal, vec3 normal) {
    return Shading(geometric_normal, normal, packed[0].xyz, packed[1].xyz, packed[2].xyz, packed[0].w, packed[1].w,
                   packed[2].w, packed[3].x, packed[3].y, packed[3].z, uint(packed[3].w), vec3(0.0), 0.5, vec3(1.0),
                   1.5, vec3(0.0), vec4(1.0, 0.0, 1.0, 0.0), vec3(0.0), vec3(0.0), 0.0, 0.0, white_hair());
}

Shading shading_of(uint item) {
    vec4 packed[4];
    for (uint i = 0u; i < 4u; ++i) packed[i] = at4(item * CASE + 16u + 4u * i);
    Shading s = unpack_shading(packed, at3(item * CASE), at3(item * CASE + 3u));
    s.sheen_color = at3(item * CASE + 32u);
    s.sheen_roughness = at(item * CASE + 35u);
    s.anisotropy = at4(item * CASE + 36u);
    s.film = at3(item * CASE + 40u);
    s.tangent = vec3(1.0, 0.0, 0.0);
    s.diffuse_roughness = at(item * CASE + 43u);
    const uint hair = item * CASE + 44u;
    s.hair = HairShading(at3(hair), at3(hair + 3u), at3(hair + 6u), at3(hair + 9u), at3(hair + 12u), at3(hair + 15u),
                         at(hair + 18u), at(hair + 19u));
    return valid_shading(s);
}

void put3(uint index, vec3 value) {
    Floats(RESULTS_AT).v[index] = value.x;
    Floats(RESULTS_AT).v[index + 1u] = value.y;
    Floats(RESULTS_AT).v[index + 2u] = value.z;
}

void put4(uint index, vec4 value) {
    put3(index, value.xyz);
    Floats(RESULTS_AT).v[index + 3u] = value.w;
}

float unit(uint bits) {
    return float(bits >> 8) * (1.0 / 16777216.0);
}

// Roberts' additive sequence of three dimensions, with an offset.
vec4 sequence(uint index) {
    const uvec3 step = uvec3(3518319155u, 2882110345u, 2360945575u);
    const uvec3 bits = index * step + uvec3(2147483648u);
    return vec4(unit(bits.x), unit(bits.y), unit(bits.z), 0.0);
}

uint hash(uint x) {
    x = x * 747796405u + 2891336453u;
    x = ((x >> ((x >> 28u) + 4u)) ^ x) * 277803737u;
    return (x >> 22u) ^ x;
}

vec4 random(uint index) {
    const uint a = hash(index ^ hash(SEED));
    const uint b = hash(a);
    return vec4(unit(a), unit(b), unit(hash(b)), 0.0);
}

void run_case(uint item, Bsdf b, vec3 wo) {
    vec3 wi, weight, diffuse, specular;
    float pdf;
    const bool ok = bsdf_sample(b, wo, at4(item * CASE + 12u), wi, weight, pdf);
    const uint to = item * 28u;
    put4(to, vec4(ok ? 1.0 : 0.0, wi));
    put4(to + 4u, vec4(weight, pdf));
    put4(to + 8u, bsdf_evaluate(b, wo, wi));
    bsdf_evaluate_lobes(b, wo, at3(item * CASE + 9u), diffuse, specular, pdf);
    put3(to + 12u, diffuse);
    put3(to + 15u, specular);
    put3(to + 18u, vec3(pdf, b.chance.coat, b.chance.specular));
    put3(to + 21u, vec3(b.chance.diffuse, b.chance.scatter, b.chance.glass));
    put3(to + 24u, vec3(b.chance.glass_scatter, b.glass > 0.0 ? 1.0 - mean(glass_reflectance(b, b.o.z)) : 0.0,
                        b.glass_alpha));
    Floats(RESULTS_AT).v[to + 27u] = b.chance.sheen;
}

void main() {
    const uint thread = (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * 64u + gl_LocalInvocationID.x;
    if (thread >= COUNT) return;
    const uint item = MODE == CASES || MODE == SUMS ? thread : 0u;
    const vec3 wo = at3(item * CASE + 6u);
    const Bsdf b = make_bsdf(shading_of(item), wo);
    vec3 wi, weight;
    float pdf;
    if (MODE == CASES) {
        run_case(item, b, wo);
    } else if (MODE == SUMS) {
        vec4 sum = vec4(0.0);
        for (uint i = 0u; i < POINTS; ++i) {
            if (bsdf_sample(b, wo, sequence(SEED + i), wi, weight, pdf)) sum += vec4(weight, 1.0);
        }
        put4(thread * 4u, sum);
    } else if (MODE == SAMPLES) {
        const bool ok = bsdf_sample(b, wo, random(thread), wi, weight, pdf);
        put4(thread * 4u, vec4(wi, ok ? pdf : -1.0));
    } else {
        put4(thread * 4u, bsdf_evaluate(b, wo, at3(CASE + thread * 3u)));
    }
}
