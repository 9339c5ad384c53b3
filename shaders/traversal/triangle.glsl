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

// A triangle is seen along its plane below this squared cosine.
const float GRAZING = 1.0e-4;

// Sets distance (in units of d) and barycentrics (weights of v1, v2) and returns true when the line of the ray meets the
// triangle, edges included. The caller compares distances; NaN compares false.
//
// The distance is that of the plane: the barycentrics round by the triangle's size over its height, and a sum weighted by them would put
// points of slivers, and of triangles much larger than their distance, anywhere. Along the plane, where that rounds without bound, it is
// kept between the corners', so that no ray slips behind its own origin.
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
    vec3 size;
    const vec3 n = triangle_normal(v0, v1, v2, size);
    const float dd = dot3(d, d);
    const float along = dot3(n, d);
    t = dot3(n, a) / along;
    if (!(along * along > GRAZING * dot3(n, n) * dd)) {
        const vec3 corners = vec3(dot3(a, d), dot3(b, d), dot3(c, d)) / dd;
        const float low = min(corners.x, min(corners.y, corners.z));
        const float high = max(corners.x, max(corners.y, corners.z));
        const bool is_number = along != 0.0;
        t = clamp(is_number ? t : fma(corners.x, wa * scale, fma(corners.y, uv.x, corners.z * uv.y)), low, high);
    }
    return true;
}

#endif
