// SPDX-License-Identifier: Apache-2.0
//! Hair at the ends of its ranges: a fibre that absorbs nothing disappears in a white world, however smooth, rough,
//! thin or large it is; one that absorbs everything shows no more than its surface reflects.

use glam::DVec3;
use oocpt_core::scene::{CurveBasis, MeshDesc, ParamValue};

use super::shapes::{curve, eye};
use crate::build::{dome, network, node};
use crate::lab::{Lab, mean};
use crate::shot::Way;

/// A fibre across the view.
fn fibre(scale: f64) -> MeshDesc {
    let points = [-9.0, -3.0, 3.0, 9.0].map(|x| DVec3::X * (x * scale));
    MeshDesc { material: Some("/hair".into()), ..curve(CurveBasis::BSpline, &points, scale) }
}

fn roughness(value: f32) -> Vec<(&'static str, ParamValue)> {
    ["roughness_R", "roughness_TT", "roughness_TRT"].map(|name| (name, ParamValue::Vec2([value; 2]))).to_vec()
}

/// A case: its name, what the fibre is made of, and its scale.
type Case = (&'static str, Vec<(&'static str, ParamValue)>, f64);

pub(crate) fn run(lab: &mut Lab<'_>) {
    let white: [Case; 7] = [
        ("roughness 1e-3", roughness(1e-3), 1.0),
        ("roughness 1", roughness(1.0), 1.0),
        ("ior 1", vec![("ior", ParamValue::Float(1.0))], 1.0),
        ("ior 3", vec![("ior", ParamValue::Float(3.0))], 1.0),
        ("cuticles of 10 degrees", vec![("cuticle_angle", ParamValue::Float(0.5 + 10.0 / 180.0))], 1.0),
        ("scale 1e-6", Vec::new(), 1e-6),
        ("scale 1e9", Vec::new(), 1e9),
    ];
    for (name, values, scale) in white {
        lab.case(&format!("hair/white, {name}"), |lab, case| {
            let got = seen(lab, case, &values, scale);
            lab.number(case, "radiance in a white world", 1.0, got, 3e-3);
        });
    }
    lab.case("hair/black", |lab, case| {
        let values = [("absorption_coefficient", ParamValue::Vec3([1e30; 3]))];
        let got = seen(lab, case, &values, 1.0);
        // A quarter of the view is the fibre.
        lab.number(case, "radiance in a white world", 0.75 + 0.25 * reflected(1.55), got, 3e-3);
    });
}

/// What a cylinder reflects of light from straight ahead, by Fresnel's equations: the mean over its width.
fn reflected(eta: f64) -> f64 {
    let steps = 100_000;
    let at = |k: i32| {
        let cosine = (1.0 - ((f64::from(k) + 0.5) / f64::from(steps)).powi(2)).sqrt();
        let inner = (1.0 - (1.0 - cosine * cosine) / (eta * eta)).sqrt();
        let s = (cosine - eta * inner) / (cosine + eta * inner);
        let p = (eta * cosine - inner) / (eta * cosine + inner);
        0.5 * (s * s + p * p)
    };
    (0..steps).map(at).sum::<f64>() / f64::from(steps)
}

/// Mean radiance of the view in a white world.
fn seen(lab: &mut Lab<'_>, case: &str, values: &[(&str, ParamValue)], scale: f64) -> f64 {
    let stage = lab.bench.stage(|db| {
        let surface = node("ND_surface", &[], &[("bsdf", 1, "out")]);
        db.upsert_material(network("/hair", vec![surface, node("ND_chiang_hair_bsdf", values, &[])]));
        db.upsert_mesh(fibre(scale));
        db.upsert_light(dome(1.0));
    });
    let way = Way { samples: lab.amount(64, 4096), bounces: 8, ..Way::default() };
    mean(&lab.shoot(case, &stage, &eye(scale).camera(), &way))
}
