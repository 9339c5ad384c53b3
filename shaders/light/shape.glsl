// SPDX-License-Identifier: Apache-2.0
// Shapes of local lights under any affine map M: hits, points for shadow rays, and their densities per solid angle at
// the receiver.
//
// All in the light's unit frame: o is the receiver and d a direction there, d = M^-1 w for a unit world direction w, so
// that distances t are the world's. A shape's area element is |det M| |n . M^-1 w| / |w . N| times the unit shape's,
// hence a density p over the unit shape's area is p t^2 / (|det M| |n . d|) per world solid angle. Spheres are sampled
// in the cone that they fill in the unit frame; dw/dw' = |det M| |d|^3. Exact for ellipsoids and elliptic cylinders
// too.
//
// A shape is a file of light_shapes and a row of rust/abi/src/light_shapes.rs, from which the build writes
// what goes through all of them (generated/light_shapes.glsl). Of the shape NAME:
//   bool NAME_faces(const vec3 o)  whether the receiver is on the side that shines
//   bool NAME_hit(const vec3 o, const vec3 d, out vec3 q, out float t)
//                                  the point q that a ray from that side meets, and its distance
//   vec3 NAME_point(const vec3 o, const vec2 u)
//                                  a point for a receiver there, from two random numbers
//   float NAME_density(const float volume, const vec3 o, const vec3 d, const vec3 q, const float t)
//                                  density at the receiver, per world solid angle, of choosing q at distance t; volume
//                                  is |det M|
// A thin one, which no ray meets and which shines to all sides, has instead of all but NAME_point
//   float NAME_length(const GpuLocalLight light, const vec3 w)
//                                  what its intensity is multiplied by, seen along the unit world direction w
// A parameter that is not `const` is a copy in each call.
#ifndef OOCPT_LIGHT_SHAPE_GLSL
#define OOCPT_LIGHT_SHAPE_GLSL

GpuLocalLight load_local_light(uint index) {
    GpuLocalLight light = LocalLights(LIGHTING.local_lights).v[index];
    if (HAS_MOVING_LIGHTS) move_local_light(index, light);
    return light;
}

uint light_kind(uint flags) {
    return flags & LIGHT_KIND_MASK;
}

// The point of the plane z = 0 that a ray from z < 0 meets.
bool plane_hit(const vec3 o, const vec3 d, out vec3 q, out float t) {
    q = vec3(0.0);
    t = 0.0;
    if (!(d.z > 0.0)) return false;
    t = -o.z / d.z;
    q = vec3(o.xy + t * d.xy, 0.0);
    return true;
}

// The nearer root of |o + t d| = 1, from outside (Haines et al. 2019, Ray Tracing Gems ch. 7). `across`: the axes that
// count, all of them or, of a cylinder, all but its own.
bool round_hit(const vec3 o, const vec3 d, const vec3 across, out vec3 q, out float t) {
    q = vec3(0.0);
    t = 0.0;
    const vec3 oo = o * across;
    const vec3 dd = d * across;
    const float a = dot3(dd, dd);
    const float b = -dot3(oo, dd);
    if (!(b > 0.0 && a > 0.0)) return false;
    const vec3 nearest = oo + dd * (b / a);
    const float discriminant = 1.0 - dot3(nearest, nearest);
    if (!(discriminant > 0.0)) return false;
    t = (dot3(oo, oo) - 1.0) / (b + sqrt(a * discriminant));
    q = o + t * d;
    return true;
}

// Density per solid angle from a density over the unit shape's area, at a point whose normal has this cosine with d.
float area_density(const float density, const float cosine, const float volume, const float t) {
    return density * t * t / (volume * cosine);
}

#include "generated/light_shapes.glsl"

#endif
