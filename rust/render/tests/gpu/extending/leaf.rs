// SPDX-License-Identifier: Apache-2.0
//! The kind of leaf that `rust/book/src/extending.md` adds, boxes along the axes, against closed forms and between
//! backends; and how many files it takes.

use super::mentions;
use crate::native_traversal;
use crate::scenes::{constant, deforming, dome, instanced, instancer, mesh, prim, square, sun};
use crate::streaming::{Scene, smallest_budget};
use crate::support::{color_request, orthographic, perspective, read, read_all, render, request, session, settings};
use glam::{DMat4, DQuat, DVec3, Vec3};
use oocpt_abi::{Features, LEAF_KINDS, LEAVES};
use oocpt_core::TypedArray;
use oocpt_core::camera::Camera;
use oocpt_core::mesh::LeafKind;
use oocpt_core::scene::{Interpolation, MeshDesc, PrimShape, Primvar, SceneDb};
use oocpt_core::settings::Settings;
use oocpt_render::{AovKind, Session, SessionOptions};
use std::collections::BTreeSet;
use std::path::Path;

const SIZE: [u32; 2] = [64, 48];

/// Numbers between -1 and 1 that only depend on `i`.
fn scattered(i: u32) -> DVec3 {
    let i = f64::from(i + 1);
    2.0 * DVec3::new(0.754_877_666_246_7 * i, 0.569_840_290_998 * i, 0.381_966_011_250_1 * i).fract() - 1.0
}

/// Boxes between points that follow each other.
fn boxes(path: &str, id: i32, transform: DMat4, corners: Vec<[f32; 3]>) -> MeshDesc {
    let desc = mesh(prim(path, transform), id, Vec::new(), &[], 0.5);
    MeshDesc { shape: PrimShape::ToyBoxes, points: TypedArray::of(corners), ..desc }
}

/// Opposite corners of `count` boxes in `range`, any two of the eight.
fn corners(count: u32, range: DVec3, size: f64) -> Vec<[f32; 3]> {
    let ends = |i: u32| {
        let (middle, half) = (scattered(2 * i) * range, size * (0.2 + scattered(2 * i + 1).abs()));
        let side = |every: u32| if i.is_multiple_of(every) { 1.0 } else { -1.0 };
        let half = half * DVec3::new(side(2), side(3), 1.0);
        [middle - half, middle + half].map(|p| p.as_vec3().to_array())
    };
    (0..count).flat_map(ends).collect()
}

/// Origin and direction of the ray through a pixel's centre; the direction is one unit along the view.
fn ray(camera: &Camera, x: u32, y: u32) -> (DVec3, DVec3) {
    let ndc = [(x, SIZE[0]), (y, SIZE[1])].map(|(k, size)| (f64::from(k) + 0.5) / f64::from(size) * 2.0 - 1.0);
    let p = camera.projection;
    let across = DVec3::new(ndc[0] / p.x_axis.x, ndc[1] / p.y_axis.y, 0.0);
    let (o, d) = if p.z_axis.w != 0.0 { (DVec3::ZERO, across - DVec3::Z) } else { (across, -DVec3::Z) };
    (camera.world_from_view.transform_point3(o), camera.world_from_view.transform_vector3(d))
}

/// Where the ray enters a box, and the normal there.
fn entry(box_: &[[f32; 3]], o: DVec3, d: DVec3) -> Option<(f64, DVec3)> {
    let [a, b] = [box_[0], box_[1]].map(|p| (Vec3::from(p).as_dvec3() - o) / d);
    let (near, far) = (a.min(b), a.max(b));
    let axis = (0..3).max_by(|&i, &j| near[i].total_cmp(&near[j])).expect("three");
    let met = near[axis] > 0.0 && near[axis] <= far.min_element();
    met.then(|| (near[axis], -DVec3::AXES[axis] * d[axis].signum()))
}

