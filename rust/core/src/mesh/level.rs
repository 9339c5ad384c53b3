// SPDX-License-Identifier: Apache-2.0
//! Hierarchies over the boxes of instances, built top down by the surface area heuristic in bins (Wald 2007, "On fast
//! Construction of SAH-based Bounding Volume Hierarchies"), four children to a node.
//!
//! All nodes but one have four children: every split leaves counts that four-wide trees without gaps can hold, so `n`
//! boxes take `ceil((n - 1) / 3)` nodes, which is known before the tree is built ([`level_node_count`]). A tree over
//! `n` boxes without gaps exists when `n = 1 (mod 3)`; of the four children of any node three get such counts, and one
//! gets the remainder. Deterministic: depends on the boxes and their order only. Pure; large trees use rayon.

use glam::{Vec3A, Vec3Swizzles as _};
use oocpt_abi::{ABSENT, LEAF, LevelNode};

use super::Aabb;
use super::bvh4::level_node;
use super::collapse::WIDTH;

/// Number of boxes above which the two halves of a node are built in parallel.
const FORK_ABOVE: usize = 1 << 13;
/// Number of levels beyond those of a balanced tree from which on nodes are split in the middle.
const SPARE_LEVELS: u32 = 4;
/// Number of items from which the cut of a node is chosen, up to twice as many.
const MAX_SAMPLES: usize = 1 << 9;

/// A four-wide hierarchy over boxes. The root is node 0; parents come before their children.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LevelTree {
    /// [`level_node_count`] nodes.
    pub nodes: Vec<LevelNode>,
    /// Number of stack entries that suffice for a walk: the children that wait on the longest path down.
    pub stack: u32,
}

/// Nodes of the hierarchy over `count` boxes.
#[must_use]
pub const fn level_node_count(count: usize) -> usize {
    match count {
        0 | 1 => 1,
        _ => (count - 1).div_ceil(WIDTH - 1),
    }
}

/// Number of stack entries that hardly any hierarchy over `count` boxes exceeds ([`LevelTree::stack`]): of 386 in an
/// island, none (decisions/0050).
#[must_use]
pub const fn likely_level_stack(count: usize) -> u32 {
    match count {
        0 | 1 => 0,
        _ => 4 + 5 * count.ilog2() / 2,
    }
}

/// Builds the hierarchy over `boxes`, fewer than 2^31; a leaf is the number of a box. Boxes must not be empty: a walk
/// may not find such an item.
#[must_use]
pub fn build_level(boxes: &[Aabb]) -> LevelTree {
    let mut nodes = vec![LevelNode { child: [ABSENT; WIDTH], ..LevelNode::default() }; level_node_count(boxes.len())];
    let mut items: Vec<LevelBox> = boxes.iter().zip(0..).map(LevelBox::new).collect();
    let balanced = boxes.len().max(1).ilog2() / 2 + 1;
    let stack = match &items[..] {
        [] => 0,
        _ => {
            let mut scratch = vec![LevelBox::default(); items.len()];
            emit(&mut items, &mut scratch, &mut nodes, 0, balanced + SPARE_LEVELS)
        }
    };
    LevelTree { nodes, stack }
}

/// A box on its way to its leaf, 32 bytes.
#[derive(Clone, Copy, Default)]
struct LevelBox {
    min: [f32; 3],
    number: u32,
    max: [f32; 3],
    _pad: u32,
}

impl LevelBox {
    fn new((b, number): (&Aabb, u32)) -> Self {
        Self { min: b.min, number, max: b.max, _pad: 0 }
    }

    #[inline]
    fn min(&self) -> Vec3A {
        Vec3A::from_array(self.min)
    }

    #[inline]
    fn max(&self) -> Vec3A {
        Vec3A::from_array(self.max)
    }

    /// Centre as the sum of halves, because the sum of both corners may overflow.
    #[inline]
    fn center(&self) -> Vec3A {
        0.5 * self.min() + 0.5 * self.max()
    }
}

/// A growing box.
#[derive(Clone, Copy)]
struct GrowingBox {
    min: Vec3A,
    max: Vec3A,
}

impl GrowingBox {
    const EMPTY: Self = Self { min: Vec3A::INFINITY, max: Vec3A::NEG_INFINITY };

