// SPDX-License-Identifier: Apache-2.0
//! Meshes of quads, and the makers of things with an exact number of them. Units are metres, y is up, the foot of a
//! thing is at the origin. Pure; any thread.

use glam::DVec3;
use std::f64::consts::TAU;

use super::random::Random;

/// A mesh of quads.
#[derive(Clone, Debug, Default)]
pub(crate) struct Soup {
    /// Positions.
    pub(crate) points: Vec<[f32; 3]>,
    /// Four points per quad.
    pub(crate) quads: Vec<[i32; 4]>,
    /// Linear colour: one for all quads, or one per quad, or one per point.
    pub(crate) colors: Vec<[f32; 3]>,
    /// One per point, or none: flat.
    pub(crate) normals: Vec<[f32; 3]>,
}

impl Soup {
    /// A soup of one colour.
    pub(crate) fn of_color(color: DVec3) -> Self {
        Self { colors: vec![color.as_vec3().to_array()], ..Self::default() }
    }

    /// The number of the next point.
    fn next(&self) -> i32 {
        // Far below 2^31: meshes are cut below that by the callers' quad counts.
        i32::try_from(self.points.len()).unwrap_or(i32::MAX)
    }

    fn point(&mut self, p: DVec3) {
        self.points.push(p.as_vec3().to_array());
    }

    /// A kite about `center`: `along` and `across` are half its diagonals, `droop` lowers its sides.
    pub(crate) fn card(&mut self, center: DVec3, along: DVec3, across: DVec3, droop: DVec3) {
        let first = self.next();
        for corner in [center - along, center + across - droop, center + along, center - across - droop] {
            self.point(corner);
        }
        self.quads.push([first, first + 1, first + 2, first + 3]);
    }

    /// A tube of `sides * segments` quads along `path` (0 to 1), open at both ends.
    pub(crate) fn tube(&mut self, sides: u32, segments: u32, path: impl Fn(f64) -> DVec3, radius: impl Fn(f64) -> f64) {
        let first = self.next();
        for ring in 0..=segments {
            let t = f64::from(ring) / f64::from(segments);
            let ahead = (path((t + 0.01).min(1.0)) - path((t - 0.01).max(0.0))).normalize_or(DVec3::Y);
            let across = ahead.cross(DVec3::new(0.37, 0.11, 0.92)).normalize_or(DVec3::X);
            let third = ahead.cross(across);
            for side in 0..sides {
                let (sin, cos) = (TAU * f64::from(side) / f64::from(sides)).sin_cos();
                self.point(path(t) + (across * cos + third * sin) * radius(t));
            }
        }
        let at = |ring: u32, side: u32| first + i32::try_from(ring * sides + side % sides).unwrap_or(0);
        for ring in 0..segments {
            for side in 0..sides {
                self.quads.push([at(ring, side), at(ring, side + 1), at(ring + 1, side + 1), at(ring + 1, side)]);
            }
        }
    }

    /// A closed lump: a cube of `6 n^2` quads blown up to `size`, with bumps of relative height `rough`.
    pub(crate) fn blob(&mut self, n: u32, center: DVec3, size: DVec3, rough: f64, random: &mut Random) {
        let waves: Vec<(DVec3, f64)> =
            (0..6).map(|k| (random.direction() * f64::from(2 + k), random.angle())).collect();
        let surface = |direction: DVec3| {
            let bump: f64 = waves.iter().map(|(w, phase)| (w.dot(direction) + phase).sin() / w.length()).sum();
            center + direction * size * (1.0 + rough * bump)
        };
        // Columns are the face's two axes and its normal.
        let faces = [
            [DVec3::X, DVec3::Y, DVec3::Z],
            [DVec3::Y, DVec3::Z, DVec3::X],
            [DVec3::Z, DVec3::X, DVec3::Y],
            [DVec3::Y, DVec3::X, DVec3::NEG_Z],
            [DVec3::Z, DVec3::Y, DVec3::NEG_X],
            [DVec3::X, DVec3::Z, DVec3::NEG_Y],
        ];
        for [a, b, normal] in faces {
            let first = self.next();
            // Tangents spread the points evenly over the sphere.
            let place = |k: u32| ((f64::from(k) / f64::from(n) - 0.5) * std::f64::consts::FRAC_PI_2).tan();
            for row in 0..=n {
                for column in 0..=n {
                    self.point(surface((normal + a * place(column) + b * place(row)).normalize()));
                }
            }
            for row in 0..n {
                for column in 0..n {
                    let corner = first + i32::try_from(row * (n + 1) + column).unwrap_or(0);
                    let next = corner + i32::try_from(n + 1).unwrap_or(0);
                    self.quads.push([corner, corner + 1, next + 1, next]);
                }
            }
        }
    }
}

