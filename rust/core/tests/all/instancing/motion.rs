// SPDX-License-Identifier: Apache-2.0
//! Placements that move: their keys, boxes that hold them at every time, and motion that cannot be used.

use glam::{DAffine3, DMat4, DVec3};
use oocpt_abi::Features;
use oocpt_core::scene::{InstancerMotion, InstancerSample, MAX_KEYS, map_at};
use oocpt_core::{
    Aabb, ElementType, InstanceRecord, InstanceTarget, InstancerDesc, MotionKey, PartitionOptions, SceneDb, Snapshot,
    TransformSample, TypedArray,
};

use crate::partition::edits::assert_same_world;
use crate::support::{by, committed, records, scatter, triangle};

/// Transforms at times.
type Maps<'a> = &'a [(f64, DMat4)];

fn samples(maps: Maps<'_>) -> Vec<TransformSample> {
    maps.iter().map(|(time, transform)| TransformSample { time: *time, transform: *transform }).collect()
}

fn turned(x: f64, angle: f64) -> DMat4 {
    DMat4::from_translation(DVec3::X * x) * DMat4::from_rotation_z(angle)
}

/// Numbers between -1 and 1 that only depend on `i`.
fn scattered(i: u32) -> [f32; 3] {
    let i = f64::from(i + 1);
    let at = DVec3::new(0.754_877_666_246_7 * i, 0.569_840_290_998 * i, 0.381_966_011_250_1 * i);
    (2.0 * at.fract() - 1.0).as_vec3().to_array()
}

/// `count` instances of a triangle that is not at its own origin, with velocities of every kind.
fn swarm(path: &str, count: u32) -> InstancerDesc {
    let numbers: Vec<i32> = (0..i32::try_from(count).unwrap()).collect();
    let at: Vec<[f32; 3]> = (0..count).map(|i| scattered(i).map(|x| 100.0 * x)).collect();
    let root = format!("{path}/p");
    let rates = |scale: f32| {
        Some(TypedArray::of((0..count).map(|i| scattered(i + 7).map(|x| scale * x)).collect::<Vec<[f32; 3]>>()))
    };
    InstancerDesc {
        rotations: Some(
            TypedArray::from_vec(ElementType::Quatf, vec![[0.0_f32, 0.0, 0.6, 0.8]; numbers.len()]).unwrap(),
        ),
        motion: InstancerMotion {
            velocities: rates(300.0),
            accelerations: rates(4000.0),
            angular_velocities: rates(9000.0),
            seconds: [-0.01, 0.02],
            samples: Vec::new(),
        },
        ..scatter(path, &at, &[(&root, &numbers)])
    }
}

fn add_swarm(db: &mut SceneDb, desc: InstancerDesc) {
    let path = desc.prim.path.clone();
    let mut mesh = triangle(&format!("{path}/p"), 0.5);
    mesh.prim.instanced_by = vec![by(&path, &format!("{path}/p"))];
    mesh.prim.transform = turned(3.0, 0.2);
    db.upsert_mesh(mesh);
    db.upsert_instancer(desc);
}

/// One or the other kind of everything that moves.
fn everything() -> SceneDb {
    let mut db = SceneDb::new();
    let mut mesh = triangle("/turns", 0.25);
    mesh.prim.transform = turned(1.0, 0.0);
    mesh.prim.motion = samples(&[(-1.0, turned(0.0, 0.0)), (0.5, turned(1.0, 2.5)), (0.75, turned(-4.0, 0.5))]);
    db.upsert_mesh(mesh);
    add_swarm(&mut db, swarm("/swarm", 400));
    let mut whole = swarm("/whole", 50);
    whole.prim.motion = samples(&[(0.0, turned(0.0, 0.0)), (1.0, turned(50.0, 3.0))]);
    add_swarm(&mut db, whole);
    db.set_partition(PartitionOptions { chunk_bytes: 16 << 10 });
    db
}

fn bounds_of(snapshot: &Snapshot, target: InstanceTarget) -> Aabb {
    match target {
        InstanceTarget::Mesh(mesh) => snapshot.meshes[mesh as usize].bounds,
        InstanceTarget::Assembly(assembly) => snapshot.assemblies[assembly as usize].bounds(),
    }
}

