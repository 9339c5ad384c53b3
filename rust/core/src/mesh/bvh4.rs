// SPDX-License-Identifier: Apache-2.0
//! Hierarchies as the GPU walks them: four children to a node, their boxes in 8 bits per plane on a grid of the node's
//! own (after Ylitie, Karras and Laine 2017, "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide
//! BVHs").
//!
//! Made from a [`Bvh2`] (`collapse.rs`). Planes are rounded outwards, so a box holds what is in it. Over the
//! triangles of a mesh ([`Bvh4`]) the children lie one after the other; over boxes ([`LevelNode`]) each is named. Pure;
//! one thread per build.

use super::bundle::build_bundles;
use super::bvh::{Bvh2, build_item_bvh};
use super::collapse::{BvhCollapse, CollapsedChild};
use super::{Aabb, LeafKind, Triangle};
use oocpt_abi::{ABSENT, Bvh4Node, LEAF, LevelNode};

/// Children of a node.
pub const WIDTH: usize = 4;
/// Cells along an axis of a node's grid: fewer than planes can tell, for the rounding of their number and the margin.
const CELLS: f64 = 253.0;
/// Cells that planes over boxes are further out at least. Walks do not pad these boxes as they do those of meshes, and
/// the planes' own rounding is 2^-24 of the grid's 255 cells at each of four steps.
const MARGIN: f64 = 1.0 / 8192.0;
/// A node of children in `boxes`, at most four, which `child` names.
pub(super) fn level_node<'a>(boxes: impl Iterator<Item = &'a Aabb> + Clone, child: [u32; WIDTH]) -> LevelNode {
    let BoxGrid { origin, cell, lower, upper } = BoxGrid::new(boxes, MARGIN);
    LevelNode { origin, cell, lower, upper, child, pad: [0; 2] }
}

/// A four-wide hierarchy; node 0 is the root.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Bvh4 {
    /// Nodes, parents before children.
    pub nodes: Vec<Bvh4Node>,
    /// Stack entries that suffice for a walk: on the longest way down, the children that wait.
    pub stack: u32,
}

/// Builds the hierarchy over `triangles` (at least one, finite, fewer than 2^28) and the BVH order: `order[k]` is the
/// number of the triangle at place k.
#[must_use]
pub fn build_bvh4(triangles: &[Triangle], kind: LeafKind) -> (Bvh4, Vec<u32>) {
    let boxes: Vec<Aabb> = triangles.iter().map(|triangle| triangle.bounds(kind)).collect();
    build_bvh4_over(&boxes, kind)
}

/// [`build_bvh4`] over the boxes of triangles.
pub(super) fn build_bvh4_over(boxes: &[Aabb], kind: LeafKind) -> (Bvh4, Vec<u32>) {
    if kind == LeafKind::Points {
        return build_bundles(boxes);
    }
    let (bvh, order) = build_item_bvh(boxes);
    compress(&bvh, &order, false)
}

/// The hierarchy of `bvh`, whose leaves are of the items `order`, and these in its own order. With `in_order` the first
/// leaf of the root remains the first one of all.
pub(super) fn compress(bvh: &Bvh2, order: &[u32], in_order: bool) -> (Bvh4, Vec<u32>) {
    let mut places = Vec::with_capacity(order.len());
    let (nodes, stack) = widen(bvh, in_order, |parts, inner, first_child| {
        let BoxGrid { origin, cell, lower, upper } = BoxGrid::new(parts.iter().map(|part| &part.bounds), 0.0);
        let mut node = Bvh4Node { origin, cell_and_counts: cell, lower, upper, ..Bvh4Node::default() };
        node.first_child = index(inner) << Bvh4Node::INNER_SHIFT | first_child;
        node.first_triangle = index(places.len());
        for (at, part) in parts.iter().enumerate() {
            node.cell_and_counts |= (part.count & 3) << (24 + 2 * at);
        }
        for leaf in &parts[inner..] {
            places.extend(leaf.child..leaf.child + leaf.count);
        }
        node
    });
    let mut ordered = Vec::with_capacity(places.len());
    ordered.extend(places.iter().filter_map(|&place| order.get(place as usize).copied()));
    (Bvh4 { nodes, stack }, ordered)
}

