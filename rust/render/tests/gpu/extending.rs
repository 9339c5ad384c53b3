// SPDX-License-Identifier: Apache-2.0
//! The lobe and the light that `rust/book/src/extending.md` adds, against closed forms; and how many files they take.
//! The kind of leaf that it adds is in [`leaf`].

mod leaf;

use crate::materials::{board, color, plain};
use crate::scenes::{dome, prim, square, sun};
use crate::support::{color_request, orthographic, perspective, read, render, session, settings};
use glam::{DMat4, DVec3};
use oocpt_abi::{Features, LIGHT_SHAPES};
use oocpt_core::scene::{LightDesc, LightKind, LocalShape, ParamValue, SceneDb};
use oocpt_render::{AovKind, PlantedFaults, Session, SessionOptions};
use std::collections::BTreeSet;
use std::f64::consts::{FRAC_1_PI, FRAC_PI_2, PI};
use std::fs;
use std::path::{Path, PathBuf};

/// Of the diffuse lobe; the toy reflects half of what it leaves.
const DIFFUSE: f64 = 0.4;
const TOY: f64 = 0.5 * (1.0 - DIFFUSE);

/// A board without specular reflection under `light`, and with a `wall` of it at its side.
fn lit(db: &mut SceneDb, light: LightDesc, wall: bool) {
    let params = [
        #[expect(clippy::cast_possible_truncation, reason = "a colour")]
        ("diffuseColor", color([DIFFUSE as f32; 3])),
        ("useSpecularWorkflow", ParamValue::Int(1)),
        ("specularColor", color([0.0; 3])),
    ];
    db.upsert_material(plain("/toy", &params));
    db.upsert_mesh(board("/board", 1, "/toy"));
    if wall {
        let mut desc = board("/wall", 2, "/toy");
        desc.prim.transform = DMat4::from_translation(DVec3::X) * DMat4::from_rotation_y(-1.0);
        db.upsert_mesh(desc);
    }
    db.upsert_light(light);
}

/// The colours of that, seen from the front, with the toy and at `samples` per pixel.
fn colors(light: LightDesc, samples: u32, [wall, force_streaming]: [bool; 2]) -> Vec<[f32; 4]> {
    let faults = PlantedFaults { more_features: Features::TOY_LOBE, ..PlantedFaults::default() };
    let options = SessionOptions { validation: true, force_streaming, faults, ..SessionOptions::default() };
    let session = Session::with_options(settings(samples, 2), options);
    session.with_scene(|db| lit(db, light, wall));
    let request = color_request(orthographic(DVec3::Z * 5.0, DVec3::ZERO, 2.0, [16, 16]));
    render(&session, &request);
    read(&session, &request, AovKind::Color)
}

#[expect(clippy::cast_precision_loss, reason = "few pixels")]
fn mean(colors: &[[f32; 4]]) -> f64 {
    colors.iter().map(|color| f64::from(color[0])).sum::<f64>() / colors.len() as f64
}

#[test]
fn the_example_lobe_is_constant_under_a_distant_light() {
    for degrees in [0.0_f64, 40.0, 80.0] {
        let turn = DMat4::from_rotation_y(degrees.to_radians());
        let expected = 3.0 * (DIFFUSE * FRAC_1_PI * degrees.to_radians().cos() + TOY / (2.0 * PI));
        for color in colors(sun(3.0, 0.0, turn), 2, [false; 2]) {
            let given = f64::from(color[0]);
            assert!((given - expected).abs() < 2e-6, "{degrees} degrees: {given} instead of {expected}");
        }
    }
}

#[test]
fn the_example_lobe_in_a_dome_has_its_albedo() {
    let given = mean(&colors(dome([2.0; 3]), 64, [false; 2]));
    let expected = 2.0 * (DIFFUSE + TOY);
    assert!((given - expected).abs() < 2e-3, "{given} instead of {expected}");
}

#[test]
fn the_example_lobe_streams_with_the_same_bits() {
    let images = [false, true].map(|streams| colors(dome([1.0; 3]), 8, [true, streams]));
    assert!(images[0] == images[1], "streaming changed the picture");
}

/// A toy light of radiance 3 over the floor y = 0, `height` above it, shining down.
fn triangle(height: f64) -> LightDesc {
    let turn = DMat4::from_rotation_x(-FRAC_PI_2);
    LightDesc {
        prim: prim("/light", DMat4::from_translation(DVec3::Y * height) * turn),
        kind: LightKind::ToyLight { side: 2.0 },
        color: [1.0; 3],
        intensity: 3.0,
        normalize: false,
        ..dome([1.0; 3])
    }
}

/// Corners of that light in the world.
fn corners(height: f64) -> [DVec3; 3] {
    let to_world = triangle(height).prim.transform;
    [[-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0]].map(|[x, y]| to_world.transform_point3(DVec3::new(x, y, 0.0)))
}

/// Irradiance at a point with normal y below a polygon of radiance 1 (Lambert 1760; Baum et al. 1989, eq. 4).
fn irradiance(point: DVec3, corners: &[DVec3]) -> f64 {
    let directions: Vec<DVec3> = corners.iter().map(|corner| (*corner - point).normalize()).collect();
    let edge = |k: usize| {
        let (a, b) = (directions[k], directions[(k + 1) % directions.len()]);
        a.cross(b).normalize().y * a.dot(b).acos()
    };
    0.5 * (0..directions.len()).map(edge).sum::<f64>().abs()
}

