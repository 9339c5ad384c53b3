// SPDX-License-Identifier: Apache-2.0
//! Clipping planes of the camera: against closed forms in f64, with lens and motion, and the same bits in core and
//! streaming.

use crate::scenes::{constant, dome, mesh, prim, square, sun};
use crate::streaming::{SCENES, smallest_budget};
use crate::support::{
    color_request, images, orthographic, perspective, read, read_all, render, request, session, settings,
};
use glam::{DMat4, DVec3, DVec4};
use oocpt_core::camera::Camera;
use oocpt_core::scene::{MeshDesc, PrimShape, SceneDb, TransformSample};
use oocpt_core::settings::Settings;
use oocpt_core::{LightDesc, LightKind, TypedArray};
use oocpt_render::{AovKind, Session, SessionOptions};

const SIZE: [u32; 2] = [64, 48];

/// A ball of radius 1 about the origin, which is tested as what it is.
fn ball(db: &mut SceneDb) {
    db.upsert_mesh(MeshDesc {
        shape: PrimShape::Points,
        points: TypedArray::of(vec![[0.0_f32; 3]]),
        widths: constant(2.0_f32),
        ..mesh(prim("/ball", DMat4::IDENTITY), 1, Vec::new(), &[], 0.5)
    });
}

/// What a ray through the middle of a pixel meets of the ball: the depth; `None` for pixels that rounding may decide.
fn seen_of_ball(camera: &Camera, x: u32, y: u32) -> Option<Option<f64>> {
    let at = |k: u32, n: u32| 2.0 * (f64::from(k) + 0.5) / f64::from(n) - 1.0;
    let unproject = |z: f64| {
        let p = camera.projection.inverse() * DVec4::new(at(x, SIZE[0]), at(y, SIZE[1]), z, 1.0);
        p.truncate() / p.w
    };
    // In view space: any two points of the ray; a ray begins at depth 0.
    let (a, b) = (unproject(-1.0), unproject(0.5));
    let d = (b - a) / (a.z - b.z);
    let o = a + d * a.z;
    let center = camera.world_from_view.inverse().transform_point3(DVec3::ZERO);
    let (from, dd) = (o - center, d.dot(d));
    let half = from.dot(d) / dd;
    let rest = half * half - (from.dot(from) - 1.0) / dd;
    if rest.abs() < 1e-4 {
        return None;
    }
    let mut seen = None;
    for depth in [-half - rest.sqrt(), -half + rest.sqrt()].into_iter().rev().filter(|_| rest > 0.0) {
        let planes = camera.clip_planes.iter().filter(|plane| plane.truncate() != DVec3::ZERO);
        let sides = planes.map(|plane| plane.dot((o + depth * d).extend(1.0)) / plane.truncate().length());
        let least = sides.fold(f64::INFINITY, f64::min);
        if least.abs() < 1e-4 {
            return None;
        }
        if least > 0.0 && depth > 0.0 {
            seen = Some(depth);
        }
    }
    Some(seen)
}

fn cameras() -> [Camera; 2] {
    let (eye, target) = (DVec3::new(1.5, 2.0, 3.0), DVec3::new(0.1, 0.0, 0.0));
    [perspective(eye, target, 0.6, SIZE), orthographic(eye, target, 2.4, SIZE)]
}

/// Planes in view space through points near the ball's centre, which is 3.9 from the eye.
fn cuts() -> [Vec<DVec4>; 5] {
    let through = |normal: DVec3, depth: f64| normal.extend(normal.z * depth);
    let front = through(DVec3::new(0.3, -0.2, -1.0), 3.7);
    let back = through(DVec3::new(-2.0, 1.0, 3.0), 4.3);
    let side = through(DVec3::new(1e-3, 0.0, 0.0), 0.0);
    let scaled = front * 1e30;
    [vec![front], vec![back], vec![scaled, back, side], vec![front, -front - DVec4::W], vec![DVec4::ZERO]]
}

