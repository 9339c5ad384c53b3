// SPDX-License-Identifier: Apache-2.0
//! Lights against closed forms: a small patch of a white-ish floor at the origin, facing up, and the irradiance on it.
//!
//! Every answer is tested twice: with direct light only, where shadow rays contribute all of it, and with a bounce,
//! where shadow rays and BSDF rays share it by the balance heuristic.

mod dome;
mod light_tree;
mod links_and_shadows;
mod local_and_infinite;
mod mesh;
mod mesh_programs;
mod mesh_textures;
mod moving;
mod moving_extremes;
mod moving_meshes;
mod shapes;
mod shaping;
mod test_files;

pub(crate) use mesh_programs::stripes;
pub(crate) use test_files::TestFiles;

use crate::scenes::{prim, square};
use crate::support::{color_request, orthographic, read, render, session, settings};
use glam::{DMat4, DVec3};
use oocpt_core::scene::SceneDb;
use oocpt_core::settings::Settings;
use oocpt_core::{LightDesc, LightKind};
use oocpt_render::AovKind;
use std::f64::consts::PI;
use std::sync::Arc;

const ALBEDO: f32 = 0.5;

/// A light of radiance 1 that the camera does not see.
pub(crate) fn light(kind: LightKind, transform: DMat4) -> LightDesc {
    LightDesc { prim: prim("/light", transform), kind, camera_visible: false, ..LightDesc::default() }
}

/// A transform that turns -z down, at `at`.
fn downwards(at: DVec3) -> DMat4 {
    DMat4::from_translation(at) * DMat4::from_rotation_x(-PI / 2.0)
}

fn rect(width: f32, height: f32) -> LightKind {
    LightKind::Rect { width, height, texture: None }
}

fn sphere(radius: f32) -> LightKind {
    LightKind::Sphere { radius, treat_as_point: false }
}

fn disk(radius: f32) -> LightKind {
    LightKind::Disk { radius }
}

fn cylinder(length: f32, radius: f32) -> LightKind {
    LightKind::Cylinder { length, radius, treat_as_line: false }
}

/// Irradiance at the origin, by colour, in the scene that `build` adds to the floor, and how many contributions were
/// not finite.
fn irradiance_with(settings: Settings, build: &dyn Fn(&mut SceneDb)) -> [f64; 3] {
    let session = session(settings);
    session.set_light_files(Arc::new(TestFiles));
    session.with_scene(|db| {
        db.upsert_mesh(square(prim("/floor", DMat4::IDENTITY), 1, ALBEDO));
        build(db);
    });
    let request = color_request(orthographic(DVec3::new(0.0, 5.0, 3.0), DVec3::ZERO, 0.01, [8, 8]));
    render(&session, &request);
    let colors: Vec<[f32; 4]> = read(&session, &request, AovKind::Color);
    assert!(colors.iter().flatten().all(|c| c.is_finite()), "no pixel may be NaN or infinite");
    #[expect(clippy::cast_precision_loss, reason = "a few pixels")]
    let scale = PI / f64::from(ALBEDO) / colors.len() as f64;
    [0, 1, 2].map(|k| scale * colors.iter().map(|color| f64::from(color[k])).sum::<f64>())
}

/// Irradiance with shadow rays alone, and with both strategies.
fn irradiances(samples: u32, build: &dyn Fn(&mut SceneDb)) -> [[f64; 3]; 2] {
    [0, 1].map(|bounces| irradiance_with(settings(samples, bounces), build))
}

/// Asserts the irradiance, of all colours, to a relative `error`.
fn expect(what: &str, samples: u32, expected: f64, error: f64, build: &dyn Fn(&mut SceneDb)) {
    for (given, how) in irradiances(samples, build).into_iter().zip(["shadow rays alone", "both strategies"]) {
        for value in given {
            assert!((value - expected).abs() <= error * expected.abs(), "{what}, {how}: {value}, not {expected}");
        }
    }
}
