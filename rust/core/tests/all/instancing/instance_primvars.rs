// SPDX-License-Identifier: Apache-2.0
//! Primvars with a value per instance: who gets which, what is left out, and what an edit touches.

use oocpt_abi::{Features, NAME_DISPLAY_COLOR, NO_ROW, NO_VALUE};
use std::sync::Arc;

use crate::support::{by, committed, constant, scatter, triangle};
use oocpt_core::partition::{Chunk, PartitionOptions};
use oocpt_core::scene::{InstanceColumn, NamedPrimvar};
use oocpt_core::{
    ArrayElement, InstanceRecord, InstancerDesc, Interpolation, MeshDesc, Primvar, SceneDb, Snapshot, TypedArray,
};

const COLOR: InstanceColumn = InstanceColumn { id: NAME_DISPLAY_COLOR, width: 3 };

fn per_instance<T: ArrayElement + std::fmt::Debug>(
    mut desc: InstancerDesc,
    name: &str,
    values: Vec<T>,
) -> InstancerDesc {
    let primvar = Primvar { interpolation: Interpolation::Instance, values: TypedArray::of(values), indices: None };
    desc.primvars.push(NamedPrimvar { name: name.into(), primvar });
    desc
}

fn line(count: u16) -> Vec<[f32; 3]> {
    (0..count).map(|k| [3.0 * f32::from(k), 0.0, 0.0]).collect()
}

fn colors(count: u16) -> Vec<[f32; 3]> {
    (0..count).map(|k| [f32::from(k), 0.5, 0.25]).collect()
}

/// A mesh in the prototype `/i/p` of `/i`.
fn leaf(path: &str, instancer: &str, root: &str) -> MeshDesc {
    let mut mesh = triangle(path, 0.0);
    mesh.prim.instanced_by = vec![by(instancer, root)];
    mesh
}

fn row(count: u16) -> InstancerDesc {
    let numbers: Vec<i32> = (0..i32::from(count)).collect();
    scatter("/i", &line(count), &[("/i/p", &numbers)])
}

/// Rank of each record of the root, and the first float of its colour; `None` without.
fn root_colors(snapshot: &Snapshot) -> Vec<(u32, Option<f32>)> {
    let mut all = Vec::new();
    for chunk in &snapshot.world.chunks {
        let mut records = vec![InstanceRecord::default(); chunk.len()];
        chunk.encode(0..chunk.len(), &mut records);
        let mut values = vec![-1.0; 3 * chunk.len()];
        chunk.encode_values(COLOR, 0..chunk.len(), &mut values);
        for (record, value) in records.iter().zip(values.chunks(3)) {
            let value = (value[0].to_bits() != NO_VALUE).then_some(value[0]);
            all.push((record.index_in_prototype, value));
        }
    }
    all.sort_by_key(|(rank, _)| *rank);
    all
}

#[test]
fn every_record_has_the_value_of_its_instance() {
    let mut db = SceneDb::new();
    db.set_partition(PartitionOptions { chunk_bytes: 1 });
    db.upsert_mesh(leaf("/i/p", "/i", "/i/p"));
    let mut desc = per_instance(row(1000), "displayColor", colors(1000));
    let mask: Vec<bool> = (0..1000).map(|k| k % 3 != 1).collect();
    desc.mask = Some(TypedArray::from_bools(&mask));
    db.upsert_instancer(desc);
    let snapshot = committed(&mut db);
    assert!(snapshot.world.chunks.len() > 3, "several chunks");
    let shown: Vec<usize> = (0..1000).filter(|k| mask[*k]).collect();
    let found = root_colors(&snapshot);
    assert_eq!(found.len(), shown.len());
    for (rank, value) in found {
        #[expect(clippy::cast_precision_loss, reason = "up to 1000")]
        let expected = shown[rank as usize] as f32;
        assert_eq!(value, Some(expected), "rank {rank}");
    }
    assert!(snapshot.features.contains(Features::INSTANCE_PRIMVARS));
    assert_eq!(snapshot.assemblies.last().map(|a| a.device_bytes()), Some(found_bytes(shown.len())));
}

/// 128 bytes of a record and its node, 12 of a colour.
fn found_bytes(records: usize) -> u64 {
    140 * records as u64
}

#[test]
fn a_mesh_that_has_its_own_takes_none() {
    let mut db = SceneDb::new();
    db.upsert_mesh(MeshDesc { display_color: Some(constant([1.0_f32; 3])), ..leaf("/i/p", "/i", "/i/p") });
    db.upsert_instancer(per_instance(row(4), "displayColor", colors(4)));
    let snapshot = committed(&mut db);
    assert!(snapshot.world.chunks.iter().all(|chunk| chunk.columns().is_empty()));
    assert!(!snapshot.features.contains(Features::INSTANCE_PRIMVARS));
    // An empty array is none, as front ends say it.
    let empty = Primvar {
        interpolation: Interpolation::Constant,
        values: TypedArray::of::<[f32; 3]>(Vec::new()),
        indices: None,
    };
    db.upsert_mesh(MeshDesc { display_color: Some(empty), ..leaf("/i/p", "/i", "/i/p") });
    assert_eq!(root_colors(&committed(&mut db))[2].1, Some(2.0));
}

