// SPDX-License-Identifier: Apache-2.0
//! Meshes that deform in a live scene keep the shape of their hierarchies as long as it is good.

use std::collections::BTreeSet;
use std::sync::Arc;

use oocpt_core::mesh::MeshAsset;
use oocpt_core::partition::{MIN_CHUNK_BYTES, PartitionOptions};
use oocpt_core::{MeshDesc, SceneDb, Snapshot, TypedArray};

use crate::support::{asset, committed, grid};

/// Quads along a side of the mesh.
const SIDE: u16 = 40;

/// A grid whose points `bend` has moved.
fn bent(bend: impl Fn(usize, [f32; 3]) -> [f32; 3]) -> MeshDesc {
    let desc = grid("/cloth", SIDE);
    let view = desc.points.view();
    let point = |at: usize| view.vec3(at).expect("a point").as_vec3().to_array();
    let points: Vec<[f32; 3]> = (0..desc.points.len()).map(|at| bend(at, point(at))).collect();
    MeshDesc { points: TypedArray::of(points), ..desc }
}

/// A wave that moves with `time`.
fn wave(time: f32) -> MeshDesc {
    bent(|_, [x, y, z]| [x, y + 0.2 * (3.0 * x + time).sin(), z + 0.1 * (2.0 * z + time).cos()])
}

fn live() -> SceneDb {
    let mut db = SceneDb::new();
    db.set_live(true);
    db
}

/// Commits the mesh; returns how many were built and refitted for it.
fn show(db: &mut SceneDb, desc: MeshDesc) -> (Arc<Snapshot>, u64, u64) {
    let [made, refitted] = [db.meshes_made(), db.meshes_refitted()];
    db.upsert_mesh(desc);
    let snapshot = committed(db);
    (snapshot, db.meshes_made() - made, db.meshes_refitted() - refitted)
}

fn assets(snapshot: &Snapshot) -> Vec<Arc<MeshAsset>> {
    snapshot.meshes.iter().map(|mesh| asset(mesh)).collect()
}

/// Faces and corners of all triangles.
fn triangles(snapshot: &Snapshot) -> BTreeSet<(u32, [[u32; 3]; 3])> {
    let meshes = assets(snapshot);
    let all = meshes.iter().flat_map(|mesh| &mesh.triangles);
    let all: Vec<_> = all.map(|t| (t.face, t.vertices.map(|vertex| vertex.map(f32::to_bits)))).collect();
    let set: BTreeSet<_> = all.iter().copied().collect();
    assert_eq!(set.len(), all.len(), "each is there once");
    set
}

fn fresh(desc: MeshDesc) -> Arc<Snapshot> {
    let mut db = SceneDb::new();
    db.upsert_mesh(desc);
    committed(&mut db)
}

/// Asserts that the only mesh of both is the same, bit for bit.
fn assert_same(a: &Snapshot, b: &Snapshot, why: &str) {
    let [a, b] = [assets(a), assets(b)];
    let ([a], [b]) = (&a[..], &b[..]) else { panic!("one mesh each: {why}") };
    assert!(a.bvh == b.bvh && a.triangles == b.triangles && a.key == b.key, "{why}");
}

#[test]
fn what_deforms_keeps_its_shape_and_has_the_triangles_of_a_mesh_that_is_built() {
    let mut db = live();
    assert_eq!(show(&mut db, wave(0.0)).1, 1);
    let (first, made, refitted) = show(&mut db, wave(0.1));
    assert_eq!((made, refitted), (1, 0), "its shape is kept from now on");
    assert_same(&first, &fresh(wave(0.1)), "which costs no bit");
    for frame in 2_u8..6 {
        let desc = wave(0.1 * f32::from(frame));
        let (snapshot, made, refitted) = show(&mut db, desc.clone());
        assert_eq!((made, refitted), (1, 1), "frame {frame}");
        assert_eq!(triangles(&snapshot), triangles(&fresh(desc)), "frame {frame}");
        let stacks = [&first, &snapshot].map(|s| (s.meshes[0].stack, s.meshes[0].nodes));
        assert_eq!(stacks[0], stacks[1], "nodes keep their places");
    }
    let (still, made, refitted) = show(&mut db, wave(0.1));
    assert_eq!((made, refitted), (1, 1), "back");
    let [back, built] = [&still, &first].map(|snapshot| assets(snapshot).remove(0));
    assert!(back.bvh == built.bvh && back.triangles == built.triangles, "the nodes are as tight as those of a build");
    assert_ne!(back.key, built.key, "though it has another key");
}

