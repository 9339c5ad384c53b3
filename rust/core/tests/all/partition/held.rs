// SPDX-License-Identifier: Apache-2.0
//! Live scenes hold the chunks of instances that move: what is shown is what a new database shows, and where the scene
//! is no longer live, it is that of a new database bit for bit.

use std::collections::BTreeSet;
use std::sync::Arc;

use oocpt_core::partition::HELD_FROM;
use oocpt_core::{Aabb, InstancerDesc, PartitionOptions, SceneDb, Snapshot, TypedArray};

use crate::partition::cut::{assert_same_leaves, chunk_records, flatten_world, spread};
use crate::partition::edits::{assert_keys_tell, assert_same_world};
use crate::support::{by, committed, scatter, triangle};

/// Instances: more than have to move for their chunks to be held.
const COUNT: usize = 5 * HELD_FROM;
/// Side of the cube that they are in.
const SIDE: f32 = 50.0;

/// The instances of a scene, which tests edit.
#[derive(Clone)]
struct Crowd {
    points: Vec<[f32; 3]>,
    scales: Vec<[f32; 3]>,
    turns: Vec<[f32; 4]>,
    kinds: Vec<usize>,
    mask: Option<Vec<bool>>,
    hidden: usize,
}

impl Crowd {
    fn new() -> Self {
        Self {
            points: spread(COUNT, SIDE, 5),
            scales: vec![[1.0; 3]; COUNT],
            turns: vec![[0.0, 0.0, 0.0, 1.0]; COUNT],
            kinds: (0..COUNT).map(|n| (n % 10).saturating_sub(7)).collect(),
            mask: None,
            hidden: usize::MAX,
        }
    }

    fn desc(&self) -> InstancerDesc {
        let numbers = |of: usize| {
            let all = self.kinds.iter().enumerate().filter(move |(n, kind)| **kind == of && *n != self.hidden);
            all.map(|(n, _)| i32::try_from(n).unwrap()).collect::<Vec<i32>>()
        };
        let [a, b, c] = [0, 1, 2].map(numbers);
        let mut desc = scatter("/i", &self.points, &[("/i/p0", &a), ("/i/p1", &b), ("/i/p2", &c)]);
        desc.scales = Some(TypedArray::of(self.scales.clone()));
        desc.rotations = Some(TypedArray::of(self.turns.clone()));
        desc.mask = self.mask.as_deref().map(TypedArray::from_bools);
        desc
    }

    /// Moves each `step`th instance by less than `by`, another way in each `frame`.
    fn stir(&mut self, step: usize, by: f32, frame: usize) {
        for (n, point) in self.points.iter_mut().enumerate().step_by(step) {
            let turn = (n * 7 + frame * 13) as f32;
            *point = [point[0] + by * turn.sin(), point[1] + by * turn.cos(), point[2]];
        }
    }
}

fn database(crowd: &Crowd, is_live: bool) -> SceneDb {
    let mut db = SceneDb::new();
    db.set_partition(PartitionOptions { chunk_bytes: 64 << 10 });
    db.set_live(is_live);
    for (root, shape) in [("/i/p0", 0.5), ("/i/p1", 1.0), ("/i/p2", 2.0)] {
        let mut mesh = triangle(&format!("{root}/m"), shape);
        mesh.prim.instanced_by = vec![by("/i", root)];
        db.upsert_mesh(mesh);
    }
    db.upsert_instancer(crowd.desc());
    db
}

/// The scene after an edit.
fn edited(db: &mut SceneDb, crowd: &Crowd) -> Arc<Snapshot> {
    db.upsert_instancer(crowd.desc());
    committed(db)
}

fn fresh(crowd: &Crowd) -> Arc<Snapshot> {
    committed(&mut database(crowd, false))
}

fn shapes(snapshot: &Snapshot) -> BTreeSet<u64> {
    snapshot.world.chunks.iter().map(|chunk| chunk.shape()).collect()
}

fn held(snapshot: &Snapshot) -> usize {
    snapshot.world.chunks.iter().filter(|chunk| chunk.is_held()).count()
}

fn keys(snapshot: &Snapshot) -> BTreeSet<u64> {
    snapshot.world.chunks.iter().map(|chunk| chunk.key()).collect()
}

