// SPDX-License-Identifier: Apache-2.0
//! Meshes that emit light and whose placement moves: closed forms, averaged over the shutter in f64, with shadow rays
//! alone and with both strategies; their noise; meshes that are not sampled; and absurd motion.

use super::mesh::{convex, corners, glow, glowing, noise, place, quad, turn};
use super::mesh_programs::stripes;
use super::mesh_textures::{by_texture, screen_that, textured};
use super::moving::mean;
use super::shapes::polygon;
use super::{ALBEDO, downwards, expect};
use crate::scenes::{deforming, instanced, instancer, prim, sphere, square};
use crate::streaming::MOVING_BULBS;
use crate::support::{color_request, orthographic, render_with_messages, session, settings};
use glam::{DMat4, DQuat, DVec3, DVec4};
use oocpt_core::TypedArray;
use oocpt_core::scene::{MaterialDesc, MeshDesc, SceneDb, TransformSample};
use std::f64::consts::PI;

const SAMPLES: u32 = 4096;

/// A placement as a function of time.
pub(super) type Map<'a> = &'a dyn Fn(f64) -> DMat4;

pub(super) fn samples(keys: &[f64], map: Map<'_>) -> Vec<TransformSample> {
    keys.iter().map(|&time| TransformSample { time, transform: map(time) }).collect()
}

fn moving(mut desc: MeshDesc, keys: &[f64], map: Map<'_>) -> MeshDesc {
    desc.prim.transform = map(0.5);
    desc.prim.motion = samples(keys, map);
    desc
}

/// A square of half size 1 that emits, at `map`.
pub(super) fn going(id: i32, keys: &[f64], map: Map<'_>) -> MeshDesc {
    moving(quad(&format!("/quad_{id}"), id, DMat4::IDENTITY), keys, map)
}

pub(super) fn at(x: f64, y: f64, z: f64) -> DMat4 {
    DMat4::from_translation(DVec3::new(x, y, z))
}

pub(super) fn scaled(x: f64, y: f64) -> DMat4 {
    DMat4::from_scale(DVec3::new(x, y, 1.0))
}

pub(super) fn sheared() -> DMat4 {
    DMat4::from_cols(DVec4::X, DVec4::new(0.8, 1.0, 0.3, 0.0), DVec4::Z, DVec4::W)
}

/// A placement from one side to the other, turned about some axis.
pub(super) fn passing(time: f64) -> DMat4 {
    let turn = DMat4::from_axis_angle(DVec3::new(0.3, 1.0, 0.4).normalize(), 1.5 * (time - 0.6));
    at(-2.0 + 3.0 * time, 1.5 + 0.5 * time, -1.4 - 0.3 * time) * turn
}

