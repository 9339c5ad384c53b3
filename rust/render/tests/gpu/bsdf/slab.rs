// SPDX-License-Identifier: Apache-2.0
//! Anisotropy, thin films, thin walls: against their definitions in f64, energy, reciprocity, sampling; and nothing of
//! them without their bits.

use super::cases::{Case, Random, direction};
use super::device::{ALL, Device};
use super::energy::furnace;
use super::sampling::{Chart, test};
use super::values::expect_reciprocal;
use glam::{DVec2, DVec3};
use oocpt_abi::Features;
use std::f64::consts::{PI, TAU};

/// `SHADING_THIN_WALLED`.
const THIN: u32 = 8;

const ANISOTROPIC: Features = ALL.union(Features::OPEN_PBR).union(Features::ANISOTROPY);
const FILMS: Features = ALL.union(Features::OPEN_PBR).union(Features::THIN_FILM);
const WALLS: Features = FILMS.union(Features::THIN_WALLS);

/// A metal whose alphas differ.
fn metal(roughness: f64, ratio: f64, wo: DVec3) -> Case {
    Case { roughness, wo, metallic: 1.0, anisotropy: [ratio, 0.0, 1.0, 0.0], ..Case::default() }
}

/// Single scattering of F = 1 times cosine: Heitz (2014), eq. 85 and 99, alphas as `OpenPBR` has them.
fn lobe(roughness: f64, ratio: f64, turn: f64, o: DVec3, i: DVec3) -> f64 {
    let along = roughness * roughness * (2.0 / (1.0 + ratio * ratio)).sqrt();
    let alphas = DVec2::new(along, along * ratio);
    let turned = |w: DVec3| DVec2::from_angle(-TAU * turn).rotate(w.truncate()).extend(w.z);
    let (o, i) = (turned(o), turned(i));
    let h = (o + i).normalize();
    let spread = (h.truncate() / alphas).length_squared() + h.z * h.z;
    let density = 1.0 / (PI * alphas.x * alphas.y * spread * spread);
    let lambda = |w: DVec3| 0.5 * ((1.0 + (w.truncate() * alphas).length_squared() / (w.z * w.z)).sqrt() - 1.0);
    density / (1.0 + lambda(o) + lambda(i)) / (4.0 * o.z)
}

/// Only the lobe itself differs from the isotropic one of the same roughness: all else uses its tables.
#[test]
fn anisotropic_lobes_match_the_f64_definition() {
    let device = Device::new(ANISOTROPIC);
    let mut random = Random(51);
    let cases: Vec<Case> = (0..4000)
        .map(|_| {
            let up = |random: &mut Random| direction(0.1 + 0.9 * random.unit(), TAU * random.unit());
            let (wo, wi) = (up(&mut random), up(&mut random));
            let ratio = 0.02 + 0.97 * random.unit();
            let anisotropy = [ratio, random.unit() * 2.0 - 1.0, 1.0, 0.0];
            Case { wi, anisotropy, ..metal(0.2 + 0.8 * random.unit(), ratio, wo) }.rounded()
        })
        .collect();
    let even: Vec<Case> = cases.iter().map(|case| Case { anisotropy: [1.0, 0.0, 1.0, 0.0], ..*case }).collect();
    let mut worst: f64 = 0.0;
    for ((case, found), plain) in cases.iter().zip(device.cases(&cases)).zip(device.cases(&even)) {
        let [ratio, turn, ..] = case.anisotropy;
        let known = lobe(case.roughness, ratio, turn, case.wo, case.wi);
        let scattered = plain.specular.x - lobe(case.roughness, 1.0, 0.0, case.wo, case.wi);
        let error = (found.specular.x - scattered - known).abs() / (known + 0.05);
        worst = worst.max(error);
        assert!(error < 2e-3, "{} less {scattered}, not {known}: {case:?}", found.specular.x);
    }
    println!("largest error {worst:.1e}");
    device.close();
}

/// White metal in a white furnace: the tables are those of an isotropic lobe. Stated in the head of `bsdf.glsl`.
#[test]
fn anisotropic_lobes_in_a_white_furnace() {
    let device = Device::new(ANISOTROPIC);
    let (mut most, mut mean_off): (f64, f64) = (0.0, 0.0);
    for roughness in [0.1, 0.3, 0.5, 0.8, 1.0] {
        for ratio in [0.05, 0.2, 0.5, 0.9] {
            for cosine in [0.05, 0.15, 0.4, 0.9] {
                let around: Vec<Case> = (0..16)
                    .map(|k| metal(roughness, ratio, direction(cosine, TAU * (f64::from(k) + 0.5) / 16.0)))
                    .collect();
                let albedos: Vec<f64> = device.albedos(&around, 4, 2048).iter().map(|(a, ..)| a.x).collect();
                let mean = albedos.iter().sum::<f64>() / 16.0;
                most = albedos.iter().copied().fold(most, f64::max);
                // At grazing angles light seen across the narrow axis is lost.
                if cosine > 0.3 {
                    mean_off = mean_off.max((mean - 1.0).abs());
                }
                assert!(mean > 0.8 && mean < 1.07, "roughness {roughness}, ratio {ratio}, cosine {cosine}: {mean}");
            }
        }
    }
    println!("largest albedo {most:.3}, means at cosines above 0.3 off by {mean_off:.3}");
    assert!(most < 1.12 && mean_off < 0.07, "{most}, {mean_off}");
    device.close();
}