/// A lump of at most `quads` quads, at least 24.
pub(crate) fn lump(quads: u64, center: DVec3, size: DVec3, rough: f64, color: DVec3, random: &mut Random) -> Soup {
    let mut soup = Soup::of_color(color);
    soup.blob(side_of(quads.max(24), 6), center, size, rough, random);
    soup
}

/// The largest n with `per * n^2` not above `quads`; at least 1.
pub(crate) fn side_of(quads: u64, per: u64) -> u32 {
    u32::try_from((quads / per).isqrt().max(1)).unwrap_or(u32::MAX)
}

fn whole(quads: u64) -> u32 {
    u32::try_from(quads).unwrap_or(u32::MAX)
}

/// A trunk or stick: a bent tube.
pub(crate) fn trunk(quads: u64, height: f64, radius: f64, bend: f64, color: DVec3) -> Soup {
    let mut soup = Soup::of_color(color);
    let sides = if quads >= 64 { 8 } else { 5 };
    let segments = whole(quads / u64::from(sides)).max(2);
    let thick = |t: f64| radius * (1.0 - 0.55 * t + 0.9 * (-18.0 * t).exp());
    soup.tube(sides, segments, |t| trunk_at(t, height, bend), thick);
    soup
}

/// The middle of a trunk at `t` of its length.
pub(crate) fn trunk_at(t: f64, height: f64, bend: f64) -> DVec3 {
    DVec3::new(bend * t * t, t, 0.3 * bend * (1.0 - (3.0 * t).cos())) * height
}

/// A feather leaf along +x that first rises, then droops: leaflets on both sides of a spine. `length` metres.
pub(crate) fn frond(quads: u64, length: f64, droop: f64, color: DVec3, random: &mut Random) -> Soup {
    let mut soup = Soup::of_color(color);
    let leaflets = whole(quads).max(6);
    let spine = |t: f64| DVec3::new(length * t * (1.0 - 0.18 * droop * t), length * t * (0.45 - droop * t), 0.0);
    for leaflet in 0..leaflets {
        let t = 0.12 + 0.88 * (f64::from(leaflet) + random.unit()) / f64::from(leaflets);
        let side = if leaflet % 2 == 0 { 1.0 } else { -1.0 };
        let long = 0.17 * length * (1.2 - t).sqrt() * random.range(0.85, 1.1);
        let ahead = (spine(t + 0.01) - spine(t)).normalize();
        let out = (DVec3::Z * side + ahead * 0.55 - DVec3::Y * 0.25).normalize();
        let width = (1.9 * length / f64::from(leaflets)).clamp(0.006 * length, 0.03 * length);
        soup.card(spine(t) + out * long, out * long, ahead * width, DVec3::Y * width * 0.5);
    }
    soup
}

/// Grass: blades of two quads each.
pub(crate) fn tuft(quads: u64, height: f64, color: DVec3, random: &mut Random) -> Soup {
    let mut soup = Soup::of_color(color);
    let blades = whole(quads / 2).max(3);
    let width = (0.9 * height / f64::from(blades)).clamp(0.006 * height, 0.05 * height);
    for _ in 0..blades {
        let (angle, lean, tall) = (random.angle(), random.range(0.1, 0.8), height * random.range(0.5, 1.0));
        let out = DVec3::new(angle.cos(), 0.0, angle.sin());
        let across = DVec3::new(-angle.sin(), 0.0, angle.cos()) * width;
        let root = out * 0.12 * height * random.unit() - DVec3::Y * 0.03 * height;
        let middle = root + DVec3::Y * 0.6 * tall + out * 0.3 * lean * tall;
        let tip = root + DVec3::Y * tall * (1.0 - 0.2 * lean) + out * lean * tall;
        let first = soup.next();
        for (point, wide) in [(root, 1.0), (middle, 0.8), (tip, 0.08)] {
            soup.point(point - across * wide);
            soup.point(point + across * wide);
        }
        soup.quads.extend([0, 2].map(|k| [first + k, first + k + 1, first + k + 3, first + k + 2]));
    }
    soup
}

