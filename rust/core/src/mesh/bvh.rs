// SPDX-License-Identifier: Apache-2.0
//! The BVH2 of a mesh: built by `obvhs` (PLOC and reinsertion), laid out for the GPU. Pure; one thread per mesh.

use bytemuck::{Pod, Zeroable};
use glam::Vec3A;
use obvhs::bvh2::Bvh2 as Tree;
use obvhs::bvh2::leaf_collapser::collapse;
use obvhs::bvh2::node::Bvh2Node;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};

use super::{Aabb, Triangle};

/// Most triangles in a leaf.
pub const MAX_LEAF_TRIANGLES: u32 = 4;
/// Deepest hierarchy that is given out; deeper ones (adversarial meshes) are built again, balanced.
pub const MAX_DEPTH: u32 = 64;
/// Cost of a node step in triangle tests, for collapsing leaves.
const TRAVERSAL_COST: f32 = 3.0;
/// Share of the nodes that reinsertion looks at.
const REINSERTION: f32 = 0.05;

/// An inner node with the boxes of both children, 64 bytes.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct BvhNode {
    /// Lower corners of the children's boxes.
    pub min: [[f32; 3]; 2],
    /// Upper corners of the children's boxes; an absent child has `min = +inf, max = -inf`.
    pub max: [[f32; 3]; 2],
    /// Node index where `count` is 0, else first triangle in BVH order.
    pub child: [u32; 2],
    /// Triangles of a leaf child (1 to [`MAX_LEAF_TRIANGLES`]); 0 for an inner or absent child.
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

    fn set(&mut self, side: usize, bounds: &Aabb, child: u32, count: u32) {
        self.min[side] = bounds.min;
        self.max[side] = bounds.max;
        self.child[side] = child;
        self.count[side] = count;
    }
}

/// A binary hierarchy; node 0 is the root. A mesh of one leaf has one node whose second child is absent.
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
    /// A box does not hold what is below it, or is larger than that.
    #[error("node {0} has a box that does not fit its child")]
    Bounds(usize),
    /// A triangle or node is not reached exactly once.
    #[error("a triangle or node is not reached exactly once")]
    Coverage,
    /// The stored depth is wrong.
    #[error("the depth is wrong")]
    Depth,
}

/// Builds the hierarchy over `triangles` (at least one, finite) and the BVH order: `order[k]` is the number of the
/// triangle at place k.
#[must_use]
pub fn build_bvh(triangles: &[Triangle]) -> (Bvh2, Vec<u32>) {
    let (bvh, order) = Layout::of_ploc(triangles);
    if bvh.depth <= MAX_DEPTH { (bvh, order) } else { Layout::balanced(triangles) }
}

/// Nodes and order while being laid out.
#[derive(Default)]
struct Layout {
    nodes: Vec<BvhNode>,
    order: Vec<u32>,
    depth: u32,
}

