// SPDX-License-Identifier: Apache-2.0
//! Motion that is extreme or makes no sense: a black card before a white sky takes its own area of the light, wherever
//! it is, as long as it is in view.

use glam::{DMat4, DQuat, DVec3};
use oocpt_core::TypedArray;
use oocpt_core::scene::{InstancerMotion, SceneDb, TransformSample};

use super::transforms::Ring;
use crate::build::{Body, dome, instanced, prim};
use crate::lab::Lab;
use crate::shot::Way;
use crate::tracer::camera::Eye;

/// What is left of the light: the card is one of 16 square units.
const LEFT: f64 = 1.0 - 1.0 / 16.0;

fn eye() -> Eye {
    Eye::parallel(DVec3::Z * 10.0, DVec3::ZERO, 4.0, [32, 32])
}

fn way() -> Way {
    Way { samples: 256, ..Way::default() }
}

/// A square unit that faces the camera.
fn card() -> DMat4 {
    DMat4::from_rotation_x(std::f64::consts::FRAC_PI_2) * DMat4::from_scale(DVec3::splat(0.5))
}

fn sampled(db: &mut SceneDb, maps: &[(f64, DMat4)]) {
    db.upsert_light(dome(1.0));
    let mut own = prim("/card", card());
    own.motion = maps.iter().map(|(time, map)| TransformSample { time: *time, transform: *map * card() }).collect();
    db.upsert_mesh(Body::square(0.0).mesh(own, 1));
}

fn driven(db: &mut SceneDb, velocity: [f32; 3], angular: [f32; 3], seconds: [f64; 2]) {
    db.upsert_light(dome(1.0));
    let Some(ring) = Ring::new(vec![DVec3::ZERO], &[DQuat::IDENTITY], vec![DVec3::ONE]) else { return };
    let mut row = ring.desc(prim("/row", DMat4::IDENTITY), "/row/card");
    row.motion = InstancerMotion {
        velocities: Some(TypedArray::of(vec![velocity])),
        angular_velocities: Some(TypedArray::of(vec![angular])),
        seconds,
        ..InstancerMotion::default()
    };
    db.upsert_instancer(row);
    db.upsert_mesh(Body::square(0.0).mesh(instanced(prim("/row/card", card()), "/row"), 1));
}

type Build = fn(&mut SceneDb);

pub(crate) fn run(lab: &mut Lab<'_>) {
    let clean: [(&str, Build, f64); 5] = [
        ("motion/within the view", |db| sampled(db, &[(0.0, DMat4::IDENTITY), (1.0, aside(1.2))]), LEFT),
        ("motion/over in a moment", |db| sampled(db, &[(0.0, aside(-1.0)), (1e-5, DMat4::IDENTITY)]), LEFT),
        ("motion/velocities of 1e9", |db| driven(db, [1e9, 0.0, 0.0], [0.0; 3], [0.0, 1.0]), 1.0),
        ("motion/velocities of 1e-9", |db| driven(db, [1e-9, 0.0, 0.0], [0.0; 3], [0.0, 1.0]), LEFT),
        ("motion/1e6 degrees a second", |db| driven(db, [0.0; 3], [0.0, 0.0, 1e6], [-0.5, 0.5]), LEFT),
    ];
    for (name, build, left) in clean {
        lab.case(name, |lab, case| {
            let stage = lab.bench.stage(build);
            let shot = lab.shoot(case, &stage, &eye().camera(), &way());
            lab.mean(case, "light that is left", left, &shot, 2e-3, None);
        });
    }
    let bad: [(&str, Build); 7] = [
        ("motion/NaN sample", |db| sampled(db, &[(0.0, DMat4::IDENTITY), (1.0, aside(f64::NAN))])),
        ("motion/samples in the wrong order", |db| sampled(db, &[(1.0, aside(9.0)), (0.0, DMat4::IDENTITY)])),
        ("motion/turned inside out", |db| sampled(db, &[(0.0, DMat4::IDENTITY), (1.0, mirror())])),
        ("motion/shutter of zero", |db| driven(db, [9.0, 0.0, 0.0], [0.0; 3], [0.0, 0.0])),
        ("motion/closed before it opens", |db| driven(db, [9.0, 0.0, 0.0], [0.0; 3], [1.0, 0.0])),
        ("motion/NaN velocity", |db| driven(db, [f32::NAN, 0.0, 0.0], [0.0; 3], [0.0, 1.0])),
        ("motion/infinite turn", |db| driven(db, [0.0; 3], [0.0, f32::INFINITY, 0.0], [0.0, 1.0])),
    ];
    for (name, build) in bad {
        lab.case(name, |lab, case| {
            let stage = lab.bench.stage(build);
            let shot = lab.shoot_warned(case, &stage, &eye().camera(), &way());
            lab.mean(case, "light that is left", LEFT, &shot, 2e-3, None);
            #[expect(clippy::cast_precision_loss, reason = "a few")]
            let warnings = shot.warnings.iter().filter(|text| text.contains("move")).count() as f64;
            lab.number(case, "warnings", 1.0, warnings, 0.0);
        });
    }
}

fn aside(x: f64) -> DMat4 {
    DMat4::from_translation(DVec3::X * x)
}

fn mirror() -> DMat4 {
    DMat4::from_scale(DVec3::new(-1.0, 1.0, 1.0))
}
