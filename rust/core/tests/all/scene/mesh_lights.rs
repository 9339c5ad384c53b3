// SPDX-License-Identifier: Apache-2.0
//! Meshes that are lights by `MeshLightAPI`: the materials that they get.

use oocpt_abi::{MaterialFlags, MaterialInput};
use oocpt_core::material::InputValue;
use oocpt_core::scene::{
    AssetRef, ConnectionDesc, MESH_LIGHT, MaterialDesc, MaterialSync, MeshDesc, NodeDesc, ParamDesc, ParamValue,
    SceneDb, ShapingCone,
};
use oocpt_core::{LightDesc, LightKind, Material, PrimDesc, TypedArray};

use glam::{DMat4, DVec3};
use std::sync::Arc;

/// Half a square of side 2: area 2, in the world 2 * 3 * 0.5.
fn triangle() -> MeshDesc {
    MeshDesc {
        prim: PrimDesc {
            path: "/mesh".into(),
            transform: DMat4::from_scale(DVec3::new(3.0, 0.5, 7.0)),
            ..PrimDesc::default()
        },
        prim_id: 4,
        face_vertex_counts: TypedArray::of(vec![3]),
        face_vertex_indices: TypedArray::of(vec![0, 1, 2]),
        points: TypedArray::of(vec![[0.0_f32, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 2.0, 0.0]]),
        ..MeshDesc::default()
    }
}

fn light(sync: MaterialSync) -> LightDesc {
    LightDesc {
        prim: PrimDesc { path: format!("/mesh{MESH_LIGHT}").into(), ..PrimDesc::default() },
        kind: LightKind::Mesh { sync },
        intensity: 3.0,
        exposure: 1.0,
        color: [1.0, 0.5, 0.25],
        ..LightDesc::default()
    }
}

/// `UsdPreviewSurface` of roughness 0.25 with this emission; textured: times a picture.
fn material(emission: [f32; 3], is_textured: bool) -> MaterialDesc {
    let node = |kind: &str, params: Vec<(&str, ParamValue)>, connections: Vec<ConnectionDesc>| NodeDesc {
        path: format!("/m/{kind}").into(),
        kind: kind.into(),
        params: params.into_iter().map(|(name, value)| ParamDesc { name: name.into(), value }).collect(),
        connections,
    };
    let [r, g, b] = emission;
    let file = ParamValue::Asset(AssetRef { authored: "a.png".into(), resolved: "/a.png".into() });
    let scale = ParamValue::Vec4([r, g, b, 1.0]);
    let texture = node("UsdUVTexture", vec![("file", file), ("scale", scale)], Vec::new());
    let params = vec![("roughness", ParamValue::Float(0.25)), ("emissiveColor", ParamValue::Vec3(emission))];
    let connection = ConnectionDesc { input: "emissiveColor".into(), node: 1, output: "rgb".into() };
    let surface = node("UsdPreviewSurface", params, if is_textured { vec![connection] } else { Vec::new() });
    MaterialDesc { path: "/m".into(), nodes: vec![surface, texture], surface: Some(0), ..MaterialDesc::default() }
}

/// The mesh's material, and the warnings.
fn dressed(light: LightDesc, material: Option<MaterialDesc>) -> (Arc<Material>, Vec<String>) {
    let mut db = SceneDb::new();
    let bound = material.as_ref().map(|material| material.path.clone());
    material.into_iter().for_each(|material| db.upsert_material(material));
    db.upsert_mesh(MeshDesc { material: bound, ..triangle() });
    db.upsert_light(light);
    let commit = db.commit();
    let surfaces = &commit.snapshot.surfaces;
    let slot = surfaces.slots(4)[0];
    assert!(commit.snapshot.lights.is_empty(), "it is a surface, and no light of its own");
    let texts = commit.warnings.iter().map(|warning| warning.message.clone()).collect();
    (surfaces.materials[slot as usize].clone(), texts)
}

fn emission(material: &Material) -> [f32; 3] {
    match material.input(MaterialInput::EmissiveColor) {
        InputValue::Constant([r, g, b, _]) => [*r, *g, *b],
        InputValue::Texture { scale: [r, g, b, _], .. } => [*r, *g, *b],
        // Equal to nothing.
        InputValue::Primvar { .. } | InputValue::Register(_) => [f32::NAN; 3],
    }
}

