// SPDX-License-Identifier: Apache-2.0
//! Upper bound of the host memory that building a mesh takes, computed before it is built from the lengths of its
//! arrays and the rate at which it is cut. Tests compare it with the memory that building really takes. Pure.

use super::demand::BuildDemand;
use super::dicing::DicingRate;
use super::leaf::round::curve_points;
use super::patch::{MeshPatch, PatchSize};
use super::primvar::TriangleSource;
use super::refine::{EdgeRates, MAX_REFINED_TRIANGLES};
use super::topology::{MAX_CORNERS, MeshFace};
use super::{POINT_BUNDLE, POINT_BYTES, TRIANGLE_BYTES, Triangle};
use crate::array::TypedArray;
use crate::desc::{CurveBasis, Interpolation, MeshDesc, PrimShape, Primvar, Subdivision};
use glam::DVec3;
use oocpt_abi::{Bvh4Node, NAME_PTEX};

/// Bytes that building a tree takes for each item: boxes, twice; the nodes of the builder, of the binary tree and of
/// its copy with larger leaves; sorted codes.
const TREE: u64 = 340;
/// Bytes of an item.
const ITEM: u64 = size_of::<Triangle>() as u64;
/// Bytes of an item and of its source, while a description is read.
const READ_ITEM: u64 = ITEM + size_of::<TriangleSource>() as u64;
/// Bytes of nodes per item.
const NODES: u64 = size_of::<Bvh4Node>() as u64 * 5 / 16;
/// Bytes of an item while it is sorted into clusters.
const SORTED: u64 = 16;
/// Bytes of the box of a triangle with a cutout, and of its number.
const COVERED: u64 = 28;
/// Bytes of a point in any array.
const POINT: u64 = size_of::<[f32; 3]>() as u64;
/// Bytes that OpenSubdiv takes for each corner of a control mesh.
const CONTROL_CORNER: u64 = 640;
/// Bytes of a vertex of a surface that is cut: positions and normals in blocks and joined, and its displacement.
const CUT_VERTEX: u64 = 160;
/// Bytes of a point of curves that are cut.
const CURVE_POINT: u64 = 280;
/// Largest number of keys of a moving mesh.
const MAX_KEYS: u64 = 16;

/// Host memory that building a mesh takes, bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct BuildFootprint {
    /// Most bytes while its arrays are read.
    reading: u64,
    /// Most bytes after that, without clusters in progress.
    whole: u64,
    /// Bytes of each cluster in progress; 0 if there are no clusters.
    cluster: u64,
    /// Approximate number of clusters.
    clusters: u64,
}

impl BuildFootprint {
    /// Least bytes of building: one cluster is made at a time.
    pub(crate) fn least(&self) -> u64 {
        self.reading.max(self.whole.saturating_add(self.cluster))
    }

    /// Number of clusters that can be made in parallel within `bytes`, at least one and at most `most`, and the bytes
    /// that building then takes.
    pub(crate) fn within(&self, bytes: u64, most: usize) -> (usize, u64) {
        let fit = bytes.saturating_sub(self.whole).checked_div(self.cluster).unwrap_or(1);
        let at_once = fit.min(self.clusters).min(most as u64).max(1);
        let building = self.whole.saturating_add(self.cluster.saturating_mul(at_once));
        (usize::try_from(at_once).unwrap_or(1), self.reading.max(building))
    }

    /// A footprint of `whole` bytes, without clusters.
    #[cfg(test)]
    pub(crate) fn plain(whole: u64) -> Self {
        Self { whole, ..Self::default() }
    }

