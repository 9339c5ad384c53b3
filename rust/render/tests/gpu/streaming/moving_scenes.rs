// SPDX-License-Identifier: Apache-2.0
//! Scenes of many small chunks in which something moves while the shutter is open.

use super::scenes::{Scene, balls, ground, lamps_and_sky, lights, scattered};
use crate::scenes::{constant, deforming, glow, instanced, instancer, mesh, prim, sphere, turning, widening};
use glam::{DMat4, DQuat, DVec3, Vec3};
use oocpt_core::scene::{
    CurveBasis, CurveWrap, CurvesDesc, InstancerDesc, InstancerMotion, MeshDesc, PrimShape, SceneDb, Subdivision,
    TransformSample,
};
use oocpt_core::{LightDesc, LightKind, TypedArray};

/// Meshes that move, instances that do, instancers that turn as a whole, and a large mesh among them.
pub(crate) const MOVING: Scene =
    Scene { name: "moving things", build: moving, eye: DVec3::new(6.0, 5.0, 14.0), target: DVec3::ZERO };

/// Things that move under lamps of all kinds that do, a sun and a sky.
pub(crate) const MOVING_LAMPS: Scene =
    Scene { name: "moving lamps", build: moving_lamps, eye: DVec3::new(6.0, 5.0, 14.0), target: DVec3::ZERO };

/// Meshes, tubes, ribbons and points whose points, widths and normals change, and a large mesh among them.
pub(crate) const DEFORMING: Scene =
    Scene { name: "deforming things", build: deforming_things, eye: DVec3::new(6.0, 5.0, 14.0), target: DVec3::ZERO };

/// Things that move and glow, alone, in instancers that do, and in many clusters.
pub(crate) const MOVING_BULBS: Scene =
    Scene { name: "moving bulbs", build: moving_bulbs, eye: DVec3::new(6.0, 5.0, 14.0), target: DVec3::ZERO };

/// See [`MOVING_LAMPS`].
fn moving_lamps(db: &mut SceneDb) {
    lamps_and_sky(db, &|place| {
        let next = place * DMat4::from_rotation_y(0.8) * DMat4::from_translation(DVec3::new(0.5, -0.2, 0.3));
        [(0.0, place), (1.0, next)].map(|(time, transform)| TransformSample { time, transform }).to_vec()
    });
    // In a prototype: on arms that turn, of instances that fly.
    let places: Vec<_> = (0..3)
        .map(|i| {
            ((scattered(i + 60) - 0.5) * 6.0 + DVec3::Y * 2.0, DQuat::IDENTITY, DVec3::splat(1.0 + 0.2 * f64::from(i)))
        })
        .collect();
    let mut row = instancer(prim("/row", DMat4::IDENTITY), "/row/lamp", &places);
    row.motion.velocities = Some(TypedArray::of(vec![[1.0_f32, -0.5, 0.5]; 3]));
    row.motion.seconds = [-0.5, 0.5];
    row.prim.motion =
        [0.0, 1.0].map(|time| TransformSample { time, transform: DMat4::from_rotation_y(0.8 * time) }).to_vec();
    db.upsert_instancer(row);
    db.upsert_light(LightDesc {
        prim: instanced(prim("/row/lamp", DMat4::IDENTITY), "/row"),
        kind: LightKind::Sphere { radius: 0.3, treat_as_point: false },
        intensity: 3.0,
        ..LightDesc::default()
    });
}

