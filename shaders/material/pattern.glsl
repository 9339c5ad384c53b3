// SPDX-License-Identifier: Apache-2.0
// Programs of materials (rust/materialx/src/program.rs): run at a hit, they leave the inputs that are registers in
// pattern_registers. Only with HAS_PATTERNS.
//
// Memory of a program, from 16 * GpuMaterial::program bytes of FrameConstants::programs on: constants, f32x4 each;
// lookups, a GpuInput each; instructions, two in 16 bytes: op | to << 8 | a << 16 | b << 24, c | immediate << 8. Behind
// it, of a material whose opacity or, if not, whose emission is a register: 16 bytes, the sizes of a program for that
// alone and the register of the emission; and this program (traversal/cutout_program.glsl, light/program.glsl). The
// host has checked all numbers.
//
// Before including, PATTERN_LOOKUP may be defined as a function in place of texture_lookup, and PATTERN_RANDOM where
// programs may read random numbers of the hit.
#ifndef OOCPT_PATTERN_GLSL
#define OOCPT_PATTERN_GLSL

#include "math/affine.glsl"
#include "material/pattern_ops.glsl"
#include "geometry/surface_material.glsl"
#include "texture/texture.glsl"

#ifndef PATTERN_LOOKUP
#define PATTERN_LOOKUP texture_lookup
#endif

vec4 pattern_registers[PROGRAM_REGISTERS];

#ifdef PATTERN_RANDOM
// Random numbers of the hit, set before a program that reads them (HAS_MIXTURES).
vec4 pattern_random;
#endif

// Where a program is run.
struct PatternPoint {
    vec3 position; // world
    vec3 normal;   // shading normal, world, unit
    vec3 view;     // from the viewer to the surface, unit
    float cone;    // width of the ray's cone
};

// Of GpuMaterial::program_sizes.
uint program_constants(uint sizes) {
    return sizes & 0xffu;
}

uint program_lookups(uint sizes) {
    return (sizes >> 8) & 0xffu;
}

uint program_instructions(uint sizes) {
    return sizes >> 16;
}

// What is behind a program.
uint64_t program_end(uint64_t program, uint sizes) {
    const uint rows = program_constants(sizes) + 4u * program_lookups(sizes) + (program_instructions(sizes) + 1u) / 2u;
    return program + 16ul * uint64_t(rows);
}

uint64_t material_program(uint material) {
    return FRAME.programs + 16ul * uint64_t(Materials(FRAME.materials).v[material].program);
}

vec4 pattern_operand(uint64_t program, uint operand) {
    if (operand < PROGRAM_REGISTERS) return pattern_registers[operand];
    return ConstVec4s(program).v[operand - PROGRAM_REGISTERS];
}

// GEOMETRY_*.
vec4 pattern_geometry(uint what, GpuSurfaceMaterial m, PatternPoint p) {
    if (what <= GEOMETRY_UV1) return vec4(m.uv[what & 1u], 0.0, 0.0);
    if (what <= GEOMETRY_PRIMVAR1) {
        const uint slot = what & 1u;
        if ((m.flags & (1u << slot)) != 0u) return m.primvars[slot];
        return Materials(FRAME.materials).v[m.material].primvar_fallback[slot];
    }
#ifdef PATTERN_RANDOM
    if (HAS_MIXTURES && what >= GEOMETRY_RANDOM0 && what <= GEOMETRY_RANDOM2) {
        return vec4(pattern_random[what - GEOMETRY_RANDOM0]);
    }
#endif
    const vec3 normal = p.normal;
    if (what == GEOMETRY_POSITION) return vec4(p.position, 0.0);
    if (what == GEOMETRY_NORMAL) return vec4(normal, 0.0);
    if (what == GEOMETRY_VIEW_DIRECTION) return vec4(p.view, 0.0);
    if (what >= GEOMETRY_FRAME_X) {
        vec3 x, y;
        normal_frame(m, normal, true, x, y);
        return vec4(what == GEOMETRY_FRAME_X ? x : y, 0.0);
    }
    const vec3 tangent = normal_or(m.tangent - normal * dot3(normal, m.tangent), vec3(0.0));
    if (what == GEOMETRY_TANGENT) return vec4(tangent, 0.0);
    return vec4(cross3(normal, tangent) * m.handedness, 0.0);
}

// A lookup of the program; `place` counts where it does not know its own.
vec4 pattern_texture(GpuInput i, vec2 place, bool is_placed, GpuSurfaceMaterial m, float cone, inout uint missing) {
    if (!HAS_TEXTURES) return vec4(0.0, 0.0, 0.0, 1.0);
    const uint set = (i.kind >> INPUT_SET_SHIFT) & 3u;
    const vec2 at = is_placed ? map_place(i, set == INPUT_NO_SET ? vec2(0.0) : m.uv[set & 1u]) : place;
    float width = 0.0;
    if (set != INPUT_NO_SET) width = lookup_width(i.texture, at, m.footprints[set & 1u], cone, i.row_s, i.row_t);
    uint unit;
    const vec4 texel = PATTERN_LOOKUP(i.texture, at, width, unit);
    if (unit < TEXTURE_FALLBACK) missing = unit;
    return pattern_number(texel);
}

// Runs a program of the material `m`. `missing` as for input_value.
void run_program(uint64_t program, uint sizes, GpuSurfaceMaterial m, PatternPoint p, inout uint missing) {
    const uint constants = program_constants(sizes);
    const uint lookups = program_lookups(sizes);
    const uint count = program_instructions(sizes);
    const uint64_t inputs = program + 16ul * uint64_t(constants);
    const uint64_t instructions = inputs + 64ul * uint64_t(lookups);
    [[dont_unroll]] for (uint k = 0u; k < count; ++k) {
        const uvec2 word = ConstUVec2s(instructions).v[k];
        const uint op = word.x & 0xffu;
        const uint immediate = word.y >> 8;
        const vec4 a = pattern_operand(program, (word.x >> 16) & 0xffu);
        vec4 value;
        if (op == PATTERN_SURFACE) {
            value = pattern_number(pattern_geometry(immediate, m, p));
        } else if (op == PATTERN_TEXTURE) {
            const GpuInput i = Inputs(inputs).v[immediate & 0xffu];
            value = pattern_texture(i, a.xy, (immediate & INPUT_PLACED) != 0u, m, p.cone, missing);
        } else {
            const vec4 b = pattern_operand(program, word.x >> 24);
            const vec4 c = pattern_operand(program, word.y & 0xffu);
            value = pattern_op(op, a, b, c, immediate);
        }
        pattern_registers[(word.x >> 8) & 0xffu] = value;
    }
}

#endif