#[test]
fn a_square_that_moves_gives_the_mean_over_the_shutter() {
    let flat = DMat4::from_rotation_x(-PI / 2.0);
    let [still, go] = [at(0.2, 1.3, -1.5), at(-2.0, 1.5, -1.2)];
    let there = |time: f64| go * DMat4::from_translation(DVec3::new(3.5, 0.5, -0.3) * time);
    let ways: [(&str, &[f64], Map<'_>); 8] = [
        ("it goes", &[0.0, 1.0], &|time| there(time) * flat * scaled(0.4, 0.4)),
        ("it turns", &[0.0, 1.0], &|time| still * DMat4::from_rotation_x(1.5 * time - 2.0) * scaled(0.4, 0.6)),
        ("it grows", &[0.0, 1.0], &|time| still * flat * scaled(0.1 + 0.8 * time, 0.5 - 0.3 * time)),
        // Rays of the BSDF contribute a good part of it.
        ("it grows large", &[0.0, 1.0], &|time| {
            at(0.0, 1.0, -4.3) * flat * DMat4::from_scale(DVec3::splat(0.5 + 3.5 * time))
        }),
        ("all of that, mirrored", &[0.0, 1.0], &|time| passing(time) * flat * scaled(-0.2 - 0.5 * time, 0.6)),
        ("sampled outside the shutter", &[-0.5, 0.25, 1.5], &|time| passing(time) * flat * scaled(0.5, 0.4)),
        ("sheared", &[0.0, 1.0], &|time| passing(time) * flat * sheared() * scaled(0.3, 0.3)),
        ("from one key to the next", &[0.0, 0.5, 1.0], &|time| {
            there(0.5 + (time - 0.5).abs()) * flat * scaled(0.5, 0.2)
        }),
    ];
    for (what, keys, map) in ways {
        let known = mean(|time| polygon(&corners(map(time))));
        expect(what, SAMPLES, known, 0.01, &|db| {
            db.upsert_material(glow("/glow", [1.0; 3]));
            db.upsert_mesh(going(2, keys, map));
        });
    }
}

#[test]
fn a_ball_of_faces_that_moves_gives_the_mean_of_its_faces() {
    let map = |time: f64| {
        at(0.6 - time, 1.3, -0.9 - 0.5 * time)
            * DMat4::from_rotation_z(2.0 * time)
            * DMat4::from_scale(DVec3::new(0.2, 0.5, 0.3))
    };
    let ball = || glowing(sphere(prim("/ball", DMat4::IDENTITY), 2, 8, 0.0));
    let known = mean(|time| convex(&ball(), map(time)));
    expect("a ball", SAMPLES, known, 0.01, &|db| {
        db.upsert_material(glow("/glow", [1.0; 3]));
        db.upsert_mesh(moving(ball(), &[0.0, 1.0], &map));
    });
}

/// Squares on turning arms of flying instances, each turning about itself: the motion is composed of three sets of
/// keys.
fn wheel(db: &mut SceneDb, own: Map<'_>) -> impl Fn(usize, f64) -> DMat4 + use<> {
    let turn = |time: f64| DMat4::from_rotation_y(1.2 * (time - 0.5));
    let base = [DVec3::new(0.0, 1.8, -1.6), DVec3::new(-2.6, 2.2, -1.7)];
    let speeds = [DVec3::new(1.0, 0.5, -0.5), DVec3::new(0.0, -0.4, -1.5)];
    let places = base.map(|p| (p, DQuat::IDENTITY, DVec3::ONE));
    let mut row = instancer(prim("/row", turn(0.5)), "/row/lamp", &places);
    row.prim.motion = samples(&[0.0, 1.0], &turn);
    row.motion.velocities = Some(TypedArray::of(speeds.map(|v| v.as_vec3().to_array()).to_vec()));
    row.motion.seconds = [-0.5, 0.5];
    db.upsert_instancer(row);
    let mut lamp = moving(quad("/row/lamp", 2, DMat4::IDENTITY), &[0.0, 1.0], own);
    lamp.prim = instanced(lamp.prim, "/row");
    db.upsert_mesh(lamp);
    move |lamp, time| turn(time) * DMat4::from_translation(base[lamp] + speeds[lamp] * (time - 0.5))
}

#[test]
fn prototype_mesh_lights_follow_all_enclosing_motion() {
    let own = |time: f64| DMat4::from_rotation_x(0.9 * time - PI / 2.0) * scaled(0.5, 0.3);
    let still = |_: f64| downwards(DVec3::new(0.1, 0.0, 0.0)) * scaled(0.5, 0.3);
    let ways: [(&str, Map<'_>); 2] = [("three motions", &own), ("two", &still)];
    for (what, own) in ways {
        let around = wheel(&mut SceneDb::new(), own);
        let known = mean(|time| (0..2).map(|lamp| polygon(&corners(around(lamp, time) * own(time)))).sum());
        expect(what, SAMPLES, known, 0.01, &|db| {
            db.upsert_material(glow("/glow", [1.0; 3]));
            drop(wheel(db, own));
        });
    }
}

#[test]
fn a_mesh_light_turning_in_a_nonuniform_scale_is_exact() {
    // Two such frames, the outer one at rest, which stretches what turns inside.
    let outer = [(DVec3::new(0.2, 0.4, -1.5), DQuat::from_rotation_z(0.3), DVec3::new(1.5, 0.8, 0.4))];
    let hub = |time: f64| DMat4::from_axis_angle(DVec3::new(0.2, 1.0, 0.1).normalize(), 2.0 * time);
    let arm = [(DVec3::new(0.5, 1.0, 0.3), DQuat::from_rotation_x(0.2), DVec3::new(1.0, 0.7, 1.0))];
    let own = DMat4::from_rotation_x(-1.3) * scaled(0.4, 0.3);
    let place = |(at, turn, size): (DVec3, DQuat, DVec3)| DMat4::from_scale_rotation_translation(size, turn, at);
    let map = |time: f64| place(outer[0]) * hub(time) * place(arm[0]) * own;
    let known = mean(|time| polygon(&corners(map(time))));
    expect("nested", SAMPLES, known, 0.01, &|db| {
        db.upsert_material(glow("/glow", [1.0; 3]));
        db.upsert_instancer(instancer(prim("/outer", DMat4::IDENTITY), "/outer/hub", &outer));
        let mut inside = instancer(prim("/outer/hub", DMat4::IDENTITY), "/outer/hub/lamp", &arm);
        inside.prim = instanced(inside.prim, "/outer");
        inside.prim.transform = hub(0.5);
        inside.prim.motion = samples(&[0.0, 1.0], &hub);
        db.upsert_instancer(inside);
        let mut lamp = quad("/outer/hub/lamp", 2, own);
        lamp.prim = instanced(lamp.prim, "/outer/hub");
        db.upsert_mesh(lamp);
    });
}

/// Many meshes, most of which are below the floor's plane in the middle of the shutter: the tree must bound them at all
/// times.
#[test]
fn many_moving_mesh_lights_match_their_sum() {
    const COUNT: u32 = 100;
    let half = 0.03;
    let map = |i: u32, time: f64| {
        let rise = DVec3::new(1.0, if i.is_multiple_of(4) { 1.0 } else { 7.0 }, -1.0) * (time - 0.9);
        let spin = DMat4::from_rotation_z(2.0 * time);
        DMat4::from_translation(place(i) + rise) * DMat4::from_quat(turn(i)) * spin * scaled(half, half)
    };
    let small = |i: u32, time: f64| {
        let at = map(i, time).w_axis.truncate();
        let normal = map(i, time).transform_vector3(DVec3::Z).normalize();
        let d = at.length();
        4.0 * half * half * normal.dot(at / d).abs() * at.y.max(0.0) / (d * d * d)
    };
    let middle = (0..COUNT).filter(|i| map(*i, 0.5).w_axis.y < 0.0).count();
    assert!(middle > 30, "{middle} are below the floor in the middle of the shutter");
    let known = mean(|time| (0..COUNT).map(|i| small(i, time)).sum());
    expect("many", 2 * SAMPLES, known, 0.012, &|db| {
        db.upsert_material(glow("/glow", [1.0; 3]));
        // The horizon is the plane's: no more of the floor than is seen.
        db.upsert_mesh(square(prim("/floor", DMat4::from_scale(DVec3::splat(0.02))), 1, ALBEDO));
        for i in 0..COUNT {
            db.upsert_mesh(going(10 + i32::try_from(i).expect("small"), &[0.0, 1.0], &|time| map(i, time)));
        }
    });
}

/// At equal samples: nearly as good as at rest, and far better than by chance.
#[test]
fn a_small_moving_mesh_light_is_little_noisier_than_a_static_one() {
    let map = |time: f64| downwards(DVec3::new(0.3 * time, 1.0, -0.5 - 0.1 * time)) * scaled(0.1, 0.1);
    let spun = |time: f64| map(time) * DMat4::from_rotation_z(time);
    let known = mean(|time| polygon(&corners(spun(time))));
    let by = |twin: bool| {
        noise(16, known, &|db| {
            db.upsert_material(glow("/glow", [1.0; 3]));
            db.upsert_mesh(going(2, &[0.0, 1.0], &spun));
            if twin {
                let below = |time: f64| at(0.0, -50.0, 0.0) * spun(time);
                let twin = MeshDesc { prim: prim("/twin", DMat4::IDENTITY), ..going(2, &[0.0, 1.0], &below) };
                db.upsert_mesh(moving(twin, &[0.0, 1.0], &below));
            }
        })
    };
    let rest = noise(16, polygon(&corners(spun(0.5))), &|db| {
        db.upsert_material(glow("/glow", [1.0; 3]));
        db.upsert_mesh(quad("/quad", 2, spun(0.5)));
    });
    let (light, chance) = (by(false), by(true));
    println!("relative MSE at 16 samples: moving {light:.3e}, at rest {rest:.3e}, by chance {chance:.3e}");
    assert!(chance > 20.0 * light, "by chance: {chance}, as a light: {light}");
    assert!(light < 4.0 * rest, "moving: {light}, at rest: {rest}");
}

/// Shadow rays and BSDF rays see the same emission of a texture or a program on a moving mesh.
#[test]
fn varying_emission_of_moving_meshes_agrees_for_shadow_and_hit_rays() {
    let lean = |time: f64| {
        at(-0.5 + 0.6 * time, 1.0, -0.9) * DMat4::from_rotation_x(-1.1 - 0.5 * time) * scaled(1.0 + 0.3 * time, 0.7)
    };
    let cases: [(&str, MaterialDesc); 3] =
        [("steps", by_texture("steps", 1.0)), ("letters", by_texture("letters", 1.0)), ("places", stripes("world"))];
    for (what, material) in cases {
        let build = |is_alone| {
            let material = material.clone();
            move |db: &mut SceneDb| {
                db.upsert_material(material.clone());
                screen_that(db, lean(0.5), is_alone, &|desc, aside| {
                    moving(desc, &[0.0, 1.0], &|time| DMat4::from_translation(aside) * lean(time))
                });
            }
        };
        let [shadow, both] = textured(1024, &build(true));
        let [_, chance] = textured(4096, &build(false));
        // The scatter of 256 pixels gives the errors of the means.
        for (how, given) in [("shadow rays", shadow), ("both", both)] {
            let sigma = ((given.1 + chance.1) / 256.0).sqrt();
            let off = given.0 / chance.0 - 1.0;
            println!("{what}, {how}: {:.4}, by chance {:.4}: off by {off:.1e}, sigma {sigma:.1e}", given.0, chance.0);
            assert!(sigma < 4e-3, "{what}, {how}: too noisy to tell: {sigma}");
            assert!(off.abs() < 4.0 * sigma + 5e-4, "{what}, {how}: off by {off}, sigma {sigma}");
        }
    }
}

/// Sampled lights give no warning, and lights at rest need none of the features.
#[test]
fn only_deforming_mesh_lights_are_not_sampled() {
    let told = |build: &dyn Fn(&mut SceneDb)| {
        let session = session(settings(1, 1));
        session.with_scene(|db| {
            db.upsert_material(glow("/glow", [1.0; 3]));
            build(db);
        });
        let request = color_request(orthographic(DVec3::new(0.0, 0.0, 3.0), DVec3::ZERO, 1.0, [8, 8]));
        let messages = render_with_messages(&session, &request);
        let left_out = session.stats().features_left_out;
        let names = ["emissive meshes sampled", "motion of meshes sampled"];
        let has = names.map(|name| !left_out.iter().any(|part| part.starts_with(name)));
        (messages.iter().filter(|message| message.text.contains("whose points move")).count(), has)
    };
    let still = told(&|db| db.upsert_mesh(quad("/quad", 2, DMat4::IDENTITY)));
    assert_eq!(still, (0, [true, false]), "at rest");
    let goes = told(&|db| db.upsert_mesh(going(2, &[0.0, 1.0], &|time| at(time, 0.0, 0.0))));
    assert_eq!(goes, (0, [true, true]), "a placement that moves");
    let deforms = told(&|db| {
        let grows = |p: glam::Vec3, time: f64| (p.as_dvec3() * (1.0 + time)).as_vec3();
        db.upsert_mesh(deforming(quad("/quad", 2, DMat4::IDENTITY), &[0.0, 1.0], &grows));
    });
    assert_eq!(deforms, (1, [false, false]), "points that move");
    let beside = told(&|db| {
        let mut dark = going(3, &[0.0, 1.0], &|time| at(time, 0.0, 0.0));
        dark.material = None;
        db.upsert_mesh(dark);
        db.upsert_mesh(quad("/quad", 2, DMat4::IDENTITY));
    });
    assert_eq!(beside, (0, [true, false]), "something dark that moves");
}

#[test]
fn moving_mesh_lights_have_the_same_bits_at_every_budget() {
    crate::streaming::same_bits(&MOVING_BULBS);
}
