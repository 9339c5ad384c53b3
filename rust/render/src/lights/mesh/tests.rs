// SPDX-License-Identifier: Apache-2.0
//! Mesh lights on the host, and the densities that the device finds for them.

use crate::NoFiles;
use crate::assets::SurfaceEntries;
use crate::lights::emission::{EmittedPower, PrimEmission};
use crate::lights::emitter::MeshEmitter;
use crate::lights::tests::probe;
use crate::lights::tree::trails;
use crate::lights::{FileCache, LightTable, MeshLightCache, MeshLights, narrow};
use glam::{DMat4, DQuat, DVec3};
use oocpt_abi::LIGHT_LEAF;
use oocpt_core::scene::{
    ConnectionDesc, InstancedBy, InstancerDesc, InstancerPrototype, Interpolation, MaterialDesc, MeshDesc,
    NamedPrimvar, NodeDesc, ParamDesc, ParamValue, Primvar, Snapshot, SubsetDesc,
};
use oocpt_core::{LightDesc, LightKind, PrimDesc, SceneDb, TypedArray};
use std::sync::Arc;

fn prim(path: &str, transform: DMat4) -> PrimDesc {
    PrimDesc { path: path.into(), transform, ..PrimDesc::default() }
}

fn glow(path: &str, emission: [f32; 3]) -> MaterialDesc {
    let value = ParamValue::Vec3(emission);
    let surface = NodeDesc {
        path: format!("{path}/s").into(),
        kind: "UsdPreviewSurface".into(),
        params: vec![ParamDesc { name: "emissiveColor".into(), value }],
        connections: Vec::new(),
    };
    MaterialDesc { path: path.into(), nodes: vec![surface], surface: Some(0), ..MaterialDesc::default() }
}

/// A cube of side 2, six faces; or, open, without the last one.
pub(in crate::lights) fn cube(path: &str, prim_id: i32, transform: DMat4, is_open: bool) -> MeshDesc {
    let points: Vec<[f32; 3]> =
        (0..8_u8).map(|k| [k & 1, k >> 1 & 1, k >> 2].map(|bit| 2.0 * f32::from(bit) - 1.0)).collect();
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let faces = &faces[..if is_open { 5 } else { 6 }];
    MeshDesc {
        prim: prim(path, transform),
        prim_id,
        face_vertex_counts: TypedArray::of(vec![4; faces.len()]),
        face_vertex_indices: TypedArray::of(faces.concat()),
        points: TypedArray::of(points),
        material: Some("/glow".into()),
        ..MeshDesc::default()
    }
}

pub(in crate::lights) fn instancer(places: &[DVec3]) -> InstancerDesc {
    let numbers: Vec<i32> = (0..).take(places.len()).collect();
    InstancerDesc {
        prim: prim("/lamps", DMat4::IDENTITY),
        prototypes: vec![InstancerPrototype { root: "/lamps/lamp".into(), indices: TypedArray::of(numbers) }],
        translations: Some(TypedArray::of(places.iter().map(|p| p.as_vec3().to_array()).collect::<Vec<_>>())),
        ..InstancerDesc::default()
    }
}

pub(in crate::lights) fn lamp(mut mesh: MeshDesc) -> MeshDesc {
    let prototype_root = mesh.prim.path.clone();
    mesh.prim.instanced_by = vec![InstancedBy { instancer: "/lamps".into(), prototype_root }];
    mesh
}

pub(in crate::lights) fn snapshot(build: impl FnOnce(&mut SceneDb)) -> Arc<Snapshot> {
    let mut db = SceneDb::new();
    db.upsert_material(glow("/glow", [1.0, 2.0, 0.5]));
    build(&mut db);
    db.commit().snapshot
}

pub(in crate::lights) fn mesh_lights(snapshot: &Snapshot) -> Arc<MeshLights> {
    MeshLightCache::default().get(snapshot, None).expect("something emits")
}

#[test]
fn a_scene_without_emission_has_no_mesh_lights() {
    let mut cache = MeshLightCache::default();
    let dark = snapshot(|db| {
        db.upsert_material(glow("/glow", [0.0; 3]));
        db.upsert_mesh(cube("/cube", 0, DMat4::IDENTITY, false));
    });
    assert!(cache.get(&dark, None).is_none(), "black emission");
    let bright = snapshot(|db| db.upsert_mesh(cube("/cube", 0, DMat4::IDENTITY, false)));
    let lights = cache.get(&bright, None).expect("it emits");
    assert!(Arc::ptr_eq(&lights, &cache.get(&bright, None).expect("it emits")), "kept as long as the scene stays");
}

