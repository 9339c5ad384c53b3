// SPDX-License-Identifier: Apache-2.0
//! Splits large meshes into spatial clusters, each an asset of its own with its own hierarchy.
//!
//! Guarantees: every triangle is in exactly one cluster; its corners, face number and attribute values keep their bits;
//! the clusters depend on the mesh and on the size asked for only, not on the number of threads or on how many clusters
//! are made at once. Work is spread over the caller's rayon pool: clusters are independent, only the first cuts go over
//! all triangles on one thread.

use oocpt_abi::{AttributeRate, Bvh4Node};
use rayon::prelude::*;
use xxhash_rust::xxh3::Xxh3;

use super::build_bvh4::build_bvh4_over;
use super::bundle::POINT_BUNDLE;
use super::bvh4::Bvh4;
use super::{
    Aabb, AnyAttribute, Attribute, LeafKind, MeshAsset, MeshPrimvar, MeshSummary, PRIMVAR_BYTES, SECTION_ALIGN,
    each_width,
};

/// Expected nodes per 16 triangles. Measured: 3.7 to 4.0 for grids and closed surfaces, 3.4 to 3.5 for soups.
const NODES_PER_16: u64 = 4;
/// Number of nodes per 16 bundles of points.
const NODES_PER_16_BUNDLES: u64 = 8;
/// Number of sixteenths to which clusters are planned to be full, so that most need no second cut.
const FILL_16: u64 = 15;

/// The order of triangles in the mesh that is split: the tie break of the cuts, hence part of the clusters' keys.
#[derive(Clone, Copy, Debug)]
pub(super) enum TriangleOrder {
    /// The order of the hierarchy.
    Bvh,
    /// The authored order.
    Authored,
}

/// A triangle while it is sorted into clusters. 16 bytes, so that cuts of large meshes stay in the cache.
#[derive(Clone, Copy)]
struct SplitTriangle {
    /// Twice the centre of the item's box.
    center: [f32; 3],
    triangle: u32,
}

/// The mesh that is split, and the order of its triangles.
#[derive(Clone, Copy)]
pub(super) struct SplitSource<'a> {
    pub(super) mesh: &'a MeshAsset,
    /// Boxes of the parts of its triangles that cutouts keep, empty if nothing is kept; `None`: all triangles are
    /// whole.
    pub(super) covered: Option<&'a [Aabb]>,
}

impl SplitSource<'_> {
    fn item_bounds(&self, item: u32) -> Aabb {
        match self.covered {
            Some(covered) => covered.get(item as usize).copied().unwrap_or(Aabb::EMPTY),
            None => self.mesh.item_bounds(item as usize),
        }
    }
}

/// A mesh being split.
struct MeshSplitter<'a> {
    source: SplitSource<'a>,
    mesh: &'a MeshAsset,
    max_bytes: u64,
    /// Bytes of an item at one key, with its radius.
    item_bytes: u64,
}

/// Splits `mesh` into clusters of at most `max_bytes` on the device ([`MeshAsset::device_bytes`]); a single triangle
/// may take more. A mesh that fits gives one cluster.
///
/// A cluster's `key` is the xxh3-128 of the mesh's key, `max_bytes`, the cluster's number and whether the triangles
/// came in authored order or in that of a hierarchy: equal keys mean equal clusters. Attributes keep their rates;
/// values of points that a cluster does not use are left out of it.
#[must_use]
pub fn split_mesh(mesh: &MeshAsset, max_bytes: u64) -> Vec<MeshAsset> {
    let mut clusters = Vec::new();
    split_ordered(SplitSource { mesh, covered: None }, max_bytes, TriangleOrder::Bvh, usize::MAX, &mut |cluster| {
        clusters.push(cluster)
    });
    clusters
}

