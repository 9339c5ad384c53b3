// SPDX-License-Identifier: Apache-2.0
//! Samples are distributed as the density says (chi-square), which integrates to what they are; counts of sharp and
//! lost samples too.
//!
//! Directions are counted on a chart of the whole sphere about an axis: with `T = tan^2(angle / 2)`,
//! `t = T / (scale^2 + T)` is uniform for a lobe about as wide as `scale`; `scale` 1 is area.

use super::cases::{Case, SPECULAR_WORKFLOW, direction};
use super::device::{ALL, Device};
use glam::DVec3;
use std::f64::consts::TAU;

const RINGS: usize = 40;
const SECTORS: usize = 32;
const FINE: usize = 12;
const COUNT: usize = 1 << 16;

pub(super) struct Chart {
    axis: DVec3,
    x: DVec3,
    y: DVec3,
    scale: f64,
    /// True if half of the rings are as for `scale`, half as for 1: for a narrow lobe among broad ones.
    is_twofold: bool,
    /// The side of the surface that it counts, by the sign; 0: both.
    side: f64,
}

impl Chart {
    pub(super) fn new(axis: DVec3, scale: f64) -> Self {
        let x = axis.any_orthonormal_vector();
        Self { axis, x, y: axis.cross(x), scale, is_twofold: false, side: 0.0 }
    }

    /// A chart for a narrow lobe among broad ones, on the axis' side of the surface.
    pub(super) fn twofold(axis: DVec3, scale: f64) -> Self {
        Self { is_twofold: true, side: axis.z.signum(), ..Self::new(axis, scale) }
    }

    fn covers(&self, w: DVec3) -> bool {
        w.z * self.side >= 0.0
    }

    fn bin(&self, w: DVec3) -> usize {
        let w = w.normalize();
        let d = w - self.axis;
        let c1 = 0.5 * d.length_squared(); // 1 - cosine
        let tangent2 = c1 / (2.0 - c1).max(1e-300);
        let of = |s: f64| tangent2 / (s * s + tangent2);
        let t = if self.is_twofold { 0.5 * (of(self.scale) + of(1.0)) } else { of(self.scale) };
        let angle = w.dot(self.y).atan2(w.dot(self.x)).rem_euclid(TAU) / TAU;
        let index = |x: f64, n: usize| {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                clippy::cast_precision_loss,
                reason = "in 0..n"
            )]
            let i = (x * n as f64) as usize;
            i.min(n - 1)
        };
        index(t, RINGS) * SECTORS + index(angle, SECTORS)
    }

    /// `T` of a ring, and its change with the ring.
    fn tangent2(&self, t: f64) -> (f64, f64) {
        let a = self.scale * self.scale;
        if !self.is_twofold {
            return (a * t / (1.0 - t), a / (1.0 - t).powi(2));
        }
        // 2 t = T / (a + T) + T / (1 + T), a quadratic in T; the root without a difference of like numbers.
        let (p, q, r) = (2.0 - 2.0 * t, (1.0 + a) * (1.0 - 2.0 * t), 2.0 * t * a);
        let root = (q * q + 4.0 * p * r).sqrt();
        let tangent2 = if q > 0.0 { 2.0 * r / (q + root) } else { (root - q) / (2.0 * p) };
        (tangent2, 1.0 / (0.5 * a / (a + tangent2).powi(2) + 0.5 / (1.0 + tangent2).powi(2)))
    }

    /// Direction of a point of the chart, and solid angle per area of the chart.
    fn direction(&self, t: f64, angle: f64) -> (DVec3, f64) {
        let (tangent2, change) = self.tangent2(t);
        let cosine = (1.0 - tangent2) / (1.0 + tangent2);
        let sine = 2.0 * tangent2.sqrt() / (1.0 + tangent2);
        let (sin, cos) = (TAU * angle).sin_cos();
        let solid = 2.0 * TAU / (1.0 + tangent2).powi(2) * change;
        (self.axis * cosine + (self.x * cos + self.y * sin) * sine, solid)
    }

    /// Expected shares of the bins, by a midpoint rule.
    #[expect(clippy::cast_precision_loss, reason = "small numbers")]
    fn expected(&self, device: &Device, case: &Case) -> Vec<f64> {
        let (rings, sectors) = (RINGS * FINE, SECTORS * FINE);
        let points: Vec<(DVec3, f64)> = (0..rings * sectors)
            .map(|i| {
                let (ring, sector) = (i / sectors, i % sectors);
                self.direction((ring as f64 + 0.5) / rings as f64, (sector as f64 + 0.5) / sectors as f64)
            })
            .collect();
        let directions: Vec<DVec3> = points.iter().map(|(w, _)| *w).collect();
        let values = device.grid(case, &directions);
        let mut bins = vec![0.0; RINGS * SECTORS];
        for (i, ((w, solid), value)) in points.iter().zip(values).enumerate() {
            if !self.covers(*w) {
                continue;
            }
            let (ring, sector) = (i / sectors, i % sectors);
            bins[ring / FINE * SECTORS + sector / FINE] += f64::from(value[3]) * solid / (rings * sectors) as f64;
        }
        bins
    }
}

