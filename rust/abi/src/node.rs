// SPDX-License-Identifier: Apache-2.0
//! Nodes of trees: four children to a node, their boxes in 8 bits per plane on a grid of the node's own (after Ylitie,
//! Karras and Laine 2017, "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs").
//!
//! Guarantees: plain data, of which the build makes the structs of the shaders. Any thread.

use bytemuck::{Pod, Zeroable};

shared! {
    /// Node of a mesh's hierarchy, 48 B: the boxes of at most four children. The root is node 0. Inner children come
    /// first, then leaves.
    #[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Pod, Zeroable)]
    pub struct Bvh4Node {
        /// Lower corner of the grid, the bits of three floats.
        pub origin: [u32; 3],
        /// From the lowest byte: the exponents of the cell's edges, biased as in floats and never 0; then, two bits to
        /// a child, the triangles of a leaf (1 to 3), 0 for an inner or absent child.
        pub cell_and_counts: u32,
        /// Per axis, a byte to a child from the lowest: its lower plane, in cells from the origin.
        pub lower: [u32; 3],
        /// The same of the upper planes.
        pub upper: [u32; 3],
        /// Node of the first inner child, the others follow; in the four highest bits how many there are.
        pub first_child: u32,
        /// First triangle of the first leaf, the others follow; below 2^28, as nodes and instances. Of points, leaves
        /// count bundles.
        pub first_triangle: u32,
    }
}

/// What a child is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NodeChild {
    /// A node.
    Inner(u32),
    /// Triangles.
    Leaf {
        /// The first one, in BVH order.
        first: u32,
        /// How many.
        count: u32,
    },
    /// Nothing.
    Absent,
}

impl Bvh4Node {
    /// Place of the number of inner children in `first_child`.
    pub const INNER_SHIFT: u32 = 28;

    /// Edge of a cell along `axis`.
    #[must_use]
    pub fn cell(&self, axis: usize) -> f64 {
        f64::from(f32::from_bits((self.cell_and_counts >> (8 * axis) & 255) << 23))
    }

    /// Lower and upper plane of child `at` along `axis`, exact but for the rounding of double precision.
    #[must_use]
    pub fn planes(&self, at: usize, axis: usize) -> [f64; 2] {
        let origin = f64::from(f32::from_bits(self.origin[axis]));
        [self.lower[axis], self.upper[axis]]
            .map(|planes| origin + f64::from(planes >> (8 * at) & 255) * self.cell(axis))
    }

    /// What child `at` (0 to 3) is.
    #[must_use]
    pub fn child(&self, at: u32) -> NodeChild {
        let count = |at: u32| self.cell_and_counts >> (24 + 2 * at) & 3;
        if at < self.first_child >> Self::INNER_SHIFT {
            NodeChild::Inner((self.first_child & ((1 << Self::INNER_SHIFT) - 1)) + at)
        } else if count(at) > 0 {
            NodeChild::Leaf { first: self.first_triangle + (0..at).map(count).sum::<u32>(), count: count(at) }
        } else {
            NodeChild::Absent
        }
    }
}

shared! {
    /// Node of a hierarchy over boxes of instances, 64 B: grid and planes as those of [`Bvh4Node`], but children are
    /// named one by one. The root is node 0.
    #[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Pod, Zeroable)]
    pub struct LevelNode {
        /// As [`Bvh4Node::origin`].
        pub origin: [u32; 3],
        /// Exponents as in [`Bvh4Node::cell_and_counts`], no counts.
        pub cell: u32,
        /// As [`Bvh4Node::lower`].
        pub lower: [u32; 3],
        /// As [`Bvh4Node::upper`].
        pub upper: [u32; 3],
        /// A node, [`crate::LEAF`] and the number of a box, or [`crate::ABSENT`].
        pub child: [u32; 4],
        /// 0.
        pub pad: [u32; 2],
    }
}

impl LevelNode {
    /// Planes of child `at` along `axis`, as [`Bvh4Node::planes`].
    #[must_use]
    pub fn planes(&self, at: usize, axis: usize) -> [f64; 2] {
        let Self { origin, cell, lower, upper, .. } = *self;
        Bvh4Node { origin, cell_and_counts: cell, lower, upper, ..Bvh4Node::default() }.planes(at, axis)
    }
}