#[test]
fn chunks_of_moving_instances_are_held_and_cut_when_the_scene_rests() {
    let mut crowd = Crowd::new();
    let mut db = database(&crowd, true);
    let first = committed(&mut db);
    assert_eq!((held(&first), keys(&first)), (0, shapes(&first)), "nothing has moved");
    let chunks = first.world.chunks.len();
    assert!(chunks > 40, "{chunks} chunks");
    let mut before = first.clone();
    for frame in 0..6 {
        crowd.stir(1, 0.2, frame);
        let after = edited(&mut db, &crowd);
        assert_eq!((held(&after), shapes(&after)), (chunks, shapes(&first)), "all are held, none is cut");
        assert!(keys(&after).is_disjoint(&keys(&before)), "their records are others");
        assert_same_leaves(flatten_world(&after), flatten_world(&fresh(&crowd)));
        before = after;
    }
    db.set_live(false);
    let rest = committed(&mut db);
    assert_eq!(held(&rest), 0, "cut");
    assert_same_world(&fresh(&crowd), &rest);
    db.set_live(true);
    assert!(!db.commit().changed, "nothing moved");
}

#[test]
fn chunks_without_a_moved_record_stay_and_few_moves_hold_none() {
    // A run of which more than a quarter moves counts as moved as a whole.
    let mut crowd = Crowd { kinds: vec![0; COUNT], ..Crowd::new() };
    let mut db = database(&crowd, true);
    committed(&mut db);
    crowd.points[..HELD_FROM / 8].iter_mut().for_each(|point| point[0] += 0.01);
    let few = edited(&mut db, &crowd);
    assert_eq!(held(&few), 0, "few moved");
    assert_same_world(&fresh(&crowd), &few);
    // A corner of the cube.
    let is_near = |point: &[f32; 3]| point.iter().all(|v| *v < 0.104 * SIDE);
    let near = crowd.points.iter_mut().filter(|point| is_near(point));
    assert!(near.map(|point| point[1] += 0.01).count() > HELD_FROM, "enough");
    let after = edited(&mut db, &crowd);
    let kept = assert_keys_tell(&few, &after);
    assert!(kept > 5 && held(&after) > 5 && kept + held(&after) == after.world.chunks.len(), "{kept} are kept");
    assert_same_leaves(flatten_world(&after), flatten_world(&fresh(&crowd)));
    // What is held stays so, whatever moves next.
    crowd.points[7][0] += 0.01;
    let next = edited(&mut db, &crowd);
    assert_eq!(shapes(&next), shapes(&after), "none is cut");
    assert!((held(&after)..=held(&after) + 1).contains(&held(&next)), "at most one more is held");
}

#[test]
fn what_has_moved_far_is_cut_anew() {
    let mut crowd = Crowd::new();
    let mut db = database(&crowd, true);
    let first = committed(&mut db);
    let chunks = first.world.chunks.len();
    crowd.stir(1, 0.1, 0);
    assert_eq!(held(&edited(&mut db, &crowd)), chunks, "held");
    // Each to the place of another one.
    crowd.points.rotate_left(COUNT / 3);
    let mixed = edited(&mut db, &crowd);
    assert_eq!(held(&mixed), 0, "boxes as large as the scene");
    assert_same_world(&fresh(&crowd), &mixed);
    crowd.stir(1, 0.1, 1);
    assert_eq!(held(&edited(&mut db, &crowd)), mixed.world.chunks.len(), "held again");
    // One goes far away: all of its chunk would be as coarse as the way is long.
    crowd.points[5] = [3000.0, 0.0, 0.0];
    crowd.stir(2, 0.1, 2);
    let apart = edited(&mut db, &crowd);
    assert_eq!(held(&apart), 0, "one is apart");
    assert_same_world(&fresh(&crowd), &apart);
}

