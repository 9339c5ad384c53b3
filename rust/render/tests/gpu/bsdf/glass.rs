// SPDX-License-Identifier: Apache-2.0
//! Rough glass by itself: against its definition in f64, reciprocity with both indices, a white furnace over roughness
//! and index, samples against densities on both sides, and the limit of a smooth interface.

use super::cases::{Case, Random, SPECULAR_WORKFLOW, direction};
use super::device::{ALL, Device, SHARP_GLASS};
use super::energy::furnace_of;
use super::sampling::{Chart, mirror, test};
use crate::support::few_of;
use glam::DVec3;
use std::f64::consts::{PI, TAU};

/// A case of glass only.
fn glass() -> Case {
    Case { opacity: 0.0, metallic: 0.0, ..Case::default() }
}

/// Index on the side of the viewer, and beyond; `ior` may be below 1.
fn indices(case: &Case) -> (f64, f64) {
    if case.wo.z > 0.0 { (1.0, case.ior) } else { (case.ior, 1.0) }
}

/// Fresnel's equations for a microfacet at this cosine, `eta` = index there / index here.
fn fresnel(cosine: f64, eta: f64) -> f64 {
    let sine2 = (1.0 - cosine * cosine) / (eta * eta);
    if sine2 >= 1.0 {
        return 1.0;
    }
    let there = (1.0 - sine2).sqrt();
    let (s, p) = ((cosine - eta * there) / (cosine + eta * there), (eta * cosine - there) / (eta * cosine + there));
    0.5 * (s * s + p * p)
}

fn masking(alpha: f64, cosine: f64) -> f64 {
    let tangent2 = (1.0 - cosine * cosine) / (cosine * cosine);
    2.0 / (1.0 + (1.0 + alpha * alpha * tangent2).sqrt())
}

fn both_masking(alpha: f64, o: f64, i: f64) -> f64 {
    1.0 / (1.0 / masking(alpha, o) + 1.0 / masking(alpha, i) - 1.0)
}

fn density(alpha: f64, cosine: f64) -> f64 {
    let a2 = alpha * alpha;
    a2 / (PI * (cosine * cosine * (a2 - 1.0) + 1.0).powi(2))
}

/// The loss of single scattering at a cosine on a side, by quadrature over normals with density D cos, not over visible
/// ones. The sum over visible normals is normalised to 1.
fn lost(alpha: f64, cosine: f64, eta: f64) -> f64 {
    const STEPS: [u32; 2] = [64, 600];
    let o = DVec3::new((1.0 - cosine * cosine).sqrt(), 0.0, cosine);
    // Sine and cosine of the normals' angles to the surface's.
    let slopes: Vec<[f64; 2]> = (0..STEPS[1])
        .map(|b| {
            let u = (f64::from(b) + 0.5) / f64::from(STEPS[1]);
            let tangent = alpha * (u / (1.0 - u)).sqrt();
            let z = 1.0 / (1.0 + tangent * tangent).sqrt();
            [tangent * z, z]
        })
        .collect();
    let own = masking(alpha, cosine);
    let (mut sum, mut whole) = (0.0, 0.0);
    for a in 0..STEPS[0] {
        let (sin, cos) = (PI * (f64::from(a) + 0.5) / f64::from(STEPS[0])).sin_cos();
        for [sine, z] in &slopes {
            let half = o.dot(DVec3::new(sine * cos, sine * sin, *z));
            if half <= 0.0 {
                continue;
            }
            let f = fresnel(half, eta);
            let up = 2.0 * half * z - cosine;
            let reflected = if up > 0.0 { f * both_masking(alpha, cosine, up) / own } else { 0.0 };
            let sine2 = (1.0 - half * half) / (eta * eta);
            let down = if sine2 < 1.0 { cosine / eta - (half / eta - (1.0 - sine2).sqrt()) * z } else { 0.0 };
            let refracted = if down > 0.0 { (1.0 - f) * masking(alpha, down) } else { 0.0 };
            let weight = half / (cosine * z);
            sum += (1.0 - reflected - refracted) * weight;
            whole += weight;
        }
    }
    sum / whole
}

/// The average of U over a side's hemisphere.
fn average(alpha: f64, eta: f64) -> f64 {
    const STEPS: i32 = 48;
    (0..STEPS)
        .map(|step| (f64::from(step) + 0.5) / f64::from(STEPS))
        .map(|x| lost(alpha, x.powi(3), eta) * 6.0 * x.powi(5) / f64::from(STEPS))
        .sum()
}

