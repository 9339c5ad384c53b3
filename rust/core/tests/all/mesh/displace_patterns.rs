// SPDX-License-Identifier: Apache-2.0
//! Meshes displaced by `displacement` nodes of `MaterialX`, against their fields: programs, textures, primvars;
//! unreadable files, edits.

use std::sync::Arc;

use glam::DVec3;
use oocpt_core::material::{Displacement, compile};
use oocpt_core::mesh::BuiltMesh;
use oocpt_core::{
    DroppedData, Interpolation, MaterialDesc, MeshDesc, NamedPrimvar, NodeDesc, ParamValue, Primvar, SceneDb,
    Subdivision, TypedArray,
};
use oocpt_materialx::eval::evaluate;
use oocpt_materialx::program::Op;

use crate::material::preview_surface::{file, network, node, text};
use crate::mesh::displace::{Files, asset, build, constant, corners, cube, filtered, repeated, square, st};

const FLOAT: &str = "ND_displacement_float";
pub(crate) const VECTOR: &str = "ND_displacement_vector3";
const IMAGE: &str = "ND_image_float";

pub(crate) fn number(value: f32) -> ParamValue {
    ParamValue::Float(value)
}

/// A material whose displacement is its first node.
pub(crate) fn displacing(mut nodes: Vec<NodeDesc>) -> MaterialDesc {
    nodes.push(node("ND_open_pbr_surface_surfaceshader", &[], &[]));
    let surface = Some(nodes.len() - 1);
    MaterialDesc { surface, displacement: Some(0), ..network("/m", nodes) }
}

pub(crate) fn of(material: &MaterialDesc) -> Arc<Displacement> {
    let compiled = compile(material);
    assert_eq!(compiled.problem(), None, "a sound network");
    compiled.displacement.expect("a displacement")
}

fn bits(built: &BuiltMesh) -> Vec<u32> {
    let asset = built.asset.as_ref().unwrap();
    let normals = asset.normals.as_ref().unwrap().values.as_flattened().iter();
    asset.triangles.iter().flat_map(|t| t.vertices).flatten().chain(normals.copied()).map(f32::to_bits).collect()
}

fn single(value: DVec3) -> [f32; 4] {
    let [x, y, z] = value.as_vec3().to_array();
    [x, y, z, 0.0]
}

#[test]
fn a_constant_displacement_matches_preview_surface() {
    for scheme in [Subdivision::None, Subdivision::CatmullClark] {
        let material = displacing(vec![node(FLOAT, &[("displacement", number(0.5)), ("scale", number(0.5))], &[])]);
        let [found, known] = [material, constant(0.25)].map(|material| bits(&build(&cube(scheme), &material, 9.0)));
        assert!(found == known, "{scheme:?}");
    }
    assert_eq!(compile(&displacing(vec![node(FLOAT, &[], &[])])).displacement, None, "0 moves nothing");
}

