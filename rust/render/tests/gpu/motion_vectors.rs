// SPDX-License-Identifier: Apache-2.0
//! The image `motion`, against positions of points by closed forms in f64: cameras, placements and points that move.

use crate::scenes::{constant, deforming, mesh, prim, square, widening};
use crate::support::{orthographic, perspective, read, render, request, session, settings};
use glam::{DMat4, DVec3, DVec4, Vec3};
use oocpt_core::TypedArray;
use oocpt_core::camera::Camera;
use oocpt_core::scene::{MeshDesc, PrimShape, SceneDb, TransformSample};
use oocpt_render::{AovKind, Session};
use std::f64::consts::FRAC_PI_2;

const SIZE: [u32; 2] = [64, 48];

/// The position at a time of the shutter of the point that is at `p`, on prim `id`, in the middle of the shutter.
type Path<'a> = dyn Fn(i32, DVec3, f64) -> DVec3 + 'a;

/// Pixel from the lower left corner, and camera depth, of a point of the world.
fn projected(camera: &Camera, world_from_view: DMat4, p: DVec3) -> Option<DVec3> {
    let v = world_from_view.inverse().transform_point3(p);
    let clip = camera.projection * v.extend(1.0);
    let [width, height] = SIZE.map(f64::from);
    let ndc = clip / clip.w;
    (clip.w > 0.0).then(|| DVec3::new(0.5 * (ndc.x + 1.0) * width, 0.5 * (ndc.y + 1.0) * height, -v.z))
}

/// The world's point at the centre of a pixel, at a camera depth.
fn seen(camera: &Camera, [x, y]: [u32; 2], depth: f64) -> DVec3 {
    let [width, height] = SIZE.map(f64::from);
    let ndc = [2.0 * (f64::from(x) + 0.5) / width - 1.0, 2.0 * (f64::from(y) + 0.5) / height - 1.0];
    let inverse = camera.projection.inverse();
    let on_ray = |z: f64| {
        let p = inverse * DVec4::new(ndc[0], ndc[1], z, 1.0);
        p.truncate() / p.w
    };
    let (near, far) = (on_ray(-1.0), on_ray(1.0));
    camera.world_from_view.transform_point3(near + (far - near) * ((-depth - near.z) / (far.z - near.z)))
}

fn rendered(camera: &Camera, build: impl FnOnce(&mut SceneDb)) -> (Session, Vec<[f32; 3]>, Vec<i32>, Vec<f32>) {
    let session = session(settings(1, 0));
    session.with_scene(build);
    let mut request = request(camera.clone());
    let wanted = [AovKind::Motion, AovKind::MotionBoth, AovKind::PrimId, AovKind::CameraDepth];
    request.aovs.retain(|aov| wanted.contains(&aov.kind));
    render(&session, &request);
    let motion = read::<[f32; 3]>(&session, &request, AovKind::Motion);
    let (ids, depths) = (read(&session, &request, AovKind::PrimId), read(&session, &request, AovKind::CameraDepth));
    (session, motion, ids, depths)
}

/// Renders and compares every pixel. `still`: the camera in the middle of the shutter; `at`: its map at a time of it.
/// Returns the number of moving pixels of each prim id.
fn agree(
    what: &str,
    (camera, still): (&Camera, &Camera),
    at: &dyn Fn(f64) -> DMat4,
    build: impl FnOnce(&mut SceneDb),
    path: &Path<'_>,
) -> Vec<usize> {
    let (session, motion, ids, depths) = rendered(camera, build);
    let both: Vec<[f32; 4]> = read(&session, &request(camera.clone()), AovKind::MotionBoth);
    let mut moved = vec![0; 8];
    for (i, (y, x)) in (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |x| (y, x))).enumerate() {
        let given = DVec3::from_array(motion[i].map(f64::from));
        if ids[i] < 0 {
            assert_eq!((motion[i], both[i]), ([0.0; 3], [0.0; 4]), "{what}: nothing at {x}, {y}");
            continue;
        }
        let p = seen(still, [x, y], f64::from(depths[i]));
        let end = |time: f64| projected(camera, at(time), path(ids[i], p, time));
        let known = end(0.0).zip(end(1.0)).map_or(DVec3::ZERO, |(from, to)| to - from);
        let off = (given - known).abs();
        let bound = 2e-3 + 2e-5 * known.length();
        assert!(off.max_element() < bound, "{what}: {given} at {x}, {y} of {}, which is {known}", ids[i]);
        let [back_x, back_y, fore_x, fore_y] = both[i].map(f64::from);
        let now = DVec3::new(f64::from(x) + 0.5, f64::from(y) + 0.5, 0.0);
        let parts = end(0.0).zip(end(1.0)).map_or([DVec3::ZERO; 2], |(from, to)| [now - from, to - now]);
        let off = [back_x - parts[0].x, back_y - parts[0].y, fore_x - parts[1].x, fore_y - parts[1].y];
        assert!(off.iter().all(|off| off.abs() < bound), "{what}: {:?} at {x}, {y}, which is {parts:?}", both[i]);
        moved[usize::try_from(ids[i]).expect("an id")] += usize::from(known.truncate().length() > 0.5);
    }
    moved
}