#[test]
fn the_innermost_level_that_has_it_gives_it() {
    let mut db = SceneDb::new();
    // Both levels have colours: only the inner one's are kept.
    let mut inner = scatter("/i/p", &line(3), &[("/i/p/q", &[0, 1, 2])]);
    inner.prim.instanced_by = vec![by("/i", "/i/p")];
    db.upsert_mesh(leaf("/i/p/q", "/i/p", "/i/p/q"));
    db.upsert_instancer(per_instance(inner.clone(), "displayColor", colors(3)));
    db.upsert_instancer(per_instance(row(5), "displayColor", colors(5)));
    let snapshot = committed(&mut db);
    assert_eq!(snapshot.assemblies[0].columns(), [COLOR]);
    assert!(root_colors(&snapshot).iter().all(|(_, value)| value.is_none()), "nobody reads the outer ones");
    let mut values = [0.0; 6];
    snapshot.assemblies[0].encode_values(COLOR, 1..3, &mut values);
    assert_eq!(values, [1.0, 0.5, 0.25, 2.0, 0.5, 0.25]);
    // Without them, the outer one's.
    db.upsert_instancer(inner);
    let snapshot = committed(&mut db);
    assert!(snapshot.assemblies[0].columns().is_empty());
    assert_eq!(root_colors(&snapshot)[4].1, Some(4.0));
}

#[test]
fn opened_assemblies_get_a_value_table() {
    let mut db = SceneDb::new();
    db.set_partition(PartitionOptions { chunk_bytes: 1 });
    let numbers: Vec<i32> = (0..2000).collect();
    let mut inner = scatter("/i/p", &line(2000), &[("/i/p/q", &numbers)]);
    inner.prim.instanced_by = vec![by("/i", "/i/p")];
    db.upsert_mesh(leaf("/i/p/q", "/i/p", "/i/p/q"));
    db.upsert_instancer(inner);
    db.upsert_instancer(per_instance(row(3), "displayColor", colors(3)));
    let first = committed(&mut db);
    let placed = &first.world.placed;
    assert_eq!((placed.columns.as_slice(), placed.rows()), (&[COLOR][..], 3));
    assert!(first.world.opened.len() == 2 && first.world.instances.len() >= 6, "the inner one is opened");
    for instance in &first.world.instances {
        assert_ne!(instance.row, NO_ROW);
        let red = f32::from_bits(placed.values[0][3 * instance.row as usize]);
        #[expect(clippy::cast_precision_loss, reason = "0, 1 or 2")]
        let expected = instance.instance_id as f32;
        assert_eq!(red, expected);
    }
    // Other colours: the chunks stay, and so do the instances.
    db.upsert_instancer(per_instance(row(3), "displayColor", vec![[9.0_f32; 3]; 3]));
    let second = committed(&mut db);
    assert!(second.version > first.version && second.world.placed != first.world.placed);
    assert!(first.world.chunks.iter().zip(&second.world.chunks).all(|(a, b)| Arc::ptr_eq(a, b)));
}

#[test]
fn an_edit_of_values_touches_the_chunks_that_have_them() {
    let mut db = SceneDb::new();
    db.set_partition(PartitionOptions { chunk_bytes: 1 });
    db.upsert_mesh(leaf("/i/p", "/i", "/i/p"));
    let mut values = colors(2000);
    db.upsert_instancer(per_instance(row(2000), "displayColor", values.clone()));
    let first = committed(&mut db);
    // The same again changes nothing.
    db.upsert_instancer(per_instance(row(2000), "displayColor", values.clone()));
    assert!(Arc::ptr_eq(&committed(&mut db), &first), "equal contents");
    values[1234][0] = -7.0;
    db.upsert_instancer(per_instance(row(2000), "displayColor", values));
    let second = committed(&mut db);
    let keys = |s: &Snapshot| s.world.chunks.iter().map(|chunk| chunk.key()).collect::<Vec<_>>();
    let (before, after) = (keys(&first), keys(&second));
    assert!(before.len() > 10 && before.len() == after.len());
    assert_eq!(before.iter().zip(&after).filter(|(a, b)| a != b).count(), 1, "one chunk has another value");
    assert_eq!(root_colors(&second)[1234].1, Some(-7.0));
    assert_eq!(root_colors(&second)[1233].1, Some(1233.0), "the others are as before");
    assert!(Arc::ptr_eq(&first.meshes[0], &second.meshes[0]), "no mesh is built again");
    assert_eq!(first.world.top.nodes, second.world.top.nodes, "nothing moved");
    // A move and other values at once, then none at all.
    let mut moved = row(2000);
    let mut places = line(2000);
    places[77][1] = 1.0;
    moved.translations = Some(TypedArray::of(places));
    let third = {
        db.upsert_instancer(per_instance(moved, "displayColor", colors(2000)));
        committed(&mut db)
    };
    assert_eq!((root_colors(&third)[1234].1, root_colors(&third)[77].1), (Some(1234.0), Some(77.0)));
    db.upsert_instancer(row(2000));
    assert!(committed(&mut db).world.chunks.iter().all(|chunk| chunk.columns().is_empty()));
}

