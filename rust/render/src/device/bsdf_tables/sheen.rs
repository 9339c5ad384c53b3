// SPDX-License-Identifier: Apache-2.0
//! The directional albedo of sheen, for `shaders/material/bsdf/sheen.glsl`, which explains the lobe.
//!
//! Guarantees: [`bytes`] is 23 KB that are part of the program, made by `examples/bsdf_tables.rs` from [`compute`] in
//! f64; all values are finite and in 0..=1. Pure; any thread.
//!
//! Sources: Conty and Kulla 2017, "Production friendly microfacet sheen BRDF" (the distribution of normals, layering by
//! albedo); Neubelt and Pettineo 2013, "Crafting a next-gen material pipeline for The Order: 1886" (the substitute for
//! masking).

use super::{PairRow, part};
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};

/// Cosines, equally far apart in their root.
pub const COSINES: usize = 80;
/// Roughnesses from [`SHARPEST`] to 1, equally far apart in their root.
pub const ROUGHNESSES: usize = 32;
/// Least roughness: smaller ones are raised to it.
pub const SHARPEST: f64 = 0.1;
/// Floats in all: albedos, averages, scales, products with the two albedos of each roughness of GGX.
pub const FLOATS: usize = ROUGHNESSES * (COSINES + 2 + 2 * super::ROUGHNESSES);
/// Points of the quadrature: over half a turn, and over cosines.
const POINTS: [usize; 2] = [256, 256];

static TABLE: &[u8] = include_bytes!("sheen.bin");
const _: () = assert!(TABLE.len() == 4 * FLOATS, "run the example `bsdf_tables`");

/// The table as the shaders read it: f32, little-endian.
#[must_use]
pub fn bytes() -> &'static [u8] {
    TABLE
}

/// Albedo of sheen before it is scaled, by a midpoint rule over incoming directions, denser at the horizon.
#[must_use]
#[expect(clippy::cast_precision_loss, reason = "few points")]
pub fn albedo(cosine: f64, roughness: f64, points: [usize; 2]) -> f64 {
    let cosine = cosine.max(1e-7);
    let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
    let power = 1.0 / roughness;
    let mut sum = 0.0;
    for i in 0..points[0] {
        // Near the direction back to the viewer, 0, the lobe is narrowest if both graze.
        let turn = (i as f64 + 0.5) / points[0] as f64;
        let (turn, turn_measure) = (PI * turn * turn, 2.0 * turn);
        for j in 0..points[1] {
            let root = (j as f64 + 0.5) / points[1] as f64;
            let c = root * root;
            let s = (1.0 - c * c).sqrt();
            let h = [sine + s * turn.cos(), s * turn.sin(), cosine + c];
            let sine2 = (h[0] * h[0] + h[1] * h[1]) / (h[0] * h[0] + h[1] * h[1] + h[2] * h[2]);
            let density = (2.0 + power) * sine2.powf(0.5 * power) / TAU;
            sum += density * c / (4.0 * (cosine + c - cosine * c)) * 2.0 * root * turn_measure;
        }
    }
    sum * TAU / (points[0] * points[1]) as f64
}

/// The roughness at a place among the rows, 0..=1.
fn roughness_of(place: f64) -> f64 {
    let first = SHARPEST.sqrt();
    (first + (1.0 - first) * place).powi(2)
}

/// The average over the hemisphere, cosine weighted, of an interpolated row times another function of the cosine.
fn average(row: &[f64], other: impl Fn(f64) -> f64) -> f64 {
    const STEPS: i32 = 16;
    let mut sum = 0.0;
    for cell in 0..COSINES - 1 {
        for step in 0..STEPS {
            let at = (f64::from(step) + 0.5) / f64::from(STEPS);
            let root = part(cell, COSINES) + at * part(1, COSINES);
            sum += 4.0 * root.powi(3) * (row[cell] * (1.0 - at) + row[cell + 1] * at) * other(root * root);
        }
    }
    sum * part(1, COSINES) / f64::from(STEPS)
}

