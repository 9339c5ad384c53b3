// SPDX-License-Identifier: Apache-2.0
//! Hierarchies over the boxes of instances, built top down by the surface area heuristic in bins (Wald 2007, "On fast
//! Construction of SAH-based Bounding Volume Hierarchies"), four children to a node.
//!
//! All nodes but one have four children: every split leaves counts that four-wide trees without gaps can hold, so `n`
//! boxes take `ceil((n - 1) / 3)` nodes, which is known before the tree is built ([`level_node_count`]). A tree over
//! `n` boxes without gaps exists when `n = 1 (mod 3)`; of the four children of any node three get such counts, and one
//! gets what is left. Deterministic: depends on the boxes and their order only. Pure; large trees use rayon.

use glam::Vec3A;

use super::Aabb;
use super::bvh4::{ABSENT, LEAF, LevelNode, WIDTH};

/// Boxes above which the two halves of a node are built side by side.
const FORK_ABOVE: usize = 1 << 13;
/// Levels beyond those of a balanced tree from which on nodes are split in the middle.
const SPARE_LEVELS: u32 = 4;

/// A four-wide hierarchy over boxes. The root is node 0; parents come before their children.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LevelTree {
    /// [`level_node_count`] nodes.
    pub nodes: Vec<LevelNode>,
    /// Stack entries that suffice for a walk: on the longest way down, the children that wait.
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

/// Builds the hierarchy over `boxes`, fewer than 2^31; a leaf is the number of a box. Boxes must not be empty: a walk
/// may not find such an item.
#[must_use]
pub fn build_level(boxes: &[Aabb]) -> LevelTree {
    let mut nodes = vec![LevelNode { child: [ABSENT; WIDTH], ..LevelNode::default() }; level_node_count(boxes.len())];
    let mut items: Vec<Item> = boxes.iter().zip(0..).map(Item::new).collect();
    let balanced = boxes.len().max(1).ilog2() / 2 + 1;
    let stack = match &items[..] {
        [] => 0,
        _ => emit(&mut items, &mut nodes, 0, balanced + SPARE_LEVELS),
    };
    LevelTree { nodes, stack }
}

/// A box on its way to its leaf.
#[derive(Clone, Copy)]
struct Item {
    min: Vec3A,
    max: Vec3A,
    number: u32,
}

impl Item {
    fn new((b, number): (&Aabb, u32)) -> Self {
        Self { min: Vec3A::from(b.min), max: Vec3A::from(b.max), number }
    }

    /// Not the sum of both, which may overflow.
    fn center(&self) -> Vec3A {
        0.5 * self.min + 0.5 * self.max
    }
}

/// A growing box.
#[derive(Clone, Copy)]
struct Bounds {
    min: Vec3A,
    max: Vec3A,
}

impl Bounds {
    const EMPTY: Self = Self { min: Vec3A::INFINITY, max: Vec3A::NEG_INFINITY };

    fn of(items: &[Item]) -> Self {
        items.iter().fold(Self::EMPTY, |all, item| all.with(item.min, item.max))
    }

    fn with(self, min: Vec3A, max: Vec3A) -> Self {
        Self { min: self.min.min(min), max: self.max.max(max) }
    }

    /// Half its surface, in double precision: no square of a single overflows or vanishes there.
    fn half_area(&self) -> f64 {
        let extent = (self.max - self.min).max(Vec3A::ZERO).as_dvec3();
        extent.x * extent.y + extent.y * extent.z + extent.z * extent.x
    }

    fn plain(&self) -> Aabb {
        Aabb { min: self.min.to_array(), max: self.max.to_array() }
    }
}

