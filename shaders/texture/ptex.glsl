// SPDX-License-Identifier: Apache-2.0
// Ptex (Burley and Lacewell 2008): the place of a point of a triangle in its face, and texels of faces. The numbering
// of faces is in rust/core/src/mesh/ptex.rs, the order of texels in rust/core/src/texture/faces.rs.
#ifndef OOCPT_PTEX_GLSL
#define OOCPT_PTEX_GLSL

// Parts of a face, `PtexPart` of core.
const uint PTEX_WEDGE = 4u;
const uint PTEX_LAST_WEDGE = 5u;
const uint PTEX_CORNER = 6u;
const uint PTEX_NOWHERE = 7u;

const uint PTEX_FACE_BITS = 26u;
const uint PTEX_NO_FACE = (1u << PTEX_FACE_BITS) - 1u;

// A place in a Ptex file in the two floats of texture coordinates: 30 bits in each, which is never zero, denormal,
// infinite or no number, so that nothing on its way changes it.
float ptex_float(uint bits) {
    return uintBitsToFloat((bits >> 29) << 31 | 0x20000000u | (bits & 0x1fffffffu));
}

uint ptex_bits(float v) {
    const uint bits = floatBitsToUint(v);
    return (bits >> 31) << 29 | (bits & 0x1fffffffu);
}

vec2 pack_ptex(uint face, vec2 uv) {
    const uvec2 steps = uvec2(clamp(uv * PTEX_STEPS, vec2(0.0), vec2(PTEX_STEPS - 1.0)));
    return vec2(ptex_float(face | (steps.x >> 13) << PTEX_FACE_BITS), ptex_float((steps.x & 0x1fffu) | steps.y << 13));
}

// In the middle of a step: exact, as is its product with a power of two.
vec2 unpack_ptex(vec2 st, out uint face) {
    const uvec2 bits = uvec2(ptex_bits(st.x), ptex_bits(st.y));
    face = bits.x & PTEX_NO_FACE;
    const uvec2 steps = uvec2((bits.x >> PTEX_FACE_BITS) << 13 | (bits.y & 0x1fffu), bits.y >> 13);
    return (vec2(steps) + 0.5) / PTEX_STEPS;
}

// A triangle's face and the coordinates of its corners there. `second`: of a wedge, the face of its second corner.
uint ptex_corners(uvec2 word, bool second, out vec2 a, out vec2 b, out vec2 c) {
    const uint part = word.x & 7u;
    const uint face = word.x >> 3;
    a = vec2(0.0);
    b = vec2(1.0, 0.0);
    c = vec2(1.0, 1.0);
    if (part == 1u) {
        b = vec2(1.0, 1.0);
        c = vec2(0.0, 1.0);
    } else if (part == 2u) {
        c = vec2(0.0, 1.0);
    } else if (part == 3u) {
        a = vec2(1.0, 0.0);
        b = vec2(1.0, 1.0);
        c = vec2(0.0, 1.0);
    } else if (part == PTEX_CORNER || part == PTEX_NOWHERE) {
        b = a;
        c = a;
    } else if (part >= PTEX_WEDGE) {
        a = second ? vec2(0.0, 2.0) : vec2(0.0);
        b = second ? vec2(0.0) : vec2(2.0, 0.0);
        if (second) return part == PTEX_WEDGE ? face + 1u : face + 1u - word.y;
    }
    return part == PTEX_NOWHERE ? PTEX_NO_FACE : face;
}

// The place of a point of a triangle, packed.
vec2 ptex_place(uvec2 word, vec3 weights) {
    const uint part = word.x & 7u;
    vec2 a, b, c;
    const bool second = (part == PTEX_WEDGE || part == PTEX_LAST_WEDGE) && weights.y > weights.x;
    const uint face = ptex_corners(word, second, a, b, c);
    return pack_ptex(face, a * weights.x + b * weights.y + c * weights.z);
}

// The face and corners of a triangle at the packed place `st`, as ptex_corners returns them.
void ptex_corners_at(uvec2 word, vec2 st, out vec2 a, out vec2 b, out vec2 c) {
    uint face;
    unpack_ptex(st, face);
    ptex_corners(word, face != word.x >> 3, a, b, c);
}

#endif