/// The hierarchy of `bvh`, which is one over boxes ([`super::build_box_bvh`]), and the stack entries that suffice for a
/// walk. Without boxes one node without children.
#[must_use]
pub fn level_nodes(bvh: &Bvh2) -> (Vec<LevelNode>, u32) {
    widen(bvh, false, |parts, inner, first_child| {
        let mut child = [ABSENT; WIDTH];
        for ((slot, part), at) in child.iter_mut().zip(parts).zip(0..) {
            *slot = if (at as usize) < inner { first_child + at } else { LEAF | part.child };
        }
        level_node(parts.iter().map(|part| &part.bounds), child)
    })
}

/// The nodes that `emit` makes of the parts of a node, how many of them are inner and where these will be; and the
/// stack entries that suffice for a walk.
fn widen<N: Copy + Default>(
    bvh: &Bvh2,
    in_order: bool,
    mut emit: impl FnMut(&[CollapsedChild], usize, u32) -> N,
) -> (Vec<N>, u32) {
    let (mut nodes, mut stack) = (vec![N::default()], 0);
    let collapse = BvhCollapse::new(bvh);
    let mut open = vec![(0_u32, 0_usize, 0_u32)];
    while let Some((node, slot, waiting)) = open.pop() {
        let parts = collapse.children(node, in_order);
        let inner = parts.iter().take_while(|part| part.count == 0).count();
        let first_child = nodes.len();
        nodes.resize(first_child + inner, N::default());
        nodes[slot] = emit(&parts, inner, index(first_child));
        let waiting = waiting + index(parts.len().saturating_sub(1));
        stack = stack.max(waiting);
        let inner = parts[..inner].iter().enumerate().rev();
        open.extend(inner.map(|(at, part)| (part.child, first_child + at, waiting)));
    }
    nodes.shrink_to_fit(); // they are kept
    (nodes, stack)
}

fn index(of: usize) -> u32 {
    u32::try_from(of).unwrap_or(u32::MAX)
}

/// Half the surface of a box, which single precision may not hold.
pub(super) fn half_area(b: &Aabb) -> f64 {
    let [x, y, z] = [0, 1, 2].map(|k| f64::from(b.max[k]) - f64::from(b.min[k]));
    x * y + y * z + z * x
}

/// The grid of a node and the planes of its children.
#[derive(Default)]
struct BoxGrid {
    origin: [u32; 3],
    cell: u32,
    lower: [u32; 3],
    upper: [u32; 3],
}

impl BoxGrid {
    /// The planes of at most four `boxes`, further out by `margin` cells at least.
    fn new<'a>(boxes: impl Iterator<Item = &'a Aabb> + Clone, margin: f64) -> Self {
        let all = boxes.clone().fold(Aabb::EMPTY, |all, b| all.union(b));
        let mut grid = Self::default();
        if all.is_empty() {
            return grid;
        }
        for axis in 0..3 {
            let origin = if margin > 0.0 { below(all.min[axis], all.max[axis]) } else { all.min[axis] };
            grid.origin[axis] = origin.to_bits();
            let origin = f64::from(origin);
            let exponent = cell_exponent((f64::from(all.max[axis]) - origin) / CELLS);
            // Exact: the cell is a power of two.
            let per_cell = 1.0 / f64::from(f32::from_bits(exponent << 23));
            grid.cell |= exponent << (8 * axis);
            for (at, b) in boxes.clone().enumerate() {
                let cells = |plane: f32| (f64::from(plane) - origin) * per_cell;
                grid.lower[axis] |= floor(cells(b.min[axis]) - margin) << (8 * at);
                grid.upper[axis] |= ceil(cells(b.max[axis]) + margin) << (8 * at);
            }
        }
        grid
    }
}

/// Where the grid of a box begins, so far below it that the margin fits.
fn below(min: f32, max: f32) -> f32 {
    let spare = (max / 256.0 - min / 256.0).max(min.abs() * 2.0_f32.powi(-22)).max(1e-30);
    min - spare
}

/// The biased exponent of the smallest power of two that is a normal `f32` and not below `edge`.
fn cell_exponent(edge: f64) -> u32 {
    let bits = edge.to_bits();
    let exponent = (bits >> 52) + u64::from(bits & ((1 << 52) - 1) != 0);
    u32::try_from(exponent.saturating_sub(1023 - 127)).unwrap_or(253).clamp(1, 253)
}

/// The last whole number not above `cells`, from 0 to 255.
fn floor(cells: f64) -> u32 {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
    let byte = cells.clamp(0.0, 255.0) as u32;
    byte
}

/// The first whole number not below `cells`, from 0 to 255.
fn ceil(cells: f64) -> u32 {
    let byte = floor(cells);
    byte + u32::from(byte < 255 && cells > f64::from(byte))
}