/// Value of single and of multiple scattering, the density of single scattering, and the share of multiple scattering
/// on that side, as the head of `shaders/material/bsdf/glass.glsl` defines them, with absolute indices as in Walter et
/// al. 2007.
fn reference(case: &Case) -> [f64; 4] {
    let case = case.rounded();
    let alpha = case.roughness * case.roughness;
    let (here, beyond) = indices(&case);
    let (o, i) = (case.wo * case.wo.z.signum(), case.wi * case.wo.z.signum());
    let eta = beyond / here;
    let index = if i.z > 0.0 { here } else { beyond };
    let (value, pdf) = if i.z > 0.0 {
        let h = (o + i).normalize();
        let half = o.dot(h);
        let visible = density(alpha, h.z) * masking(alpha, o.z) / (4.0 * o.z);
        let f = fresnel(half, eta);
        (f * density(alpha, h.z) * both_masking(alpha, o.z, i.z) / (4.0 * o.z), f * visible)
    } else {
        let across = here * o + beyond * i;
        let h = across.normalize() * across.z.signum();
        let (oh, ih) = (o.dot(h), i.dot(h));
        if oh > 0.0 && ih < 0.0 {
            let jacobian = beyond * beyond * ih.abs() / (here * oh + beyond * ih).powi(2);
            let visible = density(alpha, h.z) * masking(alpha, o.z) * oh / o.z;
            let pdf = (1.0 - fresnel(oh, eta)) * visible * jacobian;
            (pdf * masking(alpha, i.z.abs()), pdf)
        } else {
            (0.0, 0.0)
        }
    };
    let sides = [here * here * average(alpha, eta), beyond * beyond * average(alpha, 1.0 / eta)];
    let norm = PI * (sides[0] + sides[1]);
    let share = PI * sides[usize::from(i.z < 0.0)] / norm;
    let there = lost(alpha, i.z.abs(), if i.z > 0.0 { eta } else { 1.0 / eta });
    [value, lost(alpha, o.z, eta) * there * index * index * i.z.abs() / norm, pdf, share]
}

#[test]
fn rough_glass_values_match_the_f64_definition() {
    let device = Device::new(ALL);
    let mut random = Random(21);
    let mut made = Vec::new();
    for (at, ior) in [0.7, 1.2, 1.5, 2.4].into_iter().cycle().take(32).enumerate() {
        let roughness = 0.25 + 0.75 * random.unit();
        let mut wo = direction(0.15 + 0.85 * random.unit(), TAU * random.unit());
        if at % 2 == 1 {
            wo = -wo;
        }
        let case = Case { wo, ior, roughness, u: random.units(), ..glass() };
        // The direction is a sample, so that narrow lobes are met.
        let wi = device.cases(&[case])[0].sampled;
        if wi.z.abs() > 0.15 {
            made.push(Case { wi, ..case });
        }
    }
    let mut worst = [0.0_f64; 2];
    let mut beyond = 0;
    for (case, answer) in made.iter().zip(device.cases(&made)) {
        let [single, multiple, density, share] = reference(case);
        let value = answer.specular.x;
        let spread = single + multiple;
        let alpha = case.roughness.powi(2);
        let broad = 1.0 / (TAU * (case.wi.z.abs() + alpha) * (1.0 / alpha).ln_1p());
        let density = answer.chance[4] * density + answer.chance[5] * share * broad;
        let errors = [(value - spread).abs() / (spread + 0.02), (answer.given_pdf - density).abs() / density];
        for (worst, error) in worst.iter_mut().zip(errors) {
            *worst = worst.max(error);
        }
        assert!(errors.iter().all(|e| *e < 0.02), "{errors:?}: {single} + {multiple}, not {answer:?} of {case:?}");
        assert_eq!(answer.diffuse, DVec3::ZERO, "glass is specular");
        beyond += usize::from(case.wi.z * case.wo.z < 0.0);
    }
    println!("{} cases, {beyond} beyond: values to {:.1e}, densities to {:.1e}", made.len(), worst[0], worst[1]);
    assert!(beyond > 8 && made.len() - beyond > 4, "both sides");
    device.close();
}