/// Standard deviations by which chi-square is off (Wilson and Hilferty 1931); bins that expect few are merged.
#[expect(clippy::cast_precision_loss, reason = "counts")]
fn deviation(expected: &[f64], counted: &[usize]) -> (f64, usize) {
    let mut sum = 0.0;
    let mut bins = 0_usize;
    let mut rest = (0.0, 0.0);
    let mut add = |e: f64, c: f64| {
        sum += (c - e).powi(2) / e;
        bins += 1;
    };
    for (e, c) in expected.iter().map(|e| e * COUNT as f64).zip(counted.iter().map(|c| *c as f64)) {
        if e < 10.0 {
            rest = (rest.0 + e, rest.1 + c);
        } else {
            add(e, c);
        }
    }
    if rest.0 >= 1.0 {
        add(rest.0, rest.1);
    } else {
        assert!(rest.1 <= 12.0, "{} samples where {} are expected", rest.1, rest.0);
    }
    let k = (bins.max(2) - 1) as f64;
    let third = 2.0 / (9.0 * k);
    (((sum / k).cbrt() - 1.0 + third) / third.sqrt(), bins)
}

/// Chi-square of one case, with bins for sharp and lost samples; the integral of the density.
#[expect(clippy::cast_precision_loss, reason = "counts")]
pub(super) fn test(device: &Device, name: &str, case: &Case, charts: &[Chart], seed: u32) -> f64 {
    let case = case.rounded();
    let answer = device.cases(&[case])[0];
    let chance = answer.chance;
    let mut expected: Vec<f64> = charts.iter().flat_map(|chart| chart.expected(device, &case)).collect();
    let integral: f64 = expected.iter().sum();
    let is_sharp = |roughness: f64| roughness < 0.01;
    let sharp = if answer.glass_alpha <= 0.0 { chance[4] } else { 0.0 }
        + if is_sharp(case.coat_roughness) { chance[0] } else { 0.0 }
        + if is_sharp(case.roughness) { chance[1] } else { 0.0 };
    let mut counted = vec![0; expected.len() + 2];
    for [x, y, z, pdf] in device.samples(&case, COUNT, seed) {
        let at = if pdf < 0.0 {
            expected.len() + 1
        } else if pdf == 0.0 {
            expected.len()
        } else {
            let w = DVec3::new(f64::from(x), f64::from(y), f64::from(z));
            let of = charts.iter().position(|chart| chart.covers(w)).expect("a chart of that side");
            of * RINGS * SECTORS + charts[of].bin(w)
        };
        counted[at] += 1;
    }
    let lost = counted[expected.len() + 1] as f64 / COUNT as f64;
    let whole = integral + sharp + lost;
    assert!((whole - 1.0).abs() < 0.01, "{name}: {integral} smooth + {sharp} sharp + {lost} lost, of {case:?}");
    assert!(lost < 0.45, "{name}: {lost} lost of {case:?}");
    expected.push(sharp);
    expected.push((1.0 - integral - sharp).max(0.0));
    // The quadrature's own error must not decide: losses are compared to a hundredth above, not to a count.
    let (expected, counted) = (&expected[..expected.len() - 1], &counted[..counted.len() - 1]);
    let (z, bins) = deviation(expected, counted);
    assert!(z < 5.0, "{name}: {z} standard deviations over {bins} bins, {case:?}");
    lost
}

