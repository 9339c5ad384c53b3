// SPDX-License-Identifier: Apache-2.0
//! The loss of single scattering by rough glass, for `shaders/material/bsdf/glass.glsl`, which explains its use.
//!
//! Guarantees: [`bytes`] is 1.4 MB that are part of the program, made by `examples/bsdf_tables.rs` from the code here:
//! no time is spent on it. Lookups are right to 1e-3 for any roughness, cosine and index of refraction (a test asserts
//! it), and the averages are those of the lookups, to rounding. Pure; any thread. Only scenes with rough glass use it.
//!
//! A node is a roughness and an index; each has two rows of losses over the cosine, one per side, with columns of its
//! own, since the curve bends at places that depend on alpha and on the angle of total reflection. A lookup evaluates
//! the four nodes about it, each at the cosine, and mixes: so an average of lookups is the mixture of the nodes'
//! averages.
//!
//! Sources: Walter et al. 2007 (refraction by microfacets), Heitz 2014 (masking), Dupuy and Benyoub 2023 (visible
//! normals), Kulla and Conty 2017 (the use of the averages).

use super::{part, roughness_of};
use std::f64::consts::PI;

/// Roughnesses from [`super::SHARPEST`] to 1, equally far apart in their power 0.4.
pub const ROUGHNESSES: usize = 64;
/// Indices of refraction, placed by the spread of a node (`IorSpread::ior`).
pub const IORS: usize = 64;
/// Cosines on the side of the lower index, and on the other, placed by `CosineColumns`.
pub const COSINES: [usize; 2] = [64, 96];
/// Floats of a node: 1 / alpha, cosine of total reflection, then for each side factor and offset of the columns,
/// averages.
pub const NODE_FLOATS: usize = 8;
/// Bytes in all: nodes, then the losses as 16 bits of 0..=1, both sides of a node one after the other.
pub const BYTES: usize = IORS * ROUGHNESSES * (4 * NODE_FLOATS + 2 * (COSINES[0] + COSINES[1]));

/// Largest index, in place of infinity.
const MAX_IOR: f64 = 1e6;

static TABLE: &[u8] = include_bytes!("glass.bin");
const _: () = assert!(TABLE.len() == BYTES, "run the example `bsdf_tables`");

/// The table as the shaders read it, little-endian.
#[must_use]
pub fn bytes() -> &'static [u8] {
    TABLE
}

/// Numbers that are computed in parallel.
const LANES: usize = 8;

/// Places on the spherical cap of visible normals: a lattice that is denser at the rim, where the few normals are that
/// look aside.
#[derive(Debug)]
pub struct VisibleNormals {
    /// Cosine and sine of the turn, height below the top of the cap over its whole height, measure.
    points: Vec<[[f64; LANES]; 4]>,
    whole: f64,
}

impl VisibleNormals {
    /// At least `count` places.
    #[must_use]
    #[expect(clippy::cast_precision_loss, reason = "few points")]
    pub fn new(count: usize) -> Self {
        let groups = count.div_ceil(LANES);
        let of = |group: usize, lane: usize| {
            let i = (group * LANES + lane) as f64;
            let (sine, cosine) = (PI * (i + 0.5) / (groups * LANES) as f64).sin_cos();
            // Steps of the golden ratio spread over 0..1 for any number of them.
            let rim = (0.5 + i * 0.618_033_988_749_894_9).fract();
            [cosine, sine, 1.0 - rim.powi(3), rim * rim]
        };
        let group = |group| std::array::from_fn(|what| std::array::from_fn(|lane| of(group, lane)[what]));
        let points: Vec<[[f64; LANES]; 4]> = (0..groups).map(group).collect();
        let whole = points.iter().flat_map(|point| point[3]).sum();
        Self { points, whole }
    }

