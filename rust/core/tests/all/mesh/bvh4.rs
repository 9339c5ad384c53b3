// SPDX-License-Identifier: Apache-2.0
//! The four-wide hierarchies of meshes: invariants, their checker, boxes of any size, and a walk against brute force.

use glam::DVec3;
use oocpt_abi::{ABSENT, LEAF, LevelNode, NodeChild};
use oocpt_core::mesh::build_bvh4::build_bvh4;
use oocpt_core::mesh::bvh4::{Bvh4, level_nodes};
use oocpt_core::mesh::{
    LeafKind, LevelShape, LevelTree, build_box_bvh, build_level, level_node_count, likely_level_stack,
};
use oocpt_core::{Aabb, BvhError, Triangle};
use proptest::prelude::*;

use crate::mesh::bvh::{expect_brute_force, hit, soup};

fn ordered(triangles: &[Triangle]) -> (Bvh4, Vec<Triangle>) {
    let (bvh, order) = build_bvh4(triangles, LeafKind::Triangles);
    let ordered = order.iter().map(|&i| triangles[i as usize]).collect();
    (bvh, ordered)
}

/// `n` triangles, axis `k` stretched by `stretch[k]` and moved by `shift`.
fn placed(n: u32, stretch: [f32; 3], shift: f32) -> Vec<Triangle> {
    let mut triangles = soup(n, 20.0);
    for corner in triangles.iter_mut().flat_map(|t| &mut t.vertices) {
        for k in 0..3 {
            corner[k] = corner[k] * stretch[k] + shift;
        }
    }
    triangles
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]
    #[test]
    fn every_triangle_is_in_one_leaf_and_boxes_hold_what_is_in_them(
        n in 1_u32..400,
        x in prop_oneof![Just(0.0_f32), Just(1.0), Just(1e-38), Just(1e36)],
        y in prop_oneof![Just(0.0_f32), Just(1.0), Just(1e-20), Just(1e18)],
        shift in prop_oneof![Just(0.0_f32), Just(-1e7), Just(1e30)],
    ) {
        let (bvh, ordered) = ordered(&placed(n, [x, y, 1.0], shift));
        prop_assert_eq!(bvh.validate(&ordered, LeafKind::Triangles), Ok(()));
        let mut faces: Vec<u32> = ordered.iter().map(|t| t.face).collect();
        faces.sort_unstable();
        prop_assert!(faces.iter().copied().eq(0..n));
    }
}

#[test]
fn a_single_triangle_is_the_only_child() {
    let (bvh, ordered) = ordered(&soup(1, 1.0));
    assert_eq!((bvh.nodes.len(), bvh.stack), (1, 0));
    assert_eq!(bvh.nodes[0].child(0), NodeChild::Leaf { first: 0, count: 1 });
    assert!((1..4).all(|at| bvh.nodes[0].child(at) == NodeChild::Absent));
    assert_eq!(bvh.validate(&ordered, LeafKind::Triangles), Ok(()));
}

#[test]
fn nodes_have_at_least_three_children_on_average() {
    let (bvh, _) = ordered(&soup(10_000, 100.0));
    let children = bvh.nodes.iter().flat_map(|node| (0..4).map(|at| node.child(at)));
    let there = children.filter(|child| *child != NodeChild::Absent).count();
    assert!(there >= 3 * bvh.nodes.len(), "{there} children of {} nodes", bvh.nodes.len());
}

/// The largest finite numbers, and a plane that is flat in one axis: cells neither overflow nor vanish.
#[test]
fn extreme_f32_boxes_stay_conservative() {
    let corner = |s: f32| Triangle { vertices: [[s, -s, 7.0], [-s, s, 7.0], [s, s, 7.0]], face: 0 };
    for s in [f32::MAX, f32::MIN_POSITIVE, 1.0] {
        let triangles = vec![corner(s), corner(0.5 * s), corner(0.25 * s), corner(0.75 * s)];
        let (bvh, ordered) = ordered(&triangles);
        assert_eq!(bvh.validate(&ordered, LeafKind::Triangles), Ok(()), "{s}");
        assert!((0..3).all(|axis| bvh.nodes[0].cell(axis) >= f64::from(f32::MIN_POSITIVE)), "{s}: {:?}", bvh.nodes[0]);
    }
}

