// SPDX-License-Identifier: Apache-2.0
//! The partition shows the same scene as the assemblies it was cut from.

use std::sync::Arc;

use glam::{DMat3, DMat4, DVec3, DVec4};
use oocpt_core::{InstanceRecord, InstanceTarget, PartitionOptions, PartitionedWorld, SceneDb, Snapshot, TypedArray};

use crate::support::{Leaf, asset, by, committed, flatten, grid, scatter, triangle};

/// The smallest chunks: 128 records.
pub(crate) const SMALL: PartitionOptions = PartitionOptions { chunk_bytes: 16 << 10 };

/// All records of a chunk.
pub(crate) fn chunk_records(world: &PartitionedWorld, chunk: usize) -> Vec<InstanceRecord> {
    let chunk = &world.chunks[chunk];
    let mut out = vec![InstanceRecord::default(); chunk.len()];
    chunk.encode(0..chunk.len(), &mut out);
    out
}

fn target_from_parent(record: &InstanceRecord) -> DMat4 {
    let row = |k: usize| DVec4::from(record.object_from_parent[k].map(f64::from));
    DMat4::from_cols(row(0), row(1), row(2), DVec4::W).transpose()
}

/// Multiplies the world out, in f64 from the f32 maps of chunks and records.
pub(crate) fn flatten_world(snapshot: &Snapshot) -> Vec<Leaf> {
    let world = &snapshot.world;
    let mut leaves = Vec::new();
    for instance in &world.instances {
        let row = |k: usize| DVec3::from(instance.chunk_from_world[k].map(f64::from));
        let linear = DMat3::from_cols(row(0), row(1), row(2)).transpose().inverse();
        let frame = DMat4::from_translation(snapshot.origin + instance.origin) * DMat4::from_mat3(linear);
        // No ray finds a record whose box is empty.
        let is_somewhere = |record: &InstanceRecord| record.bounds[0][0] <= record.bounds[1][0];
        for record in chunk_records(world, instance.chunk as usize).into_iter().filter(is_somewhere) {
            below(snapshot, &record, frame, instance.instance_id, &mut leaves);
        }
    }
    leaves
}

fn below(snapshot: &Snapshot, record: &InstanceRecord, frame: DMat4, id: u32, leaves: &mut Vec<Leaf>) {
    let world = frame * target_from_parent(record).inverse();
    let id = id.wrapping_mul(record.prototype_count).wrapping_add(record.index_in_prototype);
    match record.target {
        InstanceTarget::Mesh(m) => leaves.push(Leaf {
            mesh: asset(&snapshot.meshes[m as usize]),
            world,
            prim_id: record.prim_id,
            instance_id: i64::from(id),
        }),
        InstanceTarget::Assembly(a) => {
            for record in crate::support::records(snapshot, a as usize) {
                below(snapshot, &record, world, id, leaves);
            }
        }
    }
}

/// Checks that both lists place the same meshes at the same positions.
pub(crate) fn assert_same_leaves(mut a: Vec<Leaf>, mut b: Vec<Leaf>) {
    assert_eq!(a.len(), b.len(), "number of leaves");
    let order = |x: &Leaf, y: &Leaf| {
        (x.prim_id, x.instance_id, x.mesh.key)
            .cmp(&(y.prim_id, y.instance_id, y.mesh.key))
            .then_with(|| compare(&x.world, &y.world))
    };
    a.sort_by(order);
    b.sort_by(order);
    for (a, b) in a.iter().zip(&b) {
        assert_eq!((a.prim_id, a.instance_id, a.mesh.key), (b.prim_id, b.instance_id, b.mesh.key), "what is placed");
        let (p, q) = (a.world.transform_point3(DVec3::ONE), b.world.transform_point3(DVec3::ONE));
        assert!((p - q).length() < 1e-3 * (1.0 + p.length()), "{p} {q}");
    }
}

/// Orders by position, coarsely, so that rounding does not swap distant placements.
fn compare(a: &DMat4, b: &DMat4) -> std::cmp::Ordering {
    let key = |m: &DMat4| (m.transform_point3(DVec3::ONE) * 8.0).round().to_array();
    key(a).partial_cmp(&key(b)).unwrap_or(std::cmp::Ordering::Equal)
}

