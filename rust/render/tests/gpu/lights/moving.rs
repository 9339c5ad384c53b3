// SPDX-License-Identifier: Apache-2.0
//! Lights that move while the shutter is open: closed forms, averaged over it in f64, with shadow rays alone and with
//! both strategies; and the mean of still pictures.

use super::shapes::polygon;
use super::{TestFiles, cylinder, disk, downwards, expect, irradiance_with, irradiances, light, rect, sphere};
use crate::scenes::{dome, instanced, instancer, prim, square, sun};
use crate::streaming::MOVING_LAMPS;
use crate::support::{color_request, perspective, read, render, session, settings};
use glam::{DMat4, DQuat, DVec3};
use oocpt_core::scene::{LightKind, SceneDb, ShapingCone, TransformSample};
use oocpt_core::settings::Settings;
use oocpt_core::{DomeFormat, LightDesc, TypedArray};
use oocpt_render::AovKind;
use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::Arc;

const SAMPLES: u32 = 4096;

fn moving(desc: LightDesc, keys: &[f64], place: &dyn Fn(f64) -> DMat4) -> LightDesc {
    let mut desc = desc;
    desc.prim.transform = place(0.5);
    desc.prim.motion = keys.iter().map(|&time| TransformSample { time, transform: place(time) }).collect();
    desc
}

/// The mean over the shutter.
pub(super) fn mean(value: impl Fn(f64) -> f64) -> f64 {
    const STEPS: u32 = 200;
    (0..STEPS).map(|k| value((f64::from(k) + 0.5) / f64::from(STEPS))).sum::<f64>() / f64::from(STEPS)
}

fn line(from: DVec3, to: DVec3) -> impl Fn(f64) -> DVec3 {
    move |time| from.lerp(to, time)
}

#[test]
fn a_moving_turning_rect_light_matches_its_closed_form() {
    let at = line(DVec3::new(-2.0, 1.5, 0.3), DVec3::new(1.0, 2.0, 0.0));
    let place = |time: f64| {
        let turn = DMat4::from_axis_angle(DVec3::new(0.3, 0.2, 1.0).normalize(), 1.5 * (time - 0.6));
        DMat4::from_translation(at(time)) * turn * DMat4::from_rotation_x(-FRAC_PI_2)
    };
    let known = mean(|time| {
        let corners = [(1.0, 1.0), (1.0, -1.0), (-1.0, -1.0), (-1.0, 1.0)];
        let corners = corners.map(|(x, y)| place(time).transform_point3(DVec3::new(0.6 * x, 0.4 * y, 0.0)));
        assert!(corners.iter().all(|c| c.y > 0.0), "above the floor");
        polygon(&corners)
    });
    let desc = || moving(light(rect(1.2, 0.8), DMat4::IDENTITY), &[0.0, 1.0], &place);
    expect("a rectangle", SAMPLES, known, 0.01, &|db| db.upsert_light(desc()));
    // Samples beyond the shutter: the same way.
    let beyond = || moving(light(rect(1.2, 0.8), DMat4::IDENTITY), &[-0.5, 0.25, 1.5], &place);
    expect("sampled outside", SAMPLES, known, 0.01, &|db| db.upsert_light(beyond()));
}

#[test]
fn passing_sphere_lights_match_their_closed_form() {
    let at = line(DVec3::new(-3.0, 1.5, 0.3), DVec3::new(2.0, 2.5, -1.0));
    let place = |time: f64| DMat4::from_translation(at(time));
    // A sphere above the horizon: pi (r / d)^2 cos.
    let fall = |time: f64, radius: f64| PI * radius * radius * at(time).y / at(time).length().powi(3);
    let ball = || moving(light(sphere(0.8), DMat4::IDENTITY), &[0.0, 1.0], &place);
    expect("a ball", SAMPLES, mean(|time| fall(time, 0.8)), 0.01, &|db| db.upsert_light(ball()));
    let point = || {
        let kind = LightKind::Sphere { radius: 0.8, treat_as_point: true };
        moving(light(kind, DMat4::IDENTITY), &[0.0, 1.0], &place)
    };
    expect("a point", SAMPLES, mean(|time| fall(time, 0.8)), 0.01, &|db| db.upsert_light(point()));
    // A normalised ball that grows as it moves has constant power: radiance 1 / (4 pi r^2).
    let grows = |time: f64| place(time) * DMat4::from_scale(DVec3::splat(0.4 + 0.5 * time));
    let growing = || LightDesc { normalize: true, ..moving(light(sphere(1.0), DMat4::IDENTITY), &[0.0, 1.0], &grows) };
    let known = mean(|time| fall(time, 1.0) / (4.0 * PI));
    expect("a ball that grows", SAMPLES, known, 0.01, &|db| db.upsert_light(growing()));
}

