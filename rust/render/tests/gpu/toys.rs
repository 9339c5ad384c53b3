// SPDX-License-Identifier: Apache-2.0
//! The lobe that `rust/book/src/extending.md` adds, against closed forms; and how many files it takes.

use crate::materials::{board, color, plain};
use crate::scenes::{dome, sun};
use crate::support::{color_request, orthographic, read, render, settings};
use glam::{DMat4, DVec3};
use oocpt_core::scene::{LightDesc, ParamValue, SceneDb};
use oocpt_render::{AovKind, Faults, Session, SessionOptions};
use oocpt_shader_abi::Features;
use std::f64::consts::{FRAC_1_PI, PI};
use std::fs;
use std::path::{Path, PathBuf};

/// Of the diffuse lobe; the toy reflects half of what it leaves.
const DIFFUSE: f64 = 0.4;
const TOY: f64 = 0.5 * (1.0 - DIFFUSE);

/// A board without specular reflection under `light`.
fn lit(db: &mut SceneDb, light: LightDesc) {
    let params = [
        #[expect(clippy::cast_possible_truncation, reason = "a colour")]
        ("diffuseColor", color([DIFFUSE as f32; 3])),
        ("useSpecularWorkflow", ParamValue::Int(1)),
        ("specularColor", color([0.0; 3])),
    ];
    db.upsert_material(plain("/toy", &params));
    db.upsert_mesh(board("/board", 1, "/toy"));
    db.upsert_light(light);
}

/// The board's colours, seen from the front, with the toy and at `samples` per pixel.
fn colors(light: LightDesc, samples: u32, force_streaming: bool) -> Vec<[f32; 4]> {
    let faults = Faults { more_features: Features::TOY_LOBE, ..Faults::default() };
    let options = SessionOptions { validation: true, force_streaming, faults, ..SessionOptions::default() };
    let session = Session::with_options(settings(samples, 2), options);
    session.with_scene(|db| lit(db, light));
    let request = color_request(orthographic(DVec3::Z * 5.0, DVec3::ZERO, 2.0, [16, 16]));
    render(&session, &request);
    read(&session, &request, AovKind::Color)
}

#[test]
fn a_toy_lobe_under_a_distant_light_does_not_ask_for_the_angle() {
    for degrees in [0.0_f64, 40.0, 80.0] {
        let turn = DMat4::from_rotation_y(degrees.to_radians());
        let expected = 3.0 * (DIFFUSE * FRAC_1_PI * degrees.to_radians().cos() + TOY / (2.0 * PI));
        for color in colors(sun(3.0, 0.0, turn), 2, false) {
            let given = f64::from(color[0]);
            assert!((given - expected).abs() < 2e-6, "{degrees} degrees: {given} instead of {expected}");
        }
    }
}

#[test]
fn a_toy_lobe_in_a_dome_has_its_albedo_and_the_same_bits_when_it_streams() {
    let given = colors(dome([2.0; 3]), 64, false);
    #[expect(clippy::cast_precision_loss, reason = "few pixels")]
    let mean = given.iter().map(|color| f64::from(color[0])).sum::<f64>() / given.len() as f64;
    let expected = 2.0 * (DIFFUSE + TOY);
    assert!((mean - expected).abs() < 2e-3, "{mean} instead of {expected}");
    assert!(given == colors(dome([2.0; 3]), 64, true), "streaming changed the picture");
}

/// Source files that mention `name`, in any case, or are called so; documents and tests apart.
fn mentions(name: &str) -> Vec<PathBuf> {
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
        let is_called_so = path.file_stem().is_some_and(|stem| stem.eq_ignore_ascii_case(name));
        let text = fs::read(&path).expect("a file");
        if is_called_so || String::from_utf8_lossy(&text).to_lowercase().contains(name) {
            found.push(path);
        }
    }
    found.sort();
    found
}

#[test]
fn a_lobe_takes_at_most_six_files() {
    let found = mentions("toy_lobe");
    let own = Path::new("shaders/include/bsdf/lobes/toy_lobe.glsl");
    assert!(found.iter().any(|path| path.ends_with(own)), "the count sees the lobe's own file: {found:?}");
    assert!(found.len() <= 6, "{found:#?}");
}
