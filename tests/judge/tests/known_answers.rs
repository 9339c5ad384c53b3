// SPDX-License-Identifier: Apache-2.0
//! The judge is judged: scenes made through the scene database whose depth, ids and light can be worked out by hand.
#![forbid(unsafe_code)]
#![expect(clippy::cast_possible_truncation, reason = "positions in pictures of a few pixels, values near one")]

use std::f64::consts::{FRAC_1_PI, PI};
use std::sync::Arc;

use glam::{DMat4, DVec3};
use oocpt_core::TypedArray;
use oocpt_core::camera::Camera;
use oocpt_core::scene::{
    InstancedBy, InstancerDesc, InstancerPrototype, Interpolation, LightDesc, LightKind, MeshDesc, PrimDesc, Primvar,
    SceneDb, Snapshot, Subdivision,
};
use oocpt_judge::{PathTracerOptions, World, compare_depth, compare_ids, first_hits, path_trace, z_test};

fn prim(path: &str, transform: DMat4, instanced_by: Vec<InstancedBy>) -> PrimDesc {
    PrimDesc { path: path.into(), transform, instanced_by, ..PrimDesc::default() }
}

fn vec3s(values: &[[f32; 3]]) -> TypedArray {
    TypedArray::of(values.to_vec())
}

fn ints(values: &[i32]) -> TypedArray {
    TypedArray::of(values.to_vec())
}

/// A unit square in the xy plane about the origin, facing +z, two triangles (faces 0 and 1).
fn square(prim: PrimDesc, prim_id: i32, albedo: f32) -> MeshDesc {
    MeshDesc {
        prim,
        prim_id,
        double_sided: true,
        left_handed: false,
        subdivision: Subdivision::None,
        face_vertex_counts: ints(&[3, 3]),
        face_vertex_indices: ints(&[0, 1, 2, 0, 2, 3]),
        hole_indices: None,
        points: vec3s(&[[-0.5, -0.5, 0.0], [0.5, -0.5, 0.0], [0.5, 0.5, 0.0], [-0.5, 0.5, 0.0]]),
        normals: None,
        display_color: Some(Primvar {
            interpolation: Interpolation::Constant,
            values: vec3s(&[[albedo; 3]]),
            indices: None,
        }),
        display_opacity: None,
        ..MeshDesc::default()
    }
}

fn light(path: &str, kind: LightKind, intensity: f32, transform: DMat4) -> LightDesc {
    LightDesc {
        prim: prim(path, transform, Vec::new()),
        kind,
        color: [1.0; 3],
        intensity,
        exposure: 0.0,
        color_temperature: None,
        normalize: true,
        camera_visible: true,
        ..LightDesc::default()
    }
}

/// Looks down -z from (0, 0, 5) at a square of 2 x 2 units, orthographic.
fn camera(size: i32) -> Camera {
    Camera {
        world_from_view: DMat4::from_translation(DVec3::Z * 5.0),
        projection: glam::dmat4(
            glam::dvec4(1.0, 0.0, 0.0, 0.0),
            glam::dvec4(0.0, 1.0, 0.0, 0.0),
            glam::dvec4(0.0, 0.0, -2.0 / 9.0, 0.0),
            glam::dvec4(0.0, 0.0, -11.0 / 9.0, 1.0),
        ),
        display_window: [0.0, 0.0, size as f32, size as f32],
        data_window: [0, 0, size, size],
        lens_radius: 0.0,
        focus_distance: 5.0,
        clip_planes: Vec::new(),
        motion: Vec::new(),
        exposure_scale: 1.0,
    }
}

fn commit(db: &mut SceneDb) -> Arc<Snapshot> {
    let commit = db.commit();
    assert!(commit.warnings.is_empty(), "{:?}", commit.warnings);
    commit.snapshot
}

#[test]
fn depth_and_ids_of_two_squares() {
    let mut db = SceneDb::new();
    db.upsert_mesh(square(prim("/Far", DMat4::from_translation(DVec3::new(0.1, 0.1, 0.0)), Vec::new()), 7, 0.5));
    db.upsert_mesh(square(prim("/Near", DMat4::from_translation(DVec3::new(0.6, 0.6, 1.0)), Vec::new()), 9, 0.5));
    let snapshot = commit(&mut db);
    let world = World::flatten(&snapshot).unwrap();
    assert_eq!(world.triangle_count(), 4, "two squares");
    let hits = first_hits(&world, &snapshot, &camera(16)).unwrap();
    let at = |x: f64, y: f64| hits[(((y + 1.0) * 8.0) as usize) * 16 + ((x + 1.0) * 8.0) as usize].0;
    let far = at(-0.2, -0.3).expect("the far square is hit");
    assert_eq!(far.ids, [7, 0, 0], "prim, instance, face below the diagonal");
    assert!((far.camera_depth - 5.0).abs() < 1e-12, "{}", far.camera_depth);
    // Near plane 1, far plane 10: (5 - 1) / 9.
    assert!((far.depth - 4.0 / 9.0).abs() < 1e-12, "{}", far.depth);
    let near = at(0.4, 0.9).expect("the near square is hit");
    assert_eq!((near.ids, near.camera_depth.round() as i32), ([9, 0, 1], 4), "the nearer one wins");
    assert!(at(-0.9, 0.9).is_none(), "nothing there");
    let ids: Vec<i32> = hits.iter().map(|(hit, _)| hit.map_or(-1, |hit| hit.ids[0])).collect();
    compare_ids(&hits, 0, &ids).unwrap();
    let depths: Vec<f32> = hits.iter().map(|(hit, _)| hit.map_or(1.0, |hit| hit.depth as f32)).collect();
    compare_depth(&hits, |hit| hit.depth, 1.0, 1e-6, &depths).unwrap();
}

