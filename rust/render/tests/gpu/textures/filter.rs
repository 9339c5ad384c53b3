// SPDX-License-Identifier: Apache-2.0
//! How coarsely textures are looked up: levels that are known, and a ground seen at a grazing angle against the same
//! picture without a filter, worked out in f64.

use super::test_images::{CHECKS, Library, check};
use super::{node, options, text, textured};
use crate::scenes::{constant, dome, mesh, prim, sun};
use crate::support::{self, color_request, orthographic, perspective, read, request, settings};
use glam::{DMat2, DMat4, DVec2, DVec3};
use oocpt_core::scene::{Interpolation, MaterialDesc, MeshDesc, NamedPrimvar, ParamDesc, ParamValue, Primvar, SceneDb};
use oocpt_core::settings::Settings;
use oocpt_core::texture::{TextureSampler, TileLayout, Wrap, ellipse};
use oocpt_core::{Camera, TypedArray};
use oocpt_render::{AovKind, RenderRequest, Session};
use std::sync::Arc;

/// A quad in the plane z = 0 from -`half` to `half`, whose st go from 0 to `st`.
fn quad(place: DMat4, half: f32, st: [f32; 2], material: &str) -> MeshDesc {
    let points = vec![[-half, -half, 0.0], [half, -half, 0.0], [half, half, 0.0], [-half, half, 0.0]];
    let mut desc = mesh(prim("/board", place), 1, points, &[vec![0, 1, 2, 3]], 0.5);
    let values = TypedArray::of(vec![[0.0, 0.0], [st[0], 0.0], st, [0.0, st[1]]]);
    let primvar = Primvar { interpolation: Interpolation::Vertex, values, indices: None };
    desc.primvars.push(NamedPrimvar { name: "st".into(), primvar });
    desc.display_color = constant([0.5_f32; 3]);
    desc.material = Some(material.into());
    desc
}

fn session(settings: Settings, material: MaterialDesc, build: impl FnOnce(&mut SceneDb)) -> Session {
    let session = Session::with_options(settings, options()).with_images(Arc::new(Library));
    session.with_scene(|db| {
        db.upsert_material(material);
        build(db);
    });
    session
}

/// A view of 2 units in 32 x 32 pixels.
fn front() -> Camera {
    orthographic(DVec3::Z * 400.0, DVec3::ZERO, 2.0, [32, 32])
}

/// A large board behind the whole picture, 16 texels of "steps" to the pixel when it faces the camera, turned away from
/// it by `tilt`.
fn board(db: &mut SceneDb, tilt: f64) {
    db.upsert_mesh(quad(DMat4::from_rotation_x(tilt), 128.0, [128.0; 2], "/m"));
}

fn middle(material: MaterialDesc, tilt: f64) -> f32 {
    let session = session(settings(1, 1), material, |db| {
        board(db, tilt);
        db.upsert_light(dome([1.0; 3]));
    });
    support::render(&session, &request(front()));
    read::<[f32; 3]>(&session, &request(front()), AovKind::Albedo)[16 * 32 + 16][0]
}

fn steps(own: Vec<(&str, ParamValue)>, input: &str) -> MaterialDesc {
    textured("/m", "steps", own, &[(input, "r")])
}

/// The angle at which a surface is `times` as long as it looks.
fn slant(times: f64) -> f64 {
    (1.0 / times).acos()
}

/// Not by its longer side, up to a ratio of sixteen.
#[test]
fn a_slanted_surface_is_looked_up_as_coarse_as_its_shorter_side() {
    for (times, level) in [(1.0, 4.0), (2.0, 4.0), (-2.0, 4.0), (15.9, 4.0), (32.0, 5.0), (-32.0, 5.0), (64.0, 6.0)] {
        let tilt = slant(f64::abs(times)) * f64::signum(times);
        let got = middle(steps(Vec::new(), "diffuseColor"), tilt) * 255.0 / 20.0;
        assert!((got - level).abs() < 3e-3, "{times} times as long: level {got}, not {level}");
    }
}

/// The level follows the shorter axis in texels, whatever maps coordinates to it.
#[test]
fn a_texture_that_is_scaled_down_is_looked_up_coarser() {
    for (scale, level) in [
        ([2.0_f32, 2.0], 5.0),
        ([4.0, 1.0], 4.0),
        ([8.0, 1.0], 4.0),
        ([64.0, 1.0], 6.0),
        ([0.5, 4.0], 3.0),
        ([-0.5, 0.5], 3.0),
    ] {
        let mut material = steps(Vec::new(), "diffuseColor");
        material.nodes[1].connections[0].node = 3;
        let params = vec![("scale", ParamValue::Vec2(scale)), ("rotation", ParamValue::Float(30.0))];
        material.nodes.push(node("/transform", "UsdTransform2d", params, &[("in", 2, "result")]));
        let got = middle(material, 0.0) * 255.0 / 20.0;
        assert!((got - level).abs() < 1e-3, "{scale:?}: level {got}, not {level}");
    }
}