    /// The loss at one cosine: `1 - F G2 / G1 - (1 - F) G1` over these normals. A sum of losses, as it is small where
    /// it is a difference. `eta` = index beyond / index on the viewer's side.
    #[must_use]
    pub fn loss(&self, cosine: f64, alpha: f64, eta: f64) -> f64 {
        let cosine = cosine.max(1e-7);
        let (alpha2, inverse) = (alpha * alpha, 1.0 / eta);
        let slope = |c: f64| (c * c + alpha2 * (1.0 - c * c)).sqrt();
        let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
        let length = slope(cosine);
        let (x, z) = (alpha * sine / length, cosine / length);
        let lost = |cos: f64, sin: f64, height: f64| {
            let cap = height * (1.0 + z) - z;
            let ring = (1.0 - cap * cap).max(0.0).sqrt();
            let h = [alpha * (ring * cos + x), alpha * ring * sin, cap + z];
            let norm = (h[0] * h[0] + h[1] * h[1] + h[2] * h[2]).sqrt();
            let half = ((sine * h[0] + cosine * h[2]) / norm).clamp(1e-9, 1.0);
            let up = h[2] / norm;
            let back = (2.0 * half * up - cosine).max(0.0);
            let reflected = back * (cosine + length) / (cosine * slope(back) + back * length);
            // Fresnel; at total reflection `there` is 0, which gives a reflectance of 1.
            let there = (1.0 - (1.0 - half * half) * inverse * inverse).max(0.0).sqrt();
            let a = (half - eta * there) / (half + eta * there);
            let b = (eta * half - there) / (eta * half + there);
            let reflectance = 0.5 * (a * a + b * b);
            let down = (cosine * inverse - (half * inverse - there) * up).max(0.0);
            let refracted = 2.0 * down / (down + slope(down));
            (reflectance * (1.0 - reflected) + (1.0 - reflectance) * (1.0 - refracted)).max(0.0)
        };
        let mut sums = [0.0; LANES];
        for [cos, sin, height, measure] in &self.points {
            for lane in 0..LANES {
                sums[lane] += measure[lane] * lost(cos[lane], sin[lane], height[lane]);
            }
        }
        sums.iter().sum::<f64>() / self.whole
    }
}

/// The spread of the root of (ior - 1) / (ior + 1) at an alpha: logarithmic above `near`, from `least` on, below which
/// glass is sharp.
struct IorSpread {
    near: f64,
    least: f64,
}

impl IorSpread {
    fn new(alpha: f64) -> Self {
        Self { near: 0.3 * alpha, least: (2.4e-5 / alpha).min(0.2).sqrt() }
    }

    fn ior(&self, place: f64) -> f64 {
        let range = ((1.0 + self.near) / (self.least + self.near)).ln();
        let root = (self.least + self.near) * (place * range).exp() - self.near;
        let ratio = root * root;
        ((1.0 + ratio) / (1.0 - ratio).max(1.0 / MAX_IOR)).min(MAX_IOR)
    }

    fn place(&self, ior: f64) -> f64 {
        let root = ((ior - 1.0) / (ior + 1.0)).sqrt();
        let log = |x: f64| ((x + self.near) / (self.least + self.near)).ln();
        (log(root) / log(1.0)).clamp(0.0, 1.0)
    }
}

/// The places of the columns of a side of a node: equally far apart in `(shape(cosine) - offset) * factor`. They are
/// dense where the cosine is about alpha, and on the denser side at the angle of total reflection.
#[derive(Clone, Copy, Debug)]
struct CosineColumns {
    alpha: f64,
    critical: Option<f64>,
    offset: f64,
    factor: f64,
}

impl CosineColumns {
    fn new(alpha: f64, ior: f64, side: usize) -> Self {
        let critical = (side == 1).then(|| (1.0 - 1.0 / (ior * ior)).max(0.0).sqrt());
        let made = Self { alpha, critical, offset: 0.0, factor: 1.0 };
        let (offset, end) = (made.shape(0.0), made.shape(1.0));
        Self { offset, factor: 1.0 / (end - offset), ..made }
    }

    fn shape(&self, cosine: f64) -> f64 {
        match self.critical {
            None => cosine + (1.0 + cosine / (0.3 * self.alpha)).ln(),
            Some(critical) => {
                let off = cosine - critical;
                2.0 * cosine
                    + 1.3 * (1.0 + cosine / (0.02 * self.alpha)).ln()
                    + off.signum() * (1.0 + off.abs() / (0.6 * self.alpha)).ln()
            }
        }
    }

    /// The place of a cosine, 0..=1.
    fn place(&self, cosine: f64) -> f64 {
        ((self.shape(cosine) - self.offset) * self.factor).clamp(0.0, 1.0)
    }

    fn cosine(&self, place: f64) -> f64 {
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if self.place(middle) < place { low = middle } else { high = middle }
        }
        0.5 * (low + high)
    }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_precision_loss, reason = "small")]
