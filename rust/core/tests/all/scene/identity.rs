// SPDX-License-Identifier: Apache-2.0
//! The hash of a scene: every kind of edit changes it, and nothing else does.

use crate::support::{by, constant, grid, polygons, prim, scatter, triangle};
use glam::{DMat4, DVec3};
use oocpt_core::scene::{
    AssetRef, DomeFormat, InstanceLinks, LightDesc, LightKind, MaterialDesc, NamedPrimvar, NodeDesc, ParamDesc,
    ParamValue, PrimShape, SolidDesc, SolidSize, SubsetDesc, TransformSample,
};
use oocpt_core::{InstancerDesc, MeshDesc, SceneDb, Subdivision, TypedArray};
use std::collections::BTreeSet;
use std::sync::Arc;

fn asset(name: &str) -> AssetRef {
    AssetRef { authored: name.into(), resolved: format!("/somewhere/{name}").into() }
}

/// What a file contains, in a test: its name without folder.
fn content(asset: &AssetRef) -> String {
    asset.resolved.rsplit('/').next().unwrap_or_default().to_owned()
}

fn ground() -> MeshDesc {
    let mut mesh = grid("/ground", 12);
    mesh.material = Some("/red".into());
    mesh.display_color = Some(constant([0.5_f32, 0.25, 0.125]));
    mesh.primvars = vec![NamedPrimvar { name: "st".into(), primvar: constant([0.5_f32, 0.0]) }];
    mesh
}

fn ball() -> MeshDesc {
    let size = SolidSize { radii: [1.0; 2], height: 0.0 };
    let mut ball = polygons("/ball", &[], &[], &[]);
    ball.solid = Some(SolidDesc { size, samples: Vec::new(), axis: 2, is_round: true });
    ball.display_color = Some(constant([0.5_f32, 0.25, 0.125]));
    ball
}

fn leaf() -> MeshDesc {
    let mut leaf = triangle("/trees/tree/leaf", 0.25);
    leaf.prim.instanced_by = vec![by("/trees", "/trees/tree")];
    leaf
}

fn trees() -> InstancerDesc {
    let places: Vec<[f32; 3]> = (0_u8..40).map(|at| [f32::from(at), 0.0, 0.0]).collect();
    scatter("/trees", &places, &[("/trees/tree", &(0..40).collect::<Vec<i32>>())])
}

fn red() -> MaterialDesc {
    let params = vec![
        ParamDesc { name: "roughness".into(), value: ParamValue::Float(0.5) },
        ParamDesc { name: "file".into(), value: ParamValue::Asset(asset("bark.png")) },
    ];
    let kind = "UsdPreviewSurface".into();
    let node = NodeDesc { path: "/red/surface".into(), kind, params, connections: Vec::new() };
    MaterialDesc { path: "/red".into(), nodes: vec![node], surface: Some(0), displacement: None }
}

fn sky() -> LightDesc {
    let kind = LightKind::Dome { texture: Some(asset("sky.exr")), format: DomeFormat::Latlong };
    LightDesc { prim: prim("/sky"), kind, ..LightDesc::default() }
}

fn scene() -> SceneDb {
    let mut db = SceneDb::new();
    [ground(), ball(), leaf()].into_iter().for_each(|mesh| db.upsert_mesh(mesh));
    db.upsert_instancer(trees());
    db.upsert_material(red());
    db.upsert_light(sky());
    db
}

fn identity(mut db: SceneDb) -> u128 {
    db.commit();
    db.identity(&content)
}

fn with(edit: impl FnOnce(&mut SceneDb)) -> u128 {
    let mut db = scene();
    edit(&mut db);
    identity(db)
}

fn mesh(mut desc: MeshDesc, edit: impl FnOnce(&mut MeshDesc)) -> u128 {
    edit(&mut desc);
    with(|db| db.upsert_mesh(desc))
}

fn instancer(edit: impl FnOnce(&mut InstancerDesc)) -> u128 {
    let mut desc = trees();
    edit(&mut desc);
    with(|db| db.upsert_instancer(desc))
}

fn material(edit: impl FnOnce(&mut MaterialDesc)) -> u128 {
    let mut desc = red();
    edit(&mut desc);
    with(|db| db.upsert_material(desc))
}

fn light(edit: impl FnOnce(&mut LightDesc)) -> u128 {
    let mut desc = sky();
    edit(&mut desc);
    with(|db| db.upsert_light(desc))
}

/// The array with its last byte changed, as at the end of a large one.
fn changed(array: &TypedArray) -> TypedArray {
    let mut points: Vec<[f32; 3]> = array.view().bytes().chunks_exact(12).map(bytemuck::pod_read_unaligned).collect();
    if let Some([.., z]) = points.last_mut() {
        *z = f32::from_bits(z.to_bits() ^ 1);
    }
    TypedArray::of(points)
}

fn file(name: &str) -> ParamDesc {
    ParamDesc { name: "file".into(), value: ParamValue::Asset(asset(name)) }
}