/// As [`split_mesh`], for a mesh in any order; its own hierarchy is ignored. Gives each cluster to `put`, in order; at
/// most `at_once` are made in parallel and wait for that, so that the caller needs memory for no more.
pub(super) fn split_ordered(
    source: SplitSource<'_>,
    max_bytes: u64,
    order: TriangleOrder,
    at_once: usize,
    put: &mut dyn FnMut(MeshAsset),
) {
    let mesh = source.mesh;
    let item = |triangle: u32| {
        let b = source.item_bounds(triangle);
        (!b.is_empty()).then(|| SplitTriangle { center: [0, 1, 2].map(|k| b.min[k] + b.max[k]), triangle })
    };
    let count = u32::try_from(mesh.triangles.len()).unwrap_or(u32::MAX);
    let mut items: Vec<SplitTriangle> = (0..count).into_par_iter().filter_map(item).collect();
    let summary = MeshSummary::of(mesh);
    let item_bytes = summary.item_bytes() + if summary.radii > 1 { 4 } else { 0 };
    let splitter = MeshSplitter { source, mesh, max_bytes, item_bytes };
    let filled = (max_bytes / 16).saturating_mul(FILL_16).max(1);
    let parts = if splitter.fits(&items) { 1 } else { expected_bytes(mesh).div_ceil(filled) };
    let mut numbers = 0_u64..;
    for group in splitter.parts(&mut items, parts).chunks_mut(at_once.max(1)) {
        let made: Vec<Vec<MeshAsset>> =
            group.par_iter_mut().with_max_len(1).map(|part| splitter.clusters(part)).collect();
        for (mut cluster, number) in made.into_iter().flatten().zip(&mut numbers) {
            cluster.key = cluster_key((mesh.key, max_bytes), number, order);
            put(cluster);
        }
    }
}

/// Key of a cluster of the mesh with this key, in clusters of at most so many bytes: see [`split_mesh`].
pub(super) fn cluster_key((mesh, max_bytes): (u128, u64), number: u64, order: TriangleOrder) -> u128 {
    let mut hasher = Xxh3::new();
    hasher.update(&mesh.to_le_bytes());
    hasher.update(&max_bytes.to_le_bytes());
    hasher.update(&number.to_le_bytes());
    hasher.update(&[order as u8]);
    hasher.digest128()
}

/// The points of the corners of `members`, sorted; empty if no attribute has values by point.
pub(super) fn points_of(mesh: &MeshAsset, members: &[u32]) -> Vec<u32> {
    let mut points = pick(&mesh.corner_indices, members).into_flattened();
    points.sort_unstable();
    points.dedup();
    points
}

/// Approximate device bytes of the mesh once it has a hierarchy: a function of its sizes only.
pub(super) fn expected_bytes(mesh: &MeshAsset) -> u64 {
    let hierarchy = if mesh.bvh.nodes.is_empty() { node_bytes(mesh.kind, mesh.triangles.len() as u64) } else { 0 };
    mesh.device_bytes().saturating_add(hierarchy)
}

fn node_bytes(kind: LeafKind, items: u64) -> u64 {
    let nodes = match kind {
        LeafKind::Points => items.div_ceil(POINT_BUNDLE as u64) * NODES_PER_16_BUNDLES,
        _ => items * NODES_PER_16,
    };
    nodes.div_ceil(16) * size_of::<Bvh4Node>() as u64
}

