// SPDX-License-Identifier: Apache-2.0
//! `MaterialX` at the limits: surfaces that are white in a white world at the ends of their ranges, and programs with
//! operations that have no value, which count as 0.

use std::f64::consts::FRAC_PI_2;

use glam::{DMat4, DQuat, DVec3};
use oocpt_core::TypedArray;
use oocpt_core::scene::{Interpolation, MaterialDesc, MeshDesc, NamedPrimvar, NodeDesc, ParamValue, Primvar};

use crate::build::{Body, dome, network, node, prim};
use crate::lab::Lab;
use crate::shot::Way;
use crate::tracer::camera::Eye;

const OPEN_PBR: &str = "ND_open_pbr_surface_surfaceshader";

/// Why a metal of the largest anisotropy is not white.
const STRETCHED: &str = "tables of what scatters more than once are those of one roughness for both directions";

fn float(value: f32) -> ParamValue {
    ParamValue::Float(value)
}

fn metal(roughness: f32, anisotropy: f32) -> Vec<(&'static str, ParamValue)> {
    vec![
        ("base_metalness", float(1.0)),
        ("base_color", ParamValue::Vec3([1.0; 3])),
        ("specular_roughness", float(roughness)),
        ("specular_roughness_anisotropy", float(anisotropy)),
    ]
}

fn glass(ior: f32) -> Vec<(&'static str, ParamValue)> {
    vec![("transmission_weight", float(1.0)), ("specular_ior", float(ior)), ("specular_roughness", float(0.0))]
}

pub(crate) fn run(lab: &mut Lab<'_>) {
    surfaces(lab);
    programs(lab);
}

fn surfaces(lab: &mut Lab<'_>) {
    let turned = DMat4::from_quat(DQuat::from_rotation_x(0.6) * DQuat::from_rotation_y(0.4));
    let eye = Eye::parallel(DVec3::Z * 5.0, DVec3::ZERO, 2.4, [24, 24]);
    let cases = [
        ("metal, roughness 0", metal(0.0, 0.0)),
        ("metal, roughness 1e-4", metal(1e-4, 0.0)),
        ("metal, roughness 1", metal(1.0, 0.0)),
        ("metal, roughness 0.5, anisotropy 1", metal(0.5, 1.0)),
        ("glass, ior 1", glass(1.0)),
        ("glass, ior 1.0001", glass(1.0001)),
        ("glass, ior 3", glass(3.0)),
    ];
    for (name, values) in cases {
        let known = name.contains("anisotropy").then_some((8e-3, STRETCHED));
        lab.case(&format!("materialx/white {name}"), |lab, case| {
            let stage = lab.bench.stage(|db| {
                let half = turned * DMat4::from_scale(DVec3::splat(0.5));
                db.upsert_mesh(MeshDesc {
                    material: Some("/material".into()),
                    ..Body::cube(1.0).mesh(prim("/body", half), 1)
                });
                db.upsert_material(network("/material", vec![node(OPEN_PBR, &values, &[])]));
                db.upsert_light(dome(1.0));
            });
            let way = Way { samples: lab.amount(64, 4096), bounces: 100, ..Way::default() };
            let shot = lab.shoot(case, &stage, &eye.camera(), &way);
            lab.mean(case, "radiance in a white world, relative", 1.0, &shot, 3e-3, known);
        });
    }
}

/// A matt surface whose albedo is 0.25 and what a network gives, all of it worked out on the device from a primvar that
/// is 0.5 everywhere: `nodes` begin with number 3 and read the primvar at 2, the first of them is added.
fn matt(nodes: Vec<NodeDesc>) -> MaterialDesc {
    let mut all = vec![
        node(OPEN_PBR, &[("base_weight", float(1.0)), ("specular_weight", float(0.0))], &[("base_color", 1, "out")]),
        node("ND_combine3_color3", &[], &[("in1", 4, "out"), ("in2", 4, "out"), ("in3", 4, "out")]),
        node("ND_geompropvalue_float", &[("geomprop", ParamValue::Text("half".into()))], &[]),
        node("ND_constant_float", &[("value", float(0.0))], &[]),
        node("ND_add_float", &[("in2", float(0.25))], &[("in1", 5, "out")]),
    ];
    all.extend(nodes);
    network("/material", all)
}

/// One operation on the primvar and a number.
fn on_half(kind: &'static str, number: &'static str, value: f32, half: &'static str) -> Vec<NodeDesc> {
    vec![node(kind, &[(number, float(value))], &[(half, 2, "out")])]
}

/// What is done to `first` by a second operation.
fn then(kind: &'static str, number: &'static str, value: f32, first: Vec<NodeDesc>) -> Vec<NodeDesc> {
    let mut all = vec![node(kind, &[(number, float(value))], &[("in1", 6, "out")])];
    all.extend(first);
    all
}

fn programs(lab: &mut Lab<'_>) {
    let eye = Eye::parallel(DVec3::Z * 5.0, DVec3::ZERO, 1.0, [16, 16]);
    let huge = || on_half("ND_multiply_float", "in2", 1e38, "in1");
    let negative = || on_half("ND_multiply_float", "in2", -1.0, "in1");
    let root = |first: Vec<NodeDesc>| {
        let mut all = vec![node("ND_sqrt_float", &[], &[("in", 6, "out")])];
        all.extend(first);
        all
    };
    // Name, nodes, and what they give.
    let cases: [(&str, Vec<NodeDesc>, f64); 8] = [
        ("division by 0", on_half("ND_divide_float", "in2", 0.0, "in1"), 0.0),
        ("remainder of a division by 0", on_half("ND_modulo_float", "in2", 0.0, "in1"), 0.0),
        ("product above all numbers", then("ND_multiply_float", "in2", 1e30, huge()), 0.0),
        ("root of -0.5", root(negative()), 0.0),
        ("(-0.5) to the power 0.3", then("ND_power_float", "in2", 0.3, negative()), 0.0),
        ("0.5 to the power 1e9", on_half("ND_power_float", "in2", 1e9, "in1"), 0.0),
        ("difference of 1e38 and itself", then("ND_subtract_float", "in2", 0.5e38, huge()), 0.0),
        (
            "1e-30 times 1e30",
            then("ND_multiply_float", "in2", 1e30, on_half("ND_multiply_float", "in2", 1e-30, "in1")),
            0.5,
        ),
    ];
    for (name, nodes, value) in cases {
        lab.case(&format!("materialx/{name}"), |lab, case| {
            let stage = lab.bench.stage(|db| {
                let values = TypedArray::of(vec![0.5_f32; 4]);
                let half = Primvar { interpolation: Interpolation::Vertex, values, indices: None };
                let mut mesh = Body::square(0.5).mesh(prim("/board", DMat4::from_rotation_x(FRAC_PI_2)), 1);
                mesh.primvars.push(NamedPrimvar { name: "half".into(), primvar: half });
                mesh.material = Some("/material".into());
                db.upsert_mesh(mesh);
                db.upsert_material(matt(nodes));
                db.upsert_light(dome(1.0));
            });
            let way = Way { samples: 64, bounces: 1, ..Way::default() };
            let shot = lab.shoot(case, &stage, &eye.camera(), &way);
            lab.mean(case, "radiance under a white sky, relative", 0.25 + value, &shot, 1e-4, None);
        });
    }
}
