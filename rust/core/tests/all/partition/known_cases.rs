// SPDX-License-Identifier: Apache-2.0
//! Single edits and rules of the partition with known outcomes.

use std::collections::HashMap;
use std::sync::Arc;

use glam::{DMat4, Vec3};
use half::f16;
use oocpt_core::{ElementType, PartitionOptions, SceneDb, TypedArray};

use crate::partition::cut::{SMALL, chunk_records, spread};
use crate::partition::edits::{assert_keys_tell, assert_same_world};
use crate::support::{by, committed, grid, scatter, triangle, with_instancer};

/// Instances of one prototype are added: the records of the other prototypes stay as they are.
#[test]
fn growing_one_prototype_leaves_the_chunks_of_others() {
    let all: Vec<i32> = (0..600).collect();
    let mut points = spread(600, 50.0, 11);
    points.iter_mut().take(300).for_each(|p| p[0] -= 100.0);
    points.iter_mut().skip(300).for_each(|p| p[0] += 100.0);
    let mut db = SceneDb::new();
    db.set_partition(SMALL);
    for name in ["a", "b"] {
        let mut mesh = triangle(&format!("/i/{name}/m"), if name == "a" { 0.5 } else { 1.0 });
        mesh.prim.instanced_by = vec![by("/i", &format!("/i/{name}"))];
        db.upsert_mesh(mesh);
    }
    db.upsert_instancer(scatter("/i", &points, &[("/i/a", &all[..300]), ("/i/b", &all[300..])]));
    let before = committed(&mut db);
    points.push([100.0, 0.0, 0.0]);
    let more: Vec<i32> = (300..601).collect();
    db.upsert_instancer(scatter("/i", &points, &[("/i/a", &all[..300]), ("/i/b", &more)]));
    let after = committed(&mut db);
    let kept = assert_keys_tell(&before, &after);
    assert!(kept >= 3, "{kept} of {} kept", after.world.chunks.len());
}

/// Old arrays are freed once they are not needed, although kept chunks were made from them.
#[test]
fn kept_chunks_release_replaced_arrays() {
    let all: Vec<i32> = (0..600).collect();
    let mut points = spread(600, 50.0, 12);
    let mut db = with_instancer(scatter("/i", &points, &[("/i/p", &all)]));
    db.set_partition(SMALL);
    let before = committed(&mut db);
    let desc = |points: &[[f32; 3]]| {
        let source: Arc<dyn oocpt_core::ArraySource> = Arc::new(Floats(points.to_vec()));
        let mut desc = scatter("/i", &[], &[("/i/p", &all)]);
        desc.translations = Some(TypedArray::new(ElementType::Vec3f, source.clone()).unwrap());
        (desc, source)
    };
    points[0][1] += 1.0;
    let (second, source) = desc(&points);
    db.upsert_instancer(second);
    let after = committed(&mut db);
    assert!(assert_keys_tell(&before, &after) > 0, "some chunks are kept");
    points[0][1] += 1.0;
    db.upsert_instancer(desc(&points).0);
    let last = committed(&mut db);
    assert!(assert_keys_tell(&after, &last) > 0, "some chunks are kept");
    drop((before, after));
    assert_eq!(Arc::strong_count(&source), 1, "the arrays of the second version");
}

#[derive(Debug)]
struct Floats(Vec<[f32; 3]>);

impl oocpt_core::ArraySource for Floats {
    fn bytes(&self) -> &[u8] {
        bytemuck::cast_slice(&self.0)
    }
}

/// Cells of equal codes are cut in the middle of their order: one member less moves all cuts.
#[test]
fn removing_coincident_members_updates_all_cuts() {
    let scene = |names: &[&str]| {
        let mut db = SceneDb::new();
        db.set_partition(SMALL);
        let all: Vec<i32> = (0..200).collect();
        for name in names {
            let (path, root) = (format!("/{name}"), format!("/{name}/p"));
            let n = if *name == "b" { 30 } else { 200 };
            db.upsert_instancer(scatter(&path, &vec![[3.0, 3.0, 3.0]; 200], &[(&root, &all[..n])]));
            let mut mesh = triangle(&format!("{root}/m"), 0.5);
            mesh.prim.instanced_by = vec![by(&path, &root)];
            db.upsert_mesh(mesh);
        }
        db.upsert_mesh(grid("/ground", 2));
        db
    };
    let mut db = scene(&["a", "b", "c"]);
    let before = committed(&mut db);
    db.remove("/b");
    let after = committed(&mut db);
    assert!(before.world.chunks.len() > 4, "{} chunks", before.world.chunks.len());
    assert_same_world(&committed(&mut scene(&["a", "c"])), &after);
}

