// SPDX-License-Identifier: Apache-2.0
//! Edits: untouched data stay, and the result is that of a new database for the same scene.

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

use glam::{DMat4, DVec3};
use oocpt_core::{
    ElementType, InstanceRecord, InstanceTarget, InstancerDesc, MeshDesc, PartitionOptions, SceneDb, Snapshot,
    TypedArray,
};
use proptest::prelude::*;

use crate::partition::cut::{SMALL, assert_same_leaves, chunk_records, flatten_world, spread};
use crate::support::{by, committed, flatten, grid, scatter, triangle};

/// Bytes of an item of the partition.
const ITEM: u64 = 24;

/// Mesh indices depend on the history of a database, content hashes do not.
fn comparable(snapshot: &Snapshot, record: &InstanceRecord) -> (Vec<u32>, u128, Vec<u32>) {
    let floats = record.object_from_parent.as_flattened().iter().chain(record.bounds.as_flattened());
    let target = match record.target {
        InstanceTarget::Mesh(m) => snapshot.meshes[m as usize].key,
        InstanceTarget::Assembly(a) => u128::from(a),
    };
    let rest = [
        record.prim_id.cast_unsigned(),
        record.index_in_prototype,
        record.prototype_count,
        u32::from(record.flips_handedness),
    ];
    (floats.map(|v| v.to_bits()).collect(), target, rest.to_vec())
}

/// The same cells with the same records bit for bit, placed the same.
pub(crate) fn assert_same_world(a: &Snapshot, b: &Snapshot) {
    let (wa, wb) = (&a.world, &b.world);
    let cells = |s: &Snapshot| s.world.chunks.iter().map(|c| (c.cell(), c.len())).collect::<Vec<_>>();
    assert!(cells(a) == cells(b), "cells\n{:?}\n{:?}", cells(a), cells(b));
    for k in 0..wa.chunks.len() {
        let (ca, cb) = (&wa.chunks[k], &wb.chunks[k]);
        assert_eq!((ca.origin(), ca.bounds()), (cb.origin(), cb.bounds()), "frame of chunk {k}");
        assert_eq!(ca.targets().len(), cb.targets().len(), "targets of chunk {k}");
        let records = |s: &Snapshot| chunk_records(&s.world, k).iter().map(|r| comparable(s, r)).collect::<Vec<_>>();
        assert!(records(a) == records(b), "records of chunk {k}");
    }
    assert!(wa.instances == wb.instances, "chunk instances");
    assert_eq!((wa.levels, &wa.opened, &wa.top), (wb.levels, &wb.opened, &wb.top), "top level");
    for (a, b) in a.assemblies.iter().zip(&b.assemblies) {
        assert_eq!((a.bounds(), a.len()), (b.bounds(), b.len()), "assembly");
    }
    assert_eq!((a.counts, a.dropped), (b.counts, b.dropped), "counts");
}

/// Chunks of one key have the same records in any snapshot.
pub(crate) fn assert_keys_tell(before: &Snapshot, after: &Snapshot) -> usize {
    let old: HashMap<u64, usize> = before.world.chunks.iter().enumerate().map(|(k, c)| (c.key(), k)).collect();
    let mut kept = 0;
    for (k, chunk) in after.world.chunks.iter().enumerate() {
        if let Some(&was) = old.get(&chunk.key()) {
            let (a, b) = (chunk_records(&before.world, was), chunk_records(&after.world, k));
            assert!(a == b, "records of chunk {k} changed, its key did not");
            assert!(Arc::ptr_eq(&before.world.chunks[was], chunk), "a kept chunk is the same");
            kept += 1;
        }
    }
    kept
}

#[derive(Clone, Debug)]
struct Instancer {
    at: Vec<[f32; 3]>,
    scales: Vec<[f32; 3]>,
    rotations: Vec<[f32; 4]>,
    /// Prototype of each instance.
    kinds: Vec<u8>,
    offset: f64,
    present: bool,
}