#[test]
fn the_checker_sees_each_planted_error() {
    let (good, ordered) = ordered(&soup(100, 10.0));
    let with = |change: &dyn Fn(&mut Bvh4)| {
        let mut bvh = good.clone();
        change(&mut bvh);
        bvh.validate(&ordered, LeafKind::Triangles)
    };
    let leaf = good.nodes.iter().position(|n| matches!(n.child(0), NodeChild::Leaf { .. })).unwrap();
    assert_eq!(with(&|_| ()), Ok(()));
    assert_eq!(with(&|b| b.nodes.clear()), Err(BvhError::Empty));
    assert_eq!(with(&|b| b.stack += 1), Err(BvhError::Depth));
    // A plane one cell further in, and one further out, of the first child.
    assert_eq!(with(&|b| b.nodes[leaf].upper[1] -= 1), Err(BvhError::Bounds(leaf)));
    assert_eq!(with(&|b| b.nodes[0].lower[1] = 0), Err(BvhError::Bounds(0)));
    assert_eq!(with(&|b| b.nodes[leaf].first_triangle = 100), Err(BvhError::Leaf(leaf)));
    assert_eq!(with(&|b| b.nodes[0].first_child &= !0xff), Err(BvhError::Child(0)));
    assert!(with(&|b| b.nodes[leaf].cell_and_counts &= 0x00ff_ffff).is_err());
    assert_eq!(with(&|b| b.nodes.push(b.nodes[0])), Err(BvhError::Coverage));
}

fn nearest(bvh: &Bvh4, triangles: &[Triangle], origin: DVec3, direction: DVec3) -> Option<f64> {
    let mut best = f64::INFINITY;
    let mut stack = vec![0_usize];
    while let Some(node) = stack.pop().map(|n| &bvh.nodes[n]) {
        for at in 0..4 {
            let [x, y, z] = [0, 1, 2].map(|axis| node.planes(at as usize, axis));
            let (min, max) = (DVec3::new(x[0], y[0], z[0]), DVec3::new(x[1], y[1], z[1]));
            let (t0, t1) = ((min - origin) / direction, (max - origin) / direction);
            if t0.min(t1).max_element() > t0.max(t1).min_element() {
                continue;
            }
            match node.child(at) {
                NodeChild::Inner(child) => stack.push(child as usize),
                NodeChild::Leaf { first, count } => {
                    let leaf = &triangles[first as usize..][..count as usize];
                    let hits = leaf.iter().filter_map(|triangle| hit(triangle, origin, direction));
                    best = hits.fold(best, f64::min);
                }
                NodeChild::Absent => {}
            }
        }
        assert!(stack.len() <= bvh.stack as usize + 1, "the stack suffices");
    }
    best.is_finite().then_some(best)
}

#[test]
fn a_walk_finds_what_brute_force_finds() {
    let (bvh, ordered) = ordered(&soup(1500, 8.0));
    expect_brute_force(&ordered, |origin, direction| nearest(&bvh, &ordered, origin, direction));
}

/// Follows every path down; returns the boxes that were reached and checks that planes contain them with a little
/// slack, and hardly more than a cell.
fn reached(boxes: &[Aabb], nodes: &[LevelNode], stack: u32) -> Vec<u32> {
    let (mut items, mut most) = (Vec::new(), 0);
    let mut open = vec![(0_u32, 0_u32)];
    while let Some((at, waiting)) = open.pop() {
        let node = &nodes[at as usize];
        let there: u32 = node.child.iter().map(|&child| u32::from(child != ABSENT)).sum();
        let waiting = waiting + there.saturating_sub(1);
        most = most.max(waiting);
        for (place, &child) in node.child.iter().enumerate().filter(|(_, child)| **child != ABSENT) {
            if child & LEAF == 0 {
                open.push((child, waiting));
                continue;
            }
            let item = child & !LEAF;
            items.push(item);
            for axis in 0..3 {
                let [lower, upper] = node.planes(place, axis);
                let cell = f64::from(f32::from_bits((node.cell >> (8 * axis) & 255) << 23));
                let item = &boxes[item as usize];
                for spare in [f64::from(item.min[axis]) - lower, upper - f64::from(item.max[axis])] {
                    let cells = spare / cell;
                    assert!((1.2e-4..1.01).contains(&cells), "{cells} cells of {cell} along {axis}: {item:?}");
                }
            }
        }
    }
    assert_eq!(most, stack, "the stack of the longest way down");
    items.sort_unstable();
    items
}

