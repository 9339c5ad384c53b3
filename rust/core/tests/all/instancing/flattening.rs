// SPDX-License-Identifier: Apache-2.0
//! Instancing against brute force: the answer is computed here from the descriptions, with other code.

use oocpt_abi::Features;
use std::sync::Arc;

use glam::{DMat4, DQuat, DVec3};
use oocpt_core::{ElementType, InstanceRecord, InstanceTarget, InstancerDesc, SceneDb, TypedArray};
use proptest::prelude::*;

use crate::support::{Leaf, by, committed, flatten, grid, records, scatter, triangle};

/// A placement as the descriptions say: prim id, world matrix, instance id.
type Expected = (i32, DMat4, i64);

fn assert_same(mut expected: Vec<Expected>, mut leaves: Vec<Leaf>) {
    assert_eq!(expected.len(), leaves.len());
    expected.sort_by_key(|(prim, _, id)| (*prim, *id));
    leaves.sort_by_key(|l| (l.prim_id, l.instance_id));
    for ((prim, world, id), leaf) in expected.iter().zip(&leaves) {
        assert_eq!((*prim, *id), (leaf.prim_id, leaf.instance_id));
        for triangle in &leaf.mesh.triangles {
            for vertex in triangle.vertices {
                let p = DVec3::from(vertex.map(f64::from));
                let (a, b) = (world.transform_point3(p), leaf.world.transform_point3(p));
                assert!((a - b).length() < 1e-4 * (1.0 + a.length()), "prim {prim} instance {id}: {a} and {b}");
            }
        }
    }
}

fn number(state: &mut u32) -> f64 {
    *state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
    f64::from(*state >> 8) / f64::from(1 << 24)
}

fn vector(state: &mut u32) -> DVec3 {
    DVec3::new(number(state), number(state), number(state)) * 4.0 - 2.0
}

fn quat(state: &mut u32) -> DQuat {
    DQuat::from_axis_angle((vector(state) + DVec3::new(0.0, 0.0, 3.0)).normalize(), 6.0 * number(state))
}

fn matrix(state: &mut u32) -> DMat4 {
    DMat4::from_scale_rotation_translation(vector(state).abs() + 0.3, quat(state), vector(state))
}

/// Gives an instancer `n` random instances through every kind of array, and their matrices.
fn fill(desc: &mut InstancerDesc, n: usize, state: &mut u32) -> Vec<DMat4> {
    desc.prim.transform = matrix(state);
    let (mut t, mut r, mut s, mut m, mut all) = (vec![], vec![], vec![], vec![], vec![]);
    for _ in 0..n {
        let translation = vector(state).as_vec3();
        let rotation = quat(state).as_quat();
        let scale = (vector(state).abs() + 0.3).as_vec3();
        let transform = matrix(state);
        t.push(translation.to_array());
        r.push((rotation * 2.0).to_array());
        s.push(scale.to_array());
        m.push(transform.to_cols_array_2d());
        let rotation = DQuat::from_array(rotation.to_array().map(f64::from)).normalize();
        all.push(
            DMat4::from_translation(translation.as_dvec3())
                * DMat4::from_quat(rotation)
                * DMat4::from_scale(scale.as_dvec3())
                * transform,
        );
    }
    desc.translations = Some(TypedArray::of(t));
    desc.rotations = Some(TypedArray::from_vec(ElementType::Quatf, r).unwrap());
    desc.scales = Some(TypedArray::of(s));
    desc.transforms = Some(TypedArray::of(m));
    all
}

