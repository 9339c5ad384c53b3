// SPDX-License-Identifier: Apache-2.0
//! Ptex: which textures are, and where triangles lie in faces.

use oocpt_abi::{Features, MaterialFlags, MaterialInput, NAME_PTEX};
use oocpt_core::material::{PTEX_SET, compile, is_ptex_name};
use oocpt_core::mesh::{PtexPart, PtexTriangle, split_mesh};
use oocpt_core::{AnyAttribute, Interpolation, MaterialDesc, MeshAsset, MeshDesc, NamedPrimvar, SceneDb, TypedArray};

use crate::material::preview_surface::{file, network, node, text};
use crate::support::{asset, committed, grid, polygons, primvar};

fn painted(kind: &str, name: &str) -> MaterialDesc {
    network(
        "/m",
        vec![
            node("UsdPreviewSurface", &[], &[("diffuseColor", 1, "rgb"), ("roughness", 1, "r")]),
            node(kind, &[("file", file(name))], &[]),
        ],
    )
}

fn built(mut desc: MeshDesc) -> (MeshAsset, Features) {
    desc.material = Some("/m".into());
    let mut db = SceneDb::new();
    db.upsert_material(painted("UsdUVTexture", "a.ptx"));
    db.upsert_mesh(desc);
    let snapshot = committed(&mut db);
    (MeshAsset::clone(&asset(&snapshot.meshes[0])), snapshot.features)
}

/// Part, face and sides of each triangle, by authored face.
fn parts(mesh: &MeshAsset) -> Vec<(u32, PtexPart, u32, u16)> {
    let mut all: Vec<_> =
        mesh.triangles.iter().zip(&mesh.ptex).map(|(t, p)| (t.face, p.part, p.face, p.sides)).collect();
    all.sort_by_key(|(face, part, ptex, _)| (*face, *ptex, *part as u32));
    all
}

#[test]
fn ptex_files_and_nodes_are_recognized() {
    assert!(["a.ptx", "/b/A.PTX", "/c/scene.usdz[0/a.ptx]"].iter().all(|name| is_ptex_name(name)));
    assert!(["a.png", "ptx", "a.ptx.png", "", "/c/scene.usdz[a.png]"].iter().all(|name| !is_ptex_name(name)));
    for (kind, name, is_ptex) in
        [("UsdUVTexture", "a.ptx", true), ("UsdUVTexture", "a.png", false), ("HwPtexTexture_1", "a.tex", true)]
    {
        let made = compile(&painted(kind, name));
        assert_eq!(made.problem(), None, "{kind} {name}");
        let [texture] = &made.textures[..] else { panic!("one texture") };
        let material = made.material.expect("understood");
        assert_eq!(
            (texture.is_ptex, material.flags.contains(MaterialFlags::PTEX)),
            (is_ptex, is_ptex),
            "{kind} {name}"
        );
        let sets: Vec<_> = material.uv_sets.iter().map(|set| (&*set.name, set.id)).collect();
        assert_eq!(sets, if is_ptex { vec![(PTEX_SET, NAME_PTEX)] } else { Vec::new() });
    }
}

#[test]
fn a_third_set_of_coordinates_is_left_out() {
    let textures = |name: &str, at| node("UsdUVTexture", &[("file", file(name))], &[("st", at, "result")]);
    let reader = |name: &str| node("UsdPrimvarReader_float2", &[("varname", text(name))], &[]);
    let inputs = [("diffuseColor", 1, "rgb"), ("emissiveColor", 2, "rgb"), ("specularColor", 3, "rgb")];
    let made = compile(&network(
        "/m",
        vec![
            node("UsdPreviewSurface", &[], &inputs),
            textures("a.png", 4),
            textures("b.png", 5),
            node("UsdUVTexture", &[("file", file("c.ptx"))], &[]),
            reader("st"),
            reader("uv"),
        ],
    ));
    assert!(made.problem().expect("said").contains("Ptex"), "which one");
    let material = made.material.expect("understood");
    assert!(!material.flags.contains(MaterialFlags::PTEX) && material.uv_sets.len() == 2);
    assert!(matches!(material.input(MaterialInput::SpecularColor), oocpt_core::material::InputValue::Constant(_)));
}

