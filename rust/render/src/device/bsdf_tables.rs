// SPDX-License-Identifier: Apache-2.0
//! Directional albedos of GGX for `shaders/material/bsdf/tables.glsl`, which says what is in the table.
//!
//! Guarantees: [`bytes`] is 62 KB that are part of the program, made by `examples/bsdf_tables.rs` from [`compute`] in
//! f64 and rounded to f32: no time is spent on them; all values are finite and in 0..=1. Pure; any thread.
//!
//! Sources: Heitz 2014 (height-correlated masking), Dupuy and Benyoub 2023 (visible normals by spherical caps), Karis
//! 2013 (B), Kulla and Conty 2017 (what the albedos are for).

pub mod glass;
pub mod sheen;

use oocpt_abi::{TABLE_COSINE, TABLE_ROUGHNESS};
use rayon::prelude::*;
use std::f64::consts::PI;

/// Cosines of the albedo table, equally far apart in their cube root.
pub const COSINES: usize = TABLE_COSINE as usize;
/// Roughnesses from [`SHARPEST`] to 1, equally far apart in their power 0.4: the energy that a surface loses changes
/// with alpha / cosine.
pub const ROUGHNESSES: usize = TABLE_ROUGHNESS as usize;
/// Least roughness: lobes below it are sharp.
pub const SHARPEST: f64 = 0.01;
/// Floats in all.
pub const FLOATS: usize = 2 * ROUGHNESSES * COSINES + 2 * ROUGHNESSES + 4 * ROUGHNESSES * ROUGHNESSES;

/// Points of the quadrature: over half a turn, and over the spherical cap.
const POINTS: [usize; 2] = [32, 128];

type FloatPair = [f64; 2];
type PairRow = [FloatPair; COSINES];

static TABLE: &[u8] = include_bytes!("bsdf_tables/ggx.bin");
const _: () = assert!(TABLE.len() == 4 * FLOATS, "run the example `bsdf_tables`");

/// The table as the shaders read it: f32, little-endian.
#[must_use]
pub fn bytes() -> &'static [u8] {
    TABLE
}

/// L and B of the single-scattering albedo `f0 * (1 - L - B) + f90 * B` by a midpoint rule of `points[0]` x
/// `points[1]`, denser at the rim of the spherical cap, where the few normals are that look aside.
#[must_use]
#[expect(clippy::cast_precision_loss, reason = "few points")]
pub fn albedo(cosine: f64, alpha: f64, points: [usize; 2]) -> [f64; 2] {
    let mut sum = [0.0; 2];
    for i in 0..points[0] {
        let turn = PI * (i as f64 + 0.5) / points[0] as f64;
        for j in 0..points[1] {
            let rim = (j as f64 + 0.5) / points[1] as f64;
            let (masking, half) = sample(cosine, alpha, turn, 1.0 - rim.powi(3));
            let weight = masking * 3.0 * rim * rim;
            let schlick = (1.0 - half).clamp(0.0, 1.0).powi(5);
            sum[0] += 3.0 * rim * rim * (1.0 - masking);
            sum[1] += weight * schlick;
        }
    }
    sum.map(|sum| sum / (points[0] * points[1]) as f64)
}

/// A reflection off a visible normal: masking over that of the viewer alone, and the cosine with the half vector.
fn sample(cosine: f64, alpha: f64, turn: f64, height: f64) -> (f64, f64) {
    let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
    let length = (alpha * alpha * sine * sine + cosine * cosine).sqrt();
    let (x, z) = if length > 0.0 { (alpha * sine / length, cosine / length) } else { (1.0, 0.0) };
    let cap = (1.0 - height) * (1.0 + z) - z;
    let ring = (1.0 - cap * cap).max(0.0).sqrt();
    let h = [alpha * (ring * turn.cos() + x), alpha * ring * turn.sin(), cap + z];
    let norm = (h[0] * h[0] + h[1] * h[1] + h[2] * h[2]).sqrt();
    if norm <= 0.0 {
        return (0.0, 0.0);
    }
    let half = (sine * h[0] + cosine * h[2]) / norm;
    let out = 2.0 * half * h[2] / norm - cosine;
    if out <= 0.0 {
        return (0.0, half);
    }
    let slope = |c: f64| (alpha * alpha + (1.0 - alpha * alpha) * c * c).sqrt();
    let denominator = cosine * slope(out) + out * slope(cosine);
    (if denominator > 0.0 { out * (cosine + slope(cosine)) / denominator } else { 0.0 }, half)
}

#[expect(clippy::cast_precision_loss, reason = "small numbers")]
fn part(index: usize, count: usize) -> f64 {
    index as f64 / (count - 1) as f64
}