/// Outer instancer of two prototypes: one mesh alone, and a pair of a mesh and an inner instancer.
#[test]
fn nested_instancers_equal_their_flattening() {
    let mut state = 7;
    let mut db = SceneDb::new();
    let mut outer = scatter("/outer", &[], &[("/outer/a", &[0, 2, 4]), ("/outer/b", &[1, 3])]);
    let outer_at = fill(&mut outer, 5, &mut state);
    let mut inner = scatter("/outer/b/inner", &[], &[("/outer/b/inner/p", &[3, 1, 0])]);
    let inner_at = fill(&mut inner, 4, &mut state);
    inner.prim.instanced_by = vec![by("/outer", "/outer/b")];
    let mut mesh = |path: &str, id: i32, parent: (&str, &str)| {
        let mut desc = grid(path, 2);
        desc.prim.instanced_by = vec![by(parent.0, parent.1)];
        desc.prim.transform = matrix(&mut state);
        desc.prim_id = id;
        desc
    };
    let alone = mesh("/outer/a/mesh", 1, ("/outer", "/outer/a"));
    let beside = mesh("/outer/b/mesh", 2, ("/outer", "/outer/b"));
    let leaf = mesh("/outer/b/inner/p/mesh", 3, ("/outer/b/inner", "/outer/b/inner/p"));

    let mut expected: Vec<Expected> = Vec::new();
    for (rank, i) in [0, 2, 4].into_iter().enumerate() {
        expected.push((1, outer.prim.transform * outer_at[i] * alone.prim.transform, i64::try_from(rank).unwrap()));
    }
    for (rank, i) in [1, 3].into_iter().enumerate() {
        let base = outer.prim.transform * outer_at[i];
        let id = i64::try_from(rank).unwrap();
        expected.push((2, base * beside.prim.transform, id));
        for (k, j) in [3, 1, 0].into_iter().enumerate() {
            let world = base * inner.prim.transform * inner_at[j] * leaf.prim.transform;
            expected.push((3, world, id * 3 + i64::try_from(k).unwrap()));
        }
    }
    for desc in [alone, beside, leaf] {
        db.upsert_mesh(desc);
    }
    db.upsert_instancer(inner);
    db.upsert_instancer(outer);
    let snapshot = committed(&mut db);
    assert_same(expected, flatten(&snapshot));
    // Kept nested: 3 + 2 records in the root, 1 + 3 in the prototype; the two single meshes needed no assembly.
    assert_eq!((snapshot.counts.instance_records, snapshot.assemblies.len(), snapshot.max_levels), (9, 2, 2));
    assert_eq!((snapshot.counts.instances, snapshot.counts.instanced_triangles), (3 + 2 + 6, 11 * 8));
    assert_eq!((snapshot.counts.meshes, snapshot.counts.unique_triangles), (1, 8), "the three grids are one asset");
    assert!(snapshot.features.contains(Features::INSTANCING));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]
    /// A chain of instancers, each placing the next one and a mesh, with masks.
    #[test]
    fn deep_nesting_equals_flattening(
        counts in prop::collection::vec(1_usize..4, 1..5),
        masks in prop::collection::vec(prop::collection::vec(prop::bool::weighted(0.8), 4), 5),
        seed: u32,
    ) {
        let mut state = seed;
        let mut db = SceneDb::new();
        let mut frames = vec![(DMat4::IDENTITY, 0_i64)];
        let mut expected = Vec::new();
        for (level, &n) in counts.iter().enumerate() {
            let path = format!("/i{level}");
            let root = format!("/i{level}/p");
            let indices: Vec<i32> = (0..i32::try_from(n).unwrap()).rev().collect();
            let mut desc = scatter(&path, &[], &[(&root, &indices)]);
            let at = fill(&mut desc, n, &mut state);
            let mask = &masks[level][..n];
            desc.mask = Some(TypedArray::from_bools(mask));
            let parent = level.checked_sub(1).map(|l| by(&format!("/i{l}"), &format!("/i{l}/p")));
            desc.prim.instanced_by.extend(parent);
            let shown: Vec<usize> = (0..n).rev().filter(|&i| mask[i]).collect();
            let ranks = i64::try_from(shown.len()).unwrap();
            frames = frames.iter().flat_map(|(frame, id)| {
                let base = *frame * desc.prim.transform;
                (0..).zip(&shown).map(|(rank, &i)| (base * at[i], id * ranks + rank)).collect::<Vec<_>>()
            }).collect();
            let mut mesh = grid(&format!("/m{level}"), 1);
            mesh.prim.instanced_by = vec![by(&path, &root)];
            mesh.prim_id = i32::try_from(level).unwrap();
            expected.extend(frames.iter().map(|(world, id)| (mesh.prim_id, *world, *id)));
            db.upsert_mesh(mesh);
            db.upsert_instancer(desc);
        }
        let snapshot = committed(&mut db);
        prop_assert_eq!(snapshot.counts.instances, expected.len() as u128);
        // Compare relative to the size of the scene: f32 inverses of chains lose some digits.
        let leaves = flatten(&snapshot);
        prop_assert_eq!(expected.len(), leaves.len());
        for (prim, world, id) in expected {
            let found = leaves.iter().find(|l| l.prim_id == prim && l.instance_id == id);
            let found = found.map(|l| l.world.transform_point3(DVec3::ONE)).unwrap_or(DVec3::INFINITY);
            let p = world.transform_point3(DVec3::ONE);
            prop_assert!((p - found).length() < 1e-3 * (1.0 + p.length()), "{} {} {} {}", prim, id, p, found);
        }
    }
}