/// A random case with all features of this file.
fn any(random: &mut Random) -> Case {
    let anisotropy = [random.unit(), random.unit(), random.unit(), random.unit()];
    let film = DVec3::new(random.unit(), 1000.0 * random.unit(), 1.0 + random.unit());
    let case = random.case();
    let flags = case.flags | if random.unit() < 0.5 { THIN } else { 0 };
    Case { anisotropy, film, flags, ..case }
}

#[test]
fn slabs_are_reciprocal() {
    let device = Device::new(WALLS | Features::ANISOTROPY | Features::SHEEN);
    let mut random = Random(52);
    let cases: Vec<Case> = (0..20_000).map(|_| any(&mut random)).collect();
    expect_reciprocal(&device, &cases);
    device.close();
}

#[test]
fn samples_of_slabs_follow_the_density() {
    let device = Device::new(WALLS | Features::ANISOTROPY);
    let mut seed = 5000;
    for ratio in [0.1, 0.6] {
        for (cosine, angle) in [(0.1, 0.2), (0.4, 1.0), (0.9, 2.0)] {
            seed += 1;
            let wo = direction(cosine, angle);
            let case = Case { anisotropy: [ratio, 0.1, 1.0, 0.0], ..metal(0.7, ratio, wo) };
            test(&device, &format!("ratio {ratio}, cosine {cosine}"), &case, &[Chart::new(DVec3::Z, 1.0)], seed);
            let coated = Case {
                coat: 1.0,
                coat_roughness: 0.6,
                anisotropy: [0.5, 0.0, ratio, 0.2],
                diffuse: DVec3::splat(0.5),
                ..metal(0.8, 0.5, wo)
            };
            test(&device, &format!("coat {ratio}, cosine {cosine}"), &coated, &[Chart::new(DVec3::Z, 1.0)], seed + 500);
            let wall = Case { wo, roughness: 0.6, opacity: 0.0, flags: THIN, ..Case::default() };
            test(&device, &format!("wall, cosine {cosine}"), &wall, &[Chart::new(DVec3::Z, 1.0)], seed + 900);
        }
    }
    device.close();
}

/// Reflectance of a film by Airy's sum in full, averaged over each channel's band.
fn airy(film: DVec3, f0: f64, cosine: f64) -> DVec3 {
    let (thickness, n) = (film.y, film.z);
    let inner = (1.0 - (1.0 - cosine * cosine) / (n * n)).sqrt();
    let root = f0.min(0.98).sqrt();
    let base = (1.0 + root) / (1.0 - root);
    let head_on = (n - base) / (n + base);
    let r2_squared = head_on * head_on + (1.0 - head_on * head_on) * (1.0 - inner).powi(5);
    let r2 = head_on.signum() * r2_squared.sqrt();
    let of = |wavenumber: f64| {
        let phase = TAU * 2.0 * n * thickness * inner * wavenumber;
        let pair =
            [((cosine - n * inner) / (cosine + n * inner), r2), ((n * cosine - inner) / (n * cosine + inner), -r2)];
        pair.iter()
            .map(|(r1, r2)| {
                let x = r1 * r2;
                1.0 - (1.0 - r1 * r1) * (1.0 - r2 * r2) / (1.0 + x * x + 2.0 * x * phase.cos())
            })
            .sum::<f64>()
            * 0.5
    };
    // Even parts of the band: its distribution function is an arc tangent.
    let band = |wavelength: f64, half_width: f64| {
        let (middle, width) = (1.0 / wavelength, half_width / (wavelength * wavelength));
        let parts = 4000;
        let at = |k: i32| PI * ((f64::from(k) + 0.5) / f64::from(parts) - 0.5);
        (0..parts).map(|k| of(middle + width * at(k).tan())).sum::<f64>() / f64::from(parts)
    };
    DVec3::new(band(600.0, 20.0), band(546.0, 20.0), band(450.0, 15.0))
}

