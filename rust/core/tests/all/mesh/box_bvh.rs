// SPDX-License-Identifier: Apache-2.0
//! Hierarchies over boxes, their checker, and the bytes of an asset on the device.

use oocpt_core::mesh::build_mesh;
use oocpt_core::mesh::bvh::MAX_DEPTH;
use oocpt_core::{Aabb, Bvh2, BvhError, Interpolation, mesh::build_box_bvh};
use proptest::prelude::*;

use crate::support::{grid, primvar, triangle};

/// Boxes of side 0 to `size`, corners in `0..spread`.
fn scattered(n: u32, spread: f32, size: f32) -> Vec<Aabb> {
    (0..n)
        .map(|k| {
            let [a, b] = [0, 1].map(|d| oocpt_abi::sampler::sample_4d(k, d, 5));
            let min = [a[0], a[1], a[2]].map(|v| v * spread);
            Aabb { min, max: [min[0] + b[0] * size, min[1] + b[1] * size, min[2] + b[2] * size] }
        })
        .collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]
    #[test]
    fn every_box_is_one_leaf_and_boxes_are_exact(
        n in 0_u32..300,
        spread in prop_oneof![Just(0.0_f32), Just(50.0), Just(1e18), Just(1e-30)],
        size in prop_oneof![Just(0.0_f32), Just(1.0), Just(1e18)],
    ) {
        let boxes = scattered(n, spread, size);
        let bvh = build_box_bvh(&boxes);
        prop_assert_eq!(bvh.validate_boxes(&boxes), Ok(()));
        prop_assert!(bvh.depth <= MAX_DEPTH);
        prop_assert_eq!(&build_box_bvh(&boxes), &bvh, "the same boxes must give the same bits");
    }
}

#[test]
fn equal_boxes_and_overflowing_extents_stay_shallow() {
    let equal = vec![Aabb { min: [1.0, 2.0, 3.0], max: [1.5, 2.0, 4.0] }; 500];
    let huge = scattered(3000, 1e30, 1e30);
    let infinite = vec![Aabb { min: [f32::NEG_INFINITY; 3], max: [f32::INFINITY; 3] }; 100];
    for boxes in [equal, huge, infinite] {
        let bvh = build_box_bvh(&boxes);
        assert_eq!(bvh.validate_boxes(&boxes), Ok(()), "{:?}", boxes[0]);
        assert!(bvh.depth <= MAX_DEPTH, "{} levels for {:?}", bvh.depth, boxes[0]);
    }
}

/// Nested boxes, each a little larger than the one before, tempt a builder into a chain.
#[test]
fn nested_boxes_stay_within_the_stack() {
    let boxes: Vec<Aabb> =
        (0..4000_u16).map(|k| 1.01_f32.powi(i32::from(k))).map(|s| Aabb { min: [0.0; 3], max: [s; 3] }).collect();
    let bvh = build_box_bvh(&boxes);
    assert_eq!(bvh.validate_boxes(&boxes), Ok(()), "the fallback is valid too");
    assert!(bvh.depth <= MAX_DEPTH, "{} levels", bvh.depth);
}

#[test]
fn up_to_two_boxes_have_one_node() {
    let boxes = scattered(2, 10.0, 1.0);
    let none = build_box_bvh(&[]);
    assert_eq!((none.nodes.len(), none.depth, none.nodes[0].count), (1, 1, [0, 0]), "no boxes: {none:?}");
    assert!(none.nodes[0].bounds(0).is_empty() && none.nodes[0].bounds(1).is_empty(), "both children are absent");
    let one = build_box_bvh(&boxes[..1]);
    assert_eq!((one.nodes.len(), one.depth, one.nodes[0].count), (1, 1, [1, 0]), "one box: {one:?}");
    assert!(one.nodes[0].bounds(1).is_empty(), "the second child is absent");
    let two = build_box_bvh(&boxes);
    assert_eq!((two.nodes.len(), two.depth, two.nodes[0].count), (1, 1, [1, 1]), "two boxes: {two:?}");
    for (bvh, boxes) in [(none, &boxes[..0]), (one, &boxes[..1]), (two, &boxes[..])] {
        assert_eq!(bvh.validate_boxes(boxes), Ok(()), "{} boxes", boxes.len());
    }
}