#[test]
fn faces_are_numbered_as_ptex_does() {
    // A quad, a triangle, a face of two corners, a pentagon that is a hole, and a quad.
    let points: Vec<[f32; 3]> = (0..9_u8).map(f32::from).map(|k| [k % 3.0, (k / 3.0).floor(), 0.1 * k * k]).collect();
    let mut desc = polygons("/a", &[4, 3, 2, 5, 4], &[0, 1, 4, 3, 1, 2, 4, 0, 1, 3, 4, 7, 6, 3, 4, 5, 8, 7], &points);
    desc.hole_indices = Some(TypedArray::of(vec![3]));
    let (mesh, features) = built(desc);
    assert!(features.contains(Features::PTEX | Features::TEXTURES));
    let all = parts(&mesh);
    let quad = |face: u32| all.iter().filter(|part| part.0 == face).map(|p| (p.1 as u32, p.2, p.3)).collect::<Vec<_>>();
    assert!(quad(0) == [(0, 0, 0), (1, 0, 0)] || quad(0) == [(2, 0, 0), (3, 0, 0)], "one face: {:?}", quad(0));
    let wedges = [(4, 1, 3), (4, 2, 3), (5, 3, 3)];
    assert_eq!(quad(1), wedges, "a face at each corner, the last one meets the first");
    // 1 + 3 + 2 + 5 come before.
    assert!(quad(4).len() == 2 && quad(4).iter().all(|part| part.1 == 11), "{:?}", quad(4));
    assert_eq!(PtexTriangle { face: 11, part: PtexPart::LastWedge, sides: 5 }.word(), 11 << 3 | 5);
}

#[test]
fn the_middle_of_a_face_has_the_mean_of_its_values() {
    let points = [[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [0.0, 3.0, 3.0]];
    let mut desc = polygons("/a", &[3], &[0, 1, 2], &points);
    desc.display_opacity = Some(primvar(Interpolation::Vertex, vec![0.0_f32, 0.5, 1.0]));
    desc.normals =
        Some(primvar(Interpolation::FaceVarying, vec![[0.0_f32, 0.0, 1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]));
    let (mesh, _) = built(desc.clone());
    assert_eq!(mesh.triangles.len(), 3, "around the middle");
    let opacities = mesh.opacities.as_ref().expect("below one");
    let normals = mesh.normals.as_ref().expect("authored");
    for (t, triangle) in mesh.triangles.iter().enumerate() {
        assert_eq!(triangle.vertices[2], [1.0, 1.0, 1.0], "the mean of the corners");
        let point = |k: usize| mesh.corner_indices[t][k] as usize;
        assert_eq!(opacities.values[point(2)], 0.5, "by point");
        let corner = points.iter().position(|p| *p == triangle.vertices[0]).expect("a corner");
        assert_eq!((point(0), opacities.values[point(0)]), (corner, 0.5 * corner as f32), "the corners keep theirs");
        let off = normals.values[3 * t + 2].map(|v| (v - 3.0_f32.sqrt().recip()).abs());
        assert!(off.iter().all(|v| *v < 1e-6), "by corner, of length 1: {off:?}");
    }
    // Without Ptex it is one triangle.
    let mut db = SceneDb::new();
    db.upsert_mesh(desc);
    let plain = committed(&mut db);
    assert!(plain.meshes[0].triangles == 1 && plain.meshes[0].ptex == 0);
}

#[test]
fn a_face_that_does_not_lie_around_its_middle_keeps_its_triangles() {
    // A hook: the mean of its corners is outside.
    let points =
        [[0.0, 0.0, 0.0], [9.0, 0.0, 0.0], [9.0, 9.0, 0.0], [8.0, 9.0, 0.0], [8.0, 1.0, 0.0], [0.0, 1.0, 0.0_f32]];
    let (mesh, _) = built(polygons("/a", &[6], &[0, 1, 2, 3, 4, 5], &points));
    assert_eq!(mesh.triangles.len(), 4);
    assert!(mesh.ptex.iter().all(|place| place.part == PtexPart::Corner && place.face < 6), "{:?}", mesh.ptex);
}

#[test]
fn clusters_keep_the_places_of_their_triangles() {
    let mut desc = grid("/a", 12);
    desc.primvars =
        vec![NamedPrimvar { name: PTEX_SET.into(), primvar: primvar(Interpolation::Constant, vec![1.0_f32]) }];
    let (mesh, _) = built(desc);
    assert!(mesh.primvars.iter().all(|p| !matches!(&p.values, AnyAttribute::One(_))), "a primvar of that name is none");
    let clusters = split_mesh(&mesh, 4096);
    assert!(clusters.len() > 3);
    let of = |mesh: &MeshAsset| parts(mesh);
    let mut all: Vec<_> = clusters.iter().flat_map(of).collect();
    all.sort_by_key(|(face, part, ptex, _)| (*face, *ptex, *part as u32));
    assert_eq!(all, parts(&mesh));
    assert!(all.iter().all(|(face, _, ptex, _)| face == ptex), "quads are numbered as they are");
}
