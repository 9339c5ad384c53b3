// SPDX-License-Identifier: Apache-2.0
//! Edits change what they must and nothing else.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use glam::{DMat4, DVec3};
use oocpt_core::mesh::{MeshFiles, PayloadError, PayloadSource, StoredEntry};
use oocpt_core::{InstancerDesc, LightDesc, LightKind, MeshDesc, SceneDb, Snapshot, Subdivision, TypedArray};

use crate::support::{by, committed, flatten, grid, prim, scatter, triangle};

/// A ground mesh, an instancer of a pair of meshes and an instancer of one mesh.
fn scene() -> (SceneDb, Vec<MeshDesc>, Vec<InstancerDesc>) {
    let mut meshes = vec![grid("/ground", 3)];
    for (path, tag, parent) in [
        ("/forest/tree/trunk", 0.1, "/forest/tree"),
        ("/forest/tree/crown", 0.2, "/forest/tree"),
        ("/rocks/r/m", 0.3, "/rocks/r"),
    ] {
        let mut mesh = triangle(path, tag);
        mesh.prim.instanced_by = vec![by(if tag > 0.25 { "/rocks" } else { "/forest" }, parent)];
        meshes.push(mesh);
    }
    let points = [[1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [3.0, 0.0, 0.0]];
    let instancers = vec![
        scatter("/forest", &points, &[("/forest/tree", &[0, 1, 2])]),
        scatter("/rocks", &points, &[("/rocks/r", &[0, 1])]),
    ];
    let mut db = SceneDb::new();
    meshes.iter().for_each(|m| db.upsert_mesh(m.clone()));
    instancers.iter().for_each(|i| db.upsert_instancer(i.clone()));
    (db, meshes, instancers)
}

fn keys(snapshot: &Snapshot) -> Vec<u64> {
    snapshot.assemblies.iter().map(|a| a.key()).collect()
}

fn same_meshes(a: &Snapshot, b: &Snapshot) -> bool {
    a.meshes.len() == b.meshes.len() && a.meshes.iter().zip(&b.meshes).all(|(a, b)| Arc::ptr_eq(a, b))
}

#[test]
fn a_commit_that_is_given_up_keeps_the_scene_and_what_it_has_built() {
    let (mut db, ..) = scene();
    let before = committed(&mut db);
    let made = db.meshes_made();
    for (path, tag) in [("/a", 0.5), ("/b", 0.6), ("/c", 0.7), ("/d", 0.8)] {
        db.upsert_mesh(triangle(path, tag));
    }
    let asked = AtomicUsize::new(0);
    let given_up = db.commit_unless(&|building| {
        assert_eq!(building.len(), 4, "{building:?}");
        asked.fetch_add(1, Ordering::Relaxed) > 0
    });
    assert!(given_up.is_none() && Arc::ptr_eq(&before, db.snapshot()), "the scene of before");
    assert_eq!(db.meshes_made() - made, 1, "one mesh was begun before");
    let after = committed(&mut db);
    assert_eq!(db.meshes_made() - made, 4, "each is built once");
    assert_eq!((after.version, after.meshes.len()), (before.version + 1, before.meshes.len() + 4));
    db.remove("/d");
    assert!(db.commit_unless(&|_| true).is_some(), "nothing is left to build");
    db.upsert_mesh(triangle("/d", 0.9));
    assert!(db.commit_unless(&|_| true).is_none(), "something is");
}

#[test]
fn nothing_edited_gives_the_same_snapshot() {
    let (mut db, meshes, instancers) = scene();
    let first = committed(&mut db);
    let again = db.commit();
    assert!(!again.changed && Arc::ptr_eq(&first, &again.snapshot));
    // The same descriptions again (same arrays) are no edit either; nor are equal arrays at other addresses.
    meshes.into_iter().for_each(|m| db.upsert_mesh(m));
    for mut instancer in instancers {
        instancer.translations = Some(TypedArray::of(vec![[1.0_f32, 0.0, 0.0], [2.0, 0.0, 0.0], [3.0, 0.0, 0.0]]));
        db.upsert_instancer(instancer);
    }
    db.upsert_mesh(grid("/ground", 3));
    let again = db.commit();
    assert!(!again.changed && Arc::ptr_eq(&first, &again.snapshot));
    assert_eq!(first.version, 1);
}

#[test]
fn moving_an_instancer_keeps_meshes_and_prototypes() {
    let (mut db, _, mut instancers) = scene();
    let before = committed(&mut db);
    instancers[0].prim.transform = DMat4::from_translation(DVec3::Y);
    db.upsert_instancer(instancers.remove(0));
    let commit = db.commit();
    let after = commit.snapshot;
    assert!(commit.changed && same_meshes(&before, &after));
    assert_eq!(after.version, before.version + 1);
    assert!(Arc::ptr_eq(&before.assemblies[0], &after.assemblies[0]), "the tree's content");
    assert_ne!(keys(&before)[1], keys(&after)[1], "the root");
    let moved = flatten(&after).iter().filter(|l| (l.world.w_axis.y - 1.0).abs() < 1e-6).count();
    assert_eq!(moved, 6);
}

#[test]
fn moving_one_instance_changes_one_record() {
    let (mut db, _, mut instancers) = scene();
    let before = committed(&mut db);
    let points = vec![[1.0_f32, 0.0, 0.0], [2.0, 5.0, 0.0], [3.0, 0.0, 0.0]];
    instancers[0].translations = Some(TypedArray::of(points));
    db.upsert_instancer(instancers.remove(0));
    let after = committed(&mut db);
    assert!(same_meshes(&before, &after));
    let (a, b) = (crate::support::records(&before, 1), crate::support::records(&after, 1));
    assert_eq!(a.iter().zip(&b).filter(|(a, b)| a != b).count(), 1);
}

#[test]
fn editing_points_rebuilds_that_mesh_only() {
    let (mut db, mut meshes, _) = scene();
    let before = committed(&mut db);
    meshes[1].points = TypedArray::of(vec![[0.0_f32, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0]]);
    db.upsert_mesh(meshes.remove(1));
    let after = committed(&mut db);
    let kept = before.meshes.iter().filter(|m| after.meshes.iter().any(|n| Arc::ptr_eq(m, n))).count();
    assert_eq!((kept, after.meshes.len()), (3, 4));
    // The new asset takes the index of the old one: the others stay where they were.
    assert_eq!(before.meshes.iter().zip(&after.meshes).filter(|(a, b)| Arc::ptr_eq(a, b)).count(), 3);
    assert_ne!(keys(&before)[0], keys(&after)[0]);
}

#[test]
fn editing_a_prototype_leaves_other_prototypes_alone() {
    let (mut db, mut meshes, _) = scene();
    // A second pair prototype.
    db.upsert_instancer(scatter("/houses", &[[0.0; 3]], &[("/houses/h", &[0])]));
    for (path, tag) in [("/houses/h/wall", 0.4), ("/houses/h/roof", 0.5)] {
        let mut mesh = triangle(path, tag);
        mesh.prim.instanced_by = vec![by("/houses", "/houses/h")];
        db.upsert_mesh(mesh);
    }
    let before = committed(&mut db);
    assert_eq!(before.assemblies.len(), 3);
    meshes[1].prim.transform = DMat4::from_translation(DVec3::Z);
    db.upsert_mesh(meshes.remove(1));
    let after = committed(&mut db);
    assert_eq!(keys(&before).iter().zip(keys(&after)).filter(|(a, b)| **a == *b).count(), 1, "the houses' content");
    assert!(same_meshes(&before, &after));
}

#[test]
fn equal_meshes_are_one_asset_until_one_differs() {
    let mut db = SceneDb::new();
    db.upsert_mesh(grid("/a", 3));
    db.upsert_mesh(grid("/b", 3));
    let mut other = grid("/c", 3);
    other.double_sided = false;
    db.upsert_mesh(other);
    let snapshot = committed(&mut db);
    assert_eq!((snapshot.meshes.len(), snapshot.counts.instances), (2, 3));
    let mut smooth = grid("/b", 3);
    smooth.subdivision = Subdivision::Loop;
    db.upsert_mesh(smooth);
    let after = committed(&mut db);
    assert_eq!(after.meshes.len(), 3);
    assert!(snapshot.meshes.iter().all(|m| after.meshes.iter().any(|n| Arc::ptr_eq(m, n))));
    assert!(after.meshes.iter().all(|m| after.meshes.iter().filter(|n| n.key == m.key).count() == 1));
}

#[test]
fn hiding_and_showing_rebuilds_nothing() {
    let (mut db, mut meshes, _) = scene();
    let before = committed(&mut db);
    let mut ground = meshes.remove(0);
    ground.prim.visible = false;
    db.upsert_mesh(ground.clone());
    let hidden = committed(&mut db);
    assert_eq!((hidden.meshes.len(), hidden.counts.instances), (3, 8));
    ground.prim.visible = true;
    db.upsert_mesh(ground);
    let shown = committed(&mut db);
    assert!(before.meshes.iter().all(|m| shown.meshes.iter().any(|n| Arc::ptr_eq(m, n))));
    assert_eq!(flatten(&shown).len(), flatten(&before).len());
}

#[test]
fn purposes_filter_meshes() {
    let mut db = SceneDb::new();
    for (path, purpose) in [("/d", ""), ("/g", "geometry"), ("/r", "render"), ("/p", "proxy"), ("/u", "guide")] {
        let mut mesh = triangle(path, 0.0);
        mesh.prim.purpose = purpose.into();
        db.upsert_mesh(mesh);
    }
    let mut shown = |purposes: &[&str]| {
        db.set_purposes(purposes);
        committed(&mut db).counts.instances
    };
    assert_eq!(shown(&["default", "render"]), 3);
    assert_eq!(shown(&["geometry", "proxy", "guide"]), 4);
    assert_eq!(shown(&["guide"]), 1);
    assert_eq!(shown(&[]), 5);
}

#[test]
fn removal_takes_the_subtree_and_no_neighbour() {
    let mut db = SceneDb::new();
    for path in ["/a", "/a/b", "/a/b/c", "/a-b", "/ab"] {
        db.upsert_mesh(triangle(path, 0.0));
    }
    db.remove("/a");
    assert_eq!(committed(&mut db).counts.instances, 2);
    db.remove("/nothing");
    assert!(!db.commit().changed);
    db.remove("/");
    let empty = committed(&mut db);
    assert_eq!((empty.counts.instances, empty.assemblies.len(), empty.max_levels), (0, 1, 1));
    assert!(empty.meshes.is_empty() && empty.assemblies[0].bounds().is_empty());
}

#[test]
fn a_light_edit_touches_no_geometry() {
    let (mut db, ..) = scene();
    let before = committed(&mut db);
    db.upsert_light(LightDesc {
        prim: prim("/sun"),
        kind: LightKind::Distant { angle_degrees: 0.53 },
        color: [1.0; 3],
        intensity: 2.0,
        exposure: 0.0,
        color_temperature: None,
        normalize: false,
        camera_visible: true,
        ..LightDesc::default()
    });
    let after = committed(&mut db);
    assert_eq!((after.lights.len(), keys(&before) == keys(&after), same_meshes(&before, &after)), (1, true, true));
}

#[test]
fn a_path_may_change_between_prim_types() {
    let mut db = SceneDb::new();
    db.upsert_mesh(triangle("/x", 0.0));
    assert_eq!(committed(&mut db).counts.instances, 1);
    db.upsert_instancer(scatter("/x", &[], &[]));
    assert_eq!(committed(&mut db).counts.instances, 0);
}

/// Prototypes that share arrays ask for the changes in them from all threads at once, and the comparison itself runs in
/// parallel: a thread that helps meanwhile must not come to wait for itself.
#[test]
fn diffing_an_array_shared_by_many_prototypes_does_not_deadlock() {
    const PROTOTYPES: u16 = 48;
    const INSTANCES: i32 = 300_000;
    let (done, result) = std::sync::mpsc::channel();
    std::thread::spawn(move || {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(16).build().expect("threads");
        let mut db = SceneDb::new();
        let roots: Vec<String> = (0..PROTOTYPES).map(|k| format!("/rocks/p{k:02}")).collect();
        let numbers: Vec<Vec<i32>> =
            (0..PROTOTYPES).map(|k| (k.into()..INSTANCES).step_by(PROTOTYPES.into()).collect()).collect();
        let prototypes: Vec<(&str, &[i32])> = roots.iter().zip(&numbers).map(|(r, n)| (&r[..], &n[..])).collect();
        let mut points: Vec<[f32; 3]> = (0..INSTANCES).map(|i| [(i % 1000) as f32, 0.0, (i / 1000) as f32]).collect();
        for root in &roots {
            let mut mesh = triangle(&format!("{root}/m"), 0.1);
            mesh.prim.instanced_by = vec![by("/rocks", root)];
            db.upsert_mesh(mesh);
        }
        db.upsert_instancer(scatter("/rocks", &points, &prototypes));
        pool.install(|| db.commit());
        for k in 0..20 {
            points[k * 13_001][1] += 1.0;
            db.upsert_instancer(scatter("/rocks", &points, &prototypes));
            let commit = pool.install(|| db.commit());
            done.send(commit.changed).expect("the test waits");
        }
    });
    for k in 0..20 {
        let changed = result.recv_timeout(Duration::from_secs(60));
        assert_eq!(changed, Ok(true), "edit {k} does not end");
    }
}

/// Files that a commit does not survive.
#[derive(Debug)]
struct PanickingFiles;

impl MeshFiles for PanickingFiles {
    fn is_persistent(&self) -> bool {
        true
    }

    fn find(&self, _: u128) -> Option<StoredEntry> {
        std::panic::resume_unwind(Box::new("a planted failure"))
    }

    fn add(&self, _: Option<u128>, _: &[u8], _: &[Vec<&[u8]>]) -> Option<Vec<Arc<dyn PayloadSource>>> {
        None
    }

    fn damaged(&self, _: Option<u128>, _: &PayloadError) {}

    fn wait(&self, _: Duration) {}
}

#[test]
fn a_commit_that_panics_is_made_again_by_the_next_one() {
    let (mut db, meshes, instancers) = scene();
    let before = db.commit().snapshot;
    let mut edited = grid("/ground", 4);
    edited.prim.transform = DMat4::from_translation(DVec3::Y);
    db.upsert_mesh(edited.clone());
    db.set_mesh_files(Some(Arc::new(PanickingFiles)));
    assert!(catch_unwind(AssertUnwindSafe(|| db.commit())).is_err(), "the planted failure");
    assert!(Arc::ptr_eq(db.snapshot(), &before), "the scene is that of before");
    db.set_mesh_files(None);
    let after = db.commit();
    assert!(after.changed, "the edit is not lost");
    let mut fresh = SceneDb::new();
    meshes.iter().skip(1).for_each(|mesh| fresh.upsert_mesh(mesh.clone()));
    fresh.upsert_mesh(edited);
    instancers.iter().for_each(|instancer| fresh.upsert_instancer(instancer.clone()));
    let fresh = fresh.commit().snapshot;
    let placed = |snapshot: &Snapshot| format!("{:?}", flatten(snapshot));
    assert_eq!(placed(&after.snapshot), placed(&fresh), "the placements of a scene without that failure");
    let sizes = |snapshot: &Snapshot| snapshot.meshes.iter().map(|mesh| mesh.triangles).collect::<Vec<_>>();
    assert_eq!(sizes(&after.snapshot), sizes(&fresh), "and its meshes");
    assert!(!db.commit().changed, "nothing is left to do");
}