/// Checks that all nodes are reached, and that all but one have four children.
fn expect_full(nodes: &[LevelNode], boxes: usize) {
    let there = |node: &LevelNode| node.child.iter().filter(|child| **child != ABSENT).count();
    let absent: usize = nodes.iter().map(|node| 4 - there(node)).sum();
    assert_eq!(nodes.iter().map(there).sum::<usize>(), boxes + nodes.len() - 1, "each node has one parent");
    assert!(absent < 3 || boxes < 3, "{absent} of {} children are absent", 4 * nodes.len());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]
    #[test]
    fn every_instance_box_is_one_leaf_with_a_margin(
        n in 0_u32..300,
        size in prop_oneof![Just(0.0_f32), Just(1e-20), Just(1.0), Just(1e18)],
        spread in prop_oneof![Just(0.0_f32), Just(1e-10), Just(30.0), Just(1e18)],
        shift in prop_oneof![Just(0.0_f32), Just(-1e7), Just(1e17)],
    ) {
        let corner = |k: u32, d: u32| oocpt_abi::sampler::sample_4d(k, d, 5);
        let boxes: Vec<Aabb> = (0..n).map(|k| {
            let (a, b) = (corner(k, 0), corner(k, 1));
            let min = [a[0], a[1], a[2]].map(|v| v * spread + shift);
            Aabb { min, max: [0, 1, 2].map(|axis| min[axis] + b[axis] * size) }
        }).collect();
        let (nodes, stack) = level_nodes(&build_box_bvh(&boxes));
        prop_assert!(reached(&boxes, &nodes, stack).into_iter().eq(0..n));
        let tree = build_level(&boxes);
        prop_assert_eq!(&build_level(&boxes), &tree, "the same boxes give the same bits");
        prop_assert!(reached(&boxes, &tree.nodes, tree.stack).into_iter().eq(0..n));
        prop_assert_eq!(tree.nodes.len(), level_node_count(boxes.len()));
        expect_full(&tree.nodes, boxes.len());
        prop_assert!(tree.stack <= 3 * (n.max(1).ilog2() + 6), "{} entries for {n} boxes", tree.stack);
    }
}

#[test]
fn the_largest_child_comes_first() {
    let cube = |(at, size): (u8, f32)| {
        let x = 10.0 * f32::from(at);
        Aabb { min: [x, 0.0, 0.0], max: [x + size, size, size] }
    };
    let boxes: Vec<Aabb> = (0..).zip([1.0, 4.0, 2.0, 3.0]).map(cube).collect();
    let largest_first = [1, 3, 2, 0].map(|number| LEAF | number);
    assert_eq!(build_level(&boxes).nodes[0].child, largest_first);
    let (nodes, _) = level_nodes(&build_box_bvh(&boxes));
    assert_eq!(nodes[0].child, largest_first);
}