impl MeshSplitter<'_> {
    /// `items` cut into about `parts` parts, in order.
    fn parts<'i>(&self, items: &'i mut [SplitTriangle], parts: u64) -> Vec<&'i mut [SplitTriangle]> {
        let parts = parts.clamp(1, items.len().max(1) as u64);
        if parts == 1 {
            return vec![items];
        }
        let left = parts / 2;
        let (low, high) = cut(items, left, parts);
        let (mut cuts, more) = rayon::join(|| self.parts(low, left), || self.parts(high, parts - left));
        cuts.extend(more);
        cuts
    }

    /// The clusters of a part: one, unless it is too large.
    fn clusters(&self, items: &mut [SplitTriangle]) -> Vec<MeshAsset> {
        if let Some(cluster) = self.cluster(items) {
            return vec![cluster];
        }
        let (low, high) = cut(items, 1, 2);
        let mut clusters = self.clusters(low);
        clusters.extend(self.clusters(high));
        clusters
    }

    /// One cluster of all `items`; `None` if it is too large and can be cut.
    fn cluster(&self, items: &[SplitTriangle]) -> Option<MeshAsset> {
        if !self.fits(items) {
            return None;
        }
        let mut members: Vec<u32> = items.iter().map(|item| item.triangle).collect();
        // The order after the cuts is not useful; neighbours in the mesh are often neighbours in space.
        members.sort_unstable();
        let boxes: Vec<Aabb> = members.iter().map(|&item| self.source.item_bounds(item)).collect();
        let (bvh, order) = build_bvh4_over(&boxes, self.mesh.kind);
        let order: Vec<u32> = pick(&members, &order);
        let mut cluster = arrange(self.mesh, bvh, &order, Some(&points_of(self.mesh, &members)));
        if self.source.covered.is_some() {
            cluster.bounds = boxes.iter().fold(Aabb::EMPTY, |all, bounds| all.union(bounds));
            cluster.is_clipped = true;
        }
        (members.len() <= 1 || cluster.device_bytes() <= self.max_bytes).then_some(cluster)
    }

    /// Returns true if `items` will fit into a cluster, as far as that can be estimated without their hierarchy.
    fn fits(&self, items: &[SplitTriangle]) -> bool {
        let count = items.len() as u64;
        let later = self.mesh.keys.times.len().saturating_sub(1) as u64;
        let moved = (self.item_bytes + if self.mesh.keys.normals.is_empty() { 0 } else { 36 }) * later;
        let constant = count * (self.item_bytes + moved) + node_bytes(self.mesh.kind, count);
        if count <= 1 || constant > self.max_bytes {
            return count <= 1;
        }
        let members: Vec<u32> = items.iter().map(|item| item.triangle).collect();
        let points = points_of(self.mesh, &members).len() as u64;
        let mesh = self.mesh;
        let corners = if mesh.corner_indices.is_empty() { 0 } else { count * size_of::<[u32; 3]>() as u64 };
        let attributes = [
            corners.next_multiple_of(SECTION_ALIGN),
            attribute_bytes(mesh.normals.as_ref(), count, points),
            attribute_bytes(mesh.colors.as_ref(), count, points),
            attribute_bytes(mesh.opacities.as_ref(), count, points),
        ];
        let primvar = |p: &MeshPrimvar| each_width!(&p.values, a => attribute_bytes(Some(a), count, points));
        let primvars: u64 = mesh.primvars.iter().map(primvar).sum();
        let table = mesh.primvars.len() as u64 * PRIMVAR_BYTES;
        constant + attributes.iter().sum::<u64>() + primvars + table <= self.max_bytes
    }
}

/// The triangles `order` of `mesh` as an asset with hierarchy `bvh`. With `points` (sorted) its corners and the values
/// by point are restricted to these, else they are unchanged.
pub(super) fn arrange(mesh: &MeshAsset, bvh: Bvh4, order: &[u32], points: Option<&[u32]>) -> MeshAsset {
    let triangles = pick(&mesh.triangles, order);
    let mut corner_indices = pick(&mesh.corner_indices, order);
    if let Some(points) = points {
        for corner in corner_indices.as_flattened_mut() {
            // Every corner's point is in the list, at a place below 2^32.
            *corner = points.binary_search(corner).ok().and_then(|at| u32::try_from(at).ok()).unwrap_or(0);
        }
    }
    let mut arranged = MeshAsset {
        key: mesh.key,
        bounds: Aabb::EMPTY,
        whole: Aabb::EMPTY,
        is_clipped: false,
        bvh,
        kind: mesh.kind,
        triangles,
        corner_indices,
        normals: mesh.normals.as_ref().map(|a| arrange_values(a, order, points)),
        colors: mesh.colors.as_ref().map(|a| arrange_values(a, order, points)),
        opacities: mesh.opacities.as_ref().map(|a| arrange_values(a, order, points)),
        primvars: mesh.primvars.iter().map(|p| arrange_primvar(p, order, points)).collect(),
        subsets: pick(&mesh.subsets, order),
        ptex: pick(&mesh.ptex, order),
        keys: mesh.keys.arranged(order, mesh.triangles.len()),
        double_sided: mesh.double_sided,
        left_handed: mesh.left_handed,
    };
    let boxes = (0..arranged.triangles.len()).map(|at| arranged.item_bounds(at));
    arranged.whole = boxes.fold(Aabb::EMPTY, |all, bounds| all.union(&bounds));
    arranged.bounds = arranged.whole;
    arranged
}

