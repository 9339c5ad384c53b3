// SPDX-License-Identifier: Apache-2.0
//! Rough diffuse reflection (`shaders/material/bsdf/eon.glsl`): values in f64 with albedos by quadrature, white
//! furnace, reciprocity, sampling; roughness 0 is Lambert, bit for bit.

use super::cases::{Case, Random, SPECULAR_WORKFLOW, direction};
use super::device::{ALL, Device, PLAIN};
use super::energy::{extremes, tilted};
use super::sampling::{Chart, test};
use super::values::expect_reciprocal;
use glam::DVec3;
use oocpt_abi::Features;
use std::f64::consts::{PI, TAU};

const ROUGH: Features = PLAIN.union(Features::OPEN_PBR).union(Features::ROUGH_DIFFUSE);
const LAYERED: Features = ALL.union(Features::OPEN_PBR).union(Features::ROUGH_DIFFUSE);

/// A case with only the diffuse lobe.
fn bare(diffuse_roughness: f64, wo: DVec3) -> Case {
    Case { diffuse_roughness, wo, flags: SPECULAR_WORKFLOW, ..Case::default() }
}

/// f pi of single scattering for white: Portsmouth et al. 2025, eq. 11 to 13.
fn single(r: f64, o: DVec3, i: DVec3) -> f64 {
    let s = o.dot(i) - o.z * i.z;
    let t = if s > 0.0 { o.z.max(i.z) } else { 1.0 };
    (1.0 + r * s / t) / (1.0 + r * (0.5 - 2.0 / (3.0 * PI)))
}

/// The albedo of single scattering, by midpoints over the hemisphere.
fn albedo(r: f64, cosine: f64) -> f64 {
    const STEPS: u32 = 400;
    let o = direction(cosine, 0.0);
    let at = |k: u32| (f64::from(k) + 0.5) / f64::from(STEPS);
    let ring = |theta: f64| {
        let sum: f64 = (0..STEPS).map(|b| single(r, o, direction(theta.cos(), PI * at(b)))).sum();
        2.0 * theta.sin() * theta.cos() * sum / f64::from(STEPS)
    };
    let quarter = 0.5 * PI;
    (0..STEPS).map(|a| ring(quarter * at(a)) * quarter / f64::from(STEPS)).sum()
}

#[test]
fn eon_values_match_the_f64_definition() {
    let device = Device::new(ROUGH);
    let mut random = Random(61);
    let cases: Vec<Case> = (0..60)
        .map(|_| {
            let up = |random: &mut Random| direction(0.02 + 0.98 * random.unit(), TAU * random.unit());
            let (wo, wi) = (up(&mut random), up(&mut random));
            Case { wi, diffuse: random.color(), ..bare(random.unit(), wo) }.rounded()
        })
        .collect();
    let mut worst = 0.0_f64;
    for (case, answer) in cases.iter().zip(device.cases(&cases)) {
        let (r, c) = (case.diffuse_roughness, case.diffuse);
        let (o, i) = (albedo(r, case.wo.z), albedo(r, case.wi.z));
        // The average, by its own quadrature.
        let average = (0..64_u32).map(|k| (f64::from(k) + 0.5) / 64.0).map(|x| albedo(r, x.sqrt()) / 64.0).sum::<f64>();
        let scattered = c * c * average / (DVec3::ONE - c * (1.0 - average));
        let more = scattered * ((1.0 - o) * (1.0 - i) / (1.0 - average));
        let known = (c * single(r, case.wo, case.wi) + more) * (case.wi.z / PI);
        let off = (known - answer.diffuse).abs().max_element() / (known.max_element() + 1e-3);
        worst = worst.max(off);
        assert!(off < 2e-3, "{}, not {known} of {case:?}", answer.diffuse);
        assert!((answer.given_pdf - case.wi.z / PI).abs() < 1e-5, "the density is Lambert's");
    }
    println!("largest relative error {worst:.1e}");
    device.close();
}