/// A coat has the index of the glass below it and shows by its roughness alone: a share of it as large as its amount.
#[test]
fn a_coat_gives_glass_its_roughness() {
    let device = Device::new(ALL);
    let mut random = Random(25);
    let mut cases = Vec::new();
    for _ in 0..200 {
        let [side, far] = [1.0, -1.0].map(|s| s * random.pick(&[1.0, -1.0]));
        let (wo, wi) = (random.above() * side, random.above() * far);
        let (roughness, coat_roughness, coat) = (0.2 + 0.8 * random.unit(), 0.2 + 0.8 * random.unit(), random.unit());
        cases.push(Case { wo, wi, roughness, coat_roughness, coat, ior: 1.4, ..glass() });
    }
    let bare = |c: &Case| Case { roughness: c.roughness + (c.coat_roughness - c.roughness) * c.coat, coat: 0.0, ..*c };
    let plain: Vec<Case> = cases.iter().map(bare).collect();
    let mut beyond = 0;
    for ((case, coated), plain) in cases.iter().zip(device.cases(&cases)).zip(device.cases(&plain)) {
        assert!((coated.glass_alpha / plain.glass_alpha - 1.0).abs() < 1e-5, "{coated:?}, not {plain:?} of {case:?}");
        let error = (coated.specular - plain.specular).abs().max_element() / (plain.specular.max_element() + 1e-3);
        assert!(error < 1e-3, "{error}: {coated:?}, not {plain:?} of {case:?}");
        beyond += usize::from(case.wi.z * case.wo.z < 0.0 && plain.specular.x > 0.0);
    }
    assert!(beyond > 50, "some go through: {beyond}");
    device.close();
}

/// The symmetric quantity is value / (n^2 |cosine|), with n of the side the light comes from.
#[test]
fn rough_glass_is_reciprocal() {
    let device = Device::new(ALL);
    let mut random = Random(22);
    let mut cases = Vec::new();
    while cases.len() < 4000 {
        let ior = random.pick(&[0.5, 0.8, 1.05, 1.33, 1.5, 2.0, 3.0]);
        let side = random.pick(&[1.0, -1.0]);
        let wo = direction(0.02 + 0.98 * random.unit(), TAU * random.unit()) * side;
        let (flags, specular) = (u32::from(random.unit() < 0.3) * SPECULAR_WORKFLOW, random.color());
        let roughness = 0.1 + 0.9 * random.unit();
        cases.push(Case { ior, wo, roughness, flags, specular, u: random.units(), ..glass() });
    }
    let answers = device.cases(&cases);
    let pairs: Vec<Case> = cases
        .iter()
        .zip(&answers)
        .filter(|(_, a)| a.ok && a.pdf > 0.0 && a.sampled.z.abs() > 0.02)
        .map(|(c, a)| Case { wi: a.sampled, ..*c })
        .collect();
    let back: Vec<Case> = pairs.iter().map(|c| Case { wo: c.wi, wi: c.wo, ..*c }).collect();
    let mut worst: f64 = 0.0;
    let mut beyond = 0;
    for ((case, a), b) in pairs.iter().zip(device.cases(&pairs)).zip(device.cases(&back)) {
        let index = |w: DVec3| if w.z > 0.0 { 1.0 } else { case.ior };
        let there = a.specular / (case.wi.z.abs() * index(case.wi).powi(2));
        let here = b.specular / (case.wo.z.abs() * index(case.wo).powi(2));
        let error = ((there - here).abs() / (there.max(here) + 1e-3)).max_element();
        // Half vectors of two directions that are nearly opposite are known to 1e-7 / (ior - 1).
        worst = worst.max(error);
        assert!(error < 5e-3, "{error}: {there} and {here} of {case:?}");
        beyond += usize::from(case.wi.z * case.wo.z < 0.0);
    }
    println!("{} pairs, {beyond} of them through; largest relative difference {worst:.1e}", pairs.len());
    assert!(beyond > 1000 && pairs.len() - beyond > 1000, "both kinds");
    device.close();
}

/// Greatest error of glass in a furnace. The lobe of multiple scattering is normalised to rounding (tested in
/// `bsdf_tables::glass`), so the error is that of the table against U; without multiple scattering it is up to two
/// thirds.
const OFF: f64 = 1e-3;