fn instancer(path: &str, root: &str, places: &[[f32; 3]], instanced_by: Vec<InstancedBy>) -> InstancerDesc {
    let numbers: Vec<i32> = (0..).take(places.len()).collect();
    InstancerDesc {
        prim: prim(path, DMat4::IDENTITY, instanced_by),
        prototypes: vec![InstancerPrototype { root: root.into(), indices: ints(&numbers) }],
        mask: None,
        translations: Some(vec3s(places)),
        rotations: None,
        scales: None,
        transforms: None,
        ..InstancerDesc::default()
    }
}

fn by(instancer: &str, root: &str) -> Vec<InstancedBy> {
    vec![InstancedBy { instancer: instancer.into(), prototype_root: root.into() }]
}

#[test]
fn nested_instances_are_numbered_outer_first() {
    let mut db = SceneDb::new();
    db.upsert_instancer(instancer("/Outer", "/Outer/Inner", &[[-0.5, 0.0, 0.0], [0.5, 0.0, 0.0]], Vec::new()));
    let places = [[0.0, -0.6, 0.0], [0.0, 0.0, 0.0], [0.0, 0.6, 0.0]];
    db.upsert_instancer(instancer("/Outer/Inner", "/Outer/Inner/S", &places, by("/Outer", "/Outer/Inner")));
    let small = DMat4::from_scale(DVec3::splat(0.4));
    db.upsert_mesh(square(prim("/Outer/Inner/S", small, by("/Outer/Inner", "/Outer/Inner/S")), 3, 0.5));
    let snapshot = commit(&mut db);
    let world = World::flatten(&snapshot).unwrap();
    assert_eq!(world.triangle_count(), 12, "six squares");
    let hits = first_hits(&world, &snapshot, &camera(20)).unwrap();
    for (outer, x) in [-0.45, 0.55].into_iter().enumerate() {
        for (inner, y) in [-0.55, 0.05, 0.65].into_iter().enumerate() {
            let index = ((y + 1.0) * 10.0) as usize * 20 + ((x + 1.0) * 10.0) as usize;
            let hit = hits[index].0.expect("a square is there");
            let expected = i32::try_from(outer * 3 + inner).unwrap();
            assert_eq!(hit.ids[..2], [3, expected], "instance {inner} of {outer}");
        }
    }
}

#[test]
fn lambert_under_a_distant_light() {
    for degrees in [0.0_f64, 30.0, 60.0, 80.0] {
        let mut db = SceneDb::new();
        db.upsert_mesh(square(prim("/S", DMat4::from_scale(DVec3::splat(4.0)), Vec::new()), 0, 0.8));
        let turn = DMat4::from_rotation_x(degrees.to_radians());
        db.upsert_light(light("/Sun", LightKind::Distant { angle_degrees: 0.0 }, 3.0, turn));
        let snapshot = commit(&mut db);
        let world = World::flatten(&snapshot).unwrap();
        let options = PathTracerOptions { samples: 2, ..Default::default() };
        let picture = path_trace(&world, &snapshot, &camera(4), &options).unwrap();
        let expected = 0.8 * FRAC_1_PI * 3.0 * degrees.to_radians().cos();
        for value in &picture.mean.data[..3] {
            assert!((f64::from(*value) - expected).abs() < 1e-6, "{degrees} degrees: {value} instead of {expected}");
        }
    }
}

#[test]
fn a_wide_sun_gives_its_irradiance() {
    let mut db = SceneDb::new();
    db.upsert_mesh(square(prim("/S", DMat4::from_scale(DVec3::splat(4.0)), Vec::new()), 0, 0.5));
    let turn = DMat4::from_rotation_x(0.6);
    db.upsert_light(light("/Sun", LightKind::Distant { angle_degrees: 20.0 }, 2.0, turn));
    let snapshot = commit(&mut db);
    let world = World::flatten(&snapshot).unwrap();
    let options = PathTracerOptions { samples: 4096, ..Default::default() };
    let mean = path_trace(&world, &snapshot, &camera(4), &options).unwrap().mean.mean()[0];
    let expected = 0.5 * FRAC_1_PI * 2.0 * f64::cos(0.6);
    assert!((mean - expected).abs() < 2e-4, "{mean} instead of {expected}");
}

