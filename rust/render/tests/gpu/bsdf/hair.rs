// SPDX-License-Identifier: Apache-2.0
//! Hair (`shaders/material/bsdf/hair.glsl`): values of a reference in f64 written from the papers' equations with
//! angles in a fixed frame, white furnace, sampling, mirrors, reciprocity as far as it goes, strange input.

use super::cases::{Case, Hair, Random, direction};
use super::device::{Device, PLAIN};
use super::sampling::{Chart, test};
use glam::DVec3;
use oocpt_abi::Features;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

const HAIR: Features = PLAIN.union(Features::OPEN_PBR).union(Features::HAIR);
/// `SHADING_HAIR`.
const SHADING_HAIR: u32 = 16;

fn fibre(hair: Hair, wo: DVec3, wi: DVec3) -> Case {
    Case { wo, wi, hair, ior: 1.55, flags: SHADING_HAIR, ..Case::default() }
}

/// exp(-x) I0(x), by its integral: the mean of exp(x (cos t - 1)).
fn scaled_bessel(x: f64) -> f64 {
    const STEPS: u32 = 4000;
    (0..STEPS).map(|k| (x * ((PI * (f64::from(k) + 0.5) / f64::from(STEPS)).cos() - 1.0)).exp()).sum::<f64>()
        / f64::from(STEPS)
}

/// d'Eon et al. 2011, eq. 7: csch(1 / v) / (2 v) exp(-sin sin / v) I0(cos cos / v), over exp.
fn longitudinal(theta_o: f64, theta_i: f64, v: f64) -> f64 {
    let a = theta_o.cos() * theta_i.cos() / v;
    let b = theta_o.sin() * theta_i.sin() / v;
    (a - b - 1.0 / v).exp() * scaled_bessel(a) / (v * (1.0 - (-2.0 / v).exp()))
}

/// Chiang et al. 2016, eq. 12: the logistic cut off at +-pi.
fn azimuthal(x: f64, scale: f64) -> f64 {
    let s = scale * (PI / 8.0).sqrt();
    let logistic = |x: f64| (-x / s).exp() / (s * (1.0 + (-x / s).exp()).powi(2));
    let below = |x: f64| 1.0 / (1.0 + (-x / s).exp());
    logistic(x.abs()) / (below(PI) - below(-PI))
}

/// Fresnel's equations, by the angles.
fn fresnel(cosine: f64, eta: f64) -> f64 {
    let inner = (1.0 - (1.0 - cosine * cosine) / (eta * eta)).sqrt();
    let s = (cosine - eta * inner) / (cosine + eta * inner);
    let p = (eta * cosine - inner) / (eta * cosine + inner);
    0.5 * (s * s + p * p)
}

/// The attenuations of the four lobes, without tints: Chiang et al. eq. 13, and the rest of its series.
fn attenuations(theta_o: f64, gamma_o: f64, eta: f64, absorption: f64) -> [f64; 4] {
    let f = fresnel((theta_o.cos() * gamma_o.cos()).max(0.0), eta);
    let theta_t = (theta_o.sin() / eta).asin();
    let bent = (eta * eta - theta_o.sin().powi(2)).sqrt() / theta_o.cos();
    let gamma_t = (gamma_o.sin() / bent).asin();
    let t = (-absorption * 2.0 * gamma_t.cos() / theta_t.cos()).exp();
    let tt = (1.0 - f).powi(2) * t;
    let trt = tt * t * f;
    let rest = std::iter::successors(Some(trt * t * f), |term| Some(term * t * f));
    [f, tt, trt, rest.take_while(|term| *term > 1e-16).sum()]
}

/// Angle from the plane across x, and around x from y to z.
fn angles(w: DVec3) -> (f64, f64) {
    (w.x.clamp(-1.0, 1.0).asin(), w.z.atan2(w.y))
}

