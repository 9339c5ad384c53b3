// SPDX-License-Identifier: Apache-2.0
//! The light tree: which lights are near each other and look the same way (`shaders/light/tree.glsl` walks it).
//!
//! Conty Estevez and Kulla 2018, "Importance Sampling of Many Lights with Adaptive Tree Splitting" (surface area
//! orientation heuristic, eq. 1); cones after Pharr et al. 2023, 3.8.4 and 12.6.3. Built top down in bins; below
//! `HEURISTIC_DEPTH` halves are cut off by number, so that no way is longer than [`LIGHT_TREE_DEPTH`]. Pure; the result
//! depends on the lights' order only.

use super::narrow;
use oocpt_abi::{GpuLightNode, LIGHT_LEAF, LIGHT_TREE_DEPTH};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Most lights that the tree takes.
pub(super) const MAX_LIGHTS: usize = 1 << 23;
const HEURISTIC_DEPTH: u32 = 20;
const BINS: usize = 12;
const _: () = assert!(HEURISTIC_DEPTH + 23 < LIGHT_TREE_DEPTH, "halving fits the rest of the depth");

/// Where a light is, where it shines, and how much.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LightBounds {
    pub(super) min: [f64; 3],
    pub(super) max: [f64; 3],
    pub(super) axis: [f64; 3],
    /// Half angle of the cone about `axis` in which the directions lie that the light, or its parts, look in.
    pub(super) spread: f64,
    /// Angle up to which it shines about each of these.
    pub(super) emission: f64,
    /// How much goes to the other side, 0 to 1.
    pub(super) back: f64,
    pub(super) power: f64,
}

/// What is the same from all sides, has no power and is nowhere.
pub(super) const NOTHING: LightBounds = LightBounds {
    min: [0.0; 3],
    max: [0.0; 3],
    axis: [0.0, 0.0, 1.0],
    spread: 0.0,
    emission: 0.0,
    back: 0.0,
    power: 0.0,
};

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The cone around two.
fn cone_union(a: ([f64; 3], f64), b: ([f64; 3], f64)) -> ([f64; 3], f64) {
    let (a, b) = if a.1 >= b.1 { (a, b) } else { (b, a) };
    let between = dot(a.0, b.0).clamp(-1.0, 1.0).acos();
    if (between + b.1).min(PI) <= a.1 {
        return a;
    }
    let spread = 0.5 * (a.1 + between + b.1);
    if spread >= PI {
        return (a.0, PI);
    }
    // From a's axis towards b's.
    let turn = spread - a.1;
    let aside = [0, 1, 2].map(|k| b.0[k] - a.0[k] * between.cos());
    let length = dot(aside, aside).sqrt();
    if length.is_nan() || length <= 1e-12 {
        return (a.0, PI);
    }
    let axis = [0, 1, 2].map(|k| a.0[k] * turn.cos() + aside[k] / length * turn.sin());
    let length = dot(axis, axis).sqrt();
    (axis.map(|x| x / length), spread)
}

impl LightBounds {
    pub(super) fn union(&self, other: &Self) -> Self {
        if other.power <= 0.0 {
            return *self;
        }
        if self.power <= 0.0 {
            return *other;
        }
        // What shines the same to both sides has no sign.
        let both = self.back >= 1.0 && other.back >= 1.0;
        let turn = if both && dot(self.axis, other.axis) < 0.0 { -1.0 } else { 1.0 };
        let (axis, spread) = cone_union((self.axis, self.spread), (other.axis.map(|x| turn * x), other.spread));
        let is_alike = self.back.to_bits() == other.back.to_bits();
        Self {
            min: [0, 1, 2].map(|k| self.min[k].min(other.min[k])),
            max: [0, 1, 2].map(|k| self.max[k].max(other.max[k])),
            axis,
            spread: if is_alike { spread } else { PI },
            emission: self.emission.max(other.emission),
            back: self.back.max(other.back),
            power: self.power + other.power,
        }
    }

    fn center(&self, k: usize) -> f64 {
        0.5 * (self.min[k] + self.max[k])
    }

