// SPDX-License-Identifier: Apache-2.0
//! Displaced meshes and their textures: levels, sets of files, unreadable files, edits.

use std::sync::Arc;

use oocpt_core::material::compile;
use oocpt_core::{DroppedData, MaterialDesc, MeshDesc, ParamValue, SceneDb, TypedArray};

use crate::mesh::displace::{Files, asset, build, constant, corners as corners_of, square, st, textured, wraps};

#[test]
fn displacement_texture_level_matches_the_dicing_rate() {
    let height = |pieces: f64| {
        let built = build(&square(), &textured("levels", "r", &wraps("clamp"), &[]), pieces);
        asset(&built).bounds.max[2]
    };
    // 64 x 32 texels: a piece of 1/16 has 4 x 2.
    assert_eq!([200.0, 64.0, 16.0, 4.0].map(height), [0.0, 0.0, 1.0, 3.0], "levels");
}

#[test]
fn udim_tiles_are_selected_by_face() {
    // Two squares side by side: the edge between them is of both members.
    let corners = [[0.0_f32, 0.0], [1.0, 0.0], [2.0, 0.0], [0.0, 1.0], [1.0, 1.0], [2.0, 1.0]];
    let desc = MeshDesc {
        face_vertex_counts: TypedArray::of(vec![4_i32; 2]),
        face_vertex_indices: TypedArray::of(vec![4_i32, 3, 0, 1, 5, 4, 1, 2]),
        points: TypedArray::of::<[f32; 3]>(corners.iter().map(|[x, y]| [*x, *y, 0.0]).collect()),
        primvars: st(oocpt_core::Interpolation::Vertex, corners.to_vec()),
        ..square()
    };
    let built = build(&desc, &textured("tile<UDIM>", "r", &[], &[]), 8.0);
    for (position, _, _) in corners_of(asset(&built)) {
        // Members go on as their last texels do. Pieces of an eighth look at level 2, of 16 x 8 texels.
        let within = |x: f64| x.clamp(0.5 / 16.0, 15.5 / 16.0) / 16.0;
        let expected = if position.x < 0.999 {
            1001.0 + within(position.x)
        } else if position.x > 1.001 {
            1002.0 + within(position.x - 1.0)
        } else {
            0.5 * (1001.0 + within(1.0) + 1002.0 + within(0.0))
        };
        assert!((position.z - expected).abs() < 1e-3, "{position} is not {expected} high");
    }
    let place = [("translation", ParamValue::Vec2([2.0, 0.0]))];
    let none = build(&square(), &textured("tile<UDIM>", "r", &[("fallback", ParamValue::Vec4([7.0; 4]))], &place), 8.0);
    assert_eq!(none.notes, ["/m/UsdUVTexture: texture tile<UDIM>: none of its tiles is there"]);
    assert!((none.asset.unwrap().bounds.max[2] - 7.0).abs() < 1e-6, "the fallback");
}

#[test]
fn unreadable_files_give_a_warning_and_the_fallback() {
    let fallback = [("fallback", ParamValue::Vec4([0.25, 0.5, 0.75, 1.0]))];
    for (name, reason) in
        [("gone", "cannot be found"), ("broken", "is damaged"), ("short", "has a level of another size than it says")]
    {
        let built = build(&square(), &textured(name, "g", &fallback, &[]), 8.0);
        let note = format!("/m/UsdUVTexture: texture {name}: {reason}; its fallback is used");
        assert_eq!(built.notes, [note]);
        let bounds = built.asset.unwrap().bounds;
        assert!(bounds.min[2] == 0.5 && bounds.max[2] == 0.5, "{name}: {bounds:?}");
    }
    let built = build(&square(), &textured("nan", "r", &[], &[]), 8.0);
    assert_eq!(built.dropped, DroppedData { displacements: 81, ..DroppedData::NONE }, "every vertex");
    assert_eq!(built.asset.unwrap().bounds.max[2].to_bits(), 0, "stays where it is");
    let built = build(&MeshDesc { primvars: Vec::new(), ..square() }, &textured("waves", "r", &[], &[]), 8.0);
    let bounds = asset(&built).bounds;
    assert_eq!(bounds.min[2].to_bits(), bounds.max[2].to_bits(), "without st all look at (0, 0)");
    let folded = MeshDesc { face_vertex_indices: TypedArray::of(vec![0_i32, 1, 0, 3]), ..square() };
    let built = build(&folded, &constant(1.0), 8.0);
    assert_eq!(built.dropped.unrefined_meshes, 1, "a face with a point twice cannot be cut");
}

