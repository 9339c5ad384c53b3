// SPDX-License-Identifier: Apache-2.0
//! Cycles, missing parents, depth: invalid hierarchies are cut where they become invalid.

use oocpt_core::{DroppedData, SceneDb};

use crate::support::{NONE, by, committed, outcome, scatter, triangle, with_instancer};

#[test]
fn instancer_cycles_are_found_even_if_unreachable() {
    // a and b contain each other; b is also placed by the root instancer c.
    for reachable in [false, true] {
        let mut db = SceneDb::new();
        for (path, parents) in [("/a", vec![by("/b", "/b/p")]), ("/b", vec![by("/a", "/a/p"), by("/c", "/c/p")])] {
            let mut desc = scatter(path, &[[0.0; 3]], &[(&format!("{path}/p"), &[0])]);
            desc.prim.instanced_by = parents;
            if !reachable {
                desc.prim.instanced_by.truncate(1);
            }
            db.upsert_instancer(desc);
        }
        db.upsert_instancer(scatter("/c", &[[0.0; 3]], &[("/c/p", &[0])]));
        let mut mesh = triangle("/m", 0.0);
        mesh.prim.instanced_by = vec![by("/b", "/b/p")];
        db.upsert_mesh(mesh);
        let (left, dropped, warned) = outcome(&mut db);
        assert_eq!(left, u128::from(reachable), "the mesh of b is left when c places it");
        assert_eq!(dropped.instancer_cycles, if reachable { 1 } else { 2 });
        assert!(warned.contains(&"/b".to_owned()), "{warned:?}");
    }
    let mut own = scatter("/i", &[[0.0; 3]], &[("/i/p", &[0])]);
    own.prim.instanced_by = vec![by("/i", "/i/p")];
    let (left, dropped, _) = outcome(&mut with_instancer(own));
    assert_eq!((left, dropped.instancer_cycles), (0, 1));
}

#[test]
fn a_hidden_parent_is_not_a_cycle() {
    let mut db = with_instancer(scatter("/i", &[[0.0; 3]], &[("/i/p", &[0])]));
    let mut hidden = scatter("/h", &[[0.0; 3]], &[("/h/p", &[0])]);
    hidden.prim.visible = false;
    db.upsert_instancer(hidden);
    let mut below = scatter("/h/p/i", &[[0.0; 3]], &[("/h/p/i/p", &[0])]);
    below.prim.instanced_by = vec![by("/h", "/h/p")];
    db.upsert_instancer(below);
    assert_eq!(outcome(&mut db), (1, NONE, vec![]));
}

#[test]
fn very_deep_nesting_is_cut_with_a_warning() {
    let mut db = SceneDb::new();
    for level in 0..10_000 {
        let mut desc = scatter(&format!("/i{level}"), &[[0.0; 3]], &[(&format!("/i{level}/p"), &[0])]);
        if level > 0 {
            desc.prim.instanced_by = vec![by(&format!("/i{}", level - 1), &format!("/i{}/p", level - 1))];
        }
        let mut mesh = triangle(&format!("/m{level}"), 0.0);
        mesh.prim.instanced_by = vec![by(&format!("/i{level}"), &format!("/i{level}/p"))];
        db.upsert_mesh(mesh);
        db.upsert_instancer(desc);
    }
    let snapshot = committed(&mut db);
    assert_eq!(snapshot.dropped, DroppedData { deep_instancers: 1, ..NONE });
    assert!(snapshot.max_levels <= oocpt_core::scene::MAX_NESTING, "{}", snapshot.max_levels);
    assert!(snapshot.counts.instances > 20, "what is above the cut is shown");
}

#[test]
fn wide_nesting_counts_beyond_64_bits() {
    let mut db = SceneDb::new();
    for level in 0..25 {
        let numbers: Vec<i32> = (0..10).collect();
        let mut desc = scatter(&format!("/i{level}"), &[[1.0; 3]; 10], &[(&format!("/i{level}/p"), &numbers)]);
        if level > 0 {
            desc.prim.instanced_by = vec![by(&format!("/i{}", level - 1), &format!("/i{}/p", level - 1))];
        }
        db.upsert_instancer(desc);
    }
    let mut mesh = triangle("/m", 0.0);
    mesh.prim.instanced_by = vec![by("/i24", "/i24/p")];
    db.upsert_mesh(mesh);
    let snapshot = committed(&mut db);
    assert_eq!(snapshot.counts.instances, 10_u128.pow(25));
    assert_eq!(snapshot.counts.instance_records, 250);
}

#[test]
fn missing_instancers_and_prototypes_are_reported() {
    let mut db = with_instancer(scatter("/i", &[[0.0; 3]], &[("/i/p", &[0])]));
    let mut mesh = triangle("/lost", 0.0);
    mesh.prim.instanced_by = vec![by("/nowhere", "/p"), by("/i", "/i/other")];
    db.upsert_mesh(mesh);
    let (left, dropped, warned) = outcome(&mut db);
    assert_eq!((left, dropped), (1, DroppedData { missing_instancers: 2, ..NONE }));
    assert_eq!(warned, ["/lost"]);
}

#[test]
fn a_prototype_without_valid_instances_does_not_affect_its_parent() {
    let mut db = with_instancer(scatter("/i", &[[0.0; 3]], &[("/i/p", &[0])]));
    let mut inner = scatter("/i/p/j", &[[f32::NAN; 3]], &[("/i/p/j/p", &[0])]);
    inner.prim.instanced_by = vec![by("/i", "/i/p")];
    db.upsert_instancer(inner);
    let mut mesh = triangle("/i/p/j/p/m", 0.0);
    mesh.prim.instanced_by = vec![by("/i/p/j", "/i/p/j/p")];
    db.upsert_mesh(mesh);
    let (left, dropped, _) = outcome(&mut db);
    assert_eq!((left, dropped), (1, DroppedData { instance_transforms: 1, ..NONE }));
    db.remove("/i/p/m");
    let (left, dropped, _) = outcome(&mut db);
    assert_eq!((left, dropped), (0, DroppedData { instance_transforms: 1, ..NONE }));
    assert_eq!(db.snapshot().max_levels, 1);
}