#[test]
fn encode_in_pieces_equals_encode_whole() {
    let mut db = SceneDb::new();
    let points: Vec<[f32; 3]> = (0..100_u8).map(|k| [f32::from(k), 0.0, 0.0]).collect();
    let numbers: Vec<i32> = (0..100).collect();
    for name in ["a", "b"] {
        let (instancer, root) = (format!("/{name}"), format!("/{name}/p"));
        db.upsert_instancer(scatter(&instancer, &points, &[(&root, &numbers)]));
        let mut mesh = triangle(&format!("/{name}/p/m"), 0.5);
        mesh.prim.instanced_by = vec![by(&instancer, &root)];
        db.upsert_mesh(mesh);
        db.upsert_mesh(triangle(&format!("/{name}_alone"), 0.5));
    }
    let snapshot = committed(&mut db);
    let root = snapshot.assemblies.last().unwrap();
    let whole = records(&snapshot, snapshot.assemblies.len() - 1);
    assert_eq!(whole.len(), 202);
    let unset = InstanceRecord { prim_id: -77, ..InstanceRecord::default() };
    for (start, end) in [(0, 202), (0, 1), (99, 103), (100, 100), (150, 202), (201, 500), (300, 301)] {
        let mut piece = vec![unset; end - start];
        root.encode(start..end, &mut piece);
        let known = end.min(202).saturating_sub(start);
        assert_eq!(&piece[..known], &whole[start.min(202)..end.min(202)], "{start}..{end}");
        assert!(piece[known..].iter().all(|r| *r == unset), "nothing is written beyond the end");
    }
}

#[test]
fn mirrored_instances_are_flagged() {
    let mut db = SceneDb::new();
    let mut desc = scatter("/i", &[[0.0; 3]; 2], &[("/i/p", &[0, 1])]);
    desc.scales = Some(TypedArray::of(vec![[1.0_f32, 1.0, 1.0], [-1.0, 1.0, 1.0]]));
    db.upsert_instancer(desc);
    let mut mesh = triangle("/i/p/m", 0.0);
    mesh.prim.instanced_by = vec![by("/i", "/i/p")];
    db.upsert_mesh(mesh);
    let snapshot = committed(&mut db);
    let flags: Vec<_> = records(&snapshot, 0).iter().map(|r| r.flips_handedness).collect();
    assert_eq!(flags, [false, true]);
}

#[test]
fn a_prim_shared_by_several_prototypes_appears_in_each() {
    let mut db = SceneDb::new();
    db.upsert_instancer(scatter("/i", &[[0.0; 3], [5.0, 0.0, 0.0]], &[("/i/p", &[0, 1])]));
    db.upsert_instancer(scatter("/j", &[[0.0, 9.0, 0.0]], &[("/j/p", &[0])]));
    let mut mesh = triangle("/m", 0.0);
    mesh.prim.instanced_by = vec![by("/i", "/i/p"), by("/j", "/j/p"), by("/i", "/i/p")];
    db.upsert_mesh(mesh);
    assert_eq!(committed(&mut db).counts.instances, 3);
}