/// An index beyond the arrays is usable once they grow, and bad again when they shrink; nothing else is touched.
#[test]
fn growing_arrays_make_out_of_range_indices_valid() {
    let all: Vec<i32> = (0..601).collect();
    let mut points = spread(600, 50.0, 13);
    points.extend([[0.0, 0.0, 0.0]]);
    let scene = |n: usize| {
        let mut db = with_instancer(scatter("/i", &points[..n], &[("/i/p", &all)]));
        db.set_partition(SMALL);
        db
    };
    let mut db = scene(600);
    let mut before = committed(&mut db);
    assert_eq!((before.counts.instances, before.dropped.instance_indices), (600, 1), "one is out of range");
    for n in [601, 600, 599] {
        db.upsert_instancer(scatter("/i", &points[..n], &[("/i/p", &all)]));
        let after = committed(&mut db);
        assert_same_world(&committed(&mut scene(n)), &after);
        assert!(assert_keys_tell(&before, &after) + 3 >= after.world.chunks.len(), "others are kept");
        before = after;
    }
}

/// Thirty meshes of 50 KiB in one place, and again in another: few records, none of the meshes exclusive to either
/// place, and still too much to be loaded at once.
#[test]
fn cells_with_large_mesh_closures_are_split() {
    let mut db = SceneDb::new();
    db.set_partition(SMALL);
    for k in 0..30_u8 {
        let (path, root) = (format!("/i{k}"), format!("/i{k}/p"));
        let at = f32::from(k) * 0.01;
        db.upsert_instancer(scatter(&path, &[[at, 0.0, 0.0], [1000.0 + at, 0.0, 0.0]], &[(&root, &[0, 1])]));
        let mut mesh = grid(&format!("{root}/m"), 20);
        let moved = (0..mesh.points.len()).filter_map(|i| mesh.points.vec3(i)).map(|p| p.as_vec3().to_array());
        mesh.points = TypedArray::of(moved.map(|[x, y, z]| [x, y, z + f32::from(k)]).collect::<Vec<_>>());
        mesh.prim.instanced_by = vec![by(&path, &root)];
        db.upsert_mesh(mesh);
    }
    let snapshot = committed(&mut db);
    let bytes: u64 = snapshot.meshes.iter().map(|m| m.device_bytes()).sum();
    assert!(snapshot.meshes.len() == 30 && bytes > 64 * (16 << 10), "{} meshes, {bytes} bytes", snapshot.meshes.len());
    let sizes: Vec<usize> = snapshot.world.chunks.iter().map(|c| c.len()).collect();
    assert!(sizes.len() >= 4 && sizes.iter().sum::<usize>() == 60, "{sizes:?}");
}

