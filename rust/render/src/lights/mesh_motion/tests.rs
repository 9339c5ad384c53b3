// SPDX-License-Identifier: Apache-2.0
//! Mesh lights that move: their tables, their bounds, and the densities that the device finds at times of the shutter.

use crate::NoFiles;
use crate::assets::SurfaceEntries;
use crate::lights::mesh::tests::{cube, instancer, lamp, mesh_lights, snapshot};
use crate::lights::tests::probe;
use crate::lights::{FileCache, LightTable, MeshLights, narrow};
use glam::{DMat4, DQuat, DVec3};
use oocpt_abi::{Features, LIGHT_LEAF};
use oocpt_core::scene::{MeshDesc, Snapshot, TransformSample};
use oocpt_core::{LightDesc, LightKind, PrimDesc, TypedArray};
use std::sync::Arc;

/// Makes a mesh that moves from one map to another.
fn moving(mut desc: MeshDesc, from: DMat4, to: DMat4) -> MeshDesc {
    desc.prim.transform = from;
    desc.prim.motion = [(0.0, from), (1.0, to)].map(|(time, transform)| TransformSample { time, transform }).to_vec();
    desc
}

fn place(i: u32, salt: u32) -> DMat4 {
    let turn = probe::scattered(i, salt + 7) * 3.0;
    let turn = DQuat::from_euler(glam::EulerRot::XYZ, turn.x, turn.y, turn.z);
    let mirror = if i % 3 == 1 { DVec3::new(-1.0, 1.0, 1.0) } else { DVec3::ONE };
    let scale = (DVec3::splat(0.05) + probe::scattered(i, salt + 3) * 0.3) * mirror;
    let shear = DMat4::from_cols(glam::DVec4::X, glam::DVec4::new(0.7, 1.0, 0.0, 0.0), glam::DVec4::Z, glam::DVec4::W);
    let at = (probe::scattered(i, salt) - 0.5) * 10.0;
    DMat4::from_scale_rotation_translation(scale, turn, at) * if i.is_multiple_of(4) { shear } else { DMat4::IDENTITY }
}

/// Cubes, two of three of which move, turn and change their shape; and some in an instancer that turns.
fn room(count: u32, has_locals: bool) -> Arc<Snapshot> {
    snapshot(|db| {
        for i in 0..count {
            let id = i32::try_from(i).expect("small");
            let desc = cube(&format!("/cube_{i}"), id, place(i, 0), i % 2 == 0);
            let goes = i == 0 || i % 3 != 0;
            db.upsert_mesh(if goes { moving(desc, place(i, 0), place(i, 20)) } else { desc });
        }
        let places: Vec<DVec3> = (0..count).map(|i| (probe::scattered(i, 9) - 0.5) * 8.0).collect();
        let mut lamps = instancer(&places);
        let turn = |time: f64| TransformSample { time, transform: DMat4::from_rotation_y(1.5 * time) };
        lamps.prim.motion = vec![turn(0.0), turn(1.0)];
        db.upsert_instancer(lamps);
        db.upsert_mesh(lamp(cube("/lamps/lamp", 1000, DMat4::from_scale(DVec3::splat(0.1)), false)));
        if has_locals {
            let kind = LightKind::Sphere { radius: 0.2, treat_as_point: false };
            let prim = PrimDesc { path: "/light".into(), ..PrimDesc::default() };
            db.upsert_light(LightDesc { prim, kind, ..LightDesc::default() });
        }
    })
}

fn table(scene: &Snapshot, lights: &Arc<MeshLights>) -> LightTable {
    let (mut table, warnings) = LightTable::new(scene, &scene.lights, true, &NoFiles, &mut FileCache::default());
    table.add_meshes(lights);
    assert!(warnings.is_empty(), "{warnings:?}");
    table
}

/// The density of choosing a point equals the density with which a hit there is weighted, at the time of the path.
#[test]
fn hit_pdf_equals_sampling_pdf_at_any_time() {
    for (count, has_locals) in [(1, false), (3, true), (200, false), (200, true)] {
        let scene = room(count, has_locals);
        let lights = mesh_lights(&scene);
        assert_eq!(lights.placements.len(), 2 * count as usize, "all are sampled");
        let table = table(&scene, &lights);
        assert!(table.features.contains(Features::MOVING_MESH_LIGHTS), "some move");
        let surfaces = SurfaceEntries::new(&scene.surfaces).expect("materials");
        let [samples] = probe::run(&table, Some(&surfaces), [2]);
        let mut met = 0;
        let mut seen = vec![false; lights.placements.len()];
        for [chosen, hit, light, reach] in samples.into_iter().filter(|sample| sample[2] > 0.0) {
            met += 1;
            assert!(chosen.is_finite() && chosen > 0.0, "{count}: {chosen}");
            assert!((hit / chosen - 1.0).abs() < 1e-5, "{count} cubes, {has_locals}: {chosen} and {hit}");
            assert!((0.5..1.0).contains(&reach), "{count}: shadow rays end before the mesh: {reach}");
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small index")]
            let index = light as usize - 1;
            seen[index] = true;
        }
        let receivers = narrow(f64::from(u32::try_from(probe::receivers().len()).expect("small")));
        assert!(met as f32 > if has_locals { 0.2 } else { 0.7 } * receivers, "{count}: {met} samples");
        let chosen = seen.iter().filter(|seen| **seen).count();
        assert!(chosen * 10 > seen.len() * 9, "{count}: {chosen} of {} are chosen by some", seen.len());
    }
}