#[test]
fn an_empty_scene_is_an_empty_world() {
    let mut db = SceneDb::new();
    assert_eq!(db.snapshot().world.top.nodes.len(), 1, "before the first commit");
    let world = committed(&mut db).world.clone();
    assert!(world.chunks.is_empty() && world.instances.is_empty(), "{world:?}");
    assert_eq!((world.top.nodes.len(), world.top.depth, world.levels), (1, 1, 1), "top level");
    assert!(world.top.nodes[0].bounds(0).is_empty() && world.top.nodes[0].bounds(1).is_empty(), "no children");
}

/// Positions spread by a generator.
pub(crate) fn spread(n: usize, size: f32, seed: u32) -> Vec<[f32; 3]> {
    let mut state = seed;
    let mut next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (f32::from(u16::try_from(state >> 16).unwrap()) / 65_536.0 - 0.5) * size
    };
    (0..n).map(|_| [next(), next(), next()]).collect()
}

#[test]
fn one_instancer_is_cut_into_chunks_that_hold_everything() {
    let mut db = SceneDb::new();
    db.set_partition(SMALL);
    let n = 1000_usize;
    let all: Vec<i32> = (0..1000).collect();
    db.upsert_instancer(scatter("/i", &spread(n, 100.0, 1), &[("/i/p", &all)]));
    let mut mesh = triangle("/i/p/m", 0.5);
    mesh.prim.instanced_by = vec![by("/i", "/i/p")];
    db.upsert_mesh(mesh);
    db.upsert_mesh(grid("/ground", 4));
    let snapshot = committed(&mut db);
    let world = &snapshot.world;
    assert!(world.chunks.len() >= 8, "{} chunks", world.chunks.len());
    assert_eq!(world.chunks.iter().map(|c| c.len()).sum::<usize>(), n + 1, "records");
    assert_eq!((world.instances.len(), world.levels), (world.chunks.len(), 1), "one placement each");
    assert_same_leaves(flatten(&snapshot), flatten_world(&snapshot));
    // A light or nothing at all edited: the same world.
    let again = db.commit();
    assert!(Arc::ptr_eq(&again.snapshot.world, world), "no edit");
}

/// An instancer of a prototype that is too large: the prototype is opened, its chunks placed once per instance.
#[test]
fn large_prototypes_are_opened() {
    let mut db = SceneDb::new();
    db.set_partition(SMALL);
    let all: Vec<i32> = (0..800).collect();
    let mut inner = scatter("/o/p/i", &spread(800, 10.0, 2), &[("/o/p/i/p", &all)]);
    inner.prim.instanced_by = vec![by("/o", "/o/p")];
    db.upsert_instancer(inner);
    let places = [[100.0, 0.0, 0.0], [-100.0, 0.0, 0.0], [0.0, 50.0, 0.0]];
    let mut outer = scatter("/o", &places, &[("/o/p", &[0, 2, 1])]);
    outer.prim.transform = DMat4::from_rotation_z(0.5) * DMat4::from_scale(DVec3::new(1.0, -2.0, 0.5));
    db.upsert_instancer(outer);
    for (path, parent) in [("/o/p/i/p/m", ("/o/p/i", "/o/p/i/p")), ("/o/p/m", ("/o", "/o/p"))] {
        let mut mesh = triangle(path, 0.25);
        mesh.prim.instanced_by = vec![by(parent.0, parent.1)];
        db.upsert_mesh(mesh);
    }
    let snapshot = committed(&mut db);
    let world = &snapshot.world;
    assert!(world.chunks.len() > 6, "{} chunks", world.chunks.len());
    assert_eq!(world.instances.len(), 3 * world.chunks.len(), "each is placed three times");
    assert_eq!(world.levels, 1, "no record places an assembly");
    assert_same_leaves(flatten(&snapshot), flatten_world(&snapshot));
    // With chunks of megabytes the prototype stays whole.
    db.set_partition(PartitionOptions::default());
    let whole = committed(&mut db);
    assert_eq!((whole.world.chunks.len(), whole.world.instances.len(), whole.world.levels), (1, 1, 2), "one chunk");
    assert_same_leaves(flatten(&whole), flatten_world(&whole));
}

