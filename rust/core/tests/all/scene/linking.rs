// SPDX-License-Identifier: Apache-2.0
//! Light linking of instances: the collections of each placement, by prim id and instance id.

use std::collections::BTreeMap;
use std::sync::Arc;

use oocpt_core::scene::InstanceLinks;
use oocpt_core::{InstancerDesc, LightDesc, MeshDesc, PrimDesc, SceneDb, Snapshot, TypedArray};

use crate::support::{by, committed, flatten, prim, scatter, triangle};

fn links(sets: &[&[&str]], of: &[u32]) -> Arc<InstanceLinks> {
    let set = |set: &&[&str]| set.iter().map(|name| Arc::from(*name)).collect();
    Arc::new(InstanceLinks { sets: sets.iter().map(set).collect(), of: (!of.is_empty()).then(|| of.to_vec()) })
}

fn lamp(path: &str, light_link: &str, shadow_link: Option<&str>) -> LightDesc {
    LightDesc {
        prim: PrimDesc { path: path.into(), ..PrimDesc::default() },
        light_link: Some(light_link.into()),
        shadow_link: shadow_link.map(Into::into),
        ..LightDesc::default()
    }
}

fn below(mesh: MeshDesc, prim_id: i32, instancer: &str, root: &str) -> MeshDesc {
    MeshDesc { prim: PrimDesc { instanced_by: vec![by(instancer, root)], ..mesh.prim }, prim_id, ..mesh }
}

/// The collections that each placement is in, by the prim id that is shown and the instance id.
fn seen(snapshot: &Snapshot) -> BTreeMap<(i32, i64), Vec<String>> {
    let tables = &snapshot.surfaces;
    let of = |prim_id: i32| {
        let record = tables.prims.get(usize::try_from(prim_id + 1).unwrap()).copied().unwrap_or_default();
        let set = tables.category_sets.get(record.category_set as usize).cloned().unwrap_or_default();
        (record.shown_as.unwrap_or(prim_id), set.iter().map(ToString::to_string).collect())
    };
    let found: BTreeMap<_, _> = flatten(snapshot)
        .iter()
        .map(|leaf| {
            let (shown, set) = of(leaf.prim_id);
            ((shown, leaf.instance_id), set)
        })
        .collect();
    assert_eq!(found.len(), flatten(snapshot).len(), "ids are told apart");
    found
}

fn expected(rows: &[(i32, i64, &[&str])]) -> BTreeMap<(i32, i64), Vec<String>> {
    rows.iter().map(|(prim, id, set)| ((*prim, *id), set.iter().map(ToString::to_string).collect())).collect()
}

const FOUR: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [6.0, 0.0, 0.0], [9.0, 0.0, 0.0]];

/// Four instances of two meshes, in three sets, of which one has a name that no light has.
fn row() -> SceneDb {
    let mut db = SceneDb::new();
    db.upsert_mesh(below(triangle("/i/a", 0.0), 3, "/i", "/i"));
    db.upsert_mesh(below(triangle("/i/b", 0.5), 4, "/i", "/i"));
    let links = links(&[&["red"], &["blue", "other"], &["other"]], &[0, 1, 2, 0]);
    db.upsert_instancer(InstancerDesc { links, ..scatter("/i", &FOUR, &[("/i", &[3, 2, 1, 0])]) });
    db.upsert_light(lamp("/l", "red", Some("blue")));
    db
}

#[test]
fn instances_are_in_the_collections_of_their_own() {
    let rows: Vec<(i32, i64, &[&str])> = [3, 4]
        .into_iter()
        .flat_map(|id| [(id, 0, &["red"][..]), (id, 1, &[]), (id, 2, &["blue"]), (id, 3, &["red"])])
        .collect();
    assert_eq!(seen(&committed(&mut row())), expected(&rows), "instance 3 - k is number k of the prototype's");
}

