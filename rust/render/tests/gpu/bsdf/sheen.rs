// SPDX-License-Identifier: Apache-2.0
//! Sheen on top of all else: its definition, reciprocity, a white furnace, samples against densities; and nothing of it
//! without its bit.

use super::cases::{Case, Random, direction};
use super::device::{ALL, Device, PLAIN};
use super::energy::{extremes, furnace, tilted};
use super::sampling::{Chart, test};
use super::values::expect_reciprocal;
use glam::DVec3;
use oocpt_abi::Features;
use std::f64::consts::{PI, TAU};

const ROUGHNESS: [f64; 8] = [0.0, 0.1, 0.13, 0.2, 0.35, 0.5, 0.75, 1.0];
const COSINE: [f64; 7] = [0.01, 0.03, 0.1, 0.3, 0.6, 0.9, 1.0];

fn grid(of: impl Fn(f64, f64) -> Case) -> Vec<Case> {
    ROUGHNESS.iter().flat_map(|r| COSINE.iter().map(|c| of(*r, *c)).collect::<Vec<_>>()).collect()
}

/// White sheen on black that reflects nothing.
fn sheen(sheen_roughness: f64, wo: DVec3) -> Case {
    Case { sheen: DVec3::ONE, sheen_roughness, wo, diffuse: DVec3::ZERO, ior: 1.0, ..Case::default() }
}

/// The lobe as the head of `shaders/material/bsdf/sheen.glsl` defines it, but for its scale; half vectors normalised,
/// angles.
fn lobe(roughness: f64, o: DVec3, i: DVec3) -> f64 {
    let power = 1.0 / roughness.max(0.1);
    let sine = (o + i).normalize().truncate().length();
    (2.0 + power) * sine.powf(power) / TAU / (4.0 * (o.z + i.z - o.z * i.z)) * i.z
}

/// The albedo of the lobe, by a midpoint rule over angles.
fn albedo(roughness: f64, o: DVec3) -> f64 {
    const STEPS: [i32; 2] = [600, 600];
    let mut sum = 0.0;
    for a in 0..STEPS[0] {
        for b in 0..STEPS[1] {
            let turn = TAU * (f64::from(a) + 0.5) / f64::from(STEPS[0]);
            let angle = 0.5 * PI * (f64::from(b) + 0.5) / f64::from(STEPS[1]);
            sum += lobe(roughness, o, direction(angle.cos(), turn)) * angle.sin();
        }
    }
    sum * TAU * 0.5 * PI / f64::from(STEPS[0] * STEPS[1])
}

#[test]
fn sheen_values_match_the_f64_definition() {
    let device = Device::new(PLAIN | Features::SHEEN);
    let mut random = Random(41);
    for roughness in ROUGHNESS {
        // The scale is 1 unless the lobe reflects more than it receives at grazing angles.
        let most = albedo(roughness, direction(1e-6, 0.0));
        let (least, largest) = if most > 1.0 { (0.99 / most, 1.01 / most) } else { (1.0 - 1e-5, 1.0 + 1e-5) };
        let cases: Vec<Case> = (0..200)
            .map(|_| {
                let wo = direction(0.02 + 0.98 * random.unit(), TAU * random.unit());
                Case { wi: direction(0.02 + 0.98 * random.unit(), TAU * random.unit()), ..sheen(roughness, wo) }
            })
            .collect();
        for (case, answer) in cases.iter().zip(device.cases(&cases)) {
            let case = case.rounded();
            let known = lobe(case.sheen_roughness, case.wo, case.wi);
            let found = answer.specular.x;
            let within = |scale: f64| (found - scale * known).abs() <= 2e-4 * known + 1e-6;
            assert!(within(1.0) || found > least * known && found < largest * known, "{found}, not {known}: {case:?}");
        }
    }
    device.close();
}

/// By itself it reflects the integral of its definition; with all layers below, it never gains, and white loses little.
#[test]
fn sheen_in_a_white_furnace() {
    let device = Device::new(ALL | Features::SHEEN);
    for roughness in [0.25, 0.4, 0.6, 1.0] {
        let cases: Vec<Case> = COSINE.iter().map(|c| sheen(roughness, direction(*c, 0.3))).collect();
        for (case, (found, error, _)) in cases.iter().zip(device.albedos(&cases, 16, 4096)) {
            let known = albedo(roughness, case.wo);
            assert!((found.x - known).abs() < 1e-3 + 4.0 * error, "{} +- {error}, not {known}: {case:?}", found.x);
        }
    }
    let white = |sheen_roughness: f64, c: f64| Case {
        wo: direction(c, 0.3),
        sheen: DVec3::ONE,
        sheen_roughness,
        ..Case::default()
    };
    // A white diffuse base reflects all that sheen lets through.
    let lambert = grid(|r, c| Case { ior: 1.0, ..white(r, c) });
    for case in &lambert {
        // A midpoint rule is used, denser at the horizon: samples of a low-discrepancy sequence err by more than their
        // spread.
        const STEPS: [i32; 2] = [128, 192];
        let place = |i: i32| {
            let root = (f64::from(i % STEPS[0]) + 0.5) / f64::from(STEPS[0]);
            (root, TAU * (f64::from(i / STEPS[0]) + 0.5) / f64::from(STEPS[1]))
        };
        let places: Vec<(f64, f64)> = (0..STEPS[0] * STEPS[1]).map(place).collect();
        let directions: Vec<DVec3> = places.iter().map(|(root, turn)| direction(root * root, *turn)).collect();
        let sum: f64 =
            device.grid(case, &directions).iter().zip(&places).map(|(v, (root, _))| f64::from(v[0]) * 2.0 * root).sum();
        let albedo = sum * TAU / f64::from(STEPS[0] * STEPS[1]);
        assert!((albedo - 1.0).abs() < 1e-3, "sheen on white: {albedo} of {case:?}");
    }
    for (name, bound, of) in [
        ("plastic", 0.97, Box::new(|c| c) as Box<dyn Fn(Case) -> Case>),
        ("coat", 0.93, Box::new(|c| Case { coat: 1.0, coat_roughness: 0.3, ..c })),
        ("metal", 0.80, Box::new(|c| Case { metallic: 1.0, ..c })),
        ("mirror", 0.80, Box::new(|c| Case { metallic: 1.0, roughness: 0.0, ..c })),
        ("half glass", 0.97, Box::new(|c| Case { opacity: 0.5, ..c })),
    ] {
        let cases = grid(|r, c| of(white(r, c)));
        let (low, _) = furnace(&device, &format!("sheen on {name}"), &cases, 16, 1024);
        assert!(low >= bound, "sheen on {name}: {low}");
    }
    device.close();
}