#[test]
fn prototype_lights_move_with_their_instances() {
    // Two balls of radius 0.8 that velocities and a turn of their instancer move.
    let turn = |time: f64| DMat4::from_rotation_y(1.2 * (time - 0.5));
    let base = [DVec3::new(0.0, 1.8, 0.6), DVec3::new(-1.0, 2.2, -1.5)];
    let speeds = [DVec3::new(2.0, 0.5, 0.0), DVec3::new(0.0, -0.4, 3.0)];
    let at = |lamp: usize, time: f64| turn(time).transform_point3(base[lamp] + speeds[lamp] * (time - 0.5));
    let fall = |p: DVec3| PI * 0.8 * 0.8 * p.y / p.length().powi(3);
    let known = mean(|time| fall(at(0, time)) + fall(at(1, time)));
    let build = |db: &mut SceneDb| {
        let places = base.map(|p| (p, DQuat::IDENTITY, DVec3::ONE));
        let mut row = instancer(prim("/row", turn(0.5)), "/row/lamp", &places);
        row.prim.motion = [0.0, 1.0].map(|time| TransformSample { time, transform: turn(time) }).to_vec();
        row.motion.velocities = Some(TypedArray::of(speeds.map(|v| v.as_vec3().to_array()).to_vec()));
        row.motion.seconds = [-0.5, 0.5];
        db.upsert_instancer(row);
        let own = light(sphere(0.8), DMat4::IDENTITY);
        db.upsert_light(LightDesc { prim: instanced(prim("/row/lamp", DMat4::IDENTITY), "/row"), ..own });
    };
    expect("lamps", SAMPLES, known, 0.01, &build);
}

#[test]
fn moving_distant_lights_match_their_closed_form() {
    // From 20 degrees beside the zenith to 70: full angles, the largest of a sun that just touches the horizon.
    let place = |time: f64| {
        let angle = (20.0 + 50.0 * time).to_radians();
        DMat4::from_rotation_z(0.7) * DMat4::from_rotation_x(-FRAC_PI_2 + angle)
    };
    let up = |time: f64| place(time).transform_vector3(DVec3::Z).y;
    for angle in [0.0, 10.0, 39.0] {
        let desc = || moving(sun(2.0, angle, DMat4::IDENTITY), &[0.0, 0.5, 1.0], &place);
        expect("a sun", SAMPLES, 2.0 * mean(up), 0.005, &|db| db.upsert_light(desc()));
    }
}

/// Compares a moving light with the mean of so many stills.
fn against_stills(what: &str, desc: &dyn Fn() -> LightDesc, place: &dyn Fn(f64) -> DMat4, error: f64) {
    const STILLS: u32 = 32;
    let mut stills = [0.0; 3];
    for k in 0..STILLS {
        let time = (f64::from(k) + 0.5) / f64::from(STILLS);
        let still = irradiance_with(settings(1024, 0), &|db| {
            let mut desc = desc();
            desc.prim.transform = place(time);
            db.upsert_light(desc);
        });
        stills.iter_mut().zip(still).for_each(|(sum, e)| *sum += e / f64::from(STILLS));
    }
    for given in irradiances(16384, &|db| db.upsert_light(moving(desc(), &[0.0, 0.5, 1.0], place))) {
        for (given, known) in given.into_iter().zip(stills) {
            assert!(known > 0.0 && (given - known).abs() < error * known, "{what}: {given}, not {known}");
        }
    }
}

