// SPDX-License-Identifier: Apache-2.0
//! Mesh lights whose emission a program computes: closed forms by polygons, and the same light met by BSDF rays only.

use super::downwards;
use super::mesh_textures::{Library, above, add, behind, row, screen, textured};
use super::shapes::polygon;
use crate::materials::{color, material, node, with};
use crate::support::{color_request, orthographic, render, session, settings};
use glam::{DMat4, DVec3};
use oocpt_core::scene::{AssetRef, Interpolation, MaterialDesc, ParamValue, SceneDb};
use std::sync::Arc;

fn text(text: &str) -> ParamValue {
    ParamValue::Text(text.into())
}

fn float(value: f32) -> ParamValue {
    ParamValue::Float(value)
}

type Nodes<'a> = &'a [(&'a str, &'a [(&'a str, ParamValue)], &'a [(&'a str, usize)])];

/// A material that reflects nothing and emits the value of the first of `nodes`; they are numbered from 1.
fn emitting(nodes: Nodes<'_>) -> MaterialDesc {
    let dark = [("base_weight", float(0.0)), ("specular_weight", float(0.0)), ("emission_luminance", float(1.0))];
    let surface = node("ND_open_pbr_surface_surfaceshader", &dark, &[("emission_color", 1)]);
    let rest = nodes.iter().map(|(kind, values, connections)| node(kind, values, connections));
    material("/glow", std::iter::once(surface).chain(rest).collect())
}

/// The square of the primvar "glow", by channel.
fn squared() -> MaterialDesc {
    emitting(&[
        ("ND_multiply_color3", &[], &[("in1", 2), ("in2", 2)]),
        ("ND_geompropvalue_color3", &[("geomprop", text("glow"))], &[]),
    ])
}

/// A picture times noise over the texture coordinates, where only the picture's filter tells rays apart.
pub(crate) fn letters() -> MaterialDesc {
    let file = ParamValue::Asset(AssetRef { authored: "letters".into(), resolved: "letters".into() });
    emitting(&[
        ("ND_multiply_color3FA", &[], &[("in1", 2), ("in2", 3)]),
        ("ND_image_color3", &[("file", file)], &[]),
        ("ND_add_float", &[("in2", float(0.7))], &[("in1", 4)]),
        ("ND_noise2d_float", &[("amplitude", float(0.5))], &[("texcoord", 5)]),
        ("ND_multiply_vector2FA", &[("in2", float(5.0))], &[("in1", 6)]),
        ("ND_texcoord_vector2", &[], &[]),
    ])
}

/// Stripes over places in a frame: 1 or a tenth.
pub(crate) fn stripes(space: &str) -> MaterialDesc {
    emitting(&[
        ("ND_convert_float_color3", &[], &[("in", 2)]),
        ("ND_ifgreater_float", &[("value2", float(0.0)), ("in1", float(1.0)), ("in2", float(0.1))], &[("value1", 3)]),
        ("ND_sin_float", &[], &[("in", 4)]),
        ("ND_dotproduct_vector3", &[("in2", ParamValue::Vec3([9.0, 2.0, 5.0]))], &[("in1", 5)]),
        ("ND_position_vector3", &[("space", text(space))], &[]),
    ])
}

/// Emission that grows along x of the view direction.
fn by_view() -> MaterialDesc {
    emitting(&[
        ("ND_convert_float_color3", &[], &[("in", 2)]),
        ("ND_add_float", &[("in2", float(1.5))], &[("in1", 3)]),
        ("ND_dotproduct_vector3", &[("in2", ParamValue::Vec3([1.0, 0.5, 0.25]))], &[("in1", 4)]),
        ("ND_viewdirection_vector3", &[("space", text("world"))], &[]),
    ])
}

/// Emission that depends on the surface's normal: it cannot be sampled as a light.
fn by_normal() -> MaterialDesc {
    emitting(&[
        ("ND_convert_float_color3", &[], &[("in", 2)]),
        ("ND_add_float", &[("in2", float(2.5))], &[("in1", 3)]),
        ("ND_dotproduct_vector3", &[("in2", ParamValue::Vec3([0.0, 1.0, 2.0]))], &[("in1", 4)]),
        ("ND_normal_vector3", &[("space", text("world"))], &[]),
    ])
}

/// One value for all, for each face, for each corner of a face; one face is dark.
#[test]
fn uniform_emission_programs_match_polygon_irradiance() {
    let values = [[1.0_f32, 0.0, 0.0], [0.0; 3], [4.0, 3.0, 0.5], [0.0, 0.75, 2.0], [0.0, 0.0, 0.375]];
    let (desc, places) = row(above());
    let corners: Vec<[f32; 3]> = places.iter().zip(values).flat_map(|(face, value)| vec![value; face.len()]).collect();
    let cases = [
        (Interpolation::Constant, vec![[0.5_f32, 1.5, 1.0]]),
        (Interpolation::Uniform, values.to_vec()),
        (Interpolation::FaceVarying, corners),
    ];
    for (interpolation, given) in cases {
        let value = |face: usize| if given.len() == 1 { given[0] } else { values[face] };
        let wanted = |k: usize| -> f64 {
            places.iter().enumerate().map(|(face, corners)| f64::from(value(face)[k]).powi(2) * polygon(corners)).sum()
        };
        let build = |db: &mut SceneDb| {
            db.upsert_material(squared());
            db.upsert_mesh(with(desc.clone(), "glow", interpolation, given.clone()));
        };
        for (irradiance, how) in super::irradiances(2048, &build).into_iter().zip(["shadow rays", "both"]) {
            for (k, irradiance) in irradiance.into_iter().enumerate() {
                let wanted = wanted(k);
                assert!(
                    (irradiance / wanted - 1.0).abs() < 1e-2,
                    "{interpolation:?}, {how}, {k}: {irradiance}, not {wanted}"
                );
            }
        }
    }
}

/// A square between points: u squared, integrated.
#[test]
fn interpolated_emission_programs_match_their_integral() {
    const STEPS: u32 = 200;
    let transform = behind();
    let mut desc = super::mesh::quad("/quad", 2, transform);
    let ramp = vec![[0.0_f32, 0.5, 1.0], [2.0, 0.5, 1.0], [2.0, 1.5, 1.0], [0.0, 1.5, 1.0]];
    add(&mut desc, "glow", Interpolation::Vertex, ramp);
    let mut wanted = [0.0; 3];
    let at = |k: u32| f64::from(k) / f64::from(STEPS) * 2.0 - 1.0;
    for (i, j) in (0..STEPS).flat_map(|i| (0..STEPS).map(move |j| (i, j))) {
        let [low, high] = [[at(i), at(j)], [at(i + 1), at(j + 1)]];
        let patch = [[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]]
            .map(|[x, y]| transform.transform_point3(DVec3::new(x, y, 0.0)));
        let share = polygon(&patch);
        let [x, y] = [0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1])];
        let values: [f64; 3] = [1.0 + x, 1.0 + 0.5 * y, 1.0];
        for (wanted, value) in wanted.iter_mut().zip(values) {
            *wanted += share * value.powi(2);
        }
    }
    let build = |db: &mut SceneDb| {
        db.upsert_material(squared());
        db.upsert_mesh(desc.clone());
    };
    for irradiance in super::irradiances(2048, &build) {
        for (given, wanted) in irradiance.into_iter().zip(wanted) {
            assert!((given / wanted - 1.0).abs() < 1e-2, "{given}, not {wanted}");
        }
    }
}

/// Shadow rays and BSDF rays see the same emission of a program.
#[test]
fn shadow_rays_and_hit_rays_run_the_same_emission_program() {
    let leaning = DMat4::from_translation(DVec3::new(-0.3, 1.0, -0.6))
        * DMat4::from_rotation_x(-1.1)
        * DMat4::from_scale(DVec3::new(1.3, 0.8, 1.0));
    let cases = [
        ("letters", letters()),
        ("places in the mesh", stripes("object")),
        ("places in the world", stripes("world")),
        ("directions", by_view()),
    ];
    let mut wrong = Vec::new();
    for (what, material) in cases {
        let build = |is_alone| {
            let material = material.clone();
            move |db: &mut SceneDb| {
                db.upsert_material(material.clone());
                screen(db, leaning, is_alone);
            }
        };
        let [shadow, both] = textured(1024, &build(true));
        let [_, chance] = textured(2048, &build(false));
        // The scatter of 256 pixels gives the errors of the means.
        for (how, given) in [("shadow rays", shadow), ("both", both)] {
            let sigma = ((given.1 + chance.1) / 256.0).sqrt();
            let off = given.0 / chance.0 - 1.0;
            println!("{what}, {how}: {:.4}, by chance {:.4}: off by {off:.1e}, sigma {sigma:.1e}", given.0, chance.0);
            assert!(given.0 > 0.01 && sigma < 4e-3, "{what}, {how}: too noisy to tell: {sigma}");
            if off.abs() > 4.0 * sigma + 5e-4 {
                wrong.push(format!("{what}, {how}: off by {off}, sigma {sigma}"));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Sampling gives far less noise than BSDF rays alone.
#[test]
fn a_small_program_emitter_has_low_noise() {
    let small = downwards(DVec3::new(0.0, 1.0, -0.5)) * DMat4::from_scale(DVec3::splat(0.1));
    for (what, material) in [("letters", letters()), ("places", stripes("object"))] {
        let noise = |is_alone: bool| {
            let build = |db: &mut SceneDb| {
                db.upsert_material(material.clone());
                screen(db, small, is_alone);
            };
            textured(64, &build)[1].1
        };
        let (light, chance) = (noise(true), noise(false));
        println!("{what}: relative MSE at 64 samples: as a light {light:.3e}, by chance {chance:.3e}");
        assert!(chance > 20.0 * light, "{what}: as a light {light}, by chance {chance}");
    }
}

/// Only scenes that need programs of emission have them; emission that reads the normal is met by BSDF rays only.
#[test]
fn scenes_without_emission_programs_omit_them() {
    let left_out = |material: MaterialDesc| {
        let session = session(settings(1, 1)).with_images(Arc::new(Library("")));
        session.with_scene(|db| {
            db.upsert_material(material);
            screen(db, DMat4::IDENTITY, true);
        });
        let request = color_request(orthographic(DVec3::new(0.0, 0.0, 3.0), DVec3::ZERO, 1.0, [8, 8]));
        render(&session, &request);
        let left_out = session.stats().features_left_out;
        let names = ["emissive meshes", "emission of lights by textures", "emission of lights by programs"];
        names.map(|name| left_out.iter().any(|part| part.starts_with(name)))
    };
    assert_eq!(left_out(super::mesh::glow("/glow", [1.0; 3])), [false, true, true], "a constant");
    assert_eq!(left_out(letters()), [false, false, false], "a program");
    assert_eq!(left_out(by_normal()), [true, true, true], "the normal");
    let dark = color([0.0; 3]);
    let never = emitting(&[
        ("ND_multiply_color3", &[], &[("in1", 2), ("in2", 3)]),
        ("ND_convert_float_color3", &[], &[("in", 4)]),
        ("ND_max_color3", &[("in2", dark)], &[("in1", 5)]),
        ("ND_cellnoise3d_float", &[], &[("position", 6)]),
        ("ND_geompropvalue_color3", &[("geomprop", text("nothing"))], &[]),
        ("ND_position_vector3", &[], &[]),
    ]);
    assert_eq!(left_out(never), [true, true, true], "black wherever it is looked at");
}