/// A few edits in chunks of many records, some of them flat or with equal sides: records come, go and pass each other,
/// prims as well as instances, and after each step the result equals that of a new database.
#[test]
fn few_edits_of_long_chunks_give_what_a_new_database_gives() {
    const N: usize = 9000;
    let options = PartitionOptions { chunk_bytes: 256 << 10 };
    let mut points = spread(N, 100.0, 21);
    points.iter_mut().for_each(|p| p[1] = if p[0] < 0.0 { 0.0 } else { p[1] });
    let mut scales = vec![[1.0_f32; 3]; N];
    let mut kinds: Vec<usize> = (0..N).map(|k| usize::from(k % 50 == 0)).collect();
    let mut singles: Vec<(u16, [f32; 3])> = (0..40).zip(spread(40, 100.0, 22)).collect();
    let apply = |db: &mut SceneDb, points: &[[f32; 3]], scales: &[[f32; 3]], kinds: &[usize], singles: &[(u16, _)]| {
        let of = |kind| (0..).zip(kinds).filter(|(_, k)| **k == kind).map(|(n, _)| n).collect::<Vec<i32>>();
        let mut desc = scatter("/i", points, &[("/i/a", &of(0)), ("/i/b", &of(1))]);
        desc.scales = Some(TypedArray::of(scales.to_vec()));
        db.upsert_instancer(desc);
        for (name, tag) in [("a", 0.5), ("b", 1.0)] {
            let mut mesh = triangle(&format!("/i/{name}/m"), tag);
            mesh.prim.instanced_by = vec![by("/i", &format!("/i/{name}"))];
            db.upsert_mesh(mesh);
        }
        db.remove("/s");
        for (name, at) in singles {
            let mut mesh = triangle(&format!("/s/{name}"), 1.5);
            mesh.prim.transform = DMat4::from_translation(Vec3::from(*at).as_dvec3());
            db.upsert_mesh(mesh);
        }
    };
    let mut db = SceneDb::new();
    db.set_partition(options);
    apply(&mut db, &points, &scales, &kinds, &singles);
    let mut before = committed(&mut db);
    for step in 0..12_u16 {
        let (from, shift) = (usize::from(step) * 700, f32::from(step) - 4.0);
        match step % 6 {
            // The outermost ones; some to one place; a little; larger; hidden by a bad number and back.
            0 => points.iter_mut().for_each(|p| p[0] = if p[0].abs() > 49.95 { -0.9 * p[0] } else { p[0] }),
            1 => points.iter_mut().skip(from).take(30).for_each(|p| *p = [shift, 0.0, 30.0]),
            2 => points.iter_mut().step_by(300).for_each(|p| p[2] += 0.01 * shift),
            3 => scales.iter_mut().skip(from).step_by(400).for_each(|s| *s = [1.0 + shift.abs(); 3]),
            4 => scales.iter_mut().skip(from).take(5).for_each(|s| s[0] = f32::NAN),
            _ => scales.iter_mut().for_each(|s| s[0] = if s[0].is_nan() { 1.0 } else { s[0] }),
        }
        if step == 7 {
            kinds.iter_mut().skip(4000).take(20).for_each(|k| *k = 1);
        }
        singles.remove(usize::from(step) * 2);
        singles.push((100 - step, [shift, 40.0, f32::from(step) * 3.0]));
        apply(&mut db, &points, &scales, &kinds, &singles);
        let after = committed(&mut db);
        assert_eq!(after.world.validate(&after.meshes, &after.assemblies), Ok(()), "step {step}");
        let mut fresh = SceneDb::new();
        fresh.set_partition(options);
        apply(&mut fresh, &points, &scales, &kinds, &singles);
        assert_same_world(&committed(&mut fresh), &after);
        assert_keys_tell(&before, &after);
        before = after;
    }
}

/// Every half there is, as part of a rotation: the same as that number as a double.
#[test]
fn half_precision_rotations_match_double_ones() {
    // Parts of one sign would be the same rotation without it.
    let part = |k: u16, c: u16| f16::from_bits((4 * k + c) ^ (c << 15));
    let halves: Vec<[f16; 4]> = (0..=u16::MAX / 4).map(|k| [0, 1, 2, 3].map(|c| part(k, c))).collect();
    let doubles: Vec<[f64; 4]> = halves.iter().map(|q| q.map(f16::to_f64)).collect();
    let all: Vec<i32> = (0..16384).collect();
    let scene = |rotations: TypedArray| {
        let mut desc = scatter("/i", &spread(16384, 100.0, 5), &[("/i/p", &all)]);
        desc.rotations = Some(rotations);
        committed(&mut with_instancer(desc))
    };
    let a = scene(TypedArray::from_vec(ElementType::Quath, halves).unwrap());
    let b = scene(TypedArray::from_vec(ElementType::Quatd, doubles).unwrap());
    assert!(a.dropped.instance_transforms > 100 && a.counts.instances > 10_000, "{:?} {:?}", a.dropped, a.counts);
    assert_same_world(&a, &b);
}

