// SPDX-License-Identifier: Apache-2.0
// Ray against a ball: a point. It is the hull of two equal balls (geometry/round.glsl), and so the functions get it: v0
// and v1 are the centre, v2.x and v2.y the radius. But an item in memory is the centre and a word, 16 bytes, with radii
// elsewhere (geometry/pose.glsl), and leaves have up to eight. geometry/leaf.glsl specifies the functions.
#ifndef OOCPT_POINT_GLSL
#define OOCPT_POINT_GLSL

// The operations of round_span, without those for a second ball and a cone.
bool point_span(const vec3 v0, const vec3 v2, const vec3 o, const vec3 d, out RoundHit hit, out float nearest) {
    const float dd = dot3(d, d);
    const vec3 from = o - v0;
    nearest = dot3(-from, d) / dd;
    hit = RoundHit(3.0e38, 0.0, -3.0e38, 0.0);
    meet_ball(hit, from + nearest * d, v2.x, d, dd, 0.0);
    return hit.entry <= hit.exit;
}

bool point_hit(const vec3 v0, const vec3 v1, const vec3 v2, const vec3 o, const vec3 d, out float t, out vec2 uv) {
    t = 0.0;
    uv = vec2(0.0);
    RoundHit hit;
    float nearest;
    if (!point_span(v0, v2, o, d, hit, nearest)) return false;
    const bool inside = !(nearest + hit.entry > 0.0);
    t = nearest + (inside ? hit.exit : hit.entry);
    return t > 0.0;
}

bool point_exit(const vec3 v0, const vec3 v1, const vec3 v2, const vec3 o, const vec3 d, out float t, out vec2 uv) {
    t = 0.0;
    uv = vec2(0.0);
    RoundHit hit;
    float nearest;
    if (!point_span(v0, v2, o, d, hit, nearest)) return false;
    t = nearest + hit.exit;
    return nearest + hit.entry > 0.0;
}

float point_radius(const vec3 v0, const vec3 v1, const vec3 v2, const vec2 uv) {
    return round_radius(v0, v1, v2, uv);
}

vec3 point_point(const vec3 v0, const vec3 v1, const vec3 v2, const vec2 uv, const vec3 met, out vec3 normal) {
    return round_point(v0, v1, v2, uv, met, normal);
}

float point_beside(const vec3 v0, const vec3 v1, const vec3 v2, const vec2 uv, const vec3 normal, const vec3 point) {
    return round_beside(v0, v1, v2, uv, normal, point);
}

float point_rounding(const vec3 v0, const vec3 v1, const vec3 v2, const vec3 point) {
    return round_rounding(v0, v1, v2, point);
}

void point_edges(const vec3 v0, const vec3 v1, const vec3 v2, out vec3 e, out vec3 f) {
    round_edges(v0, v1, v2, e, f);
}

vec3 point_keep(const vec3 v0, const vec3 v1, const vec3 v2, const vec2 uv, const vec3 point) {
    return round_keep(v0, v1, v2, uv, point);
}

vec3 point_place(const vec3 v0, const vec3 v1, const vec3 v2, const vec2 uv, const vec3 kept) {
    return round_place(v0, v1, v2, uv, kept);
}

#endif