/// White reflects all at every roughness; under a coat or a dielectric the base is not Lambert's, and the albedo is off
/// by as much as the book states.
#[test]
fn a_white_rough_surface_in_a_white_furnace_disappears() {
    let (device, layered) = (Device::new(ROUGH), Device::new(LAYERED));
    let over = |of: &dyn Fn(f64, f64) -> Case| -> Vec<Case> {
        let cosines = [0.02, 0.1, 0.3, 0.6, 0.9, 1.0];
        [0.05, 0.3, 0.7, 1.0].iter().flat_map(|r| cosines.map(|c| of(*r, c))).collect()
    };
    let (least, most) = extremes(&device, "bare", &over(&|r, c| bare(r, direction(c, 0.3))), 16, 1 << 12, 1.0);
    assert!(least >= 0.999 && most <= 1.001, "{least}..{most}");
    let plastic = over(&|r, c| Case { flags: 0, roughness: 0.3, ..bare(r, direction(c, 0.3)) });
    let (least, most) = extremes(&layered, "plastic", &plastic, 16, 1 << 12, 0.98);
    assert!(least >= 0.97 && most <= 1.01, "plastic: {least}..{most}");
    let coated = over(&|r, c| Case { flags: 0, coat: 1.0, coat_roughness: 0.2, ..bare(r, direction(c, 0.3)) });
    let (least, most) = extremes(&layered, "coated", &coated, 16, 1 << 12, 0.95);
    assert!(least >= 0.94 && most <= 1.01, "coated: {least}..{most}");
    device.close();
    layered.close();
}

#[test]
fn zero_roughness_is_lambert_bit_for_bit() {
    let mut random = Random(62);
    let cases: Vec<Case> = (0..4000).map(|k| if k % 2 == 0 { random.case() } else { tilted(&mut random) }).collect();
    let [without, with] = [ALL.union(Features::OPEN_PBR), LAYERED].map(|features| {
        let device = Device::new(features);
        let answers: Vec<Vec<u32>> =
            device.cases(&cases).iter().map(|answer| answer.raw.map(f32::to_bits).to_vec()).collect();
        device.close();
        answers
    });
    assert!(without == with, "a feature that is not asked for changes values");
    let device = Device::new(LAYERED);
    let rough: Vec<Case> = cases.iter().map(|case| Case { diffuse_roughness: 0.5, ..*case }).collect();
    let changed = device.cases(&rough).iter().zip(&with).filter(|(a, b)| a.raw.map(f32::to_bits)[..] != b[..]).count();
    assert!(changed > 1500, "roughness changes only {changed} of the cases");
    device.close();
}

#[test]
fn rough_diffuse_surfaces_are_reciprocal() {
    let device = Device::new(LAYERED);
    let mut random = Random(63);
    let cases: Vec<Case> = (0..20_000).map(|_| Case { diffuse_roughness: random.unit(), ..random.case() }).collect();
    expect_reciprocal(&device, &cases);
    device.close();
}

#[test]
fn samples_of_rough_diffuse_surfaces_follow_the_density() {
    let device = Device::new(LAYERED);
    let mut seed = 9000;
    for roughness in [0.3, 1.0] {
        for cosine in [0.1, 0.5, 0.95] {
            let wo = direction(cosine, 1.0);
            for case in [bare(roughness, wo), Case { flags: 0, roughness: 0.6, ..bare(roughness, wo) }] {
                seed += 1;
                let name = format!("diffuse roughness {roughness}, cosine {cosine}");
                test(&device, &name, &case, &[Chart::new(DVec3::Z, 1.0)], seed);
                // Samples are weighted by the evaluation of their direction.
                for answer in device.cases(&[Case { u: [0.3, 0.6, 0.4], ..case }]) {
                    let known = answer.value / answer.value_pdf;
                    assert!(answer.ok && answer.weight.distance(known) < 1e-5, "{name}: {answer:?}");
                }
            }
        }
    }
    device.close();
}

#[test]
fn out_of_range_roughness_gives_finite_values() {
    let device = Device::new(LAYERED);
    let mut random = Random(64);
    let odd = [0.0, 1.0, -1.0, 1e-30, 1e30, f64::NAN, f64::INFINITY];
    let cases: Vec<Case> =
        (0..20_000).map(|_| Case { diffuse_roughness: random.pick(&odd), ..tilted(&mut random) }).collect();
    for (case, answer) in cases.iter().zip(device.cases(&cases)) {
        assert!(answer.raw.iter().all(|x| x.is_finite()), "{answer:?} of {case:?}");
        assert!(answer.raw[4..].iter().all(|x| *x >= 0.0), "{answer:?} of {case:?}");
    }
    device.close();
}
