// SPDX-License-Identifier: Apache-2.0
//! Scenes of one board that ask for one thing.

use crate::lights::light;
use crate::materials::{board, coordinates, material, node, plain, textured, with};
use crate::scenes::{instanced, instancer, prim};
use glam::{DMat4, DQuat, DVec3};
use oocpt_core::ArrayElement;
use oocpt_core::array::TypedArray;
use oocpt_core::scene::TransformSample;
use oocpt_core::scene::{
    Interpolation, LightDesc, LightKind, MaterialDesc, MeshDesc, NamedPrimvar, ParamValue, Primvar, SceneDb,
};

/// A board that nothing is known of: no colour, no normals, no material.
pub(crate) fn bare(path: &str) -> MeshDesc {
    MeshDesc { display_color: None, material: None, ..board(path, 1, "") }
}

pub(crate) fn shown(db: &mut SceneDb) {
    db.upsert_mesh(bare("/board"));
}

pub(crate) fn lit(db: &mut SceneDb, light: LightDesc) {
    shown(db);
    db.upsert_light(light);
}

pub(crate) fn ball() -> LightDesc {
    light(LightKind::Sphere { radius: 0.2, treat_as_point: false }, DMat4::from_translation(DVec3::Z * 3.0))
}

/// `material` has the path `/material`.
pub(crate) fn made_of(db: &mut SceneDb, material: MaterialDesc) {
    db.upsert_material(material);
    db.upsert_mesh(MeshDesc { material: Some("/material".into()), ..bare("/board") });
}

pub(crate) fn dressed(db: &mut SceneDb, params: &[(&str, ParamValue)]) {
    made_of(db, plain("/material", params));
}

pub(crate) fn open_pbr(db: &mut SceneDb, params: &[(&str, ParamValue)]) {
    made_of(db, material("/material", vec![node("ND_open_pbr_surface_surfaceshader", params, &[])]));
}

pub(crate) fn papered(db: &mut SceneDb, input: &str, output: &str, params: &[(&str, ParamValue)]) {
    db.upsert_material(textured("/material", input, output, params));
    let mesh = MeshDesc { material: Some("/material".into()), ..bare("/board") };
    db.upsert_mesh(with(mesh, "st", Interpolation::Vertex, coordinates(|st| st)));
}

/// A row of two boards in an instancer, with a primvar of a value for each.
pub(crate) fn placed<T: ArrayElement + std::fmt::Debug>(db: &mut SceneDb, name: &str, values: Vec<T>) {
    let mesh = bare("/row/board");
    db.upsert_mesh(MeshDesc { prim: instanced(mesh.prim.clone(), "/row"), ..mesh });
    let places = [-0.5, 0.5].map(|x| (DVec3::X * x, DQuat::IDENTITY, DVec3::splat(0.4)));
    let mut row = instancer(prim("/row", DMat4::IDENTITY), "/row/board", &places);
    let primvar = Primvar { interpolation: Interpolation::Instance, values: TypedArray::of(values), indices: None };
    row.primvars.push(NamedPrimvar { name: name.into(), primvar });
    db.upsert_instancer(row);
}

/// Two levels of instancers, the inner one with too many records for the outer one's.
pub(crate) fn nested(db: &mut SceneDb) {
    let grid = |count: u32, size: f64| -> Vec<(DVec3, DQuat, DVec3)> {
        (0..count).map(|k| (DVec3::X * size * f64::from(k), DQuat::IDENTITY, DVec3::splat(0.01))).collect()
    };
    db.upsert_instancer(instancer(prim("/outer", DMat4::IDENTITY), "/outer/inner", &grid(40, 0.02)));
    let inner = instanced(prim("/outer/inner", DMat4::IDENTITY), "/outer");
    db.upsert_instancer(instancer(inner, "/outer/inner/board", &grid(40, 2.0)));
    let mesh = bare("/outer/inner/board");
    db.upsert_mesh(MeshDesc { prim: instanced(mesh.prim.clone(), "/outer/inner"), ..mesh });
}

/// A board that turns.
pub(crate) fn turning(db: &mut SceneDb) {
    let mut mesh = bare("/board");
    let turned = mesh.prim.transform * DMat4::from_rotation_z(0.5);
    mesh.prim.motion = [(0.0, mesh.prim.transform), (1.0, turned)]
        .map(|(time, transform)| TransformSample { time, transform })
        .to_vec();
    db.upsert_mesh(mesh);
}