/// The bytes of the table, a second of one core. Only the example and tests ask.
#[must_use]
#[expect(clippy::cast_possible_truncation, clippy::cast_precision_loss, reason = "the table is f32, and small")]
pub fn compute() -> Vec<u8> {
    let made: Vec<(Vec<f64>, f64)> = (0..ROUGHNESSES)
        .into_par_iter()
        .map(|index| {
            let roughness = roughness_of(part(index, ROUGHNESSES));
            let row: Vec<f64> = (0..COSINES).map(|c| albedo(part(c, COSINES).powi(2), roughness, POINTS)).collect();
            // The lobe is scaled down where it would reflect more than it receives, at grazing angles.
            let scale = 1.0 / row.iter().copied().fold(1.0, f64::max);
            (row.into_iter().map(|x| x * scale).collect(), scale)
        })
        .collect();
    let ggx: Vec<PairRow> = (0..super::ROUGHNESSES).into_par_iter().map(super::row).collect();
    let of_ggx = |row: &PairRow, k: usize, cosine: f64| {
        let place = cosine.cbrt() * (super::COSINES - 1) as f64;
        #[expect(clippy::cast_sign_loss, reason = "above 0")]
        let cell = (place as usize).min(super::COSINES - 2);
        let at = place - cell as f64;
        row[cell][k] * (1.0 - at) + row[cell + 1][k] * at
    };
    let mut table: Vec<f64> = made.iter().flat_map(|(row, _)| row.iter().copied()).collect();
    table.extend(made.iter().map(|(row, _)| average(row, |_| 1.0)));
    table.extend(made.iter().map(|(_, scale)| *scale));
    for row in &ggx {
        for (sheen, _) in &made {
            table.extend([0, 1].map(|k| average(sheen, |cosine| of_ggx(row, k, cosine))));
        }
    }
    table.into_iter().flat_map(|x| (x as f32).to_le_bytes()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_accurate_between_its_nodes() {
        let floats: Vec<f64> = bytes().as_chunks::<4>().0.iter().map(|x| f64::from(f32::from_le_bytes(*x))).collect();
        assert!(floats.iter().all(|x| (0.0..=1.000_001).contains(x)), "all in 0..=1");
        let cell = |place: f64, count: usize| {
            let at = place * (count - 1) as f64;
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "small")]
            let index = (at as usize).min(count - 2);
            (index, at - index as f64)
        };
        let mut worst: f64 = 0.0;
        for y in 0..40 {
            let place = (f64::from(y) + 0.31) / 40.0;
            let (line, y) = cell(place, ROUGHNESSES);
            for c in 0..40 {
                let cosine = ((f64::from(c) + 0.43) / 40.0).powi(2);
                let (column, x) = cell(cosine.sqrt(), COSINES);
                let of =
                    |line: usize| floats[line * COSINES + column] * (1.0 - x) + floats[line * COSINES + column + 1] * x;
                let scale = |line: usize| floats[ROUGHNESSES * (COSINES + 1) + line];
                let scale = scale(line) * (1.0 - y) + scale(line + 1) * y;
                let known = scale * albedo(cosine, roughness_of(place), POINTS);
                worst = worst.max((of(line) * (1.0 - y) + of(line + 1) * y - known).abs());
            }
        }
        println!("largest error {worst:.1e}");
        assert!(worst < 1e-3, "{worst:e}");
    }

    #[test]
    fn albedos_match_known_values() {
        // Seen from above with roughness 1: D = 3 sin(t / 2) / (2 pi), with 1 / 4 instead of masking, so E is the
        // integral of 3 / 4 sin(t / 2) cos t sin t over t = 0..pi/2, which with s = sin(t / 2) is that of 3 s^2 (1 - 2
        // s^2) over 0..sqrt(1/2) = sqrt(2) / 10.
        let known = f64::sqrt(2.0) / 10.0;
        let found = albedo(1.0, 1.0, [16, 4096]);
        assert!((found - known).abs() < 1e-5, "{found}, not {known}");
    }
}
