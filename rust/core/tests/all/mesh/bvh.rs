// SPDX-License-Identifier: Apache-2.0
//! Mesh hierarchies: invariants, their checker, and a walk against brute force.

use glam::Vec3;
use oocpt_core::mesh::LeafKind;
use oocpt_core::mesh::bvh::{MAX_DEPTH, MAX_LEAF_TRIANGLES, build_bvh};
use oocpt_core::{Bvh2, BvhError, Triangle};
use proptest::prelude::*;

fn ordered(triangles: &[Triangle]) -> (Bvh2, Vec<Triangle>) {
    let (bvh, order) = build_bvh(triangles, LeafKind::Triangles);
    let ordered = order.iter().map(|&i| triangles[i as usize]).collect();
    (bvh, ordered)
}

pub(crate) fn soup(n: u32, spread: f32) -> Vec<Triangle> {
    let mut state = 1_u32;
    let mut next = move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        oocpt_abi::sampler::unit_float(state)
    };
    (0..n)
        .map(|face| {
            let center = Vec3::new(next(), next(), next()) * spread;
            let vertices = [(); 3].map(|()| (center + Vec3::new(next(), next(), next())).to_array());
            Triangle { vertices, face }
        })
        .collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]
    #[test]
    fn every_triangle_is_in_one_leaf_in_exact_boxes(n in 1_u32..400, spread in prop_oneof![Just(0.0_f32), Just(30.0)]) {
        let triangles = soup(n, spread);
        let (bvh, ordered) = ordered(&triangles);
        prop_assert_eq!(bvh.validate(&ordered, LeafKind::Triangles), Ok(()));
        let mut faces: Vec<u32> = ordered.iter().map(|t| t.face).collect();
        faces.sort_unstable();
        prop_assert!(faces.iter().copied().eq(0..n));
    }
}

#[test]
fn meshes_of_one_or_two_triangles_have_one_node() {
    let (bvh, ordered) = ordered(&soup(1, 1.0));
    assert_eq!((bvh.nodes.len(), bvh.depth, bvh.nodes[0].count), (1, 1, [1, 0]));
    assert!(bvh.nodes[0].bounds(1).is_empty());
    assert_eq!(bvh.validate(&ordered, LeafKind::Triangles), Ok(()));
}

#[test]
fn identical_triangles_stay_shallow() {
    let triangles = vec![soup(1, 1.0)[0]; 5000];
    let (bvh, ordered) = ordered(&triangles);
    assert_eq!(bvh.validate(&ordered, LeafKind::Triangles), Ok(()));
    assert!(bvh.depth <= MAX_DEPTH, "{}", bvh.depth);
}

/// Nested triangles, each a little larger than the one before, tempt a builder into a chain.
#[test]
fn adversarial_meshes_stay_within_the_stack() {
    let triangles: Vec<Triangle> = (0..4000_u16)
        .map(|k| {
            let s = 1.01_f32.powi(i32::from(k));
            Triangle { vertices: [[0.0, 0.0, s], [s, 0.0, 0.0], [0.0, s, 0.0]], face: u32::from(k) }
        })
        .collect();
    let (bvh, ordered) = ordered(&triangles);
    assert_eq!(bvh.validate(&ordered, LeafKind::Triangles), Ok(()));
    assert!(bvh.depth <= MAX_DEPTH, "{}", bvh.depth);
}

#[test]
fn the_checker_sees_each_planted_error() {
    let (good, ordered) = ordered(&soup(100, 10.0));
    let with = |change: &dyn Fn(&mut Bvh2)| {
        let mut bvh = good.clone();
        change(&mut bvh);
        bvh.validate(&ordered, LeafKind::Triangles)
    };
    let leaf = good.nodes.iter().position(|n| n.count[0] > 0).unwrap();
    let inner = good.nodes.iter().position(|n| n.count[1] == 0).unwrap();
    assert_eq!(with(&|_| ()), Ok(()));
    assert_eq!(with(&|b| b.nodes.clear()), Err(BvhError::Empty));
    assert_eq!(with(&|b| b.depth += 1), Err(BvhError::Depth));
    let shrunk = with(&|b| b.nodes[leaf].max[0][1] -= 0.5);
    assert!(matches!(shrunk, Err(BvhError::Bounds(_))), "{shrunk:?}");
    assert_eq!(with(&|b| b.nodes[leaf].count[0] = MAX_LEAF_TRIANGLES + 1), Err(BvhError::Leaf(leaf)));
    assert_eq!(with(&|b| b.nodes[leaf].child[0] = 100), Err(BvhError::Leaf(leaf)));
    assert_eq!(with(&|b| b.nodes[inner].child[1] = 0), Err(BvhError::Child(inner)));
    assert_eq!(with(&|b| b.nodes.push(b.nodes[0])), Err(BvhError::Coverage));
}

/// Distance along a ray to a triangle (Moeller and Trumbore 1997), in f64.
pub(crate) fn hit(triangle: &Triangle, origin: glam::DVec3, direction: glam::DVec3) -> Option<f64> {
    let [a, b, c] = triangle.vertices.map(|v| Vec3::from(v).as_dvec3());
    let (e, f) = (b - a, c - a);
    let p = direction.cross(f);
    let s = origin - a;
    let q = s.cross(e);
    let det = e.dot(p);
    let (u, v, t) = (s.dot(p) / det, direction.dot(q) / det, f.dot(q) / det);
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0).then_some(t)
}

fn nearest(bvh: &Bvh2, triangles: &[Triangle], origin: glam::DVec3, direction: glam::DVec3) -> Option<f64> {
    let mut best = f64::INFINITY;
    let mut stack = vec![0_usize];
    while let Some(node) = stack.pop().map(|n| &bvh.nodes[n]) {
        for side in 0..2 {
            let (min, max) = (Vec3::from(node.min[side]).as_dvec3(), Vec3::from(node.max[side]).as_dvec3());
            let (t0, t1) = ((min - origin) / direction, (max - origin) / direction);
            if t0.min(t1).max_element() > t0.max(t1).min_element() {
                continue;
            }
            let first = node.child[side] as usize;
            if node.count[side] == 0 {
                stack.push(first);
            }
            for triangle in &triangles[first..][..node.count[side] as usize] {
                best = best.min(hit(triangle, origin, direction).unwrap_or(f64::INFINITY));
            }
        }
        assert!(stack.len() <= bvh.depth as usize + 1, "the depth bounds the stack");
    }
    best.is_finite().then_some(best)
}

/// Traces rays into a soup of triangles: `nearest` must give the result of testing all triangles.
pub(crate) fn expect_brute_force(triangles: &[Triangle], nearest: impl Fn(glam::DVec3, glam::DVec3) -> Option<f64>) {
    let mut hits = 0;
    for k in 0..300_u32 {
        let [x, y, z, w] = oocpt_abi::sampler::sample_4d(k, 0, 3).map(f64::from);
        let origin = glam::DVec3::new(-2.0, 9.0 * x, 9.0 * y);
        let direction = glam::DVec3::new(1.0, z - 0.5, w - 0.5);
        let brute = triangles.iter().filter_map(|t| hit(t, origin, direction)).reduce(f64::min);
        assert_eq!(nearest(origin, direction), brute);
        hits += u32::from(brute.is_some());
    }
    assert!(hits > 50, "{hits}");
}

#[test]
fn a_walk_finds_what_brute_force_finds() {
    let (bvh, ordered) = ordered(&soup(1500, 8.0));
    expect_brute_force(&ordered, |origin, direction| nearest(&bvh, &ordered, origin, direction));
}
