// SPDX-License-Identifier: Apache-2.0
//! A ray against the boxes of a node's four children: traversal/node.glsl. The four are one loop over lanes, which the
//! compiler makes vector operations of. Pure, any thread.

use crate::vector::V3;
use oocpt_shader_abi::{ABSENT, GpuLevelNode, GpuMeshNode, LEAF, POINT_BUNDLE};

/// `SLAB_PAD` of traversal/box.glsl.
const SLAB_PAD: f32 = 1.000_001_2;

/// The number of an inner node, or of what a leaf begins with.
pub(crate) const NUMBER: u32 = 0x0fff_ffff;

/// The ray of a level.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct BoxRay {
    pub(crate) o: V3,
    pub(crate) reciprocal: V3,
    /// How far boxes are padded, along the ray.
    pub(crate) around: V3,
}

/// What a walk does with a node: the children that it meets.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Met {
    /// Where the ray enters each child.
    pub(crate) entries: [f32; 4],
    /// A bit for each child that is met.
    pub(crate) mask: u32,
}

#[inline(always)]
fn lanes(planes: u32) -> [f32; 4] {
    planes.to_le_bytes().map(f32::from)
}

/// The children of a box grid that the ray enters before `limit`, which is no NaN.
#[inline(always)]
fn meet(origin: [u32; 3], cell: u32, [lower, upper]: [[u32; 3]; 2], ray: &BoxRay, limit: f32) -> Met {
    // Comparisons that keep what is there where the other is NaN: what min and max of the shaders do.
    let mut entries = [0.0_f32; 4];
    let mut leaves = [f32::INFINITY; 4];
    for axis in [2, 1, 0] {
        let reciprocal = ray.reciprocal[axis];
        let from = (f32::from_bits(origin[axis]) - ray.o[axis]) * reciprocal;
        let scale = f32::from_bits(((cell >> (8 * axis)) & 255) << 23) * reciprocal;
        let (near_from, far_from) = (from - ray.around[axis], from + ray.around[axis]);
        let is_backward = reciprocal < 0.0;
        let near = lanes(if is_backward { upper[axis] } else { lower[axis] });
        let far = lanes(if is_backward { lower[axis] } else { upper[axis] });
        for lane in 0..4 {
            let a = near[lane] * scale + near_from;
            let b = far[lane] * scale + far_from;
            entries[lane] = if a > entries[lane] { a } else { entries[lane] };
            leaves[lane] = if b < leaves[lane] { b } else { leaves[lane] };
        }
    }
    let mut mask = 0;
    for lane in 0..4 {
        let leave = leaves[lane] * SLAB_PAD;
        let leave = if leave < limit { leave } else { limit };
        mask |= u32::from(entries[lane] <= leave) << lane;
    }
    Met { entries, mask }
}

/// The children of a node of the top level, a chunk or an assembly.
#[inline(always)]
pub(crate) fn meet_level(node: &GpuLevelNode, ray: &BoxRay, limit: f32) -> (Met, [u32; 4]) {
    let mut met = meet(node.origin, node.cell, [node.lower, node.upper], ray, limit);
    for (lane, &child) in node.child.iter().enumerate() {
        met.mask &= !(u32::from(child == ABSENT) << lane);
    }
    (met, node.child)
}

/// The children of a node of a mesh: nodes first, as many as `first_child` says, then leaves.
#[inline(always)]
pub(crate) fn meet_mesh(node: &GpuMeshNode, ray: &BoxRay, limit: f32) -> (Met, [u32; 4]) {
    let cell = node.cell_and_counts & 0x00ff_ffff;
    let mut met = meet(node.origin, cell, [node.lower, node.upper], ray, limit);
    let (inner, first) = (node.first_child >> 28, node.first_child & NUMBER);
    let counts = node.cell_and_counts >> 24;
    let mut triangle = node.first_triangle;
    let mut children = [0; 4];
    for (lane, child) in (0_u32..).zip(&mut children) {
        let count = (counts >> (2 * lane)) & 3;
        let is_inner = lane < inner;
        *child = if is_inner { first.wrapping_add(lane) } else { leaf(count, triangle) };
        met.mask &= !(u32::from(!is_inner && count == 0) << lane);
        triangle = triangle.wrapping_add(count);
    }
    (met, children)
}

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