/// What is compared is not filtered, nor are the levels of the file asked: level 0 is 0 all over, levels 5 and 6 are
/// 0.39 and 0.47.
#[test]
fn a_cutout_is_told_by_the_finest_level_however_slanted() {
    for times in [1.0, 2.0, -8.0, 32.0, -32.0, 64.0] {
        for (scale, bias, there) in [(1.0, 0.0, false), (-1.0, 0.4, true)] {
            let mut material = steps(vec![("opacityThreshold", ParamValue::Float(0.35))], "opacity");
            for (name, value) in [("scale", scale), ("bias", bias)] {
                material.nodes[1].params.push(ParamDesc { name: name.into(), value: ParamValue::Vec4([value; 4]) });
            }
            let seen = middle(material, slant(f64::abs(times)) * f64::signum(times));
            assert_eq!(seen > 0.0, there, "{times} times, {scale}");
        }
    }
}

fn color(session: &Session, request: &RenderRequest) -> Vec<f64> {
    support::render(session, request);
    let pixels: Vec<[f32; 4]> = read(session, request, AovKind::Color);
    pixels.iter().map(|pixel| f64::from(pixel[0])).collect()
}

/// Color has many samples in a pixel, and a filter of half its width for each: one level finer than what has one.
#[test]
fn colour_lookups_use_a_finer_level_than_single_sample_ones() {
    let material = steps(vec![("diffuseColor", ParamValue::Vec3([0.0; 3]))], "emissiveColor");
    let session = session(settings(1, 0), material, |db| board(db, slant(2.0)));
    for level in color(&session, &color_request(front())).iter().map(|value| value * 255.0 / 20.0) {
        assert!((level - 3.0).abs() < 1e-3, "level {level}, not 3");
    }
}

/// A board that leans by 60 degrees has the roughness of level 3, and not that of level 4, which its longer side has.
#[test]
fn roughness_lookups_use_the_colour_level() {
    let lit = |roughness: Option<f32>| {
        let own = vec![("metallic", ParamValue::Float(1.0)), ("diffuseColor", ParamValue::Vec3([0.9; 3]))];
        let mut material = steps(own, "roughness");
        if let Some(value) = roughness {
            material.nodes[0].connections.clear();
            material.nodes[0].params.push(ParamDesc { name: "roughness".into(), value: ParamValue::Float(value) });
        }
        let session = session(settings(16, 0), material, |db| {
            board(db, slant(2.0));
            db.upsert_light(sun(2.0, 2.0, DMat4::from_rotation_x(1.9)));
        });
        let pixels = color(&session, &color_request(front()));
        pixels.iter().sum::<f64>() / 1024.0
    };
    let seen = lit(None);
    let by_level = [3.0_f32, 4.0].map(|level| lit(Some(level * 20.0 / 255.0)));
    assert!((seen / by_level[0] - 1.0).abs() < 1e-3, "{seen}, not {by_level:?}");
    assert!((seen / by_level[1] - 1.0).abs() > 0.1, "levels differ: {seen}, {by_level:?}");
}

const SIZE: [u32; 2] = [48, 32];
/// A ground of 2000 x 2000 units, a unit below the eye; st grow by these per unit.
const HALF: f32 = 1000.0;

fn eye() -> Camera {
    perspective(DVec3::Y, DVec3::new(0.0, 0.75, -1.0), 0.7, SIZE)
}

fn ground(density: [f32; 2], material: MaterialDesc, samples: u32) -> Vec<f64> {
    let session = session(settings(samples, 0), material, |db| {
        let st = density.map(|d| 2.0 * d * HALF);
        db.upsert_mesh(quad(DMat4::from_rotation_x(-std::f64::consts::FRAC_PI_2), HALF, st, "/m"));
    });
    color(&session, &color_request(eye()))
}