    fn of(items: &[LevelBox]) -> Self {
        items.iter().fold(Self::EMPTY, |all, item| all.with(item.min(), item.max()))
    }

    fn of_centers(items: &[LevelBox]) -> Self {
        items.iter().fold(Self::EMPTY, |all, item| {
            let center = item.center();
            all.with(center, center)
        })
    }

    fn with(self, min: Vec3A, max: Vec3A) -> Self {
        Self { min: self.min.min(min), max: self.max.max(max) }
    }

    /// Factor that makes the longest edge of a box that is not empty 1, so that no product of edges overflows and none
    /// that matters vanishes.
    fn unit(&self) -> f32 {
        (0.5 * self.max - 0.5 * self.min).max_element().max(f32::MIN_POSITIVE).recip()
    }

    /// Half its surface in units of `unit`; 0 for an empty box.
    #[inline]
    fn half_area(&self, unit: f32) -> f32 {
        let edges = (0.5 * self.max - 0.5 * self.min).max(Vec3A::ZERO) * unit;
        edges.dot(edges.yzx())
    }

    fn plain(&self) -> Aabb {
        Aabb { min: self.min.to_array(), max: self.max.to_array() }
    }
}

/// Writes the tree over at least one item: its root is `nodes[0]`, which is node `base` of the whole, and `nodes` are
/// as many as it takes; `scratch` is as long as `items`. Nodes `sah_levels` further down are split in the middle.
/// Returns the number of stack entries of a walk.
fn emit(
    items: &mut [LevelBox],
    mut scratch: &mut [LevelBox],
    nodes: &mut [LevelNode],
    base: u32,
    sah_levels: u32,
) -> u32 {
    let Some((root, mut rest)) = nodes.split_first_mut() else { return 0 };
    let mut children = children(items, scratch, sah_levels > 0).map(|part| (GrowingBox::of(part), part));
    // As in meshes, rays that may take any child first take the large ones (`super::collapse`).
    let unit = children.iter().fold(GrowingBox::EMPTY, |all, (b, _)| all.with(b.min, b.max)).unit();
    children.sort_by(|(a, _), (b, _)| b.half_area(unit).total_cmp(&a.half_area(unit)));
    let mut child = [ABSENT; WIDTH];
    let mut bounds = [Aabb::EMPTY; WIDTH];
    let mut jobs: [Option<SubtreeJob<'_>>; WIDTH] = [const { None }; WIDTH];
    let mut next = base + 1;
    let mut there = 0;
    for (at, (around, part)) in children.into_iter().enumerate() {
        if part.is_empty() {
            continue;
        }
        there += 1;
        let (own_scratch, others) = scratch.split_at_mut(part.len());
        scratch = others;
        bounds[at] = around.plain();
        if let [item] = part {
            child[at] = LEAF | item.number;
            continue;
        }
        let count = level_node_count(part.len());
        let (own, others) = rest.split_at_mut(count);
        rest = others;
        child[at] = next;
        jobs[at] = Some(SubtreeJob {
            items: part,
            scratch: own_scratch,
            nodes: own,
            base: next,
            sah_levels: sah_levels.saturating_sub(1),
        });
        next += u32::try_from(count).unwrap_or(u32::MAX);
    }
    *root = level_node(bounds[..].iter(), child);
    there - 1 + run(&mut jobs)
}

/// A subtree to build.
struct SubtreeJob<'a> {
    items: &'a mut [LevelBox],
    scratch: &'a mut [LevelBox],
    nodes: &'a mut [LevelNode],
    base: u32,
    sah_levels: u32,
}