fn under_the_light(eye: DVec3, target: DVec3, height: f64, force_streaming: bool) -> Vec<[f32; 4]> {
    let options = SessionOptions { validation: true, force_streaming, ..SessionOptions::default() };
    let session = Session::with_options(settings(64, 1), options);
    session.with_scene(|db| {
        db.upsert_mesh(square(prim("/floor", DMat4::from_scale(DVec3::splat(4.0))), 1, 0.5));
        db.upsert_light(LightDesc { camera_visible: false, ..triangle(height) });
    });
    let request = color_request(perspective(eye, target, 0.01, [24, 24]));
    render(&session, &request);
    read(&session, &request, AovKind::Color)
}

#[test]
fn the_example_light_gives_the_irradiance_of_a_triangle() {
    for target in [DVec3::new(0.3, 0.0, 0.2), DVec3::new(-1.0, 0.0, -0.5), DVec3::new(1.5, 0.0, 1.5)] {
        let given = mean(&under_the_light(target + DVec3::new(0.5, 3.0, 4.0), target, 1.5, false));
        let expected = 0.5 * FRAC_1_PI * 3.0 * irradiance(target, &corners(1.5));
        assert!((given / expected - 1.0).abs() < 0.01, "at {target}: {given} instead of {expected}");
    }
}

#[test]
fn the_example_light_streams_with_the_same_bits() {
    let eye = DVec3::new(0.5, 3.0, 4.0);
    let images = [false, true].map(|streams| under_the_light(eye, DVec3::ZERO, 1.5, streams));
    assert!(images[0] == images[1], "streaming changed the picture");
}

/// Pixels of a picture of the light's square that see it.
fn seen_from(eye: DVec3) -> Vec<bool> {
    let session = session(settings(1, 1));
    session.with_scene(|db| db.upsert_light(LightDesc { camera_visible: true, ..triangle(0.0) }));
    let request = color_request(orthographic(eye, DVec3::ZERO, 2.0, [32, 32]));
    render(&session, &request);
    let colors: Vec<[f32; 4]> = read(&session, &request, AovKind::Color);
    assert!(colors.iter().all(|color| [0.0, 3.0].contains(&color[0])), "its radiance, or none");
    colors.iter().map(|color| color[0] > 0.0).collect()
}

#[test]
fn the_example_light_is_seen_as_a_one_sided_triangle() {
    let seen = seen_from(DVec3::new(0.0, -3.0, 1.0e-3)).iter().filter(|seen| **seen).count();
    // Half of the square, but for the 32 pixels on its diagonal.
    assert!(seen.abs_diff(512) <= 32, "{seen} of 1024 pixels");
    assert!(!seen_from(DVec3::new(0.0, 3.0, 1.0e-3)).contains(&true), "its back is dark");
}

/// Source files that mention one of the names, in any case, or are called so; documents and tests apart.
fn mentions(names: [&str; 2]) -> Vec<PathBuf> {
    let repo = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let mut waiting: Vec<PathBuf> = ["rust", "shaders", "cpp"].map(|folder| repo.join(folder)).to_vec();
    let mut found = Vec::new();
    while let Some(path) = waiting.pop() {
        if path.is_dir() {
            let is_left_out = ["tests", "book", "decisions"].iter().any(|folder| path.ends_with(folder));
            if !is_left_out {
                waiting.extend(fs::read_dir(&path).expect("a folder").map(|entry| entry.expect("an entry").path()));
            }
            continue;
        }
        let stem = path.file_stem().unwrap_or_default().to_string_lossy().to_lowercase();
        let text = fs::read(&path).expect("a file");
        let text = String::from_utf8_lossy(&text).to_lowercase();
        if names.iter().any(|name| stem == *name || text.contains(name)) {
            found.push(path);
        }
    }
    found.sort();
    found
}

#[test]
fn a_lobe_takes_at_most_four_files() {
    let found = mentions(["toy_lobe", "toylobe"]);
    let own = Path::new("shaders/material/bsdf/lobes/toy_lobe.glsl");
    assert!(found.iter().any(|path| path.ends_with(own)), "the count sees the lobe's own file: {found:?}");
    assert!(found.len() <= 4, "{found:#?}");
}

#[test]
fn a_light_takes_at_most_four_files() {
    let found = mentions(["toy_light", "toylight"]);
    let own = Path::new("shaders/light/shapes/toy_light.glsl");
    assert!(found.iter().any(|path| path.ends_with(own)), "the count sees the light's own file: {found:?}");
    assert!(found.len() <= 4, "{found:#?}");
}

#[test]
fn every_shape_of_a_light_has_a_row() {
    use LocalShape::{Cylinder, Disk, Line, Point, Rect, Sphere, ToyLight};
    let shapes = [Rect, Disk, Sphere, Cylinder, Point, Line, ToyLight];
    let thin = |name: &str| LIGHT_SHAPES.iter().find(|row| row.name == name).map(|row| row.is_thin);
    for shape in shapes {
        assert_eq!(thin(shape.name()), Some(shape.is_thin()), "{shape:?}");
    }
    let names: BTreeSet<&str> = shapes.iter().map(|shape| shape.name()).collect();
    let kinds: BTreeSet<u32> = LIGHT_SHAPES.iter().map(|row| row.kind).collect();
    assert_eq!([names.len(), kinds.len(), LIGHT_SHAPES.len()], [shapes.len(); 3], "each has its own");
}