/// Writes the tree over at least one item: its root is `nodes[0]`, which is node `base` of the whole, and `nodes` are
/// as many as it takes. Nodes `sah_levels` further down are split in the middle. Gives the stack entries of a walk.
fn emit(items: &mut [Item], nodes: &mut [LevelNode], base: u32, sah_levels: u32) -> u32 {
    let Some((root, mut rest)) = nodes.split_first_mut() else { return 0 };
    let mut children = children(items, sah_levels > 0);
    let mut child = [ABSENT; WIDTH];
    let mut bounds = [Aabb::EMPTY; WIDTH];
    let mut jobs: [Option<Job<'_>>; WIDTH] = [const { None }; WIDTH];
    let mut next = base + 1;
    let mut there = 0;
    for (at, part) in children.iter_mut().enumerate() {
        let part = std::mem::take(part);
        if part.is_empty() {
            continue;
        }
        there += 1;
        bounds[at] = Bounds::of(part).plain();
        if let [item] = part {
            child[at] = LEAF | item.number;
            continue;
        }
        let count = level_node_count(part.len());
        let (own, others) = rest.split_at_mut(count);
        rest = others;
        child[at] = next;
        jobs[at] = Some(Job { items: part, nodes: own, base: next, sah_levels: sah_levels.saturating_sub(1) });
        next += u32::try_from(count).unwrap_or(u32::MAX);
    }
    *root = LevelNode::new(bounds[..].iter(), child);
    there - 1 + run(&mut jobs)
}

/// A subtree to build.
struct Job<'a> {
    items: &'a mut [Item],
    nodes: &'a mut [LevelNode],
    base: u32,
    sah_levels: u32,
}

