// SPDX-License-Identifier: Apache-2.0
//! Chooses the subtrees of a binary hierarchy that become the children of the nodes of a wide one, such that the
//! surface areas of all wide nodes have the least sum, which is the cost of nodes to rays (Ylitie, Karras and Laine
//! 2017, "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs", 3.1; leaves stay as they are).
//! Pure; takes time and memory in proportion to the nodes.

use super::Aabb;
use super::bvh::{Bvh2, BvhNode};

/// Children of a node.
pub(super) const WIDTH: usize = 4;
/// Most trees that a side of a binary node may bring into a wide one.
const MAX_TREES: usize = WIDTH - 1;

/// A child of a wide node.
#[derive(Clone, Copy, Debug)]
pub(super) struct CollapsedChild {
    pub(super) bounds: Aabb,
    /// Index of a node of the binary hierarchy, or the contents of its leaf.
    pub(super) child: u32,
    /// Items of a leaf; 0 for a node.
    pub(super) count: u32,
}

/// Costs of the subtree of a binary node as a forest, for each largest number of trees.
#[derive(Clone, Copy, Debug, Default)]
struct ForestChoice {
    /// Least sums of surface areas with at most one, two and three trees.
    cost: [f64; MAX_TREES],
    /// Number of trees that these sums take.
    used: [u8; MAX_TREES],
    /// Number of trees that the first side gets, when cut into two, three, four trees.
    first: [u8; MAX_TREES],
}

/// The choice of children for each node of a binary hierarchy.
#[derive(Debug)]
pub(super) struct BvhCollapse<'b> {
    bvh: &'b Bvh2,
    /// Choices by node.
    choices: Vec<ForestChoice>,
}

impl<'b> BvhCollapse<'b> {
    /// Weighs all ways to collapse `bvh`, whose parents come before their children. If surfaces are not finite, any way
    /// may be chosen.
    pub(super) fn new(bvh: &'b Bvh2) -> Self {
        let mut choices = vec![ForestChoice::default(); bvh.nodes.len()];
        for (at, node) in bvh.nodes.iter().enumerate().rev() {
            let cost = [0, 1].map(|side| {
                let below = inner(node, side).and_then(|child| choices.get(child));
                below.map_or([0.0; MAX_TREES], |below| below.cost)
            });
            choices[at] = ForestChoice::new(&node.bounds(0).union(&node.bounds(1)), cost);
        }
        Self { bvh, choices }
    }

    /// The children of the wide node that begins at `node`, four at most: nodes first, and of each kind the largest
    /// first. With `in_order` leaves are as in the binary hierarchy.
    ///
    /// Rays that begin in several children, or that any hit ends, take them in roughly this order, because large ones
    /// are hit more likely.
    pub(super) fn children(&self, node: u32, in_order: bool) -> Vec<CollapsedChild> {
        let mut parts = Vec::with_capacity(WIDTH);
        let mut open = vec![(node, WIDTH)];
        while let Some((at, trees)) = open.pop() {
            let (Some(node), Some(choice)) = (self.bvh.nodes.get(at as usize), self.choices.get(at as usize)) else {
                continue;
            };
            let first = usize::from(choice.first[trees - 2]);
            for (side, trees) in [(0, first), (1, trees - first)] {
                let below = inner(node, side).and_then(|child| self.choices.get(child));
                match below.map_or(1, |below| usize::from(below.used[trees - 1])) {
                    1 if below.is_some() || node.count[side] > 0 => parts.push(part(node, side)),
                    1 => {}
                    used => open.push((node.child[side], used)),
                }
            }
        }
        let area = |part: &CollapsedChild| if in_order && part.count > 0 { 0.0 } else { part.bounds.half_area() };
        let is_leaf = |part: &CollapsedChild| part.count > 0;
        parts.sort_by(|a, b| is_leaf(a).cmp(&is_leaf(b)).then(area(b).total_cmp(&area(a))));
        parts
    }
}

/// The node on a side, if there is one.
fn inner(node: &BvhNode, side: usize) -> Option<usize> {
    (node.count[side] == 0 && !node.bounds(side).is_empty()).then_some(node.child[side] as usize)
}

fn part(node: &BvhNode, side: usize) -> CollapsedChild {
    CollapsedChild { bounds: node.bounds(side), child: node.child[side], count: node.count[side] }
}

