// SPDX-License-Identifier: Apache-2.0
//! Meshes whose points move: which triangle lies where in the hierarchy stays, and its nodes are bounded anew from the
//! leaves up (I. Wald, S. Boulos, P. Shirley, "Ray Tracing Deformable Scenes Using Dynamic Bounding Volume
//! Hierarchies", ACM Transactions on Graphics 26(1), 2007). A hierarchy whose cost has grown is built anew
//! (C. Lauterbach, S.-E. Yoon, D. Tuft, D. Manocha, "RT-DEFORM: Interactive Ray Tracing of Dynamic Scenes using BVHs",
//! IEEE Symposium on Interactive Ray Tracing, 2006), by the same growth as those over instances ([`has_worn`]).
//!
//! Pure; clusters are refitted in parallel. A refitted mesh has the triangles and values of one that is built, in
//! another order.

use std::sync::Arc;

use oocpt_abi::Bvh4Node;
use rayon::prelude::*;

use super::bvh4::{Bvh4, mesh_node};
use super::collapse::WIDTH;
use super::level_shape::has_worn;
use super::split::{TriangleOrder, arrange, cluster_key, points_of};
use super::{Aabb, LeafKind, MeshAsset};

/// The part of [`Bvh4Node::cell_and_counts`] that tells the triangles of the children.
const COUNTS: u32 = 0xff << 24;

/// What stays of a hierarchy when its items move.
#[derive(Clone, Debug, PartialEq)]
struct TreeShape {
    /// Of each node: `first_child`, `first_triangle` and the counts of its children, as in [`Bvh4Node`].
    nodes: Vec<[u32; 3]>,
    stack: u32,
    /// Its cost where it was built.
    cost: f64,
}

impl TreeShape {
    /// The shape of `bvh` over items with these boxes, in its order.
    fn of(bvh: &Bvh4, boxes: &[Aabb]) -> Self {
        let parts = |node: &Bvh4Node| [node.first_child, node.first_triangle, node.cell_and_counts & COUNTS];
        let mut shape = Self { nodes: bvh.nodes.iter().map(parts).collect(), stack: bvh.stack, cost: 0.0 };
        shape.cost = shape.fit(boxes, |_, _| ());
        shape
    }

    /// The hierarchy of this shape over other boxes; `None` if it has worn out.
    fn refit(&self, boxes: &[Aabb]) -> Option<Bvh4> {
        let mut nodes = vec![Bvh4Node::default(); self.nodes.len()];
        let cost = self.fit(boxes, |at, children| {
            if let (Some(slot), Some(&parts)) = (nodes.get_mut(at), self.nodes.get(at)) {
                *slot = mesh_node(children, parts);
            }
        });
        (!has_worn(cost / self.cost)).then_some(Bvh4 { nodes, stack: self.stack })
    }

    /// Calls `emit` with each node's number and the boxes of its children; children before their parents. Returns the
    /// surface of all nodes, of the root's: what a ray that meets the root costs. It does not change with the scale.
    fn fit(&self, boxes: &[Aabb], mut emit: impl FnMut(usize, &[Aabb])) -> f64 {
        let mut around = vec![Aabb::EMPTY; self.nodes.len()];
        let (mut sum, mut root) = (0.0, 0.0);
        for (at, &[first_child, first_triangle, counts]) in self.nodes.iter().enumerate().rev() {
            let mut children = [Aabb::EMPTY; WIDTH];
            let inner = (first_child >> Bvh4Node::INNER_SHIFT) as usize;
            let (mut node, mut item) = (first_child & !(0xf << Bvh4Node::INNER_SHIFT), first_triangle);
            let mut used = 0;
            for (slot, bounds) in children.iter_mut().enumerate() {
                let count = counts >> (24 + 2 * slot) & 3;
                if slot < inner {
                    // Parents come before their children, so its box is known.
                    *bounds = around.get(node as usize).copied().unwrap_or(Aabb::EMPTY);
                    node += 1;
                } else if count > 0 {
                    let items = boxes.get(item as usize..(item + count) as usize).unwrap_or_default();
                    *bounds = items.iter().fold(Aabb::EMPTY, |all, b| all.union(b));
                    item += count;
                } else {
                    break;
                }
                used = slot + 1;
            }
            let children = children.get(..used).unwrap_or_default();
            let all = children.iter().fold(Aabb::EMPTY, |all, b| all.union(b));
            root = if all.is_empty() { 0.0 } else { all.half_area() };
            sum += root;
            around[at] = all;
            emit(at, children);
        }
        sum / root
    }
}