#[test]
fn what_rests_around_a_held_crowd_that_leaves_is_cut_as_in_a_new_database() {
    // In the cell from 8 to 12: a clump on either side, of an instancer that rests, and between them those that move.
    let within = |n: usize, low: f32, high: f32| {
        let at = spread(1, 1.0, u32::try_from(n).unwrap())[0].map(|v| v + 0.5);
        [low + (high - low) * at[0], 8.5 + 3.0 * at[1], 8.5 + 3.0 * at[2]]
    };
    let mut resting: Vec<[f32; 3]> = (0..200).map(|n| within(n, 8.1, 8.3)).collect();
    resting.extend((200..400).map(|n| within(n, 11.7, 11.9)));
    let with_resting = |mut db: SceneDb| {
        let mut mesh = triangle("/r/p/m", 0.5);
        mesh.prim.instanced_by = vec![by("/r", "/r/p")];
        db.upsert_mesh(mesh);
        let all: Vec<i32> = (0..).take(resting.len()).collect();
        db.upsert_instancer(scatter("/r", &resting, &[("/r/p", &all)]));
        db
    };
    let mut crowd = Crowd::new();
    let moving = 400..400 + 2 * HELD_FROM;
    for (n, point) in crowd.points.iter_mut().enumerate() {
        *point = if moving.contains(&n) { within(n, 10.1, 10.9) } else { point.map(|v| v - SIDE) };
    }
    crowd.kinds = vec![0; COUNT];
    let mut db = with_resting(database(&crowd, true));
    committed(&mut db);
    for frame in 0..2 {
        for (n, point) in crowd.points.iter_mut().enumerate().filter(|(n, _)| moving.contains(n)) {
            point[1] += 0.01 * ((n + frame) as f32).sin();
        }
        let after = edited(&mut db, &crowd);
        assert!(held(&after) > 10 && held(&after) < after.world.chunks.len(), "frame {frame}");
    }
    crowd.points.iter_mut().enumerate().filter(|(n, _)| moving.contains(n)).for_each(|(_, point)| point[0] -= 60.0);
    assert!(held(&edited(&mut db, &crowd)) > 10, "they go together");
    db.set_live(false);
    let after = committed(&mut db);
    let near = after.world.chunks.iter().filter(|chunk| chunk.origin().min_element() > 8.0);
    assert_eq!(near.map(|chunk| chunk.len()).collect::<Vec<usize>>(), [400], "both clumps are one chunk");
    assert_same_world(&committed(&mut with_resting(database(&crowd, false))), &after);
}

#[test]
fn another_chunk_size_cuts_what_is_held() {
    let mut crowd = Crowd::new();
    let mut db = database(&crowd, true);
    committed(&mut db);
    crowd.stir(1, 0.1, 0);
    let before = edited(&mut db, &crowd).world.chunks.len();
    crowd.stir(1, 0.1, 1);
    db.set_partition(PartitionOptions { chunk_bytes: 32 << 10 });
    let after = edited(&mut db, &crowd);
    assert!(after.world.chunks.len() > before && held(&after) == 0, "smaller ones");
}

/// An edit of a crowd that may be hostile.
fn disturb(crowd: &mut Crowd, kind: u32, n: usize) {
    let far = [f32::NAN, f32::INFINITY, 1e30, -1e17, 3e8, 0.0][n % 6];
    match kind {
        0..3 => crowd.stir(1 + n % 5, 0.2, n),
        3 => crowd.points[n] = [far, 1.0, 2.0],
        4 => crowd.scales[n] = [far, 1.0, 1.0],
        5 => crowd.turns[n] = [far, 0.0, 1.0, 0.0],
        6 => crowd.mask = Some((0..COUNT).map(|k| !k.is_multiple_of(2 + n % 9)).collect()),
        7 => crowd.mask = None,
        8 => crowd.kinds.swap(n, (n * 17) % COUNT),
        9 => crowd.hidden = if crowd.hidden == n { usize::MAX } else { n },
        10 => crowd.points.rotate_right(n % 100),
        // Fewer places than instances that are named.
        11 => crowd.points.truncate(COUNT - n % 50),
        12 => {
            let known = crowd.points.len();
            crowd.points.extend(spread(COUNT, SIDE, 9).split_off(known));
        }
        // What was nowhere is somewhere again.
        _ => {
            let back = |v: &mut f32| *v = if v.is_finite() && v.abs() < 1e3 { *v } else { 1.0 };
            crowd.points.as_flattened_mut().iter_mut().for_each(back);
            crowd.scales.as_flattened_mut().iter_mut().for_each(|v| *v = if *v == 0.0 { 1.0 } else { *v });
            crowd.scales.as_flattened_mut().iter_mut().for_each(back);
            crowd.turns.as_flattened_mut().iter_mut().for_each(back);
        }
    }
}