/// Leaves in a ball of `radius` metres about `center`, each a quad; as many as it takes to look full.
pub(crate) fn leaves(soup: &mut Soup, quads: u64, center: DVec3, radius: DVec3, fill: f64, random: &mut Random) {
    #[expect(clippy::cast_precision_loss, reason = "a size, not a count")]
    let size = fill * (radius.element_product().cbrt()) * (2.6 / (quads.max(1) as f64).sqrt()).min(0.7);
    for _ in 0..quads {
        let out = random.direction();
        let place = center + out * radius * random.range(0.35, 1.0).sqrt();
        let normal = (out + random.direction() * 0.7 + DVec3::Y * 0.4).normalize_or(DVec3::Y);
        let along = normal.cross(random.direction()).normalize_or(DVec3::X);
        let long = size * random.range(0.7, 1.3);
        soup.card(place, along * long, normal.cross(along) * long * 0.55, normal * long * 0.25);
    }
}

/// Petals about +y.
pub(crate) fn flower(quads: u64, radius: f64, color: DVec3, random: &mut Random) -> Soup {
    let mut soup = Soup::of_color(color);
    let petals = whole(quads).max(5);
    for petal in 0..petals {
        let angle = TAU * f64::from(petal % 5) / 5.0 + 0.25 * random.normal();
        let out = DVec3::new(angle.cos(), random.range(0.2, 0.6), angle.sin()).normalize();
        let across = DVec3::new(-angle.sin(), 0.0, angle.cos()) * 0.3 * radius;
        soup.card(out * 0.5 * radius, out * 0.5 * radius, across, DVec3::Y * 0.1 * radius);
    }
    soup
}

/// A tree of exactly `quads` quads (at least 60), `height` metres high: trunk, boughs and a crown of leaf clouds.
pub(crate) fn tree(quads: u64, height: f64, random: &mut Random) -> Soup {
    let mut soup = Soup::default();
    let bark = DVec3::new(0.16, 0.11, 0.08);
    let lean = random.range(-0.12, 0.12);
    let stem = |t: f64| DVec3::new(lean * height * t * t, height * (0.72 * t - 0.04), 0.5 * lean * height * t);
    let boughs = if quads < 600 { 3 } else { 14 };
    soup.tube(6, 3, stem, |t| 0.035 * height * (1.0 - 0.7 * t));
    let mut ends = Vec::new();
    for bough in 0..boughs {
        let from = stem(random.range(0.45, 0.95));
        let angle = 2.4 * f64::from(bough) + 0.4 * random.normal();
        let reach = height * random.range(0.16, 0.34);
        let end = from + DVec3::new(angle.cos() * reach, height * random.range(0.08, 0.22), angle.sin() * reach);
        if quads >= 600 {
            soup.tube(
                4,
                3,
                |t| from.lerp(end, t) + DVec3::Y * 0.05 * height * (t - t * t),
                |t| 0.012 * height * (1.0 - 0.8 * t),
            );
        }
        ends.push(end);
    }
    soup.colors = vec![bark.as_vec3().to_array(); soup.quads.len()];
    let left = quads.saturating_sub(soup.quads.len() as u64);
    let clouds = ends.len() as u64;
    for (k, end) in (0..).zip(&ends) {
        // Shares that differ by one add up exactly.
        let share = left * (k + 1) / clouds - left * k / clouds;
        let size = height * random.range(0.11, 0.18);
        let tint = DVec3::new(0.075, 0.135, 0.03) * (0.25 * random.normal()).exp();
        let before = soup.quads.len();
        leaves(&mut soup, share, *end, DVec3::new(size, 0.72 * size, size), 1.0, random);
        soup.colors.extend((before..soup.quads.len()).map(|_| tint.as_vec3().to_array()));
    }
    soup
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tree_has_the_quads_it_was_asked_for() {
        for quads in [60, 61, 599, 600, 12_345] {
            let tree = tree(quads, 20.0, &mut Random::new(&[quads]));
            assert_eq!(tree.quads.len() as u64, quads, "tree of {quads}");
            assert_eq!(tree.colors.len(), tree.quads.len(), "a colour per quad");
        }
    }

    #[test]
    fn a_blob_is_closed_and_faces_outward() {
        let mut soup = Soup::default();
        soup.blob(3, DVec3::ZERO, DVec3::ONE, 0.0, &mut Random::new(&[1]));
        assert_eq!(soup.quads.len(), 54, "six faces of nine");
        for quad in &soup.quads {
            let [a, b, _, d] = quad.map(|i| glam::Vec3::from(soup.points[usize::try_from(i).unwrap()]));
            assert!((b - a).cross(d - a).dot(a) > 0.0, "counter-clockwise from outside: {quad:?}");
        }
    }
}