    /// The footprint of building a mesh as `super::build` does it.
    pub(crate) fn of(desc: &MeshDesc, demand: &BuildDemand<'_>, limit_bytes: u64, cluster_bytes: u64) -> Self {
        let lengths = [&desc.face_vertex_counts, &desc.face_vertex_indices, &desc.points].map(TypedArray::len);
        if lengths.into_iter().any(|length| length > MAX_CORNERS) {
            // Such a prim is refused before anything is built.
            return Self::default();
        }
        let mut read = ReadSize::of(desc, demand, lengths.map(|length| length as u64));
        let is_cut_out = matches!(desc.shape, PrimShape::Mesh) && demand.covers.iter().any(Option::is_some);
        read.covered = if is_cut_out { COVERED.saturating_mul(read.items) } else { 0 };
        read.footprint(limit_bytes, cluster_bytes)
    }

    /// The footprint of a patch of a mesh, with its rings.
    pub(crate) fn of_patch(desc: &MeshDesc, demand: &BuildDemand<'_>, patch: &MeshPatch, limits: [u64; 2]) -> Self {
        let PatchSize { faces, corners, triangles } = patch.size();
        // The patch as a mesh of its own, and indices for its values.
        let taken = 64 * corners;
        let mut read = ReadSize::of_surface(desc, demand, [faces, corners, corners], triangles);
        read.beside = read.beside.saturating_add(taken);
        read.covered = if demand.covers.iter().any(Option::is_some) { COVERED.saturating_mul(read.items) } else { 0 };
        // The values that its own triangles use are copied.
        read.beside = read.beside.saturating_add(read.loose());
        let [limit_bytes, cluster_bytes] = limits;
        read.footprint(limit_bytes, cluster_bytes)
    }
}

/// Size of the items that a description is read into.
#[derive(Clone, Copy, Debug, Default)]
struct ReadSize {
    /// Number of triangles or other items.
    items: u64,
    /// True for points, whose tree is over bundles.
    is_of_points: bool,
    /// Bytes besides those of items, until the tree is built.
    beside: u64,
    /// Bytes of attributes, with the indices of their values.
    attributes: u64,
    /// Bytes of all keys but the first.
    keys: u64,
    /// Bytes of the facts about cutouts.
    covered: u64,
}

impl ReadSize {
    fn of(desc: &MeshDesc, demand: &BuildDemand<'_>, [faces, corners, points]: [u64; 3]) -> Self {
        let keys = key_count(desc);
        let of_ptex = demand.wanted.iter().any(|wanted| wanted.id == NAME_PTEX);
        let topology = |faces: u64, corners: u64, points: u64| topology_bytes(faces, corners, points, keys);
        let none = DicingRate::default();
        let dicing = demand.dicing.unwrap_or(&none);
        match &desc.shape {
            PrimShape::Mesh if demand.refines(desc) && !of_ptex => {
                let items = refined_triangles(desc, demand, dicing, corners);
                Self::of_surface(desc, demand, [faces, corners, points], items)
            }
            PrimShape::Mesh => {
                let items = triangle_count(desc, corners, of_ptex);
                let values = value_bytes(desc, demand, [1, items, points, 3 * items]);
                let is_smooth = matches!(desc.subdivision, Subdivision::CatmullClark | Subdivision::Loop);
                // Sums in double precision.
                let smooth = if is_smooth || desc.normals.is_some() { 60 * points } else { 0 };
                let ptex = if of_ptex { 12 * items } else { 0 };
                let beside = topology(faces, corners, points) + smooth + 2 * ptex;
                Self::with(desc, items, beside, values.saturating_add(smooth / 5 + ptex), keys)
            }
            PrimShape::Curves(curves) => {
                let indices = curves.indices.as_ref().map_or(0, |indices| indices.len() as u64);
                let count = match curves.basis {
                    CurveBasis::Linear => counted(&curves.counts, |count| count).min(points.max(indices)),
                    _ => curve_points(desc, curves, dicing),
                };
                // Ribbons have two triangles a piece, and two points at each end.
                let items = if desc.normals.is_some() { 2 * count } else { count };
                let values = value_bytes(desc, demand, [1, items, items, items]);
                let beside = CURVE_POINT.saturating_mul(count).saturating_add(2 * topology(items, 3 * items, items));
                Self::with(desc, items, beside.saturating_add(values), values, keys)
            }
            _ => {
                let values = value_bytes(desc, demand, [1, 1, points, points]);
                let beside = 2 * topology(points, 3 * points, points);
                Self { is_of_points: true, ..Self::with(desc, points, beside, values, keys) }
            }
        }
    }