/// See [`MOVING_BULBS`].
fn moving_bulbs(db: &mut SceneDb) {
    moving(db);
    db.remove("/sun");
    db.upsert_material(glow("/glow", [3.0, 2.0, 1.0]));
    db.upsert_material(glow("/ember", [0.4, 0.1, 0.0]));
    let moves = |from: DMat4| {
        let next = from * DMat4::from_rotation_z(1.2) * DMat4::from_translation(DVec3::new(0.6, -0.3, 0.4));
        [(0.0, from), (1.0, next)].map(|(time, transform)| TransformSample { time, transform }).to_vec()
    };
    let mut add = |path: &str, id: i32, rings: i32, place: DMat4, material: &str| {
        let mut desc = sphere(prim(path, place), id, rings, 0.5);
        desc.prim.motion = moves(place);
        desc.material = Some(material.into());
        db.upsert_mesh(desc);
    };
    for i in 0..6_u32 {
        let at = (scattered(i + 40) - 0.5) * DVec3::new(12.0, 2.0, 12.0) + DVec3::Y;
        let place = DMat4::from_translation(at) * DMat4::from_scale(DVec3::new(0.3, 0.2, 0.25));
        add(&format!("/bulb_{i}"), 100 + i32::try_from(i).expect("small"), 6, place, "/glow");
    }
    // Cut into clusters.
    add("/coal", 90, 40, DMat4::from_translation(DVec3::Y * 3.0), "/ember");
    // On arms that turn, of instances that fly, each of which moves itself.
    let places: Vec<_> = (0..20)
        .map(|i| {
            ((scattered(i + 60) - 0.5) * 6.0 + DVec3::Y * 2.0, DQuat::from_rotation_x(f64::from(i)), DVec3::splat(0.1))
        })
        .collect();
    let mut row = instancer(prim("/row", DMat4::IDENTITY), "/row/bulb", &places);
    row.motion.velocities = Some(TypedArray::of(vec![[1.0_f32, -0.5, 0.5]; 20]));
    row.motion.seconds = [-0.5, 0.5];
    row.prim.motion =
        [0.0, 1.0].map(|time| TransformSample { time, transform: DMat4::from_rotation_y(0.8 * time) }).to_vec();
    db.upsert_instancer(row);
    let mut bulb = sphere(instanced(prim("/row/bulb", DMat4::IDENTITY), "/row"), 91, 5, 0.5);
    bulb.prim.motion = moves(DMat4::IDENTITY);
    bulb.material = Some("/glow".into());
    db.upsert_mesh(bulb);
}