/// The roughness at a place among the rows, 0..=1.
fn roughness_of(place: f64) -> f64 {
    let first = SHARPEST.powf(0.4);
    (first + (1.0 - first) * place).powf(2.5)
}

fn roughness(index: usize) -> f64 {
    roughness_of(part(index, ROUGHNESSES))
}

fn row(index: usize) -> PairRow {
    let alpha = roughness(index).powi(2);
    std::array::from_fn(|column| albedo(part(column, COSINES).powi(3), alpha, POINTS))
}

/// Average over the hemisphere, cosine weighted, of the product of two entries of interpolated rows.
fn average(a: &PairRow, i: usize, b: &PairRow, j: usize) -> f64 {
    integral(|cell, at| {
        let value = |row: &PairRow, k: usize| row[cell][k] * (1.0 - at) + row[cell + 1][k] * at;
        value(a, i) * value(b, j)
    })
}

/// The average of a function of (cell, place in it); what is interpolated is linear in `x`, the cube root of the
/// cosine, within a cell, and `6 x^5 dx` is the measure, so six points of Gauss and Legendre are exact with room for a
/// product.
fn integral(f: impl Fn(usize, f64) -> f64) -> f64 {
    const NODES: [[f64; 2]; 3] = [
        [0.238_619_186_083_196_9, 0.467_913_934_572_691],
        [0.661_209_386_466_264_5, 0.360_761_573_048_138_6],
        [0.932_469_514_203_152, 0.171_324_492_379_170_3],
    ];
    let mut sum = 0.0;
    for cell in 0..COSINES - 1 {
        for [node, weight] in NODES {
            for at in [0.5 - 0.5 * node, 0.5 + 0.5 * node] {
                let x = part(cell, COSINES) + at * part(1, COSINES);
                sum += 0.5 * weight * part(1, COSINES) * 6.0 * x.powi(5) * f(cell, at);
            }
        }
    }
    sum
}

/// The bytes of the table: half a second of one core. Only the example and tests ask.
#[must_use]
#[expect(clippy::cast_possible_truncation, reason = "the table is f32")]
pub fn compute() -> Vec<u8> {
    let ones: PairRow = [[1.0; 2]; COSINES];
    // Values are rounded first, so that the averages are those of what the shaders interpolate.
    let rounded = |row: PairRow| row.map(|pair| pair.map(|x| f64::from(x as f32)));
    let rows: Vec<PairRow> = (0..ROUGHNESSES).into_par_iter().map(|index| rounded(row(index))).collect();
    let mut table: Vec<f64> = rows.iter().flatten().flatten().copied().collect();
    table.extend(rows.iter().flat_map(|row| [average(row, 0, &ones, 0), average(row, 1, &ones, 0)]));
    let products =
        |a: usize, b: usize| [(0, 0), (0, 1), (1, 0), (1, 1)].map(|(i, j)| average(&rows[a], i, &rows[b], j));
    let pairs = (0..ROUGHNESSES).flat_map(|a| (0..ROUGHNESSES).map(move |b| (a, b)));
    table.extend(pairs.flat_map(|(a, b)| products(a, b)));
    table.into_iter().flat_map(|x| (x as f32).to_le_bytes()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_quadrature_has_converged() {
        let mut worst: f64 = 0.0;
        for index in [0, 4, 9, 18, 30, 47] {
            for column in [4, 8, 16, 32, 50, 63] {
                let (alpha, cosine) = (roughness(index).powi(2), part(column, COSINES).powi(3));
                let fine = albedo(cosine, alpha, [200, 3000]);
                let used = albedo(cosine, alpha, POINTS);
                worst = worst.max((fine[0] - used[0]).abs()).max((fine[1] - used[1]).abs());
            }
        }
        assert!(worst < 3e-4, "worst error {worst:e}");
    }

    #[test]
    fn average_albedos_match_known_values() {
        let floats =
            |bytes: &[u8]| -> Vec<f32> { bytes.as_chunks::<4>().0.iter().map(|x| f32::from_le_bytes(*x)).collect() };
        let table = floats(bytes());
        assert_eq!(table.len(), FLOATS, "size");
        let far = table.iter().zip(floats(&compute())).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(far < 1e-6, "what is computed is {far:e} from the table");
        assert!(table.iter().all(|x| (0.0..=1.000_001).contains(x)), "all in 0..=1");
        // Schlick: the average of (1 - c)^5 is 1 / 21, and a mirror loses nothing; the first row is nearly one.
        let averages = &table[2 * ROUGHNESSES * COSINES..];
        assert!((averages[1] - 1.0 / 21.0).abs() < 1e-3, "average of Schlick's term: {}", averages[1]);
        assert!(averages[0] < 1e-4, "nearly a mirror loses next to nothing: {}", averages[0]);
    }
}