/// The box of what is placed, at 200 times, is in that of its record, which is little larger.
fn holds(snapshot: &Snapshot, record: &InstanceRecord, keys: &[MotionKey]) {
    let target = bounds_of(snapshot, record.target);
    let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for step in 0..=200 {
        let map = map_at(keys, f64::from(step) / 200.0);
        for corner in 0..8_usize {
            let side = |k: usize| f64::from(if corner >> k & 1 == 1 { target.max[k] } else { target.min[k] });
            let p = map.transform_point3(DVec3::new(side(0), side(1), side(2)));
            (min, max) = (min.min(p), max.max(p));
        }
    }
    let [low, high] = record.bounds.map(|corner| DVec3::from(corner.map(f64::from)));
    assert!(low.cmple(min).all() && high.cmpge(max).all(), "{low} {high} for {min} {max}");
    let spare = (min - low).max(high - max).max_element();
    assert!(spare < 0.03 * (max - min).max_element(), "{spare} too much for {min} {max}");
}

fn check_all(snapshot: &Snapshot, records: &[InstanceRecord], keys: &[Vec<MotionKey>]) -> usize {
    let moving: Vec<&InstanceRecord> = records.iter().filter(|record| record.keys != 0).collect();
    assert_eq!(moving.len(), keys.len(), "keys of every record that moves");
    for (record, keys) in moving.iter().zip(keys) {
        assert_eq!(record.keys as usize, keys.len());
        holds(snapshot, record, keys);
    }
    keys.len()
}

/// What moves is measured with all its keys wherever the partition does so.
#[test]
fn moving_items_partition_equally_in_stretches_and_at_once() {
    let mut in_stretches = everything();
    in_stretches.set_partition_memory(1);
    let (at_once, in_stretches) = (committed(&mut everything()), committed(&mut in_stretches));
    assert!(at_once.world.chunks.len() > 4, "{} chunks", at_once.world.chunks.len());
    assert_same_world(&at_once, &in_stretches);
}

#[test]
fn boxes_hold_what_moves_at_every_time_in_assemblies_and_chunks() {
    let mut db = everything();
    let snapshot = committed(&mut db);
    assert!(snapshot.features.contains(Features::MOTION));
    let mut moving = 0;
    for (at, assembly) in snapshot.assemblies.iter().enumerate() {
        let mut keys = Vec::new();
        assembly.encode_keys(0..assembly.len(), |of_record| keys.push(of_record.to_vec()));
        moving += check_all(&snapshot, &records(&snapshot, at), &keys);
        assert_eq!(assembly.keys_before(assembly.len()), keys.iter().map(Vec::len).sum::<usize>());
    }
    // The mesh, 400 instances, the whole and 50 instances in it.
    assert_eq!(moving, 1 + 400 + 1 + 50);
    assert!(snapshot.world.chunks.len() > 4, "{} chunks", snapshot.world.chunks.len());
    let mut in_chunks = 0;
    for chunk in &snapshot.world.chunks {
        let mut records = vec![InstanceRecord::default(); chunk.len()];
        chunk.encode(0..chunk.len(), &mut records);
        let mut keys = Vec::new();
        chunk.encode_keys(0..chunk.len(), |of_record| keys.push(of_record.to_vec()));
        in_chunks += check_all(&snapshot, &records, &keys);
        let around = chunk.bounds();
        for record in &records {
            let [min, max] = record.bounds;
            let inside = (0..3).all(|k| around.min[k] <= min[k] && max[k] <= around.max[k]);
            assert!(inside, "{around:?} of a chunk does not hold {:?}", record.bounds);
        }
        let half = chunk.len() / 2;
        let before: usize = records[..half].iter().map(|record| record.keys as usize).sum();
        assert_eq!(chunk.keys_before(half), before);
        let mut second = Vec::new();
        chunk.encode_keys(half..chunk.len(), |of_record| second.push(of_record.to_vec()));
        assert_eq!(second[..], keys[keys.len() - second.len()..], "the keys of a part are those of the whole");
    }
    assert_eq!(in_chunks, 1 + 400 + 1);
}

#[test]
fn keys_are_where_velocities_and_samples_say() {
    let mut db = SceneDb::new();
    let mut desc = scatter("/i", &[[1.0, 2.0, 3.0]], &[("/i/p", &[0])]);
    desc.rotations = Some(TypedArray::from_vec(ElementType::Quatf, vec![[0.0_f32, 0.0, 0.0, 1.0]]).unwrap());
    desc.motion = InstancerMotion {
        velocities: Some(TypedArray::of(vec![[2.0_f32, 0.0, 0.0]])),
        accelerations: Some(TypedArray::of(vec![[0.0_f32, 8.0, 0.0]])),
        angular_velocities: Some(TypedArray::of(vec![[0.0_f32, 0.0, 90.0]])),
        seconds: [-0.5, 0.5],
        samples: Vec::new(),
    };
    let mut mesh = triangle("/i/p", 0.0);
    mesh.prim.instanced_by = vec![by("/i", "/i/p")];
    db.upsert_mesh(mesh);
    db.upsert_instancer(desc);
    let snapshot = committed(&mut db);
    let mut keys = Vec::new();
    snapshot.assemblies[snapshot.assemblies.len() - 1].encode_keys(0..1, |of_record| keys = of_record.to_vec());
    for (time, seconds) in [(0.0, -0.5), (0.5, 0.0), (1.0, 0.5_f64)] {
        let known = DAffine3::from_translation(DVec3::new(1.0 + 2.0 * seconds, 2.0 + 4.0 * seconds * seconds, 3.0))
            * DAffine3::from_rotation_z(90_f64.to_radians() * seconds);
        let map = map_at(&keys, time);
        let map = DAffine3::from_translation(snapshot.origin) * map;
        assert!(map.abs_diff_eq(known, 1e-6), "{time}: {map:?} is not {known:?}");
    }
}