    /// A surface that is cut into `items` triangles.
    fn of_surface(desc: &MeshDesc, demand: &BuildDemand<'_>, [faces, corners, points]: [u64; 3], items: u64) -> Self {
        let keys = key_count(desc);
        // Faces that meet at edges that are not smooth have vertices of their own there.
        let vertices = items.saturating_add(corners);
        let values = value_bytes(desc, demand, [1, items, vertices, vertices]);
        let cut = CUT_VERTEX.saturating_mul(vertices).saturating_add(values.saturating_mul(4));
        let control = topology_bytes(faces, corners, points, keys) + CONTROL_CORNER * corners + 48 * points;
        let refined = topology_bytes(items, 3 * items, vertices, keys) + 16 * items;
        let beside = control.saturating_add(cut.saturating_mul(keys.max(1))).saturating_add(refined);
        Self::with(desc, items, beside, values.saturating_add(POINT * vertices), keys)
    }

    fn with(desc: &MeshDesc, items: u64, beside: u64, values: u64, keys: u64) -> Self {
        let subsets = if desc.subsets.is_empty() { 0 } else { 2 * items };
        // Points of corners, where some values go by them.
        let attributes = if values == 0 { 0 } else { values.saturating_add(12 * items) };
        let attributes = attributes.saturating_add(subsets);
        // Vertices at each key, and normals by corner.
        let of_keys = 72_u64.saturating_mul(items).saturating_mul(keys.saturating_sub(1));
        Self { items, is_of_points: false, beside, attributes, keys: of_keys, covered: 0 }
    }

    /// Bytes of the items in authored order, with all their data.
    fn loose(&self) -> u64 {
        ITEM.saturating_mul(self.items).saturating_add(self.attributes).saturating_add(self.keys)
    }

    fn footprint(&self, limit_bytes: u64, cluster_bytes: u64) -> BuildFootprint {
        let loose = self.loose();
        // Items exist in blocks and joined; lists of values grow while they are read.
        let items = (2 * READ_ITEM).saturating_mul(self.items);
        let values = self.attributes.saturating_add(self.attributes / 2).saturating_add(self.keys.saturating_mul(2));
        let reading = self.beside.saturating_add(items).saturating_add(values);
        let per_item = if self.is_of_points { TREE / POINT_BUNDLE as u64 + 40 } else { TREE };
        let device = if self.is_of_points { POINT_BYTES + 3 } else { TRIANGLE_BYTES + 12 };
        let arranged = |items: u64| {
            let share = u128::from(loose) * u128::from(items) / u128::from(self.items.max(1));
            u64::try_from(share).unwrap_or(u64::MAX).saturating_add(NODES * items)
        };
        // The copy in the tree's order is made when most of the tree's memory is free again.
        let tree = |items: u64| (per_item * items).max(arranged(items) + 32 * items);
        let expected = device.saturating_mul(self.items).saturating_add(self.attributes);
        let whole = loose.saturating_add(self.covered).saturating_add(tree(self.items.min(limit_bytes / device)));
        if expected <= limit_bytes {
            return BuildFootprint { reading, whole, cluster: 0, clusters: 0 };
        }
        let of_cluster = self.items.min(cluster_bytes / device + 1);
        let cluster = tree(of_cluster).saturating_add(arranged(of_cluster)).saturating_add(40 * of_cluster);
        let sorted = loose.saturating_add(self.covered).saturating_add(SORTED * self.items);
        // Unusable values may make it small enough for one tree.
        let is_near = expected / 2 <= limit_bytes;
        let reading = if is_near { reading.max(whole) } else { reading };
        BuildFootprint { reading, whole: sorted, cluster, clusters: expected.div_ceil(cluster_bytes.max(1)) }
    }
}