fn cell(place: f64, count: usize) -> (usize, f64) {
    let at = place * (count - 1) as f64;
    let index = (at as usize).min(count - 2);
    (index, at - index as f64)
}

/// The four nodes about a roughness and an index, each (ior, roughness), with their weights.
fn corners(alpha: f64, ior: f64) -> [((usize, usize), f64); 4] {
    let first = super::SHARPEST.powf(0.4);
    let row = ((alpha.powf(0.2) - first) / (1.0 - first)).clamp(0.0, 1.0);
    let (line, y) = cell(row, ROUGHNESSES);
    let (plane, z) = cell(IorSpread::new(alpha).place(ior), IORS);
    [
        ((plane, line), (1.0 - y) * (1.0 - z)),
        ((plane, line + 1), y * (1.0 - z)),
        ((plane + 1, line), (1.0 - y) * z),
        ((plane + 1, line + 1), y * z),
    ]
}

/// Computes the table; only the example and tests do.
pub mod make {
    use super::{
        COSINES, CosineColumns, IORS, IorSpread, ROUGHNESSES, VisibleNormals, cell, corners, part, roughness_of,
    };
    use rayon::prelude::*;

    /// Points of the quadrature.
    const POINTS: usize = 1 << 14;
    /// Largest number of 16 bits.
    const FULL: f64 = 65535.0;

    type LossRows = [Vec<f64>; 2];

    /// Losses at all nodes.
    #[derive(Debug)]
    pub struct GlassLosses {
        nodes: Vec<LossRows>,
    }

    fn node_of(index: usize) -> (f64, f64) {
        let alpha = roughness_of(part(index % ROUGHNESSES, ROUGHNESSES)).powi(2);
        (alpha, IorSpread::new(alpha).ior(part(index / ROUGHNESSES, IORS)))
    }

    fn eta(ior: f64, side: usize) -> f64 {
        if side == 1 { 1.0 / ior } else { ior }
    }

    impl GlassLosses {
        /// Computes the losses: some minutes of a core.
        #[must_use]
        pub fn compute() -> Self {
            let normals = VisibleNormals::new(POINTS);
            let row = |alpha: f64, ior: f64, side: usize| -> Vec<f64> {
                let columns = CosineColumns::new(alpha, ior, side);
                let at = |column| normals.loss(columns.cosine(part(column, COSINES[side])), alpha, eta(ior, side));
                (0..COSINES[side]).map(at).collect()
            };
            let node = |index| {
                let (alpha, ior) = node_of(index);
                [row(alpha, ior, 0), row(alpha, ior, 1)]
            };
            let mut made = Self { nodes: (0..IORS * ROUGHNESSES).into_par_iter().map(node).collect() };
            made.balance(&normals);
            for value in made.nodes.iter_mut().flatten().flatten() {
                *value = (value.clamp(0.0, 1.0) * FULL).round() / FULL;
            }
            made
        }

        /// Spreads the error of interpolation, which has one sign between nodes, over cells and nodes.
        fn balance(&mut self, normals: &VisibleNormals) {
            let cells: Vec<(usize, usize)> =
                (0..IORS - 1).flat_map(|z| (0..ROUGHNESSES - 1).map(move |y| (z, y))).collect();
            let errors = |&(z, y): &(usize, usize)| -> [Vec<(f64, f64)>; 2] {
                let middle = |index: usize, count: usize| 0.5 * (part(index, count) + part(index + 1, count));
                let alpha = roughness_of(middle(y, ROUGHNESSES)).powi(2);
                let ior = IorSpread::new(alpha).ior(middle(z, IORS));
                std::array::from_fn(|side| {
                    let columns = CosineColumns::new(alpha, ior, side);
                    let error = |column| {
                        let cosine = columns.cosine(middle(column, COSINES[side]));
                        (cosine, normals.loss(cosine, alpha, eta(ior, side)) - self.at(alpha, ior, side, cosine))
                    };
                    (0..COSINES[side] - 1).map(error).collect()
                })
            };
            let found: Vec<_> = cells.par_iter().map(errors).collect();
            let mut sums: Vec<[Vec<(f64, f64)>; 2]> =
                (0..IORS * ROUGHNESSES).map(|_| COSINES.map(|count| vec![(0.0, 0.0); count])).collect();
            for ((z, y), errors) in cells.iter().zip(&found) {
                for index in [(*z, *y), (*z, *y + 1), (*z + 1, *y), (*z + 1, *y + 1)].map(|(z, y)| z * ROUGHNESSES + y)
                {
                    let (alpha, ior) = node_of(index);
                    for (side, errors) in errors.iter().enumerate() {
                        let columns = CosineColumns::new(alpha, ior, side);
                        for (cosine, error) in errors {
                            let (at, x) = cell(columns.place(*cosine), COSINES[side]);
                            for (at, weight) in [(at, 1.0 - x), (at + 1, x)] {
                                let sum = &mut sums[index][side][at];
                                *sum = (sum.0 + weight * error, sum.1 + weight);
                            }
                        }
                    }
                }
            }
            for (node, sums) in self.nodes.iter_mut().zip(&sums) {
                for (value, (error, weight)) in node.iter_mut().flatten().zip(sums.iter().flatten()) {
                    // Half of the error is moved, and never more than a tenth of the loss: small losses stay small.
                    let change = if *weight > 0.0 { 0.5 * error / weight } else { 0.0 };
                    *value += change.clamp(-0.1 * *value, 0.1 * *value);
                }
            }
        }

