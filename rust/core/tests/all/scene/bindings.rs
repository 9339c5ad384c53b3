// SPDX-License-Identifier: Apache-2.0
//! Material bindings: meshes, subsets, primvars that materials read, and edits of them.

use oocpt_abi::{AttributeRate, Features, NO_MATERIAL, PrimMask};
use std::sync::Arc;

use oocpt_core::mesh::split_mesh;
use oocpt_core::scene::InstanceLinks;
use oocpt_core::{
    AnyAttribute, DroppedData, InstancerDesc, Interpolation, LightDesc, MaterialDesc, MeshAsset, MeshDesc,
    NamedPrimvar, ParamValue, Primvar, SceneDb, Snapshot, SubsetDesc, TypedArray,
};

use crate::material::preview_surface::{file, network, node, surface, text};
use crate::support::{asset, by, committed, grid, polygons, prim, primvar, scatter};

pub(crate) fn color(path: &str, value: f32) -> MaterialDesc {
    network(path, vec![surface(&[("diffuseColor", ParamValue::Vec3([value; 3]))])])
}

/// Reads the primvars `names` (at most two).
fn reads(path: &str, names: &[&str]) -> MaterialDesc {
    let inputs = ["diffuseColor", "emissiveColor"];
    let connections: Vec<_> =
        inputs.iter().zip(1..).take(names.len()).map(|(input, at)| (*input, at, "result")).collect();
    let head = node("UsdPreviewSurface", &[], &connections);
    let readers = names.iter().map(|name| node("UsdPrimvarReader_float3", &[("varname", text(name))], &[]));
    network(path, [head].into_iter().chain(readers).collect())
}

fn textured(path: &str, name: &str) -> MaterialDesc {
    network(
        path,
        vec![
            node("UsdPreviewSurface", &[], &[("diffuseColor", 1, "rgb")]),
            node("UsdUVTexture", &[("file", file(name))], &[("st", 2, "result")]),
            node("UsdPrimvarReader_float2", &[("varname", text("st"))], &[]),
        ],
    )
}

/// Two quads side by side.
fn quads(path: &str, prim_id: i32) -> MeshDesc {
    let points = [0, 1, 2].map(|k| f32::from(u8::try_from(k).unwrap()));
    let points: Vec<[f32; 3]> = points.iter().flat_map(|&x| [[x, 0.0, 0.0], [x, 1.0, 0.0]]).collect();
    let mut desc = polygons(path, &[4, 4], &[0, 2, 3, 1, 2, 4, 5, 3], &points);
    desc.prim_id = prim_id;
    desc
}

pub(crate) fn bind(mut desc: MeshDesc, material: &str, subsets: &[(&str, &[i32])]) -> MeshDesc {
    let subset = |(material, faces): &(&str, &[i32])| SubsetDesc {
        path: format!("{}/{material}", desc.prim.path).into(),
        material: (!material.is_empty()).then(|| (*material).into()),
        faces: TypedArray::of(faces.to_vec()),
    };
    desc.subsets = subsets.iter().map(subset).collect();
    desc.material = (!material.is_empty()).then(|| material.into());
    desc
}

fn named(name: &str, primvar: Primvar) -> NamedPrimvar {
    NamedPrimvar { name: name.into(), primvar }
}

/// Diffuse value of each face of a mesh: -1 where it has no material.
fn shown(snapshot: &Snapshot, mesh: &MeshAsset, prim_id: i32) -> Vec<(u32, f32)> {
    let slots = snapshot.surfaces.slots(prim_id);
    let mut faces: Vec<(u32, f32)> = (0..mesh.triangles.len())
        .map(|t| {
            let subset = mesh.subsets.get(t).copied().unwrap_or(0);
            let slot = slots.get(usize::from(subset)).copied().unwrap_or(NO_MATERIAL);
            let value =
                snapshot.surfaces.materials.get(slot as usize).map_or(-1.0, |material| match material.inputs[0] {
                    oocpt_core::InputValue::Constant([value, ..]) => value,
                    _ => f32::NAN,
                });
            (mesh.triangles[t].face, value)
        })
        .collect();
    faces.sort_by(|a, b| a.partial_cmp(b).unwrap());
    faces.dedup();
    faces
}

#[test]
fn a_scene_without_materials_has_no_tables() {
    let mut db = SceneDb::new();
    db.upsert_mesh(quads("/a", 0));
    db.upsert_material(color("/m", 0.5));
    let snapshot = committed(&mut db);
    assert_eq!(snapshot.surfaces, oocpt_core::SurfaceTables::default());
    assert_eq!(snapshot.features, Features::empty());
    assert!(snapshot.meshes[0].subsets == 0 && snapshot.meshes[0].primvars.is_empty());
}

