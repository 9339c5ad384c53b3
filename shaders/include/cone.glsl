// SPDX-License-Identifier: Apache-2.0
// Ray cones (Akenine-Moeller et al. 2021, "Improved Shader and Texture Level of Detail Using Ray Cones", JCGT 10(1)): a width at the
// origin of a path's ray, and its growth per unit of length. Only with textures. Lookups take the longer side of a cone's cut
// through a slanted surface, as there. Curvature of surfaces is left out.
#ifndef OOCPT_CONE_GLSL
#define OOCPT_CONE_GLSL

#include "include/affine.glsl"

layout(buffer_reference, scalar, buffer_reference_align = 8) buffer Cones { vec2 v[]; };

// Share of a direction's density that a cone stands for: as if so many samples of a pixel went to the hemisphere, a cone each.
const float CONE_SAMPLES = 64.0;
const float CONE_WIDEST = 0.5;

// The cone of a camera ray through a pixel: it is a pixel wide, everywhere. `d` is the direction of length 1 along the view axis.
void store_camera_cone(uint path, vec3 d) {
    const float width = sqrt(length(FRAME.ray_o_x) * length(FRAME.ray_o_y));
    const float spread = sqrt(length(FRAME.ray_d_x) * length(FRAME.ray_d_y)) * inversesqrt(dot(d, d));
    Cones(FRAME.cones).v[path] = vec2(width, spread);
}

const float SLANT_MOST = 1.0e4;

// How much longer than wide a cone's cut through a surface with normal n is, for a ray along d: 1 / cos; of any lengths.
float slant(vec3 n, vec3 d) {
    const float across = abs(dot3(n, d));
    const float whole = sqrt(dot3(n, n)) * sqrt(dot3(d, d));
    return whole < SLANT_MOST * across ? whole / across : SLANT_MOST;
}

float cone_width(uint path, float t) {
    const vec2 cone = Cones(FRAME.cones).v[path];
    return fma(cone.y, t, cone.x);
}

// How the cone of a path grows after a direction that was chosen with density `pdf`; 0: by a mirror or a smooth boundary, which leave
// the growth as it is.
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