#[test]
fn unusable_instance_primvars_are_reported_with_their_name() {
    let mut db = SceneDb::new();
    db.upsert_mesh(leaf("/i/p", "/i", "/i/p"));
    db.upsert_instancer(per_instance(row(4), "displayColor", colors(3)));
    let commit = db.commit();
    assert_eq!(commit.snapshot.dropped.primvars, 1, "too short");
    assert_eq!(commit.warnings.len(), 1, "{:?}", commit.warnings);
    let mut values = colors(4);
    values[1] = [f32::NAN, 1.0, 1.0];
    values[3] = [f32::INFINITY, 1.0, 1.0];
    db.upsert_instancer(per_instance(row(4), "displayColor", values));
    let snapshot = committed(&mut db);
    assert_eq!((snapshot.dropped.primvars, snapshot.dropped.primvar_values), (0, 2));
    let found: Vec<_> = root_colors(&snapshot).into_iter().map(|(_, value)| value).collect();
    assert_eq!(found, [Some(0.0), Some(0.0), Some(2.0), Some(0.0)], "bad values are 0");
    // Indices out of range and of the wrong sign.
    let mut desc = per_instance(row(4), "displayColor", colors(2));
    desc.primvars[0].primvar.indices = Some(TypedArray::of(vec![1, -1, 2, 0]));
    db.upsert_instancer(desc);
    let snapshot = committed(&mut db);
    assert_eq!(snapshot.dropped.primvar_values, 2);
    assert_eq!(root_colors(&snapshot)[0].1, Some(1.0));
    // Other interpolations are not for instances, and not read.
    let mut desc = row(4);
    desc.primvars = vec![NamedPrimvar { name: "displayColor".into(), primvar: constant([1.0_f32; 3]) }];
    db.upsert_instancer(desc);
    let snapshot = committed(&mut db);
    assert_eq!((snapshot.dropped.total(), root_colors(&snapshot)[0].1), (0, None));
}

#[test]
fn opacities_of_one_need_no_table() {
    let mut db = SceneDb::new();
    db.upsert_mesh(leaf("/i/p", "/i", "/i/p"));
    db.upsert_instancer(per_instance(row(4), "displayOpacity", vec![1.0_f32; 4]));
    assert_eq!(committed(&mut db).features & (Features::OPACITY | Features::INSTANCE_PRIMVARS), Features::empty());
    db.upsert_instancer(per_instance(row(4), "displayOpacity", vec![1.0_f32, 1.0, 0.5, 1.0]));
    let snapshot = committed(&mut db);
    assert!(snapshot.features.contains(Features::OPACITY | Features::INSTANCE_OPACITY));
    assert_eq!(snapshot.world.chunks[0].columns().len(), 1);
}

/// A large edit beside others that change values alone: chunks of the latter are not taken for what they were.
#[test]
fn values_update_beside_a_large_edit_sorted_in_stretches() {
    let mut db = SceneDb::new();
    db.set_partition(PartitionOptions { chunk_bytes: 1 });
    db.set_partition_memory(1);
    let far: Vec<[f32; 3]> = (0..600_u16).map(|k| [1000.0 + f32::from(k), 50.0, 0.0]).collect();
    let numbers: Vec<i32> = (0..600).collect();
    let others = |points: &[[f32; 3]]| scatter("/j", points, &[("/j/p", &numbers)]);
    db.upsert_mesh(leaf("/i/p/m", "/i", "/i/p"));
    db.upsert_mesh(leaf("/j/p/m", "/j", "/j/p"));
    db.upsert_instancer(per_instance(row(300), "displayColor", colors(300)));
    db.upsert_instancer(others(&far));
    let before: Vec<u64> = committed(&mut db).world.chunks.iter().map(|chunk| chunk.key()).collect();
    let mut changed = colors(300);
    changed[7][0] = 5000.0;
    db.upsert_instancer(per_instance(row(300), "displayColor", changed));
    db.upsert_instancer(others(&far.iter().map(|p| p.map(|v| v + 1.0)).collect::<Vec<_>>()));
    let after = committed(&mut db);
    let of_row: Vec<f32> = root_colors(&after).into_iter().filter_map(|(_, value)| value).collect();
    assert_eq!(of_row.len(), 300, "values of the row");
    assert!(of_row.contains(&5000.0), "the new value");
    assert!(!of_row.contains(&7.0), "the old value is gone");
    let has_it = |chunk: &Chunk| {
        let mut values = vec![0.0; 3 * chunk.len()];
        chunk.encode_values(COLOR, 0..chunk.len(), &mut values);
        values.contains(&5000.0)
    };
    let (new, rest): (Vec<_>, Vec<_>) = after.world.chunks.iter().partition(|chunk| has_it(chunk));
    assert!(new.iter().all(|chunk| !before.contains(&chunk.key())), "other values, another key");
    assert!(rest.iter().any(|chunk| before.contains(&chunk.key())), "the row's others are kept");
}