impl Instancer {
    fn new(n: usize, seed: u32) -> Self {
        let turn = |p: [f32; 3]| [p[0], p[1], p[2], 1.0];
        Self {
            at: spread(n, 100.0, seed),
            scales: vec![[1.0; 3]; n],
            rotations: spread(n, 2.0, seed + 9).into_iter().map(turn).collect(),
            kinds: (0..n).map(|k| u8::from(k % 3 == 0)).collect(),
            offset: 0.0,
            present: true,
        }
    }

    fn desc(&self, path: &str) -> InstancerDesc {
        let indices =
            |kind: u8| -> Vec<i32> { (0..).zip(&self.kinds).filter(|(_, k)| **k == kind).map(|(n, _)| n).collect() };
        let roots = [format!("{path}/a"), format!("{path}/b")];
        let mut desc = scatter(path, &self.at, &[(&roots[0], &indices(0)), (&roots[1], &indices(1))]);
        desc.scales = Some(TypedArray::of(self.scales.clone()));
        desc.rotations = Some(TypedArray::from_vec(ElementType::Quatf, self.rotations.clone()).unwrap());
        desc.prim.transform = DMat4::from_translation(DVec3::new(self.offset, 0.0, 0.0));
        desc
    }
}

/// The scene as it should be.
#[derive(Clone, Debug)]
struct Model {
    instancers: [Instancer; 4],
    /// Tag and place of single meshes.
    singles: BTreeMap<u8, (f32, [f32; 3])>,
    /// Shape of the prototypes' meshes.
    tags: [f32; 8],
    grid: u16,
}

const PATHS: [&str; 4] = ["/f0", "/f1", "/outer", "/outer/b/in"];

impl Model {
    fn new() -> Self {
        Self {
            instancers: [Instancer::new(700, 1), Instancer::new(150, 2), Instancer::new(9, 3), Instancer::new(650, 4)],
            singles: (0..20).map(|k| (k, (f32::from(k % 5), [f32::from(k) * 5.0, -40.0, 3.0]))).collect(),
            tags: [0.5, 0.75, 1.0, 1.25, 1.5, 1.75, 2.0, 2.25],
            grid: 3,
        }
    }

    /// Describes everything; unchanged descriptions are no edit.
    fn apply(&self, db: &mut SceneDb) {
        for (k, instancer) in self.instancers.iter().enumerate() {
            let path = PATHS[k];
            for (which, name) in ["a", "b"].into_iter().enumerate() {
                let root = format!("{path}/{name}");
                let mut mesh = triangle(&format!("{root}/m"), self.tags[2 * k + which]);
                mesh.prim.instanced_by = vec![by(path, &root)];
                db.upsert_mesh(mesh);
            }
            let mut desc = instancer.desc(path);
            if k == 3 {
                desc.prim.instanced_by = vec![by("/outer", "/outer/b")];
            }
            if instancer.present {
                db.upsert_instancer(desc);
            } else {
                db.remove(path);
            }
        }
        for k in 0..40 {
            let path = format!("/s/{k}");
            match self.singles.get(&k) {
                None => db.remove(&path),
                Some((tag, at)) => db.upsert_mesh(single(&path, *tag, *at)),
            }
        }
        // Keeps the origin where it is.
        let mut ground = grid("/ground", self.grid);
        ground.prim.transform =
            DMat4::from_scale(DVec3::new(400.0, 400.0, 1.0)) * DMat4::from_translation(DVec3::new(-0.5, -0.5, 0.0));
        db.upsert_mesh(ground);
    }
}

fn single(path: &str, tag: f32, at: [f32; 3]) -> MeshDesc {
    let mut mesh = triangle(path, tag);
    mesh.prim.transform = DMat4::from_translation(DVec3::from(at.map(f64::from)));
    mesh
}