#[test]
fn empty_and_nan_boxes_do_not_panic() {
    let mut boxes = scattered(50, 1.0, 1.0);
    boxes[7] = Aabb::EMPTY;
    boxes[9] = Aabb { min: [f32::NAN; 3], max: [f32::NAN; 3] };
    let bvh = build_box_bvh(&boxes);
    let mut items: Vec<u32> =
        bvh.nodes.iter().flat_map(|n| (0..2).filter(|&s| n.count[s] == 1).map(|s| n.child[s])).collect();
    items.sort_unstable();
    assert!(items.into_iter().eq(0..50), "every item keeps its leaf");
}

#[test]
fn the_checker_sees_each_planted_error() {
    let boxes = scattered(100, 10.0, 1.0);
    let good = build_box_bvh(&boxes);
    let with = |change: &dyn Fn(&mut Bvh2)| {
        let mut bvh = good.clone();
        change(&mut bvh);
        bvh.validate_boxes(&boxes)
    };
    let leaf = good.nodes.iter().position(|n| n.count == [1, 1]).unwrap();
    assert_eq!(with(&|b| b.nodes[leaf].count[0] = 2), Err(BvhError::Leaf(leaf)), "a leaf of two");
    assert_eq!(with(&|b| b.nodes[leaf].child[0] = 100), Err(BvhError::Leaf(leaf)), "an item out of range");
    let swapped = with(&|b| b.nodes[leaf].child.swap(0, 1));
    assert_eq!(swapped, Err(BvhError::Bounds(leaf)), "items exchanged");
    let twice = with(&|b| b.nodes[leaf].child[1] = b.nodes[leaf].child[0]);
    assert_eq!(twice, Err(BvhError::Coverage), "an item reached twice");
    assert_eq!(good.validate_boxes(&boxes[..99]), Err(BvhError::Leaf(leaf_of(&good, 99))), "a box too few");
    assert_eq!(good.validate_boxes(&[]), Err(BvhError::Leaf(first_leaf(&good))), "no boxes at all");
}

fn leaf_of(bvh: &Bvh2, item: u32) -> usize {
    let holds = |s: usize, n: &oocpt_core::BvhNode| n.count[s] == 1 && n.child[s] == item;
    bvh.nodes.iter().position(|n| holds(0, n) || holds(1, n)).unwrap()
}

/// The leaf that a walk which takes the second child first meets first.
fn first_leaf(bvh: &Bvh2) -> usize {
    let mut open = vec![0];
    while let Some(at) = open.pop() {
        let node: &oocpt_core::BvhNode = &bvh.nodes[at];
        if node.count != [0, 0] {
            return at;
        }
        open.extend(node.child.map(|c| c as usize));
    }
    0
}

#[test]
fn device_bytes_are_the_sum_of_the_sections() {
    let mut one = triangle("/t", 0.0);
    assert_eq!(build_mesh(&one, 1).asset.unwrap().device_bytes(), 48 + 48, "a node and a triangle");
    one.display_color = Some(primvar(Interpolation::Vertex, vec![[0.5_f32, 0.5, 0.5]; 3]));
    // 12 bytes of corner indices take 16, 36 of colours 48.
    assert_eq!(build_mesh(&one, 1).asset.unwrap().device_bytes(), 48 + 48 + 16 + 48, "colours of the points");
    one.display_opacity = Some(primvar(Interpolation::Constant, vec![0.5_f32]));
    assert_eq!(build_mesh(&one, 1).asset.unwrap().device_bytes(), 48 + 48 + 16 + 48 + 16, "and one opacity");
    let grid = build_mesh(&grid("/g", 20), 1).asset.unwrap();
    assert_eq!(grid.device_bytes(), 48 * grid.bvh.nodes.len() as u64 + 48 * 800, "without attributes");
}