    /// Power times area times solid angle (Conty Estevez and Kulla, eq. 1 and 2).
    fn cost(&self) -> f64 {
        let d = [0, 1, 2].map(|k| self.max[k] - self.min[k]);
        let area = 2.0 * (d[0] * d[1] + d[1] * d[2] + d[2] * d[0]);
        // Lights in one plane or place still differ in direction.
        let size = dot(d, d).max(1e-60);
        let (o, w) = (self.spread, (self.spread + self.emission).min(PI));
        let angle =
            TAU * (1.0 - o.cos()) + FRAC_PI_2 * (2.0 * w * o.sin() - (o - 2.0 * w).cos() - 2.0 * o * o.sin() + o.cos());
        self.power * (area + 1e-3 * size) * angle.max(1e-3)
    }
}

/// The nodes, the root first; leaves name lights by their number in `lights`. Not more than [`MAX_LIGHTS`] are taken.
/// Lights of power 0 are never chosen, nor found by rays.
pub(super) fn build(lights: &[LightBounds]) -> Vec<GpuLightNode> {
    let count = u32::try_from(lights.len().min(MAX_LIGHTS)).unwrap_or_default();
    let mut order: Vec<u32> = (0..count).collect();
    let mut nodes = Vec::with_capacity(order.len());
    nodes.push(empty());
    let builder = LightTreeBuilder { lights };
    match order.len() {
        0 => {}
        1 => {
            let child = builder.bounds(&order);
            set(&mut nodes, 0, 0, &child, LIGHT_LEAF);
        }
        _ => builder.split(&mut nodes, 0, &mut order, 0),
    }
    nodes
}

/// One node over two trees whose roots' bounds are given; its children are not nodes of `nodes`.
pub(super) fn joint(first: &LightBounds, second: &LightBounds) -> GpuLightNode {
    let mut nodes = [empty()];
    set(&mut nodes, 0, 0, first, LIGHT_LEAF);
    set(&mut nodes, 0, 1, second, LIGHT_LEAF);
    let [node] = nodes;
    node
}

/// Appends a tree of [`build`] whose leaves are to be numbered from `first_leaf`; gives the index of its root.
pub(super) fn append(nodes: &mut Vec<GpuLightNode>, tree: &[GpuLightNode], first_leaf: u32) -> u32 {
    // Fewer than 2^25.
    let root = u32::try_from(nodes.len()).unwrap_or_default();
    nodes.extend(tree.iter().map(|node| GpuLightNode {
        child: node.child.map(|child| child + if child & LIGHT_LEAF != 0 { first_leaf } else { root }),
        ..*node
    }));
    root
}

/// The turns from the root to each of `count` leaves, the first in the lowest bit: 1 is the second child.
pub(super) fn trails(nodes: &[GpuLightNode], count: usize) -> Vec<u64> {
    let mut trails = vec![0; count];
    let mut open = vec![(0_u32, 0_u64, 0_u32)];
    while let Some((index, trail, depth)) = open.pop() {
        let Some(node) = nodes.get(index as usize) else { continue };
        for side in (0..2).filter(|&side| node.power[side] > 0.0) {
            let trail = trail | (side as u64) << depth;
            let child = node.child[side];
            if child & LIGHT_LEAF == 0 {
                open.push((child, trail, depth + 1));
            } else if let Some(slot) = trails.get_mut((child & !LIGHT_LEAF) as usize) {
                *slot = trail;
            }
        }
    }
    trails
}

fn empty() -> GpuLightNode {
    GpuLightNode { cos_axis: [-1.0; 2], child: [LIGHT_LEAF; 2], ..bytemuck::Zeroable::zeroed() }
}

fn set(nodes: &mut [GpuLightNode], node: usize, side: usize, bounds: &LightBounds, child: u32) {
    let Some(node) = nodes.get_mut(node) else { return };
    let outwards = |value: f64, up: bool| {
        let near = narrow(value);
        match (up, f64::from(near) < value, f64::from(near) > value) {
            (true, true, _) => near.next_up(),
            (false, _, true) => near.next_down(),
            _ => near,
        }
    };
    node.min[side] = bounds.min.map(|v| outwards(v, false));
    node.max[side] = bounds.max.map(|v| outwards(v, true));
    node.axis[side] = bounds.axis.map(narrow);
    node.cos_axis[side] = narrow(bounds.spread.min(PI).cos());
    node.cos_emission[side] = narrow(bounds.emission.min(PI).cos());
    node.power[side] = narrow(bounds.power);
    node.back[side] = narrow(bounds.back);
    node.child[side] = child;
}

