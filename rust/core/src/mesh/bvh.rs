// SPDX-License-Identifier: Apache-2.0
//! BVH2 over the triangles of a mesh or over boxes, of which [`super::bvh4`] makes what the GPU walks: built by `obvhs`
//! (PLOC, Meister and Bittner 2018; reinsertion, Meister and Bittner 2017). Deterministic and never deeper than
//! [`MAX_DEPTH`]. Pure; one thread per build.

use bytemuck::{Pod, Zeroable};
use glam::Vec3A;
use obvhs::bvh2::Bvh2 as Tree;
use obvhs::bvh2::leaf_collapser::collapse;
use obvhs::bvh2::node::Bvh2Node;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};

use super::{Aabb, LeafKind, Triangle};

/// Most triangles in a leaf.
pub const MAX_LEAF_TRIANGLES: u32 = 3;
/// Deepest hierarchy that is given out; deeper ones (adversarial meshes) are built again, balanced.
pub const MAX_DEPTH: u32 = 64;
/// Cost of a node step in triangle tests, for collapsing leaves.
const TRAVERSAL_COST: f32 = 1.0;
/// Share of the nodes that reinsertion looks at, with single items in leaves and once more with several.
const REINSERTION: f32 = 0.1;

/// An inner node with the boxes of both children, 64 bytes.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct BvhNode {
    /// Lower corners of the children's boxes.
    pub min: [[f32; 3]; 2],
    /// Upper corners of the children's boxes; an absent child has `min = +inf, max = -inf`.
    pub max: [[f32; 3]; 2],
    /// Node index where `count` is 0, else first triangle in BVH order (a hierarchy over boxes: the number of the box).
    pub child: [u32; 2],
    /// Triangles of a leaf child (1 to [`MAX_LEAF_TRIANGLES`]; 1 over boxes); 0 for an inner or absent child.
    pub count: [u32; 2],
}

impl BvhNode {
    /// A node without children.
    pub const EMPTY: Self = Self { min: [Aabb::EMPTY.min; 2], max: [Aabb::EMPTY.max; 2], child: [0; 2], count: [0; 2] };

    /// Box of child `side` (0 or 1).
    #[must_use]
    pub fn bounds(&self, side: usize) -> Aabb {
        Aabb { min: self.min[side & 1], max: self.max[side & 1] }
    }

    pub(super) fn set(&mut self, side: usize, bounds: &Aabb, child: u32, count: u32) {
        self.min[side] = bounds.min;
        self.max[side] = bounds.max;
        self.child[side] = child;
        self.count[side] = count;
    }
}

/// A binary hierarchy; node 0 is the root. One with a single leaf has one node whose second child is absent.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Bvh2 {
    /// Nodes, parents before children.
    pub nodes: Vec<BvhNode>,
    /// Nodes on the longest way down, at most [`MAX_DEPTH`]; a traversal stack of this many entries suffices.
    pub depth: u32,
}

/// A broken invariant of a [`Bvh2`]: always a bug of this crate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum BvhError {
    /// No node.
    #[error("the hierarchy has no node")]
    Empty,
    /// A child index is out of range or not larger than its parent's.
    #[error("node {0} has a child out of order or out of range")]
    Child(usize),
    /// A leaf is too large or out of range.
    #[error("node {0} has a leaf out of range")]
    Leaf(usize),
    /// A box does not hold what is below it, or is larger than that needs.
    #[error("node {0} has a box that does not fit its child")]
    Bounds(usize),
    /// An item (triangle or box) or node is not reached exactly once.
    #[error("an item or node is not reached exactly once")]
    Coverage,
    /// The stored depth, or the stack, is wrong.
    #[error("the depth is wrong")]
    Depth,
}

/// Builds the hierarchy over `triangles` (at least one, finite) and the BVH order: `order[k]` is the number of the
/// triangle at place k.
#[must_use]
pub fn build_bvh(triangles: &[Triangle], kind: LeafKind) -> (Bvh2, Vec<u32>) {
    let boxes: Vec<Aabb> = triangles.iter().map(|triangle| triangle.bounds(kind)).collect();
    build_item_bvh(&boxes)
}

