// SPDX-License-Identifier: Apache-2.0
//! Materials at the ends of their ranges, in a white world, in which all of them are white; and a nearly sharp mirror
//! of a lamp.
//!
//! One scene for all: the passes are compiled once.

use glam::{DMat4, DQuat, DVec3};
use oocpt_core::scene::{LightDesc, LightKind, MeshDesc, ParamValue};

use crate::build::{Body, dome, material, prim};
use crate::lab::Lab;
use crate::shot::{Stage, Way};
use crate::tracer::camera::Eye;

/// A metal that reflects everything.
fn metal(roughness: f32) -> Vec<(&'static str, ParamValue)> {
    vec![
        ("metallic", ParamValue::Float(1.0)),
        ("diffuseColor", ParamValue::Vec3([1.0; 3])),
        ("roughness", ParamValue::Float(roughness)),
    ]
}

fn glass(ior: f32, roughness: f32) -> Vec<(&'static str, ParamValue)> {
    vec![
        ("opacity", ParamValue::Float(0.0)),
        ("ior", ParamValue::Float(ior)),
        ("roughness", ParamValue::Float(roughness)),
        ("diffuseColor", ParamValue::Vec3([1.0; 3])),
    ]
}

/// A turned box or ball of a material; something of glass and something of metal is always there, out of sight.
fn stage(lab: &Lab<'_>, body: &Body, place: DMat4, values: &[(&str, ParamValue)]) -> Stage {
    lab.bench.stage(|db| {
        let bound = |mesh: MeshDesc, path: &str| MeshDesc { material: Some(path.into()), ..mesh };
        db.upsert_mesh(bound(body.mesh(prim("/body", place), 1), "/material"));
        db.upsert_material(material("/material", values));
        for (name, id, values, x) in [("/glass", 2, glass(1.5, 0.0), 90.0), ("/metal", 3, metal(0.5), -90.0)] {
            let place = DMat4::from_translation(DVec3::new(x, 0.0, 50.0));
            db.upsert_mesh(bound(Body::cube(0.5).mesh(prim(&format!("{name}_box"), place), id), name));
            db.upsert_material(material(name, &values));
        }
        db.upsert_light(dome(1.0));
    })
}

pub(crate) fn run(lab: &mut Lab<'_>) {
    let turned = DMat4::from_quat(DQuat::from_rotation_x(0.6) * DQuat::from_rotation_y(0.4));
    let eye = Eye::parallel(DVec3::Z * 5.0, DVec3::ZERO, 2.4, [24, 24]);
    let way = Way { samples: lab.amount(64, 4096), bounces: 24, ..Way::default() };
    for roughness in [0.0, 1e-4, 0.0101, 1.0] {
        lab.case(&format!("materials/white metal, roughness {roughness}"), |lab, case| {
            let stage = stage(lab, &Body::sphere(16, 1.0), turned, &metal(roughness));
            let shot = lab.shoot(case, &stage, &eye.camera(), &way);
            lab.mean(case, "radiance in a white world, relative", 1.0, &shot, 3e-3, None);
        });
    }
    for ior in [1.0, 1.0001, 3.0] {
        lab.case(&format!("materials/clear glass, ior {ior}"), |lab, case| {
            let half = turned * DMat4::from_scale(DVec3::splat(0.5));
            let stage = stage(lab, &Body::cube(1.0), half, &glass(ior, 0.0));
            let shot = lab.shoot(case, &stage, &eye.camera(), &Way { bounces: 100, ..way.clone() });
            lab.mean(case, "radiance in a white world, relative", 1.0, &shot, 3e-3, None);
        });
    }
    lab.case("materials/metal seen at 0.1 degrees", |lab, case| {
        let stage = stage(lab, &Body::square(1.0), DMat4::from_scale(DVec3::splat(20.0)), &metal(0.3));
        let up = 0.1_f64.to_radians().tan();
        let eye = Eye::at(DVec3::Y * up * 10.0, DVec3::Z * -10.0, up * 0.2, [24, 24]);
        let shot = lab.shoot(case, &stage, &eye.camera(), &way);
        lab.mean(case, "radiance in a white world, relative", 1.0, &shot, 1e-2, None);
    });
    lab.case("materials/nearly sharp mirror of a lamp", mirror);
}

/// A metal of roughness just above sharp shows the middle of a lamp as bright as it is: the lobe is far narrower than
/// the lamp, which shadow rays sample all the same.
fn mirror(lab: &mut Lab<'_>, case: &str) {
    let stage = stage(lab, &Body::square(1.0), DMat4::from_scale(DVec3::splat(20.0)), &metal(0.0101));
    stage.edit(|db| {
        db.upsert_light(LightDesc { prim: prim("/dome", DMat4::IDENTITY), intensity: 1e-6, ..LightDesc::default() });
        let kind = LightKind::Sphere { radius: 0.5, treat_as_point: false };
        let place = prim("/lamp", DMat4::from_translation(DVec3::new(0.0, 4.0, -4.0)));
        db.upsert_light(LightDesc { prim: place, kind, intensity: 7.0, ..LightDesc::default() });
    });
    // From (0, 4, 4) the mirror shows the lamp at the origin.
    let eye = Eye::at(DVec3::new(0.0, 4.0, 4.0), DVec3::ZERO, 0.02, [16, 16]);
    let way = Way { samples: lab.amount(256, 4096), bounces: 2, ..Way::default() };
    let shot = lab.shoot(case, &stage, &eye.camera(), &way);
    lab.mean(case, "radiance of the lamp's image, relative", 7.0, &shot, 1e-2, None);
}