fn sample(time: f64, transform: DMat4) -> TransformSample {
    TransformSample { time, transform }
}

/// A square in the plane z = 0 of its own frame, two units wide.
fn card(path: &str, id: i32, transform: DMat4) -> MeshDesc {
    square(prim(path, transform * DMat4::from_rotation_x(FRAC_PI_2)), id, 0.5)
}

/// The card of id 1 goes along a line, that of id 2 turns by 150 degrees about an axis that is not its own and grows,
/// the floor of id 0 is at rest.
fn place_of(id: i32, time: f64) -> DMat4 {
    match id {
        1 => DMat4::from_translation(DVec3::new(-1.5 + time, 0.6 - 0.4 * time, 0.8 * time)),
        2 => {
            let axis = DVec3::new(0.2, 0.3, 1.0).normalize();
            let turn = DMat4::from_axis_angle(axis, time * 150_f64.to_radians());
            DMat4::from_translation(DVec3::new(1.6, 0.3, -0.5))
                * turn
                * DMat4::from_scale(DVec3::splat(0.8 + 0.5 * time))
        }
        _ => DMat4::from_translation(DVec3::new(0.0, 0.0, -3.0)) * DMat4::from_scale(DVec3::splat(3.0)),
    }
}

fn cards(db: &mut SceneDb) {
    for (id, path) in ["/floor", "/line", "/turn"].into_iter().enumerate() {
        let id = i32::try_from(id).expect("small");
        let flat = DMat4::from_rotation_x(FRAC_PI_2);
        let mut desc = card(path, id, place_of(id, 0.0));
        // The keys of a rotation and of a growth: between two the map is that of `place_of`.
        desc.prim.motion =
            if id == 0 { Vec::new() } else { [0.0, 1.0].map(|t| sample(t, place_of(id, t) * flat)).to_vec() };
        db.upsert_mesh(desc);
    }
}

fn placed(id: i32, p: DVec3, time: f64) -> DVec3 {
    (place_of(id, time) * place_of(id, 0.5).inverse()).transform_point3(p)
}