#[test]
fn subsets_go_by_face_and_the_first_wins() {
    let mut db = SceneDb::new();
    for (path, value) in [("/m", 0.25), ("/n", 0.5), ("/unused", 0.75)] {
        db.upsert_material(color(path, value));
    }
    db.upsert_mesh(bind(quads("/a", 3), "/m", &[("/n", &[1])]));
    db.upsert_mesh(bind(quads("/b", 4), "", &[("/m", &[0, 1]), ("/n", &[1])]));
    db.upsert_mesh(bind(quads("/c", 5), "/n", &[("", &[0])]));
    let snapshot = committed(&mut db);
    assert_eq!(snapshot.surfaces.materials.len(), 2, "what nobody shows is left out");
    let of = |id: i32| {
        let meshes = snapshot.meshes.iter();
        meshes.map(|mesh| shown(&snapshot, &asset(mesh), id)).collect::<Vec<_>>()
    };
    // Meshes with equal subsets of faces share an asset, whatever their materials are.
    assert_eq!(snapshot.meshes.len(), 3);
    assert!(of(3).contains(&vec![(0, 0.25), (1, 0.5)]));
    assert!(of(4).contains(&vec![(0, 0.25), (1, 0.25)]));
    assert!(of(5).contains(&vec![(0, -1.0), (1, 0.5)]));
    assert_eq!(snapshot.surfaces.slots(-1), &[] as &[u32]);
    assert_eq!(snapshot.features, Features::MATERIALS);
}

#[test]
fn editing_a_material_or_a_binding_builds_no_mesh() {
    let mut db = SceneDb::new();
    db.upsert_material(color("/m", 0.25));
    db.upsert_material(color("/n", 0.5));
    let mesh = bind(quads("/a", 1), "/m", &[("/n", &[1])]);
    db.upsert_mesh(mesh.clone());
    let before = committed(&mut db);
    let same_mesh = |after: &Snapshot| Arc::ptr_eq(&before.meshes[0], &after.meshes[0]);

    db.upsert_material(color("/m", 0.25));
    assert!(!db.commit().changed, "the same material again is no edit");
    db.upsert_material(color("/m", 0.75));
    let after = committed(&mut db);
    assert_eq!(shown(&after, &asset(&after.meshes[0]), 1), [(0, 0.75), (1, 0.5)]);
    assert!(same_mesh(&after) && Arc::ptr_eq(&before.surfaces.materials[1], &after.surfaces.materials[1]));

    let rebound = MeshDesc { material: Some("/n".into()), ..mesh.clone() };
    db.upsert_mesh(rebound.clone());
    let after = committed(&mut db);
    assert_eq!(shown(&after, &asset(&after.meshes[0]), 1), [(0, 0.5), (1, 0.5)]);
    assert!(same_mesh(&after));
    assert_eq!(after.surfaces.materials.len(), 1);

    db.upsert_mesh(bind(rebound, "/n", &[("/n", &[0])]));
    assert!(!same_mesh(&committed(&mut db)), "other faces are another mesh");
    db.remove("/n");
    let commit = db.commit();
    assert_eq!(commit.snapshot.surfaces.materials.len(), 0);
    assert!(commit.warnings.iter().any(|w| &*w.path == "/a" && w.message.contains("/n does not exist")));
}