#[test]
fn a_shape_that_has_worn_out_is_built_anew() {
    let mut db = live();
    [0.0, 0.1, 0.2].into_iter().for_each(|time| _ = show(&mut db, wave(time)));
    // Neighbours are far from each other.
    let torn = |turn: usize| bent(move |at, [x, y, z]| [x, y, z].map(|v| v + ((at * 7919 * turn) % 997) as f32 * 0.05));
    let (snapshot, made, refitted) = show(&mut db, torn(1));
    assert_eq!((made, refitted), (1, 0), "torn apart");
    let [now, built] = [snapshot, fresh(torn(1))].map(|snapshot| assets(&snapshot).remove(0));
    assert!(now.bvh == built.bvh && now.triangles == built.triangles, "by the builder");
    let (_, made, refitted) = show(&mut db, bent(|at, p| p.map(|v| v + ((at * 7919) % 997) as f32 * 0.0501)));
    assert_eq!((made, refitted), (1, 1), "from where the new shape is kept");
    let (_, _, refitted) = show(&mut db, bent(|at, p| p.map(|v| 1e3 * (v + ((at * 7919) % 997) as f32 * 0.05))));
    assert_eq!(refitted, 1, "size alone wears nothing");
}

#[test]
fn hostile_points_lose_no_triangle() {
    let mut db = live();
    [0.0, 0.1, 0.2].into_iter().for_each(|time| _ = show(&mut db, wave(time)));
    type Bend = fn(usize, [f32; 3]) -> [f32; 3];
    let bends: [(&str, Bend); 7] = [
        ("a point is no number", |at, p| if at == 77 { [f32::NAN; 3] } else { p }),
        ("infinite", |at, p| if at % 50 == 0 { [f32::INFINITY, 0.0, 1.0] } else { p }),
        ("huge", |at, p| if at % 3 == 0 { p.map(|v| 1e37 * v) } else { p }),
        ("collapsed", |_, _| [1.0, 2.0, 3.0]),
        ("collapsed to a line", |_, [x, ..]| [x, 0.0, 0.0]),
        ("exploded", |at, p| p.map(|v| 1e6 * v * at as f32)),
        ("tiny", |_, p| p.map(|v| 1e-30 * v)),
    ];
    for (what, bend) in bends {
        let rebuilt = fresh(bent(bend));
        let (snapshot, ..) = show(&mut db, bent(bend));
        assert_eq!(triangles(&snapshot), triangles(&rebuilt), "{what}");
        assert_eq!(snapshot.dropped, rebuilt.dropped, "{what}");
        // Each comes after a sound mesh too, and the snapshots are validated: boxes contain what is below them.
        let (sound, ..) = show(&mut db, wave(0.3));
        assert_eq!(triangles(&sound), triangles(&fresh(wave(0.3))), "after: {what}");
    }
}

#[test]
fn clusters_are_refitted_each() {
    let mut db = live();
    db.set_partition(PartitionOptions { chunk_bytes: MIN_CHUNK_BYTES });
    [0.0, 0.1].into_iter().for_each(|time| _ = show(&mut db, wave(time)));
    let (snapshot, made, refitted) = show(&mut db, wave(0.2));
    assert!(snapshot.meshes.len() > 4, "in clusters: {}", snapshot.meshes.len());
    assert_eq!((made, refitted), (1, 1));
    assert_eq!(triangles(&snapshot), triangles(&fresh(wave(0.2))));
    let keys: BTreeSet<u128> = snapshot.meshes.iter().map(|mesh| mesh.key).collect();
    assert_eq!(keys.len(), snapshot.meshes.len(), "each with a key of its own");
}

#[test]
fn a_batch_scene_does_not_depend_on_a_live_one_before_it() {
    let mut db = live();
    [0.0, 0.1, 0.2].into_iter().for_each(|time| _ = show(&mut db, wave(time)));
    assert_eq!(db.meshes_refitted(), 1);
    db.set_live(false);
    assert_same(&committed(&mut db), &fresh(wave(0.2)), "built where the scene is no longer live");
    let (snapshot, made, refitted) = show(&mut db, wave(0.3));
    assert_eq!((made, refitted), (1, 0), "nor is one refitted that is not");
    assert_same(&snapshot, &fresh(wave(0.3)), "in batch");
}

#[test]
fn other_faces_are_built() {
    let mut db = live();
    [0.0, 0.1, 0.2].into_iter().for_each(|time| _ = show(&mut db, wave(time)));
    let wave = wave(0.3);
    let view = wave.face_vertex_indices.view();
    let indices: Vec<i32> = (0..view.len()).rev().map(|at| view.index(at).expect("one")).collect();
    let flipped = MeshDesc { face_vertex_indices: TypedArray::of(indices), ..wave.clone() };
    let (snapshot, made, refitted) = show(&mut db, flipped.clone());
    assert_eq!((made, refitted), (1, 0));
    assert_same(&snapshot, &fresh(flipped), "of their own");
}
