// SPDX-License-Identifier: Apache-2.0
//! The leaf test of curves, hulls of two balls: geometry/round.glsl, operation by operation. Pure, any
//! thread.

use crate::vector::{V3, cross3, dot3};

/// Where the line of a ray enters and leaves, and which ball touches there.
pub(super) struct RoundHit {
    entry: f32,
    entry_u: f32,
    exit: f32,
    exit_u: f32,
}

impl RoundHit {
    pub(super) const NONE: Self = Self { entry: 3.0e38, entry_u: 0.0, exit: -3.0e38, exit_u: 0.0 };

    fn note(&mut self, t: f32, u: f32) {
        if t < self.entry {
            (self.entry, self.entry_u) = (t, u);
        }
        if t > self.exit {
            (self.exit, self.exit_u) = (t, u);
        }
    }

    pub(super) fn meet_ball(&mut self, c: V3, radius: f32, d: V3, dd: f32, u: f32) {
        let b = dot3(c, d) / dd;
        let across = c - b * d;
        // Without roots; what is left out has a negative `rest`.
        if dot3(across, across) > 1.0001 * radius * radius {
            return;
        }
        let rest = (radius - dot3(across, across).sqrt()) * (radius + dot3(across, across).sqrt());
        if rest >= 0.0 && radius > 0.0 {
            let half_chord = (rest / dd).sqrt();
            self.note(-b - half_chord, u);
            self.note(-b + half_chord, u);
        }
    }

    /// The distance and the ball, given how far on the ray the place is from which distances count.
    pub(super) fn nearest(&self, nearest: f32) -> Option<(f32, f32)> {
        if self.entry <= self.exit {
            let enters = nearest + self.entry > 0.0;
            let (t, u) = if enters { (self.entry, self.entry_u) } else { (self.exit, self.exit_u) };
            let t = nearest + t;
            (t > 0.0).then_some((t, u))
        } else {
            None
        }
    }

    /// The same for where the line leaves what it enters in front of the origin.
    pub(super) fn second(&self, nearest: f32) -> Option<(f32, f32)> {
        (self.entry <= self.exit && nearest + self.entry > 0.0).then_some((nearest + self.exit, self.exit_u))
    }
}

/// `passes_by`: whether the line is so far from the axis that the test would find no hit.
fn passes_by(from: V3, d: V3, dd: f32, axis: V3, radius: f32) -> bool {
    let across = cross3(d, axis);
    let apart = dot3(from, across);
    let (radius2, length2) = (radius * radius, dot3(axis, axis));
    let rounding = 1.0e-10 * (dot3(from, from) + length2 + radius2) * dd * length2;
    let apart2 = apart * apart;
    apart2 > 2.0 * radius2 * dot3(across, across) + rounding && apart2 > 1.0e-30
}

/// Where the ray enters the hull, or leaves it if it begins inside, and the ball that touches there.
pub(super) fn hit(vertices: [V3; 3], o: V3, d: V3) -> Option<(f32, [f32; 2])> {
    let (hit, nearest) = span(vertices, o, d)?;
    hit.nearest(nearest).map(|(t, u)| (t, [u, 0.0]))
}

/// `round_exit`.
pub(super) fn exit(vertices: [V3; 3], o: V3, d: V3) -> Option<(f32, [f32; 2])> {
    let (hit, nearest) = span(vertices, o, d)?;
    hit.second(nearest).map(|(t, u)| (t, [u, 0.0]))
}

/// `round_span`.
#[inline(always)]
fn span([p0, p1, V3([r0, r1, _])]: [V3; 3], o: V3, d: V3) -> Option<(RoundHit, f32)> {
    let dd = dot3(d, d);
    let axis = p1 - p0;
    let from = o - p0;
    if passes_by(from, d, dd, axis, r0.max(r1)) {
        return None;
    }
    let nearest = dot3(0.5 * axis - from, d) / dd;
    let c = from + nearest * d;
    let mut hit = RoundHit::NONE;
    hit.meet_ball(c, r0, d, dd, 0.0);
    let squared = dot3(axis, axis);
    if squared > 0.0 {
        hit.meet_ball(c - axis, r1, d, dd, 1.0);
        meet_cone(&mut hit, (c, axis), squared, [r0, r1], d, dd);
    }
    Some((hit, nearest))
}

/// `round_edges`.
pub(super) fn edges([p0, p1, V3([r0, r1, _])]: [V3; 3]) -> [V3; 2] {
    let mut e = p1 - p0;
    let radius = r0.max(r1);
    if dot3(e, e) <= 0.0 || dot3(e, e).is_nan() {
        e = V3([radius, 0.0, 0.0]);
    }
    let size = e.map(f32::abs);
    let least = if size[0] <= size[1] && size[0] <= size[2] {
        V3([1.0, 0.0, 0.0])
    } else if size[1] <= size[2] {
        V3([0.0, 1.0, 0.0])
    } else {
        V3([0.0, 0.0, 1.0])
    };
    let aside = cross3(e, least);
    [e, (radius * (1.0 / dot3(aside, aside).max(1.0e-38).sqrt())) * aside]
}

fn meet_cone(hit: &mut RoundHit, (c, axis): (V3, V3), squared: f32, [r0, r1]: [f32; 2], d: V3, dd: f32) {
    let taper = r1 - r0;
    let g = squared - taper * taper;
    if g > 1.0e-6 * squared {
        let len = squared.sqrt();
        let along = axis.map(|x| x / len);
        let (cs, ds) = (dot3(c, along), dot3(d, along));
        let ca = c - cs * along;
        let da = d - ds * along;
        let root = 1.0 / g.sqrt();
        let slope = taper * root;
        let radius = (len * r0 + taper * cs) * root;
        let a = dot3(da, da) - slope * slope * ds * ds;
        let b = dot3(ca, da) - slope * ds * radius;
        let size = dot3(ca, ca).sqrt();
        let k = (size - radius) * (size + radius);
        let rest = b * b - a * k;
        if rest >= 0.0 && a.abs() > 1.0e-12 * dd {
            let h = rest.sqrt();
            for at in [(-b - h) / a, (-b + h) / a] {
                let s = cs + at * ds;
                let ball = (len * s + taper * r0) / g;
                if (0.0..=1.0).contains(&ball) && r0 + ball * taper >= 0.0 {
                    hit.note(at, ball);
                }
            }
        }
    }
}