/// f |cosine| by channel, for the normal z: the fibre goes along x.
pub(crate) fn reference(hair: &Hair, eta: f64, wo: DVec3, wi: DVec3) -> DVec3 {
    let ((theta_o, phi_o), (theta_i, phi_i)) = (angles(wo), angles(wi));
    let gamma_o = phi_o - FRAC_PI_2; // the normal is at a quarter turn
    let bent = (eta * eta - theta_o.sin().powi(2)).sqrt() / theta_o.cos();
    let gamma_t = (gamma_o.sin() / bent).asin();
    let mut sum = DVec3::ZERO;
    for (channel, value) in sum.as_mut().iter_mut().enumerate() {
        let parts = attenuations(theta_o, gamma_o, eta, hair.absorption[channel]);
        for (p, part) in parts.into_iter().enumerate() {
            let at = p.min(2);
            let tilt = [2.0, -1.0, -4.0, 0.0][p] * hair.tilt;
            // Beyond a pole the angle continues on the other side.
            let tilted = (theta_o + tilt).sin().asin();
            let along = longitudinal(tilted, theta_i, hair.variance[at]);
            let turns = f64::from(u8::try_from(p).expect("few"));
            let leaves = 2.0 * turns * gamma_t - 2.0 * gamma_o + turns * PI;
            let off = (phi_i - phi_o - leaves + PI).rem_euclid(TAU) - PI;
            let around = if p == 3 { 1.0 / TAU } else { azimuthal(off, hair.spread[at]) };
            *value += hair.tints[at][channel] * part * along * around;
        }
    }
    sum
}

fn any(random: &mut Random) -> Hair {
    let narrow = [0.001, 0.01, 0.05, 0.2, 0.6, 1.0];
    let mut numbers = || DVec3::new(random.pick(&narrow), random.pick(&narrow), random.pick(&narrow));
    let (variance, spread) = (numbers(), numbers());
    Hair {
        tints: [random.color(), random.color(), random.color()],
        absorption: random.color() * random.pick(&[0.0, 0.3, 2.0]),
        variance,
        spread,
        tilt: random.pick(&[0.0, 0.05, -0.2]),
        ..Hair::default()
    }
}

/// Values and densities; half of the directions are where a narrow lobe is.
#[test]
fn hair_values_match_the_f64_reference() {
    let device = Device::new(HAIR);
    let mut random = Random(31);
    let mut cases: Vec<Case> = (0..1500)
        .map(|_| {
            let (wo, hair) = (random.above(), any(&mut random));
            let wi = direction(2.0 * random.unit() - 1.0, TAU * random.unit());
            Case { u: random.units(), ior: 1.0 + random.unit(), ..fibre(hair, wo, wi) }.rounded()
        })
        .collect();
    let sampled: Vec<DVec3> = device.cases(&cases).iter().map(|answer| answer.sampled).collect();
    for (case, wi) in cases.iter_mut().zip(sampled).skip(500) {
        case.wi = wi;
    }
    let (mut worst, mut worst_narrow) = (0.0_f64, 0.0_f64);
    for (case, answer) in cases.iter().zip(device.cases(&cases)) {
        let known = reference(&case.hair, case.ior, case.wo, case.wi.normalize());
        let off = (known - answer.specular).abs().max_element() / (known.max_element() + 1e-3);
        let narrow = case.hair.variance.min_element().min(case.hair.spread.min_element()) < 0.05;
        if narrow {
            worst_narrow = worst_narrow.max(off)
        } else {
            worst = worst.max(off)
        }
        // f32 directions resolve lobes of a thousandth only so far, as they do narrow GGX lobes.
        assert!(off < if narrow { 2e-2 } else { 1e-3 }, "{off}: {}, not {known} of {case:?}", answer.specular);
        assert_eq!(answer.diffuse, DVec3::ZERO, "a fibre has no diffuse lobe");
    }
    println!("largest relative error: {worst:.1e}; of lobes below 0.05 {worst_narrow:.1e}");
    device.close();
}

