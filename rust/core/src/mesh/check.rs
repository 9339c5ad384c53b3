// SPDX-License-Identifier: Apache-2.0
//! Checks every invariant of a [`Bvh2`] and of a [`Bvh4`]. For tests and for snapshots that are validated; pure.

use super::bundle::bundle_boxes;
use super::bvh::{Bvh2, BvhError, MAX_LEAF_TRIANGLES};
use super::bvh4::{Bvh4, WIDTH};
use super::{Aabb, LeafKind, Triangle};
use oocpt_abi::NodeChild;

/// What a walk has seen so far.
struct BvhCheck<'a> {
    /// The items: boxes in the order in which leaves name them.
    boxes: &'a [Aabb],
    max_leaf: u32,
    seen: Vec<bool>,
    nodes: usize,
    /// Of a [`Bvh4`]: of the stack.
    depth: u32,
    /// Of a [`Bvh4`]: leaves hold parts of the items.
    is_clipped: bool,
}

impl Bvh2 {
    /// Checks every invariant against the triangles in BVH order: boxes are exact, every triangle and node is reached
    /// exactly once, parents come before children, the depth is right.
    ///
    /// # Errors
    /// The first broken invariant.
    pub fn validate(&self, triangles: &[Triangle], kind: LeafKind) -> Result<(), BvhError> {
        let boxes: Vec<Aabb> = triangles.iter().map(|triangle| triangle.bounds(kind)).collect();
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
        let mut walk =
            BvhCheck { boxes, max_leaf, seen: vec![false; boxes.len()], nodes: 0, depth: 0, is_clipped: false };
        self.walk(&mut walk)?;
        if walk.nodes != self.nodes.len() || walk.seen.contains(&false) {
            return Err(BvhError::Coverage);
        }
        if walk.depth == self.depth { Ok(()) } else { Err(BvhError::Depth) }
    }

    fn walk(&self, walk: &mut BvhCheck<'_>) -> Result<(), BvhError> {
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

impl Bvh4 {
    /// Checks every invariant against the triangles in BVH order: boxes hold what is in them with less than a cell to
    /// spare, every triangle and node is reached exactly once, parents come before children, the stack is that of the
    /// longest way down.
    ///
    /// # Errors
    /// The first broken invariant.
    pub fn validate(&self, triangles: &[Triangle], kind: LeafKind) -> Result<(), BvhError> {
        let boxes: Vec<Aabb> = triangles.iter().map(|triangle| triangle.bounds(kind)).collect();
        self.validate_items(&boxes, kind)
    }

    /// The same against the boxes of the items in BVH order: those of the whole shutter where points move.
    ///
    /// # Errors
    /// The first broken invariant.
    pub fn validate_items(&self, boxes: &[Aabb], kind: LeafKind) -> Result<(), BvhError> {
        match kind {
            LeafKind::Points => self.validate_leaves(&bundle_boxes(boxes), 1, false),
            _ => self.validate_leaves(boxes, MAX_LEAF_TRIANGLES, false),
        }
    }

    /// The same where leaves are boxes of what is there of the items, which are triangles: no box goes beyond the items
    /// in it.
    ///
    /// # Errors
    /// The first broken invariant.
    pub fn validate_clipped(&self, boxes: &[Aabb]) -> Result<(), BvhError> {
        self.validate_leaves(boxes, MAX_LEAF_TRIANGLES, true)
    }

    /// Against the boxes of what leaves count.
    fn validate_leaves(&self, boxes: &[Aabb], max_leaf: u32, is_clipped: bool) -> Result<(), BvhError> {
        if self.nodes.is_empty() || boxes.is_empty() {
            return Err(BvhError::Empty);
        }
        let seen = vec![false; boxes.len()];
        let mut walk = BvhCheck { boxes, max_leaf, seen, nodes: 0, depth: 0, is_clipped };
        self.walk(&mut walk, 0, 0)?;
        if walk.nodes != self.nodes.len() || walk.seen.contains(&false) {
            return Err(BvhError::Coverage);
        }
        if walk.depth == self.stack { Ok(()) } else { Err(BvhError::Depth) }
    }

    /// Checks what is below node `at`, where `waiting` children wait on the stack; gives its box.
    fn walk(&self, walk: &mut BvhCheck<'_>, at: usize, waiting: u32) -> Result<Aabb, BvhError> {
        let node = self.nodes.get(at).ok_or(BvhError::Child(at))?;
        walk.nodes += 1;
        let children: Vec<NodeChild> = (0..4).map(|c| node.child(c)).take_while(|c| *c != NodeChild::Absent).collect();
        let waiting = waiting + u32::try_from(children.len()).unwrap_or(u32::MAX).saturating_sub(1);
        walk.depth = walk.depth.max(waiting);
        if children.is_empty() || (0..).take(WIDTH).skip(children.len()).any(|c| node.child(c) != NodeChild::Absent) {
            return Err(BvhError::Child(at));
        }
        let mut all = Aabb::EMPTY;
        for (place, child) in children.into_iter().enumerate() {
            let inside = match child {
                NodeChild::Inner(child) if child as usize > at => self.walk(walk, child as usize, waiting)?,
                NodeChild::Leaf { first, count } => walk.leaf(at, first as usize, count)?,
                _ => return Err(BvhError::Child(at)),
            };
            for axis in 0..3 {
                let [lower, upper] = node.planes(place, axis);
                let spare = [f64::from(inside.min[axis]) - lower, upper - f64::from(inside.max[axis])];
                let least = if walk.is_clipped { f64::NEG_INFINITY } else { 0.0 };
                if !spare.iter().all(|spare| (least..node.cell(axis)).contains(spare)) {
                    return Err(BvhError::Bounds(at));
                }
            }
            all = all.union(&inside);
        }
        Ok(all)
    }
}

impl BvhCheck<'_> {
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
