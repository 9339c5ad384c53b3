// SPDX-License-Identifier: Apache-2.0
// Ray against the hull of two balls: a piece of a curve. The hull is convex, so a line enters and leaves it
// once. Its surface is that of a cone between the circles where it touches the balls, and of the balls beyond them; and
// all of both balls is inside. So the entry is the least of what the balls and the cone say, the exit the largest, and
// nothing has to be decided about where a ball ends: pieces that share a ball leave no gap.
//
// The cone in terms of the distance s along the axis, from the first centre: the ball around the centre at u * axis has
// radius r0 + u (r1 - r0); the envelope of these balls is at the distance (L r0 + (r1 - r0) s) / sqrt(g) from the axis,
// g = L^2 - (r1 - r0)^2, and touches the ball u = (L s + (r1 - r0) r0) / g. (Both follow from the derivative by u
// of the ball's equation. Terms are kept apart along and across the axis, so that a piece that is much longer than
// thick keeps its digits.)
//
// A hit keeps the ball that touches the surface there, uv.x: 0 is the first one, v0 with radius v2.x, and 1 the second
// one, v1 with radius v2.y. Corners 0 and 2 are the first centre, so values by corner are linear along the axis.
// geometry/leaf.glsl says what the functions are.
#ifndef OOCPT_ROUND_GLSL
#define OOCPT_ROUND_GLSL

// Relative rounding error of round_hit: 32 operations that each may lose a unit.
const float ROUND_ROUNDOFF = 32.0 * UNIT_ROUNDOFF;

struct RoundHit {
    float entry;
    float entry_u;
    float exit;
    float exit_u;
};

void note_round(inout RoundHit hit, float t, float u) {
    if (t < hit.entry) {
        hit.entry = t;
        hit.entry_u = u;
    }
    if (t > hit.exit) {
        hit.exit = t;
        hit.exit_u = u;
    }
}

// Extends the span of the ray by its part inside a ball. `c`: from the centre to the ray's origin; dd: |d|^2. Computing
// with the part of c across the ray keeps its digits.
void meet_ball(inout RoundHit hit, vec3 c, float radius, vec3 d, float dd, float u) {
    const float b = dot3(c, d) / dd;
    const vec3 across = c - b * d;
    const float rest = (radius - sqrt(dot3(across, across))) * (radius + sqrt(dot3(across, across)));
    if (!(rest >= 0.0) || !(radius > 0.0)) return;
    const float half_chord = sqrt(rest / dd);
    note_round(hit, -b - half_chord, u);
    note_round(hit, -b + half_chord, u);
}

// Returns true if the ray's line is so far from the axis that it meets no hull with this radius at most: their squared
// distance is above twice the radius's square, plus a little for the rounding of this test and of the exact one, which
// would find no hit at four times the cost. If numbers underflow, overflow or are not finite, the answer is false.
bool passes_by(vec3 from, vec3 d, float dd, vec3 axis, float radius) {
    const vec3 across = cross(d, axis);
    const float apart = dot(from, across);
    const float radius2 = radius * radius;
    const float length2 = dot(axis, axis);
    const float rounding = 1.0e-10 * (dot(from, from) + length2 + radius2) * dd * length2;
    const float apart2 = apart * apart;
    return apart2 > 2.0 * radius2 * dot(across, across) + rounding && apart2 > 1.0e-30;
}

// The distances at which the ray's line enters and leaves the hull, from `nearest` on the ray. NaN is no hit.
bool round_span(const vec3 v0, const vec3 v1, const vec3 v2, const vec3 o, const vec3 d, out RoundHit hit,
                out float nearest) {
    hit = RoundHit(3.0e38, 0.0, -3.0e38, 0.0);
    nearest = 0.0;
    const float r0 = v2.x;
    const float r1 = v2.y;
    const float dd = dot3(d, d);
    const vec3 axis = v1 - v0;
    // From here on, distances along the ray are from the point nearest to the middle.
    const vec3 from = o - v0;
    if (passes_by(from, d, dd, axis, max(r0, r1))) return false;
    nearest = dot3(0.5 * axis - from, d) / dd;
    const vec3 c = from + nearest * d;
    meet_ball(hit, c, r0, d, dd, 0.0);
    const float squared = dot3(axis, axis);
    if (squared > 0.0) {
        meet_ball(hit, c - axis, r1, d, dd, 1.0);
        const float taper = r1 - r0;
        const float g = squared - taper * taper;
        if (g > 1.0e-6 * squared) {
            const float len = sqrt(squared);
            const vec3 along = axis / len;
            const float cs = dot3(c, along);
            const float ds = dot3(d, along);
            const vec3 ca = c - cs * along;
            const vec3 da = d - ds * along;
            const float root = inversesqrt(g);
            const float slope = taper * root;
            const float radius = (len * r0 + taper * cs) * root;
            const float a = dot3(da, da) - slope * slope * ds * ds;
            const float b = dot3(ca, da) - slope * ds * radius;
            const float size = sqrt(dot3(ca, ca));
            const float k = (size - radius) * (size + radius);
            const float rest = b * b - a * k;
            if (rest >= 0.0 && abs(a) > 1.0e-12 * dd) {
                const float h = sqrt(rest);
                for (uint i = 0u; i < 2u; ++i) {
                    const float at = (i == 0u ? -b - h : -b + h) / a;
                    const float s = cs + at * ds;
                    const float ball = (len * s + taper * r0) / g;
                    if (ball >= 0.0 && ball <= 1.0 && r0 + ball * taper >= 0.0) note_round(hit, at, ball);
                }
            }
        }
    }
    return hit.entry <= hit.exit;
}