#[test]
fn only_primvars_that_a_material_reads_are_built() {
    let st: Vec<[f32; 2]> = (0..8_u8).map(|k| [f32::from(k), 0.5]).collect();
    let mut mesh = bind(quads("/a", 1), "", &[]);
    mesh.primvars = vec![
        named(
            "st",
            Primvar {
                interpolation: Interpolation::FaceVarying,
                values: TypedArray::of(st),
                indices: Some(TypedArray::of((0..8).rev().collect::<Vec<i32>>())),
            },
        ),
        named("tint", primvar(Interpolation::Vertex, vec![[0.5_f64, 1.0, 2.0]; 6])),
        named("glow", primvar(Interpolation::Uniform, vec![1.0_f32, 2.0])),
        named("big", primvar(Interpolation::Constant, vec![[0.0_f32; 4]])),
    ];
    let mut db = SceneDb::new();
    db.upsert_material(textured("/t", "a.png"));
    db.upsert_material(reads("/r", &["tint", "missing"]));
    db.upsert_material(reads("/g", &["glow", "displayColor"]));
    db.upsert_mesh(mesh.clone());
    assert!(committed(&mut db).meshes[0].primvars.is_empty());

    mesh.material = Some("/t".into());
    db.upsert_mesh(mesh.clone());
    let with_st = committed(&mut db);
    let [built] = &asset(&with_st.meshes[0]).primvars[..] else { panic!("one primvar") };
    assert_eq!(built.id, with_st.surfaces.materials[0].uv_sets[0].id);
    let AnyAttribute::Two(values) = &built.values else { panic!("two floats") };
    assert_eq!((values.rate, values.values.len()), (AttributeRate::FaceVarying, 12));
    // Through the indices: the first corner of the first face has the last value.
    assert!(values.values.iter().all(|v| v[1] == 0.5) && values.values.iter().any(|v| v[0] == 7.0));
    assert_eq!(with_st.features, Features::MATERIALS | Features::TEXTURES);
    assert_eq!(with_st.surfaces.textures.len(), 1);

    // Another file in the same place needs nothing new of the mesh.
    db.upsert_material(textured("/t", "b.png"));
    assert!(Arc::ptr_eq(&committed(&mut db).meshes[0], &with_st.meshes[0]));

    mesh.material = Some("/r".into());
    db.upsert_mesh(mesh.clone());
    let with_tint = committed(&mut db);
    let [built] = &asset(&with_tint.meshes[0]).primvars[..] else { panic!("one primvar: the other is missing") };
    assert_eq!(
        built.values,
        AnyAttribute::Three(oocpt_core::Attribute { rate: AttributeRate::Vertex, values: vec![[0.5, 1.0, 2.0]; 6] })
    );
    assert_eq!(with_tint.meshes[0].corner_indices, 4);

    mesh.material = Some("/g".into());
    mesh.display_color = Some(primvar(Interpolation::Constant, vec![[1.0_f32, 0.5, 0.25]]));
    db.upsert_mesh(mesh.clone());
    let with_glow = committed(&mut db);
    let widths: Vec<u32> = with_glow.meshes[0].primvars.iter().map(|p| p.values.width).collect();
    assert_eq!(widths.iter().sum::<u32>(), 4, "one float and a colour");
    // An array that no material reads may change without anything being built.
    mesh.primvars[0] = named("st", primvar(Interpolation::Constant, vec![[0.0_f32; 2]]));
    db.upsert_mesh(mesh);
    assert!(!db.commit().changed);
}

#[test]
fn a_split_mesh_keeps_primvars_and_subsets() {
    let mut desc = bind(grid("/a", 40), "/t", &[("/t", &(0..800).collect::<Vec<i32>>())]);
    let st: Vec<[f32; 2]> = (0..desc.points.len())
        .filter_map(|k| desc.points.vec3(k))
        .map(|p| {
            let p = p.as_vec3();
            [p.x, p.y]
        })
        .collect();
    desc.primvars = vec![named("st", primvar(Interpolation::Vertex, st))];
    let mut db = SceneDb::new();
    db.upsert_material(textured("/t", "a.png"));
    db.upsert_mesh(desc);
    let whole = asset(&committed(&mut db).meshes[0]);
    let limit = 20_000;
    let parts = split_mesh(&whole, limit);
    assert!(parts.len() > 4 && parts.iter().all(|part| part.device_bytes() <= limit));
    for part in parts.iter().chain([&*whole]) {
        let [built] = &part.primvars[..] else { panic!("one primvar") };
        let AnyAttribute::Two(st) = &built.values else { panic!("two floats") };
        assert_eq!(part.subsets.len(), part.triangles.len());
        for (t, triangle) in part.triangles.iter().enumerate() {
            assert_eq!(part.subsets[t], u16::from(triangle.face < 800));
            for (vertex, point) in triangle.vertices.iter().zip(part.corner_indices[t]) {
                assert_eq!(st.values[point as usize], [vertex[0], vertex[1]]);
            }
        }
    }
}

#[test]
fn bad_bindings_and_subsets_give_one_warning() {
    let mut db = SceneDb::new();
    db.upsert_material(network("/odd", vec![node("Odd", &[], &[])]));
    db.upsert_material(color("/m", 0.5));
    let mut bad = bind(quads("/a", 1), "/gone", &[("/odd", &[0, 7, -1])]);
    bad.subsets.push(SubsetDesc {
        path: "/s".into(),
        material: Some("/m".into()),
        faces: TypedArray::of(vec![0.5_f32]),
    });
    db.upsert_mesh(bad);
    // Two meshes of one id.
    db.upsert_mesh(bind(quads("/b", 2), "/m", &[]));
    db.upsert_mesh(quads("/c", 2));
    // An id that no table reaches.
    db.upsert_mesh(bind(quads("/d", i32::MAX), "/m", &[]));
    let commit = db.commit();
    assert_eq!(commit.snapshot.validate(), Ok(()));
    let expected = DroppedData { subset_faces: 2, wrong_array_types: 1, ..DroppedData::default() };
    assert_eq!(commit.snapshot.dropped, expected);
    let warned: Vec<(&str, &str)> = commit.warnings.iter().map(|w| (&*w.path, &*w.message)).collect();
    for (path, part) in [
        ("/a", "/gone does not exist"),
        ("/a", "subset faces"),
        ("/c", "same prim id"),
        ("/d", "out of range"),
        ("/odd", "not supported"),
    ] {
        assert!(warned.iter().any(|(p, m)| *p == path && m.contains(part)), "{path}: {part} in {warned:?}");
    }
    assert_eq!(warned.len(), 4, "one warning per prim: {warned:?}");
    assert_eq!(commit.snapshot.surfaces.slots(1), [NO_MATERIAL, NO_MATERIAL, 0]);
    assert_eq!(commit.snapshot.surfaces.slots(2), [0], "the first by path");
    db.set_purposes(&[]);
    assert!(db.commit().warnings.is_empty());
}