        /// The loss that a lookup returns.
        #[must_use]
        pub fn at(&self, alpha: f64, ior: f64, side: usize, cosine: f64) -> f64 {
            let mut sum = 0.0;
            for ((plane, line), weight) in corners(alpha, ior) {
                let index = plane * ROUGHNESSES + line;
                let (alpha, ior) = node_of(index);
                let (column, x) = cell(CosineColumns::new(alpha, ior, side).place(cosine), COSINES[side]);
                let row = &self.nodes[index][side];
                sum += weight * (row[column] * (1.0 - x) + row[column + 1] * x);
            }
            sum
        }

        /// The average of a row over its hemisphere, cosine weighted.
        fn average(&self, index: usize, side: usize) -> f64 {
            let (alpha, ior) = node_of(index);
            let columns = CosineColumns::new(alpha, ior, side);
            let row = &self.nodes[index][side];
            let mut sum = 0.0;
            let mut low = 0.0_f64;
            for column in 0..COSINES[side] - 1 {
                let high =
                    if column + 2 == COSINES[side] { 1.0 } else { columns.cosine(part(column + 1, COSINES[side])) };
                // Simpson's rule: a cell of the columns is short, and the cosine is smooth in it.
                for step in 0..8 {
                    let at = |k: f64| low + (high - low) * (f64::from(step) + k) / 8.0;
                    let value = |c: f64| {
                        let (at, x) = cell(columns.place(c), COSINES[side]);
                        2.0 * c * (row[at] * (1.0 - x) + row[at + 1] * x)
                    };
                    sum += (high - low) / 48.0 * (value(at(0.0)) + 4.0 * value(at(0.5)) + value(at(1.0)));
                }
                low = high;
            }
            sum
        }

        /// The bytes of the table.
        #[must_use]
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "f32, 16 bits")]
        pub fn bytes(&self) -> Vec<u8> {
            let mut bytes = Vec::with_capacity(super::BYTES);
            for index in 0..self.nodes.len() {
                let (alpha, ior) = node_of(index);
                let [light, dense] = [0, 1].map(|side| CosineColumns::new(alpha, ior, side));
                let node = [
                    1.0 / alpha,
                    dense.critical.unwrap_or(0.0),
                    light.factor,
                    light.offset,
                    dense.factor,
                    dense.offset,
                    self.average(index, 0),
                    self.average(index, 1),
                ];
                bytes.extend(node.iter().flat_map(|x| (*x as f32).to_le_bytes()));
            }
            let values = self.nodes.iter().flatten().flatten();
            bytes.extend(values.flat_map(|x| ((x * FULL).round() as u16).to_le_bytes()));
            bytes
        }

        /// Decodes the bytes of a table.
        #[must_use]
        pub fn of(bytes: &[u8]) -> Self {
            let values = &bytes[4 * super::NODE_FLOATS * IORS * ROUGHNESSES..];
            let mut values = values.as_chunks::<2>().0.iter().map(|pair| f64::from(u16::from_le_bytes(*pair)) / FULL);
            let mut row = |count: usize| values.by_ref().take(count).collect();
            Self { nodes: (0..IORS * ROUGHNESSES).map(|_| [row(COSINES[0]), row(COSINES[1])]).collect() }
        }
    }
}

#[cfg(test)]
mod tests;
