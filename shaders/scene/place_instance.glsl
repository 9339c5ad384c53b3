// SPDX-License-Identifier: Apache-2.0
// The placement of an instance from the arrays of its instancer, as the host computes it
// (rust/core/src/instancing/placement): the same operations in double precision, in the same order, so that records
// have the same bits where a device divides and rounds as IEEE 754 says.
#ifndef OOCPT_PLACE_INSTANCE_GLSL
#define OOCPT_PLACE_INSTANCE_GLSL

#include "scene/held_chunks.glsl"

layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer ConstDoubles { double v[]; };

// Rounding of the record and of its evaluation (MATRIX_ERROR), what counts as singular, the largest number of a record
// in the assembly's frame (MAX_MAGNITUDE), and of any.
const double MATRIX_ERROR = 4.0LF / 16777216.0LF;
const double SINGULAR = 1e-24LF;
const float MAX_MAGNITUDE = 1e18;
const float LARGEST = 3.402823466e38;

struct Affine {
    dvec3 x;
    dvec3 y;
    dvec3 z;
    dvec3 t;
};

const Affine IDENTITY =
    Affine(dvec3(1.0LF, 0.0LF, 0.0LF), dvec3(0.0LF, 1.0LF, 0.0LF), dvec3(0.0LF, 0.0LF, 1.0LF), dvec3(0.0LF));

struct PlacedInstance {
    vec4 rows[3];
    vec3 lower;
    vec3 upper;
    bool flips;
};

double dot_of(dvec3 a, dvec3 b) {
    return (a.x * b.x + a.y * b.y) + a.z * b.z;
}

dvec3 cross_of(dvec3 a, dvec3 b) {
    return dvec3(a.y * b.z - b.y * a.z, a.z * b.x - b.z * a.x, a.x * b.y - b.x * a.y);
}

dvec3 mapped(Affine m, dvec3 v) {
    return (m.x * v.x + m.y * v.y) + m.z * v.z;
}

Affine times(Affine a, Affine b) {
    return Affine(mapped(a, b.x), mapped(a, b.y), mapped(a, b.z), mapped(a, b.t) + a.t);
}

double number_of(uint64_t bits) {
    return packDouble2x32(unpackUint2x32(bits));
}

dvec3 vector_of(uint64_t x, uint64_t y, uint64_t z) {
    return dvec3(number_of(x), number_of(y), number_of(z));
}

Affine affine_of(uint64_t v[12]) {
    return Affine(vector_of(v[0], v[1], v[2]), vector_of(v[3], v[4], v[5]), vector_of(v[6], v[7], v[8]),
                  vector_of(v[9], v[10], v[11]));
}

dvec3 three_floats(uint64_t array, uint number) {
    ConstFloats floats = ConstFloats(array);
    const uint at = 3u * number;
    return dvec3(floats.v[at], floats.v[at + 1u], floats.v[at + 2u]);
}

dvec4 quaternion(uint64_t array, uint number, bool halves) {
    if (halves) {
        const uvec2 words = ConstUVec2s(array).v[number];
        return dvec4(unpackHalf2x16(words.x), unpackHalf2x16(words.y));
    }
    ConstFloats floats = ConstFloats(array);
    const uint at = 4u * number;
    return dvec4(floats.v[at], floats.v[at + 1u], floats.v[at + 2u], floats.v[at + 3u]);
}

// The rotation of a quaternion of any length; the identity for the zero quaternion.
Affine rotation(dvec4 q) {
    const double norm = ((q.x * q.x + q.y * q.y) + q.z * q.z) + q.w * q.w;
    if (norm == 0.0LF) return IDENTITY;
    const double s = 2.0LF / norm;
    const dvec3 v = q.xyz * s;
    const dvec3 w = q.w * v;
    const double xx = q.x * v.x, xy = q.x * v.y, xz = q.x * v.z;
    const double yy = q.y * v.y, yz = q.y * v.z, zz = q.z * v.z;
    return Affine(dvec3(1.0LF - (yy + zz), xy + w.z, xz - w.y), dvec3(xy - w.z, 1.0LF - (xx + zz), yz + w.x),
                  dvec3(xz + w.y, yz - w.x, 1.0LF - (xx + yy)), dvec3(0.0LF));
}

// A matrix as Gf stores it; false if it is not affine.
bool gf_matrix(uint64_t array, uint number, out Affine m) {
    ConstDoubles doubles = ConstDoubles(array);
    const uint at = 16u * number;
    double v[16];
    for (uint k = 0u; k < 16u; ++k) v[k] = doubles.v[at + k];
    const double w = v[15];
    if (v[3] == 0.0LF && v[7] == 0.0LF && v[11] == 0.0LF && w != 0.0LF && w != 1.0LF && abs(w) <= double(LARGEST)) {
        for (uint k = 0u; k < 16u; ++k) v[k] /= w;
    }
    m = Affine(dvec3(v[0], v[1], v[2]), dvec3(v[4], v[5], v[6]), dvec3(v[8], v[9], v[10]), dvec3(v[12], v[13], v[14]));
    const dvec4 row = abs(dvec4(v[3], v[7], v[11], v[15] - 1.0LF));
    return max(max(row.x, row.y), max(row.z, row.w)) <= 1e-9LF;
}