pub(super) fn mirror(wo: DVec3) -> DVec3 {
    DVec3::new(-wo.x, -wo.y, wo.z)
}

#[test]
fn samples_follow_the_density() {
    let device = Device::new(ALL);
    let mut lost: f64 = 0.0;
    let mut seed = 0;
    for roughness in [0.05, 0.1, 0.3, 0.6, 1.0] {
        for cosine in [0.05, 0.15, 0.4, 0.95] {
            for (metallic, ior, coat, opacity) in [
                (1.0, 1.5, 0.0, 1.0),
                (0.0, 1.5, 0.0, 1.0),
                (0.5, 3.0, 0.0, 1.0),
                (0.0, 1.5, 1.0, 1.0),
                (1.0, 1.5, 0.5, 1.0),
                (0.0, 1.5, 0.0, 0.4),
                (0.0, 1.33, 0.5, 0.0),
            ] {
                let wo = direction(cosine, 0.7);
                let case = Case { wo, roughness, metallic, ior, coat, coat_roughness: 0.5, opacity, ..Case::default() };
                let alpha = roughness * roughness;
                let narrow = metallic == 1.0 && coat == 0.0 && roughness < 0.5;
                let chart = if narrow { Chart::new(mirror(wo), alpha) } else { Chart::new(DVec3::Z, 1.0) };
                if roughness < 0.3 && (!narrow || cosine < 0.1) || roughness < 0.6 && cosine < 0.1 && !narrow {
                    continue; // A narrow lobe among broad ones (see below), or cut by the horizon.
                }
                seed += 1;
                let name = format!(
                    "roughness {roughness}, cosine {cosine}, metallic {metallic}, coat {coat}, opacity {opacity}"
                );
                lost = lost.max(test(&device, &name, &case, &[chart], seed));
            }
        }
    }
    println!("{seed} cases; largest share of samples lost below the horizon: {lost:.3}");
    device.close();
}

/// A smooth coat on a rough base, and a smooth base under a rough coat or none.
#[test]
fn samples_of_narrow_lobes_among_broad_ones_follow_the_density() {
    let device = Device::new(ALL);
    let mut seed = 300;
    for narrow in [0.05, 0.1, 0.2] {
        for (cosine, metallic) in [(0.4, 0.0), (0.4, 1.0), (0.95, 0.0)] {
            for (roughness, coat, coat_roughness) in [(0.7, 1.0, narrow), (narrow, 0.5, 0.7), (narrow, 0.0, 0.5)] {
                let wo = direction(cosine, 0.7);
                let case = Case { wo, roughness, metallic, coat, coat_roughness, ..Case::default() };
                seed += 1;
                let name =
                    format!("roughness {roughness}, coat {coat} of {coat_roughness}, cosine {cosine}, {metallic}");
                test(&device, &name, &case, &[Chart::twofold(mirror(wo), narrow * narrow)], seed);
            }
        }
    }
    device.close();
}

#[test]
fn samples_follow_the_density_where_normals_differ() {
    let device = Device::new(ALL);
    let g = direction(0.8, 2.0);
    for (seed, (roughness, metallic, opacity)) in (100..).zip([(0.4, 1.0, 1.0), (0.7, 0.0, 1.0), (0.5, 0.0, 0.5)]) {
        // Seen from above both, from below the shading normal's horizon, and from behind.
        for (i, wo) in (0..).zip([direction(0.7, 1.0), direction(-0.1, 2.0), -direction(0.6, 4.0)]) {
            let flags = if seed == 101 { SPECULAR_WORKFLOW } else { 0 };
            let case =
                Case { g, wo, roughness, metallic, opacity, specular: DVec3::splat(0.3), flags, ..Case::default() };
            let chart = Chart::new(g, 1.0);
            test(&device, &format!("normals differ, {seed}, {i}"), &case, &[chart], 10 * seed + i);
        }
    }
    device.close();
}