/// The integral of the values over all directions, by midpoints in the fibre's own angles.
fn albedo(device: &Device, case: &Case) -> f64 {
    const STEPS: [u32; 2] = [384, 1024];
    let mut weights = Vec::new();
    let mut directions = Vec::new();
    for a in 0..STEPS[0] {
        let theta = PI * ((f64::from(a) + 0.5) / f64::from(STEPS[0]) - 0.5);
        for b in 0..STEPS[1] {
            let phi = TAU * (f64::from(b) + 0.5) / f64::from(STEPS[1]);
            directions.push(DVec3::new(theta.sin(), theta.cos() * phi.cos(), theta.cos() * phi.sin()));
            weights.push(theta.cos() * PI / f64::from(STEPS[0]) * TAU / f64::from(STEPS[1]));
        }
    }
    let values = device.grid(case, &directions);
    values.iter().zip(&weights).map(|(value, weight)| f64::from(value[0]) * weight).sum()
}

/// Without absorption nothing is lost and nothing won, at any roughness, index, tilt, and place across the fibre; with
/// it the albedo is the sum of the lobes' attenuations.
#[test]
fn white_hair_in_a_white_furnace_disappears() {
    let device = Device::new(HAIR);
    let mut worst = 0.0_f64;
    for (variance, spread) in [(0.002, 0.03), (0.01, 0.1), (0.05, 0.3), (0.2, 0.6), (1.0, 1.0), (0.01, 1.0)] {
        for (theta, gamma) in [(0.0_f64, 0.0_f64), (0.4, 0.7), (-1.2, -1.3), (1.5, 0.2)] {
            for (tilt, absorption) in [(0.0, 0.0), (0.07, 0.0), (-0.3, 0.5)] {
                let hair = Hair {
                    variance: DVec3::splat(variance),
                    spread: DVec3::splat(spread),
                    absorption: DVec3::splat(absorption),
                    tilt,
                    ..Hair::default()
                };
                let phi = gamma + FRAC_PI_2;
                let wo = DVec3::new(theta.sin(), theta.cos() * phi.cos(), theta.cos() * phi.sin());
                let case = fibre(hair, wo, wo).rounded();
                let known: f64 = attenuations(theta, gamma, case.ior, absorption).iter().sum();
                if absorption == 0.0 {
                    assert!((known - 1.0).abs() < 1e-9, "the reference loses: {known}");
                }
                let found = albedo(&device, &case);
                worst = worst.max((found - known).abs());
                assert!((found - known).abs() < 1e-3, "{found}, not {known} of {case:?}");
            }
        }
    }
    println!("largest error of an albedo: {worst:.1e}");
    device.close();
}

#[test]
fn samples_of_hair_follow_the_density() {
    let device = Device::new(HAIR);
    let mut seed = 700;
    for (variance, spread) in [(0.03, 0.15), (0.1, 0.4), (0.5, 0.2), (1.0, 1.0)] {
        for cosine in [0.1, 0.5, 0.95] {
            for (absorption, tilt) in [(0.0, 0.0), (0.4, 0.06), (5.0, -0.1)] {
                let hair = Hair {
                    variance: DVec3::new(variance, 0.5 * variance, variance),
                    spread: DVec3::splat(spread),
                    absorption: DVec3::new(absorption, 0.5 * absorption, 0.1),
                    tilt,
                    ..Hair::default()
                };
                seed += 1;
                let case = fibre(hair, direction(cosine, 0.7), DVec3::Z);
                let name = format!("hair of {variance}, {spread}, cosine {cosine}, absorption {absorption}");
                let lost = test(&device, &name, &case, &[Chart::new(DVec3::X, 1.0)], seed);
                assert!(lost == 0.0, "{name}: {lost} of the samples are lost");
            }
        }
    }
    device.close();
}

/// For the narrowest lobes: R is the mirror direction, TT through the middle goes straight on.
#[test]
fn narrow_hair_lobes_follow_specular_directions() {
    let device = Device::new(HAIR);
    let mut random = Random(5);
    let narrow = Hair { variance: DVec3::splat(0.001), spread: DVec3::splat(0.001), ..Hair::default() };
    let only =
        |at: usize| Hair { tints: std::array::from_fn(|k| if k == at { DVec3::ONE } else { DVec3::ZERO }), ..narrow };
    for _ in 0..100 {
        let wo = direction(0.2 + 0.7 * random.unit(), TAU * random.unit());
        let through = DVec3::new(wo.x, 0.0, wo.z).normalize();
        for (hair, wo, known) in [(only(0), wo, DVec3::new(-wo.x, -wo.y, wo.z)), (only(1), through, -through)] {
            // The middle of the lobe.
            let case = Case { u: [0.5, 0.999, 0.25], ..fibre(hair, wo, wo) };
            let answer = device.cases(&[case])[0];
            assert!(answer.ok && answer.sampled.distance(known) < 0.02, "{known}: {answer:?} of {case:?}");
        }
    }
    device.close();
}