#[test]
fn the_example_leaf_is_hit_at_its_planes() {
    let all = corners(40, DVec3::new(3.0, 2.0, 3.0), 0.5);
    let (mut hits, mut doubtful) = (0, 0);
    for (name, camera) in [
        ("perspective", perspective(DVec3::new(2.0, 3.0, 9.0), DVec3::ZERO, 0.8, SIZE)),
        ("orthographic", orthographic(DVec3::new(-5.0, -3.0, 8.0), DVec3::ZERO, 6.0, SIZE)),
    ] {
        let session = session(settings(1, 0));
        session.with_scene(|db| db.upsert_mesh(boxes("/boxes", 7, DMat4::IDENTITY, all.clone())));
        let request = request(camera.clone());
        render(&session, &request);
        let depth: Vec<f32> = read(&session, &request, AovKind::CameraDepth);
        let normals: Vec<[f32; 3]> = read(&session, &request, AovKind::Normal);
        let ids: Vec<i32> = read(&session, &request, AovKind::PrimId);
        let elements: Vec<i32> = read(&session, &request, AovKind::ElementId);
        for (at, (y, x)) in (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |x| (y, x))).enumerate() {
            let (o, d) = ray(&camera, x, y);
            let met = (0_i32..).zip(all.chunks(2)).filter_map(|(number, box_)| Some((entry(box_, o, d)?, number)));
            let Some(((t, normal), number)) = met.min_by(|a, b| a.0.0.total_cmp(&b.0.0)) else {
                doubtful += usize::from(ids[at] != -1);
                continue;
            };
            let given = Vec3::from(normals[at]).as_dvec3();
            if elements[at] != number || given.dot(normal) < 0.5 {
                doubtful += 1;
                continue;
            }
            hits += 1;
            assert_eq!(ids[at], 7, "{name}: {x}, {y}");
            assert!((f64::from(depth[at]) / t - 1.0).abs() < 2e-6, "{name}: depth {} instead of {t}", depth[at]);
            assert!((given - normal).length() < 1e-6, "{name}: normal {given} instead of {normal}");
        }
    }
    // Rays along an edge to what 24 bits say of it: none of these.
    assert!(hits > 2000 && doubtful == 0, "{hits} pixels agree, {doubtful} do not");
}

/// A box from -1 to 1 with a value at each end of x, turned and far away.
fn tinted(db: &mut SceneDb, place: DMat4) {
    let values = TypedArray::of(vec![[0.2_f32, 1.0, 1.0], [0.8, 1.0, 1.0]]);
    let tint = Primvar { interpolation: Interpolation::Vertex, values, indices: None };
    let desc = boxes("/box", 1, place, vec![[-1.0, 1.0, -1.0], [1.0, -1.0, 1.0]]);
    db.upsert_mesh(MeshDesc { display_color: Some(tint), ..desc });
    db.upsert_light(dome([2.0; 3]));
}

/// Colours of that box from all six sides, and where along x between its corners each pixel is.
fn from_all_sides() -> Vec<([f32; 4], f64)> {
    let turn = DMat4::from_rotation_y(0.4) * DMat4::from_rotation_x(0.3);
    let place = DMat4::from_translation(DVec3::new(900.0, -350.0, 70.0)) * turn;
    let session = session(settings(16, 3));
    session.with_scene(|db| tinted(db, place));
    let mut all = Vec::new();
    for side in [DVec3::Z, DVec3::NEG_Z, DVec3::Y, DVec3::NEG_Y, DVec3::X, DVec3::NEG_X] {
        let [eye, target] = [side * 5.0, DVec3::ZERO].map(|p| place.transform_point3(p));
        let camera = orthographic(eye, target, 1.0, [8, 8]);
        let request = color_request(camera.clone());
        render(&session, &request);
        let colors: Vec<[f32; 4]> = read(&session, &request, AovKind::Color);
        all.extend(colors.into_iter().zip((0..8_u32).flat_map(|y| (0..8_u32).map(move |x| (y, x)))).map(
            |(color, (y, x))| {
                let centre = [x, y].map(|k| (f64::from(k) + 0.5) / 8.0 - 0.5);
                let seen = camera.world_from_view.transform_point3(DVec3::new(centre[0], centre[1], -4.0));
                (color, place.inverse().transform_point3(seen).x)
            },
        ));
    }
    all
}

#[test]
fn the_example_leaf_interpolates_colour_between_corners() {
    for (color, along) in from_all_sides() {
        let expected = 2.0 * (0.5 + 0.3 * along);
        // Samples are spread over the pixel, an eighth of a unit.
        assert!((f64::from(color[0]) - expected).abs() < 6e-3, "at {along}: {color:?} instead of {expected}");
    }
}