/// Any roughness, index and cosine, most of them where the table bends: near index 1, at grazing angles and about that
/// of total reflection. The chance of multiple scattering is the shader's U; to measure a thousandth, samples would
/// have to be millions.
#[test]
fn any_glass_in_a_white_furnace_disappears() {
    let device = Device::new(ALL);
    let mut random = Random(24);
    let cases: Vec<Case> = (0..1500)
        .map(|_| {
            let roughness = 0.015 + 0.985 * random.unit().powf(1.5);
            let index = 1.0001 + 2.0 * random.unit().powi(3);
            let critical = (1.0 - 1.0 / (index * index)).sqrt();
            let about = critical + 4.0 * roughness * roughness * (random.unit() - 0.5);
            let side = random.pick(&[1.0, -1.0]);
            let cosine = if side < 0.0 && random.unit() < 0.4 { about } else { random.unit().powi(2) };
            let wo = direction(cosine.clamp(1.5e-3, 1.0), 0.3) * side;
            // The inverse index is a denser outside.
            let inverse = random.unit() < 0.3 && index < 2.5;
            let (ior, wo) = if inverse { (1.0 / index, -wo) } else { (index, wo) };
            Case { wo, roughness, ior, ..glass() }
        })
        .collect();
    let normals = oocpt_render::bsdf_tables::glass::VisibleNormals::new(1 << 15);
    let mut worst: f64 = 0.0;
    let mut rough = 0;
    for (case, answer) in cases.iter().zip(device.cases(&cases)) {
        if answer.glass_alpha <= 0.0 {
            continue;
        }
        rough += 1;
        let case = case.rounded();
        let (here, beyond) = indices(&case);
        let known = normals.loss(case.wo.z.abs(), case.roughness * case.roughness, beyond / here);
        let off = (answer.chance[5] - known).abs();
        worst = worst.max(off);
        assert!(off < OFF, "U is {}, not {known}: {case:?}", answer.chance[5]);
    }
    println!("{rough} kinds of rough glass: off by {worst:.1e} at most");
    assert!(rough > 1200, "most are rough: {rough}");
    device.close();
}

/// The furnace by samples, to their accuracy: nothing is lost, and nothing won, on the way to either side.
#[test]
fn glass_in_a_white_furnace_disappears() {
    let device = Device::new(ALL);
    for &ior in few_of(&[0.4, 0.9, 1.0, 1.0001, 1.33, 3.0, 0.7, 1.1, 1.5], 6) {
        for side in [1.0, -1.0] {
            let of = |roughness: f64, c: f64| Case { wo: direction(c, 0.3) * side, roughness, ior, ..glass() };
            let name = format!("glass of ior {ior}, side {side}");
            let (low, high) = furnace_of(&device, &name, of, [16, 2048], 1.0);
            assert!(low >= 1.0 - OFF && high <= 1.0 + OFF, "{name}: {low}..{high}");
        }
    }
    device.close();
}

/// The specular workflow has no compensation: it may lose, and must not win.
#[test]
fn specular_workflow_glass_gains_no_energy() {
    let device = Device::new(ALL);
    for f0 in [0.0, 0.04, 0.3, 1.0] {
        for side in [1.0, -1.0] {
            let of = |roughness: f64, c: f64| {
                let (wo, specular, flags) = (direction(c, 0.3) * side, DVec3::splat(f0), SPECULAR_WORKFLOW);
                Case { wo, roughness, specular, flags, ..glass() }
            };
            let (_, high) =
                furnace_of(&device, &format!("glass of specular colour {f0}, side {side}"), of, [8, 1024], 0.0);
            assert!(high <= 1.001, "specular {f0}, side {side}: {high}");
        }
    }
    device.close();
}

#[test]
fn samples_follow_the_density_on_both_sides() {
    let device = Device::new(ALL);
    let mut seed = 500;
    for ior in [0.6, 1.1, 1.5, 2.5] {
        for (roughness, cosine) in [(0.5, 0.9), (0.6, 0.3), (0.8, 0.15), (1.0, 0.6), (1.0, 0.05), (0.9, 1.0)] {
            for side in [1.0, -1.0] {
                let case = Case { wo: direction(cosine, 0.7) * side, roughness, ior, ..glass() };
                seed += 1;
                // Refraction by ior 1.1 is narrow: bins about it.
                let chart = if ior == 1.1 { Chart::new(-case.wo, 0.15) } else { Chart::new(DVec3::Z, 1.0) };
                test(&device, &format!("glass {ior}, roughness {roughness}, {cosine}, {side}"), &case, &[chart], seed);
            }
        }
    }
    // Total reflection is narrow and alone, so bins of its size suit it.
    let case = Case { wo: -direction(0.4, 0.7), roughness: 0.2, ..glass() };
    let chart = Chart::new(-direction(0.4, 0.7 + PI), 0.04);
    test(&device, "total reflection", &case, &[chart], seed + 1);
    device.close();
}

