// SPDX-License-Identifier: Apache-2.0
// Ray cones (Akenine-Moeller et al. 2021, "Improved Shader and Texture Level of Detail Using Ray Cones", JCGT 10(1)): a
// width at the origin of a path's ray, and its growth per unit of length. Only with textures. texture/footprint.glsl
// computes what a cone covers of a slanted surface. Curvature of surfaces is left out.
#ifndef OOCPT_CONE_GLSL
#define OOCPT_CONE_GLSL

#include "math/affine.glsl"

layout(buffer_reference, scalar, buffer_reference_align = 8) buffer Cones { vec2 v[]; };

// Samples of a pixel that are assumed to share the hemisphere: a cone's solid angle is 1 / (CONE_SAMPLES * density).
const float CONE_SAMPLES = 64.0;
const float CONE_WIDEST = 0.5;

// Width of a camera ray's cone, in pixels. The samples of a pixel are spread over it, and filter; a filter of a pixel's
// width for each of them blurs twice. By half the width the blur's error at 64 samples is about that of their noise
// without a filter (decisions/0018).
const float CAMERA_CONE = 0.5;

// The cone of a camera ray; `d` is the direction of length 1 along the view axis.
void store_camera_cone(uint path, vec3 d) {
    // Images other than the color have one sample in a pixel.
    const float pixels = (push.flags & PUSH_AOVS) != 0u ? 1.0 : CAMERA_CONE;
    const float width = pixels * sqrt(length(FRAME.ray_o_x) * length(FRAME.ray_o_y));
    const float spread = pixels * sqrt(length(FRAME.ray_d_x) * length(FRAME.ray_d_y)) * inversesqrt(dot(d, d));
    Cones(FRAME.cones).v[path] = vec2(width, spread);
}

float cone_width(uint path, float t) {
    const vec2 cone = Cones(FRAME.cones).v[path];
    return fma(cone.y, t, cone.x);
}

// The cone of a camera ray that begins at distance t instead.
void begin_cone(uint path, float t) {
    Cones(FRAME.cones).v[path].x = cone_width(path, t);
}

// The growth of a path's cone after a direction that was sampled with density `pdf`; 0: by a mirror or a smooth
// boundary, which leave the growth as it is.
float next_spread(uint path, float pdf) {
    const float before = Cones(FRAME.cones).v[path].y;
    // A cone of small angle a fills pi a^2 / 4.
    const float spread = pdf > 0.0 ? sqrt(4.0 / (3.14159265 * CONE_SAMPLES * pdf)) : 0.0;
    return max(before, min(spread, CONE_WIDEST));
}

// The cone of the next ray, from where the last one was `width` wide.
void store_next_cone(uint path, float width, float pdf) {
    Cones(FRAME.cones).v[path] = vec2(width, next_spread(path, pdf));
}

#endif
