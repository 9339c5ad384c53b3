// SPDX-License-Identifier: Apache-2.0
// The kind of leaf that rust/book/src/extending.md adds; compiled for tests alone. A box along the axes of the mesh's
// frame, of which v0 and v1 are any two opposite corners; values by corner are linear along x. geometry/leaf.glsl
// specifies the functions.
#ifndef OOCPT_TOY_BOX_GLSL
#define OOCPT_TOY_BOX_GLSL

// The position along x from v0 to v1, 0..1.
float toy_box_share(const vec3 v0, const vec3 v1, const float x) {
    const float extent = v1.x - v0.x;
    return extent == 0.0 ? 0.0 : clamp((x - v0.x) / extent, 0.0, 1.0);
}

// The ray is inside between its last entry into a pair of planes and its first exit (Kay and Kajiya 1986).
bool toy_box_span(const vec3 v0, const vec3 v1, const vec3 o, const vec3 d, out float entry, out float exit) {
    entry = -3.0e38;
    exit = 3.0e38;
    for (uint i = 0u; i < 3u; ++i) {
        const float a = v0[i] - o[i];
        const float b = v1[i] - o[i];
        if (d[i] == 0.0) {
            if ((a < 0.0) == (b < 0.0)) return false;
            continue;
        }
        const float first = a / d[i];
        const float second = b / d[i];
        const float near = first < second ? first : second;
        const float far = first < second ? second : first;
        if (near > entry) entry = near;
        if (far < exit) exit = far;
    }
    return entry <= exit;
}

bool toy_box_hit(const vec3 v0, const vec3 v1, const vec3 v2, const vec3 o, const vec3 d, out float t, out vec2 uv) {
    t = 0.0;
    uv = vec2(0.0);
    float entry, exit;
    if (!toy_box_span(v0, v1, o, d, entry, exit)) return false;
    t = entry > 0.0 ? entry : exit;
    uv.x = toy_box_share(v0, v1, o.x + t * d.x);
    return t > 0.0;
}

bool toy_box_exit(const vec3 v0, const vec3 v1, const vec3 v2, const vec3 o, const vec3 d, out float t, out vec2 uv) {
    t = 0.0;
    uv = vec2(0.0);
    float entry, exit;
    if (!toy_box_span(v0, v1, o, d, entry, exit)) return false;
    t = exit;
    uv.x = toy_box_share(v0, v1, o.x + t * d.x);
    return entry > 0.0;
}

// The point of the nearest face to the point where the ray meets it.
vec3 toy_box_point(const vec3 v0, const vec3 v1, const vec3 v2, const vec2 uv, const vec3 met, out vec3 normal) {
    vec3 point = clamp(met, min(v0, v1), max(v0, v1));
    float least = 3.0e38;
    uint axis = 0u;
    float face = v0.x;
    for (uint i = 0u; i < 6u; ++i) {
        const uint k = i >> 1;
        const float place = (i & 1u) == 0u ? v0[k] : v1[k];
        const float beside = abs(met[k] - place);
        if (beside < least) {
            least = beside;
            axis = k;
            face = place;
        }
    }
    point[axis] = face;
    normal = vec3(0.0);
    normal[axis] = 2.0 * face < v0[axis] + v1[axis] ? -1.0 : 1.0;
    return point;
}

float toy_box_beside(const vec3 v0, const vec3 v1, const vec3 v2, const vec2 uv, const vec3 normal, const vec3 point) {
    const vec3 low = min(v0, v1);
    const vec3 high = max(v0, v1);
    const vec3 side = max(normal, vec3(0.0)) * high - max(-normal, vec3(0.0)) * low;
    return abs(dot3(side, abs(normal)) - dot3(point, normal));
}

// The rounding of a difference and a quotient, and as much again for the operations that follow.
float toy_box_rounding(const vec3 v0, const vec3 v1, const vec3 v2, const vec3 point) {
    return 4.0 * UNIT_ROUNDOFF * (max(largest_of(v0), largest_of(v1)) + largest_of(point));
}

// An edge along x, and one across.
void toy_box_edges(const vec3 v0, const vec3 v1, const vec3 v2, out vec3 e, out vec3 f) {
    e = vec3(v1.x - v0.x, 0.0, 0.0);
    f = vec3(0.0, v1.y - v0.y, v1.z - v0.z);
}

// The position relative to v0 and v1, in each axis.
vec3 toy_box_keep(const vec3 v0, const vec3 v1, const vec3 v2, const vec2 uv, const vec3 point) {
    return (point - v0) / (v1 - v0);
}

vec3 toy_box_place(const vec3 v0, const vec3 v1, const vec3 v2, const vec2 uv, const vec3 kept) {
    return v0 + kept * (v1 - v0);
}

#endif
