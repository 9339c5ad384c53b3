// SPDX-License-Identifier: Apache-2.0
//! The leaf test of points, balls: geometry/point.glsl, operation by operation. Pure, any thread.

use super::round::RoundHit;
pub(super) use super::round::edges;
use crate::vector::{V3, dot3};

/// Where the ray enters the ball, or leaves it if it begins inside.
pub(super) fn hit(vertices: [V3; 3], o: V3, d: V3) -> Option<(f32, [f32; 2])> {
    let (hit, nearest) = span(vertices, o, d);
    hit.nearest(nearest).map(|(t, _)| (t, [0.0; 2]))
}

/// `point_exit`.
pub(super) fn exit(vertices: [V3; 3], o: V3, d: V3) -> Option<(f32, [f32; 2])> {
    let (hit, nearest) = span(vertices, o, d);
    hit.second(nearest).map(|(t, _)| (t, [0.0; 2]))
}

#[inline(always)]
fn span([center, _, V3([radius, ..])]: [V3; 3], o: V3, d: V3) -> (RoundHit, f32) {
    let dd = dot3(d, d);
    let from = o - center;
    let nearest = dot3(-1.0 * from, d) / dd;
    let mut hit = RoundHit::NONE;
    hit.meet_ball(from + nearest * d, radius, d, dd, 0.0);
    (hit, nearest)
}