fn edits() -> Vec<u128> {
    let moved = DMat4::from_translation(DVec3::X * 1e-9);
    let key = |time: f64| TransformSample { time, transform: DMat4::from_translation(DVec3::X * time) };
    vec![
        mesh(ground(), |mesh| mesh.points = changed(&mesh.points)),
        mesh(ground(), |mesh| mesh.prim.transform = moved),
        mesh(ground(), |mesh| mesh.prim.motion = vec![key(0.0), key(1.0)]),
        mesh(ground(), |mesh| mesh.prim.visible = false),
        mesh(ground(), |mesh| mesh.prim.purpose = "render".into()),
        mesh(ground(), |mesh| mesh.prim_id = 8),
        mesh(ground(), |mesh| mesh.left_handed = true),
        mesh(ground(), |mesh| mesh.subdivision = Subdivision::CatmullClark),
        mesh(ground(), |mesh| mesh.hole_indices = Some(TypedArray::of(vec![1]))),
        mesh(ground(), |mesh| mesh.shape = PrimShape::Points),
        mesh(ground(), |mesh| mesh.display_color = Some(constant([0.5_f32, 0.25, 0.5]))),
        mesh(ground(), |mesh| mesh.primvars[0].primvar = constant([0.5_f32, 0.5])),
        mesh(ground(), |mesh| mesh.primvars[0].name = "uv".into()),
        mesh(ground(), |mesh| mesh.point_motion.velocities = Some(TypedArray::of(vec![[1.0_f32; 3]; 169]))),
        mesh(ground(), |mesh| mesh.material = None),
        mesh(ground(), |mesh| mesh.categories = vec!["lit".into()]),
        mesh(ground(), |mesh| {
            let faces = TypedArray::of(vec![0]);
            mesh.subsets = vec![SubsetDesc { path: "/ground/part".into(), material: None, faces }];
        }),
        mesh(ball(), |mesh| mesh.solid.as_mut().expect("a ball").size.radii = [2.0; 2]),
        mesh(ball(), |mesh| mesh.display_color = Some(constant([0.5_f32, 0.25, 0.5]))),
        mesh(leaf(), |mesh| mesh.prim.instanced_by = Vec::new()),
        instancer(|trees| trees.translations = trees.translations.as_ref().map(changed)),
        instancer(|trees| trees.prototypes[0].indices = TypedArray::of(vec![0, 2])),
        instancer(|trees| trees.mask = Some(TypedArray::from_bools(&[false; 40]))),
        instancer(|trees| trees.prim.transform = moved),
        instancer(|trees| trees.motion.seconds = [0.0, 0.5]),
        instancer(|trees| {
            trees.links = Arc::new(InstanceLinks { sets: vec![vec!["lit".into()]], of: None });
        }),
        material(|red| red.nodes[0].params[0].value = ParamValue::Float(0.501)),
        material(|red| red.nodes[0].params[1] = file("moss.png")),
        material(|red| red.nodes[0].kind = "ND_standard_surface_surfaceshader".into()),
        material(|red| red.displacement = Some(0)),
        light(|sky| sky.intensity = 2.0),
        light(|sky| sky.prim.transform = moved),
        light(|sky| sky.kind = LightKind::Dome { texture: Some(asset("dusk.exr")), format: DomeFormat::Latlong }),
        light(|sky| sky.light_link = Some("lit".into())),
        with(|db| db.remove("/sky")),
        with(|db| db.set_purposes(&["render"])),
    ]
}

#[test]
fn every_kind_of_edit_changes_the_identity_of_a_scene() {
    let plain = identity(scene());
    let edits = edits();
    for (at, edited) in edits.iter().enumerate() {
        assert_ne!(*edited, plain, "edit {at} changes nothing");
    }
    let distinct: BTreeSet<&u128> = edits.iter().collect();
    assert_eq!(distinct.len(), edits.len(), "each edit gives another scene");
}

#[test]
fn the_same_scene_has_the_same_identity_wherever_its_files_and_arrays_are() {
    let plain = identity(scene());
    assert_eq!(identity(scene()), plain, "arrays at other addresses");
    let mut backwards = SceneDb::new();
    backwards.upsert_light(sky());
    backwards.upsert_material(red());
    backwards.upsert_instancer(trees());
    [leaf(), ball(), ground()].into_iter().for_each(|mesh| backwards.upsert_mesh(mesh));
    assert_eq!(identity(backwards), plain, "prims in another order");
    let elsewhere = AssetRef { authored: "./bark.png".into(), resolved: "/elsewhere/bark.png".into() };
    let param = ParamDesc { name: "file".into(), value: ParamValue::Asset(elsewhere) };
    assert_eq!(material(|red| red.nodes[0].params[1] = param), plain, "files in another folder");
    let undone = with(|db| {
        db.remove("/sky");
        db.commit();
        db.upsert_light(sky());
    });
    assert_eq!(undone, plain, "an edit that was undone");
}

#[test]
fn the_light_at_the_camera_is_the_same_in_every_process() {
    let at_camera = |path: &str| {
        let kind = LightKind::Distant { angle_degrees: 0.5 };
        with(|db| db.upsert_light(LightDesc { prim: prim(path), kind, ..LightDesc::default() }))
    };
    let one = at_camera("/_UsdImaging_HdOocPTRendererPlugin_0x2905ccb8/lights/light_0");
    assert_eq!(at_camera("/_UsdImaging_HdOocPTRendererPlugin_0x41c3db58/lights/light_0"), one, "another address");
    assert_ne!(at_camera("/_UsdImaging_HdOocPTRendererPlugin_0x41c3db58/lights/light_1"), one, "another light");
    assert_ne!(at_camera("/world_0x2905ccb8/light_0"), at_camera("/world_0x41c3db58/light_0"), "paths of the scene");
}

#[test]
fn prims_that_are_hidden_and_stay_so_do_not_count() {
    let mut hidden = grid("/proxy", 3);
    hidden.prim.purpose = "proxy".into();
    let [purpose, off] = [false, true].map(|is_off| {
        let mut mesh = hidden.clone();
        (mesh.prim.visible, mesh.prim.purpose) = (!is_off, if is_off { "default" } else { "proxy" }.into());
        with(|db| db.upsert_mesh(mesh))
    });
    assert_eq!([purpose, off], [identity(scene()); 2]);
}