#[test]
fn thin_films_match_the_f64_definition() {
    let device = Device::new(FILMS);
    let mut random = Random(53);
    let mut worst: f64 = 0.0;
    let mut spread: f64 = 0.0;
    let cases: Vec<Case> = (0..3000)
        .map(|_| {
            let wo = direction(0.02 + 0.98 * random.unit(), TAU * random.unit());
            let film = DVec3::new(1.0, 1200.0 * random.unit(), 1.2 + 0.8 * random.unit());
            let diffuse = DVec3::splat(0.02 + 0.9 * random.unit());
            Case { wo, film, diffuse, metallic: 1.0, roughness: 0.0, ..Case::default() }.rounded()
        })
        .collect();
    for (case, answer) in cases.iter().zip(device.cases(&cases)) {
        let known = airy(case.film, case.diffuse.x, case.wo.z);
        let error = (answer.weight - known).abs().max_element();
        worst = worst.max(error);
        spread = spread.max(known.max_element() - known.min_element());
        // The bound is the accuracy of the reference's sum, far from the middle of a band.
        assert!(answer.ok && error < 5e-3, "{}, not {known}: {case:?}", answer.weight);
    }
    println!("largest error {worst:.1e}; channels differ by up to {spread:.2}");
    assert!(spread > 0.2, "films have colours: {spread}");
    device.close();
}

/// Light that a sheet does not reflect goes straight on, and none is lost of a sharp one.
#[test]
fn thin_walls_do_not_refract() {
    let device = Device::new(WALLS);
    let mut random = Random(54);
    let wall = |random: &mut Random| {
        let wo = direction(0.02 + 0.98 * random.unit(), TAU * random.unit()) * random.pick(&[1.0, -1.0]);
        let ior = 1.0 + random.unit();
        Case { wo, ior, opacity: 0.0, roughness: 0.0, flags: THIN, u: random.units(), ..Case::default() }
    };
    let cases: Vec<Case> = (0..3000).map(|_| wall(&mut random)).collect();
    let mut through = 0;
    for (case, answer) in cases.iter().zip(device.cases(&cases)) {
        assert!(answer.ok && (answer.weight - DVec3::ONE).abs().max_element() < 1e-5, "{answer:?} of {case:?}");
        if answer.sampled.z * case.wo.z < 0.0 {
            through += 1;
            assert!((answer.sampled + case.wo).length() < 1e-6, "{answer:?} of {case:?}");
        }
        // R + R (1 - R)^2 / (1 - R^2) of both interfaces.
        let cosine = case.wo.z.abs();
        let inner = (1.0 - (1.0 - cosine * cosine) / (case.ior * case.ior)).sqrt();
        let (s, p) = (
            (cosine - case.ior * inner) / (cosine + case.ior * inner),
            (case.ior * cosine - inner) / (case.ior * cosine + inner),
        );
        let r = 0.5 * (s * s + p * p);
        let known = 1.0 - (r + r * (1.0 - r).powi(2) / (1.0 - r * r));
        assert!((answer.lets_through - known).abs() < 1e-4, "{}, not {known}: {case:?}", answer.lets_through);
    }
    assert!(through > 1000, "{through} go through");
    let rough: Vec<Case> = [0.0, 0.1, 0.3, 0.6, 1.0]
        .iter()
        .flat_map(|roughness| [0.05, 0.3, 0.7, 1.0].map(|c| (*roughness, c)))
        .map(|(roughness, c)| Case {
            roughness,
            wo: direction(c, 0.3),
            opacity: 0.0,
            flags: THIN,
            film: DVec3::new(1.0, 400.0, 1.4),
            ..Case::default()
        })
        .collect();
    let (least, _) = furnace(&device, "walls", &rough, 8, 2048);
    assert!(least > 0.99, "none is lost: {least}");
    device.close();
}

/// Without the bits, and with them in cases that do not use them, the results are the same to the bit.
#[test]
fn without_feature_bits_slab_lobes_are_absent() {
    let without = Device::new(ALL | Features::OPEN_PBR);
    let with = Device::new(WALLS | Features::ANISOTROPY);
    let mut random = Random(55);
    let bare: Vec<Case> = (0..5000).map(|_| random.case()).collect();
    let asked: Vec<Case> = bare
        .iter()
        .map(|c| Case { anisotropy: [0.3, 0.1, 0.4, 0.0], film: DVec3::new(1.0, 400.0, 1.5), ..*c })
        .collect();
    let expected = without.cases(&bare);
    for (answer, expected) in without.cases(&asked).iter().zip(&expected) {
        assert_eq!(answer.raw, expected.raw, "they do not count");
    }
    // Another pipeline: compilers for GPUs fuse other products in it, and a choice at an edge may go the other way.
    let is_near = |a: &f32, b: &f32| a == b || (a - b).abs() <= 1e-3 * (1e-3 + a.abs().max(b.abs()));
    let (mut off, mut differ) = (0, 0);
    for ((bare, asked), expected) in with.cases(&bare).iter().zip(with.cases(&asked)).zip(&expected) {
        off += usize::from(!bare.raw.iter().zip(&expected.raw).all(|(a, b)| is_near(a, b)));
        differ += usize::from(!asked.raw.iter().zip(&expected.raw).all(|(a, b)| is_near(a, b)));
    }
    assert!(off < 25, "nothing is asked for: {off} of 5000 differ");
    assert!(differ > 4000, "they count where they are asked for: {differ}");
    without.close();
    with.close();
}