impl ForestChoice {
    /// The choices of a node with these `bounds`, from the costs of its sides.
    fn new(bounds: &Aabb, [a, b]: [[f64; MAX_TREES]; 2]) -> Self {
        let mut best = Self { used: [1; MAX_TREES], first: [1; MAX_TREES], ..Self::default() };
        let mut cut = [f64::INFINITY; MAX_TREES];
        for trees in 2..=WIDTH {
            for (first, number) in (1..trees).zip(1..) {
                let sum = a[first - 1] + b[trees - first - 1];
                if sum < cut[trees - 2] {
                    (cut[trees - 2], best.first[trees - 2]) = (sum, number);
                }
            }
        }
        best.cost[0] = bounds.half_area() + cut[MAX_TREES - 1];
        for (trees, number) in (2..WIDTH).zip(2..) {
            let (fewer, apart) = (best.cost[trees - 2], cut[trees - 2]);
            (best.cost[trees - 1], best.used[trees - 1]) =
                if apart < fewer { (apart, number) } else { (fewer, best.used[trees - 2]) };
        }
        best
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::build_box_bvh;

    /// The sum of the surfaces of the wide nodes that begin at the nodes `roots` (a bit each) of `bvh`; `None` if one
    /// of them has more than four children.
    fn cost_of(bvh: &Bvh2, roots: u32) -> Option<f64> {
        let mut sum = 0.0;
        for root in (0..bvh.nodes.len()).filter(|at| roots >> at & 1 != 0) {
            let node = &bvh.nodes[root];
            sum += node.bounds(0).union(&node.bounds(1)).half_area();
            let (mut open, mut children) = (vec![root], 0);
            while let Some(at) = open.pop() {
                for side in 0..2 {
                    match inner(&bvh.nodes[at], side) {
                        Some(child) if roots >> child & 1 == 0 => open.push(child),
                        _ => children += 1,
                    }
                }
            }
            if children > WIDTH {
                return None;
            }
        }
        Some(sum)
    }

    #[test]
    fn collapsing_minimizes_surface_area() {
        let mut state = 7_u32;
        let mut number = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32
        };
        let mut is_better = 0;
        for round in 0..200 {
            let boxes: Vec<Aabb> = (0..5 + round % 6)
                .map(|_| {
                    let min = [number(), number(), 0.1 * number()];
                    let size = [number().powi(4), number().powi(4), 0.1 * number()];
                    Aabb { min, max: [0, 1, 2].map(|k| min[k] + size[k]) }
                })
                .collect();
            let bvh = build_box_bvh(&boxes);
            let collapse = BvhCollapse::new(&bvh);
            let (mut roots, mut leaves, mut open) = (0_u32, 0, vec![0_u32]);
            while let Some(at) = open.pop() {
                roots |= 1 << at;
                let parts = collapse.children(at, false);
                let places = parts.iter().map(|part| (part.count > 0, -part.bounds.half_area()));
                assert!(parts.len() <= WIDTH && places.is_sorted(), "nodes first, the largest first: {parts:?}");
                leaves += parts.iter().filter(|part| part.count > 0).count();
                open.extend(parts.iter().filter(|part| part.count == 0).map(|part| part.child));
            }
            assert_eq!(leaves, boxes.len());
            let all = (1_u32..1 << bvh.nodes.len()).filter(|roots| roots & 1 != 0);
            let costs: Vec<f64> = all.filter_map(|roots| cost_of(&bvh, roots)).collect();
            let least = costs.iter().copied().fold(f64::INFINITY, f64::min);
            let got = cost_of(&bvh, roots).expect("four children at most");
            assert!(got <= least * (1.0 + 1e-12), "{got}, not {least}: {roots:b} of {bvh:?}");
            is_better += u32::from(costs.iter().any(|cost| *cost > 1.01 * least));
        }
        assert!(is_better > 150, "there was something to choose: {is_better}");
    }

    #[test]
    fn one_box_gives_one_child_and_none_gives_none() {
        let unit = Aabb { min: [0.0; 3], max: [1.0; 3] };
        for count in [0, 1, 2] {
            let bvh = build_box_bvh(&vec![unit; count]);
            assert_eq!(BvhCollapse::new(&bvh).children(0, false).len(), count);
        }
    }
}
