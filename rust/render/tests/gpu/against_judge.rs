// SPDX-License-Identifier: Apache-2.0
//! The images against the judge's f64 renderer: ids exactly, depth and normals to rounding, colour by z-test.

use crate::scenes::{features, flattened, mesh, nested, prim, square, sun};
use crate::support::{color_request, orthographic, perspective, read, render, request, session, settings, snapshot};
use glam::{DMat4, DVec3, DVec4};
use oocpt_core::camera::Camera;
use oocpt_core::scene::SceneDb;
use oocpt_core::settings::SettingValue;
use oocpt_judge::{
    Image, PathTracerOptions, World, compare_depth, compare_ids, compare_normals, first_hits, path_trace, z_test,
};
use oocpt_render::AovKind;

const SIZE: [u32; 2] = [64, 40];

fn cameras() -> [Camera; 2] {
    let (eye, target) = (DVec3::new(3.0, 4.0, 6.0), DVec3::new(0.0, 0.5, 0.0));
    [perspective(eye, target, 0.7, SIZE), orthographic(eye, target, 5.0, SIZE)]
}

fn first_hits_agree(build: fn(&mut SceneDb)) {
    let snapshot = snapshot(build);
    let world = World::flatten(&snapshot).expect("small");
    let session = session(settings(1, 0));
    session.with_scene(build);
    for camera in cameras() {
        let hits = first_hits(&world, &snapshot, &camera).expect("the camera is invertible");
        let request = request(camera);
        render(&session, &request);
        for (which, kind) in [AovKind::PrimId, AovKind::InstanceId, AovKind::ElementId].into_iter().enumerate() {
            let ids: Vec<i32> = read(&session, &request, kind);
            let verdict = compare_ids(&hits, which, &ids);
            assert!(verdict.is_ok(), "{kind:?}: {verdict:?}");
            let mut wrong = ids;
            wrong.iter_mut().for_each(|id| *id += 1);
            compare_ids(&hits, which, &wrong).expect_err("shifted ids must be refused");
        }
        let depth: Vec<f32> = read(&session, &request, AovKind::Depth);
        // Window depth is 0.5 z + 0.5 with z near -1 or 1: its error is that of numbers near one, not of small depths.
        let shifted: Vec<f32> = depth.iter().map(|depth| 1.0 + depth).collect();
        compare_depth(&hits, |hit| 1.0 + hit.depth, 2.0, 2.5e-7, &shifted).expect("depth");
        let depth: Vec<f32> = read(&session, &request, AovKind::CameraDepth);
        compare_depth(&hits, |hit| hit.camera_depth, 0.0, 1e-5, &depth).expect("camera depth");
        let wrong: Vec<f32> = depth.iter().map(|depth| depth * 1.0001).collect();
        compare_depth(&hits, |hit| hit.camera_depth, 0.0, 1e-5, &wrong).expect_err("scaled depth must be refused");
        let normals: Vec<[f32; 3]> = read(&session, &request, AovKind::Normal);
        compare_normals(&hits, |hit| hit.normal, 2e-4, &normals).expect("normal");
        let normals: Vec<[f32; 3]> = read(&session, &request, AovKind::Neye);
        compare_normals(&hits, |hit| hit.view_normal, 2e-4, &normals).expect("Neye");
    }
}

#[test]
fn first_hits_of_nested_instances() {
    first_hits_agree(nested);
}

#[test]
fn first_hits_of_flattened_instances() {
    first_hits_agree(flattened);
}

/// Independent renders, each with [`SAMPLES`] samples: their spread is the variance of the product's own estimator,
/// which is not that of the judge's.
const SEEDS: u32 = 64;
const SAMPLES: u32 = 4;

/// Mean over all seeds, and the variance of one sample.
fn render_seeds(build: fn(&mut SceneDb), camera: &Camera) -> (Vec<f32>, Vec<f64>) {
    let session = session(settings(SAMPLES, 3));
    session.with_scene(build);
    let mut request = request(camera.clone());
    request.aovs.truncate(1);
    let mut mean = vec![0.0_f64; usize::try_from(request.pixels()).expect("small") * 4];
    let mut squares = mean.clone();
    for seed in 0..SEEDS {
        session.set_setting("oocpt:seed", SettingValue::Int(i64::from(seed))).expect("a valid seed");
        render(&session, &request);
        for (i, value) in read::<f32>(&session, &request, AovKind::Color).into_iter().enumerate() {
            let difference = f64::from(value) - mean[i];
            mean[i] += difference / f64::from(seed + 1);
            squares[i] += difference * (f64::from(value) - mean[i]);
        }
    }
    #[expect(clippy::cast_possible_truncation, reason = "an image")]
    let image = mean.into_iter().map(|value| value as f32).collect();
    (image, squares.into_iter().map(|value| value / f64::from(SEEDS - 1) * f64::from(SAMPLES)).collect())
}