#[test]
fn memory_grows_with_unique_triangles_and_placements() {
    let places: Vec<DVec3> = (0..1000).map(|i| probe::scattered(i, 0) * 100.0).collect();
    let scene = snapshot(|db| {
        db.upsert_instancer(instancer(&places));
        db.upsert_mesh(lamp(cube("/lamps/lamp", 3, DMat4::IDENTITY, false)));
        // Another colour, another prim: the same triangles serve.
        db.upsert_mesh(cube("/cube", 4, DMat4::IDENTITY, false));
    });
    let lights = mesh_lights(&scene);
    assert_eq!(lights.placements.len(), 1001, "one for each placement");
    assert_eq!((lights.meshes.len(), lights.triangles.len(), lights.faces.len()), (1, 12, 6), "one cube");
    assert_eq!(lights.nodes.len(), 1000 + 5, "a tree over all, and one over the faces");
    assert!(lights.placements.is_sorted_by_key(|p| (p.prim_id, p.instance_id, p.mesh)), "hits are looked up");
    assert!(lights.warning.is_none(), "all of them are sampled");
}

#[test]
fn meshes_with_ambiguous_prim_ids_are_not_sampled() {
    let scene = snapshot(|db| {
        for (path, id) in [("/a", 7), ("/b", 7), ("/c", 8), ("/d", -1)] {
            db.upsert_mesh(cube(path, id, DMat4::IDENTITY, false));
        }
    });
    let lights = mesh_lights(&scene);
    let ids: Vec<u32> = lights.placements.iter().map(|p| p.prim_id).collect();
    assert_eq!(ids, [8], "two prims of one id, and one without, are left to rays");
}

#[test]
fn beyond_the_cap_there_is_one_warning() {
    let places: Vec<DVec3> = (0..(1 << 18) + 5).map(|i| probe::scattered(i, 0) * 1000.0).collect();
    let scene = snapshot(|db| {
        db.upsert_instancer(instancer(&places));
        db.upsert_mesh(lamp(cube("/lamps/lamp", 3, DMat4::IDENTITY, false)));
    });
    let lights = mesh_lights(&scene);
    assert_eq!(lights.placements.len(), 1 << 18, "the cap");
    assert!(lights.warning.as_ref().is_some_and(|text| text.contains("262144")), "{:?}", lights.warning);
}

#[test]
fn closed_meshes_shine_outwards() {
    for (is_open, turn, back) in [(true, 1.0, 1.0), (false, 1.0, 0.05), (false, -1.0, 0.05)] {
        let mut mesh = cube("/cube", 0, DMat4::IDENTITY, is_open);
        if turn < 0.0 {
            // Corners the other way round.
            let faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];
            mesh.face_vertex_indices = TypedArray::of(faces.concat());
        }
        let scene = snapshot(|db| db.upsert_mesh(mesh));
        let emitter = MeshEmitter::new(
            &scene.meshes[0].asset().expect("in memory"),
            &PrimEmission { by_slot: vec![EmittedPower::Even(1.0)], scale: 1.0 },
        )
        .expect("it emits");
        let wanted = if is_open { 20.0 } else { 24.0 };
        assert!((emitter.bounds.power - wanted).abs() < 1e-6, "area: {}", emitter.bounds.power);
        for node in &emitter.nodes {
            for side in (0..2).filter(|&side| node.child[side] & LIGHT_LEAF != 0) {
                assert!((node.back[side] - back).abs() < 1e-6, "open: {is_open}: {}", node.back[side]);
                let outwards: f32 =
                    (0..3).map(|k| node.axis[side][k] * 0.5 * (node.min[side][k] + node.max[side][k])).sum();
                assert!(is_open || (outwards - 1.0).abs() < 1e-5, "turn {turn}: {outwards}");
            }
        }
    }
}

#[test]
fn tree_trails_lead_to_their_leaves() {
    let places: Vec<DVec3> = (0..300).map(|i| probe::scattered(i, 0) * 100.0).collect();
    let scene = snapshot(|db| {
        db.upsert_instancer(instancer(&places));
        db.upsert_mesh(lamp(cube("/lamps/lamp", 3, DMat4::IDENTITY, false)));
    });
    let lights = mesh_lights(&scene);
    let all = trails(&lights.nodes, lights.placements.len());
    for (number, light) in (0..).zip(&lights.placements) {
        let trail = u64::from(light.trail[0]) | u64::from(light.trail[1]) << 32;
        assert_eq!(trail, all[number as usize], "as it was made");
        let mut at = 0;
        let found = (0..64).find_map(|depth| {
            let child = lights.nodes[at].child[usize::from(trail >> depth & 1 == 1)];
            at = child as usize;
            (child & LIGHT_LEAF != 0).then_some(child & !LIGHT_LEAF)
        });
        assert_eq!(found, Some(number), "the way of placement {number}");
    }
}

