// SPDX-License-Identifier: Apache-2.0
//! The glass table against direct quadrature.

use super::make::GlassLosses;
use super::*;

/// Places all over the table and not at its nodes, most of them where the curve bends: (alpha, ior, side, cosine).
fn places(count: usize) -> Vec<(f64, f64, usize, f64)> {
    let mut state = 1_u64;
    let mut unit = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        f64::from(u32::try_from(state >> 40).unwrap_or(0)) / f64::from(1_u32 << 24)
    };
    let mut made = Vec::new();
    while made.len() < count {
        let roughness = 0.01 + 0.99 * unit().powf(1.5);
        let alpha = roughness * roughness;
        let ior = 1.0001 + 2.0 * unit().powi(3);
        let side = usize::from(unit() < 0.6);
        let critical = (1.0 - 1.0 / (ior * ior)).sqrt();
        let about = critical + 4.0 * alpha * (unit() - 0.5);
        let cosine = if side == 1 && unit() < 0.4 { about } else { unit().powi(2) };
        if alpha * (2.0 * (ior - 1.0)).min(1.0) >= 1e-4 {
            made.push((alpha, ior, side, cosine.clamp(1e-3, 1.0)));
        }
    }
    made
}

#[test]
fn the_table_is_accurate_between_its_nodes() {
    use rayon::prelude::*;
    let (table, normals) = (GlassLosses::of(bytes()), VisibleNormals::new(1 << 15));
    let errors: Vec<(f64, (f64, f64, usize, f64))> = places(3000)
        .into_par_iter()
        .map(|place| {
            let (alpha, ior, side, cosine) = place;
            let eta = if side == 1 { 1.0 / ior } else { ior };
            ((table.at(alpha, ior, side, cosine) - normals.loss(cosine, alpha, eta)).abs(), place)
        })
        .collect();
    let (worst, place) = errors.iter().copied().max_by(|a, b| a.0.total_cmp(&b.0)).expect("some");
    println!("largest error {worst:.2e} at (alpha, ior, side, cosine) {place:?}");
    assert!(worst < 1e-3, "{worst:e} at {place:?}");
}

#[test]
fn average_albedos_match_the_interpolated_table() {
    let table = GlassLosses::of(bytes());
    let float = |at: usize| f64::from(f32::from_le_bytes(std::array::from_fn(|i| bytes()[4 * at + i])));
    for (alpha, ior, side, _) in places(40) {
        // A midpoint rule in the logarithm above a hundredth of alpha.
        const STEPS: i32 = 20_000;
        let range = (1.0 + 100.0 / alpha).ln();
        let point = |i: i32| 0.01 * alpha * (range * f64::from(i) / f64::from(STEPS)).exp_m1();
        let mut sum = 0.0;
        for i in 0..STEPS {
            let (a, b) = (point(i), point(i + 1));
            sum += (b - a) * (a + b) * table.at(alpha, ior, side, 0.5 * (a + b));
        }
        let told: f64 = corners(alpha, ior)
            .iter()
            .map(|((plane, line), weight)| weight * float(NODE_FLOATS * (plane * ROUGHNESSES + line) + 6 + side))
            .sum();
        assert!((told - sum).abs() < 2e-4 * sum + 1e-9, "{told}, not {sum}: alpha {alpha}, ior {ior}, side {side}");
    }
}

#[test]
fn energy_losses_match_known_values() {
    let normals = VisibleNormals::new(1 << 15);
    // An interface that bends nothing and reflects nothing loses what is masked on the way out: 1 - G1 at the viewer's
    // cosine.
    for (cosine, alpha) in [(0.05, 0.3), (0.3, 1.0), (0.9, 0.5)] {
        let lost = normals.loss(cosine, alpha, 1.0);
        let slope = f64::sqrt(cosine * cosine + alpha * alpha * (1.0 - cosine * cosine));
        let known = 1.0 - 2.0 * cosine / (cosine + slope);
        assert!((lost - known).abs() < 1e-6, "{lost:?}, not {known}");
    }
    // A mirror loses as much as the table of GGX has, from either side, within the error of the two rules.
    let known = crate::device::bsdf_tables::albedo(0.4, 0.5, [64, 512])[0];
    for eta in [1e9, 1e-9] {
        let mirror = normals.loss(0.4, 0.5, eta);
        assert!((mirror - known).abs() < 1e-4, "{mirror}, not {known}");
    }
}