#[test]
fn mesh_light_material_sync_modes_are_applied() {
    use MaterialSync::{GlowTintsLight, Independent, NoResponse};
    let plain = [6.0, 3.0, 1.5];
    let glow = [0.5, 2.0, 4.0];
    for (sync, emits, wanted, roughness) in [
        (GlowTintsLight, glow, [3.0, 6.0, 6.0], 0.25),
        (GlowTintsLight, [0.0; 3], plain, 0.25),
        (Independent, glow, plain, 0.25),
        (NoResponse, glow, plain, 1.0),
    ] {
        let (material, warnings) = dressed(light(sync), Some(material(emits, false)));
        assert_eq!(emission(&material), wanted, "{sync:?} over {emits:?}");
        assert_eq!(*material.input(MaterialInput::Roughness), InputValue::Constant([roughness; 4]), "{sync:?}");
        assert!(material.flags.contains(MaterialFlags::EMISSIVE) && warnings.is_empty(), "{sync:?}: {warnings:?}");
    }
    let (material, _) = dressed(light(GlowTintsLight), None);
    assert_eq!(emission(&material), plain, "no material");
    assert_eq!(
        *material.input(MaterialInput::DiffuseColor),
        InputValue::Constant([0.0, 0.0, 0.0, 1.0]),
        "it reflects nothing"
    );
}

#[test]
fn textured_emission_is_tinted_by_its_scale() {
    let (textured, warnings) = dressed(light(MaterialSync::GlowTintsLight), Some(material([0.5, 2.0, 4.0], true)));
    assert!(matches!(textured.input(MaterialInput::EmissiveColor), InputValue::Texture { .. }), "still a texture");
    assert_eq!(emission(&textured), [3.0, 6.0, 6.0], "scale times the light's");
    assert!(!warnings.iter().any(|text| text.contains("light")), "{warnings:?}");
}

#[test]
fn a_normalised_mesh_is_divided_by_its_area_in_the_world() {
    let desc = LightDesc { normalize: true, ..light(MaterialSync::NoResponse) };
    let (material, _) = dressed(desc, None);
    assert_eq!(emission(&material), [2.0, 1.0, 0.5], "6 / 3 and so on");
}

#[test]
fn unsupported_mesh_light_inputs_give_one_warning() {
    let shaped = LightDesc {
        shaping: Some(ShapingCone::default()),
        diffuse: 0.5,
        light_link: Some("some".into()),
        ..light(MaterialSync::Independent)
    };
    let (_, warnings) = dressed(shaped, None);
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    for part in ["shaping", "light linking", "multipliers"] {
        assert!(warnings[0].contains(part), "{part}: {warnings:?}");
    }
}

#[test]
fn removing_a_mesh_light_restores_the_mesh() {
    let mut db = SceneDb::new();
    db.upsert_material(material([0.0; 3], false));
    db.upsert_mesh(MeshDesc { material: Some("/m".into()), ..triangle() });
    let before = db.commit().snapshot;
    db.upsert_light(light(MaterialSync::Independent));
    let lit = db.commit();
    assert!(lit.changed && lit.snapshot.surfaces.features() != before.surfaces.features(), "it emits");
    assert!(Arc::ptr_eq(&lit.snapshot.meshes[0], &before.meshes[0]), "the mesh is not built again");
    db.remove(&format!("/mesh{MESH_LIGHT}"));
    let after = db.commit();
    assert!(after.changed && after.snapshot.surfaces == before.surfaces, "as before");
    db.upsert_light(light(MaterialSync::Independent));
    db.commit();
    db.remove("/mesh");
    assert!(db.commit().snapshot.meshes.is_empty(), "mesh and light go together");
}

/// Of a prim with both the light's label counts; a label alone is a change of the scene.
#[test]
fn labels_are_those_of_the_light_or_of_the_mesh() {
    let label = |text: &str| Some(Arc::<str>::from(text));
    let mut db = SceneDb::new();
    db.upsert_mesh(MeshDesc { label: label("skin"), ..triangle() });
    let first = db.commit().snapshot;
    assert_eq!(first.surfaces.labels, [vec![None; 5], vec![label("skin")]].concat(), "by prim id + 1");
    assert!(first.surfaces.prims.is_empty(), "without a material there is nothing else of it");
    db.upsert_mesh(MeshDesc { label: label("cloth"), ..triangle() });
    let second = db.commit().snapshot;
    assert!(second.version > first.version, "another scene");
    assert_eq!(second.surfaces.labels[5], label("cloth"));
    db.upsert_light(LightDesc { label: label("key"), ..light(MaterialSync::Independent) });
    assert_eq!(db.commit().snapshot.surfaces.labels[5], label("key"), "the light's");
    db.upsert_light(LightDesc { label: label(""), ..light(MaterialSync::Independent) });
    assert_eq!(db.commit().snapshot.surfaces.labels[5], label("cloth"), "an empty one is none");
    db.upsert_mesh(MeshDesc { label: None, ..triangle() });
    assert_eq!(db.commit().snapshot.surfaces.labels, [], "none");
    let lamp = LightDesc { prim: PrimDesc { path: "/lamp".into(), ..PrimDesc::default() }, ..LightDesc::default() };
    db.upsert_light(LightDesc { label: label("fill"), ..lamp });
    assert_eq!(db.commit().snapshot.lights[0].label, label("fill"), "a lamp's");
}
