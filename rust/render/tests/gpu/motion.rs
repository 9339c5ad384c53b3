// SPDX-License-Identifier: Apache-2.0
//! Motion while the shutter is open: against closed forms, against the mean of still pictures, and the same bits in
//! core and streaming.

use crate::scenes::{constant, dome, instanced, instancer, prim, sphere, square, sun};
use crate::streaming::MOVING;
use crate::support::{color_request, orthographic, perspective, read, render, session, settings};
use glam::{DMat4, DQuat, DVec3};
use oocpt_core::TypedArray;
use oocpt_core::camera::Camera;
use oocpt_core::scene::{InstancerMotion, MeshDesc, SceneDb, TransformSample};
use oocpt_core::settings::Settings;
use oocpt_render::AovKind;

/// Samples of a pixel in the closed forms: their times are spread evenly, so that coverage is off by little more than
/// one of them.
const SAMPLES: u32 = 256;

fn sample(time: f64, transform: DMat4) -> TransformSample {
    TransformSample { time, transform }
}

/// A square in the plane z = 0, of two units.
fn card(path: &str, transform: DMat4) -> MeshDesc {
    square(prim(path, transform * DMat4::from_rotation_x(std::f64::consts::FRAC_PI_2)), 1, 0.5)
}

/// The card at each of `maps`.
fn moving_card(maps: &[(f64, DMat4)]) -> MeshDesc {
    let turned = DMat4::from_rotation_x(std::f64::consts::FRAC_PI_2);
    let mut mesh = card("/card", maps[0].1);
    mesh.prim.motion = maps.iter().map(|(time, map)| sample(*time, *map * turned)).collect();
    mesh
}

/// Alpha of each pixel: the share of the samples that met something.
fn coverage(build: impl FnOnce(&mut SceneDb), camera: Camera, samples: u32) -> Vec<f64> {
    let session = session(settings(samples, 0));
    session.with_scene(build);
    let request = color_request(camera);
    render(&session, &request);
    read::<[f32; 4]>(&session, &request, AovKind::Color).iter().map(|color| f64::from(color[3])).collect()
}

/// The camera of the closed forms: `height` units of the plane z = 0, seen from the front.
fn front(height: f64, size: [u32; 2]) -> Camera {
    orthographic(DVec3::Z * 10.0, DVec3::ZERO, height, size)
}

/// Share of the pixel (x, y) and of the shutter in which `covers(point, time)`, by a grid of points and times.
fn integral(size: [u32; 2], height: f64, covers: impl Fn(DVec3, f64) -> bool) -> Vec<f64> {
    let pixel = height / f64::from(size[1]);
    let at = |k: u32, n: u32| (f64::from(k) + 0.5) / f64::from(n);
    let mut out = Vec::new();
    for (y, x) in (0..size[1]).flat_map(|y| (0..size[0]).map(move |x| (y, x))) {
        let mut met = 0_u32;
        for (i, j, k) in (0..8).flat_map(|i| (0..8).flat_map(move |j| (0..128).map(move |k| (i, j, k)))) {
            let across = f64::from(x) - 0.5 * f64::from(size[0]) + at(i, 8);
            let up = f64::from(y) - 0.5 * f64::from(size[1]) + at(j, 8);
            met += u32::from(covers(DVec3::new(across * pixel, up * pixel, 0.0), at(k, 128)));
        }
        out.push(f64::from(met) / (8.0 * 8.0 * 128.0));
    }
    out
}

/// The largest difference, and the mean one.
fn differences(a: &[f64], b: &[f64]) -> (f64, f64) {
    assert_eq!(a.len(), b.len(), "pictures of one size");
    let all = || a.iter().zip(b).map(|(a, b)| (a - b).abs());
    (all().fold(0.0, f64::max), all().sum::<f64>() / a.len() as f64)
}