/// sin(9 u) + a ramp of v, noise of the point, and both together by a scale that varies.
#[test]
fn a_displaced_square_matches_the_field_of_its_program() {
    let waves = |at: usize| {
        vec![
            node("ND_add_float", &[], &[("in1", at + 1, "out"), ("in2", at + 4, "out")]),
            node("ND_sin_float", &[], &[("in", at + 2, "out")]),
            node("ND_dotproduct_vector2", &[("in2", ParamValue::Vec2([9.0, 0.0]))], &[("in1", at + 3, "out")]),
            node("ND_texcoord_vector2", &[], &[]),
            node("ND_ramptb_float", &[("valuet", number(2.0)), ("valueb", number(-1.0))], &[]),
        ]
    };
    let noise = |at: usize| {
        vec![
            node(
                "ND_noise3d_float",
                &[("amplitude", number(0.5)), ("pivot", number(0.25))],
                &[("position", at + 1, "out")],
            ),
            node("ND_multiply_vector3FA", &[("in2", number(7.0))], &[("in1", at + 2, "out")]),
            node("ND_position_vector3", &[], &[]),
        ]
    };
    let wave = |p: DVec3| (9.0 * p.x).sin() + 2.0 * (1.0 - p.y) - p.y;
    let grain = |p: DVec3| {
        let [value, ..] = evaluate(Op::Noise3, [single(7.0 * p), [0.0; 4], [0.0; 4]], 0);
        0.25 + 0.5 * f64::from(value)
    };
    let by = |connections: &[(&str, usize, &str)], parts: Vec<Vec<NodeDesc>>| {
        displacing([vec![node(FLOAT, &[], connections)], parts.concat()].concat())
    };
    let both = |p: DVec3| wave(p) * grain(p);
    type Field<'a> = &'a dyn Fn(DVec3) -> f64;
    let cases: [(&str, MaterialDesc, Field<'_>); 3] = [
        ("waves", by(&[("displacement", 1, "out")], vec![waves(1)]), &wave),
        ("noise", by(&[("displacement", 1, "out")], vec![noise(1)]), &grain),
        ("both", by(&[("displacement", 1, "out"), ("scale", 6, "out")], vec![waves(1), noise(6)]), &both),
    ];
    for (name, material, field) in cases {
        let built = build(&square(), &material, 60.0);
        assert_eq!(asset(&built).triangles.len(), 2 * 60 * 60, "60 pieces an edge");
        let mut highest = f64::MIN;
        for (position, _, _) in corners(asset(&built)) {
            // Points on the square move straight up.
            let expected = field(DVec3::new(position.x, position.y, 0.0));
            assert!((position.z - expected).abs() < 2e-6, "{name}: {position} is not {expected} high");
            highest = highest.max(position.z);
        }
        assert!(highest > 0.3, "{name} moves something");
    }
}

#[test]
fn node_displacement_textures_are_filtered_as_preview_surface_ones() {
    let image = |kind: &str, more: &[(&str, ParamValue)]| {
        let params = [&[("file", file("waves"))], more].concat();
        displacing(vec![
            node(FLOAT, &[("scale", number(0.5))], &[("displacement", 1, "out")]),
            node(kind, &params, &[]),
        ])
    };
    type Place = fn(f64, f64) -> [f64; 2];
    let tiled = [("uvtiling", ParamValue::Vec2([2.0, 1.5])), ("uvoffset", ParamValue::Vec2([0.25, -0.5]))];
    let cases: [(MaterialDesc, Place); 2] = [
        (image(IMAGE, &[]), |s, t| [s, t]),
        (image("ND_tiledimage_float", &tiled), |s, t| [2.0 * s - 0.25, 1.5 * t + 0.5]),
    ];
    for (material, place) in cases {
        let built = build(&square(), &material, 150.0);
        for (position, _, _) in corners(asset(&built)) {
            let [s, t] = place(position.x, position.y);
            let expected = 0.5 * filtered(s, t, 0, repeated);
            assert!((position.z - expected).abs() < 1e-5, "{position} is not {expected} high");
        }
    }
    // Each channel is read by itself, at coordinates that a program computes; scale is another texture.
    for channel in 0..3_u8 {
        let material = displacing(vec![
            node(FLOAT, &[], &[("displacement", 1, "out"), ("scale", 3, "out")]),
            node("ND_extract_color3", &[("index", ParamValue::Int(i64::from(channel)))], &[("in", 2, "out")]),
            node("ND_image_color3", &[("file", file("waves"))], &[("texcoord", 4, "out")]),
            node(IMAGE, &[("file", file("one"))], &[]),
            node("ND_multiply_vector2", &[], &[("in1", 5, "out"), ("in2", 5, "out")]),
            node("ND_texcoord_vector2", &[], &[]),
        ]);
        let built = build(&square(), &material, 200.0);
        for (position, _, _) in corners(asset(&built)) {
            let expected = filtered(position.x * position.x, position.y * position.y, channel, repeated);
            assert!((position.z - expected).abs() < 1e-5, "{channel}: {position} is not {expected} high");
        }
    }
}

/// The level is also right if a program computes the coordinates, and with more pieces than are measured.
#[test]
fn displacement_texture_level_matches_the_dicing_rate() {
    let placed = vec![
        node(FLOAT, &[], &[("displacement", 1, "out")]),
        node(IMAGE, &[("file", file("levels"))], &[("texcoord", 2, "out")]),
        node("ND_noise2d_vector2", &[("amplitude", ParamValue::Vec2([0.0; 2]))], &[]),
    ];
    let mut moved = placed.clone();
    moved[2] = node("ND_convert_vector3_vector2", &[], &[("in", 3, "out")]);
    moved.push(node("ND_position_vector3", &[], &[]));
    for (name, material, levels) in [
        (
            "own",
            displacing(placed[..2].iter().cloned().chain([node("ND_texcoord_vector2", &[], &[])]).collect()),
            [0.0, 0.0, 1.0, 3.0],
        ),
        ("of the point", displacing(moved), [0.0, 0.0, 1.0, 3.0]),
    ] {
        let height = |pieces: f64| asset(&build(&square(), &material, pieces)).bounds.max[2];
        // 64 x 32 texels: a piece of 1/16 has 4 x 2.
        assert_eq!([300.0, 64.0, 16.0, 4.0].map(height), levels, "{name}");
    }
}

#[test]
fn udim_tiles_are_selected_by_face() {
    let places = [[0.0_f32, 0.0], [1.0, 0.0], [2.0, 0.0], [0.0, 1.0], [1.0, 1.0], [2.0, 1.0]];
    let desc = MeshDesc {
        face_vertex_counts: TypedArray::of(vec![4_i32; 2]),
        face_vertex_indices: TypedArray::of(vec![4_i32, 3, 0, 1, 5, 4, 1, 2]),
        points: TypedArray::of::<[f32; 3]>(places.iter().map(|[x, y]| [*x, *y, 0.0]).collect()),
        primvars: st(Interpolation::Vertex, places.to_vec()),
        ..square()
    };
    let image = |name: &str| {
        let nodes = vec![
            node(FLOAT, &[], &[("displacement", 1, "out")]),
            node(IMAGE, &[("file", file(name)), ("default", number(7.0))], &[]),
        ];
        displacing(nodes)
    };
    for (position, _, _) in corners(asset(&build(&desc, &image("tile<UDIM>"), 8.0))) {
        let within = |x: f64| x.clamp(0.5 / 16.0, 15.5 / 16.0) / 16.0;
        let expected = match position.x {
            x if x < 0.999 => 1001.0 + within(x),
            x if x > 1.001 => 1002.0 + within(x - 1.0),
            _ => 0.5 * (1001.0 + within(1.0) + 1002.0 + within(0.0)),
        };
        assert!((position.z - expected).abs() < 1e-3, "{position} is not {expected} high");
    }
    let far = MeshDesc { primvars: st(Interpolation::Constant, vec![[2.5, 0.5]]), ..square() };
    let none = build(&far, &image("tile<UDIM>"), 8.0);
    assert_eq!(none.notes, ["/ND_image_float: texture tile<UDIM>: none of its tiles is there"]);
    assert!((none.asset.unwrap().bounds.max[2] - 7.0).abs() < 1e-6, "the fallback");
}

#[test]
fn unreadable_files_give_one_warning_and_the_fallback() {
    for (name, reason) in
        [("gone", "cannot be found"), ("broken", "is damaged"), ("short", "has a level of another size than it says")]
    {
        // Two lookups of one file.
        let params = [("file", file(name)), ("default", number(0.25))];
        let material = displacing(vec![
            node(FLOAT, &[], &[("displacement", 1, "out")]),
            node("ND_add_float", &[], &[("in1", 2, "out"), ("in2", 3, "out")]),
            node(IMAGE, &params, &[]),
            node(IMAGE, &params, &[("texcoord", 4, "out")]),
            node("ND_noise2d_vector2", &[], &[]),
        ]);
        let built = build(&square(), &material, 8.0);
        assert_eq!(built.notes, [format!("/ND_image_float: texture {name}: {reason}; its fallback is used")]);
        let bounds = built.asset.unwrap().bounds;
        assert!(bounds.min[2] == 0.5 && bounds.max[2] == 0.5, "{name}: {bounds:?}");
    }
    // Values that are NaN count as 0; vertices with too large a displacement stay where they are.
    let image = |name: &str, scale: f32| {
        displacing(vec![
            node(FLOAT, &[("scale", number(scale))], &[("displacement", 1, "out")]),
            node(IMAGE, &[("file", file(name))], &[]),
        ])
    };
    let built = build(&square(), &image("one", 1e30), 8.0);
    assert_eq!(built.dropped, DroppedData { displacements: 81, ..DroppedData::NONE }, "every vertex");
    assert_eq!(built.asset.unwrap().bounds.max[2].to_bits(), 0, "stays where it is");
    let vector = [("displacement", ParamValue::Vec3([1e25, 0.0, 0.0]))];
    let built = build(&square(), &displacing(vec![node(VECTOR, &vector, &[])]), 8.0);
    assert_eq!(built.dropped, DroppedData { displacements: 81, ..DroppedData::NONE }, "every vertex");
    let built = build(&square(), &image("nan", 1.0), 8.0);
    assert!(built.asset.unwrap().triangles.iter().flat_map(|t| t.vertices).flatten().all(f32::is_finite), "NaN");
    // Without coordinates all look at (0, 0).
    let built = build(&MeshDesc { primvars: Vec::new(), ..square() }, &image("waves", 1.0), 8.0);
    let bounds = asset(&built).bounds;
    assert_eq!(bounds.min[2].to_bits(), bounds.max[2].to_bits());
}

/// Primvars of every width and rate; their fallbacks where there are none.
#[test]
fn primvars_are_read_at_every_rate() {
    let material = displacing(vec![
        node(FLOAT, &[], &[("displacement", 1, "out")]),
        node("ND_geompropvalue_float", &[("geomprop", text("heat")), ("default", number(3.0))], &[]),
    ]);
    let heat = |interpolation, values: TypedArray| {
        let primvar = Primvar { interpolation, values, indices: None };
        vec![NamedPrimvar { name: "heat".into(), primvar }]
    };
    let numbers = || TypedArray::of(vec![1.0_f32, 1.0, 1.0, 1.0]);
    for (primvars, height) in [
        (heat(Interpolation::Constant, TypedArray::of(vec![2.0_f32])), 2.0),
        (heat(Interpolation::Uniform, TypedArray::of(vec![[5.0_f32, 1.0, 1.0]])), 5.0),
        (heat(Interpolation::Vertex, numbers()), 1.0),
        (heat(Interpolation::FaceVarying, numbers()), 1.0),
        (Vec::new(), 3.0),
    ] {
        let built = build(&MeshDesc { primvars, ..square() }, &material, 4.0);
        assert_eq!([asset(&built).bounds.min[2], asset(&built).bounds.max[2]], [height; 2]);
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let material = displacing(vec![
        node(VECTOR, &[("scale", number(0.1))], &[("displacement", 1, "out")]),
        node("ND_add_vector3", &[], &[("in1", 2, "out"), ("in2", 3, "out")]),
        node("ND_image_vector3", &[("file", file("waves"))], &[]),
        node("ND_noise3d_vector3", &[], &[]),
    ]);
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| bits(&build(&cube(Subdivision::CatmullClark), &material, 60.0)))
    };
    let one = with(1);
    assert!([2, 5].into_iter().all(|threads| with(threads) == one));
}