/// [`build_bvh`] over the boxes of triangles.
pub(super) fn build_item_bvh(boxes: &[Aabb]) -> (Bvh2, Vec<u32>) {
    build(boxes, MAX_LEAF_TRIANGLES)
}

/// [`build_item_bvh`] with one item to a leaf.
pub(super) fn build_box_order(boxes: &[Aabb]) -> (Bvh2, Vec<u32>) {
    build(boxes, 1)
}

/// Builds the hierarchy over `boxes`: leaves of exactly one item, whose `child` is the number of the box. A single box
/// gives one node with an absent second child, no boxes one node with two absent children.
///
/// The result depends on the boxes and their order only. Boxes must not be empty: a walk may not find such an item.
/// Boxes whose common surface overflows single precision (1e19 and more across) get a balanced, poorer hierarchy.
#[must_use]
pub fn build_box_bvh(boxes: &[Aabb]) -> Bvh2 {
    if boxes.is_empty() {
        return Bvh2 { nodes: vec![BvhNode::EMPTY], depth: 1 };
    }
    let (mut bvh, order) = build(boxes, 1);
    for node in &mut bvh.nodes {
        for side in 0..2 {
            if let (1, Some(&item)) = (node.count[side], order.get(node.child[side] as usize)) {
                node.child[side] = item;
            }
        }
    }
    bvh
}

/// Hierarchy over at least one box and the order of its items, leaves of at most `max_leaf`.
fn build(boxes: &[Aabb], max_leaf: u32) -> (Bvh2, Vec<u32>) {
    if has_surface(boxes) {
        let (bvh, order) = BvhLayout::of_ploc(boxes, max_leaf);
        if bvh.depth <= MAX_DEPTH {
            return (bvh, order);
        }
    }
    BvhLayout::balanced(boxes, max_leaf)
}

/// True when no box is empty or NaN and all surfaces are finite. PLOC compares surfaces: infinite ones make it merge a
/// pair per pass, which takes quadratic time, and NaN makes it panic.
fn has_surface(boxes: &[Aabb]) -> bool {
    let is_box = |b: &Aabb| (0..3).all(|k| b.min[k] <= b.max[k]);
    let all = boxes.iter().fold(Aabb::EMPTY, |a, b| a.union(b));
    let [x, y, z] = [0, 1, 2].map(|k| all.max[k] - all.min[k]);
    boxes.iter().all(is_box) && (x * y + y * z + z * x).is_finite()
}

/// Nodes and order while being laid out.
#[derive(Default)]
struct BvhLayout {
    nodes: Vec<BvhNode>,
    order: Vec<u32>,
    depth: u32,
}

impl BvhLayout {
    fn of_ploc(boxes: &[Aabb], max_leaf: u32) -> (Bvh2, Vec<u32>) {
        let obvhs_box = |b: &Aabb| obvhs::aabb::Aabb::new(Vec3A::from(b.min), Vec3A::from(b.max));
        let boxes: Vec<_> = boxes.iter().map(obvhs_box).collect();
        let indices = (0..).take(boxes.len()).collect();
        let mut ploc = PlocBuilder::with_capacity(boxes.len());
        let mut tree = ploc.build(PlocSearchDistance::Medium, &boxes, indices, SortPrecision::U64, 3);
        // What follows takes as much again: the builder's arrays and the boxes are not needed any more.
        drop((ploc, boxes));
        let mut optimizer = ReinsertionOptimizer::default();
        optimizer.run(&mut tree, REINSERTION, None);
        if max_leaf > 1 {
            collapse(&mut tree, max_leaf, TRAVERSAL_COST);
            optimizer.run(&mut tree, REINSERTION, None);
        }
        drop(optimizer);
        let mut layout = Self::default();
        // An inner node for each pair of nodes but the root.
        layout.nodes.reserve_exact(tree.nodes.len() / 2 + 1);
        layout.order.reserve_exact(tree.primitive_indices.len());
        layout.add_tree(&tree);
        layout.finish()
    }

    fn finish(self) -> (Bvh2, Vec<u32>) {
        (Bvh2 { nodes: self.nodes, depth: self.depth }, self.order)
    }