#[test]
fn moving_shaped_lights_turn_their_cone() {
    // A spot that sweeps over the floor, from one side to the other.
    let sweep = |time: f64| downwards(DVec3::new(0.3, 2.0, 0.0)) * DMat4::from_rotation_y(1.6 * (time - 0.4));
    let spot = || LightDesc {
        shaping: Some(ShapingCone { cone_angle_degrees: 25.0, cone_softness: 0.5, ..ShapingCone::default() }),
        ..light(disk(0.3), DMat4::IDENTITY)
    };
    against_stills("a spot", &spot, &sweep, 0.02);
    let roll = |time: f64| {
        DMat4::from_translation(DVec3::new(time, 1.5, -0.5))
            * DMat4::from_rotation_y(2.0 * time)
            * DMat4::from_rotation_z(0.6 * time)
    };
    against_stills("a cylinder", &|| light(cylinder(2.0, 0.2), DMat4::IDENTITY), &roll, 0.02);
    // A sky that turns.
    let sky = || LightDesc {
        kind: LightKind::Dome { texture: Some(TestFiles::asset("sky")), format: DomeFormat::Latlong },
        ..dome([1.0; 3])
    };
    let turn = |time: f64| DMat4::from_rotation_x(1.5 * time) * DMat4::from_rotation_z(0.8);
    against_stills("a sky", &sky, &turn, 0.02);
}

/// A ball on a floor under lamps of all kinds, as they are from `open` to `close`; at one moment where these are the
/// same.
fn lamps(db: &mut SceneDb, open: f64, close: f64) {
    db.upsert_mesh(square(prim("/floor", DMat4::from_scale(DVec3::splat(4.0))), 1, 0.5));
    let ball = DMat4::from_translation(DVec3::new(0.0, 0.6, 0.0));
    db.upsert_mesh(crate::scenes::sphere(prim("/ball", ball), 2, 8, 0.6));
    let mut add = |name: &str, kind: LightKind, place: &dyn Fn(f64) -> DMat4| {
        let own = light(kind, place(open));
        let mut desc = LightDesc { prim: prim(name, place(open)), camera_visible: true, intensity: 3.0, ..own };
        if open < close {
            let sample = |k: u32| {
                let part = f64::from(k) / 4.0;
                TransformSample { time: part, transform: place(open + (close - open) * part) }
            };
            desc.prim.motion = (0..=4).map(sample).collect();
        }
        db.upsert_light(desc);
    };
    for (i, kind) in [sphere(0.2), rect(0.6, 0.3), disk(0.3), cylinder(0.8, 0.1)].into_iter().enumerate() {
        let way = DVec3::new(1.5 * i as f64 - 2.2, 1.2 + 0.2 * i as f64, 1.5 - 0.9 * i as f64);
        add(&format!("/lamp_{i}"), kind, &move |time| {
            let turn = DMat4::from_rotation_y(1.5 * time) * DMat4::from_rotation_x(-1.2);
            DMat4::from_translation(way + DVec3::new(0.0, 0.3 * time, -1.2 * time)) * turn
        });
    }
}

fn colors(build: impl FnOnce(&mut SceneDb), settings: Settings) -> Vec<f64> {
    let session = session(settings);
    session.set_light_files(Arc::new(TestFiles));
    session.with_scene(build);
    let request = color_request(perspective(DVec3::new(0.0, 3.0, 8.0), DVec3::Y * 0.5, 0.7, [48, 32]));
    render(&session, &request);
    read::<[f32; 4]>(&session, &request, AovKind::Color).iter().map(|c| f64::from(c[0] + c[1] + c[2])).collect()
}

fn rmse(a: &[f64], b: &[f64]) -> f64 {
    (a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>() / a.len() as f64).sqrt()
}

#[test]
fn moving_lights_equal_the_mean_of_static_ones() {
    const STILLS: u32 = 64;
    let mut mean = vec![0.0; 48 * 32];
    for k in 0..STILLS {
        let time = (f64::from(k) + 0.5) / f64::from(STILLS);
        let still = colors(|db| lamps(db, time, time), Settings { seed: 1000 + k, ..settings(16, 1) });
        mean.iter_mut().zip(still).for_each(|(sum, v)| *sum += v / f64::from(STILLS));
    }
    let moving = |seed| colors(|db| lamps(db, 0.0, 1.0), Settings { seed, ..settings(1024, 1) });
    let (a, b) = (moving(1), moving(2));
    let (noise, off) = (rmse(&a, &b), rmse(&a, &mean));
    assert!(off < 1.5 * noise, "{off} from the mean of the stills; the noise is {noise}");
    let one = colors(|db| lamps(db, 0.5, 0.5), settings(256, 1));
    assert!(rmse(&one, &mean) > 10.0 * noise, "something moves");
}

#[test]
fn moving_lights_have_the_same_bits_at_every_budget() {
    crate::streaming::same_bits(&MOVING_LAMPS);
}