/// `M_p` `N_p` of R without tilt is the same both ways, seen from the other side of the fibre; the reflectance is not:
/// it is Fresnel's at the place where the light leaves.
#[test]
fn the_reflection_is_reciprocal_but_for_fresnel() {
    let device = Device::new(HAIR);
    let mut random = Random(8);
    let mut worst = 0.0_f64;
    for _ in 0..200 {
        let (wo, wi) = (direction(0.9 * random.unit(), 1.0), direction(2.0 * random.unit() - 1.0, TAU * random.unit()));
        let hair = Hair {
            tints: [DVec3::ONE, DVec3::ZERO, DVec3::ZERO],
            variance: DVec3::splat(0.3),
            spread: DVec3::splat(0.4),
            offset: 1.8 * random.unit() - 0.9,
            ..Hair::default()
        };
        let value = |wo: DVec3, wi: DVec3, hair: Hair| {
            let case = fibre(hair, wo, wi).rounded();
            let theta = case.wo.x.asin();
            let f = fresnel(theta.cos() * case.hair.offset.asin().cos(), case.ior);
            device.cases(&[case])[0].specular.x / f
        };
        // `offset` grows along cross(normal, tangent); which side of the fibre that is depends on the viewer.
        let side = |w: DVec3| DVec3::X.cross(DVec3::new(0.0, w.y, w.z)).dot(DVec3::Z.cross(DVec3::X)).signum();
        let there = Hair { offset: -hair.offset * side(wo) * side(wi), ..hair };
        let (a, b) = (value(wo, wi, hair), value(wi, wo, there));
        worst = worst.max((a - b).abs() / a.max(b));
        assert!((a - b).abs() < 1e-3 * a.max(b) + 1e-6, "{a} {b} of {wo}, {wi}, {hair:?}");
    }
    println!("largest difference: {worst:.1e}");
    device.close();
}

#[test]
fn out_of_range_hair_gives_finite_values() {
    let device = Device::new(HAIR);
    let mut random = Random(77);
    let odd = [0.0, 1.0, 0.5, -1.0, 1e-30, 1e30, f64::NAN, f64::INFINITY];
    let cases: Vec<Case> = (0..20_000)
        .map(|_| {
            let mut numbers = || DVec3::new(random.pick(&odd), random.pick(&odd), random.pick(&odd));
            let mut hair = Hair {
                tints: [numbers(), numbers(), numbers()],
                absorption: numbers(),
                variance: numbers(),
                spread: numbers(),
                ..Hair::default()
            };
            hair.tilt = random.pick(&odd);
            hair.offset = random.pick(&odd);
            let unit = |v: DVec3| if v.length() > 1e-30 { v.normalize() } else { DVec3::X };
            let mut vector =
                || unit(DVec3::new(random.pick(&odd[..5]), random.pick(&odd[..5]), random.pick(&odd[..4])));
            let (g, n, wo, wi) = (vector(), vector(), vector(), vector());
            Case { g, n, ior: random.pick(&odd), u: random.units(), ..fibre(hair, wo, wi) }
        })
        .collect();
    for (case, answer) in cases.iter().zip(device.cases(&cases)) {
        assert!(answer.raw.iter().all(|x| x.is_finite()), "{answer:?} of {case:?}");
        assert!((answer.sampled.length() - 1.0).abs() < 1e-4, "{answer:?} of {case:?}");
        assert!(answer.raw[4..].iter().all(|x| *x >= 0.0), "{answer:?} of {case:?}");
    }
    device.close();
}
