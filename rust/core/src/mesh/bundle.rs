// SPDX-License-Identifier: Apache-2.0
//! Hierarchies over bundles of points: a leaf is one bundle, so that a point's share of the nodes is small.
//!
//! All bundles but the first one of the asset's order are full; the first has the remainder. So the position of a
//! bundle's points follows from its number and the number of all points. Pure; one thread per build.

use super::Aabb;
use super::bvh::{Bvh2, BvhNode, build_box_order, longest_axis};
use super::bvh4::{Bvh4, compress};

/// Points of a bundle.
pub const POINT_BUNDLE: usize = oocpt_abi::POINT_BUNDLE as usize;

/// The boxes of the bundles of points in BVH order, from the boxes of the points.
pub(super) fn bundle_boxes(boxes: &[Aabb]) -> Vec<Aabb> {
    let (short, full) = boxes.split_at(boxes.len() % POINT_BUNDLE);
    let short = (!short.is_empty()).then_some(short);
    short.into_iter().chain(full.chunks(POINT_BUNDLE)).map(|members| around(members.iter())).collect()
}

/// The hierarchy over bundles of the points with these boxes (at least one), and the BVH order of the points.
pub(super) fn build_bundles(boxes: &[Aabb]) -> (Bvh4, Vec<u32>) {
    let mut members: Vec<u32> = (0..).take(boxes.len()).collect();
    gather(boxes, &mut members);
    let bundles: Vec<&[u32]> = members.chunks(POINT_BUNDLE).collect();
    let around_bundle = |bundle: &&[u32]| around(bundle.iter().filter_map(|&at| boxes.get(at as usize)));
    let bounds: Vec<Aabb> = bundles.iter().map(around_bundle).collect();
    let full = boxes.len() / POINT_BUNDLE;
    let (bvh, order) = match bounds.get(full) {
        Some(short) if full > 0 => {
            let (bvh, order) = build_box_order(&bounds[..full]);
            with_leaf_first(&bvh, order, short)
        }
        _ => build_box_order(&bounds),
    };
    let (bvh, order) = compress(&bvh, &order, true);
    let mut ordered = Vec::with_capacity(boxes.len());
    ordered.extend(order.iter().filter_map(|&bundle| bundles.get(bundle as usize)).copied().flatten());
    (bvh, ordered)
}

/// Sorts neighbours into full bundles, with the remainder last: cuts at the median of the longest axis.
fn gather(boxes: &[Aabb], members: &mut [u32]) {
    let center = |at: u32, axis: usize| boxes.get(at as usize).map_or(0.0, |b| b.min[axis] + b.max[axis]);
    let mut open = vec![(0, members.len())];
    while let Some((begin, end)) = open.pop() {
        let part = &mut members[begin..end];
        if part.len() <= POINT_BUNDLE {
            continue;
        }
        let centers = part.iter().map(|&at| [0, 1, 2].map(|axis| center(at, axis)));
        let axis = longest_axis(&centers.fold(Aabb::EMPTY, |all, point| all.with_point(point)));
        let half = (part.len() / 2).next_multiple_of(POINT_BUNDLE);
        let order = |&a: &u32, &b: &u32| center(a, axis).total_cmp(&center(b, axis)).then(a.cmp(&b));
        part.select_nth_unstable_by(half, order);
        open.extend([(begin, begin + half), (begin + half, end)]);
    }
}

fn around<'a>(boxes: impl Iterator<Item = &'a Aabb>) -> Aabb {
    boxes.fold(Aabb::EMPTY, |all, b| all.union(b))
}

/// A hierarchy with one more leaf, beside the root, so that in the wide hierarchy this leaf is the first of the root's.
fn with_leaf_first(bvh: &Bvh2, mut order: Vec<u32>, bounds: &Aabb) -> (Bvh2, Vec<u32>) {
    let place = u32::try_from(order.len()).unwrap_or(u32::MAX);
    order.push(place);
    let mut root = BvhNode::EMPTY;
    root.set(0, bounds, place, 1);
    let mut nodes = vec![root];
    for node in &bvh.nodes {
        let mut node = *node;
        for side in 0..2 {
            node.child[side] += u32::from(node.count[side] == 0);
        }
        nodes.push(node);
    }
    let depth = bvh.depth + 1;
    if let [root, only] = nodes.as_mut_slice() {
        // A single leaf has no node of its own.
        if only.bounds(1).is_empty() {
            root.set(1, &only.bounds(0), only.child[0], only.count[0]);
            nodes.pop();
            return (Bvh2 { nodes, depth: 1 }, order);
        }
    }
    if let [root, below, ..] = nodes.as_mut_slice() {
        root.set(1, &below.bounds(0).union(&below.bounds(1)), 1, 0);
    }
    (Bvh2 { nodes, depth }, order)
}