#[test]
fn bounces_between_two_walls_form_a_geometric_series() {
    // Two squares of 10^5 units face each other; the camera is between them and sees the floor.
    let mut db = SceneDb::new();
    let wall = |z: f64| DMat4::from_translation(DVec3::Z * z) * DMat4::from_scale(DVec3::new(1e5, 1e5, 1.0));
    db.upsert_mesh(square(prim("/Floor", wall(0.0), Vec::new()), 0, 0.5));
    db.upsert_mesh(square(prim("/Ceiling", wall(5.5), Vec::new()), 1, 0.5));
    db.upsert_light(light("/Dome", LightKind::PLAIN_DOME, 1.0, DMat4::IDENTITY));
    let snapshot = commit(&mut db);
    let world = World::flatten(&snapshot).unwrap();
    let options = PathTracerOptions { samples: 64, max_bounces: 4, ..Default::default() };
    let dark = path_trace(&world, &snapshot, &camera(4), &options).unwrap().mean.mean()[0];
    assert!(dark < 0.01, "no light gets between the walls, yet {dark}");

    // The ceiling lets half of the rays through: every crossing is a coin toss, so the sum over bounces is known.
    let mut veil = square(prim("/Ceiling", wall(5.5), Vec::new()), 1, 0.5);
    let half = TypedArray::of(vec![0.5_f32]);
    veil.display_opacity = Some(Primvar { interpolation: Interpolation::Constant, values: half, indices: None });
    db.upsert_mesh(veil);
    let snapshot = commit(&mut db);
    let world = World::flatten(&snapshot).unwrap();
    let options = PathTracerOptions { samples: 20_000, max_bounces: 40, ..Default::default() };
    let mean = path_trace(&world, &snapshot, &camera(2), &options).unwrap().mean.mean()[0];
    // f = albedo * (half + half * c), c = albedo * f (the ceiling's lower side sees only the floor): f = 0.25 / (1 -
    // 0.125).
    let expected = 0.25 / 0.875;
    assert!((mean - expected).abs() < 2e-3, "{mean} instead of {expected}");
}

#[test]
fn opacity_is_the_chance_to_stop_a_ray() {
    let mut db = SceneDb::new();
    let mut veil = square(prim("/Veil", DMat4::from_scale(DVec3::splat(4.0)), Vec::new()), 0, 1.0);
    let opacity = TypedArray::of(vec![0.3_f32]);
    veil.display_opacity = Some(Primvar { interpolation: Interpolation::Constant, values: opacity, indices: None });
    db.upsert_mesh(veil);
    db.upsert_light(light("/Sun", LightKind::Distant { angle_degrees: 0.0 }, PI as f32, DMat4::IDENTITY));
    let snapshot = commit(&mut db);
    let world = World::flatten(&snapshot).unwrap();
    let options = PathTracerOptions { samples: 4096, ..Default::default() };
    let mean = path_trace(&world, &snapshot, &camera(4), &options).unwrap().mean.mean();
    assert!((mean[3] - 0.3).abs() < 0.01, "alpha {}", mean[3]);
    assert!((mean[0] - mean[3]).abs() < 1e-6, "colour is premultiplied: {} against {}", mean[0], mean[3]);
}

#[test]
fn pictures_with_other_random_numbers_agree_and_another_scene_does_not() {
    let scene = |albedo: f32| {
        let mut db = SceneDb::new();
        db.upsert_mesh(square(prim("/S", DMat4::from_scale(DVec3::splat(1.2)), Vec::new()), 0, albedo));
        let ball = DMat4::from_translation(DVec3::new(0.2, 0.1, 0.4))
            * DMat4::from_rotation_y(0.9)
            * DMat4::from_scale(DVec3::splat(0.5));
        db.upsert_mesh(square(prim("/T", ball, Vec::new()), 1, 0.7));
        db.upsert_light(light("/Dome", LightKind::PLAIN_DOME, 0.5, DMat4::IDENTITY));
        db.upsert_light(light("/Sun", LightKind::Distant { angle_degrees: 5.0 }, 2.0, DMat4::from_rotation_y(0.5)));
        let snapshot = commit(&mut db);
        (World::flatten(&snapshot).unwrap(), snapshot)
    };
    let render = |albedo: f32, seed: u64, samples: u32| {
        let (world, snapshot) = scene(albedo);
        let options = PathTracerOptions { samples, seed, max_bounces: 3, ..Default::default() };
        path_trace(&world, &snapshot, &camera(24), &options).unwrap()
    };
    let reference = render(0.5, 1, 1024);
    let honest = z_test(&render(0.5, 2, 256).mean, 256, &reference).unwrap();
    assert!(honest.accepted(), "{honest}");
    let darker = z_test(&render(0.49, 3, 256).mean, 256, &reference).unwrap();
    assert!(!darker.accepted(), "an albedo of 0.49 for 0.5 must be seen: {darker}");
}
