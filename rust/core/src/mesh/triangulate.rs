// SPDX-License-Identifier: Apache-2.0
//! Faces to triangles: n - 2 triangles per simple n-gon, same orientation as the face. Pure and deterministic.
//!
//! Convex faces become fans; others are projected on the plane of Newell's normal and clipped ear by ear, best ear
//! first, so that corners on a straight edge stay in use (no cracks at T-vertices). Very large faces go to `earcut`.

use earcut::Earcut;
use glam::{DVec2, DVec3};

/// Largest face we accept.
pub(crate) const MAX_FACE_CORNERS: usize = 1 << 20;
/// Above this many corners the quadratic ear clipping gives way to `earcut`.
const MAX_CLIPPED_CORNERS: usize = 256;

/// Triangles as corner numbers inside the face.
pub(crate) type EarTriangles = Vec<[u32; 3]>;

/// Scratch memory kept between faces.
#[derive(Default)]
pub(crate) struct FaceTriangulator {
    earcut: Earcut<f64>,
    flat: Vec<DVec2>,
    flat_indices: Vec<u32>,
    ring: Vec<EarCorner>,
}

/// A corner not clipped yet.
#[derive(Clone, Copy)]
struct EarCorner {
    index: u32,
    /// Quality of the ear at this corner, above 0 if it may be clipped.
    quality: f64,
}

impl FaceTriangulator {
    /// Triangulates a face of 3 or more corners at `points` into `out` (cleared first).
    pub(crate) fn triangulate(&mut self, points: &[DVec3], normal: DVec3, out: &mut EarTriangles) {
        out.clear();
        match points {
            [_, _, _] => out.push([0, 1, 2]),
            &[a, b, c, d] => out.extend(split_quad([a, b, c, d])),
            _ => self.polygon(points, normal, out),
        }
    }

    fn polygon(&mut self, points: &[DVec3], normal: DVec3, out: &mut EarTriangles) {
        let Some(normal) = normal.try_normalize() else {
            // No plane: a face without area, or one that cancels itself out.
            return fan(points.len(), out);
        };
        let (x, y) = normal.any_orthonormal_pair();
        self.flat.clear();
        let anchor = points[0];
        self.flat.extend(points.iter().map(|&p| DVec2::new((p - anchor).dot(x), (p - anchor).dot(y))));
        if is_convex(&self.flat) {
            fan(points.len(), out);
        } else if points.len() <= MAX_CLIPPED_CORNERS {
            self.clip_ears(out);
        } else {
            self.cut_large(out);
        }
    }

    /// Quadratic ear clipping; takes the roundest ear each time.
    fn clip_ears(&mut self, out: &mut EarTriangles) {
        let flat = &self.flat;
        let ring = &mut self.ring;
        ring.clear();
        ring.extend((0..).zip(flat).map(|(index, _)| EarCorner { index, quality: 0.0 }));
        rate_all(flat, ring);
        while ring.len() > 3 {
            let mut best = best_ear(ring);
            if ring[best].quality <= 0.0 {
                // Clipping may have freed ears that are not neighbours of a clipped corner.
                rate_all(flat, ring);
                best = best_ear(ring);
            }
            let n = ring.len();
            out.push([ring[(best + n - 1) % n].index, ring[best].index, ring[(best + 1) % n].index]);
            ring.remove(best);
            let n = ring.len();
            for at in [(best + n - 1) % n, best % n] {
                ring[at].quality = ear_quality(flat, ring, at);
            }
        }
        if let &[a, b, c] = &ring[..] {
            out.push([a.index, b.index, c.index]);
        }
    }

    fn cut_large(&mut self, out: &mut EarTriangles) {
        let flat = &self.flat;
        self.earcut.earcut::<u32>(flat.iter().map(|p| p.to_array()), &[], &mut self.flat_indices);
        for ear in self.flat_indices.as_chunks::<3>().0 {
            let [a, b, c] = ear.map(|i| flat[i as usize]);
            // The projection has positive area; earcut's own orientation is not promised.
            out.push(if (b - a).perp_dot(c - a) < 0.0 { [ear[0], ear[2], ear[1]] } else { *ear });
        }
    }
}

