// SPDX-License-Identifier: Apache-2.0
//! Tests a ray against the boxes of a node's four children: traversal/node.glsl. Pure, any thread.

use crate::vector::V3;
use oocpt_abi::{ABSENT, Bvh4Node, LEAF, POINT_BUNDLE};
use std::hint::select_unpredictable;

/// Mask of the number of an inner node, or of a leaf's first item.
pub(crate) const NUMBER: u32 = 0x0fff_ffff;

/// The ray of a level, in the form that box tests use; the fourth numbers are 0.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(16))]
pub(crate) struct BoxRay {
    pub(crate) o: [f32; 4],
    pub(crate) reciprocal: [f32; 4],
    /// Padding of the boxes along the ray.
    pub(crate) around: [f32; 4],
    /// Order of a node's planes along the ray; set only for instructions that use it.
    pub(crate) turns: [[u8; 16]; 2],
}

impl BoxRay {
    pub(crate) const NONE: Self = Self { o: [0.0; 4], reciprocal: [0.0; 4], around: [0.0; 4], turns: [[0; 16]; 2] };

    #[inline(always)]
    pub(crate) fn origin(&self) -> V3 {
        let [x, y, z, _] = self.o;
        V3([x, y, z])
    }
}

/// The children of a node that a ray meets.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EnteredChildren {
    /// Distance at which the ray enters each child, or the node if that is farther.
    pub(crate) entries: [f32; 4],
    /// Mask with one bit for each child that is met.
    pub(crate) mask: u32,
}

/// The children of a node of a mesh: `first_child` nodes first, then leaves.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MeshChildren {
    inner: u32,
    first: u32,
    leaves: LeafCounts,
    first_triangle: u32,
}

impl MeshChildren {
    #[inline(always)]
    pub(crate) fn new(node: &Bvh4Node) -> Self {
        let [.., counts] = node.cell_and_counts.to_le_bytes();
        Self {
            inner: node.first_child >> 28,
            first: node.first_child & NUMBER,
            leaves: LEAVES[usize::from(counts)],
            first_triangle: node.first_triangle,
        }
    }

    /// Mask with one bit for each child that exists.
    #[inline(always)]
    pub(crate) fn there(&self) -> u32 {
        u32::from(self.leaves.there) | ((1 << self.inner) - 1)
    }

    /// Reference of the child in a lane: a node or a leaf.
    #[inline(always)]
    pub(crate) fn at(&self, lane: u32) -> u32 {
        let lane = lane & 3;
        let leaf = leaf(
            (self.leaves.counts >> (8 * lane)) & 255,
            self.first_triangle.wrapping_add((self.leaves.before >> (8 * lane)) & 255),
        );
        select_unpredictable(lane < self.inner, self.first.wrapping_add(lane), leaf)
    }
}

/// The triangle counts in a node's byte.
#[derive(Clone, Copy, Debug)]
struct LeafCounts {
    /// Number of triangles of each child, a byte each.
    counts: u32,
    /// Number of triangles of the children before each child, a byte each.
    before: u32,
    /// Mask with one bit for each child that has triangles.
    there: u8,
}

/// Counts by that byte, which has two bits for each child.
static LEAVES: [LeafCounts; 256] = {
    let mut all = [LeafCounts { counts: 0, before: 0, there: 0 }; 256];
    let mut byte = 0_u32;
    while byte < 256 {
        let (mut lane, mut before) = (0, 0);
        let leaves = &mut all[byte as usize];
        while lane < 4 {
            let count = (byte >> (2 * lane)) & 3;
            leaves.counts |= count << (8 * lane);
            leaves.before |= before << (8 * lane);
            leaves.there |= ((count != 0) as u8) << lane;
            before += count;
            lane += 1;
        }
        byte += 1;
    }
    all
};

/// The points of a leaf, which has the number of its bundle, of a mesh with this number of points: `bundle_members` of
/// the shaders.
#[inline(always)]
pub(crate) fn bundle_members(leaf: u32, points: u32) -> u32 {
    if leaf < LEAF || leaf == ABSENT {
        return leaf;
    }
    let missing = points.wrapping_neg() & (POINT_BUNDLE - 1);
    let end = (POINT_BUNDLE * ((leaf & NUMBER) + 1)).wrapping_sub(missing);
    let begin = end.saturating_sub(POINT_BUNDLE);
    self::leaf(end - begin, begin)
}

#[inline(always)]
fn leaf(count: u32, first: u32) -> u32 {
    LEAF | (count.wrapping_sub(1) & 7) << 28 | (first & NUMBER)
}