/// An edit, from plain numbers.
#[derive(Clone, Copy, Debug)]
enum Edit {
    Move { which: usize, start: usize, count: usize, by: [f32; 3] },
    Gather { which: usize, start: usize, count: usize, to: [f32; 3] },
    Scale { which: usize, start: usize, count: usize, to: f32 },
    Grow { which: usize, count: usize, seed: u32 },
    Shrink { which: usize, count: usize },
    Swap { which: usize, start: usize, count: usize },
    Shift { which: usize, offset: f64 },
    Toggle { which: usize },
    Single { k: u8, tag: f32, at: [f32; 3] },
    Without { k: u8 },
    Shape { which: usize, tag: f32 },
    Ground { n: u16 },
    All { which: usize },
}

impl Edit {
    fn make(self, model: &mut Model) {
        let pick =
            |n: usize, start: usize, count: usize| (start..start + count).map(move |k| (k * 7) % n.max(1)).take(n);
        match self {
            Self::Move { which, start, count, by } => {
                let at = &mut model.instancers[which].at;
                pick(at.len(), start, count).for_each(|k| (0..3).for_each(|axis| at[k][axis] += by[axis]));
            }
            Self::Gather { which, start, count, to } => {
                let at = &mut model.instancers[which].at;
                pick(at.len(), start, count).for_each(|k| at[k] = to);
            }
            Self::Scale { which, start, count, to } => {
                let scales = &mut model.instancers[which].scales;
                pick(scales.len(), start, count).for_each(|k| scales[k] = [to; 3]);
            }
            Self::Grow { which, count, seed } => {
                let more = Instancer::new(count, seed);
                let one = &mut model.instancers[which];
                one.at.extend(more.at);
                one.scales.extend(more.scales);
                one.rotations.extend(more.rotations);
                one.kinds.extend(more.kinds);
            }
            Self::Shrink { which, count } => {
                let one = &mut model.instancers[which];
                let left = one.at.len().saturating_sub(count).max(1);
                one.at.truncate(left);
                one.scales.truncate(left);
                one.rotations.truncate(left);
                one.kinds.truncate(left);
            }
            Self::Swap { which, start, count } => {
                let kinds = &mut model.instancers[which].kinds;
                pick(kinds.len(), start, count).for_each(|k| kinds[k] ^= 1);
            }
            Self::Shift { which, offset } => model.instancers[which].offset = offset,
            Self::Toggle { which } => model.instancers[which].present ^= true,
            Self::Single { k, tag, at } => drop(model.singles.insert(k, (tag, at))),
            Self::Without { k } => drop(model.singles.remove(&k)),
            Self::Shape { which, tag } => model.tags[which] = tag,
            Self::Ground { n } => model.grid = n,
            Self::All { which } => {
                let at = &mut model.instancers[which].at;
                at.fill([1.0, 2.0, 3.0]);
            }
        }
    }
}

fn edit() -> impl Strategy<Value = Edit> {
    let point = || [-60.0_f32..60.0, -60.0_f32..60.0, -60.0_f32..60.0];
    let few = || prop_oneof![4 => 1_usize..4, 1 => 1_usize..60];
    // Tiny, usual, huge; singular, not finite.
    let size = prop_oneof![Just(1e-7_f32), Just(0.5), Just(30.0), Just(2.0e4), Just(0.0), Just(f32::NAN)];
    prop_oneof![
        6 => (0_usize..4, 0_usize..700, few(), point())
            .prop_map(|(which, start, count, by)| Edit::Move { which, start, count, by }),
        2 => (0_usize..4, 0_usize..700, 1_usize..400, point())
            .prop_map(|(which, start, count, to)| Edit::Gather { which, start, count, to }),
        3 => (0_usize..4, 0_usize..700, few(), size)
            .prop_map(|(which, start, count, to)| Edit::Scale { which, start, count, to }),
        2 => (0_usize..4, few(), 0_u32..99).prop_map(|(which, count, seed)| Edit::Grow { which, count, seed }),
        2 => (0_usize..4, few()).prop_map(|(which, count)| Edit::Shrink { which, count }),
        2 => (0_usize..4, 0_usize..700, few()).prop_map(|(which, start, count)| Edit::Swap { which, start, count }),
        1 => (0_usize..4, -50.0_f64..50.0).prop_map(|(which, offset)| Edit::Shift { which, offset }),
        1 => (0_usize..4).prop_map(|which| Edit::Toggle { which }),
        2 => (0_u8..40, 0.0_f32..9.0, point()).prop_map(|(k, tag, at)| Edit::Single { k, tag: tag.round(), at }),
        2 => (0_u8..40).prop_map(|k| Edit::Without { k }),
        1 => (0_usize..8, 0.5_f32..3.0).prop_map(|(which, tag)| Edit::Shape { which, tag }),
        1 => (2_u16..45).prop_map(|n| Edit::Ground { n }),
        1 => (0_usize..4).prop_map(|which| Edit::All { which }),
    ]
}