/// Renders with many seeds and compares with the judge.
fn light_agrees(build: fn(&mut SceneDb), name: &str) {
    const TOTAL: u32 = SEEDS * SAMPLES;
    let snapshot = snapshot(build);
    let world = World::flatten(&snapshot).expect("small");
    let camera = perspective(DVec3::new(3.0, 4.0, 6.0), DVec3::new(0.0, 0.5, 0.0), 0.7, [32, 20]);
    let options = PathTracerOptions { samples: 1024, max_bounces: 3, ..PathTracerOptions::default() };
    let mut reference = path_trace(&world, &snapshot, &camera, &options).expect("the camera is invertible");
    let (data, own_variance) = render_seeds(build, &camera);
    // The z-test assumes one variance for both; give it the one that makes the variance of their difference right.
    let (ours, theirs) = (1.0 / f64::from(TOTAL), 1.0 / f64::from(options.samples));
    for (variance, own) in reference.variance.data.iter_mut().zip(own_variance) {
        let difference = own * ours + f64::from(*variance) * theirs;
        #[expect(clippy::cast_possible_truncation, reason = "a variance near one")]
        let common = (difference / (ours + theirs)) as f32;
        *variance = common;
    }
    let image = Image::from_data(32, 20, 4, data).expect("the shape is right");
    let report = z_test(&image, TOTAL, &reference).expect("same shape");
    let folder = std::env::temp_dir();
    report.write_if_refused(&folder, name, &image, &reference).expect("the temporary folder can be written");
    assert!(report.accepted(), "{name}: {report}; images under {}", folder.display());
    let mut planted = image;
    planted.data.iter_mut().for_each(|value| *value *= 1.02);
    assert!(!z_test(&planted, TOTAL, &reference).expect("same shape").accepted(), "2 % too bright must be refused");
}

#[test]
fn light_in_nested_instances() {
    light_agrees(nested, "nested");
}

#[test]
fn light_on_colours_normals_and_opacity() {
    light_agrees(features, "features");
}

#[test]
fn a_sun_straight_above_casts_shadows_from_afar() {
    // Two components of the shadow rays are zero, and boxes begin a thousand units beside them: distances along the ray
    // to these are finite.
    let upwards = DMat4::from_cols(DVec4::X, DVec4::NEG_Z, DVec4::Y, DVec4::W);
    let corner = |x: f32, z: f32| [x, 300.0, z];
    let plate = vec![corner(100.0, 500.0), corner(500.0, 500.0), corner(500.0, 100.0), corner(100.0, 100.0)];
    let session = session(settings(1, 0));
    session.with_scene(|db| {
        db.upsert_mesh(square(prim("/floor", DMat4::from_scale(DVec3::splat(1000.0))), 1, 0.5));
        db.upsert_mesh(mesh(prim("/plate", DMat4::IDENTITY), 2, plate, &[vec![0, 1, 2, 3]], 0.5));
        db.upsert_light(sun(1.0, 0.0, upwards));
    });
    let red = |target: DVec3| {
        let request = color_request(perspective(DVec3::new(0.0, 600.0, 2000.0), target, 0.001, [4, 4]));
        render(&session, &request);
        read::<[f32; 4]>(&session, &request, AovKind::Color).into_iter().map(|pixel| pixel[0]).collect::<Vec<f32>>()
    };
    assert!(red(DVec3::new(300.0, 0.0, 300.0)).iter().all(|red| *red == 0.0), "the floor below the plate is dark");
    let lit = red(DVec3::new(-300.0, 0.0, 300.0));
    assert!(lit.iter().all(|red| (red * std::f32::consts::PI - 0.5).abs() < 1e-5), "and bright beside it: {lit:?}");
}