// The distance at which the ray enters the hull, or leaves it if the ray begins inside.
bool round_hit(const vec3 v0, const vec3 v1, const vec3 v2, const vec3 o, const vec3 d, out float t, out vec2 uv) {
    t = 0.0;
    uv = vec2(0.0);
    RoundHit hit;
    float nearest;
    if (!round_span(v0, v1, v2, o, d, hit, nearest)) return false;
    const bool inside = !(nearest + hit.entry > 0.0);
    t = nearest + (inside ? hit.exit : hit.entry);
    uv.x = inside ? hit.exit_u : hit.entry_u;
    return t > 0.0;
}

bool round_exit(const vec3 v0, const vec3 v1, const vec3 v2, const vec3 o, const vec3 d, out float t, out vec2 uv) {
    t = 0.0;
    uv = vec2(0.0);
    RoundHit hit;
    float nearest;
    if (!round_span(v0, v1, v2, o, d, hit, nearest)) return false;
    t = nearest + hit.exit;
    uv.x = hit.exit_u;
    return nearest + hit.entry > 0.0;
}

float round_radius(const vec3 v0, const vec3 v1, const vec3 v2, const vec2 uv) {
    return mix(v2.x, v2.y, uv.x);
}

// The point where the ray meets the ball that touches the surface there.
vec3 round_point(const vec3 v0, const vec3 v1, const vec3 v2, const vec2 uv, const vec3 met, out vec3 normal) {
    const vec3 center = mix(v0, v1, uv.x);
    normal = normal_or(met - center, vec3(0.0, 0.0, 1.0));
    return center + round_radius(v0, v1, v2, uv) * normal;
}

float round_beside(const vec3 v0, const vec3 v1, const vec3 v2, const vec2 uv, const vec3 normal, const vec3 point) {
    const vec3 out_of_ball = point - mix(v0, v1, uv.x);
    return abs(sqrt(dot3(out_of_ball, out_of_ball)) - round_radius(v0, v1, v2, uv));
}

// The test rounds in proportion to the item's size, and to how far the origin is from its centres.
float round_rounding(const vec3 v0, const vec3 v1, const vec3 v2, const vec3 point) {
    const vec3 reach = max(abs(v0), abs(v1)) + abs(point);
    return ROUND_ROUNDOFF * (max(reach.x, max(reach.y, reach.z)) + max(v2.x, v2.y) + largest_of(v1 - v0));
}

// The axis, and a direction across it, along which nothing changes.
void round_edges(const vec3 v0, const vec3 v1, const vec3 v2, out vec3 e, out vec3 f) {
    e = v1 - v0;
    const float radius = max(v2.x, v2.y);
    if (!(dot3(e, e) > 0.0)) e = vec3(radius, 0.0, 0.0);
    const vec3 size = abs(e);
    vec3 least = vec3(0.0, 0.0, 1.0);
    if (size.x <= size.y && size.x <= size.z) {
        least = vec3(1.0, 0.0, 0.0);
    } else if (size.y <= size.z) {
        least = vec3(0.0, 1.0, 0.0);
    }
    const vec3 aside = cross3(e, least);
    f = aside * (radius * inversesqrt(max(dot3(aside, aside), 1.0e-38)));
}

// The offset from the ball's centre, in radii where these may change.
vec3 round_keep(const vec3 v0, const vec3 v1, const vec3 v2, const vec2 uv, const vec3 point) {
    vec3 kept = point - mix(v0, v1, uv.x);
    if (HAS_DEFORMATION) kept /= max(round_radius(v0, v1, v2, uv), 1.0e-30);
    return kept;
}

vec3 round_place(const vec3 v0, const vec3 v1, const vec3 v2, const vec2 uv, const vec3 kept) {
    const vec3 out_of_ball = HAS_DEFORMATION ? kept * round_radius(v0, v1, v2, uv) : kept;
    return mix(v0, v1, uv.x) + out_of_ball;
}

#endif