/// An asset of the mesh: all of it, or a cluster.
#[derive(Clone, Debug, PartialEq)]
struct ShapePart {
    /// Number, in the mesh as it was read, of the triangle at each place of the hierarchy.
    order: Vec<u32>,
    tree: TreeShape,
    /// Bytes on the device.
    bytes: u64,
}

/// What stays of a mesh when its points move.
#[derive(Debug)]
pub(crate) struct MeshShape {
    /// Key of the mesh that it was made with.
    pub(crate) key: u128,
    is_split: bool,
    triangles: usize,
    parts: Vec<ShapePart>,
}

/// A mesh that deforms: its shape, if it is known, and what became of it.
#[derive(Debug)]
pub(crate) struct MeshRefit {
    pub(crate) shape: Option<Arc<MeshShape>>,
    /// True if a shape was known: the key of the mesh is not that of its content alone.
    pub(crate) had_shape: bool,
    /// True if the mesh was refitted, false if it was built.
    pub(crate) is_refitted: bool,
}

impl MeshRefit {
    /// A mesh of this shape, which is not built yet.
    pub(crate) fn new(shape: Option<Arc<MeshShape>>) -> Self {
        Self { had_shape: shape.is_some(), shape, is_refitted: false }
    }

    /// Makes the assets of `loose`: those of the shape, or else those that `build` makes, whose shape is kept. The
    /// whole mesh is returned, clusters go to `put`. `cluster_bytes`: part of the keys of clusters.
    pub(super) fn arrange(
        &mut self,
        mut loose: MeshAsset,
        cluster_bytes: u64,
        put: &mut dyn FnMut(MeshAsset),
        build: impl FnOnce(MeshAsset, &mut dyn FnMut(MeshAsset)) -> Option<MeshAsset>,
    ) -> Option<MeshAsset> {
        if loose.kind != LeafKind::Triangles {
            self.shape = None;
            return build(loose, put);
        }
        if let Some(mut assets) = self.shape.as_ref().and_then(|shape| shape.assets(&loose, cluster_bytes)) {
            self.is_refitted = true;
            if self.shape.as_ref().is_some_and(|shape| shape.is_split) {
                assets.into_iter().for_each(put);
                return None;
            }
            return assets.pop();
        }
        // Triangles take their numbers through the build, and get their faces back.
        let (key, triangles) = (loose.key, loose.triangles.len());
        let faces: Vec<u32> = loose.triangles.iter().map(|triangle| triangle.face).collect();
        (0..).zip(&mut loose.triangles).for_each(|(number, triangle)| triangle.face = number);
        let mut parts = Vec::new();
        let mut note = |asset: &mut MeshAsset| {
            parts.push(ShapePart::of(asset));
            for triangle in &mut asset.triangles {
                triangle.face = faces.get(triangle.face as usize).copied().unwrap_or(0);
            }
        };
        let whole = build(loose, &mut |mut cluster| {
            note(&mut cluster);
            put(cluster);
        });
        let whole = whole.map(|mut asset| {
            note(&mut asset);
            asset
        });
        self.shape = Some(Arc::new(MeshShape { key, is_split: whole.is_none(), triangles, parts }));
        whole
    }
}

impl ShapePart {
    /// Of an asset whose triangles have their numbers in place of faces.
    fn of(asset: &MeshAsset) -> Self {
        let order = asset.triangles.iter().map(|triangle| triangle.face).collect();
        let boxes: Vec<Aabb> = (0..asset.triangles.len()).map(|at| asset.item_bounds(at)).collect();
        Self { order, tree: TreeShape::of(&asset.bvh, &boxes), bytes: asset.device_bytes() }
    }
}

impl MeshShape {
    /// The assets of `loose`, each with the triangles that it had; `None` if there are more or fewer triangles, if an
    /// asset would have another size, or if a hierarchy has worn out.
    fn assets(&self, loose: &MeshAsset, cluster_bytes: u64) -> Option<Vec<MeshAsset>> {
        if self.triangles != loose.triangles.len() {
            return None;
        }
        let all = self.parts.par_iter().enumerate();
        all.map(|(number, part)| {
            let boxes: Vec<Aabb> = part.order.iter().map(|at| loose.item_bounds(*at as usize)).collect();
            let bvh = part.tree.refit(&boxes)?;
            drop(boxes);
            let points = self.is_split.then(|| points_of(loose, &part.order));
            let mut asset = arrange(loose, bvh, &part.order, points.as_deref());
            if self.is_split {
                asset.key = cluster_key((loose.key, cluster_bytes), number as u64, TriangleOrder::Authored);
            }
            (asset.device_bytes() == part.bytes).then_some(asset)
        })
        .collect()
    }
}
