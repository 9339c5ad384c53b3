// SPDX-License-Identifier: Apache-2.0
//! The shape of a hierarchy over boxes: which node holds which, without bounds. When the boxes have moved, the bounds
//! are made anew from the leaves up, and nothing is sorted (I. Wald, S. Boulos, P. Shirley, "Ray Tracing Deformable
//! Scenes Using Dynamic Bounding Volume Hierarchies", ACM Transactions on Graphics 26(1), 2007). Pure; one thread.

use oocpt_abi::{ABSENT, LEAF, LevelNode};

use super::Aabb;
use super::bvh4::level_node;
use super::collapse::WIDTH;
use super::level::LevelTree;

/// Growth of the area of all nodes from which on a shape is better made anew.
const WORN: f64 = 1.5;

/// What stays of a hierarchy when its boxes move.
#[derive(Clone, Debug, PartialEq)]
pub struct LevelShape {
    /// Children of each node, as [`LevelNode::child`].
    children: Vec<[u32; WIDTH]>,
    stack: u32,
    /// Number of boxes.
    boxes: usize,
    /// Half the surface of all nodes, for the boxes that the hierarchy was built for.
    area: f64,
}

/// A hierarchy of an earlier shape.
#[derive(Clone, Debug, PartialEq)]
pub struct RefittedLevel {
    /// Its nodes bound the boxes as tightly as those of a tree that is built.
    pub tree: LevelTree,
    /// Surface of all nodes, of that when the shape was made: what a walk costs more at most.
    pub growth: f64,
}

impl RefittedLevel {
    /// Whether the boxes have moved so far from each other that a tree that is built anew would be clearly better.
    #[must_use]
    pub fn is_worn(&self) -> bool {
        has_worn(self.growth)
    }
}

/// Whether the surface of a tree's nodes has grown so much, by this factor, that it is better built anew.
#[must_use]
pub fn has_worn(growth: f64) -> bool {
    growth > WORN || growth.is_nan()
}

impl LevelShape {
    /// The shape of `tree`, which [`super::build_level`] made of `boxes`.
    #[must_use]
    pub fn of(tree: &LevelTree, boxes: &[Aabb]) -> Self {
        let children = tree.nodes.iter().map(|node| node.child).collect();
        let mut shape = Self { children, stack: tree.stack, boxes: boxes.len(), area: 0.0 };
        shape.area = shape.fit(boxes, |_, _, _| ());
        shape
    }

    /// The tree of this shape over other `boxes`; `None` if there are more or fewer.
    #[must_use]
    pub fn refit(&self, boxes: &[Aabb]) -> Option<RefittedLevel> {
        if boxes.len() != self.boxes {
            return None;
        }
        let mut nodes = vec![LevelNode::default(); self.children.len()];
        let area = self.fit(boxes, |at, bounds, child| {
            if let Some(node) = nodes.get_mut(at) {
                *node = level_node(bounds.iter(), child);
            }
        });
        Some(RefittedLevel { tree: LevelTree { nodes, stack: self.stack }, growth: area / self.area })
    }

    /// Bytes of host memory held.
    #[must_use]
    pub fn host_bytes(&self) -> u64 {
        (size_of::<Self>() + size_of_val(&self.children[..])) as u64
    }

    /// Calls `emit` with each node's number, the boxes of its children, and these; children before their parents.
    /// Returns half the surface of all nodes.
    fn fit(&self, boxes: &[Aabb], mut emit: impl FnMut(usize, &[Aabb; WIDTH], [u32; WIDTH])) -> f64 {
        let mut around = vec![Aabb::EMPTY; self.children.len()];
        let mut sum = 0.0;
        for (at, child) in self.children.iter().enumerate().rev() {
            let bounds = child.map(|child| match child {
                ABSENT => Aabb::EMPTY,
                leaf if leaf & LEAF != 0 => boxes.get((leaf & !LEAF) as usize).copied().unwrap_or(Aabb::EMPTY),
                // Parents come before their children, so its box is known.
                node => around.get(node as usize).copied().unwrap_or(Aabb::EMPTY),
            });
            let all = bounds.iter().fold(Aabb::EMPTY, |all, b| all.union(b));
            sum += if all.is_empty() { 0.0 } else { all.half_area() };
            around[at] = all;
            emit(at, &bounds, *child);
        }
        sum
    }
}