/// Bytes of a topology with its points, at each of its keys too.
fn topology_bytes(faces: u64, corners: u64, points: u64, keys: u64) -> u64 {
    faces * size_of::<MeshFace>() as u64 + 4 * corners + POINT * points * (1 + keys)
}

/// Largest number of keys that it may have; 0 if nothing moves.
fn key_count(desc: &MeshDesc) -> u64 {
    let motion = &desc.point_motion;
    match motion.samples.len() as u64 {
        _ if motion.velocities.is_some() => 5,
        0 | 1 => 0,
        samples => (samples + 2).min(MAX_KEYS),
    }
}

/// Largest number of triangles of polygons with this number of corners in all.
fn triangle_count(desc: &MeshDesc, corners: u64, of_ptex: bool) -> u64 {
    let of_face = |count: u64| if of_ptex && count != 4 { count } else { count.saturating_sub(2) };
    counted(&desc.face_vertex_counts, of_face).min(corners)
}

/// The sum of `of(count)` over all counts.
fn counted(counts: &TypedArray, of: impl Fn(u64) -> u64) -> u64 {
    let counts = counts.view();
    let count = |at: usize| counts.index(at).and_then(|count| u64::try_from(count).ok()).unwrap_or(0);
    (0..counts.len()).map(|at| of(count(at))).fold(0, u64::saturating_add)
}

/// Largest number of triangles of a surface that is cut.
fn refined_triangles(desc: &MeshDesc, demand: &BuildDemand<'_>, dicing: &DicingRate, corners: u64) -> u64 {
    let cutting = EdgeRates::new(desc, dicing, demand.displaces(desc));
    let (counts, indices, points) =
        (desc.face_vertex_counts.view(), desc.face_vertex_indices.view(), desc.points.view());
    let point = |corner: usize| {
        let at = indices.index(corner).and_then(|at| usize::try_from(at).ok());
        at.and_then(|at| points.vec3(at)).unwrap_or(DVec3::ZERO)
    };
    let (mut first, mut sum) = (0_usize, 0_u64);
    for at in 0..counts.len() {
        let Some(count) = counts.index(at).and_then(|count| usize::try_from(count).ok()) else { continue };
        if count > indices.len() - first {
            break;
        }
        let edges = (0..count).map(|k| cutting.pieces(point(first + k), point(first + (k + 1) % count)));
        let most = edges.max().and_then(|most| u64::try_from(most).ok()).unwrap_or(0);
        first += count;
        // Faces with other than four corners are first cut at their middles.
        let of_face = match count {
            0..3 => 0,
            4 => 2 * most * most,
            3 if desc.subdivision == Subdivision::Loop => most * most,
            _ => 2 * count as u64 * most.div_ceil(2) * most.div_ceil(2),
        };
        sum = sum.saturating_add(of_face + 4 * most);
    }
    sum.min(MAX_REFINED_TRIANGLES.max(2 * corners))
}

/// Bytes of values, if a primvar has this many at each rate: for all, for each face, for each point, for each corner.
fn value_bytes(desc: &MeshDesc, demand: &BuildDemand<'_>, counts: [u64; 4]) -> u64 {
    let bytes = |primvar: &Primvar, width: u64| {
        let count = match primvar.interpolation {
            Interpolation::Constant | Interpolation::Instance => counts[0],
            Interpolation::Uniform => counts[1],
            Interpolation::Vertex | Interpolation::Varying => counts[2],
            Interpolation::FaceVarying => counts[3],
        };
        count.saturating_mul(width)
    };
    let named = desc.primvars.iter().filter(|named| demand.reads(&named.name)).map(|named| bytes(&named.primvar, 16));
    let own = [(&desc.normals, 12), (&desc.display_color, 12), (&desc.display_opacity, 4)];
    let own = own.into_iter().filter_map(|(primvar, width)| Some(bytes(primvar.as_ref()?, width)));
    named.chain(own).fold(0, u64::saturating_add)
}

#[cfg(test)]
mod tests;