/// A mesh above the limit is an opened assembly of clusters; all counts for users stay the same.
#[test]
fn large_meshes_are_split_and_still_count_as_one() {
    let scene = || {
        let mut db = SceneDb::new();
        let mut mesh = grid("/i/p/m", 40);
        mesh.prim.instanced_by = vec![by("/i", "/i/p")];
        mesh.prim.transform = DMat4::from_rotation_x(0.3);
        db.upsert_mesh(mesh);
        db.upsert_mesh(grid("/single", 40));
        db.upsert_mesh(grid("/small", 2));
        db.upsert_instancer(scatter("/i", &spread(3, 100.0, 5), &[("/i/p", &[0, 1, 2])]));
        db
    };
    let whole = committed(&mut scene());
    let mut db = scene();
    db.set_partition(SMALL);
    let split = committed(&mut db);
    assert_eq!(whole.counts, split.counts, "counts");
    let world = &split.world;
    assert!(split.meshes.len() > 10 && whole.meshes.len() == 2, "{} meshes", split.meshes.len());
    let of_mesh = |leaf: &&Leaf| leaf.mesh.triangles.len() > 8;
    let leaves = flatten_world(&split);
    assert_same_leaves(flatten(&split), leaves.clone());
    let triangles = |leaves: &[Leaf]| leaves.iter().map(|l| l.mesh.triangles.len()).sum::<usize>();
    assert_eq!(triangles(&flatten(&whole)), triangles(&leaves), "triangles");
    let area = |leaves: &[Leaf]| leaves.iter().filter(of_mesh).map(|l| crate::support::area(&l.mesh)).sum::<f64>();
    assert!((area(&flatten(&whole)) - area(&leaves)).abs() < 1e-6, "area");
    assert!(leaves.iter().all(|l| l.mesh.device_bytes() <= 16 << 10), "clusters fit");
    // All clusters of one placement are reached by the same ray: same origin, same map, same instance id.
    let frames: Vec<_> = world
        .instances
        .iter()
        .filter(|i| world.chunks[i.chunk as usize].targets().len() == 1 && world.chunks.len() > 1)
        .filter(|i| world.chunks[i.chunk as usize].origin() == DVec3::ZERO)
        .map(|i| {
            (i.origin.to_array().map(f64::to_bits), i.chunk_from_world.map(|r| r.map(f32::to_bits)), i.instance_id)
        })
        .collect();
    let mut distinct = frames.clone();
    distinct.sort_unstable();
    distinct.dedup();
    assert!(frames.len() > 8 && distinct.len() == 4, "{} frames, {} distinct", frames.len(), distinct.len());
    // Larger chunks: whole again, as if made so from the start.
    db.set_partition(PartitionOptions::default());
    let again = committed(&mut db);
    assert_eq!((again.counts, again.meshes.len()), (whole.counts, 2), "whole again");
}

/// An instancer of `n` triangles at `path` inside the given prototypes; large enough to be opened by small chunks.
fn crowd(db: &mut SceneDb, path: &str, points: &[[f32; 3]], parents: &[(&str, &str)]) {
    let root = format!("{path}/p");
    let all: Vec<i32> = (0..).take(points.len()).collect();
    let mut inner = scatter(path, points, &[(&root, &all)]);
    inner.prim.instanced_by = parents.iter().map(|(instancer, root)| by(instancer, root)).collect();
    db.upsert_instancer(inner);
    let mut mesh = triangle(&format!("{root}/m"), 0.25);
    mesh.prim.instanced_by = vec![by(path, &root)];
    db.upsert_mesh(mesh);
}

/// Two instancers show the same instancer, one of them through a third.
#[test]
fn an_assembly_is_opened_through_several_parents() {
    let mut db = SceneDb::new();
    db.set_partition(SMALL);
    crowd(&mut db, "/c", &spread(700, 10.0, 7), &[("/x", "/x/p"), ("/y", "/y/p")]);
    let mut x = scatter("/x", &[[50.0, 0.0, 0.0], [0.0, 50.0, 0.0]], &[("/x/p", &[1, 0])]);
    x.prim.instanced_by = vec![by("/z", "/z/p")];
    db.upsert_instancer(x);
    db.upsert_instancer(scatter("/y", &[[-50.0, 0.0, 0.0]], &[("/y/p", &[0])]));
    db.upsert_instancer(scatter("/z", &spread(3, 500.0, 8), &[("/z/p", &[2, 1, 0])]));
    // A beside-mesh makes each prototype an assembly of its own.
    for parent in ["/x", "/y"] {
        let mut mesh = triangle(&format!("{parent}/p/m"), 0.5);
        mesh.prim.instanced_by = vec![by(parent, &format!("{parent}/p"))];
        db.upsert_mesh(mesh);
    }
    // Opened in the plan, placed nowhere.
    db.upsert_instancer(scatter("/none", &[[0.0; 3]], &[("/none/p", &[])]));
    crowd(&mut db, "/none/p/c", &spread(700, 10.0, 9), &[("/none", "/none/p")]);
    let snapshot = committed(&mut db);
    assert!(snapshot.world.opened.len() >= 4, "{:?}", snapshot.world.opened);
    assert_eq!(snapshot.counts.instances, (700 + 1) * (6 + 1), "placements");
    assert_same_leaves(flatten(&snapshot), flatten_world(&snapshot));
}