/// The picture of the ground by n x n samples in a pixel, each by a filter whose width is that of the ellipse of a
/// pixel's cone by `width`.
fn expected(density: [f32; 2], n: u32, width: fn([f64; 2]) -> f64) -> Vec<f64> {
    let density = density.map(f64::from);
    let layout = TileLayout::new([CHECKS; 2], 1).expect("a layout");
    let texel = |level: u32, x: u32, y: u32| [f64::from(check(level, x, y)) / 255.0; 4];
    let sampler = TextureSampler { layout, wrap: [Wrap::Repeat, Wrap::Mirror], outside: [0.0; 4], texel };
    let camera = eye();
    let half_height = 0.35_f64.tan();
    let [w, h] = SIZE.map(f64::from);
    let gradients = [DVec3::X * density[0], DVec3::NEG_Z * density[1]];
    let at = |x: f64, y: f64| {
        let view = DVec3::new((2.0 * x / w - 1.0) * half_height * w / h, (2.0 * y / h - 1.0) * half_height, -1.0);
        let direction = camera.world_from_view.transform_vector3(view);
        let met = DVec3::Y - direction / direction.y;
        if direction.y >= 0.0 || met.abs().max_element() > f64::from(HALF) {
            return 0.0;
        }
        let cone = 2.0 * half_height / h / view.length() * (met - DVec3::Y).length();
        let axes = ellipse(gradients, DVec3::Y, direction, DMat2::IDENTITY, [CHECKS; 2]).map(|axis| axis * cone);
        let st = DVec2::new(met.x + f64::from(HALF), f64::from(HALF) - met.z) * DVec2::from(density);
        sampler.lookup(st.to_array(), width(axes))[0]
    };
    let step = |i: u32| (f64::from(i) + 0.5) / f64::from(n);
    let pixel = |i: u32| {
        let samples =
            (0..n * n).map(|k| at(f64::from(i % SIZE[0]) + step(k % n), f64::from(i / SIZE[0]) + step(k / n)));
        samples.sum::<f64>() / f64::from(n * n)
    };
    (0..SIZE[0] * SIZE[1]).map(pixel).collect()
}

fn error(picture: &[f64], reference: &[f64]) -> f64 {
    let relative = |(a, b): (&f64, &f64)| (a - b).powi(2) / (b * b + 0.01);
    picture.iter().zip(reference).map(relative).sum::<f64>() / picture.len() as f64
}

/// How much of the reference's differences between neighbours a picture has.
fn sharpness(picture: &[f64], reference: &[f64]) -> f64 {
    let row = SIZE[0] as usize;
    let edges = |image: &[f64]| -> Vec<f64> {
        let inside = (row + 1..image.len() - row - 1).filter(|i| i % row != 0 && i % row != row - 1);
        inside.map(|i| 4.0 * image[i] - image[i - 1] - image[i + 1] - image[i - row] - image[i + row]).collect()
    };
    let (a, b) = (edges(picture), edges(reference));
    a.iter().zip(&b).map(|(a, b)| a * b).sum::<f64>() / b.iter().map(|b| b * b).sum::<f64>()
}

fn glowing() -> MaterialDesc {
    textured("/m", "checks", vec![("diffuseColor", ParamValue::Vec3([0.0; 3]))], &[("emissiveColor", "r")])
}

/// A filter by the longer axis, with no noise at all, is farther from the picture without a filter than the renderer at
/// 64 samples.
#[test]
fn anisotropic_filtering_of_a_ground_beats_isotropic() {
    for density in [[0.25, 0.25], [1.0, 0.125]] {
        let reference = expected(density, 64, |_| 0.0);
        let isotropic = expected(density, 8, |[longer, _]| longer);
        let seen = ground(density, glowing(), 64);
        let errors = [error(&seen, &reference), error(&isotropic, &reference)];
        assert!(errors[0] * 50.0 < errors[1], "{density:?}: relMSE and that of the other {errors:?}");
        let sharp = [sharpness(&seen, &reference), sharpness(&isotropic, &reference)];
        assert!((0.95..1.02).contains(&sharp[0]) && sharp[1] < 0.7, "{density:?}: edges kept {sharp:?}");
    }
}

/// Where the checks are holes: a surface that is there by chance is so in the mean.
#[test]
fn anisotropic_filtering_of_cutouts_beats_isotropic() {
    let density = [0.25, 0.25];
    let own = vec![
        ("diffuseColor", ParamValue::Vec3([0.0; 3])),
        ("emissiveColor", ParamValue::Vec3([1.0; 3])),
        ("opacityMode", text("presence")),
    ];
    let seen = ground(density, textured("/m", "checks", own, &[("opacity", "r")]), 256);
    let reference = expected(density, 64, |_| 0.0);
    let isotropic = expected(density, 16, |[longer, _]| longer);
    let errors = [error(&seen, &reference), error(&isotropic, &reference)];
    assert!(errors[0] * 5.0 < errors[1], "relMSE and that of the other {errors:?}");
    let sharp = [sharpness(&seen, &reference), sharpness(&isotropic, &reference)];
    assert!((0.9..1.1).contains(&sharp[0]) && sharp[1] < 0.7, "edges kept {sharp:?}");
}