/// Cubes turned, stretched, sheared and mirrored, of two materials, beside local lights or not.
fn room(count: u32, has_locals: bool) -> Arc<Snapshot> {
    snapshot(|db| {
        db.upsert_material(glow("/dim", [0.0, 0.0, 0.25]));
        for i in 0..count {
            let turn = probe::scattered(i, 7) * 6.0;
            let turn = DQuat::from_euler(glam::EulerRot::XYZ, turn.x, turn.y, turn.z);
            let mirror = if i % 3 == 1 { DVec3::new(-1.0, 1.0, 1.0) } else { DVec3::ONE };
            let scale = (DVec3::splat(0.05) + probe::scattered(i, 3) * 0.3) * mirror;
            let at = (probe::scattered(i, 0) - 0.5) * 10.0;
            let shear =
                DMat4::from_cols(glam::DVec4::X, glam::DVec4::new(0.7, 1.0, 0.0, 0.0), glam::DVec4::Z, glam::DVec4::W);
            let transform = DMat4::from_scale_rotation_translation(scale, turn, at) * shear;
            let id = i32::try_from(i).expect("small");
            let mut mesh = cube(&format!("/cube_{i}"), id, transform, i % 2 == 0);
            if i % 5 == 0 {
                let faces = TypedArray::of(vec![1, 3]);
                mesh.subsets = vec![SubsetDesc { path: "/s".into(), material: Some("/dim".into()), faces }];
            }
            db.upsert_mesh(mesh);
        }
        if has_locals {
            let kind = LightKind::Sphere { radius: 0.2, treat_as_point: false };
            db.upsert_light(LightDesc { prim: prim("/light", DMat4::IDENTITY), kind, ..LightDesc::default() });
        }
    })
}

/// Takes what it emits from the primvar "glow".
fn reading(path: &str) -> MaterialDesc {
    let node = |kind: &str, name: &str, value: ParamValue| NodeDesc {
        path: format!("{path}/{kind}").into(),
        kind: kind.into(),
        params: vec![ParamDesc { name: name.into(), value }],
        connections: Vec::new(),
    };
    let mut surface = node("UsdPreviewSurface", "roughness", ParamValue::Float(1.0));
    let connection = ConnectionDesc { input: "emissiveColor".into(), node: 1, output: "result".into() };
    surface.connections.push(connection);
    let reader = node("UsdPrimvarReader_float3", "varname", ParamValue::Text("glow".into()));
    MaterialDesc { path: path.into(), nodes: vec![surface, reader], surface: Some(0), ..MaterialDesc::default() }
}

fn glow_primvar(interpolation: Interpolation, values: Vec<[f32; 3]>) -> NamedPrimvar {
    NamedPrimvar {
        name: "glow".into(),
        primvar: Primvar { interpolation, values: TypedArray::of(values), indices: None },
    }
}

/// A value for each face, for each point, for each instance; and a constant.
fn varied_room() -> Arc<Snapshot> {
    snapshot(|db| {
        db.upsert_material(reading("/read"));
        for i in 0..100 {
            let at = (probe::scattered(i, 0) - 0.5) * 10.0;
            let transform = DMat4::from_scale_rotation_translation(DVec3::splat(0.3), DQuat::from_rotation_y(at.x), at);
            let mut mesh = cube(&format!("/cube_{i}"), i32::try_from(i).expect("small"), transform, i % 2 == 0);
            let value = |k: usize| (probe::scattered(i, u32::try_from(k).expect("small")).as_vec3() - 0.3).to_array();
            let faces = mesh.face_vertex_counts.len();
            mesh.primvars.extend(match i % 4 {
                0 => Some(glow_primvar(Interpolation::Uniform, (0..faces).map(value).collect())),
                1 => Some(glow_primvar(Interpolation::Vertex, (0..8).map(value).collect())),
                2 => Some(glow_primvar(Interpolation::FaceVarying, (0..4 * faces).map(value).collect())),
                _ => None,
            });
            if i % 4 != 3 {
                mesh.material = Some("/read".into());
            }
            db.upsert_mesh(mesh);
        }
        let places: Vec<DVec3> = (0..50).map(|i| (probe::scattered(i, 9) - 0.5) * 10.0).collect();
        let values = (0..50).map(|i| (probe::scattered(i, 4).as_vec3() * 3.0).to_array()).collect();
        let mut lamps = instancer(&places);
        lamps.primvars.push(glow_primvar(Interpolation::Instance, values));
        db.upsert_instancer(lamps);
        let mut mesh = lamp(cube("/lamps/lamp", 200, DMat4::IDENTITY, false));
        mesh.material = Some("/read".into());
        db.upsert_mesh(mesh);
    })
}