/// See [`MOVING`].
fn moving(db: &mut SceneDb) {
    lights(db);
    ground(db, 12.0, -2.0);
    let moves = |from: DMat4, to: DMat4| {
        let sample = |(time, transform)| TransformSample { time, transform };
        [(-0.5, from), (0.3, to), (1.0, from * DMat4::from_rotation_x(1.0))].map(sample).to_vec()
    };
    for i in 0..60 {
        let at = (scattered(i) - 0.5) * DVec3::new(12.0, 3.0, 12.0);
        let place = DMat4::from_translation(at) * DMat4::from_scale(DVec3::new(0.5, 0.3, 0.4));
        let next = DMat4::from_translation(at + (scattered(i + 90) - 0.5) * 2.0) * DMat4::from_rotation_y(2.0);
        let mut ball = sphere(prim(&format!("/ball_{i}"), place), 10 + i32::try_from(i).expect("small"), 6, 0.5);
        ball.prim.motion = moves(place, next * DMat4::from_scale(DVec3::new(0.3, 0.5, 0.4)));
        db.upsert_mesh(ball);
    }
    let hub = DMat4::from_translation(DVec3::new(-2.0, 1.0, 0.0));
    let swarm_at = |path: &str| {
        let mut swarm = balls(0, 300, path);
        swarm.prim = prim(path, hub);
        swarm
    };
    let spread = |scale: f32| {
        let speeds: Vec<[f32; 3]> = (0..300).map(|i| ((scattered(i) - 0.5).as_vec3() * scale).to_array()).collect();
        Some(TypedArray::of(speeds))
    };
    let motion = InstancerMotion {
        velocities: spread(2.0),
        accelerations: spread(1.0),
        angular_velocities: spread(200.0),
        seconds: [-0.25, 0.25],
        samples: Vec::new(),
    };
    // Of the first the instances move in the world, of the second in a frame that turns.
    let mut turning = InstancerDesc { motion: motion.clone(), ..swarm_at("/turning") };
    turning.prim.motion = moves(hub, hub * DMat4::from_rotation_z(0.8));
    for swarm in [InstancerDesc { motion, ..swarm_at("/swarm") }, turning] {
        let path = swarm.prim.path.clone();
        db.upsert_instancer(swarm);
        let aside = prim(&format!("{path}/ball"), DMat4::from_translation(DVec3::X * 0.1));
        db.upsert_mesh(sphere(instanced(aside, &path), 80, 8, 0.6));
    }
    let place = DMat4::from_translation(DVec3::new(3.0, 0.0, 3.0));
    let mut large = sphere(prim("/large", place), 71, 40, 0.4);
    large.prim.motion = moves(place, place * DMat4::from_rotation_y(0.5));
    db.upsert_mesh(large);
}
fn deforming_things(db: &mut SceneDb) {
    lights(db);
    ground(db, 12.0, -2.0);
    let wave = |amount: f32| {
        move |p: Vec3, time: f64| {
            #[expect(clippy::cast_possible_truncation, reason = "positions")]
            let time = time as f32;
            p * (1.0 + amount * time) + Vec3::new(0.3, -0.2, 0.1) * (amount * time * (2.0 + 3.0 * p.y).sin())
        }
    };
    for i in 0..30_u8 {
        let at = (scattered(u32::from(i)) - 0.5) * DVec3::new(12.0, 3.0, 12.0);
        let place = DMat4::from_translation(at) * DMat4::from_scale(DVec3::splat(0.6));
        let mut ball = sphere(prim(&format!("/ball_{i}"), place), 10 + i32::from(i), 6, 0.5);
        if i % 3 == 0 {
            ball.subdivision = Subdivision::CatmullClark;
        }
        let times: &[f64] = if i % 2 == 0 { &[0.0, 1.0] } else { &[-0.5, 0.3, 0.6, 1.5] };
        db.upsert_mesh(deforming(ball, times, &wave(0.2 + 0.02 * f32::from(i))));
    }
    // Cut into clusters.
    let large = sphere(prim("/large", DMat4::from_scale(DVec3::splat(2.0))), 60, 60, 0.6);
    db.upsert_mesh(deforming(large, &[0.0, 0.4, 1.0], &wave(0.5)));
    let tuft = |i: u32, k: u32| {
        let root = (scattered(i) - 0.5) * DVec3::new(8.0, 0.0, 8.0) - DVec3::Y * 2.0;
        (root + DVec3::Y * 0.5 * f64::from(k)).as_vec3().to_array()
    };
    let curves = CurvesDesc {
        basis: CurveBasis::BSpline,
        wrap: CurveWrap::Pinned,
        counts: TypedArray::of(vec![4_i32; 200]),
        indices: None,
    };
    let hair = MeshDesc {
        shape: PrimShape::Curves(curves),
        points: TypedArray::of::<[f32; 3]>((0..200).flat_map(|i| (0..4).map(move |k| tuft(i, k))).collect()),
        widths: constant(0.05_f32),
        ..mesh(prim("/hair", DMat4::IDENTITY), 70, Vec::new(), &[], 0.4)
    };
    #[expect(clippy::cast_possible_truncation, reason = "widths and angles")]
    let wider = |time: f64| 0.05 + 0.1 * time as f32;
    #[expect(clippy::cast_possible_truncation, reason = "widths and angles")]
    let aside = |time: f64| Vec3::new((2.0 * time).sin() as f32, 0.2, (2.0 * time).cos() as f32);
    let grass = MeshDesc { prim: prim("/grass", DMat4::from_translation(DVec3::X * 0.1)), ..hair.clone() };
    let grass = deforming(grass, &[0.0, 0.6, 1.0], &wave(0.3));
    db.upsert_mesh(turning(widening(grass, &wider), &aside));
    db.upsert_mesh(widening(deforming(hair, &[0.0, 1.0], &wave(0.2)), &wider));
    let spray = (0..300).map(|i| ((scattered(i) - 0.5) * DVec3::new(6.0, 4.0, 6.0)).as_vec3().to_array());
    let spray = MeshDesc {
        shape: PrimShape::Points,
        points: TypedArray::of::<[f32; 3]>(spray.collect()),
        widths: constant(0.09_f32),
        ..mesh(prim("/spray", DMat4::IDENTITY), 71, Vec::new(), &[], 0.8)
    };
    db.upsert_mesh(widening(deforming(spray, &[0.0, 0.5, 1.0], &wave(0.4)), &wider));
}
