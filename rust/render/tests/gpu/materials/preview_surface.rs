// SPDX-License-Identifier: Apache-2.0
//! Emission and albedo as they are authored, by mesh and by subset; the effect of each parameter of a surface.

use super::*;
use crate::scenes::sun;
use std::f64::consts::PI;

#[test]
fn emission_is_seen_exactly() {
    let glow = [1.5, 0.25, 3.7];
    let (session, request) = shown(
        |db| {
            let black = [("emissiveColor", color(glow)), ("diffuseColor", color([0.0; 3]))];
            db.upsert_material(plain("/glow", &black));
            db.upsert_mesh(board("/a", 1, "/glow"));
        },
        8,
    );
    let pixels: Vec<[f32; 4]> = read(&session, &request, AovKind::Color);
    assert!(pixels.iter().all(|p| *p == [glow[0], glow[1], glow[2], 1.0]), "{:?}", pixels[0]);
    let left_out = session.stats().features_left_out;
    let has = |part: &str| left_out.iter().any(|name| name.contains(part));
    assert!(
        !has("materials, and") && !has("emission of surfaces") && has("coats") && has("transmission"),
        "{left_out:?}"
    );
}

#[test]
fn a_scene_without_materials_omits_material_features() {
    let (session, _) = shown(
        |db| {
            db.upsert_mesh(MeshDesc { material: None, ..board("/a", 1, "") });
            db.upsert_light(dome([1.0; 3]));
        },
        1,
    );
    let left_out = session.stats().features_left_out;
    for part in ["materials, and", "cutouts in traversal", "emission", "coats", "transmission"] {
        assert!(left_out.iter().any(|name| name.contains(part)), "{part}: {left_out:?}");
    }
}

