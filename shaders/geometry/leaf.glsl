// SPDX-License-Identifier: Apache-2.0
// What a kind of leaf is: a file of geometry with a few functions, and a row of rust/abi/src/leaves.rs, from
// which the build writes what goes through all kinds (generated/leaves.glsl). An item has three vertices v0, v1, v2, at
// the time of the path (posed_item of geometry/pose.glsl), and what they mean is the kind's; all is in the mesh's
// frame. Values by corner have weights 1 - uv.x - uv.y, uv.x, uv.y at a hit, whatever the kind. Of the kind NAME:
//   bool NAME_hit(const vec3 v0, const vec3 v1, const vec3 v2, const vec3 o, const vec3 d, out float t, out vec2 uv)
//                                  whether a ray meets the item in front of its origin, the distance in units of d, and
//                                  the weights there. rust/traverse/src/leaf/NAME.rs does the same operations
//   bool NAME_exit(const vec3 v0, const vec3 v1, const vec3 v2, const vec3 o, const vec3 d, out float t, out vec2 uv)
//                                  the same for the second surface, where a ray leaves the item that it enters in front
//                                  of its origin: a ray that goes through the first one (opacity, cutouts) comes to it.
//                                  False where there is none. The Rust file does the same operations
//   vec3 NAME_point(const vec3 v0, const vec3 v1, const vec3 v2, const vec2 uv, const vec3 met, out vec3 normal)
//                                  the point of the surface at a hit, and the unit normal there, outwards; `met` is
//                                  where the ray is at the hit's distance, and rounded
//   float NAME_beside(const vec3 v0, const vec3 v1, const vec3 v2, const vec2 uv, const vec3 normal, const vec3 point)
//                                  how far beside that surface a point near the hit is
//   float NAME_rounding(const vec3 v0, const vec3 v1, const vec3 v2, const vec3 point)
//                                  a bound on how far NAME_hit may see the surface from its place, for a ray that
//                                  begins at the point: rays that leave a surface start that much away from it
//   void NAME_edges(const vec3 v0, const vec3 v1, const vec3 v2, out vec3 e, out vec3 f)
//                                  two vectors, not parallel, along which values by corner grow by those of the second
//                                  and the third corner less that of the first. The Rust file does the same operations
//   vec3 NAME_keep(const vec3 v0, const vec3 v1, const vec3 v2, const vec2 uv, const vec3 point)
//   vec3 NAME_place(const vec3 v0, const vec3 v1, const vec3 v2, const vec2 uv, const vec3 kept)
//                                  what a point of the surface keeps when the item moves, and where a point is that
//                                  keeps it: images of motion follow the point
// A tube (its row says so: v1 - v0 is its axis) has one more:
//   float NAME_radius(const vec3 v0, const vec3 v1, const vec3 v2, const vec2 uv)
//                                  the radius at a hit
//
// Triangles (geometry/triangle.glsl) are what leaves are made of where nothing else is said. What they need stands
// where it is used, beside a call of the function over all other kinds: a scene of triangles compiles nothing else.
#ifndef OOCPT_LEAF_GLSL
#define OOCPT_LEAF_GLSL

#include "math/affine.glsl"
#include "generated/leaves.glsl"

#endif