#[test]
fn a_moving_card_leaves_a_streak_of_known_coverage() {
    let size = [48, 16];
    // Half a unit wide, from -1 to 1.5; at rest for the first quarter of the shutter.
    let place = |x: f64| DMat4::from_translation(DVec3::X * x) * DMat4::from_scale(DVec3::splat(0.25));
    let keys = [(-1.0, place(-1.0)), (0.25, place(-1.0)), (1.0, place(1.5))];
    let met = coverage(|db| db.upsert_mesh(moving_card(&keys)), front(1.5, size), SAMPLES);
    let known = integral(size, 1.5, |p, time| {
        let x = -1.0 + 2.5 * ((time - 0.25) / 0.75).max(0.0);
        (p.x - x).abs() <= 0.25 && p.y.abs() <= 0.25
    });
    let (largest, mean) = differences(&met, &known);
    assert!(known.iter().any(|c| *c > 0.2) && known.iter().filter(|c| **c > 0.0 && **c < 0.3).count() > 100);
    assert!(largest < 0.05 && mean < 0.004, "{largest} at most, {mean} in the mean");
}

#[test]
fn a_turning_rod_matches_its_coverage_integral() {
    let size = [40, 40];
    let rod = DMat4::from_scale(DVec3::new(0.8, 0.04, 1.0));
    let turned = |angle: f64| DMat4::from_rotation_z(angle) * rod;
    // 150 degrees: a linear blend of the matrices would shrink the rod to a quarter on the way.
    let end = 150_f64.to_radians();
    let keys = [(0.0, turned(0.0)), (1.0, turned(end))];
    let met = coverage(|db| db.upsert_mesh(moving_card(&keys)), front(2.0, size), SAMPLES);
    let known = integral(size, 2.0, |p, time| {
        let p = DQuat::from_rotation_z(-end * time) * p;
        p.x.abs() <= 0.8 && p.y.abs() <= 0.04
    });
    let (largest, mean) = differences(&met, &known);
    assert!(largest < 0.06 && mean < 0.004, "{largest} at most, {mean} in the mean");
}

#[test]
fn a_moving_camera_blurs_static_objects() {
    let size = [48, 16];
    let card = || card("/card", DMat4::from_scale(DVec3::splat(0.25)));
    let mut camera = front(1.5, size);
    let place = |x: f64| DMat4::from_translation(DVec3::new(x, 0.0, 10.0));
    camera.motion = vec![sample(-0.5, place(2.0)), sample(1.5, place(-2.0))];
    let met = coverage(|db| db.upsert_mesh(card()), camera, SAMPLES);
    let known = integral(size, 1.5, |p, time| (p.x + 1.0 - 2.0 * time).abs() <= 0.25 && p.y.abs() <= 0.25);
    let (largest, mean) = differences(&met, &known);
    assert!(largest < 0.05 && mean < 0.004, "{largest} at most, {mean} in the mean");
    // About its own axis: the rod turns the other way.
    let size = [40, 40];
    let mut camera = front(2.0, size);
    let roll = |angle: f64| DMat4::from_translation(DVec3::Z * 10.0) * DMat4::from_rotation_z(angle);
    camera.motion = vec![sample(0.0, roll(0.0)), sample(1.0, roll(-2.0))];
    let rod = DMat4::from_scale(DVec3::new(0.8, 0.04, 1.0));
    let met = coverage(|db| db.upsert_mesh(self::card("/rod", rod)), camera, SAMPLES);
    let known = integral(size, 2.0, |p, time| {
        let p = DQuat::from_rotation_z(-2.0 * time) * p;
        p.x.abs() <= 0.8 && p.y.abs() <= 0.04
    });
    let (largest, mean) = differences(&met, &known);
    assert!(largest < 0.06 && mean < 0.004, "{largest} at most, {mean} in the mean");
}