/// Lobes below the resolution of bins of the whole sphere: each side has its own narrow lobe.
#[test]
fn samples_of_nearly_smooth_glass_follow_the_density() {
    let device = Device::new(ALL);
    let mut seed = 700;
    for roughness in [0.05, 0.1, 0.2] {
        for (ior, cosine, side) in
            [(1.5, 0.9, 1.0), (1.5, 0.4, 1.0), (1.5, 0.9, -1.0), (0.7, 0.9, 1.0), (2.4, 0.3, 1.0)]
        {
            let case = Case { wo: direction(cosine, 0.7) * side, roughness, ior, ..glass() };
            let (here, beyond) = indices(&case);
            let ratio = here / beyond;
            let sine2 = ratio * ratio * (1.0 - cosine * cosine);
            let through = (-ratio * case.wo).with_z(-side * (1.0 - sine2).sqrt());
            seed += 1;
            let alpha = roughness * roughness;
            // By refraction a lobe is turned by about the half vector's turn times 1 - ratio.
            let charts =
                [Chart::twofold(mirror(case.wo), alpha), Chart::twofold(through, alpha * (1.0 - ratio).abs().max(0.2))];
            test(&device, &format!("glass {ior}, roughness {roughness}, {cosine}, {side}"), &case, &charts, seed);
        }
    }
    device.close();
}

/// As roughness decreases the glass becomes Snell's and Fresnel's, and without any roughness the passes need nothing of
/// rough glass.
#[test]
fn rough_glass_converges_to_smooth_glass() {
    let device = Device::new(ALL);
    let sharp = Device::new(SHARP_GLASS);
    for ior in [0.6, 1.33, 1.5, 2.4] {
        for (cosine, side) in [(1.0, 1.0), (0.6, 1.0), (0.3, 1.0), (1.0, -1.0), (0.95, -1.0), (0.5, -1.0)] {
            let smooth = Case { wo: direction(cosine, 0.4) * side, ior, roughness: 0.0, ..glass() };
            let eta = {
                let (here, beyond) = indices(&smooth);
                beyond / here
            };
            let through = sharp.cases(&[smooth])[0].lets_through;
            for roughness in [0.02, 0.04] {
                let case = Case { roughness, ..smooth };
                let samples = device.samples(&case, 1 << 14, 3);
                let mut crossed = 0_u32;
                for [x, y, z, pdf] in &samples {
                    assert!(*pdf != 0.0, "rough: {case:?}");
                    let w = DVec3::new(f64::from(*x), f64::from(*y), f64::from(*z));
                    crossed += u32::from(*pdf > 0.0 && w.z * side < 0.0);
                }
                let share = f64::from(crossed) / f64::from(1 << 14);
                let known = 1.0 - fresnel(cosine, eta);
                assert!((through - known).abs() < 1e-4, "sharp: {through}, not {known}");
                // Four standard deviations, and what the width of the lobe changes.
                let off = 4.0 * (known * (1.0 - known) / f64::from(1 << 14)).sqrt() + 3.0 * roughness * roughness;
                assert!((share - known).abs() < off, "{share} went through, not {known}: {case:?}");
            }
        }
    }
    // Roughness below the resolution is the same to the bit as none.
    let mut random = Random(23);
    let of = |roughness: f64| move |c: Case| Case { roughness, coat: 0.0, opacity: 0.3 * c.opacity, ..c };
    let cases: Vec<Case> = (0..2000).map(|_| random.case()).collect();
    let rough: Vec<Case> = cases.iter().copied().map(of(0.005)).collect();
    for (a, b) in device.cases(&rough).iter().zip(sharp.cases(&rough)) {
        assert_eq!(a.raw, b.raw, "sharp glass needs no rough glass");
    }
    device.close();
    sharp.close();
}
