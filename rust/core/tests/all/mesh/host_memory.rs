// SPDX-License-Identifier: Apache-2.0
//! A budget of host memory: building keeps to it, the result is the same at every budget, and what needs more than all
//! of it is left out and named.

use std::sync::Arc;

use oocpt_core::scene::SceneCommit;
use oocpt_core::{PartitionOptions, SceneDb};

use super::store::{Files, content};
use crate::support::{committed, grid};

const MIB: u64 = 1 << 20;

/// Many meshes of all sizes, some of which are split.
fn scene() -> SceneDb {
    let mut db = SceneDb::new();
    db.set_partition(PartitionOptions { chunk_bytes: 128 << 10 });
    for at in 0..60_u16 {
        db.upsert_mesh(grid(&format!("/m{at}"), 8 + at * 37 % 110));
    }
    db
}

/// The scene with so many MiB for building, and for all; half of it may be kept.
fn within(room_mib: u64, budget_mib: u64, files: &Arc<Files>) -> SceneDb {
    let mut db = scene();
    db.set_host_budget(budget_mib * MIB);
    db.mesh_memory().set_room(room_mib * MIB);
    db.mesh_memory().set_limit(room_mib * MIB / 2);
    db.set_mesh_files(Some(files.clone()));
    db
}

/// Commits on so many threads that they would take more than there is.
fn commit(db: &mut SceneDb) -> SceneCommit {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(16).build().expect("threads");
    pool.install(|| db.commit())
}

#[test]
fn building_keeps_to_every_budget_and_gives_the_same_meshes() {
    let expected = content(&committed(&mut scene()));
    for room in [12, 24, 1024] {
        let files = Arc::new(Files::default());
        let mut db = within(room, room, &files);
        let commit = commit(&mut db);
        assert!(commit.warnings.is_empty(), "{room} MiB: {:?}", commit.warnings);
        assert_eq!(content(&commit.snapshot), expected, "{room} MiB");
        let (most, held) = (db.mesh_memory().most_taken(), db.mesh_memory().held());
        assert!(most <= room * MIB && held <= room * MIB / 2, "{most} taken, {held} held of {room} MiB");
        assert!(most > 8 * MIB, "{most}: what building takes is counted");
    }
}

#[test]
fn without_room_meshes_are_built_one_at_a_time() {
    let files = Arc::new(Files::default());
    let mut db = within(0, 64, &files);
    assert_eq!(content(&commit(&mut db).snapshot), content(&committed(&mut scene())));
    let alone = db.mesh_memory().most_taken();
    let files = Arc::new(Files::default());
    let mut db = within(64, 64, &files);
    commit(&mut db);
    let together = db.mesh_memory().most_taken();
    assert!(alone <= 16 * MIB && alone < together, "{alone} alone, {together} together");
}

#[test]
fn a_mesh_that_is_too_large_is_left_out_and_named_until_there_is_room() {
    let files = Arc::new(Files::default());
    let mut db = within(16, 16, &files);
    db.upsert_mesh(grid("/huge", 340));
    let commit = db.commit();
    let [warning] = &commit.warnings[..] else { panic!("one warning: {:?}", commit.warnings) };
    assert_eq!(&*warning.path, "/huge");
    for part in ["MiB of host memory to be built", "the 16 MiB of oocpt:hostMemoryBudget", "left out"] {
        assert!(warning.message.contains(part), "{part}: {}", warning.message);
    }
    assert_eq!(commit.snapshot.counts.instances, 60, "all others are there");
    assert!(db.mesh_memory().most_taken() <= 16 * MIB);
    db.set_host_budget(16 * MIB);
    assert!(!db.commit().changed, "nothing is tried again for the same budget");
    db.set_host_budget(1024 * MIB);
    let commit = db.commit();
    assert!(commit.changed && commit.warnings.is_empty(), "{:?}", commit.warnings);
    assert_eq!(commit.snapshot.counts.instances, 61, "there is room now");
    db.set_host_budget(16 * MIB);
    assert!(!db.commit().changed, "what is built stays");
}

#[test]
fn what_files_have_is_not_left_out() {
    let files = Arc::new(Files::lasting());
    let mut large = within(1024, 1024, &files);
    large.upsert_mesh(grid("/huge", 340));
    let expected = content(&committed(&mut large));
    let mut small = within(16, 16, &files);
    small.upsert_mesh(grid("/huge", 340));
    let commit = small.commit();
    assert!(commit.warnings.is_empty(), "{:?}", commit.warnings);
    assert_eq!(content(&commit.snapshot), expected);
}