/// 70 000 x 70 000 instance numbers, of which a few are in range.
#[test]
fn instance_ids_wrap_as_on_the_device() {
    let mut db = SceneDb::new();
    db.set_partition(SMALL);
    let mut numbers = vec![-1; 70_000];
    (0..700).for_each(|k| numbers[69_000 + k] = i32::try_from(k).unwrap());
    let mut inner = scatter("/o/p/i", &spread(700, 10.0, 3), &[("/o/p/i/p", &numbers)]);
    inner.prim.instanced_by = vec![by("/o", "/o/p")];
    db.upsert_instancer(inner);
    let mut outer = vec![-1; 70_000];
    (outer[1], outer[69_999]) = (0, 1);
    db.upsert_instancer(scatter("/o", &[[0.0; 3], [90.0, 0.0, 0.0]], &[("/o/p", &outer)]));
    for (path, instancer, root) in [("/o/p/i/p/m", "/o/p/i", "/o/p/i/p"), ("/o/p/m", "/o", "/o/p")] {
        let mut mesh = triangle(path, 0.25);
        mesh.prim.instanced_by = vec![by(instancer, root)];
        db.upsert_mesh(mesh);
    }
    let snapshot = committed(&mut db);
    let ids = |leaves: Vec<Leaf>| {
        let mut ids: Vec<u32> = leaves.iter().map(|l| u32::try_from(l.instance_id & 0xffff_ffff).unwrap()).collect();
        ids.sort_unstable();
        ids
    };
    let wrapped = ids(flatten_world(&snapshot));
    assert!(snapshot.world.instances.iter().any(|i| i.instance_id == 69_999), "opened");
    assert!(wrapped == ids(flatten(&snapshot)), "ids modulo 2^32");
    assert!(wrapped.contains(&69_999_u32.wrapping_mul(70_000).wrapping_add(69_000)), "the first of the last copy");
}

/// Sizes from 1e-9 to 1e17 in one assembly, and all instances in one point.
#[test]
fn extreme_scenes_are_cut_too() {
    let n = 900_usize;
    let all: Vec<i32> = (0..900).collect();
    let far = spread(n, 1.0, 4).into_iter().map(|p| p.map(|v| v * v * v * 4.0e17)).collect::<Vec<_>>();
    let small = spread(n, 1e-12, 5);
    let point = vec![[1.0e6_f32, -3.0, 1e-3]; n];
    for (name, points, size) in [("far", far, 1.0e3_f32), ("small", small, 1e-9), ("point", point, 0.1)] {
        let mut db = SceneDb::new();
        db.set_partition(SMALL);
        let mut desc = scatter("/i", &points, &[("/i/p", &all)]);
        desc.scales =
            Some(TypedArray::of((0..n).map(|k| [if k % 7 == 0 { size * 9.0 } else { size }; 3]).collect::<Vec<_>>()));
        db.upsert_instancer(desc);
        let mut mesh = triangle("/i/p/m", 0.5);
        mesh.prim.instanced_by = vec![by("/i", "/i/p")];
        db.upsert_mesh(mesh);
        let snapshot = committed(&mut db);
        let world = &snapshot.world;
        assert_eq!(world.chunks.iter().map(|c| c.len()).sum::<usize>(), n, "{name}: records");
        assert!(world.chunks.iter().all(|c| c.len() <= 128) && world.unplaceable == 0, "{name}: sizes");
    }
}

/// A ground plane among grass is a chunk of its own.
#[test]
fn large_members_get_their_own_chunk() {
    let mut db = SceneDb::new();
    db.set_partition(SMALL);
    crowd(&mut db, "/c", &spread(1000, 100.0, 6), &[]);
    let mut ground = grid("/ground", 2);
    ground.prim.transform = DMat4::from_scale(DVec3::splat(100.0));
    db.upsert_mesh(ground);
    let snapshot = committed(&mut db);
    let wide = snapshot.world.chunks.iter().filter(|c| c.bounds().max[0] - c.bounds().min[0] > 80.0);
    assert_eq!(wide.map(|c| c.len()).collect::<Vec<_>>(), [1], "records of wide chunks");
}