#[test]
fn a_ball_cut_open_shows_its_inside_at_the_known_depth() {
    let session = session(settings(1, 0));
    session.with_scene(ball);
    let mut inner = 0;
    for (camera, planes) in cameras().into_iter().flat_map(|camera| cuts().map(|cut| (camera.clone(), cut))) {
        let camera = Camera { clip_planes: planes, ..camera };
        let request = request(camera.clone());
        render(&session, &request);
        let ids: Vec<i32> = read(&session, &request, AovKind::PrimId);
        let depths: Vec<f32> = read(&session, &request, AovKind::CameraDepth);
        let colors: Vec<[f32; 4]> = read(&session, &request, AovKind::Color);
        let whole = Camera { clip_planes: Vec::new(), ..camera.clone() };
        let mut compared = 0;
        for (i, (x, y)) in (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |x| (x, y))).enumerate() {
            let Some(seen) = seen_of_ball(&camera, x, y) else { continue };
            compared += 1;
            let what = format!("{:?} at {x}, {y}", camera.clip_planes);
            assert_eq!(ids[i] >= 0, seen.is_some(), "{what}");
            let depth = seen.unwrap_or(0.0);
            assert!((f64::from(depths[i]) - depth).abs() < 2e-6 * 4.0, "{what}: {} for {depth}", depths[i]);
            inner += u32::from(seen.is_some() && seen_of_ball(&whole, x, y) != Some(seen));
        }
        assert!(compared > 2900, "{compared} pixels are told exactly");
        let met = colors.iter().filter(|color| color[3] > 0.0).count();
        let known = ids.iter().filter(|id| **id >= 0).count();
        assert!(met.abs_diff(known) < 120, "samples of the colour are cut as well: {met} pixels for {known}");
    }
    assert!(inner > 2000, "the inside is seen: {inner} pixels");
}

/// A square of the plane z = 0, of `half` units either way.
fn card(path: &str, z: f64, half: f64) -> MeshDesc {
    let place = DMat4::from_translation(DVec3::Z * z) * DMat4::from_scale(DVec3::splat(half));
    square(prim(path, place * DMat4::from_rotation_x(std::f64::consts::FRAC_PI_2)), 1, 0.5)
}

fn alpha(build: impl FnOnce(&mut SceneDb), camera: Camera, samples: u32) -> Vec<f64> {
    let session = session(settings(samples, 0));
    session.with_scene(build);
    let request = color_request(camera);
    render(&session, &request);
    read::<[f32; 4]>(&session, &request, AovKind::Color).iter().map(|color| f64::from(color[3])).collect()
}

#[test]
fn a_card_in_focus_is_cut_sharply_by_an_oblique_plane() {
    let mut camera = perspective(DVec3::Z * 10.0, DVec3::ZERO, 0.4, [32, 8]);
    (camera.lens_radius, camera.focus_distance) = (0.8, 10.0);
    // Meets the card at x = 0.3, whatever the point of the lens.
    camera.clip_planes = vec![DVec4::new(1.0, 0.0, 0.4, 4.0 - 0.3)];
    let met = alpha(|db| db.upsert_mesh(card("/card", 0.0, 40.0)), camera, 256);
    let pixel = 2.0 * 10.0 * 0.2_f64.tan() / 8.0;
    for (i, met) in met.iter().enumerate() {
        #[expect(clippy::cast_precision_loss, reason = "small")]
        let left = ((i % 32) as f64 - 16.0) * pixel;
        let known = ((left + pixel - 0.3) / pixel).clamp(0.0, 1.0);
        assert!((met - known).abs() < 0.02, "pixel {i}: {met} for {known}");
    }
}

#[test]
fn clipping_planes_follow_a_moving_camera() {
    let mut camera = perspective(DVec3::Z * 10.0, DVec3::ZERO, 0.4, [16, 8]);
    let at = |z: f64| DMat4::from_translation(DVec3::Z * z);
    camera.motion =
        vec![TransformSample { time: 0.0, transform: at(10.0) }, TransformSample { time: 1.0, transform: at(8.0) }];
    // What is farther than 8.5: the card for the first three quarters; and then than 9.5: for a quarter.
    for (nearest, share) in [(8.5, 0.75), (9.5, 0.25)] {
        camera.clip_planes = vec![DVec4::new(0.0, 0.0, -2.0, -2.0 * nearest)];
        let met = alpha(|db| db.upsert_mesh(card("/card", 0.0, 40.0)), camera.clone(), 256);
        for met in met {
            assert!((met - share).abs() < 0.01, "{met} for {share}");
        }
    }
}