#[test]
fn any_sequence_of_edits_shows_what_a_new_database_shows() {
    let mut random = 11_u32;
    let mut next = |below: usize| {
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (random >> 8) as usize % below
    };
    let (mut holds, mut cuts) = (0, 0);
    for round in 0..2 {
        let mut crowd = Crowd::new();
        let mut db = database(&crowd, true);
        committed(&mut db);
        for step in 0..14 {
            let kind = u32::try_from(next(14)).unwrap();
            let n = next(crowd.points.len());
            disturb(&mut crowd, kind, n);
            // Most edits come with a move of many.
            if next(3) > 0 {
                crowd.stir(1 + next(3), 0.1, step);
            }
            let after = edited(&mut db, &crowd);
            let is_held = held(&after) > 0;
            (holds, cuts) = (holds + usize::from(is_held), cuts + usize::from(!is_held));
            let new = fresh(&crowd);
            assert_eq!((after.counts, after.dropped), (new.counts, new.dropped), "round {round}, step {step}: {kind}");
            assert_same_leaves(flatten_world(&after), flatten_world(&new));
        }
        db.set_live(false);
        assert_same_world(&fresh(&crowd), &committed(&mut db));
    }
    assert!(holds > 5 && cuts > 5, "{holds} commits with held chunks, {cuts} without");
}

/// The snapshot with everything measured, as a renderer has it; leaves out what is not usable.
fn shown(snapshot: &Snapshot) -> Snapshot {
    let world = snapshot.world.measured().map_or_else(|| snapshot.world.clone(), Arc::new);
    Snapshot { world, ..snapshot.clone() }
}

/// Number of records whose box is empty, which no ray finds.
fn nowhere(snapshot: &Snapshot) -> usize {
    let chunks = 0..snapshot.world.chunks.len();
    let records = chunks.flat_map(|chunk| chunk_records(&snapshot.world, chunk));
    records.filter(|record| record.bounds[0][0] > record.bounds[1][0]).count()
}

#[test]
fn what_moves_is_measured_when_somebody_asks() {
    let mut crowd = Crowd::new();
    let mut db = database(&crowd, true);
    db.set_late(true);
    let first = committed(&mut db);
    assert!(first.world.measured().is_none(), "nothing has moved");
    for frame in 0..4 {
        crowd.stir(1, 0.2, frame);
        db.upsert_instancer(crowd.desc());
        let after = db.commit().snapshot;
        assert_eq!((held(&after), shapes(&after)), (first.world.chunks.len(), shapes(&first)), "all are held");
        assert!(after.world.chunks.iter().all(|chunk| chunk.is_late()), "frame {frame}: none is measured");
        // A device measures some of them, and the host the others.
        let device = |chunk: &Arc<oocpt_core::Chunk>, records: Vec<oocpt_core::InstanceRecord>| {
            let boxes = records.iter().map(|r| Aabb { min: r.bounds[0], max: r.bounds[1] });
            chunk.set_bounds(boxes.fold(Aabb::EMPTY, |all, b| all.union(&b)));
        };
        for (at, chunk) in after.world.chunks.iter().enumerate().step_by(2) {
            device(chunk, chunk_records(&after.world, at));
        }
        let shown = shown(&after);
        assert!(after.world.chunks.iter().all(|chunk| !chunk.is_late()), "all are measured");
        assert_eq!(shown.world.validate(&shown.meshes, &shown.assemblies), Ok(()), "boxes hold what is in them");
        assert_same_leaves(flatten_world(&shown), flatten_world(&fresh(&crowd)));
    }
    db.set_live(false);
    assert_same_world(&fresh(&crowd), &committed(&mut db));
}

#[test]
fn chunks_in_which_nothing_moved_stay_where_others_are_measured_late() {
    let mut crowd = Crowd::new();
    let mut db = database(&crowd, true);
    db.set_late(true);
    committed(&mut db);
    crowd.stir(1, 0.1, 0);
    let all = edited(&mut db, &crowd);
    assert_eq!(held(&all), all.world.chunks.len(), "all are held");
    drop(shown(&all));
    // A corner of the cube, and then a single one.
    let is_near = |point: &[f32; 3]| point.iter().all(|v| *v < -0.1 * SIDE);
    let near = crowd.points.iter_mut().filter(|point| is_near(point));
    assert!(near.map(|point| point[1] += 0.01).count() > 1000, "enough");
    let some = edited(&mut db, &crowd);
    let kept = keys(&some).intersection(&keys(&all)).count();
    let moved = some.world.chunks.len() - kept;
    assert!(moved > 2 && kept > 20 && shapes(&some) == shapes(&all), "{moved} moved, {kept} stay");
    assert_same_leaves(flatten_world(&shown(&some)), flatten_world(&fresh(&crowd)));
    crowd.points[7][0] += 0.01;
    let one = edited(&mut db, &crowd);
    assert_eq!(keys(&one).difference(&keys(&some)).count(), 1, "one chunk");
    assert_same_leaves(flatten_world(&shown(&one)), flatten_world(&fresh(&crowd)));
}