#[test]
fn prototypes_have_materials_and_collections() {
    let mut db = SceneDb::new();
    let mut leaf = bind(quads("/i/p/leaf", 9), "/m", &[]);
    leaf.prim.instanced_by = vec![by("/i", "/i/p")];
    leaf.categories = vec!["b".into(), "a".into(), "a".into()];
    db.upsert_mesh(leaf);
    db.upsert_instancer(scatter("/i", &[[0.0; 3], [5.0, 0.0, 0.0]], &[("/i/p", &[0, 1])]));
    db.upsert_mesh(quads("/plain", 4));
    db.upsert_mesh(MeshDesc {
        prim: oocpt_core::PrimDesc { visible: false, ..prim("/hidden") },
        ..bind(quads("/hidden", 5), "/n", &[])
    });
    db.upsert_material(color("/m", 0.5));
    db.upsert_material(color("/n", 0.5));
    let snapshot = committed(&mut db);
    assert_eq!(snapshot.surfaces.slots(9), [0]);
    assert_eq!(snapshot.surfaces.slots(4), [NO_MATERIAL]);
    assert_eq!(snapshot.surfaces.materials.len(), 1, "hidden meshes show no material");
    let set = snapshot.surfaces.prims[10].category_set as usize;
    let names: Vec<&str> = snapshot.surfaces.category_sets[set].iter().map(|name| &**name).collect();
    assert_eq!(names, ["a", "b"]);
}

#[test]
fn masks_are_by_prim_id_and_an_edit_of_one_builds_no_mesh() {
    let mut db = SceneDb::new();
    let mesh = quads("/a", 4);
    let masked = |mask| MeshDesc { mask, ..mesh.clone() };
    db.upsert_mesh(masked(PrimMask::NO_CAMERA));
    let before = committed(&mut db);
    assert_eq!(before.surfaces.masks, [vec![PrimMask::empty(); 5], vec![PrimMask::NO_CAMERA]].concat());
    assert!(before.features.contains(Features::PRIM_MASKS) && before.surfaces.prims.is_empty(), "nothing else of it");
    db.upsert_mesh(masked(PrimMask::NO_CAMERA));
    assert!(!db.commit().changed, "the same again is no edit");
    db.upsert_mesh(masked(PrimMask::MATTE));
    let after = committed(&mut db);
    assert_eq!(after.surfaces.masks[5], PrimMask::MATTE);
    assert!(Arc::ptr_eq(&before.meshes[0], &after.meshes[0]), "no mesh is built");
    db.upsert_mesh(mesh.clone());
    let plain = committed(&mut db);
    assert!(plain.surfaces.masks.is_empty() && !plain.features.contains(Features::PRIM_MASKS), "none is left");
    db.upsert_mesh(MeshDesc { prim_id: i32::MAX, ..masked(PrimMask::MATTE) });
    let commit = db.commit();
    assert!(commit.snapshot.surfaces.masks.is_empty(), "no table of two thousand million");
    assert!(commit.warnings.iter().any(|w| w.message.contains("all rays see it")), "{:?}", commit.warnings);
}

/// Below instances in collections of their own a prim has another id, and the same mask.
#[test]
fn masks_of_linked_instances_are_those_of_the_prim() {
    let mut db = SceneDb::new();
    let mut leaf = MeshDesc { mask: PrimMask::NO_SHADOW, ..quads("/i/p/leaf", 2) };
    leaf.prim.instanced_by = vec![by("/i", "/i/p")];
    db.upsert_mesh(leaf);
    let links = InstanceLinks { sets: vec![vec!["near".into()], Vec::new()], of: Some(vec![0, 1]) };
    let instancer = scatter("/i", &[[0.0; 3], [5.0, 0.0, 0.0]], &[("/i/p", &[0, 1])]);
    db.upsert_instancer(InstancerDesc { links: Arc::new(links), ..instancer });
    db.upsert_light(LightDesc { light_link: Some("near".into()), ..LightDesc::default() });
    let surfaces = &committed(&mut db).surfaces;
    let other = surfaces.prims.iter().position(|record| record.shown_as == Some(2)).expect("another id");
    assert_eq!((surfaces.masks[3], surfaces.masks[other]), (PrimMask::NO_SHADOW, PrimMask::NO_SHADOW));
}