#[test]
fn emission_lights_other_surfaces() {
    // An emissive board of radiance 2 that fills the hemisphere of a small patch facing it: albedo * 2.
    let (session, request) = shown(
        |db| {
            // There is no specular lobe: its reflection is not in the sum.
            let dull = [("useSpecularWorkflow", ParamValue::Int(1)), ("specularColor", color([0.0; 3]))];
            let with = |params: &[(&'static str, ParamValue)]| [&dull[..], params].concat();
            let glow = [("emissiveColor", color([2.0; 3])), ("diffuseColor", color([0.0; 3]))];
            db.upsert_material(plain("/glow", &with(&glow)));
            db.upsert_material(plain("/grey", &with(&[("diffuseColor", color([0.5; 3]))])));
            let mut ceiling = board("/ceiling", 1, "/glow");
            ceiling.prim.transform = DMat4::from_scale_rotation_translation(
                DVec3::new(4000.0, 4000.0, 1.0),
                DQuat::IDENTITY,
                DVec3::new(0.0, 0.0, 9.0),
            );
            db.upsert_mesh(ceiling);
            db.upsert_mesh(board("/floor", 2, "/grey"));
        },
        16,
    );
    let pixels: Vec<[f32; 4]> = read(&session, &request, AovKind::Color);
    let mean: f32 = pixels.iter().map(|p| p[0]).sum::<f32>() / 1024.0;
    assert!((mean - 1.0).abs() < 0.01, "{mean}, not 0.5 * 2");
}

#[test]
fn subsets_show_their_materials_and_the_rest_its_color() {
    let values = [[0.25, 0.5, 1.0], [1.0, 0.0, 0.0]];
    let (session, request) = shown(
        |db| {
            db.upsert_material(plain("/m", &[("diffuseColor", color(values[0]))]));
            db.upsert_material(plain("/n", &[("diffuseColor", color(values[1]))]));
            let subset = |material: Option<&str>, face: i32| SubsetDesc {
                path: "/s".into(),
                material: material.map(Into::into),
                faces: TypedArray::of(vec![face]),
            };
            let mut desc = board("/a", 5, "/m");
            desc.subsets = vec![subset(Some("/n"), 3), subset(None, 1)];
            db.upsert_mesh(desc);
        },
        1,
    );
    let albedo: Vec<[f32; 3]> = read(&session, &request, AovKind::Albedo);
    let faces: Vec<i32> = read(&session, &request, AovKind::ElementId);
    assert!((0..4).all(|face| faces.contains(&face)), "all faces are seen");
    for (albedo, face) in albedo.iter().zip(faces) {
        let expected = match face {
            3 => values[1],
            1 => [0.75; 3],
            _ => values[0],
        };
        assert_eq!(*albedo, expected, "face {face}");
    }
}

/// The reflection of a sun by a lobe of GGX with Schlick's Fresnel, seen along the normal.
fn shining(f0: f64, roughness: f64, degrees: f64) -> f64 {
    // The half vector is half way to the sun.
    let (cosine, half) = (degrees.to_radians().cos(), (0.5 * degrees).to_radians().cos());
    let alpha2 = roughness.powi(4);
    let density = alpha2 / (PI * (half * half * (alpha2 - 1.0) + 1.0).powi(2));
    let slope = (cosine * cosine + alpha2 * (1.0 - cosine * cosine)).sqrt();
    // Height-correlated masking over 4 cosines, times the sun's; from straight on all is visible.
    (f0 + (1.0 - f0) * (1.0 - half).powi(5)) * density * cosine / (2.0 * (slope + cosine))
}

/// Asserts the reflection of a sun by a black board with these parameters, in the specular workflow.
fn expect_shining(params: &[(&'static str, f64)], specular: f32, degrees: f64, expected: f64) {
    #[expect(clippy::cast_possible_truncation, reason = "as parameters are")]
    let floats = params.iter().map(|(name, value)| (*name, ParamValue::Float(*value as f32)));
    let colors = [("diffuseColor", color([0.0; 3])), ("specularColor", color([specular; 3]))];
    let all: Vec<_> = floats.chain(colors).chain([("useSpecularWorkflow", ParamValue::Int(1))]).collect();
    let (session, request) = shown(
        |db| {
            db.upsert_material(plain("/m", &all));
            db.upsert_mesh(board("/a", 5, "/m"));
            db.upsert_light(sun(1.0, 0.0, DMat4::from_rotation_y(degrees.to_radians())));
        },
        1,
    );
    for pixel in read::<[f32; 4]>(&session, &request, AovKind::Color) {
        let off = (f64::from(pixel[0]) / expected - 1.0).abs();
        assert!(off < 1e-3, "{} of {params:?}, not {expected}", pixel[0]);
    }
}

#[test]
fn a_coat_has_an_amount_an_index_and_a_roughness_of_its_own() {
    for (amount, ior, roughness, degrees) in [(1.0, 1.5, 0.3, 20.0), (0.5, 1.5, 0.6, 50.0), (1.0, 2.0_f64, 0.9, 70.0)] {
        let params = [("roughness", 0.1), ("clearcoat", amount), ("clearcoatRoughness", roughness), ("ior", ior)];
        let f0 = ((1.0 - ior) / (1.0 + ior)).powi(2);
        expect_shining(&params, 0.0, degrees, amount * shining(f0, roughness, degrees));
    }
    // The layer below, by itself: colour and roughness are its own.
    for (specular, roughness, degrees) in [(0.0625, 0.3, 20.0), (0.03125, 0.2, 10.0_f32)] {
        let [f0, roughness, degrees] = [specular, roughness, degrees].map(f64::from);
        let params = [("roughness", roughness), ("ior", 1.5)];
        expect_shining(&params, specular, degrees, shining(f0, roughness, degrees));
    }
}

/// In a white world, straight on: a smooth metal shows its colour, a smooth dielectric its specular one, clear glass of
/// index 1 the background.
#[test]
fn metals_specular_colours_and_opacity_are_taken_as_they_are() {
    let float = |name: &'static str, value: f32| (name, ParamValue::Float(value));
    let tint = [0.25, 0.5, 0.75];
    let metal = [("diffuseColor", color(tint)), float("metallic", 1.0), float("roughness", 0.0)];
    let dark = ("diffuseColor", color([0.0; 3]));
    let workflow = ("useSpecularWorkflow", ParamValue::Int(1));
    let specular = [dark.clone(), ("specularColor", color(tint)), workflow, float("roughness", 0.0)];
    let clear = [dark, float("opacity", 0.75), float("ior", 1.0), float("roughness", 0.0)];
    for (name, params, expected) in
        [("metal", &metal[..], tint), ("specular", &specular[..], tint), ("clear", &clear[..], [0.25; 3])]
    {
        let (session, request) = shown(
            |db| {
                db.upsert_material(plain("/m", params));
                db.upsert_mesh(board("/a", 5, "/m"));
                db.upsert_light(dome([1.0; 3]));
            },
            4,
        );
        for pixel in read::<[f32; 4]>(&session, &request, AovKind::Color) {
            let off = (Vec3::from_slice(&pixel) - Vec3::from(expected)).abs().max_element();
            assert!(off < 1e-3, "{name}: {pixel:?}, not {expected:?}");
        }
    }
}