/// Builds subtrees, large ones side by side; the most stack entries that one of them needs.
fn run(jobs: &mut [Option<Job<'_>>]) -> u32 {
    let size = |jobs: &[Option<Job<'_>>]| jobs.iter().flatten().map(|job| job.items.len()).sum::<usize>();
    if jobs.len() > 1 && size(jobs) > FORK_ABOVE {
        let (a, b) = jobs.split_at_mut(jobs.len() / 2);
        let (a, b) = rayon::join(|| run(a), || run(b));
        return a.max(b);
    }
    let each = jobs.iter_mut().flatten();
    each.map(|job| emit(job.items, job.nodes, job.base, job.sah_levels)).max().unwrap_or(0)
}

/// The items of the four children of a node over `items`, of which the last may be empty.
fn children(items: &mut [Item], sah: bool) -> [&mut [Item]; WIDTH] {
    let mut parts: [&mut [Item]; WIDTH] = Default::default();
    if items.len() <= WIDTH {
        for (part, item) in parts.iter_mut().zip(items.chunks_mut(1)) {
            *part = item;
        }
        return parts;
    }
    // What is left of 3 on the left side, so that both sides can be split again.
    let first = match items.len() % 3 {
        1 => [2, 2],
        2 => [2, 0],
        _ => [2, 1],
    };
    let (left, right) = split(items, first, sah);
    let [a, b, c, d] = &mut parts;
    (*a, *b) = halves(left, sah);
    (*c, *d) = halves(right, sah);
    parts
}

/// Two children of a node; a single item stays alone.
fn halves(items: &mut [Item], sah: bool) -> (&mut [Item], &mut [Item]) {
    match items.len() {
        0 | 1 => (items, &mut []),
        count => {
            let left = match count % 3 {
                2 => [1, 1],
                0 => [1, 2],
                _ => [1, 0],
            };
            split(items, left, sah)
        }
    }
}

/// Sorts items, at least two, to two sides, none of which is empty; of the count on the left one of `residues` is left
/// when it is divided by 3.
fn split(items: &mut [Item], residues: [usize; 2], sah: bool) -> (&mut [Item], &mut [Item]) {
    let count = items.len();
    let centers = items.iter().fold(Bounds::EMPTY, |all, item| {
        let center = item.center();
        all.with(center, center)
    });
    let extent = centers.max - centers.min;
    let chosen = match count {
        _ if !sah => None,
        0..3 => None,
        3..8 => choose::<4>(items, &centers),
        8..64 => choose::<8>(items, &centers),
        _ => choose::<16>(items, &centers),
    };
    let by_center = |axis: usize| {
        move |a: &Item, b: &Item| a.center()[axis].total_cmp(&b.center()[axis]).then_with(|| a.number.cmp(&b.number))
    };
    let Some(Cut { axis, bin, scale }) = chosen else {
        let middle = nearest(count / 2, count, residues);
        if extent.max_element() > 0.0 {
            items.select_nth_unstable_by(middle, by_center(longest(extent)));
        }
        return items.split_at_mut(middle);
    };
    let wanted = partition(items, |item| scale.bin(item.center())[axis] <= bin);
    let left = nearest(wanted, count, residues);
    // Those nearest to the cut change sides, at most two.
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

/// The number next to `wanted`, from 1 to below `count`, of which one of `residues` is left when it is divided by 3.
fn nearest(wanted: usize, count: usize, residues: [usize; 2]) -> usize {
    let is_allowed = |&left: &usize| left > 0 && left < count && residues.contains(&(left % 3));
    let around = (0..3).flat_map(|by| [wanted.checked_sub(by), wanted.checked_add(by)]).flatten();
    around.clone().find(is_allowed).unwrap_or(1)
}

fn longest(extent: Vec3A) -> usize {
    (0..3).max_by(|&a, &b| extent[a].total_cmp(&extent[b])).unwrap_or(0)
}

/// Moves the items that `is_left` to the front; how many they are.
fn partition(items: &mut [Item], is_left: impl Fn(&Item) -> bool) -> usize {
    let (mut left, mut right) = (0, items.len());
    while left < right {
        if is_left(&items[left]) {
            left += 1;
        } else {
            right -= 1;
            items.swap(left, right);
        }
    }
    left
}

/// Where bins lie.
#[derive(Clone, Copy)]
struct Scale {
    from: Vec3A,
    per_unit: Vec3A,
    last: f32,
}

impl Scale {
    /// `bins` along each axis of what holds all centers; along an axis without extent, or an infinite one, all is in
    /// the first.
    fn new(centers: &Bounds, bins: usize) -> Self {
        #[expect(clippy::cast_precision_loss, reason = "a small number")]
        let bins = bins as f32;
        let extent = centers.max - centers.min;
        let per_unit = Vec3A::select(extent.cmpgt(Vec3A::ZERO), bins / extent, Vec3A::ZERO);
        Self { from: centers.min, per_unit, last: bins - 1.0 }
    }

    /// The bin of a center along each axis.
    #[inline]
    fn bin(&self, center: Vec3A) -> [usize; 3] {
        let at = ((center - self.from) * self.per_unit).min(Vec3A::splat(self.last));
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "not below 0, at most the last bin"
        )]
        at.to_array().map(|at| at as usize)
    }
}

/// A plane between two bins.
struct Cut {
    axis: usize,
    /// The last bin on the left.
    bin: usize,
    scale: Scale,
}

/// The plane between two of `BINS` bins to an axis that costs least; none where no plane parts the centers.
fn choose<const BINS: usize>(items: &[Item], centers: &Bounds) -> Option<Cut> {
    let scale = Scale::new(centers, BINS);
    let mut filled = [[(Bounds::EMPTY, 0_u32); BINS]; 3];
    for item in items {
        for (bins, at) in filled.iter_mut().zip(scale.bin(item.center())) {
            let (bounds, count) = &mut bins[at.min(BINS - 1)];
            *bounds = bounds.with(item.min, item.max);
            *count += 1;
        }
    }
    let mut best: Option<(f64, Cut)> = None;
    for (axis, filled) in filled.iter().enumerate() {
        let mut right = [(0.0, 0_u32); BINS];
        let (mut bounds, mut count) = (Bounds::EMPTY, 0);
        for (at, (of_bin, number)) in filled.iter().enumerate().skip(1).rev() {
            bounds = bounds.with(of_bin.min, of_bin.max);
            count += number;
            right[at - 1] = (bounds.half_area() * f64::from(count), count);
        }
        let (mut bounds, mut count) = (Bounds::EMPTY, 0);
        for (bin, (of_bin, number)) in filled.iter().enumerate().take(BINS - 1) {
            bounds = bounds.with(of_bin.min, of_bin.max);
            count += number;
            let (right, others) = right[bin];
            let cost = bounds.half_area() * f64::from(count) + right;
            if *number > 0 && others > 0 && cost.is_finite() && best.as_ref().is_none_or(|(least, _)| cost < *least) {
                best = Some((cost, Cut { axis, bin, scale }));
            }
        }
    }
    best.map(|(_, cut)| cut)
}