impl Layout {
    fn of_ploc(triangles: &[Triangle]) -> (Bvh2, Vec<u32>) {
        let obvhs_box = |b: Aabb| obvhs::aabb::Aabb::new(Vec3A::from(b.min), Vec3A::from(b.max));
        let boxes: Vec<_> = triangles.iter().map(|t| obvhs_box(t.bounds())).collect();
        let indices = (0..).take(triangles.len()).collect();
        let mut ploc = PlocBuilder::with_capacity(boxes.len());
        let mut tree = ploc.build(PlocSearchDistance::Medium, &boxes, indices, SortPrecision::U64, 3);
        let mut optimizer = ReinsertionOptimizer::default();
        optimizer.run(&mut tree, REINSERTION, None);
        collapse(&mut tree, MAX_LEAF_TRIANGLES, TRAVERSAL_COST);
        optimizer.run(&mut tree, 2.0 * REINSERTION, None);
        let mut layout = Self::default();
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

    /// Splits at the median of the longest axis: poorer, but never deeper than log2 of the triangles.
    fn balanced(triangles: &[Triangle]) -> (Bvh2, Vec<u32>) {
        let bounds_of = |members: &[u32]| {
            members.iter().fold(Aabb::EMPTY, |b, &i| triangles.get(i as usize).map_or(b, |t| b.union(&t.bounds())))
        };
        let mut members: Vec<u32> = (0..).take(triangles.len()).collect();
        let mut layout = Self::default();
        let mut open = vec![(0..members.len(), None, 1)];
        while let Some((range, parent, depth)) = open.pop() {
            let slot = layout.open(parent, depth);
            let part = &mut members[range.clone()];
            if part.len() <= MAX_LEAF_TRIANGLES as usize {
                // Only the root gets here: children this small are leaves of their parent.
                layout.push_leaf(part, &bounds_of(part), (slot, 0));
                continue;
            }
            let axis = longest_axis(&bounds_of(part));
            let center =
                |i: u32| triangles.get(i as usize).map_or(0.0, |t| t.bounds().min[axis] + t.bounds().max[axis]);
            let middle = part.len() / 2;
            part.select_nth_unstable_by(middle, |&a, &b| center(a).total_cmp(&center(b)).then(a.cmp(&b)));
            let halves = [range.start..range.start + middle, range.start + middle..range.end];
            for (side, half) in halves.into_iter().enumerate().rev() {
                let members = &members[half.clone()];
                if half.len() <= MAX_LEAF_TRIANGLES as usize {
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

fn longest_axis(b: &Aabb) -> usize {
    let extent = |k: usize| b.max[k] - b.min[k];
    (0..3).max_by(|&i, &j| extent(i).total_cmp(&extent(j))).unwrap_or(0)
}

/// What a walk has seen so far.
struct Walk<'a> {
    triangles: &'a [Triangle],
    seen: Vec<bool>,
    nodes: usize,
    depth: u32,
}

impl Bvh2 {
    /// Checks every invariant against the triangles in BVH order: boxes are exact, every triangle and node is reached
    /// exactly once, parents come before children, the depth is right.
    ///
    /// # Errors
    /// The first broken invariant.
    pub fn validate(&self, triangles: &[Triangle]) -> Result<(), BvhError> {
        if self.nodes.is_empty() {
            return Err(BvhError::Empty);
        }
        let mut walk = Walk { triangles, seen: vec![false; triangles.len()], nodes: 0, depth: 0 };
        self.walk(&mut walk)?;
        if walk.nodes != self.nodes.len() || walk.seen.contains(&false) {
            return Err(BvhError::Coverage);
        }
        if walk.depth == self.depth { Ok(()) } else { Err(BvhError::Depth) }
    }

    fn walk(&self, walk: &mut Walk<'_>) -> Result<(), BvhError> {
        let mut open = vec![(0_usize, 1_u32)];
        while let Some((at, depth)) = open.pop() {
            let node = self.nodes.get(at).ok_or(BvhError::Child(at))?;
            walk.nodes += 1;
            walk.depth = walk.depth.max(depth);
            if walk.nodes > self.nodes.len() {
                return Err(BvhError::Coverage);
            }
            for side in 0..2 {
                let child = node.child[side] as usize;
                let inside = if node.count[side] > 0 {
                    walk.leaf(at, child, node.count[side])?
                } else if node.bounds(side).is_empty() {
                    // Absent: only beside the one leaf of a tiny mesh.
                    if self.nodes.len() > 1 || side == 0 {
                        return Err(BvhError::Child(at));
                    }
                    Aabb::EMPTY
                } else {
                    let below = self.nodes.get(child).filter(|_| child > at).ok_or(BvhError::Child(at))?;
                    open.push((child, depth + 1));
                    below.bounds(0).union(&below.bounds(1))
                };
                if node.bounds(side) != inside {
                    return Err(BvhError::Bounds(at));
                }
            }
        }
        Ok(())
    }
}

impl Walk<'_> {
    /// Marks a leaf's triangles and gives their box.
    fn leaf(&mut self, at: usize, first: usize, count: u32) -> Result<Aabb, BvhError> {
        let range = first..first + count as usize;
        let members = self.triangles.get(range.clone()).filter(|_| count <= MAX_LEAF_TRIANGLES);
        let members = members.ok_or(BvhError::Leaf(at))?;
        for seen in self.seen.get_mut(range).unwrap_or_default() {
            if std::mem::replace(seen, true) {
                return Err(BvhError::Coverage);
            }
        }
        Ok(members.iter().fold(Aabb::EMPTY, |b, t| b.union(&t.bounds())))
    }
}