/// Builds subtrees, large ones in parallel; returns the largest number of stack entries that one of them needs.
fn run(jobs: &mut [Option<SubtreeJob<'_>>]) -> u32 {
    let size = |jobs: &[Option<SubtreeJob<'_>>]| jobs.iter().flatten().map(|job| job.items.len()).sum::<usize>();
    if jobs.len() > 1 && size(jobs) > FORK_ABOVE {
        let (a, b) = jobs.split_at_mut(jobs.len() / 2);
        let (a, b) = rayon::join(|| run(a), || run(b));
        return a.max(b);
    }
    let each = jobs.iter_mut().flatten();
    each.map(|job| emit(job.items, job.scratch, job.nodes, job.base, job.sah_levels)).max().unwrap_or(0)
}

/// The items of the four children of a node over `items`; the last may be empty.
fn children<'a>(items: &'a mut [LevelBox], scratch: &mut [LevelBox], sah: bool) -> [&'a mut [LevelBox]; WIDTH] {
    let mut parts: [&mut [LevelBox]; WIDTH] = Default::default();
    if items.len() <= WIDTH {
        for (part, item) in parts.iter_mut().zip(items.chunks_mut(1)) {
            *part = item;
        }
        return parts;
    }
    // The left side gets a remainder modulo 3, so that both sides can be split again.
    let first = match items.len() % 3 {
        1 => [2, 2],
        2 => [2, 0],
        _ => [2, 1],
    };
    let (left, right) = split(items, scratch, first, sah);
    let [a, b, c, d] = &mut parts;
    (*a, *b) = halves(left, scratch, sah);
    (*c, *d) = halves(right, scratch, sah);
    parts
}

/// Splits the items of a node in two; a single item stays alone.
fn halves<'a>(
    items: &'a mut [LevelBox],
    scratch: &mut [LevelBox],
    sah: bool,
) -> (&'a mut [LevelBox], &'a mut [LevelBox]) {
    match items.len() {
        0 | 1 => (items, &mut []),
        count => {
            let left = match count % 3 {
                2 => [1, 1],
                0 => [1, 2],
                _ => [1, 0],
            };
            split(items, scratch, left, sah)
        }
    }
}

/// Sorts items, at least two, to two sides, none of which is empty; the number of items on the left, modulo 3, is one
/// of `residues`.
fn split<'a>(
    items: &'a mut [LevelBox],
    scratch: &mut [LevelBox],
    residues: [usize; 2],
    sah: bool,
) -> (&'a mut [LevelBox], &'a mut [LevelBox]) {
    let count = items.len();
    let centers = GrowingBox::of_centers(items);
    let extent = centers.max - centers.min;
    let chosen = match count {
        _ if !sah => None,
        0..3 => None,
        3..8 => choose::<4>(items, &centers),
        8..64 => choose::<8>(items, &centers),
        _ => choose::<16>(items, &centers),
    };
    let by_center = |axis: usize| {
        move |a: &LevelBox, b: &LevelBox| {
            a.center()[axis].total_cmp(&b.center()[axis]).then_with(|| a.number.cmp(&b.number))
        }
    };
    let Some(BinSplit { axis, bin, scale }) = chosen else {
        let middle = nearest(count / 2, count, residues);
        if extent.max_element() > 0.0 {
            items.select_nth_unstable_by(middle, by_center(longest(extent)));
        }
        return items.split_at_mut(middle);
    };
    let wanted = partition(items, scratch, |item| scale.bin(item.center())[axis] <= bin);
    let left = nearest(wanted, count, residues);
    // At most two items, those nearest to the cut, change sides.
    let order = by_center(axis);
    for at in (left..wanted).rev() {
        let last = (0..=at).max_by(|&a, &b| order(&items[a], &items[b])).unwrap_or(at);
        items.swap(last, at);
    }
    for at in wanted..left {
        let first = (at..count).min_by(|&a, &b| order(&items[a], &items[b])).unwrap_or(at);
        items.swap(first, at);
    }
    items.split_at_mut(left)
}

/// The number nearest to `wanted`, from 1 to below `count`, that is one of `residues` modulo 3.
fn nearest(wanted: usize, count: usize, residues: [usize; 2]) -> usize {
    let is_allowed = |&left: &usize| left > 0 && left < count && residues.contains(&(left % 3));
    let around = (0..3).flat_map(|by| [wanted.checked_sub(by), wanted.checked_add(by)]).flatten();
    around.clone().find(is_allowed).unwrap_or(1)
}

fn longest(extent: Vec3A) -> usize {
    (0..3).max_by(|&a, &b| extent[a].total_cmp(&extent[b])).unwrap_or(0)
}

