// SPDX-License-Identifier: Apache-2.0
//! Emission and albedo as they are authored, by mesh and by subset.

use super::*;

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
fn a_scene_without_materials_leaves_them_out() {
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
            // No specular lobe: what it would reflect is not in the sum.
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