/// Any change of a displacement builds the mesh anew; an equal one does not.
#[test]
fn edits_rebuild_displaced_meshes() {
    let mut db = SceneDb::new();
    db.set_height_files(Arc::new(Files));
    let mesh = |heat: f32| {
        let prim = oocpt_core::PrimDesc { path: "/a".into(), ..oocpt_core::PrimDesc::default() };
        let values = TypedArray::of(vec![heat]);
        let primvar = Primvar { interpolation: Interpolation::Constant, values, indices: None };
        let mut primvars = square().primvars;
        primvars.push(NamedPrimvar { name: "heat".into(), primvar });
        MeshDesc { prim, material: Some("/m".into()), refine_level: 3, primvars, ..square() }
    };
    let material = |scale: f32, picture: &str, wrap: &str, default: f32, set: &str, name: &str| {
        displacing(vec![
            node(FLOAT, &[("scale", number(scale))], &[("displacement", 1, "out")]),
            node("ND_add_float", &[], &[("in1", 2, "out"), ("in2", 4, "out")]),
            node(IMAGE, &[("file", file(picture)), ("uaddressmode", text(wrap))], &[("texcoord", 3, "out")]),
            node("ND_geompropvalue_vector2", &[("geomprop", text(set))], &[]),
            node("ND_geompropvalue_float", &[("geomprop", text(name)), ("default", number(default))], &[]),
        ])
    };
    let key = |db: &mut SceneDb, material: MaterialDesc, heat: f32| {
        db.upsert_material(material);
        db.upsert_mesh(mesh(heat));
        let snapshot = db.commit().snapshot;
        snapshot.validate().unwrap();
        (snapshot.meshes[0].key, snapshot.meshes[0].bounds.max[2])
    };
    let first = key(&mut db, material(1.0, "part1001", "clamp", 0.0, "st", "heat"), 1.0);
    assert_eq!(first.1, 1002.0);
    assert_eq!(key(&mut db, material(1.0, "part1001", "clamp", 0.0, "st", "heat"), 1.0), first, "the same");
    let mut seen = vec![first.0];
    for (material, heat, height) in [
        (material(2.0, "part1001", "clamp", 0.0, "st", "heat"), 1.0, 2004.0),
        (material(1.0, "part1002", "clamp", 0.0, "st", "heat"), 1.0, 1003.0),
        (material(1.0, "part1001", "mirror", 0.0, "st", "heat"), 1.0, 1002.0),
        (material(1.0, "part1001", "clamp", 5.0, "st", "heat"), 1.0, 1002.0),
        (material(1.0, "part1001", "clamp", 0.0, "map", "heat"), 1.0, 1002.0),
        (material(1.0, "part1001", "clamp", 0.0, "st", "cold"), 1.0, 1001.0),
        // Only the displacement reads it.
        (material(1.0, "part1001", "clamp", 0.0, "st", "heat"), 8.0, 1009.0),
    ] {
        let (key, top) = key(&mut db, material, heat);
        assert_eq!(top, height, "heat {heat}");
        assert!(!seen.contains(&key), "another mesh");
        seen.push(key);
    }
    assert_eq!(key(&mut db, material(1.0, "part1001", "clamp", 0.0, "st", "heat"), 1.0), first, "back again");
    // The primvar alone, with nothing else changed.
    db.upsert_mesh(mesh(8.0));
    assert_eq!(db.commit().snapshot.meshes[0].bounds.max[2], 1009.0, "a primvar that no surface reads");
}

