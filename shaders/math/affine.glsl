// SPDX-License-Identifier: Apache-2.0
// Affine maps as three rows, the maps into chunks, and reading both. All products are explicit fma chains: the same
// bits in every pass, which traversal, surface.glsl and its error bounds count on.
#ifndef OOCPT_AFFINE_GLSL
#define OOCPT_AFFINE_GLSL

#include "math/double.glsl"

struct Affine {
    vec4 x;
    vec4 y;
    vec4 z;
};

// From the world (relative to Snapshot::origin) to a chunk's own frame: rows * (p - origin).
struct ChunkMap {
    vec3 x;
    vec3 y;
    vec3 z;
    Double3 origin;
};

const float UNIT_ROUNDOFF = 5.9604645e-8;

float dot3(vec3 a, vec3 b) {
    return fma(a.x, b.x, fma(a.y, b.y, a.z * b.z));
}

vec3 cross3(vec3 a, vec3 b) {
    return vec3(fma(a.y, b.z, -(a.z * b.y)), fma(a.z, b.x, -(a.x * b.z)), fma(a.x, b.y, -(a.y * b.x)));
}

// A normal of a triangle, not unit, from its two shorter edges: as good as their angle, which is never a small one.
// `size` bounds what is summed: each component is off by less than 4 units in the last place of that of `size`.
vec3 triangle_normal(vec3 v0, vec3 v1, vec3 v2, out vec3 size) {
    const vec3 a = v1 - v0;
    const vec3 b = v2 - v0;
    const vec3 c = v2 - v1;
    const float aa = dot3(a, a);
    const float bb = dot3(b, b);
    const float cc = dot3(c, c);
    // a x b = a x c = b x c.
    const bool without_a = aa > bb && aa > cc;
    const bool without_c = !without_a && cc > bb;
    const vec3 p = without_a ? b : a;
    const vec3 q = without_c ? b : c;
    const vec3 s = abs(p);
    const vec3 r = abs(q);
    size = fma(s.yzx, r.zxy, s.zxy * r.yzx);
    return cross3(p, q);
}

vec3 apply_point(Affine m, vec3 p) {
    return vec3(fma(m.x.x, p.x, fma(m.x.y, p.y, fma(m.x.z, p.z, m.x.w))),
                fma(m.y.x, p.x, fma(m.y.y, p.y, fma(m.y.z, p.z, m.y.w))),
                fma(m.z.x, p.x, fma(m.z.y, p.y, fma(m.z.z, p.z, m.z.w))));
}

vec3 apply_rows(vec3 x, vec3 y, vec3 z, vec3 v) {
    return vec3(dot3(x, v), dot3(y, v), dot3(z, v));
}

vec3 apply_vector(Affine m, vec3 v) {
    return apply_rows(m.x.xyz, m.y.xyz, m.z.xyz, v);
}

vec3 combine_rows(vec3 x, vec3 y, vec3 z, vec3 v) {
    return fma(x, vec3(v.x), fma(y, vec3(v.y), z * v.z));
}

// The map of covectors (normals) from the object frame back to the parent frame.
vec3 apply_transposed(Affine m, vec3 v) {
    return combine_rows(m.x.xyz, m.y.xyz, m.z.xyz, v);
}

vec4 compose_row(vec4 row, Affine b) {
    return fma(b.x, vec4(row.x), fma(b.y, vec4(row.y), fma(b.z, vec4(row.z), vec4(0.0, 0.0, 0.0, row.w))));
}

// a after b.
Affine compose(Affine a, Affine b) {
    return Affine(compose_row(a.x, b), compose_row(a.y, b), compose_row(a.z, b));
}

// The vector that the rows map to r.
vec3 unapply_rows(vec3 x, vec3 y, vec3 z, vec3 r) {
    const vec3 yz = cross3(y, z);
    return combine_rows(yz, cross3(z, x), cross3(x, y), r) / dot3(x, yz);
}

// The point that m maps to q.
vec3 unapply_point(Affine m, vec3 q) {
    return unapply_rows(m.x.xyz, m.y.xyz, m.z.xyz, q - vec3(m.x.w, m.y.w, m.z.w));
}

Affine instance_map(uint64_t instances, uint index) {
    return Affine(Instances(instances).v[index].object_from_parent[0],
                  Instances(instances).v[index].object_from_parent[1],
                  Instances(instances).v[index].object_from_parent[2]);
}

ChunkMap chunk_map(uint chunk_instance) {
    ChunkInstances instances = ChunkInstances(FRAME.chunk_instances);
    const vec4 x = instances.v[chunk_instance].chunk_from_world[0];
    const vec4 y = instances.v[chunk_instance].chunk_from_world[1];
    const vec4 z = instances.v[chunk_instance].chunk_from_world[2];
    return ChunkMap(x.xyz, y.xyz, z.xyz, Double3(vec3(x.w, y.w, z.w), instances.v[chunk_instance].origin_lo));
}

// v normalised, for any length that is a number; else `fallback`.
vec3 normal_or(vec3 v, vec3 fallback) {
    const float largest = max(abs(v.x), max(abs(v.y), abs(v.z)));
    if (!(largest > 0.0 && largest < 3.0e38)) return fallback;
    const vec3 scaled = v / largest;
    return scaled * inversesqrt(dot3(scaled, scaled));
}

float largest_of(vec3 v) {
    return max(abs(v.x), max(abs(v.y), abs(v.z)));
}

#endif