/// Chunks that are cut in stretches of the order are those of cutting all at once: where samples miss items, also such
/// that reach beyond all samples, where many items share a code, and beside masked and unusable ones.
#[test]
fn stretched_sorting_equals_sorting_at_once() {
    // Every second instance is a sample: those of odd numbers.
    const COUNT: usize = 540_000;
    let mut points = spread(COUNT, 50.0, 21);
    points.iter_mut().skip(1).step_by(3).for_each(|p| *p = p.map(|v| 0.001 * v - 20.0));
    points.iter_mut().take(2 * 50_000).step_by(2).for_each(|p| *p = [7.0, 8.0, 9.0]);
    points[400_000] = [f32::NAN; 3];
    let scene = |points: &[[f32; 3]]| {
        let all: Vec<i32> = (0..i32::try_from(COUNT).unwrap()).map(|n| if n == 333_333 { -1 } else { n }).collect();
        let (first, second) = all.split_at(COUNT / 3);
        let mut desc = scatter("/i", points, &[("/i/p", first), ("/i/q", second), ("/i/r", &all[..100])]);
        desc.mask = Some(TypedArray::from_bools(&(0..COUNT).map(|n| n % 1000 != 10).collect::<Vec<_>>()));
        let with_memory = |bytes: u64| {
            let mut db = with_instancer(desc.clone());
            for name in ["q", "r"] {
                let mut mesh = triangle(&format!("/i/{name}/m"), 2.0);
                mesh.prim.instanced_by = vec![by("/i", &format!("/i/{name}"))];
                db.upsert_mesh(mesh);
            }
            db.upsert_mesh(triangle("/single", 3.0));
            db.set_partition(PartitionOptions { chunk_bytes: 128 << 10 });
            db.set_partition_memory(bytes);
            committed(&mut db)
        };
        let (at_once, in_stretches) = (with_memory(u64::MAX), with_memory(1));
        assert!(at_once.world.chunks.len() > 700, "{} chunks", at_once.world.chunks.len());
        assert!(at_once.counts.instance_records > 500_000, "{:?}", at_once.counts);
        assert_same_world(&at_once, &in_stretches);
    };
    scene(&points);
    // First where no sample is; then beyond all samples, on a lattice that these do not determine.
    points[200_000] = [-10.0, 20.0, -24.0];
    for k in [200_002, 200_006, 500_000] {
        points[k] = [30.0, 30.0, 30.0];
    }
    scene(&points);
    points[200_004] = [900.0, -2000.0, 0.0];
    scene(&points);
}

/// Chunks that come out of a large edit as they were are kept, but not those with an edited record that none of their
/// boxes shows.
#[test]
fn small_edits_beside_a_large_one_are_seen() {
    let numbers: Vec<i32> = (0..600).collect();
    let still = |angle: f32| {
        let mut desc = scatter("/i", &spread(600, 50.0, 31), &[("/i/p", &numbers)]);
        let mut turns = vec![[0.0, 0.0, 0.0, 1.0_f32]; 600];
        turns[300] = [0.0, 0.0, angle, 1.0];
        desc.rotations = Some(TypedArray::from_vec(ElementType::Quatf, turns).unwrap());
        desc
    };
    let moved = |by: f32| {
        let points: Vec<_> = spread(600, 50.0, 32).iter().map(|p| p.map(|v| v + by)).collect();
        scatter("/j", &points, &[("/j/p", &numbers)])
    };
    let scene = |db: &mut SceneDb, angle: f32, offset: f32| {
        let mut mesh = triangle("/j/p/m", 0.5);
        mesh.prim.instanced_by = vec![by("/j", "/j/p")];
        db.upsert_mesh(mesh);
        db.upsert_mesh(grid("/ground", 3));
        db.upsert_instancer(still(angle));
        db.upsert_instancer(moved(offset));
        db.set_partition(SMALL);
        db.set_partition_memory(1);
        committed(db)
    };
    let mut db = with_instancer(still(0.0));
    let before = scene(&mut db, 0.0, 200.0);
    // Kept chunks read the new arrays, so their earlier values are compared now.
    let chunks = before.world.chunks.iter().enumerate();
    let old: HashMap<u64, _> = chunks.map(|(k, chunk)| (chunk.key(), chunk_records(&before.world, k))).collect();
    let after = scene(&mut db, 1e-6, 200.5);
    assert_same_world(&scene(&mut with_instancer(still(1e-6)), 1e-6, 200.5), &after);
    let mut kept = 0;
    for (k, chunk) in after.world.chunks.iter().enumerate() {
        if let Some(records) = old.get(&chunk.key()) {
            assert!(*records == chunk_records(&after.world, k), "records of chunk {k} changed, its key did not");
            kept += 1;
        }
    }
    assert!(kept >= 3, "{kept} of {} kept", after.world.chunks.len());
}