#[test]
fn far_scenes_get_an_origin_and_keep_their_digits() {
    let mut db = SceneDb::new();
    let at = DVec3::new(1.0e7, -2.0e7, 3.0e6);
    for (k, shift) in [(0.0, 0.0), (1.0, 0.001)] {
        let mut mesh = triangle(if k > 0.5 { "/b" } else { "/a" }, k);
        mesh.prim.transform = DMat4::from_translation(at + DVec3::splat(shift));
        db.upsert_mesh(mesh);
    }
    let snapshot = committed(&mut db);
    assert!((snapshot.origin - at).length() < 10.0, "{}", snapshot.origin);
    let leaves = flatten(&snapshot);
    let gap = leaves[1].world.transform_point3(DVec3::ZERO) - leaves[0].world.transform_point3(DVec3::ZERO);
    assert!((gap - DVec3::splat(0.001)).length() < 1e-6, "{gap}");

    // Moving one prim a little does not move the origin; a scene near the world's origin keeps it there.
    let mut mesh = triangle("/b", 1.0);
    mesh.prim.transform = DMat4::from_translation(at + DVec3::X);
    db.upsert_mesh(mesh);
    assert_eq!(committed(&mut db).origin, snapshot.origin);
    let mut near = SceneDb::new();
    near.upsert_mesh(triangle("/a", 0.0));
    assert_eq!(committed(&mut near).origin, DVec3::ZERO);
}

#[test]
fn arrays_are_borrowed_until_the_snapshot_goes() {
    let mut db = SceneDb::new();
    let source: Arc<dyn oocpt_core::ArraySource> = Arc::new(Bytes(vec![0; 1200]));
    let mut desc = scatter("/i", &[], &[("/i/p", &[0, 99])]);
    desc.translations = Some(TypedArray::new(ElementType::Vec3f, source.clone()).unwrap());
    db.upsert_instancer(desc);
    let mut mesh = triangle("/i/p/m", 0.0);
    mesh.prim.instanced_by = vec![by("/i", "/i/p")];
    db.upsert_mesh(mesh);
    let snapshot = committed(&mut db);
    assert!(Arc::strong_count(&source) > 1);
    db.remove("/i");
    drop(db.commit());
    assert_eq!(records(&snapshot, 0).len(), 2, "an old snapshot stays whole");
    drop(snapshot);
    assert_eq!(Arc::strong_count(&source), 1);
}

#[derive(Debug)]
struct Bytes(Vec<u8>);

impl oocpt_core::ArraySource for Bytes {
    fn bytes(&self) -> &[u8] {
        &self.0
    }
}

#[test]
fn pick_targets_of_prototype_members_are_their_prims() {
    let mut db = SceneDb::new();
    db.upsert_instancer(scatter("/i", &[[0.0; 3]], &[("/i/p", &[0])]));
    for name in ["/i/p/a", "/i/p/b"] {
        let mut mesh = triangle(name, if name.ends_with('a') { 0.0 } else { 1.0 });
        mesh.prim.instanced_by = vec![by("/i", "/i/p")];
        db.upsert_mesh(mesh);
    }
    let snapshot = committed(&mut db);
    assert_eq!(records(&snapshot, 1)[0].target, InstanceTarget::Assembly(0));
    assert_eq!(records(&snapshot, 1)[0].prim_id, -1);
    let below: Vec<_> = records(&snapshot, 0).iter().map(|r| (r.target, r.prim_id, r.prototype_count)).collect();
    assert_eq!(below, [(InstanceTarget::Mesh(0), 7, 1), (InstanceTarget::Mesh(1), 7, 1)]);
}