#[test]
fn a_chunk_that_nobody_measured_stays_late_when_others_in_it_move() {
    let mut crowd = Crowd::new();
    let mut db = database(&crowd, true);
    let mut mesh = triangle("/j/p/m", 0.5);
    mesh.prim.instanced_by = vec![by("/j", "/j/p")];
    db.upsert_mesh(mesh);
    let numbers: Vec<i32> = (0..2000).collect();
    let mut points = spread(2000, SIDE, 3);
    db.upsert_instancer(scatter("/j", &points, &[("/j/p", &numbers)]));
    db.set_late(true);
    committed(&mut db);
    crowd.stir(1, 2.0, 0);
    db.upsert_instancer(crowd.desc());
    assert!(held(&db.commit().snapshot) > 0, "held, and nobody looks");
    points.iter_mut().take(50).for_each(|point| point[0] += 0.01);
    db.upsert_instancer(scatter("/j", &points, &[("/j/p", &numbers)]));
    let after = shown(&db.commit().snapshot);
    assert!(held(&after) > 0, "still held");
    assert_eq!(after.world.validate(&after.meshes, &after.assemblies), Ok(()), "boxes hold what is in them");
}

#[test]
fn what_is_torn_apart_is_cut_at_once_and_one_that_is_far_a_commit_later() {
    let mut crowd = Crowd::new();
    let mut db = database(&crowd, true);
    db.set_late(true);
    let chunks = committed(&mut db).world.chunks.len();
    crowd.stir(1, 0.1, 0);
    assert_eq!(held(&edited(&mut db, &crowd)), chunks, "held");
    crowd.points.rotate_left(COUNT / 3);
    let mixed = edited(&mut db, &crowd);
    assert_eq!(held(&mixed), 0, "some of each chunk are all over the scene");
    assert_same_world(&fresh(&crowd), &mixed);
    crowd.points[5] = [3000.0, 0.0, 0.0];
    crowd.stir(2, 0.1, 2);
    let apart = edited(&mut db, &crowd);
    assert_eq!(held(&apart), mixed.world.chunks.len(), "nobody knows");
    drop(shown(&apart));
    crowd.stir(2, 0.1, 3);
    let next = edited(&mut db, &crowd);
    assert_eq!(held(&next), 0, "one is apart");
    assert_same_world(&fresh(&crowd), &next);
}

#[test]
fn any_sequence_of_edits_that_is_measured_late_shows_what_a_new_database_shows() {
    let mut random = 5_u32;
    let mut next = |below: usize| {
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (random >> 8) as usize % below
    };
    let (mut late, mut dropped) = (0, 0);
    for round in 0..2 {
        let mut crowd = Crowd::new();
        let mut db = database(&crowd, true);
        db.set_late(true);
        committed(&mut db);
        for step in 0..14 {
            let kind = u32::try_from(next(14)).unwrap();
            let n = next(crowd.points.len());
            disturb(&mut crowd, kind, n);
            if next(3) > 0 {
                crowd.stir(1 + next(3), 0.1, step);
            }
            db.upsert_instancer(crowd.desc());
            let after = db.commit().snapshot;
            // Some snapshots are never shown.
            if next(4) == 0 {
                continue;
            }
            late += usize::from(after.world.chunks.iter().any(|chunk| chunk.is_late()));
            let shown = shown(&after);
            assert_eq!(shown.world.validate(&shown.meshes, &shown.assemblies), Ok(()), "round {round}, step {step}");
            dropped += nowhere(&shown);
            assert_same_leaves(flatten_world(&shown), flatten_world(&fresh(&crowd)));
        }
        db.set_live(false);
        assert_same_world(&fresh(&crowd), &committed(&mut db));
    }
    assert!(late > 5 && dropped > 0, "{late} snapshots were late, {dropped} records were nowhere");
}