fn arrange_primvar(primvar: &MeshPrimvar, order: &[u32], points: Option<&[u32]>) -> MeshPrimvar {
    let values = match &primvar.values {
        AnyAttribute::One(a) => AnyAttribute::One(arrange_values(a, order, points)),
        AnyAttribute::Two(a) => AnyAttribute::Two(arrange_values(a, order, points)),
        AnyAttribute::Three(a) => AnyAttribute::Three(arrange_values(a, order, points)),
        AnyAttribute::Four(a) => AnyAttribute::Four(arrange_values(a, order, points)),
    };
    MeshPrimvar { id: primvar.id, values }
}

fn arrange_values<T: Copy>(attribute: &Attribute<T>, order: &[u32], points: Option<&[u32]>) -> Attribute<T> {
    let values = match (attribute.rate, points) {
        (AttributeRate::Uniform, _) => pick(&attribute.values, order),
        (AttributeRate::FaceVarying, _) => pick(attribute.values.as_chunks::<3>().0, order).into_flattened(),
        (AttributeRate::Vertex, Some(points)) => pick(&attribute.values, points),
        (AttributeRate::Vertex, None) | (AttributeRate::Constant, _) => attribute.values.clone(),
    };
    Attribute { rate: attribute.rate, values }
}

fn attribute_bytes<T>(attribute: Option<&Attribute<T>>, triangles: u64, points: u64) -> u64 {
    let Some(attribute) = attribute else { return 0 };
    let values = match attribute.rate {
        AttributeRate::Constant => 1,
        AttributeRate::Uniform => triangles,
        AttributeRate::Vertex => points,
        AttributeRate::FaceVarying => 3 * triangles,
    };
    (values * size_of::<T>() as u64).next_multiple_of(SECTION_ALIGN)
}

/// `values` at `places`; empty if there are no values at all. Indices out of range, which cannot occur, are skipped.
fn pick<T: Copy>(values: &[T], places: &[u32]) -> Vec<T> {
    // Allocated with the exact size: a list that grows while it is made keeps up to twice its length for its whole
    // life.
    let mut picked = Vec::with_capacity(if values.is_empty() { 0 } else { places.len() });
    picked.extend(places.iter().filter_map(|&i| values.get(i as usize).copied()));
    picked
}

/// Cuts `items` across their longest axis, with `left` of `parts` on the first side.
fn cut(items: &mut [SplitTriangle], left: u64, parts: u64) -> (&mut [SplitTriangle], &mut [SplitTriangle]) {
    let middle = usize::try_from(items.len() as u128 * u128::from(left) / u128::from(parts)).unwrap_or(0);
    let axis = longest_axis(items);
    let order = |a: &SplitTriangle, b: &SplitTriangle| {
        a.center[axis].total_cmp(&b.center[axis]).then(a.triangle.cmp(&b.triangle))
    };
    items.select_nth_unstable_by(middle, order);
    items.split_at_mut(middle)
}

fn longest_axis(items: &[SplitTriangle]) -> usize {
    let bounds = items.iter().fold(Aabb::EMPTY, |b, item| b.with_point(item.center));
    super::bvh::longest_axis(&bounds)
}
