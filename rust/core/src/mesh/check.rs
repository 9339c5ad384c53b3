// SPDX-License-Identifier: Apache-2.0
//! Checks every invariant of a [`Bvh2`]. For tests and for snapshots that are validated; pure.

use super::bvh::{Bvh2, BvhError, MAX_LEAF_TRIANGLES};
use super::{Aabb, Triangle};

/// What a walk has seen so far.
struct Walk<'a> {
    /// The items: boxes in the order in which leaves name them.
    boxes: &'a [Aabb],
    max_leaf: u32,
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
        let boxes: Vec<Aabb> = triangles.iter().map(Triangle::bounds).collect();
        if boxes.is_empty() { Err(BvhError::Empty) } else { self.check(&boxes, MAX_LEAF_TRIANGLES) }
    }

    /// The same for a hierarchy over boxes ([`super::build_box_bvh`]): `boxes` as they were given, leaves of one item.
    ///
    /// # Errors
    /// The first broken invariant.
    pub fn validate_boxes(&self, boxes: &[Aabb]) -> Result<(), BvhError> {
        self.check(boxes, 1)
    }

    fn check(&self, boxes: &[Aabb], max_leaf: u32) -> Result<(), BvhError> {
        if self.nodes.is_empty() {
            return Err(BvhError::Empty);
        }
        let mut walk = Walk { boxes, max_leaf, seen: vec![false; boxes.len()], nodes: 0, depth: 0 };
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
                    // Absent: only beside the one leaf of a tiny hierarchy, or where there is nothing at all.
                    if self.nodes.len() > 1 || (side == 0 && !walk.boxes.is_empty()) {
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
    /// Marks a leaf's items and gives their box.
    fn leaf(&mut self, at: usize, first: usize, count: u32) -> Result<Aabb, BvhError> {
        let range = first..first + count as usize;
        let members = self.boxes.get(range.clone()).filter(|_| count <= self.max_leaf);
        let members = members.ok_or(BvhError::Leaf(at))?;
        for seen in self.seen.get_mut(range).unwrap_or_default() {
            if std::mem::replace(seen, true) {
                return Err(BvhError::Coverage);
            }
        }
        Ok(members.iter().fold(Aabb::EMPTY, |b, item| b.union(item)))
    }
}
