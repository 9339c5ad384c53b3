// SPDX-License-Identifier: Apache-2.0
//! Shaders and native traversal on extreme scenes, in core and streaming: the same bits. Only where the device's memory
//! is the host's; elsewhere the host cannot walk rays, and there are no rows.

use glam::{DMat4, DQuat, DVec3};
use oocpt_core::scene::{CurveBasis, PrimShape, SceneDb, TransformSample};
use oocpt_core::settings::TraversalKind;

use super::shapes::{curve, eye, shape, straight};
use crate::build::{Body, dome, prim};
use crate::lab::Lab;
use crate::shot::{Engine, Way};
use crate::tracer::camera::Eye;

/// What is built, and from where it is seen.
type Case = (&'static str, fn(&mut SceneDb), fn() -> Eye);

fn far() -> DVec3 {
    DVec3::new(1e7, -3e6, 2e7)
}

pub(crate) fn run(lab: &mut Lab<'_>) {
    let cases: [Case; 6] = [
        (
            "a ball 2e7 away from the origin",
            |db| ball(db, DMat4::from_translation(far())),
            || {
                let own = view();
                Eye::parallel(far() + DVec3::Z * 5.0, far(), 2.4, own.size)
            },
        ),
        ("a ball under a shear of 1e4", |db| ball(db, sheared()), view),
        ("a card that moves by 1e9", moving, view),
        ("a curve at scale 1e9", |db| curved(db, 1e9), || eye(1e9)),
        ("a curve at scale 1e-6", |db| curved(db, 1e-6), || eye(1e-6)),
        ("points that hold each other", |db| round(db, shape(PrimShape::Points, &[DVec3::ZERO; 3], 2.0)), || eye(1.0)),
    ];
    for (name, build, eye) in cases {
        lab.case(&format!("backends/{name}"), |lab, case| {
            let way = Way { samples: 16, bounces: 2, planes: true, ..Way::default() };
            for streaming_kib in [None, Some(64)] {
                let mut shots = Vec::new();
                for traversal in [TraversalKind::Compute, TraversalKind::Native] {
                    let engine = Engine { streaming_kib, traversal, ..Engine::default() };
                    let stage = lab.bench.stage_by(engine, build);
                    shots.push(lab.shoot(case, &stage, &eye().camera(), &way));
                    if !shots[0].host_memory {
                        return;
                    }
                }
                let [shaders, native] = &shots[..] else { return };
                let color = shaders.color.iter().zip(&native.color).filter(|(a, b)| bits(a) != bits(b)).count();
                let depth = shaders.distance.iter().zip(&native.distance).filter(|(a, b)| a.to_bits() != b.to_bits());
                let differ = color + depth.count();
                let where_from = if streaming_kib.is_some() { "streaming" } else { "in core" };
                #[expect(clippy::cast_precision_loss, reason = "pixels of a small image")]
                lab.count(case, &format!("values that differ, {where_from}"), differ as f64, None);
                let seen = shaders.prim.iter().filter(|prim| **prim >= 0).count();
                lab.number(case, &format!("something is seen, {where_from}"), 1.0, f64::from(u8::from(seen > 0)), 0.0);
            }
        });
    }
}

fn bits(color: &[f32; 4]) -> [u32; 4] {
    color.map(f32::to_bits)
}

fn view() -> Eye {
    Eye::parallel(DVec3::Z * 5.0, DVec3::ZERO, 2.4, [32, 32])
}

fn ball(db: &mut SceneDb, place: DMat4) {
    db.upsert_mesh(Body::sphere(12, 0.5).mesh(prim("/ball", place), 1));
    db.upsert_light(dome(1.0));
}

fn sheared() -> DMat4 {
    let mut shear = DMat4::IDENTITY;
    shear.z_axis.x = 1e4;
    shear * DMat4::from_quat(DQuat::from_rotation_x(0.3))
}

fn moving(db: &mut SceneDb) {
    let card = DMat4::from_rotation_x(std::f64::consts::FRAC_PI_2);
    let mut own = prim("/card", card);
    let at = |time: f64, x: f64| TransformSample { time, transform: DMat4::from_translation(DVec3::X * x) * card };
    own.motion = vec![at(0.0, 0.0), at(0.5, 0.1), at(1.0, 1e9)];
    db.upsert_mesh(Body::square(0.5).mesh(own, 1));
    db.upsert_light(dome(1.0));
}

fn curved(db: &mut SceneDb, scale: f64) {
    round(db, curve(CurveBasis::BSpline, &straight(9, scale), 0.5 * scale));
}

fn round(db: &mut SceneDb, mesh: oocpt_core::scene::MeshDesc) {
    db.upsert_mesh(mesh);
    db.upsert_light(dome(1.0));
}