#[test]
fn the_example_leaf_does_not_shadow_itself() {
    for (color, along) in from_all_sides() {
        assert!(color[1..3].iter().all(|c| (c - 2.0).abs() < 1e-5), "at {along}: {color:?} of a white box");
    }
}

#[test]
fn points_of_the_example_leaf_move_with_its_corners() {
    // One corner rests, the other goes 0.8 along x and 0.4 along y: points in between go by their share of the way.
    let place = |p: Vec3, time: f64| (p.as_dvec3() + (time * DVec3::new(0.8, 0.4, 0.0)) * f64::from(p.x)).as_vec3();
    let desc = boxes("/box", 1, DMat4::IDENTITY, vec![[0.0, 0.0, -1.0], [1.0, 1.0, 1.0]]);
    let session = session(settings(1, 0));
    session.with_scene(|db| db.upsert_mesh(deforming(desc, &[0.0, 1.0], &place)));
    let mut request = request(orthographic(DVec3::Z * 5.0, DVec3::ZERO, 4.0, [32, 32]));
    request.aovs.retain(|aov| aov.kind == AovKind::Motion);
    render(&session, &request);
    let motion: Vec<[f32; 3]> = read(&session, &request, AovKind::Motion);
    let mut moved = 0;
    for (given, (y, x)) in motion.iter().zip((0..32_u32).flat_map(|y| (0..32_u32).map(move |x| (y, x)))) {
        // In the middle of the shutter the box is 1.4 times 1.2 wide.
        let share = [(x, 1.4), (y, 1.2)].map(|(k, size)| ((f64::from(k) + 0.5) / 8.0 - 2.0) / size);
        let inside = share.iter().all(|share| (0.0..=1.0).contains(share));
        let expected = if inside { [8.0 * 0.8 * share[0], 8.0 * 0.4 * share[1]] } else { [0.0; 2] };
        let off = (f64::from(given[0]) - expected[0]).abs().max((f64::from(given[1]) - expected[1]).abs());
        assert!(off < 1e-4, "{x}, {y}: {given:?} instead of {expected:?}");
        moved += usize::from(inside);
    }
    assert!(moved > 80, "{moved} pixels saw the box");
}

/// Boxes in many chunks, in instances, half transparent and moving.
fn heap(db: &mut SceneDb) {
    db.upsert_light(dome([0.4, 0.5, 0.7]));
    db.upsert_light(sun(2.0, 2.0, DMat4::from_rotation_x(-0.8) * DMat4::from_rotation_y(0.5)));
    let ground = DMat4::from_translation(DVec3::Y * -1.2) * DMat4::from_scale(DVec3::splat(12.0));
    db.upsert_mesh(square(prim("/ground", ground), 1, 0.5));
    let pile = boxes("/piles/pile", 2, DMat4::IDENTITY, corners(200, DVec3::new(3.0, 1.0, 3.0), 0.08));
    let places: Vec<_> = (0..20)
        .map(|i| {
            let at = scattered(i + 50) * DVec3::new(5.0, 0.6, 5.0);
            (at, DQuat::from_rotation_z(f64::from(i)), DVec3::splat(0.2))
        })
        .collect();
    db.upsert_instancer(instancer(prim("/piles", DMat4::IDENTITY), "/piles/pile", &places));
    db.upsert_mesh(MeshDesc { prim: instanced(prim("/piles/pile", DMat4::IDENTITY), "/piles"), ..pile });
    for i in 0..30 {
        let place =
            DMat4::from_translation(scattered(i + 90) * DVec3::new(5.0, 1.0, 5.0)) * DMat4::from_rotation_y(0.3);
        let own = corners(60 + i, DVec3::splat(0.5), 0.1);
        db.upsert_mesh(boxes(&format!("/crate{i}"), 5, place, own));
    }
    let veil = boxes("/veil", 3, DMat4::IDENTITY, corners(60, DVec3::new(2.0, 2.0, 2.0), 0.3));
    let values = TypedArray::of((0..120_u8).map(|i| f32::from(i % 5) / 4.0).collect::<Vec<f32>>());
    let opacity = Primvar { interpolation: Interpolation::Vertex, values, indices: None };
    db.upsert_mesh(MeshDesc { display_opacity: Some(opacity), ..veil });
    let swarm = boxes("/swarm", 4, DMat4::IDENTITY, corners(80, DVec3::new(3.0, 2.0, 3.0), 0.1));
    let drift = |p: Vec3, time: f64| (p.as_dvec3() * (1.0 + 0.2 * time)).as_vec3();
    db.upsert_mesh(MeshDesc { display_color: constant([0.9_f32, 0.3, 0.2]), ..deforming(swarm, &[0.0, 1.0], &drift) });
}