/// Moves the items for which `is_left` is true to the front, in order; returns their number. It has no branches on the
/// items, which processors could not predict.
fn partition(items: &mut [LevelBox], scratch: &mut [LevelBox], is_left: impl Fn(&LevelBox) -> bool) -> usize {
    let (mut left, mut right) = (0, 0);
    for at in 0..items.len() {
        let item = items[at];
        let goes_left = is_left(&item);
        items[left] = item;
        scratch[right] = item;
        left += usize::from(goes_left);
        right += usize::from(!goes_left);
    }
    items[left..].copy_from_slice(&scratch[..right]);
    left
}

/// Origin and scale of the bins along each axis.
#[derive(Clone, Copy)]
struct BinScale {
    from: Vec3A,
    per_unit: Vec3A,
    last: Vec3A,
}

impl BinScale {
    /// `bins` along each axis of the box of all centres; along an axis without extent, or an infinite one, every centre
    /// is in the first bin.
    fn new(centers: &GrowingBox, bins: usize) -> Self {
        #[expect(clippy::cast_precision_loss, reason = "a small number")]
        let bins = bins as f32;
        let extent = centers.max - centers.min;
        let per_unit = Vec3A::select(extent.cmpgt(Vec3A::ZERO), bins / extent, Vec3A::ZERO);
        Self { from: centers.min, per_unit, last: Vec3A::splat(bins - 1.0) }
    }

    /// The bin of a center along each axis.
    #[inline]
    fn bin(&self, center: Vec3A) -> [usize; 3] {
        /// Number whose last bit, in single precision, counts wholes. Adding it rounds `x - 0.5` to the last whole
        /// number not above `x`, except for centres at an edge between bins, which may go to either bin.
        const WHOLES: f32 = (1 << 23) as f32;
        let at = ((center - self.from) * self.per_unit - 0.5).clamp(Vec3A::ZERO, self.last);
        (at + WHOLES).to_array().map(|at| (at.to_bits() & 0xff) as usize)
    }
}

/// A plane between two bins.
struct BinSplit {
    axis: usize,
    /// The last bin on the left.
    bin: usize,
    scale: BinScale,
}

/// The cheapest plane between two of `BINS` bins along an axis; `None` if no plane separates the centres. Of many items
/// an evenly spread sample is used.
fn choose<const BINS: usize>(items: &[LevelBox], centers: &GrowingBox) -> Option<BinSplit> {
    let scale = BinScale::new(centers, BINS);
    let mut filled = [[GrowingBox::EMPTY; BINS]; 3];
    let mut counts = [[0_u16; BINS]; 3];
    for item in items.iter().step_by((items.len() / MAX_SAMPLES).max(1)) {
        let (min, max) = (item.min(), item.max());
        let bins = scale.bin(item.center());
        for axis in 0..3 {
            let bin = bins[axis].min(BINS - 1);
            filled[axis][bin] = filled[axis][bin].with(min, max);
            counts[axis][bin] += 1;
        }
    }
    let all = filled[0].iter().fold(GrowingBox::EMPTY, |all, bin| all.with(bin.min, bin.max));
    let unit = all.unit();
    let mut best: Option<(f32, BinSplit)> = None;
    for axis in 0..3 {
        let (filled, counts) = (&filled[axis], &counts[axis]);
        let mut right = [(0.0, 0_u16); BINS];
        let (mut bounds, mut count) = (GrowingBox::EMPTY, 0);
        for at in (1..BINS).rev() {
            bounds = bounds.with(filled[at].min, filled[at].max);
            count += counts[at];
            right[at - 1] = (bounds.half_area(unit) * f32::from(count), count);
        }
        let (mut bounds, mut count) = (GrowingBox::EMPTY, 0);
        for bin in 0..BINS - 1 {
            bounds = bounds.with(filled[bin].min, filled[bin].max);
            count += counts[bin];
            let (right, others) = right[bin];
            let cost = bounds.half_area(unit) * f32::from(count) + right;
            let parts = counts[bin] > 0 && others > 0 && cost.is_finite();
            if parts && best.as_ref().is_none_or(|(least, _)| cost < *least) {
                best = Some((cost, BinSplit { axis, bin, scale }));
            }
        }
    }
    best.map(|(_, cut)| cut)
}
