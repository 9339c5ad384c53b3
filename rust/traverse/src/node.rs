// SPDX-License-Identifier: Apache-2.0
//! A ray against the boxes of a node's four children: traversal/node.glsl. Pure, any thread.

use crate::vector::V3;
use oocpt_abi::{ABSENT, Bvh4Node, LEAF, POINT_BUNDLE};
use std::hint::select_unpredictable;

/// The number of an inner node, or of what a leaf begins with.
pub(crate) const NUMBER: u32 = 0x0fff_ffff;

/// The ray of a level, as boxes are tested with it; a fourth number is 0.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(16))]
pub(crate) struct BoxRay {
    pub(crate) o: [f32; 4],
    pub(crate) reciprocal: [f32; 4],
    /// How far boxes are padded, along the ray.
    pub(crate) around: [f32; 4],
    /// How the planes of a node lie for it; only what needs it sets it.
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

/// What a walk does with a node: the children that it meets.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EnteredChildren {
    /// Where the ray enters each child, or the node if that is farther.
    pub(crate) entries: [f32; 4],
    /// A bit for each child that is met.
    pub(crate) mask: u32,
}

/// The children of a node of a mesh: nodes first, as many as `first_child` says, then leaves.
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

    /// A bit for each child that there is.
    #[inline(always)]
    pub(crate) fn there(&self) -> u32 {
        u32::from(self.leaves.there) | ((1 << self.inner) - 1)
    }

    /// What the child in a lane is: a node or a leaf.
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

/// What the byte of a node says that counts the triangles of its leaves.
#[derive(Clone, Copy, Debug)]
struct LeafCounts {
    /// A byte to a child: its triangles.
    counts: u32,
    /// A byte to a child: those of the children before it.
    before: u32,
    /// A bit for each child that has some.
    there: u8,
}

/// By that byte, two bits to a child.
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

/// The points of a leaf that says which bundle it has, of so many points: `bundle_members` of the shaders.
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
