// SPDX-License-Identifier: Apache-2.0
//! White furnace, and no gain of energy with any parameters.

use super::cases::{Case, Random, SPECULAR_WORKFLOW, direction};
use super::device::{ALL, Device, PLAIN};
use crate::support::few_of;
use glam::DVec3;

const ROUGHNESS: [f64; 11] = [0.0, 0.01, 0.03, 0.05, 0.1, 0.2, 0.35, 0.5, 0.7, 0.9, 1.0];
const COSINE: [f64; 7] = [0.01, 0.03, 0.1, 0.3, 0.6, 0.9, 1.0];
/// Energy that may be gained by rounding and interpolation of the albedo table.
const GAIN: f64 = 1e-3;

/// Asserts that nothing gains; see [`extremes`].
pub(super) fn furnace(device: &Device, name: &str, cases: &[Case], parts: usize, points: u32) -> (f64, f64) {
    let found = extremes(device, name, cases, parts, points, 0.0);
    assert!(found.1 <= 1.0 + GAIN, "{name} gains: {found:?}");
    found
}

/// [`extremes`] over all roughnesses and cosines.
pub(super) fn furnace_of(
    device: &Device,
    name: &str,
    of: impl Fn(f64, f64) -> Case,
    points: [u32; 2],
    least: f64,
) -> (f64, f64) {
    extremes(device, name, &grid(of), points[0] as usize, points[1], least)
}

/// Prints and returns least and largest albedo, each by four standard errors nearer to the other. `least`: what no
/// albedo should be below.
pub(super) fn extremes(
    device: &Device,
    name: &str,
    cases: &[Case],
    parts: usize,
    points: u32,
    least: f64,
) -> (f64, f64) {
    let mut albedos = device.albedos(cases, parts, points);
    // Apparent gains or losses are measured again with more samples: the error estimates of a few sets of points are
    // rough themselves.
    let seems = |albedo: DVec3| albedo.max_element() > 1.0 + GAIN || albedo.min_element() < least - GAIN;
    let suspects: Vec<usize> = (0..cases.len()).filter(|i| seems(albedos[*i].0)).collect();
    let again: Vec<Case> = suspects.iter().map(|i| cases[*i]).collect();
    if !again.is_empty() {
        for (i, albedo) in suspects.into_iter().zip(device.albedos(&again, 64, 1 << 13)) {
            albedos[i] = albedo;
        }
    }
    let mut extremes = (f64::INFINITY, f64::NEG_INFINITY);
    let mut noise: f64 = 0.0;
    for (case, (albedo, error, _)) in cases.iter().zip(&albedos) {
        assert!(albedo.is_finite(), "{name}: {case:?}");
        if albedo.max_element() > 1.0 + GAIN + 4.0 * error {
            println!("{name} gains: {albedo} +- {error:e} of {case:?}");
        }
        extremes =
            (extremes.0.min(albedo.min_element() + 4.0 * error), extremes.1.max(albedo.max_element() - 4.0 * error));
        noise = noise.max(*error);
    }
    println!("{name}: {:.5}..{:.5}, largest standard error {noise:.1e}", extremes.0, extremes.1);
    extremes
}

fn grid(of: impl Fn(f64, f64) -> Case) -> Vec<Case> {
    ROUGHNESS.iter().flat_map(|r| COSINE.iter().map(|c| of(*r, *c)).collect::<Vec<_>>()).collect()
}

#[test]
fn a_white_surface_in_a_white_furnace_disappears() {
    let device = Device::new(PLAIN);
    for metallic in [0.0, 0.5, 1.0] {
        let iors: &[f64] = if metallic == 1.0 { &[1.5] } else { &[1.0, 1.0001, 1.33, 1.5, 3.0] };
        for &ior in iors {
            let cases =
                grid(|roughness, c| Case { wo: direction(c, 0.3), roughness, ior, metallic, ..Case::default() });
            let (least, _) = furnace(&device, &format!("metallic {metallic}, ior {ior}"), &cases, 8, 4096);
            assert!(least >= 0.998, "metallic {metallic}, ior {ior}: {least}");
        }
    }
    for f0 in [0.0, 1e-4, 0.04, 0.5, 1.0] {
        let specular = DVec3::splat(f0);
        let flags = SPECULAR_WORKFLOW;
        let cases = grid(|roughness, c| Case { wo: direction(c, 0.3), roughness, specular, flags, ..Case::default() });
        let (least, _) = furnace(&device, &format!("specular {f0}"), &cases, 8, 4096);
        assert!(least >= 0.998, "specular {f0}: {least}");
    }
    device.close();
}

#[test]
fn a_coat_and_glass_in_a_white_furnace() {
    let device = Device::new(ALL);
    for &coat_roughness in few_of(&[0.0, 0.1, 1.0, 0.01, 0.4], 3) {
        for (metallic, bound) in [(0.0, 0.98), (1.0, 0.95)] {
            let cases = grid(|roughness, c| Case {
                wo: direction(c, 0.3),
                roughness,
                coat: 1.0,
                coat_roughness,
                metallic,
                ..Case::default()
            });
            let (least, _) =
                furnace(&device, &format!("coat {coat_roughness} on metallic {metallic}"), &cases, 8, 1024);
            assert!(least >= bound, "coat {coat_roughness} on metallic {metallic}: {least}");
        }
    }
    for opacity in [0.0, 0.5] {
        for (coat, bound) in [(0.0, 0.998), (0.7, 0.94)] {
            for side in [1.0, -1.0] {
                for &ior in few_of(&[1.0001, 1.5, 1.0, 3.0], 2) {
                    let of = |roughness, c| {
                        let (wo, coat_roughness) = (direction(c, 0.3) * side, 0.2);
                        Case { wo, roughness, opacity, ior, coat, coat_roughness, ..Case::default() }
                    };
                    let name = format!("opacity {opacity}, coat {coat}, ior {ior}, side {side}");
                    let (least, _) = furnace(&device, &name, &grid(of), 8, 1024);
                    assert!(least >= bound, "{name}: {least}");
                }
            }
        }
    }
    device.close();
}

#[test]
fn no_parameters_gain_energy() {
    let device = Device::new(ALL);
    let mut random = Random(7);
    let flat: Vec<Case> = (0..3000).map(|_| random.case()).collect();
    furnace(&device, "random", &flat, 8, 512);
    let bent: Vec<Case> = (0..3000).map(|_| tilted(&mut random)).collect();
    furnace(&device, "random, normals that differ", &bent, 8, 512);
    device.close();
}

/// A case whose normals differ, seen from either side of either.
pub(super) fn tilted(random: &mut Random) -> Case {
    let g = random.above();
    let turn = random.above();
    let n = (g + turn * random.unit()).normalize();
    let mut wo = random.above();
    if wo.dot(g) < 0.0 {
        wo -= 2.0 * wo.dot(g) * g;
    }
    let side = random.pick(&[1.0, -1.0]);
    Case { g, n, wo: wo * side, ..random.case() }
}