const HEAP: Scene = Scene { name: "a heap of boxes", build: heap, eye: DVec3::new(3.0, 3.0, 9.0), target: DVec3::ZERO };

#[test]
fn the_example_leaf_has_the_same_bits_when_streaming_and_native() {
    let request = request(perspective(HEAP.eye, HEAP.target, 0.8, [48, 32]));
    let small = Settings { chunk_size_kib: 16, ..settings(4, 3) };
    let tight = Settings { geometry_budget_kib: 2 * smallest_budget(&HEAP), ..small.clone() };
    let images = [(&small, false), (&tight, true)].map(|(settings, force_streaming)| {
        let options = SessionOptions { validation: true, force_streaming, ..SessionOptions::default() };
        let session = Session::with_options(settings.clone(), options);
        session.with_scene(HEAP.build);
        render(&session, &request);
        let stats = session.stats().streaming;
        assert!(stats.in_core != force_streaming && stats.chunks >= 8, "{stats:?}");
        read_all(&session, &request)
    });
    assert!(images[0] == images[1], "streaming changed a picture");
    native_traversal::same_bits(HEAP.name, HEAP.build, &small, false, &request);
    native_traversal::same_bits(HEAP.name, HEAP.build, &tight, true, &request);
}

#[test]
fn invalid_example_leaves_are_omitted_and_counted() {
    let mut bad = corners(3, DVec3::splat(1.0), 0.5);
    bad[0][1] = f32::NAN;
    bad[3][2] = bad[2][2];
    bad.push([0.0; 3]);
    let mut db = SceneDb::new();
    db.upsert_mesh(boxes("/boxes", 1, DMat4::IDENTITY, bad));
    let commit = db.commit();
    // One that is no number, one without an extent, one that is alone.
    assert_eq!(commit.snapshot.dropped.points, 3, "{:?}", commit.warnings);
    assert_eq!(commit.snapshot.counts.unique_triangles, 1, "the third is there");
    assert!(commit.warnings.len() == 1 && &*commit.warnings[0].path == "/boxes", "{:?}", commit.warnings);
    db.upsert_mesh(MeshDesc { points: TypedArray::of(vec![0_i32; 6]), ..boxes("/boxes", 1, DMat4::IDENTITY, vec![]) });
    let commit = db.commit();
    assert_eq!((commit.snapshot.counts.unique_triangles, commit.warnings.len()), (0, 1), "{:?}", commit.warnings);
}

#[test]
fn every_kind_of_leaf_has_a_row() {
    let names: BTreeSet<&str> = LEAVES.iter().map(|row| row.name).collect();
    let kinds: BTreeSet<&str> = LeafKind::ALL.iter().map(|kind| kind.row().name).collect();
    assert_eq!(names, kinds, "both tables have the same kinds");
    let numbers: BTreeSet<u32> = LEAVES.iter().map(|row| row.number).collect();
    assert_eq!([names.len(), numbers.len()], [LEAVES.len(); 2], "each has its own");
    assert!(numbers.iter().all(|number| *number < LEAF_KINDS), "flags have room for it");
    let always = LEAVES.iter().filter(|row| row.needs == Features::empty());
    assert_eq!(always.map(|row| row.name).collect::<Vec<_>>(), [LeafKind::Triangles.row().name], "others are left out");
}

#[test]
fn a_kind_of_leaf_takes_at_most_eight_files() {
    let found = mentions(["toy_box", "toybox"]);
    let own = ["shaders/geometry", "rust/traverse/src/leaf", "rust/core/src/mesh/leaf"];
    for own in own.map(|folder| Path::new(folder).join("toy_box")) {
        assert!(
            found.iter().any(|path| path.with_extension("").ends_with(&own)),
            "the count sees the kind's own files: {found:?}"
        );
    }
    assert!(found.len() <= 8, "{found:#?}");
}