fn lookers() -> [(&'static str, Camera); 2] {
    [
        ("perspective", perspective(DVec3::new(1.0, 0.8, 7.0), DVec3::ZERO, 0.8, SIZE)),
        ("orthographic", orthographic(DVec3::new(1.0, 0.8, 7.0), DVec3::ZERO, 6.0, SIZE)),
    ]
}

#[test]
fn motion_vectors_of_placements_match_closed_forms() {
    for (what, camera) in lookers() {
        let moved = agree(what, (&camera, &camera), &|_| camera.world_from_view, cards, &placed);
        assert!(moved[1] > 100 && moved[2] > 100 && moved[0] == 0, "{what}: {moved:?}");
        let (_, motion, ids, _) = rendered(&camera, cards);
        let floor = || motion.iter().zip(&ids).filter(|(_, id)| **id == 0);
        assert!(floor().count() > 300 && floor().all(|(m, _)| *m == [0.0; 3]), "{what}: what is at rest is 0 exactly");
    }
}

#[test]
fn camera_motion_gives_vectors_to_static_and_moving_objects() {
    for (what, looker) in lookers() {
        let base = looker.world_from_view;
        let at = |time: f64| {
            let way = DMat4::from_translation(DVec3::new(0.5 * time - 0.1, 0.3 * time, 0.4 * time));
            way * base * DMat4::from_axis_angle(DVec3::new(0.3, 1.0, -2.0).normalize(), 0.4 * (time - 0.5))
        };
        let motion = vec![sample(0.0, at(0.0)), sample(1.0, at(1.0))];
        let still = Camera { world_from_view: at(0.5), ..looker.clone() };
        let moving = Camera { motion, ..still.clone() };
        let moved = agree(what, (&moving, &still), &at, cards, &placed);
        assert!(moved[0] > 300 && moved[1] > 100 && moved[2] > 100, "{what}: {moved:?}");
    }
}

#[test]
#[expect(clippy::cast_possible_truncation, reason = "widths")]
fn points_that_move_take_surfaces_and_balls_along() {
    // p(t) = p + t * rate(p), with rates that are linear in p: known of any point between vertices.
    let rate = |p: DVec3| DVec3::new(0.8 * p.x, 0.5 * p.x - 0.3 * p.y, 0.4 * p.y);
    let points = vec![[0.4_f32, -0.8, 0.0], [1.9, 0.9, 0.2]];
    let size = |time: f64| 0.8 + 0.5 * time;
    let centres: Vec<DVec3> = points.iter().map(|p| Vec3::from_array(*p).as_dvec3()).collect();
    let build = |db: &mut SceneDb| {
        let stretch = |p: Vec3, time: f64| (p.as_dvec3() + time * rate(p.as_dvec3())).as_vec3();
        let corner = |x: f32, y: f32| [x - 1.2, 0.8 * y, 0.3 * x];
        let corners = vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
        let sheet = mesh(prim("/sheet", DMat4::IDENTITY), 1, corners, &[vec![0, 1, 2, 3]], 0.5);
        db.upsert_mesh(deforming(sheet, &[0.0, 1.0], &stretch));
        let balls = MeshDesc {
            shape: PrimShape::Points,
            points: TypedArray::of(points.clone()),
            widths: constant(0.9_f32),
            ..mesh(prim("/balls", DMat4::IDENTITY), 2, Vec::new(), &[], 0.5)
        };
        db.upsert_mesh(widening(deforming(balls, &[0.0, 1.0], &stretch), &|time| 0.9 * size(time) as f32));
    };
    // A ball goes where its centre goes, and grows about it.
    let path = |id: i32, p: DVec3, time: f64| {
        let from_middle = time - 0.5;
        if id == 2 {
            let near = |c: &&DVec3| ((**c + 0.5 * rate(**c)) - p).length();
            let centre = centres.iter().min_by(|a, b| near(a).total_cmp(&near(b))).expect("two");
            let middle = *centre + 0.5 * rate(*centre);
            return middle + from_middle * rate(*centre) + (p - middle) * (size(time) / size(0.5));
        }
        // p = q + rate(q) / 2, solved row by row.
        let x = p.x / 1.4;
        let y = (p.y - 0.25 * x) / 0.85;
        p + from_middle * rate(DVec3::new(x, y, 0.0))
    };
    for (what, camera) in lookers() {
        let moved = agree(what, (&camera, &camera), &|_| camera.world_from_view, build, &path);
        assert!(moved[1] > 100 && moved[2] > 50, "{what}: {moved:?}");
    }
}

#[test]
fn motion_vectors_are_zero_for_static_points_and_absent_behind_the_camera() {
    let (_, camera) = &lookers()[0];
    let back = camera.world_from_view.z_axis.truncate();
    let path = move |_: i32, p: DVec3, time: f64| p + back * 16.0 * (time - 0.5);
    let build = |db: &mut SceneDb| {
        let mut desc = card("/card", 1, DMat4::IDENTITY);
        let flat = DMat4::from_rotation_x(FRAC_PI_2);
        desc.prim.motion =
            [-0.5, 0.5].map(|t| sample(t + 0.5, DMat4::from_translation(back * 16.0 * t) * flat)).to_vec();
        db.upsert_mesh(desc);
    };
    let (_, motion, ids, _) = rendered(camera, build);
    assert!(ids.iter().filter(|id| **id == 1).count() > 200, "it is seen");
    assert!(motion.iter().all(|m| *m == [0.0; 3]), "and has no place behind the camera");
    agree("behind", (camera, camera), &|_| camera.world_from_view, build, &path);
    // Nothing moves: nothing is compiled for it, and all is 0.
    let still = |db: &mut SceneDb| db.upsert_mesh(card("/card", 1, DMat4::IDENTITY));
    let (session, motion, ids, _) = rendered(camera, still);
    assert!(motion.iter().all(|m| *m == [0.0; 3]) && ids.contains(&1), "at rest");
    let features = session.stats().inventory.features;
    let vectors = features.iter().find(|feature| feature.name == "MOTION_VECTORS").expect("a feature");
    assert!(!vectors.present, "not compiled");
}

#[test]
fn motion_vectors_are_accurate_far_from_the_origin() {
    // A tenth of a unit at 10^6: a quarter of it would be lost in single precision.
    let way = DVec3::new(1e6, -2e6, 1e6);
    let far = DMat4::from_translation(way);
    let (_, near) = &lookers()[0];
    let camera = Camera { world_from_view: far * near.world_from_view, ..near.clone() };
    let map = |time: f64| far * DMat4::from_translation(DVec3::X * 0.1 * time);
    let build = |db: &mut SceneDb| {
        let mut desc = card("/card", 1, map(0.0));
        let flat = DMat4::from_rotation_x(FRAC_PI_2);
        desc.prim.motion = [0.0, 1.0].map(|t| sample(t, map(t) * flat)).to_vec();
        db.upsert_mesh(desc);
        // The device counts from the middle of the scene: this one keeps it where it is.
        db.upsert_mesh(card("/other", 2, DMat4::from_translation(-way)));
    };
    let path = |_: i32, p: DVec3, time: f64| p + DVec3::X * 0.1 * (time - 0.5);
    let moved = agree("far", (&camera, &camera), &|_| camera.world_from_view, build, &path);
    assert!(moved[1] > 100, "{moved:?}");
}