/// The leaves of the tree over placements bound each one at all times.
#[test]
fn tree_boxes_bound_moving_lights_at_any_time() {
    let scene = room(60, false);
    let lights = mesh_lights(&scene);
    let found = scene.mesh_placements(&|_| true, 1000).all;
    let mut moved = 0;
    for node in lights.nodes.iter().take(lights.placements.len() - 1) {
        for side in (0..2).filter(|&side| node.child[side] & LIGHT_LEAF != 0) {
            let light = &lights.placements[(node.child[side] & !LIGHT_LEAF) as usize];
            let name = (light.prim_id, light.instance_id, light.mesh);
            let same =
                |p: &&oocpt_core::scene::MeshPlacement| (p.prim_id.unsigned_abs(), p.instance_id, p.mesh) == name;
            let placement = found.iter().find(same).expect("it has a place");
            let [min, max] = [node.min[side], node.max[side]].map(|corner| DVec3::from(corner.map(f64::from)));
            let mut least = f64::INFINITY;
            for step in 0..=500 {
                let map = placement.world_at(f64::from(step) / 500.0);
                for corner in 0..8_u8 {
                    let p = [corner & 1, corner >> 1 & 1, corner >> 2].map(|bit| 2.0 * f64::from(bit) - 1.0);
                    let p = map.transform_point3(DVec3::from(p));
                    least = least.min((p - min).min(max - p).min_element());
                }
            }
            assert!(least >= 0.0, "{name:?} leaves its box by {}", -least);
            moved += usize::from(!placement.motion.is_empty());
        }
    }
    assert!(moved > 90, "{moved} move");
}

/// Keys that instances share are stored once; without motion there is no table.
#[test]
fn motion_tables_grow_only_with_independent_motion() {
    let places: Vec<DVec3> = (0..1000).map(|i| probe::scattered(i, 0) * 100.0).collect();
    let scene = |turns: bool, flies: bool| {
        snapshot(|db| {
            let mut lamps = instancer(&places);
            if turns {
                let turn = |time: f64| TransformSample { time, transform: DMat4::from_rotation_y(time) };
                lamps.prim.motion = vec![turn(0.0), turn(1.0)];
            }
            if flies {
                lamps.motion.velocities = Some(TypedArray::of(vec![[1.0_f32, 0.0, 0.0]; places.len()]));
                lamps.motion.seconds = [0.0, 1.0];
            }
            db.upsert_instancer(lamps);
            db.upsert_mesh(lamp(cube("/lamps/lamp", 3, DMat4::IDENTITY, false)));
            db.upsert_mesh(cube("/still", 4, DMat4::IDENTITY, false));
        })
    };
    for (turns, flies, levels, keys) in
        [(false, false, 0, 0), (true, false, 1, 2), (false, true, 1, 2000), (true, true, 2, 2002)]
    {
        let scene = scene(turns, flies);
        let lights = mesh_lights(&scene);
        assert_eq!(lights.placements.len(), 1001, "one for each placement");
        assert_eq!(lights.keys.len(), keys, "turns {turns}, flies {flies}: keys");
        assert_eq!(lights.motion.len(), if levels > 0 { 1001 + 1000 * levels } else { 0 }, "places and levels");
        let moves = table(&scene, &lights).features.contains(Features::MOVING_MESH_LIGHTS);
        assert_eq!(moves, levels > 0, "turns {turns}, flies {flies}");
        for (place, light) in lights.motion.iter().zip(&lights.placements) {
            let expected = if light.prim_id == 4 { 0 } else { u32::try_from(levels).expect("small") };
            assert_eq!(place[1], expected, "levels of {}", light.prim_id);
        }
        for [first, count] in lights.motion.iter().skip(1001).copied() {
            let of_level = &lights.keys[first as usize..(first + count) as usize];
            assert!(count >= 2 && of_level.is_sorted_by(|a, b| a.key.time < b.key.time), "{first}, {count}");
        }
    }
}