    /// Copies the tree depth first, the first inner child next to its parent.
    fn add_tree(&mut self, tree: &Tree) {
        let Some(root) = tree.nodes.first() else { return };
        if root.is_leaf() {
            let slot = self.open(None, 1);
            return self.add_leaf(tree, root, (slot, 0));
        }
        let mut open = vec![(root, None, 1)];
        while let Some((node, parent, depth)) = open.pop() {
            let slot = self.open(parent, depth);
            let first = node.first_index as usize;
            let children = tree.nodes.get(first..first + 2).unwrap_or_default();
            for (side, child) in children.iter().enumerate() {
                if child.is_leaf() {
                    self.add_leaf(tree, child, (slot, side));
                } else {
                    self.nodes[slot].set(side, &plain_box(child), 0, 0);
                }
            }
            let inner = children.iter().enumerate().filter(|(_, child)| !child.is_leaf());
            open.extend(inner.rev().map(|(side, child)| (child, Some((slot, side)), depth + 1)));
        }
    }

    /// Adds an empty node, told to its parent's child on the given side.
    fn open(&mut self, parent: Option<(usize, usize)>, depth: u32) -> usize {
        let slot = self.nodes.len();
        if let (Some((above, side)), Ok(child)) = (parent, u32::try_from(slot)) {
            self.nodes[above].child[side] = child;
        }
        self.nodes.push(BvhNode::EMPTY);
        self.depth = self.depth.max(depth);
        slot
    }

    fn add_leaf(&mut self, tree: &Tree, leaf: &Bvh2Node, (slot, side): (usize, usize)) {
        let first = leaf.first_index as usize;
        let members = tree.primitive_indices.get(first..first + leaf.prim_count as usize).unwrap_or_default();
        self.push_leaf(members, &plain_box(leaf), (slot, side));
    }

    fn push_leaf(&mut self, members: &[u32], bounds: &Aabb, (slot, side): (usize, usize)) {
        if let (Ok(first), Ok(count)) = (u32::try_from(self.order.len()), u32::try_from(members.len())) {
            self.nodes[slot].set(side, bounds, first, count);
            self.order.extend_from_slice(members);
        }
    }

    /// Splits at the median of the longest axis: poorer, but never deeper than log2 of the items.
    fn balanced(boxes: &[Aabb], max_leaf: u32) -> (Bvh2, Vec<u32>) {
        let bounds_of = |members: &[u32]| {
            members.iter().fold(Aabb::EMPTY, |b, &i| boxes.get(i as usize).map_or(b, |item| b.union(item)))
        };
        let mut members: Vec<u32> = (0..).take(boxes.len()).collect();
        let mut layout = Self::default();
        let mut open = vec![(0..members.len(), None, 1)];
        while let Some((range, parent, depth)) = open.pop() {
            let slot = layout.open(parent, depth);
            let part = &mut members[range.clone()];
            if part.len() <= max_leaf as usize {
                // Only the root gets here: children this small are leaves of their parent.
                layout.push_leaf(part, &bounds_of(part), (slot, 0));
                continue;
            }
            let axis = longest_axis(&bounds_of(part));
            let center = |i: u32| boxes.get(i as usize).map_or(0.0, |b| b.min[axis] + b.max[axis]);
            let middle = part.len() / 2;
            part.select_nth_unstable_by(middle, |&a, &b| center(a).total_cmp(&center(b)).then(a.cmp(&b)));
            let halves = [range.start..range.start + middle, range.start + middle..range.end];
            for (side, half) in halves.into_iter().enumerate().rev() {
                let members = &members[half.clone()];
                if half.len() <= max_leaf as usize {
                    layout.push_leaf(members, &bounds_of(members), (slot, side));
                } else {
                    layout.nodes[slot].set(side, &bounds_of(members), 0, 0);
                    open.push((half, Some((slot, side)), depth + 1));
                }
            }
        }
        layout.finish()
    }
}

fn plain_box(node: &Bvh2Node) -> Aabb {
    let aabb = node.aabb();
    Aabb { min: aabb.min.to_array(), max: aabb.max.to_array() }
}

pub(super) fn longest_axis(b: &Aabb) -> usize {
    let extent = |k: usize| b.max[k] - b.min[k];
    (0..3).max_by(|&i, &j| extent(i).total_cmp(&extent(j))).unwrap_or(0)
}