fn rate_all(flat: &[DVec2], ring: &mut [EarCorner]) {
    for at in 0..ring.len() {
        ring[at].quality = ear_quality(flat, ring, at);
    }
}

fn best_ear(ring: &[EarCorner]) -> usize {
    (0..ring.len()).max_by(|&a, &b| ring[a].quality.total_cmp(&ring[b].quality)).unwrap_or(0)
}

fn fan(corners: usize, out: &mut EarTriangles) {
    let last = u32::try_from(corners).unwrap_or(u32::MAX).saturating_sub(1);
    out.extend((1..last).map(|i| [0, i, i + 1]));
}

/// Splits on the diagonal whose triangles face the same way; among two such, on the one with the rounder triangles.
fn split_quad(p: [DVec3; 4]) -> [[u32; 3]; 2] {
    let quality = |split: &[[u32; 3]; 2]| {
        let [n, m] = split.map(|t| {
            let [a, b, c] = t.map(|i| p[i as usize]);
            let cross = (b - a).cross(c - a);
            let longest =
                [b - a, c - b, a - c].map(|e| e.length_squared()).into_iter().fold(f64::MIN_POSITIVE, f64::max);
            cross / longest
        });
        let folded = n.dot(m) <= 0.0;
        let rounder = n.length().min(m.length());
        if folded { rounder - 4.0 } else { rounder }
    };
    let splits = [[[0, 1, 2], [0, 2, 3]], [[0, 1, 3], [1, 2, 3]]];
    let [first, second] = [quality(&splits[0]), quality(&splits[1])];
    if second > first { splits[1] } else { splits[0] }
}

/// True when every corner turns left, strictly, and the outline goes round once.
fn is_convex(flat: &[DVec2]) -> bool {
    let n = flat.len();
    let mut turns_of_x = 0;
    for i in 0..n {
        let (a, b, c) = (flat[i], flat[(i + 1) % n], flat[(i + 2) % n]);
        let (e, f) = (b - a, c - b);
        if e.perp_dot(f) <= 1e-9 * e.length() * f.length() {
            return false;
        }
        // An outline that goes round once turns its x direction twice.
        turns_of_x += i32::from((e.x > 0.0) != (f.x > 0.0));
    }
    turns_of_x == 2
}

/// How round the triangle at corner `at` of the ring is, in (0, 1]; at most 0 when it is no ear. Blocked convex corners
/// rank above reflex ones, so that something sensible is clipped from outlines that cross themselves.
fn ear_quality(flat: &[DVec2], ring: &[EarCorner], at: usize) -> f64 {
    let n = ring.len();
    let corner = |k: usize| flat[ring[k % n].index as usize];
    let (a, b, c) = (corner(at + n - 1), corner(at), corner(at + 1));
    let longest = (b - a).length_squared().max((c - b).length_squared()).max((a - c).length_squared());
    let area = (b - a).perp_dot(c - b);
    let quality = area / longest.max(f64::MIN_POSITIVE);
    if quality <= 1e-12 {
        return quality.min(0.0) - 2.0;
    }
    let inside = |p: DVec2| {
        // Corners at the same place as a, b or c do not block.
        p != a && p != b && p != c && sides(a, b, c, p).into_iter().all(|s| s >= 0.0)
    };
    let blocked = (at + 2..at + n - 1).any(|k| inside(corner(k)));
    if blocked { quality - 1.0 - 1e-9 } else { quality }
}

fn sides(a: DVec2, b: DVec2, c: DVec2, p: DVec2) -> [f64; 3] {
    [(b - a).perp_dot(p - a), (c - b).perp_dot(p - b), (a - c).perp_dot(p - c)]
}
