// SPDX-License-Identifier: Apache-2.0
// Watertight ray-triangle test: vertices relative to the ray origin, three Pluecker edge functions (Woop, Benthin and Wald
// 2013 prove the idea; Platis and Theoharis 2003 for the coordinates). The edge functions of an edge that two triangles
// share are exact negatives of each other, so no ray slips between them.
#ifndef OOCPT_TRIANGLE_GLSL
#define OOCPT_TRIANGLE_GLSL

// d . ((p - q) x (p + q)); exactly antisymmetric in p and q.
float edge_function(vec3 p, vec3 q, vec3 d) {
    precise const vec3 e = p - q;
    precise const vec3 s = p + q;
    precise const float x = fma(e.y, s.z, -(e.z * s.y));
    precise const float y = fma(e.z, s.x, -(e.x * s.z));
    precise const float z = fma(e.x, s.y, -(e.y * s.x));
    precise const float r = fma(x, d.x, fma(y, d.y, z * d.z));
    return r;
}

// Sets distance (in units of d) and barycentrics (weights of v1, v2) and returns true when the line of the ray meets the
// triangle, edges included. The caller compares distances; NaN compares false.
bool hit_triangle(vec3 v0, vec3 v1, vec3 v2, vec3 o, vec3 d, out float t, out vec2 uv) {
    const vec3 a = v0 - o;
    const vec3 b = v1 - o;
    const vec3 c = v2 - o;
    const float wb = edge_function(c, a, d);
    const float wc = edge_function(a, b, d);
    const float wa = edge_function(b, c, d);
    const float sum = wa + wb + wc;
    if ((min(wa, min(wb, wc)) < 0.0 && max(wa, max(wb, wc)) > 0.0) || sum == 0.0) return false;
    const float scale = 1.0 / sum;
    uv = vec2(wb, wc) * scale;
    t = dot3(fma(a, vec3(wa * scale), fma(b, vec3(uv.x), c * uv.y)), d) / dot3(d, d);
    return true;
}

#endif