#[test]
fn distant_clusters_split_at_the_root() {
    // The distance between neighbours in a cluster is about the resolution of single precision in the scene, or far
    // more.
    for (scale, far) in [(1.0, 1e3), (1e-18, 1e3), (1e18, 1e3), (1e-3, 1e6)] {
        for (left, all) in [(2, 7_u16), (5, 30), (20, 100), (1001, 4097), (5000, 20_000)] {
            let center = |k: u16| {
                let turn = f32::from(k) * 2.4;
                let at = if k % all < left { -far } else { far };
                [(at + turn.cos()) * scale, turn.sin() * scale, f32::from(k % 7) * 0.1 * scale]
            };
            let half = 0.05 * scale;
            let box_of = |c: [f32; 3]| Aabb { min: c.map(|x| x - half), max: c.map(|x| x + half) };
            // The order is unrelated to the positions: 1009 is prime.
            let boxes: Vec<Aabb> = (0..u32::from(all))
                .map(|k| center(u16::try_from(k * 1009 % u32::from(all)).expect("below all")))
                .map(box_of)
                .collect();
            let root = build_level(&boxes).nodes[0];
            for at in (0..4).filter(|&at| root.child[at] != ABSENT) {
                let [from, to] = root.planes(at, 0);
                assert!(from * to > 0.0, "{left} of {all}, scale {scale}: child {at} reaches from {from} to {to}");
            }
        }
    }
}

/// Passes are compiled for stacks of that size before there are trees (decisions/0050).
#[test]
fn stack_depth_stays_within_the_predicted_bound() {
    // Scattered evenly, in clusters of clusters, on a line, and ever denser towards a point.
    let spreads: [fn(f32) -> f32; 4] =
        [|x| x, |x| (x * 8.0).fract() * 0.01 + (x * 8.0).floor(), |_| 0.0, |x| (-20.0 * x).exp()];
    for (spread, name) in spreads.into_iter().zip(["even", "clusters", "line", "point"]) {
        for n in [1_u32, 2, 3, 4, 5, 10, 30, 100, 1000, 10_000, 100_000] {
            let of = |k| oocpt_abi::sampler::sample_4d(k, 0, 5);
            let boxes: Vec<Aabb> = (0..n)
                .map(|k| [of(k)[0], spread(of(k)[1]), spread(of(k)[2])])
                .map(|min| Aabb { min, max: min.map(|x| x + 1e-4) })
                .collect();
            let (stack, likely) = (build_level(&boxes).stack, likely_level_stack(boxes.len()));
            assert!(stack <= likely, "{n} boxes, {name}: {stack} entries, {likely} foreseen");
            assert!(n < 100 || likely <= 2 * stack, "{n} boxes, {name}: {stack} entries, as many as {likely} foreseen");
        }
    }
}

#[test]
fn a_refitted_tree_bounds_what_moved_as_a_built_one_does() {
    let boxes = |moved: f32, n: u32| -> Vec<Aabb> {
        let place = |k: u32| {
            let [a, b, c, d] = oocpt_abi::sampler::sample_4d(k, 0, 9);
            let by = moved * (d - 0.5);
            let min = [a * 30.0 + by, b * 30.0 - by, c * 30.0];
            Aabb { min, max: min.map(|v| v + d) }
        };
        (0..n).map(place).collect()
    };
    for n in [0, 1, 2, 5, 40, 3000] {
        let rest = boxes(0.0, n);
        let built = build_level(&rest);
        let shape = LevelShape::of(&built, &rest);
        let same = shape.refit(&rest).expect("as many boxes");
        assert_eq!(same.tree, built, "the same boxes give the same bits");
        let near = boxes(0.5, n);
        let refitted = shape.refit(&near).expect("as many boxes");
        assert!(reached(&near, &refitted.tree.nodes, refitted.tree.stack).into_iter().eq(0..n), "{n} boxes");
        let root = |tree: &LevelTree| [0, 1, 2].map(|axis| tree.nodes[0].planes(0, axis));
        if n == 1 {
            assert_eq!(root(&refitted.tree), root(&build_level(&near)), "as tight");
        }
        assert!(shape.refit(&boxes(0.0, n + 1)).is_none(), "another number of boxes");
        if n == 3000 {
            assert!((0.9..1.3).contains(&refitted.growth) && !refitted.is_worn(), "{}", refitted.growth);
            let far = shape.refit(&boxes(60.0, n)).expect("as many boxes");
            assert!(far.growth > 3.0 && far.is_worn(), "{}", far.growth);
        }
    }
}
