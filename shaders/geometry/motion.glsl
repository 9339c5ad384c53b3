// SPDX-License-Identifier: Apache-2.0
// Placements that move: the map of one at a time of the shutter, from keys of translation, rotation and symmetric
// stretch (oocpt_core::scene::MotionKey). Translations and stretches are linear between keys, rotations go along the
// arc (Shoemake 1985). Only products, sums and divisions, in one order: the same bits in every pass, which traversal
// and the error bounds of surface.glsl count on. Without HAS_MOTION none of it is compiled in.
//
// The time of a path is a function of pixel, sample and seed, worked out anew wherever it is needed: nothing about it
// is kept.
#ifndef OOCPT_MOTION_GLSL
#define OOCPT_MOTION_GLSL

#include "math/affine.glsl"
#include "math/sampler.glsl"

// What GpuInstance::target holds besides flags.
const uint TARGET_NUMBER = HAS_MOTION ? ~(TARGET_ASSEMBLY | TARGET_MOVING) : ~TARGET_ASSEMBLY;

// sample_4d(index, TIME_SET, seed).x: stratified over the samples of a pixel.
float shutter_time(uint index, uint seed) {
    const uint set_seed = hash_u32(hash_combine(seed, TIME_SET));
    const uint x = bitfieldReverse(owen_scramble(index, set_seed));
    return float(owen_scramble(x, hash_u32(hash_combine(set_seed, 0u))) >> 8) * 5.9604644775390625e-8;
}

// Images through pixel centres are those of the middle of the shutter, as is the camera of FrameConstants.
float path_time(uint path) {
    if ((push.flags & PUSH_AOVS) != 0u) return 0.5;
    const uvec2 pixel = pixel_position(path_pixel(path));
    return shutter_time(path_sample(path), pixel_seed(pixel.x, pixel.y, path_seed(path)));
}

// The sine in [0, pi / 2], off by less than 2^-23: the driver's may be off by 2^-11.
float quadrant_sine(float x) {
    const float y = x * x;
    const float high = fma(y, fma(y, -2.5052108e-8, 2.7557319e-6), -1.9841270e-4);
    return x * fma(y, fma(y, fma(y, high, 8.3333333e-3), -1.6666667e-1), 1.0);
}

struct Motion {
    float part; // of the way from one key to the next
    vec3 stretch;
    vec3 shear;
    vec3 turn[3]; // columns of the rotation
};

Motion between(GpuMotionKey a, GpuMotionKey b, float time) {
    Motion m;
    const float f = clamp((time - a.time) / (b.time - a.time), 0.0, 1.0);
    m.part = f;
    m.stretch = fma(vec3(f), b.stretch - a.stretch, a.stretch);
    m.shear = fma(vec3(f), b.shear - a.shear, a.shear);
    vec2 weights = vec2(1.0 - f, f);
    if (a.half_angle > 0.0) {
        weights = vec2(quadrant_sine((1.0 - f) * a.half_angle), quadrant_sine(f * a.half_angle));
    }
    const vec4 q = fma(vec4(weights.x), a.rotation, weights.y * b.rotation);
    // Of any length.
    const vec4 s = q * (2.0 / fma(q.w, q.w, dot3(q.xyz, q.xyz)));
    m.turn[0] = vec3(1.0 - fma(q.y, s.y, q.z * s.z), fma(q.x, s.y, q.w * s.z), fma(q.x, s.z, -(q.w * s.y)));
    m.turn[1] = vec3(fma(q.x, s.y, -(q.w * s.z)), 1.0 - fma(q.x, s.x, q.z * s.z), fma(q.y, s.z, q.w * s.x));
    m.turn[2] = vec3(fma(q.x, s.z, q.w * s.y), fma(q.y, s.z, -(q.w * s.x)), 1.0 - fma(q.x, s.x, q.y * s.y));
    return m;
}

vec3 moved_vector(Motion m, vec3 v) {
    const vec3 stretched =
        vec3(dot3(vec3(m.stretch.x, m.shear.xy), v), dot3(vec3(m.shear.x, m.stretch.y, m.shear.z), v),
             dot3(vec3(m.shear.yz, m.stretch.z), v));
    return combine_rows(m.turn[0], m.turn[1], m.turn[2], stretched);
}

// The inverse of translation * rotation * stretch: rows from the parent's frame to the object's.
Affine inverse_map(Motion m, vec3 translation) {
    const float size = largest_of(m.stretch);
    const vec3 d = m.stretch / size;
    const vec3 e = m.shear / size; // xy, xz, yz
    const vec3 diagonal = vec3(fma(d.y, d.z, -(e.z * e.z)), fma(d.x, d.z, -(e.y * e.y)), fma(d.x, d.y, -(e.x * e.x)));
    const vec3 beside = vec3(fma(e.y, e.z, -(e.x * d.z)), fma(e.x, e.z, -(e.y * d.y)), fma(e.x, e.y, -(e.z * d.x)));
    const float scale = 1.0 / (fma(d.x, diagonal.x, fma(e.x, beside.x, e.y * beside.y)) * size);
    const vec3 x = combine_rows(m.turn[0], m.turn[1], m.turn[2], vec3(diagonal.x, beside.x, beside.y) * scale);
    const vec3 y = combine_rows(m.turn[0], m.turn[1], m.turn[2], vec3(beside.x, diagonal.y, beside.z) * scale);
    const vec3 z = combine_rows(m.turn[0], m.turn[1], m.turn[2], vec3(beside.y, beside.z, diagonal.z) * scale);
    return Affine(vec4(x, -dot3(x, translation)), vec4(y, -dot3(y, translation)), vec4(z, -dot3(z, translation)));
}

Affine moving_map(uint64_t instances, uint record, float time) {
    const uvec2 place = ConstUVec4s(instances).v[record * 4u].xy;
    const uint64_t keys = instances + 16ul * uint64_t(place.x);
    uint at = 0u;
    while (at + 2u < place.y && MotionKeys(keys).v[at + 1u].time <= time) ++at;
    const GpuMotionKey a = MotionKeys(keys).v[at];
    const GpuMotionKey b = MotionKeys(keys).v[at + 1u];
    const Motion m = between(a, b, time);
    return inverse_map(m, fma(vec3(m.part), b.translation - a.translation, a.translation));
}

// The map of a record, which is that of a moving one at the given time.
Affine placed_map(uint64_t instances, uint record, uint target, float time) {
    if (HAS_MOTION && (target & TARGET_MOVING) != 0u) return moving_map(instances, record, time);
    return instance_map(instances, record);
}

#endif
