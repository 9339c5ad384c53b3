// SPDX-License-Identifier: Apache-2.0
//! What single scattering by rough glass loses, for `shaders/include/bsdf/glass.glsl`, which says what it is for.
//!
//! Guarantees: [`floats`] is 314 KB, computed in f64 at its first use (a second and a half of one core, all cores take part), the same on
//! every machine that rounds alike; all values are finite and in 0..=1. Pure; any thread. Only scenes with rough glass ask.
//!
//! Sources: Walter et al. 2007 (refraction by microfacets), Heitz 2014 (masking), Dupuy and Benyoub 2023 (visible normals), Kulla and
//! Conty 2017 (what the averages are for).

use super::{average_of, part, roughness_of};
use rayon::prelude::*;
use std::f64::consts::PI;
use std::sync::OnceLock;

/// Cosines, equally far apart in their cube root.
pub const COSINES: usize = 48;
/// Roughnesses from [`super::SHARPEST`] to 1, equally far apart in their power 0.4.
pub const ROUGHNESSES: usize = 40;
/// Indices of refraction, equally far apart in ((ior - 1) / (ior + 1))^0.4: near 1 the loss changes fast.
pub const IORS: usize = 20;
/// Floats in all.
pub const FLOATS: usize = 2 * IORS * ROUGHNESSES * (COSINES + 1);

/// Points of the quadrature: over half a turn, and over the spherical cap.
const POINTS: [usize; 2] = [24, 48];
/// Largest index, in place of infinity.
const LARGEST_IOR: f64 = 1e6;

/// Seen from the side of the lower index, and from the other.
type Sides = [f64; 2];

/// The table as the shaders read it.
#[must_use]
pub fn floats() -> &'static [f32] {
    static TABLE: OnceLock<Vec<f32>> = OnceLock::new();
    TABLE.get_or_init(compute)
}

/// Fresnel reflectance and the cosine on the other side; `eta` = index there / index here.
fn fresnel(cosine: f64, eta: f64) -> (f64, f64) {
    let sine2 = (1.0 - cosine * cosine) / (eta * eta);
    if sine2 >= 1.0 {
        return (1.0, 0.0);
    }
    let there = (1.0 - sine2).sqrt();
    let a = (cosine - eta * there) / (cosine + eta * there);
    let b = (eta * cosine - there) / (eta * cosine + there);
    (0.5 * (a * a + b * b), there)
}

/// The loss at one cosine and roughness for several indices: `1 - F G2 / G1 - (1 - F) G1` over visible normals by a rule of
/// `points[0]` x `points[1]`, denser at the rim of the spherical cap. Each turn has its own place in the cells of the other axis, so that the
/// kink at total reflection is not met at the same place by all. A sum of losses, as it is small where it is a difference.
#[must_use]
#[expect(clippy::cast_precision_loss, reason = "few points")]
pub fn losses(cosine: f64, alpha: f64, iors: &[f64], points: [usize; 2]) -> Vec<Sides> {
    let cosine = cosine.max(1e-7);
    let slope = |c: f64| (c * c + alpha * alpha * (1.0 - c * c)).sqrt();
    let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
    let length = slope(cosine);
    let (x, z) = (alpha * sine / length, cosine / length);
    let mut sums = vec![[0.0; 2]; iors.len()];
    let mut whole = 0.0;
    for i in 0..points[0] {
        let turn = PI * (i as f64 + 0.5) / points[0] as f64;
        // Steps of the golden ratio are all over 0..1 in any number of them.
        let place = (0.5 + i as f64 * 0.618_033_988_749_894_9).fract();
        for j in 0..points[1] {
            let rim = (j as f64 + place) / points[1] as f64;
            let measure = rim * rim;
            whole += measure;
            let cap = (1.0 - rim.powi(3)) * (1.0 + z) - z;
            let ring = (1.0 - cap * cap).max(0.0).sqrt();
            let h = [alpha * (ring * turn.cos() + x), alpha * ring * turn.sin(), cap + z];
            let norm = (h[0] * h[0] + h[1] * h[1] + h[2] * h[2]).sqrt();
            let half = ((sine * h[0] + cosine * h[2]) / norm).clamp(0.0, 1.0);
            let up = h[2] / norm;
            let back = 2.0 * half * up - cosine;
            let reflected =
                if back > 0.0 { back * (cosine + length) / (cosine * slope(back) + back * length) } else { 0.0 };
            for (sum, ior) in sums.iter_mut().zip(iors) {
                for (sum, eta) in sum.iter_mut().zip([*ior, 1.0 / ior]) {
                    let (reflectance, there) = fresnel(half, eta);
                    let down = cosine / eta - (half / eta - there) * up;
                    let refracted = if down > 0.0 { 2.0 * down / (down + slope(down)) } else { 0.0 };
                    let lost = reflectance * (1.0 - reflected) + (1.0 - reflectance) * (1.0 - refracted);
                    *sum += measure * lost.max(0.0);
                }
            }
        }
    }
    for sum in sums.iter_mut().flatten() {
        *sum /= whole;
    }
    sums
}