fn any(random: &mut Random, case: Case) -> Case {
    Case { sheen: random.color() * random.pick(&[1.0, 1.0, 0.0]), sheen_roughness: random.unit(), ..case }
}

#[test]
fn sheen_gains_no_energy_whatever_is_below() {
    let device = Device::new(ALL | Features::SHEEN);
    let mut random = Random(42);
    let mut make = |of: fn(&mut Random) -> Case| -> Vec<Case> {
        (0..1000)
            .map(|_| {
                let case = of(&mut random);
                any(&mut random, case)
            })
            .collect()
    };
    let (flat, bent) = (make(Random::case), make(tilted));
    furnace(&device, "random", &flat, 8, 512);
    furnace(&device, "random, normals that differ", &bent, 8, 512);
    device.close();
}

#[test]
fn sheen_and_what_is_below_is_reciprocal() {
    let device = Device::new(ALL | Features::SHEEN);
    let mut random = Random(43);
    let cases: Vec<Case> = (0..20_000)
        .map(|_| {
            let case = random.case();
            any(&mut random, case)
        })
        .collect();
    expect_reciprocal(&device, &cases);
    device.close();
}

#[test]
fn samples_follow_the_density() {
    let device = Device::new(ALL | Features::SHEEN);
    let mut seed = 900;
    for roughness in [0.07, 0.2, 0.5, 1.0] {
        for cosine in [0.02, 0.1, 0.3, 0.6, 0.95] {
            let only = sheen(roughness, direction(cosine, 0.7));
            for (name, case) in [
                ("alone", only),
                ("on plastic", Case { diffuse: DVec3::splat(0.5), ior: 1.5, roughness: 0.7, ..only }),
                ("on a sharp metal", Case { diffuse: DVec3::ONE, metallic: 1.0, roughness: 0.0, ..only }),
                ("and sharp glass", Case { diffuse: DVec3::ONE, ior: 1.5, opacity: 0.4, roughness: 0.0, ..only }),
            ] {
                seed += 1;
                let told = format!("sheen {roughness} {name}, cosine {cosine}");
                test(&device, &told, &case, &[Chart::new(DVec3::Z, 1.0)], seed);
                let answer = device.cases(&[case])[0];
                assert!(answer.chance_sheen > 0.0, "{told}: it is sampled");
            }
        }
    }
    device.close();
}

/// Weights have a bound, so samples are good also where the lobe is narrow.
#[test]
fn sheen_sample_weights_are_bounded() {
    let device = Device::new(PLAIN | Features::SHEEN);
    let mut random = Random(44);
    let cases: Vec<Case> = (0..50_000)
        .map(|_| Case {
            u: random.units(),
            ..sheen(random.unit(), direction(0.002 + random.unit().powi(2) * 0.998, 1.0))
        })
        .collect();
    let mut worst: f64 = 0.0;
    for (case, answer) in cases.iter().zip(device.cases(&cases)) {
        if answer.ok {
            let most = 0.5 * (2.0 + 1.0 / case.sheen_roughness.max(0.1));
            worst = worst.max(answer.weight.x / most);
            assert!(answer.weight.x <= most, "{answer:?} of {case:?}");
        }
    }
    println!("weights up to {worst:.2} of their bound");
    device.close();
}

/// Without the bit the pass has no table of sheen (its address is 0), and its results are those without colour of
/// sheen, to the bit.
#[test]
fn without_the_feature_bit_sheen_is_absent() {
    let without = Device::new(ALL);
    let with = Device::new(ALL | Features::SHEEN);
    let mut random = Random(45);
    let bare: Vec<Case> = (0..5000).map(|_| random.case()).collect();
    let asked: Vec<Case> = bare.iter().map(|c| Case { sheen: DVec3::ONE, sheen_roughness: 0.3, ..*c }).collect();
    let expected = without.cases(&bare);
    for (answer, expected) in without.cases(&asked).iter().zip(&expected) {
        assert_eq!(answer.raw, expected.raw, "colour of sheen does not count");
    }
    let mut differ = 0;
    for ((bare, asked), expected) in with.cases(&bare).iter().zip(with.cases(&asked)).zip(&expected) {
        assert_eq!(bare.raw, expected.raw, "no colour, no sheen");
        differ += usize::from(asked.raw != expected.raw);
    }
    assert!(differ > 4000, "it counts where it is asked for: {differ}");
    let (low, high) = extremes(&with, "no sheen", &[Case { ior: 1.0, ..Case::default() }], 4, 512, 1.0);
    assert!((low - 1.0).abs() < 1e-3 && (high - 1.0).abs() < 1e-3, "white stays white: {low}..{high}");
    without.close();
    with.close();
}
