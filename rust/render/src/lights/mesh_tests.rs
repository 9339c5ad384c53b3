// SPDX-License-Identifier: Apache-2.0
//! Mesh lights on the host, and the densities that the device finds for them.

use super::emitter::Emitter;
use super::tests::probe;
use super::tree::trails;
use super::{FileCache, LightTable, MeshLightCache, MeshLights, NoFiles, narrow};
use crate::assets::SurfaceEntries;
use glam::{DMat4, DQuat, DVec3};
use oocpt_core::scene::{
    InstancedBy, InstancerDesc, InstancerPrototype, MaterialDesc, MeshDesc, NodeDesc, ParamDesc, ParamValue, Snapshot,
    SubsetDesc,
};
use oocpt_core::{LightDesc, LightKind, PrimDesc, SceneDb, TypedArray};
use oocpt_shader_abi::LIGHT_LEAF;
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
    MaterialDesc { path: path.into(), nodes: vec![surface], surface: Some(0) }
}

/// A cube of side 2, six faces; or, open, without the last one.
fn cube(path: &str, prim_id: i32, transform: DMat4, is_open: bool) -> MeshDesc {
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

fn instancer(places: &[DVec3]) -> InstancerDesc {
    let numbers: Vec<i32> = (0..).take(places.len()).collect();
    InstancerDesc {
        prim: prim("/lamps", DMat4::IDENTITY),
        prototypes: vec![InstancerPrototype { root: "/lamps/lamp".into(), indices: TypedArray::of(numbers) }],
        translations: Some(TypedArray::of(places.iter().map(|p| p.as_vec3().to_array()).collect::<Vec<_>>())),
        ..InstancerDesc::default()
    }
}

fn lamp(mut mesh: MeshDesc) -> MeshDesc {
    let prototype_root = mesh.prim.path.clone();
    mesh.prim.instanced_by = vec![InstancedBy { instancer: "/lamps".into(), prototype_root }];
    mesh
}

fn snapshot(build: impl FnOnce(&mut SceneDb)) -> Arc<Snapshot> {
    let mut db = SceneDb::new();
    db.upsert_material(glow("/glow", [1.0, 2.0, 0.5]));
    build(&mut db);
    db.commit().snapshot
}

fn mesh_lights(snapshot: &Snapshot) -> Arc<MeshLights> {
    MeshLightCache::default().get(snapshot).expect("something emits")
}

#[test]
fn nothing_that_emits_is_no_light() {
    let mut cache = MeshLightCache::default();
    let dark = snapshot(|db| {
        db.upsert_material(glow("/glow", [0.0; 3]));
        db.upsert_mesh(cube("/cube", 0, DMat4::IDENTITY, false));
    });
    assert!(cache.get(&dark).is_none(), "black emission");
    let bright = snapshot(|db| db.upsert_mesh(cube("/cube", 0, DMat4::IDENTITY, false)));
    let lights = cache.get(&bright).expect("it emits");
    assert!(Arc::ptr_eq(&lights, &cache.get(&bright).expect("it emits")), "kept as long as the scene stays");
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
fn what_a_hit_cannot_tell_apart_is_no_light() {
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
        let emitter = Emitter::new(&scene.meshes[0], &[1.0]).expect("it emits");
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
fn trails_lead_to_their_leaves() {
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

/// What choosing a point gives as its density is what a hit there is weighed with.
#[test]
fn a_hit_has_the_density_of_choosing_it() {
    for (count, has_locals) in [(1, false), (3, true), (200, false), (200, true)] {
        let scene = room(count, has_locals);
        let lights = mesh_lights(&scene);
        let (mut table, warnings) =
            LightTable::new(&scene, &scene.lights, true, true, &NoFiles, &mut FileCache::default());
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
        assert!(chosen * 10 > seen.len() * 9, "{count}: {chosen} of the cubes are chosen by some");
    }
}
