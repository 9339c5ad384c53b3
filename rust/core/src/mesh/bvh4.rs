// SPDX-License-Identifier: Apache-2.0
//! Hierarchies as the GPU walks them: four children to a node, their boxes in 8 bits per plane on a grid of the node's
//! own (after Ylitie, Karras and Laine 2017, "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide
//! BVHs").
//!
//! Made from a [`Bvh2`] (`collapse.rs`). Planes are rounded outwards, so a box contains its items. Over the triangles
//! of a mesh ([`Bvh4`]) the children lie one after the other; over boxes ([`LevelNode`]) each is named. Pure; one
//! thread per build.

use super::Aabb;
use super::bvh::Bvh2;
use super::collapse::{BvhCollapse, CollapsedChild, WIDTH};
use oocpt_abi::{ABSENT, Bvh4Node, LEAF, LevelNode};

/// Cells along an axis of a node's grid: fewer than planes can tell, for the rounding of their number and the margin.
const CELLS: f64 = 253.0;
/// Number of cells by which planes over boxes are moved outwards at least. Walks do not pad these boxes as they do
/// those of meshes, and the planes' own rounding is 2^-24 of the grid's 255 cells at each of four steps.
const MARGIN: f64 = 1.0 / 8192.0;
/// A node of at most four children with the boxes `boxes` and the references `child`.
pub(super) fn level_node<'a>(boxes: impl Iterator<Item = &'a Aabb> + Clone, child: [u32; WIDTH]) -> LevelNode {
    let BoxGrid { origin, cell, lower, upper } = BoxGrid::new(boxes, MARGIN);
    LevelNode { origin, cell, lower, upper, child, pad: [0; 2] }
}

/// A four-wide hierarchy; node 0 is the root.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Bvh4 {
    /// Nodes, parents before children.
    pub nodes: Vec<Bvh4Node>,
    /// Number of stack entries that suffice for a walk: the children that wait on the longest path down.
    pub stack: u32,
}

/// A node over children with the boxes `boxes`, whose `first_child`, `first_triangle` and counts are given.
pub(super) fn mesh_node(boxes: &[Aabb], [first_child, first_triangle, counts]: [u32; 3]) -> Bvh4Node {
    let BoxGrid { origin, cell, lower, upper } = BoxGrid::new(boxes.iter(), 0.0);
    Bvh4Node { origin, cell_and_counts: cell | counts, lower, upper, first_child, first_triangle }
}

/// The hierarchy of `bvh`, whose leaves are of the items `order`, and these in its own order. With `in_order` the first
/// leaf of the root remains the first one of all.
pub(super) fn compress(bvh: &Bvh2, order: &[u32], in_order: bool) -> (Bvh4, Vec<u32>) {
    let mut places = Vec::with_capacity(order.len());
    let (nodes, stack) = widen(bvh, in_order, |parts, inner, first_child| {
        let mut boxes = [Aabb::EMPTY; WIDTH];
        let mut counts = 0;
        for ((at, part), slot) in parts.iter().enumerate().zip(&mut boxes) {
            counts |= (part.count & 3) << (24 + 2 * at);
            *slot = part.bounds;
        }
        let first_child = index(inner) << Bvh4Node::INNER_SHIFT | first_child;
        let node = mesh_node(&boxes[..parts.len().min(WIDTH)], [first_child, index(places.len()), counts]);
        for leaf in &parts[inner..] {
            places.extend(leaf.child..leaf.child + leaf.count);
        }
        node
    });
    let mut ordered = Vec::with_capacity(places.len());
    ordered.extend(places.iter().filter_map(|&place| order.get(place as usize).copied()));
    (Bvh4 { nodes, stack }, ordered)
}

/// The wide hierarchy of `bvh`, which is over boxes ([`super::build_box_bvh`]), and the number of stack entries that
/// suffice for a walk. Without boxes it is one node without children.
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

/// Makes wide nodes with `emit`, which gets the parts of a node, the number of inner ones, and their index; returns the
/// nodes and the number of stack entries that suffice for a walk.
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

/// The grid of a node and the planes of its children.
#[derive(Default)]
struct BoxGrid {
    origin: [u32; 3],
    cell: u32,
    lower: [u32; 3],
    upper: [u32; 3],
}

impl BoxGrid {
    /// The planes of at most four `boxes`, moved outwards by `margin` cells at least.
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

/// Lower end of a grid that contains `min`, so far below it that the margin fits.
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