#[test]
fn moving_assemblies_are_not_opened_and_static_ones_have_no_keys() {
    let mut db = SceneDb::new();
    let add = |db: &mut SceneDb, motion: Vec<TransformSample>| {
        let mut still = swarm("/i", 4000);
        still.motion = InstancerMotion::default();
        still.prim.motion = motion;
        add_swarm(db, still);
    };
    db.set_partition(PartitionOptions { chunk_bytes: 16 << 10 });
    add(&mut db, samples(&[(0.0, DMat4::IDENTITY), (1.0, DMat4::IDENTITY)]));
    let still = committed(&mut db);
    assert!(!still.features.contains(Features::MOTION), "equal samples are no motion");
    assert!(still.world.chunks.len() > 10 && still.world.levels == 1);
    add(&mut db, samples(&[(0.0, DMat4::IDENTITY), (1.0, turned(1.0, 0.1))]));
    let moving = committed(&mut db);
    assert!(moving.features.contains(Features::MOTION));
    assert_eq!((moving.world.chunks.len(), moving.world.levels), (1, 2), "one record, which moves, of 4000 at rest");
    let root = records(&moving, moving.assemblies.len() - 1);
    assert_eq!(root.iter().map(|record| record.keys).collect::<Vec<_>>(), [2]);
    let inner: Vec<_> = records(&moving, moving.assemblies.len() - 2).iter().map(|record| record.keys).collect();
    assert!(inner.len() == 4000 && inner.iter().all(|keys| *keys == 0), "instances at rest in a frame that moves");
    add(&mut db, Vec::new());
    assert_eq!(committed(&mut db).world.chunks.len(), still.world.chunks.len(), "and back");
}

/// The warnings of a scene, and whether something moves in it.
fn told(db: &mut SceneDb) -> (Vec<String>, bool) {
    let commit = db.commit();
    assert_eq!(commit.snapshot.validate(), Ok(()));
    assert_eq!(commit.snapshot.world.validate(&commit.snapshot.meshes, &commit.snapshot.assemblies), Ok(()));
    let say = |warning: &oocpt_core::SceneWarning| format!("{}: {}", warning.path, warning.message);
    (commit.warnings.iter().map(say).collect(), commit.snapshot.features.contains(Features::MOTION))
}

