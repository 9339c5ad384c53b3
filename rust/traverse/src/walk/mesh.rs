// SPDX-License-Identifier: Apache-2.0
//! The part of a walk inside of a mesh.

use super::RayTraversal;
use super::stack::StackKey;
use crate::node::{MeshChildren, NUMBER, bundle_members};
use crate::simd::Simd;
use oocpt_abi::{Bvh4Node, LEAF, MESH_LEAF_MASK, RETURN};

/// How many triangles a leaf of a mesh has.
#[inline(always)]
pub(super) fn triangles_of(leaf: u32) -> u32 {
    ((leaf >> 28) & 7) + 1
}

impl<const ANY_HIT: bool> RayTraversal<'_, '_, ANY_HIT> {
    /// From node to node and leaf to leaf, until the mesh is behind the ray, the walk ends or its turn does.
    #[inline(always)]
    pub(super) fn walk_mesh(&mut self, simd: impl Simd, turn: &mut u32) {
        let (ray, nodes) = (self.at.ray, self.at.nodes);
        let (of_points, points) = (self.pose.of_points, self.mesh.triangle_count);
        let mut next = self.next;
        loop {
            let reference = next.reference();
            if reference < LEAF {
                next = match nodes.item::<Bvh4Node>(reference) {
                    Some(node) => {
                        let met = simd.meet_mesh(&node, &ray, self.limit, next.entry());
                        let children = MeshChildren::new(&node);
                        self.stack.choose(met, self.pop_limit(), |lane| {
                            let child = children.at(lane);
                            if of_points { bundle_members(child, points) } else { child }
                        })
                    }
                    None => self.pop(),
                };
                *turn = turn.saturating_sub(1);
            } else if reference < RETURN {
                self.entry = next.entry();
                let first = reference & NUMBER;
                let end = first + triangles_of(reference);
                let ends = if self.mesh.flags & MESH_LEAF_MASK != 0 {
                    self.visit_others(first, end)
                } else {
                    self.visit_triangles(simd, first, end)
                };
                next = if ends { StackKey::DONE } else { self.pop() };
                *turn = turn.saturating_sub(1);
            } else {
                break;
            }
            if *turn == 0 {
                break;
            }
        }
        self.next = next;
    }
}