#[test]
fn masked_instances_keep_the_ids_of_the_others() {
    let mut db = row();
    let links = links(&[&["red"], &[]], &[0, 1, 0, 1]);
    let mask = Some(TypedArray::from_bools(&[true, false, true, true]));
    db.upsert_instancer(InstancerDesc { links, mask, ..scatter("/i", &FOUR, &[("/i", &[0, 1, 2, 3])]) });
    let rows: Vec<(i32, i64, &[&str])> =
        [3, 4].into_iter().flat_map(|id| [(id, 0, &["red"][..]), (id, 1, &["red"]), (id, 2, &[])]).collect();
    assert_eq!(seen(&committed(&mut db)), expected(&rows), "as without links: of those that the mask leaves");
}

#[test]
fn collections_of_outer_and_inner_instances_combine() {
    let mut db = SceneDb::new();
    db.upsert_mesh(below(triangle("/o/i/a", 0.0), 9, "/o/i", "/o/i"));
    let own = MeshDesc { categories: vec!["green".into()], ..triangle("/o/own", 0.5) };
    db.upsert_mesh(below(own, 2, "/o", "/o"));
    let inner = InstancerDesc {
        prim: PrimDesc { instanced_by: vec![by("/o", "/o")], ..prim("/o/i") },
        links: links(&[&["blue"], &[]], &[0, 1]),
        ..scatter("/o/i", &FOUR[..2], &[("/o/i", &[0, 1])])
    };
    db.upsert_instancer(inner);
    let outer = InstancerDesc {
        links: links(&[&[], &["red"]], &[0, 1]),
        ..scatter("/o", &[[0.0; 3], [0.0, 5.0, 0.0]], &[("/o", &[0, 1])])
    };
    db.upsert_instancer(outer);
    for (path, name) in [("/l", "red"), ("/m", "blue"), ("/n", "green")] {
        db.upsert_light(lamp(path, name, None));
    }
    let rows: &[(i32, i64, &[&str])] = &[
        (9, 0, &["blue"]),
        (9, 1, &[]),
        (9, 2, &["blue", "red"]),
        (9, 3, &["red"]),
        (2, 0, &["green"]),
        (2, 1, &["green", "red"]),
    ];
    assert_eq!(seen(&committed(&mut db)), expected(rows));
}

#[test]
fn unlinked_prims_keep_prim_ids_and_instance_runs() {
    let mut db = row();
    db.remove("/l");
    let snapshot = committed(&mut db);
    assert!(snapshot.surfaces.prims.is_empty(), "{:?}", snapshot.surfaces.prims);
    let mut ids: Vec<(i32, i64)> = flatten(&snapshot).iter().map(|leaf| (leaf.prim_id, leaf.instance_id)).collect();
    ids.sort_unstable();
    let all: Vec<(i32, i64)> = [3, 4].into_iter().flat_map(|prim| (0..4).map(move |id| (prim, id))).collect();
    assert_eq!(ids, all);
    assert_eq!(snapshot.counts.instance_records, 2 + 4, "one group of two, placed four times");
}

#[test]
fn link_edits_update_the_placements() {
    let mut db = row();
    committed(&mut db);
    let links = links(&[&["blue"]], &[]);
    db.upsert_instancer(InstancerDesc { links, ..scatter("/i", &FOUR, &[("/i", &[3, 2, 1, 0])]) });
    let rows: Vec<(i32, i64, &[&str])> =
        [3, 4].into_iter().flat_map(|prim| (0..4).map(move |id| (prim, id, &["blue"][..]))).collect();
    assert_eq!(seen(&committed(&mut db)), expected(&rows), "all alike");
    db.upsert_light(lamp("/l", "red", None));
    let none: Vec<(i32, i64, &[&str])> =
        [3, 4].into_iter().flat_map(|prim| (0..4).map(move |id| (prim, id, &[][..]))).collect();
    assert_eq!(seen(&committed(&mut db)), expected(&none), "no light names it any more");
}