fn ior(index: usize) -> f64 {
    let root = part(index, IORS).powf(2.5);
    ((1.0 + root) / (1.0 - root).max(1.0 / LARGEST_IOR)).min(LARGEST_IOR)
}

#[expect(clippy::cast_possible_truncation, reason = "the table is f32")]
fn compute() -> Vec<f32> {
    let iors: [f64; IORS] = std::array::from_fn(ior);
    let places: Vec<(usize, usize)> = (0..ROUGHNESSES).flat_map(|row| (0..COSINES).map(move |c| (row, c))).collect();
    let cells: Vec<Vec<[f32; 2]>> = places
        .into_par_iter()
        .map(|(row, column)| {
            let alpha = roughness_of(part(row, ROUGHNESSES)).powi(2);
            let sides = losses(part(column, COSINES).powi(3), alpha, &iors, POINTS);
            sides.into_iter().map(|sides| sides.map(|lost| lost.min(1.0) as f32)).collect()
        })
        .collect();
    let row = |ior: usize, row: usize| cells[row * COSINES..(row + 1) * COSINES].iter().map(move |cell| cell[ior]);
    let mut table = Vec::with_capacity(FLOATS);
    let mut averages = Vec::new();
    for (ior, roughness) in (0..IORS).flat_map(|i| (0..ROUGHNESSES).map(move |r| (i, r))) {
        table.extend(row(ior, roughness).flatten());
        // Of what the shaders interpolate.
        averages.extend([0, 1].map(|side| {
            let values: Vec<f64> = row(ior, roughness).map(|sides| f64::from(sides[side])).collect();
            average_of(&values) as f32
        }));
    }
    table.extend(averages);
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_quadrature_has_converged() {
        let iors = [1.001, 1.05, 1.5, 3.0];
        let mut worst = [0.0_f64; 4];
        for row in [0, 5, 12, 20, 30, 39] {
            for column in [4, 8, 15, 24, 36, 47] {
                let (alpha, cosine) = (roughness_of(part(row, ROUGHNESSES)).powi(2), part(column, COSINES).powi(3));
                let fine = losses(cosine, alpha, &iors, [160, 1200]);
                let used = losses(cosine, alpha, &iors, POINTS);
                for (worst, (a, b)) in worst.iter_mut().zip(fine.iter().zip(&used)) {
                    *worst = worst.max((a[0] - b[0]).abs()).max((a[1] - b[1]).abs());
                }
            }
        }
        // The kink at the angle of total reflection is what midpoints see worst.
        assert!(worst.iter().all(|error| *error < 6e-3), "worst errors {worst:?}");
    }

    #[test]
    fn losses_are_those_known() {
        let table = floats();
        assert_eq!(table.len(), FLOATS, "size");
        assert!(table.iter().all(|x| (0.0..=1.0).contains(x)), "all in 0..=1");
        // An interface that bends nothing and reflects nothing loses what the way out masks: 1 - G1 at the viewer's cosine.
        for (cosine, alpha) in [(0.05, 0.3), (0.3, 1.0), (0.9, 0.5)] {
            let lost = losses(cosine, alpha, &[1.0], [64, 256])[0];
            let slope = f64::sqrt(cosine * cosine + alpha * alpha * (1.0 - cosine * cosine));
            let known = 1.0 - 2.0 * cosine / (cosine + slope);
            assert!((lost[0] - known).abs() < 1e-6 && (lost[1] - known).abs() < 1e-6, "{lost:?}, not {known}");
        }
        // A mirror loses what the table of GGX says, from either side, as well as two rules agree.
        let [mirror, inside] = losses(0.4, 0.5, &[1e9], [64, 512])[0];
        let known = crate::bsdf_tables::albedo(0.4, 0.5, [64, 512])[0];
        assert!((mirror - known).abs() < 1e-4 && (inside - known).abs() < 1e-4, "{mirror} and {inside}, not {known}");
    }
}