/// Two cards: one at constant speed, one that falls along x, in four pieces.
pub(crate) fn falling(db: &mut SceneDb) {
    let mut mesh = square(instanced(prim("/row/card", DMat4::from_scale(DVec3::splat(0.2))), "/row"), 1, 0.5);
    mesh.prim.transform *= DMat4::from_rotation_x(std::f64::consts::FRAC_PI_2);
    db.upsert_mesh(mesh);
    let places = [DVec3::new(-1.0, 0.5, 0.0), DVec3::new(-1.0, -0.5, 0.0)].map(|at| (at, DQuat::IDENTITY, DVec3::ONE));
    let mut row = instancer(prim("/row", DMat4::IDENTITY), "/row/card", &places);
    row.motion = InstancerMotion {
        velocities: Some(TypedArray::of(vec![[4.0_f32, 0.0, 0.0], [0.0, 0.0, 0.0]])),
        accelerations: Some(TypedArray::of(vec![[0.0_f32, 0.0, 0.0], [16.0, 0.0, 0.0]])),
        angular_velocities: None,
        seconds: [0.0, 0.5],
        samples: Vec::new(),
    };
    db.upsert_instancer(row);
}

#[test]
fn velocities_move_instances_by_their_arrays() {
    let size = [48, 32];
    let met = coverage(falling, front(2.0, size), SAMPLES);
    // A parabola in four pieces.
    let falls = |time: f64| {
        let (a, b) = ((time * 4.0).floor() / 4.0, (time * 4.0).floor() / 4.0 + 0.25);
        let f = (time - a) / 0.25;
        2.0 * (a * a * (1.0 - f) + b * b * f)
    };
    let known = integral(size, 2.0, |p, time| {
        let x = -1.0 + if p.y > 0.0 { 2.0 * time } else { falls(time) };
        (p.x - x).abs() <= 0.2 && (p.y.abs() - 0.5).abs() <= 0.2
    });
    let (largest, mean) = differences(&met, &known);
    assert!(largest < 0.05 && mean < 0.004, "{largest} at most, {mean} in the mean");
}

/// A ball and a mill in front of a floor, lit by a sky and a sun, as they are from `open` to `close`; at one moment
/// where these are the same.
pub(crate) fn mill(db: &mut SceneDb, open: f64, close: f64) {
    db.upsert_light(dome([0.4, 0.5, 0.7]));
    db.upsert_light(sun(2.0, 2.0, DMat4::from_rotation_x(-0.8) * DMat4::from_rotation_y(0.5)));
    db.upsert_mesh(square(prim("/floor", DMat4::from_scale(DVec3::splat(5.0))), 1, 0.5));
    let times: Vec<f64> =
        if open < close { (0..=4).map(|k| open + (close - open) * f64::from(k) / 4.0).collect() } else { vec![open] };
    let motion = |map: &dyn Fn(f64) -> DMat4| -> (DMat4, Vec<TransformSample>) {
        let part = |time: f64| if open < close { (time - open) / (close - open) } else { 0.0 };
        let samples: Vec<_> = times.iter().map(|time| sample(part(*time), map(*time))).collect();
        (samples[0].transform, if samples.len() > 1 { samples } else { Vec::new() })
    };
    let mut ball = sphere(prim("/ball", DMat4::IDENTITY), 2, 8, 0.6);
    (ball.prim.transform, ball.prim.motion) = motion(&|time| {
        DMat4::from_translation(DVec3::new(-2.0 + 2.0 * time, 0.7, 0.5))
            * DMat4::from_scale(DVec3::new(0.7, 0.4 + 0.3 * time, 0.7))
    });
    ball.display_color = constant([0.8_f32, 0.3, 0.2]);
    db.upsert_mesh(ball);
    // The mill turns as a whole about a point far from its wings, each of which turns about itself.
    let wings: Vec<_> = (0..4)
        .map(|k| DQuat::from_rotation_z(f64::from(k) * std::f64::consts::FRAC_PI_2))
        .map(|turn| (turn * DVec3::X, turn, DVec3::new(0.8, 0.2, 1.0)))
        .collect();
    let mut hub = prim("/mill", DMat4::IDENTITY);
    (hub.transform, hub.motion) =
        motion(&|time| DMat4::from_translation(DVec3::new(1.0, 2.0, -1.0)) * DMat4::from_rotation_z(1.2 * time));
    db.upsert_instancer(instancer(hub, "/mill/wing", &wings));
    let mut wing = card("/mill/wing", DMat4::IDENTITY);
    let flat = DMat4::from_rotation_x(std::f64::consts::FRAC_PI_2);
    (wing.prim.transform, wing.prim.motion) = motion(&|time| DMat4::from_rotation_x(0.9 * time) * flat);
    wing.prim = instanced(wing.prim, "/mill");
    db.upsert_mesh(wing);
}