#[test]
fn only_inputs_of_the_displacement_terminal_trigger_a_rebuild() {
    let left_out = |displacement| compile(&MaterialDesc { displacement, ..constant(1.0) });
    let problem = left_out(None).problem().unwrap();
    assert!(problem.contains("displacement output is not connected"), "{problem}");
    assert_eq!(left_out(Some(7)).displacement, None, "a node that is not there");
    let other = MaterialDesc { displacement: Some(1), ..textured("waves", "r", &[], &[]) };
    let problem = compile(&other).problem().unwrap();
    assert!(problem.contains("displacement by nodes of kind `UsdUVTexture` is not supported"), "{problem}");
    let odd = compile(&constant(f32::NAN));
    assert_eq!(odd.displacement, None, "NaN");
    assert!(odd.problem().unwrap().contains("not finite"), "and it is said");
    assert_eq!(compile(&constant(0.0)), compile(&MaterialDesc { displacement: None, ..constant(0.0) }), "nothing");
    let ptex = compile(&textured("a.ptx", "r", &[], &[]));
    assert!(ptex.displacement.is_none() && ptex.problem().unwrap().contains("Ptex"), "Ptex");
    // Slots that a surface reads remain available.
    let material = textured("waves", "r", &[], &[]);
    let compiled = compile(&material);
    assert!(compiled.textures.is_empty() && compiled.material.unwrap().uv_sets.is_empty(), "of its own");
}

#[test]
fn material_and_texture_edits_rebuild_displaced_meshes() {
    let mut db = SceneDb::new();
    db.set_height_files(Arc::new(Files));
    let mesh = |path: &str| {
        let prim = oocpt_core::PrimDesc { path: path.into(), ..oocpt_core::PrimDesc::default() };
        MeshDesc { prim, material: Some("/m".into()), refine_level: 3, ..square() }
    };
    db.upsert_mesh(mesh("/a"));
    db.upsert_mesh(mesh("/b"));
    let top = |db: &mut SceneDb, material: Option<MaterialDesc>| {
        match material {
            Some(material) => db.upsert_material(material),
            None => db.remove("/m"),
        }
        let snapshot = db.commit().snapshot;
        snapshot.validate().unwrap();
        assert_eq!(snapshot.meshes.len(), 1, "equal prims share their mesh");
        (snapshot.meshes[0].bounds.max[2], snapshot.meshes[0].triangles, snapshot.meshes[0].key)
    };
    let plain = top(&mut db, None);
    let (one, two) = (textured("part1001", "r", &[], &[]), textured("part1002", "r", &[], &[]));
    let first = top(&mut db, Some(one.clone()));
    let second = top(&mut db, Some(two));
    assert_eq!([plain.1, first.1, second.1], [2, 128, 128], "a displaced mesh is cut");
    assert_eq!([plain.0, first.0, second.0], [0.0, 1001.0, 1002.0], "heights");
    assert_ne!(first.2, second.2, "another mesh");
    assert_eq!(top(&mut db, Some(one.clone())), first, "back again");
    let scaled = textured("part1001", "r", &[("scale", ParamValue::Vec4([2.0; 4]))], &[]);
    assert_eq!(top(&mut db, Some(scaled)).0, 2002.0, "another scale");
    assert_eq!(top(&mut db, None), plain, "as if it had never been");
}
