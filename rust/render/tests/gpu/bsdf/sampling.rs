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
}

impl Chart {
    pub(super) fn new(axis: DVec3, scale: f64) -> Self {
        let x = axis.any_orthonormal_vector();
        Self { axis, x, y: axis.cross(x), scale }
    }

    fn bin(&self, w: DVec3) -> usize {
        let w = w.normalize();
        let d = w - self.axis;
        let c1 = 0.5 * d.length_squared(); // 1 - cosine
        let tangent2 = c1 / (2.0 - c1).max(1e-300);
        let t = tangent2 / (self.scale * self.scale + tangent2);
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

    /// Direction of a point of the chart, and solid angle per area of the chart.
    fn direction(&self, t: f64, angle: f64) -> (DVec3, f64) {
        let s2 = self.scale * self.scale;
        let tangent2 = s2 * t / (1.0 - t);
        let cosine = (1.0 - tangent2) / (1.0 + tangent2);
        let sine = 2.0 * tangent2.sqrt() / (1.0 + tangent2);
        let (sin, cos) = (TAU * angle).sin_cos();
        let solid = 2.0 * TAU / (1.0 + tangent2).powi(2) * s2 / (1.0 - t).powi(2);
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
        for (i, ((_, solid), value)) in points.iter().zip(values).enumerate() {
            let (ring, sector) = (i / sectors, i % sectors);
            bins[ring / FINE * SECTORS + sector / FINE] += f64::from(value[3]) * solid / (rings * sectors) as f64;
        }
        bins
    }
}

/// How many standard deviations chi-square is off (Wilson and Hilferty 1931); bins that expect few are counted
/// together.
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

/// Chi-square of one case, with bins for what is sharp and what is lost; the integral of the density.
#[expect(clippy::cast_precision_loss, reason = "counts")]
pub(super) fn test(device: &Device, name: &str, case: &Case, chart: &Chart, seed: u32) -> f64 {
    let case = case.rounded();
    let answer = device.cases(&[case])[0];
    let chance = answer.chance;
    let mut expected = chart.expected(device, &case);
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
            chart.bin(DVec3::new(f64::from(x), f64::from(y), f64::from(z)))
        };
        counted[at] += 1;
    }
    let lost = counted[expected.len() + 1] as f64 / COUNT as f64;
    let whole = integral + sharp + lost;
    assert!((whole - 1.0).abs() < 0.01, "{name}: {integral} smooth + {sharp} sharp + {lost} lost, of {case:?}");
    assert!(lost < 0.45, "{name}: {lost} lost of {case:?}");
    expected.push(sharp);
    expected.push((1.0 - integral - sharp).max(0.0));
    // The quadrature's own error must not decide: what is lost is compared to a hundredth above, not to a count.
    let (expected, counted) = (&expected[..expected.len() - 1], &counted[..counted.len() - 1]);
    let (z, bins) = deviation(expected, counted);
    assert!(z < 5.0, "{name}: {z} standard deviations over {bins} bins, {case:?}");
    lost
}

fn mirror(wo: DVec3) -> DVec3 {
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
                    continue; // A narrow lobe among broad ones, or cut by the horizon: bins of neither size suit it.
                }
                seed += 1;
                let name = format!(
                    "roughness {roughness}, cosine {cosine}, metallic {metallic}, coat {coat}, opacity {opacity}"
                );
                lost = lost.max(test(&device, &name, &case, &chart, seed));
            }
        }
    }
    println!("{seed} cases; largest share of samples lost below the horizon: {lost:.3}");
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
            test(&device, &format!("normals differ, {seed}, {i}"), &case, &chart, 10 * seed + i);
        }
    }
    device.close();
}