/// The terminals of a network are each read by the kind of their node.
#[test]
fn surface_and_displacement_terminals_may_mix_node_systems() {
    let mut mixed = displacing(vec![node("UsdPreviewSurface", &[("displacement", number(0.5))], &[])]);
    let compiled = compile(&mixed);
    assert!(compiled.problem().is_none() && compiled.material.is_some(), "{:?}", compiled.problem());
    assert_eq!(compiled.displacement, compile(&constant(0.5)).displacement);
    mixed.nodes[0] = node(FLOAT, &[("displacement", number(0.5))], &[]);
    mixed.nodes[1] = node("UsdPreviewSurface", &[], &[]);
    let compiled = compile(&mixed);
    assert!(compiled.problem().is_none() && compiled.material.is_some(), "{:?}", compiled.problem());
    assert_eq!(compiled.displacement, compile(&constant(0.5)).displacement);
    mixed.surface = None;
    let compiled = compile(&mixed);
    assert_eq!(
        compiled.problem().as_deref(),
        Some("there is no surface that is read (UsdPreviewSurface or MaterialX)")
    );
    assert!(compiled.displacement.is_some(), "it is displaced all the same");
    let unlike = displacing(vec![node("ND_image_float", &[("file", file("a"))], &[])]);
    let problem = compile(&unlike).problem().unwrap();
    assert!(problem.contains("displacement by nodes of kind `image` (/ND_image_float) is not supported"), "{problem}");
}