#[test]
fn invalid_transform_samples_give_one_warning_and_no_motion() {
    let identity = DMat4::IDENTITY;
    let nan = DMat4::from_translation(DVec3::NAN);
    let cases: [(&str, Maps<'_>, &str); 6] = [
        ("NaN", &[(0.0, identity), (1.0, nan)], "singular or not finite"),
        ("flat", &[(0.0, identity), (1.0, DMat4::from_scale(DVec3::new(1.0, 0.0, 1.0)))], "singular or not finite"),
        ("backwards", &[(1.0, identity), (0.0, turned(1.0, 0.0))], "order of time"),
        ("at once", &[(0.0, identity), (0.0, turned(1.0, 0.0))], "order of time"),
        ("never", &[(0.0, identity), (f64::NAN, turned(1.0, 0.0))], "no usable time"),
        ("mirrored", &[(0.0, identity), (1.0, DMat4::from_scale(DVec3::new(-1.0, 1.0, 1.0)))], "inside out"),
    ];
    for (name, maps, text) in cases {
        let mut db = SceneDb::new();
        let mut mesh = triangle("/mesh", 0.0);
        mesh.prim.motion = samples(maps);
        db.upsert_mesh(mesh);
        let (warnings, moves) = told(&mut db);
        let [warning] = &warnings[..] else { panic!("{name}: {warnings:?}") };
        assert!(!moves && warning.starts_with("/mesh: ") && warning.contains(text), "{name}: {warning}");
        assert_eq!(records(db.snapshot(), 0).len(), 1, "{name}: it is there");
    }
}

#[test]
fn invalid_velocities_or_samples_leave_instances_static() {
    let array = |count: usize, value: f32| Some(TypedArray::of(vec![[value, 0.0, 0.0]; count]));
    let sample = |time: f64, count: usize| InstancerSample {
        time,
        translations: array(count, 1.0),
        ..InstancerSample::default()
    };
    let of = |velocities, seconds| InstancerMotion { velocities, seconds, ..InstancerMotion::default() };
    let sampled = |samples| InstancerMotion { samples, ..InstancerMotion::default() };
    let cases: [(&str, InstancerMotion, &str); 6] = [
        ("too few", of(array(2, 1.0), [0.0, 1.0]), "wrong length or type"),
        ("too many", of(array(9, 1.0), [0.0, 1.0]), "wrong length or type"),
        ("numbers", of(Some(TypedArray::of(vec![1.0_f32; 3])), [0.0, 1.0]), "wrong length or type"),
        ("closed", of(array(3, 1.0), [1.0, 0.0]), "no usable time"),
        ("other counts", sampled(vec![sample(0.0, 3), sample(1.0, 2)]), "other numbers of instances"),
        ("backwards", sampled(vec![sample(1.0, 3), sample(0.0, 3)]), "order of time"),
    ];
    let at = [[0.0_f32; 3], [5.0, 0.0, 0.0], [9.0, 0.0, 0.0]];
    for (name, motion, text) in cases {
        let mut db = SceneDb::new();
        add_swarm(&mut db, InstancerDesc { motion, ..scatter("/i", &at, &[("/i/p", &[0, 1, 2])]) });
        let (warnings, moves) = told(&mut db);
        let [warning] = &warnings[..] else { panic!("{name}: {warnings:?}") };
        assert!(!moves && warning.starts_with("/i: ") && warning.contains(text), "{name}: {warning}");
    }
    // Single ones that are no numbers, or too far: these stay, the others move.
    for bad in [f32::NAN, f32::INFINITY, 1e30] {
        let mut db = SceneDb::new();
        let velocities = Some(TypedArray::of(vec![[1.0_f32, 0.0, 0.0], [bad, 0.0, 0.0], [1e9, 0.0, 0.0]]));
        add_swarm(
            &mut db,
            InstancerDesc { motion: of(velocities, [0.0, 1.0]), ..scatter("/i", &at, &[("/i/p", &[0, 1, 2])]) },
        );
        let (warnings, moves) = told(&mut db);
        let [warning] = &warnings[..] else { panic!("{bad}: {warnings:?}") };
        assert!(moves && warning.contains("1 instances that do not move"), "{bad}: {warning}");
        let sizes: Vec<f32> = records(db.snapshot(), db.snapshot().assemblies.len() - 1)
            .iter()
            .map(|r| r.bounds[1][0] - r.bounds[0][0])
            .collect();
        assert!(sizes.len() == 3 && sizes[1] < 3.0 && sizes[0] > 1.5 && sizes[2] > 9e8, "{sizes:?}");
    }
}

#[test]
fn more_samples_than_keys_are_thinned_out() {
    let mut db = SceneDb::new();
    let mut mesh = triangle("/mesh", 0.0);
    mesh.prim.motion = samples(&(0..100).map(|k| (f64::from(k) / 99.0, turned(f64::from(k), 0.0))).collect::<Vec<_>>());
    db.upsert_mesh(mesh);
    let snapshot = committed(&mut db);
    let record = records(&snapshot, 0)[0];
    assert_eq!(record.keys as usize, MAX_KEYS);
    assert!(record.bounds[1][0] - record.bounds[0][0] >= 99.0, "the first and the last are among them");
}

#[test]
fn changed_motion_is_updated_and_equal_motion_is_kept() {
    let mut db = everything();
    let first = committed(&mut db);
    add_swarm(&mut db, swarm("/swarm", 400));
    let same = db.commit();
    assert!(!same.changed && same.snapshot.version == first.version, "the same arrays once more");
    let mut faster = swarm("/swarm", 400);
    faster.motion.seconds = [-0.02, 0.04];
    add_swarm(&mut db, faster);
    assert!(db.commit().changed, "a shutter that is longer open");
    let mut still = swarm("/swarm", 400);
    still.motion = InstancerMotion::default();
    add_swarm(&mut db, still);
    let still = committed(&mut db);
    let keys: usize = still.world.chunks.iter().map(|chunk| chunk.keys_before(chunk.len())).sum();
    assert_eq!(keys, 3 + 2, "those of the mesh and of the whole");
}