fn colors(build: impl FnOnce(&mut SceneDb), settings: Settings) -> Vec<f64> {
    let session = session(settings);
    session.with_scene(build);
    let request = color_request(perspective(DVec3::new(0.0, 3.0, 9.0), DVec3::Y, 0.7, [48, 32]));
    render(&session, &request);
    read::<[f32; 4]>(&session, &request, AovKind::Color).iter().map(|c| f64::from(c[0] + c[1] + c[2])).collect()
}

fn rmse(a: &[f64], b: &[f64]) -> f64 {
    (a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>() / a.len() as f64).sqrt()
}

#[test]
fn a_moving_scene_equals_the_mean_of_static_renders() {
    const STILLS: u32 = 64;
    let still = |k: u32| {
        let time = (f64::from(k) + 0.5) / f64::from(STILLS);
        colors(|db| mill(db, time, time), Settings { seed: 1000 + k, ..settings(16, 2) })
    };
    let mut mean = vec![0.0; 48 * 32];
    for k in 0..STILLS {
        mean.iter_mut().zip(still(k)).for_each(|(sum, v)| *sum += v / f64::from(STILLS));
    }
    let moving = |seed| colors(|db| mill(db, 0.0, 1.0), Settings { seed, ..settings(1024, 2) });
    let (a, b) = (moving(1), moving(2));
    // Two renders differ by the noise of both; the mean of the stills has as many samples as one of them.
    let (noise, off) = (rmse(&a, &b), rmse(&a, &mean));
    assert!(off < 1.5 * noise, "{off} from the mean of the stills; the noise is {noise}");
    let one = colors(|db| mill(db, 0.5, 0.5), settings(256, 2));
    assert!(rmse(&one, &mean) > 10.0 * noise, "something moves");
}

#[test]
fn moving_chunks_have_the_same_bits_at_every_budget() {
    crate::streaming::same_bits(&MOVING);
}

#[test]
fn pixel_centre_aovs_are_taken_at_mid_shutter() {
    let images = |open: f64, close: f64| {
        let session = session(settings(1, 0));
        session.with_scene(|db| mill(db, open, close));
        let camera = perspective(DVec3::new(0.0, 3.0, 9.0), DVec3::Y, 0.7, [96, 64]);
        let request = crate::support::request(camera);
        render(&session, &request);
        let ids = read::<i32>(&session, &request, AovKind::PrimId);
        (ids, read::<f32>(&session, &request, AovKind::CameraDepth))
    };
    let (moving, still, begin) = (images(0.0, 1.0), images(0.5, 0.5), images(0.0, 0.0));
    let different = |a: &[i32], b: &[i32]| a.iter().zip(b).filter(|(a, b)| a != b).count();
    assert!(different(&moving.0, &still.0) <= 2, "the ids of the middle");
    assert!(different(&moving.0, &begin.0) > 100, "and not those of the beginning");
    let far = moving.1.iter().zip(&still.1).filter(|(a, b)| (**a - **b).abs() > 1e-4 * a.abs()).count();
    assert!(far <= 2, "the depths of the middle, but for {far}");
}