#[test]
fn clipped_geometry_still_casts_shadows_and_the_dome_is_not_clipped() {
    let from_above = |planes: &[DVec4]| {
        let mut camera = orthographic(DVec3::new(0.0, 10.0, 0.0), DVec3::Z * 1e-9, 4.0, [16, 16]);
        camera.clip_planes = planes.to_vec();
        let session = session(settings(16, 0));
        session.with_scene(|db| {
            db.upsert_light(sun(1.0, 0.0, DMat4::from_rotation_x(-std::f64::consts::FRAC_PI_2)));
            db.upsert_mesh(square(prim("/floor", DMat4::from_scale(DVec3::splat(1.5))), 1, 0.5));
            let place = DMat4::from_translation(DVec3::Y * 2.0) * DMat4::from_scale(DVec3::splat(0.7));
            db.upsert_mesh(square(prim("/card", place), 2, 0.9));
        });
        let request = request(camera);
        render(&session, &request);
        (read::<i32>(&session, &request, AovKind::PrimId), read::<[f32; 4]>(&session, &request, AovKind::Color))
    };
    let (ids, colors) = from_above(&[DVec4::new(0.0, 0.0, -1.0, -9.0)]);
    let middle = 8 * 16 + 8;
    assert_eq!(ids[middle], 1, "the floor under the card that is cut off");
    assert_eq!(colors[middle], [0.0, 0.0, 0.0, 1.0], "in its shadow");
    let beside = 8 * 16 + 3;
    assert!(ids[beside] == 1 && colors[beside][0] > 0.1, "and light beside it: {:?}", colors[beside]);
    let (ids, colors) = from_above(&[]);
    assert!(ids[middle] == 2 && colors[middle][0] > 0.1, "without planes the card: {:?}", colors[middle]);
    // A plane that keeps nothing, under a sky.
    let mut camera = perspective(DVec3::Z * 10.0, DVec3::ZERO, 0.4, [8, 8]);
    camera.clip_planes = vec![-DVec4::W];
    let sky = |db: &mut SceneDb| {
        db.upsert_light(dome([0.25, 0.5, 1.0]));
        db.upsert_mesh(card("/card", 0.0, 40.0));
    };
    let request = color_request(camera);
    let session = session(Settings { dome_light_camera_visible: true, ..settings(4, 1) });
    session.with_scene(sky);
    render(&session, &request);
    for color in read::<[f32; 4]>(&session, &request, AovKind::Color) {
        assert_eq!(color, [0.25, 0.5, 1.0, 1.0], "the sky through what is cut off");
    }
}

#[test]
fn visible_lights_are_clipped_as_surfaces() {
    let lamp = |db: &mut SceneDb| {
        let template = sun(1.0, 1.0, DMat4::IDENTITY);
        db.upsert_light(LightDesc {
            prim: prim("/lamp", DMat4::IDENTITY),
            kind: LightKind::Sphere { radius: 1.0, treat_as_point: false },
            camera_visible: true,
            normalize: false,
            ..template
        });
    };
    // The lamp is from 9 to 11 from the eye. From inside it is seen by no ray.
    for (plane, is_seen) in [
        (DVec4::new(0.0, 0.0, -1.0, -8.0), true),
        (DVec4::new(0.0, 0.0, -1.0, -12.0), false),
        (DVec4::new(0.0, 0.0, 1.0, 8.0), false),
        (DVec4::new(0.0, 0.0, 1.0, 10.0), true),
    ] {
        let mut camera = perspective(DVec3::Z * 10.0, DVec3::ZERO, 0.05, [8, 8]);
        camera.clip_planes = vec![plane];
        let met = alpha(lamp, camera, 4);
        assert!(met.iter().all(|alpha| (*alpha == 1.0) == is_seen), "{plane}: {met:?}");
    }
}

#[test]
fn clipping_has_the_same_bits_in_core_and_streaming() {
    let scene = &SCENES[1];
    let mut camera = perspective(scene.eye, scene.target, 0.8, [48, 32]);
    camera.clip_planes = vec![DVec4::new(0.1, 0.0, -1.0, -14.0), DVec4::new(0.0, 0.2, 1.0, 19.0)];
    let request = request(camera.clone());
    let small = || Settings { chunk_size_kib: 16, ..settings(4, 3) };
    let whole = images(scene.build, small(), &request);
    let open = images(scene.build, small(), &self::request(Camera { clip_planes: Vec::new(), ..camera }));
    assert!(whole != open, "the planes cut something");
    let smallest = smallest_budget(scene);
    for budget in [4 * smallest, smallest] {
        let options = SessionOptions { validation: true, force_streaming: true, ..SessionOptions::default() };
        let session = Session::with_options(Settings { geometry_budget_kib: budget, ..small() }, options);
        session.with_scene(scene.build);
        render(&session, &request);
        assert!(!session.stats().streaming.in_core, "{budget} KiB: streams");
        assert!(read_all(&session, &request) == whole, "{budget} KiB: the picture differs");
    }
}
