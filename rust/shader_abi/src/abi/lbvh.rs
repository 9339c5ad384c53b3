// SPDX-License-Identifier: Apache-2.0
//! What the passes that build an instance tree are given.
//!
//! Guarantees: plain data with the offsets of `shaders/include/abi.glsl`. Any thread.

use bytemuck::{Pod, Zeroable};

/// Conservative box of one item, 24 B, in the frame of the assembly: what the build reads.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct LbvhBounds {
    /// Lower corner.
    pub min: [f32; 3],
    /// Upper corner.
    pub max: [f32; 3],
}

/// Binary node that a build passes through, 64 B; where a [`crate::GpuLevelNode`] will be or where none will.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct LbvhNode {
    /// Lower corners of the children's boxes.
    pub min: [[f32; 3]; 2],
    /// Upper corners of the children's boxes; an absent child has the empty box (+inf, -inf).
    pub max: [[f32; 3]; 2],
    /// `count == 0`: index of the child node; else the instance index.
    pub child: [u32; 2],
    /// 1 for an instance, 0 for an inner child.
    pub count: [u32; 2],
}

/// Push constants of every LBVH pass, 120 B; made by [`crate::lbvh_steps`].
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct LbvhPush {
    /// [`LbvhBounds`] per item.
    pub bounds: u64,
    /// u64 Morton keys to read.
    pub keys_in: u64,
    /// u64 Morton keys to write.
    pub keys_out: u64,
    /// u32 item indices to read.
    pub items_in: u64,
    /// u32 item indices to write.
    pub items_out: u64,
    /// u32 digit counts: `[digit][group]`, then the total per digit.
    pub histogram: u64,
    /// [`LbvhNode`] array to write, [`crate::GpuLevelNode`] array at the end.
    pub nodes: u64,
    /// u32 per inner node, then per leaf: parent, bit 31 = second child.
    pub parents: u64,
    /// u32 per inner node: 0, or 1 + height of the child that arrived first.
    pub visits: u64,
    /// One u32: levels of the binary tree, at the end stack entries that a walk may need.
    pub depth: u64,
    /// Lower corner of all centroids (or of anything around them).
    pub origin: [f32; 3],
    /// 2^21 / extent per axis, 0 for an axis without extent.
    pub scale: [f32; 3],
    /// Items.
    pub count: u32,
    /// Lowest bit of the digit of this radix pass.
    pub shift: u32,
    /// Workgroups of the sort (tiles).
    pub groups: u32,
    /// 0.
    pub pad: u32,
}