/// Weights of faces: means over their corners, of what is above 0.
#[test]
fn face_weights_are_the_mean_emission_of_corners() {
    let scene = snapshot(|db| {
        db.upsert_material(reading("/read"));
        let mut mesh = cube("/cube", 3, DMat4::IDENTITY, false);
        let values = [[0.0; 3], [1.0; 3], [-2.0; 3], [0.0, 0.0, 1.0], [4.0; 3], [0.5; 3]];
        mesh.primvars.push(glow_primvar(Interpolation::Uniform, values.to_vec()));
        mesh.material = Some("/read".into());
        db.upsert_mesh(mesh);
    });
    let lights = mesh_lights(&scene);
    let faces: Vec<u32> = lights.faces.iter().map(|[face, _]| *face).collect();
    assert_eq!(faces, [1, 3, 4, 5], "what is black or less is left out");
    for (given, wanted) in lights.face_weights.iter().zip([1.0_f32, 0.0722, 4.0, 0.5]) {
        assert!((given / wanted - 1.0).abs() < 1e-6, "{given}, not {wanted}");
    }
    assert!((lights.bounds.power - 4.0 * 5.5722).abs() < 1e-5, "areas times weights: {}", lights.bounds.power);
}

/// The innermost instancer's value, and the mesh's own before it.
#[test]
fn mesh_light_placements_use_instance_values() {
    let values: Vec<[f32; 3]> = vec![[1.0; 3], [0.0; 3], [3.0, 0.0, 0.0]];
    let scene = |own: bool| {
        snapshot(|db| {
            db.upsert_material(reading("/read"));
            let mut lamps = instancer(&[DVec3::ZERO, DVec3::X * 9.0, DVec3::Y * 9.0]);
            lamps.primvars.push(glow_primvar(Interpolation::Instance, values.clone()));
            db.upsert_instancer(lamps);
            let mut mesh = lamp(cube("/lamps/lamp", 3, DMat4::IDENTITY, false));
            mesh.material = Some("/read".into());
            if own {
                mesh.primvars.push(glow_primvar(Interpolation::Constant, vec![[5.0; 3]]));
            }
            db.upsert_mesh(mesh);
        })
    };
    let lights = mesh_lights(&scene(false));
    let told: Vec<[f32; 3]> =
        lights.placements.iter().map(|light| lights.placed_values[light.values as usize]).collect();
    assert_eq!(told, [[1.0; 3], [3.0, 0.0, 0.0]], "the black one is no light");
    assert_eq!(lights.meshes.len(), 1, "one mesh serves both");
    let lights = mesh_lights(&scene(true));
    assert_eq!((lights.placements.len(), lights.placed_values.len()), (3, 0), "its own value wins");
}

/// What choosing a point gives as its density is what a hit there is weighed with.
#[test]
fn hit_pdf_equals_sampling_pdf() {
    for (count, has_locals) in [(1, false), (3, true), (200, false), (200, true), (0, false)] {
        let scene = if count == 0 { varied_room() } else { room(count, has_locals) };
        let lights = mesh_lights(&scene);
        let (mut table, warnings) = LightTable::new(&scene, &scene.lights, true, &NoFiles, &mut FileCache::default());
        table.add_meshes(&lights);
        assert!(warnings.is_empty(), "{warnings:?}");
        let surfaces = SurfaceEntries::new(&scene.surfaces).expect("materials");
        let [samples] = probe::run(&table, Some(&surfaces), [2]);
        let (mut met, mut short) = (0, 0);
        let mut seen = vec![false; lights.placements.len()];
        for [chosen, hit, light, reach] in samples {
            if light <= 0.0 {
                continue;
            }
            met += 1;
            assert!(chosen.is_finite() && chosen > 0.0, "{count}: {chosen}");
            assert!((hit / chosen - 1.0).abs() < 1e-5, "{count} cubes, {has_locals}: {chosen} and {hit}");
            assert!((0.5..1.0).contains(&reach), "{count}: shadow rays end before the mesh: {reach}");
            short += u32::from(reach < 0.999);
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small index")]
            let index = light as usize - 1;
            seen[index] = true;
        }
        let receivers = narrow(f64::from(u32::try_from(probe::receivers().len()).expect("small")));
        let share = if has_locals { 0.2 } else { 0.7 };
        assert!(met as f32 > share * receivers, "{count}: {met} samples");
        assert!(short * 50 < met, "{count}: {short} of {met} shadow rays end far before the mesh");
        let chosen = seen.iter().filter(|seen| **seen).count();
        // Some of those of varied emission are all but dark.
        let least = if count == 0 { 8 } else { 9 };
        assert!(chosen * 10 > seen.len() * least, "{count}: {chosen} of the cubes are chosen by some");
    }
}