fn fresh(model: &Model) -> Arc<Snapshot> {
    fresh_within(model, u64::MAX)
}

/// The scene in a database that holds so many bytes of items at once.
fn fresh_within(model: &Model, item_bytes: u64) -> Arc<Snapshot> {
    let mut db = SceneDb::new();
    db.set_partition(SMALL);
    db.set_partition_memory(item_bytes);
    model.apply(&mut db);
    committed(&mut db)
}

proptest! {
    #![proptest_config(ProptestConfig { max_shrink_iters: 40, ..ProptestConfig::with_cases(12) })]
    #[test]
    fn edits_give_what_a_new_database_gives(steps in prop::collection::vec(prop::collection::vec(edit(), 1..3), 1..7)) {
        let mut model = Model::new();
        let mut db = SceneDb::new();
        db.set_partition(SMALL);
        model.apply(&mut db);
        let mut before = committed(&mut db);
        let mut in_stretches = SceneDb::new();
        in_stretches.set_partition(SMALL);
        in_stretches.set_partition_memory(1);
        model.apply(&mut in_stretches);
        let mut before_in_stretches = committed(&mut in_stretches);
        for step in steps {
            step.into_iter().for_each(|edit| edit.make(&mut model));
            model.apply(&mut db);
            let after = committed(&mut db);
            let alone = fresh(&model);
            assert_same_world(&alone, &after);
            let kept = assert_keys_tell(&before, &after);
            model.apply(&mut in_stretches);
            let after_in_stretches = committed(&mut in_stretches);
            assert_same_world(&alone, &after_in_stretches);
            let kept_in_stretches = assert_keys_tell(&before_in_stretches, &after_in_stretches);
            assert!(kept_in_stretches >= kept, "{kept_in_stretches} are kept, {kept} otherwise");
            before_in_stretches = after_in_stretches;
            for item_bytes in [1, ITEM * alone.counts.instance_records / 7, ITEM * alone.counts.instance_records] {
                assert_same_world(&alone, &fresh_within(&model, item_bytes));
            }
            before = after;
        }
        assert_same_leaves(flatten(&before), flatten_world(&before));
    }
}

#[test]
fn moving_one_instance_touches_where_it_was_and_where_it_goes() {
    let mut model = Model::new();
    let mut db = SceneDb::new();
    db.set_partition(SMALL);
    model.apply(&mut db);
    let before = committed(&mut db);
    // A little: within its chunk, most likely, and nothing else.
    model.instancers[0].at[300][2] += 0.01;
    model.apply(&mut db);
    let after = committed(&mut db);
    let (chunks, kept) = (after.world.chunks.len(), assert_keys_tell(&before, &after));
    assert!(chunks > 10 && kept + 1 >= chunks, "{kept} of {chunks} kept");
    // Across the scene.
    model.instancers[0].at[300] = [-45.0, 45.0, 45.0];
    model.apply(&mut db);
    let far = committed(&mut db);
    let (chunks, kept) = (far.world.chunks.len(), assert_keys_tell(&after, &far));
    assert!(kept + 3 >= chunks, "{kept} of {chunks} kept");
    assert_same_world(&fresh(&model), &far);
}

