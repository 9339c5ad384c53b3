// SPDX-License-Identifier: Apache-2.0
// Affine maps as three rows, and reading them from instance records.
#ifndef OOCPT_AFFINE_GLSL
#define OOCPT_AFFINE_GLSL

struct Affine {
    vec4 x;
    vec4 y;
    vec4 z;
};

// Rounds the same way in traversal and in surface.glsl, whose error bounds count on it.
vec3 apply_point(Affine m, vec3 p) {
    precise vec3 r = vec3(fma(m.x.x, p.x, fma(m.x.y, p.y, fma(m.x.z, p.z, m.x.w))),
                          fma(m.y.x, p.x, fma(m.y.y, p.y, fma(m.y.z, p.z, m.y.w))),
                          fma(m.z.x, p.x, fma(m.z.y, p.y, fma(m.z.z, p.z, m.z.w))));
    return r;
}

vec3 apply_vector(Affine m, vec3 v) {
    return vec3(dot(m.x.xyz, v), dot(m.y.xyz, v), dot(m.z.xyz, v));
}

// The map of covectors (normals) from the object frame back to the parent frame.
vec3 apply_transposed(Affine m, vec3 v) {
    return m.x.xyz * v.x + m.y.xyz * v.y + m.z.xyz * v.z;
}

// a after b.
Affine compose(Affine a, Affine b) {
    return Affine(a.x.x * b.x + a.x.y * b.y + a.x.z * b.z + vec4(0.0, 0.0, 0.0, a.x.w),
                  a.y.x * b.x + a.y.y * b.y + a.y.z * b.z + vec4(0.0, 0.0, 0.0, a.y.w),
                  a.z.x * b.x + a.z.y * b.y + a.z.z * b.z + vec4(0.0, 0.0, 0.0, a.z.w));
}

// The point that m maps to q.
vec3 unapply_point(Affine m, vec3 q) {
    const vec3 r = q - vec3(m.x.w, m.y.w, m.z.w);
    const vec3 yz = cross(m.y.xyz, m.z.xyz);
    const vec3 zx = cross(m.z.xyz, m.x.xyz);
    const vec3 xy = cross(m.x.xyz, m.y.xyz);
    return (yz * r.x + zx * r.y + xy * r.z) / dot(m.x.xyz, yz);
}

Affine instance_map(uint64_t instances, uint index) {
    return Affine(Instances(instances).v[index].object_from_parent[0], Instances(instances).v[index].object_from_parent[1],
                  Instances(instances).v[index].object_from_parent[2]);
}

#endif