// T * R * S * M of an instance; false if it has none.
bool local_map(GpuChunkMember member, uint number, out Affine m) {
    m = IDENTITY;
    if (number >= member.count) return false;
    const bool halves = (member.flags & MEMBER_HALVES) != 0u;
    if (member.rotations != 0ul) m = rotation(quaternion(member.rotations, number, halves));
    if (member.translations != 0ul) m.t = three_floats(member.translations, number);
    if (member.scales != 0ul) {
        const dvec3 s = three_floats(member.scales, number);
        m.x *= s.x;
        m.y *= s.y;
        m.z *= s.z;
    }
    if (member.transforms != 0ul) {
        Affine inner;
        if (!gf_matrix(member.transforms, number, inner)) return false;
        m = times(m, inner);
    }
    return true;
}

// The largest float that is not above `v`, by its bits: a driver may take a double that went through a float for the
// double. Not finite where `v` is beyond all floats; numbers below the normal floats become 0 or the negative of the
// least of these.
float rounded_down(double v) {
    const uvec2 bits = unpackDouble2x32(v);
    const uint sign = bits.y & 0x80000000u;
    const int exponent = int((bits.y >> 20) & 0x7ffu) - 1023 + 127;
    if (exponent <= 0) return sign != 0u && v != 0.0LF ? uintBitsToFloat(0x80800000u) : 0.0;
    if (exponent >= 255) return uintBitsToFloat(sign | 0x7f800000u);
    const uint towards_zero = sign | uint(exponent) << 23 | (bits.y & 0xfffffu) << 3 | bits.x >> 29;
    return uintBitsToFloat(sign != 0u && (bits.x & 0x1fffffffu) != 0u ? towards_zero + 1u : towards_zero);
}

// The box of a target that is placed, about the map's translation, and how far rounding may move it.
void placed_box(Affine m, dvec3 rows[3], dvec3 offset, dvec3 center, dvec3 half_sides, out vec3 lower, out vec3 upper) {
    const dvec3 middle = mapped(m, center) + m.t;
    const dvec3 x = abs(m.x), y = abs(m.y), z = abs(m.z);
    const dvec3 sides = (x * half_sides.x + y * half_sides.y) + z * half_sides.z;
    const dvec3 reach = abs(middle) + sides;
    const dvec3 far = dvec3(dot_of(abs(rows[0]), reach), dot_of(abs(rows[1]), reach), dot_of(abs(rows[2]), reach));
    const dvec3 error = (far + abs(offset)) * MATRIX_ERROR;
    const dvec3 all = ((sides + x * error.x) + y * error.y) + z * error.z;
    const dvec3 low = middle - all, high = middle + all;
    lower = vec3(rounded_down(low.x), rounded_down(low.y), rounded_down(low.z));
    upper = -vec3(rounded_down(-high.x), rounded_down(-high.y), rounded_down(-high.z));
}

bool is_below(vec3 v, float limit) {
    return abs(v.x) <= limit && abs(v.y) <= limit && abs(v.z) <= limit;
}

// The placement of an instance of a member; false if it is not usable.
bool place_instance(GpuChunkMember member, uint number, out PlacedInstance placed) {
    const Affine before = affine_of(member.before);
    const Affine after = affine_of(member.after);
    Affine m;
    if ((member.flags & MEMBER_INSTANCED) != 0u) {
        Affine local;
        if (!local_map(member, number, local)) return false;
        m = times(before, local);
        if ((member.flags & MEMBER_AFTER) != 0u) m = times(m, after);
    } else {
        m = times(before, after);
    }
    const dvec3 across[3] = dvec3[3](cross_of(m.y, m.z), cross_of(m.z, m.x), cross_of(m.x, m.y));
    const double determinant = dot_of(m.z, across[2]);
    const double volume = (dot_of(m.x, m.x) * dot_of(m.y, m.y)) * dot_of(m.z, m.z);
    if (!(determinant * determinant > SINGULAR * volume)) return false;
    const double inverse = 1.0LF / determinant;
    const dvec3 rows[3] = dvec3[3](across[0] * inverse, across[1] * inverse, across[2] * inverse);
    const dvec3 offset = -dvec3(dot_of(rows[0], m.t), dot_of(rows[1], m.t), dot_of(rows[2], m.t));
    const dvec3 center = vector_of(member.center[0], member.center[1], member.center[2]);
    const dvec3 half_sides = vector_of(member.half_sides[0], member.half_sides[1], member.half_sides[2]);
    placed_box(m, rows, offset, center, half_sides, placed.lower, placed.upper);
    for (uint k = 0u; k < 3u; ++k) placed.rows[k] = vec4(vec3(rows[k]), float(offset[k]));
    placed.flips = determinant < 0.0LF;
    // What is usable does not depend on the chunk.
    const dvec3 shift = vector_of(member.parent[0], member.parent[1], member.parent[2]) - before.t;
    const Affine seen = Affine(m.x, m.y, m.z, m.t + shift);
    const dvec3 away = -dvec3(dot_of(rows[0], seen.t), dot_of(rows[1], seen.t), dot_of(rows[2], seen.t));
    vec3 lower, upper;
    placed_box(seen, rows, away, center, half_sides, lower, upper);
    bool usable = is_below(lower, MAX_MAGNITUDE) && is_below(upper, MAX_MAGNITUDE);
    usable = usable && is_below(vec3(away), MAX_MAGNITUDE);
    for (uint k = 0u; k < 3u; ++k) {
        usable = usable && is_below(placed.rows[k].xyz, MAX_MAGNITUDE) && abs(placed.rows[k].w) <= LARGEST;
    }
    return usable && is_below(placed.lower, LARGEST) && is_below(placed.upper, LARGEST);
}

#endif
