// SPDX-License-Identifier: Apache-2.0
// The items of a leaf against the ray of a walk (traverse.glsl, which includes this): finds the candidates, and decides
// what to do with one whose cutout has to be looked up.
#ifndef OOCPT_ITEMS_GLSL
#define OOCPT_ITEMS_GLSL

// Finds the points of a leaf that the ray may meet, a bit for each: the others need no exact test. Twice the padding is
// more than the rounding of either test. Nothing depends on anything here, so all loads are under way at once.
uint points_near(uint begin, uint end) {
    const uint all = (2u << (end - begin - 1u)) - 1u;
    const float dd = dot(walk.d, walk.d);
    if (!(dd > 1.0e-30 && dd < 1.0e30)) return all;
    const float inverse = 1.0 / dd;
    uint near = 0u;
    for (uint i = 0u; i < POINT_BUNDLE; ++i) {
        const uint point = min(begin + i, end - 1u);
        const vec3 from = walk.o - posed_corner(walk.pose, point).xyz;
        const vec3 across = from - dot(from, walk.d) * inverse * walk.d;
        const float radius = posed_radius(walk.pose, point) + 2.0 * walk.pad;
        near |= uint(!(dot(across, across) > radius * radius)) << i;
    }
    return near & all;
}

// Tests the items of a leaf; true stops the walk: at its end, or with ASKS_CUTOUTS at a candidate (candidate.end != 0).
bool visit_triangles(uint begin, uint end) {
    const Shear shear = make_shear(walk.d);
    const bool are_points = HAS_POINTS && walk.pose.radii != 0ul;
    const uint near = are_points ? points_near(begin, end) : 0u;
    for (uint triangle = begin; triangle < end; ++triangle) {
        if (are_points) {
            const uint rest = near >> (triangle - begin);
            if (rest == 0u) break;
            triangle += uint(findLSB(rest));
        }
        vec3 v0, v1, v2;
        posed_item(walk.pose, triangle, v0, v1, v2);
        float t;
        vec2 uv;
        if (HAS_LEAF_KINDS && walk.other) {
            if (!leaf_hit(walk_kind, v0, v1, v2, walk.o, walk.d, t, uv)) continue;
        } else if (!hit_triangle(v0, v1, v2, walk.o, walk.d, shear, t, uv) || !(t > 0.0)) {
            continue;
        }
#if ANY_HIT
        if (!(t < walk.limit)) continue;
#else
        t = max(t, walk.entry * ENTRY_SCALE);
        if (!is_closest(t, triangle)) continue;
#endif
        if (HAS_OPACITY && !is_opaque(triangle, uv, false)) {
            bool is_second = false;
            if (HAS_LEAF_KINDS && walk.other) {
                const float first = t;
                is_second = meets_second(triangle, first, t, uv) && is_opaque(triangle, uv, true);
            }
            if (!is_second) continue;
        }
        if (ASKS_CUTOUTS) {
            candidate = Candidate(t, uv, triangle, end);
            return true;
        }
        if (DEFERS_CUTOUTS) {
            const uint presence = masked_presence(triangle, v0, v1, v2, uv, t);
            if (presence == PRESENCE_UNKNOWN) keep_candidate(triangle, uv, t);
            if (presence != PRESENCE_ALWAYS) continue;
        }
        accept(triangle, uv, t);
#if ANY_HIT
        return true;
#endif
    }
    return false;
}

// Looks the candidate's cutout up, which is much code: many threads of a subgroup do it together (rays.glsl). Continues
// with the rest of the leaf, or with the next reference.
uint answer_candidate() {
    const uint next = candidate.triangle + 1u;
    const uint rest = candidate.end - next;
    candidate.end = 0u;
    // A helper may have found a closer hit since.
    const bool counts = ANY_HIT == 1 || !SHARES || is_closest(candidate.t, candidate.triangle);
    bool is_there = counts && is_cut_in(candidate.triangle, candidate.uv, candidate.t, false);
    if (HAS_LEAF_KINDS && counts && !is_there && walk.other) {
        const float first = candidate.t;
        is_there = meets_second(candidate.triangle, first, candidate.t, candidate.uv)
                && is_cut_in(candidate.triangle, candidate.uv, candidate.t, true);
    }
    if (is_there) {
        accept(candidate.triangle, candidate.uv, candidate.t);
#if ANY_HIT
        return DONE;
#endif
    }
    return rest > 0u ? LEAF | (rest - 1u) << 28 | next : pop();
}

#endif