#[test]
fn prims_come_and_go_without_touching_other_chunks() {
    let mut model = Model::new();
    let mut db = SceneDb::new();
    db.set_partition(SMALL);
    model.apply(&mut db);
    let before = committed(&mut db);
    // Its path comes before all others of the singles.
    model.singles.insert(0, (1.0, [20.0, 20.0, 20.0]));
    model.singles.insert(30, (1.0, [-20.0, 20.0, 20.0]));
    model.apply(&mut db);
    let more = committed(&mut db);
    let (chunks, kept) = (more.world.chunks.len(), assert_keys_tell(&before, &more));
    assert!(kept + 4 >= chunks, "{kept} of {chunks} kept");
    model.singles.remove(&3);
    model.apply(&mut db);
    let less = committed(&mut db);
    let (chunks, kept) = (less.world.chunks.len(), assert_keys_tell(&more, &less));
    assert!(kept + 2 >= chunks, "{kept} of {chunks} kept");
    assert_same_world(&fresh(&model), &less);
}

/// A clump of instances leaves: the chunks around it are one now.
#[test]
fn what_is_left_around_an_emptied_chunk_is_cut_as_in_a_new_database() {
    // A cell of three chunks: one half, and both halves of the other.
    for [a, b, c] in [[60, 100, 60], [20, 120, 100], [30, 110, 90], [5, 125, 7]] {
        let clump = |count: usize, at: [f32; 3]| {
            spread(count, 1.0, 3).into_iter().map(move |p| [0, 1, 2].map(|k| p[k] + at[k]))
        };
        let others = clump(500, [-20.0; 3]).chain(clump(1, [-60.0; 3])).chain(clump(1, [60.0, -60.0, -60.0]));
        let left = clump(a, [2.0; 3]).chain(clump(c, [28.0, 2.0, 2.0]));
        let points =
            |at: [f32; 3]| -> Vec<[f32; 3]> { others.clone().chain(left.clone()).chain(clump(b, at)).collect() };
        let place = |db: &mut SceneDb, points: &[[f32; 3]]| {
            let all: Vec<i32> = (0..).take(points.len()).collect();
            db.upsert_instancer(scatter("/i", points, &[("/i/p", &all)]));
            committed(db)
        };
        let database = || {
            let mut db = SceneDb::new();
            db.set_partition(SMALL);
            let mut mesh = triangle("/i/p/m", 0.5);
            mesh.prim.instanced_by = vec![by("/i", "/i/p")];
            db.upsert_mesh(mesh);
            db
        };
        let near = |snapshot: &Snapshot| {
            let near = snapshot.world.chunks.iter().filter(|chunk| (0.0..40.0).contains(&chunk.origin().x));
            near.map(|chunk| chunk.len()).collect::<Vec<usize>>()
        };
        let mut db = database();
        let before = place(&mut db, &points([20.0, 2.0, 2.0]));
        assert_eq!(near(&before), [a, b, c], "before");
        let after = place(&mut db, &points([-20.2; 3]));
        assert_eq!(near(&after), [a + c], "after");
        assert_same_world(&place(&mut database(), &points([-20.2; 3])), &after);
    }
}

/// Another chunk size gives the result of a new database with it.
#[test]
fn the_chunk_size_may_change() {
    let model = Model::new();
    let mut db = SceneDb::new();
    for chunk_bytes in [16 << 10, 40 << 10, 8 << 20, 16 << 10] {
        let options = PartitionOptions { chunk_bytes };
        db.set_partition(options);
        model.apply(&mut db);
        let mut other = SceneDb::new();
        other.set_partition(options);
        model.apply(&mut other);
        assert_same_world(&committed(&mut other), &committed(&mut db));
    }
}