struct LightTreeBuilder<'a> {
    lights: &'a [LightBounds],
}

impl LightTreeBuilder<'_> {
    fn light(&self, index: u32) -> Option<&LightBounds> {
        self.lights.get(index as usize)
    }

    fn bounds(&self, order: &[u32]) -> LightBounds {
        order.iter().filter_map(|&i| self.light(i)).fold(NOTHING, |sum, light| sum.union(light))
    }

    /// Makes the children of `node` from at least two lights. Depth is bounded, so the recursion is.
    fn split(&self, nodes: &mut Vec<GpuLightNode>, node: usize, order: &mut [u32], depth: u32) {
        let middle = self.cut(order, depth);
        let (left, right) = order.split_at_mut(middle);
        for (side, part) in [left, right].into_iter().enumerate() {
            let bounds = self.bounds(part);
            if let [light] = part {
                set(nodes, node, side, &bounds, LIGHT_LEAF | *light);
                continue;
            }
            let child = nodes.len();
            nodes.push(empty());
            // There are at most twice as many nodes as lights.
            set(nodes, node, side, &bounds, u32::try_from(child).unwrap_or_default());
            self.split(nodes, child, part, depth + 1);
        }
    }

    /// Sorts `order` into two parts, and says where the second begins: neither is empty.
    fn cut(&self, order: &mut [u32], depth: u32) -> usize {
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for light in order.iter().filter_map(|&i| self.light(i)) {
            for k in 0..3 {
                low[k] = low[k].min(light.center(k));
                high[k] = high[k].max(light.center(k));
            }
        }
        let extent = [0, 1, 2].map(|k| high[k] - low[k]);
        let widest = (0..3).max_by(|&a, &b| extent[a].total_cmp(&extent[b])).unwrap_or(0);
        let half = order.len() / 2;
        if order.len() > 2
            && depth < HEURISTIC_DEPTH
            && extent[widest] > 0.0
            && let Some((k, bin)) = self.best(order, &low, &extent)
        {
            let is_left = |i: &u32| self.light(*i).is_some_and(|l| bin_of(l.center(k), low[k], extent[k]) <= bin);
            let mut left: Vec<u32> = Vec::with_capacity(order.len());
            left.extend(order.iter().filter(|i| is_left(i)));
            let middle = left.len();
            left.extend(order.iter().filter(|i| !is_left(i)));
            order.copy_from_slice(&left);
            if middle > 0 && middle < order.len() {
                return middle;
            }
        }
        let center = |i: u32| self.light(i).map_or(0.0, |l| l.center(widest));
        order.select_nth_unstable_by(half, |&a, &b| center(a).total_cmp(&center(b)).then(a.cmp(&b)));
        half
    }

    /// The axis and the last bin of the left part of the cheapest cut.
    fn best(&self, order: &[u32], low: &[f64; 3], extent: &[f64; 3]) -> Option<(usize, usize)> {
        let largest = extent.iter().copied().fold(0.0, f64::max);
        let mut best: Option<(f64, usize, usize)> = None;
        for k in (0..3).filter(|&k| extent[k] > 0.0) {
            let mut bins = [NOTHING; BINS];
            for light in order.iter().filter_map(|&i| self.light(i)) {
                if let Some(bin) = bins.get_mut(bin_of(light.center(k), low[k], extent[k])) {
                    *bin = bin.union(light);
                }
            }
            let mut right = [NOTHING; BINS];
            let mut sum = NOTHING;
            for at in (0..BINS).rev() {
                right[at] = sum;
                sum = sum.union(&bins[at]);
            }
            let mut left = NOTHING;
            for at in 0..BINS - 1 {
                left = left.union(&bins[at]);
                if left.power <= 0.0 || right[at].power <= 0.0 {
                    continue;
                }
                // Thin boxes are not to be cut along their short sides.
                let cost = (left.cost() + right[at].cost()) * (largest / extent[k]);
                if best.is_none_or(|(least, _, _)| cost < least) {
                    best = Some((cost, k, at));
                }
            }
        }
        best.map(|(_, k, bin)| (k, bin))
    }
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_precision_loss,
    reason = "clamped to the bins"
)]
fn bin_of(value: f64, low: f64, extent: f64) -> usize {
    ((value - low) / extent * BINS as f64).clamp(0.0, BINS as f64 - 1.0) as usize
}
