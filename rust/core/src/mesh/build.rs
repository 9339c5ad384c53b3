// SPDX-License-Identifier: Apache-2.0
//! Builds one asset from a mesh description, or several clusters where the mesh is large. Pure; a commit runs it for
//! several meshes in parallel.

use oocpt_abi::{AttributeRate, NAME_PTEX};
use std::sync::Arc;

use glam::Vec3;
use rayon::prelude::*;

use super::build_bvh4::build_bvh4_over;
use super::bvh4::Bvh4;
use super::covered::covered_boxes;
use super::deform::{poses, read_keys};
use super::demand::BuildDemand;
use super::leaf::{LeafItems, read_items};
use super::normals::{build_normals, geometric_normal};
use super::patch::{MeshPatch, TakenPatch};
use super::patch_desc::PatchDesc;
use super::pose::PointsPose;
use super::primvar::{PrimvarLayout, TriangleSource, convert, convert_wanted, subset_numbers};
use super::ptex::{PtexNumbers, PtexTriangle};
use super::refine::{ControlShape, RefinedMesh, refine};
use super::refit::MeshRefit;
use super::split::{SplitSource as Whole, TriangleOrder, arrange, expected_bytes, split_ordered};
use super::topology::{MeshFace, MeshTopology, read_topology};
use super::triangulate::FaceTriangulator;
use super::unsorted::UnsortedMesh;
use super::{Aabb, Attribute, LeafKind, MeshAsset, Triangle};
use crate::array::ArrayView;
use crate::desc::{DroppedData, MeshDesc, PrimShape};

/// Faces that a thread triangulates at a time.
const FACE_BLOCK: usize = 1 << 14;

/// Twice the smallest area of a triangle that is kept, in squares of its longest edge: three times the rounding of the
/// products in double precision, so that the direction of the normal is meaningful. The same at every scale.
pub const MIN_RELATIVE_DOUBLE_AREA: f64 = 1e-15;
/// Twice the smallest area that is kept at all: the device computes it in single precision, without denormal numbers.
pub const MIN_DOUBLE_AREA: f64 = 1e-36;

/// The assets of a mesh: one, several clusters, or none if nothing was usable; and the data that were dropped.
#[derive(Clone, Debug)]
pub struct BuiltMesh {
    /// The whole mesh; `None` if it was split or nothing was usable.
    pub asset: Option<Arc<MeshAsset>>,
    /// Clusters of the mesh, if it was split; otherwise empty. See [`super::split_mesh`].
    pub clusters: Vec<Arc<MeshAsset>>,
    /// Data dropped because it was bad.
    pub dropped: DroppedData,
    /// Further notes for the user, in words.
    pub notes: Vec<String>,
}

/// Builds the asset of `desc`; `key` is its [`super::mesh_key`]. Never splits.
#[must_use]
pub fn build_mesh(desc: &MeshDesc, key: u128) -> BuiltMesh {
    build_mesh_split(desc, key, u64::MAX, u64::MAX)
}

/// Builds the asset of `desc`, or, where it would take more than about `limit_bytes` on the device, its clusters of at
/// most `cluster_bytes` each. A split mesh never gets a hierarchy of its own. `key` is its [`super::mesh_key`].
///
/// Whether to split is decided by the numbers of triangles and attribute values, hence the same everywhere. Clusters
/// are the same bits for any number of threads, but differ from those that [`super::split_mesh`] makes of the whole
/// asset.
#[must_use]
pub fn build_mesh_split(desc: &MeshDesc, key: u128, limit_bytes: u64, cluster_bytes: u64) -> BuiltMesh {
    build_mesh_with(desc, &BuildDemand::default(), key, limit_bytes, cluster_bytes)
}

/// [`build_mesh_split`] for a demand, on its limit surface if it is a subdivision surface.
#[must_use]
pub fn build_mesh_with(
    desc: &MeshDesc,
    demand: &BuildDemand<'_>,
    key: u128,
    limit_bytes: u64,
    cluster_bytes: u64,
) -> BuiltMesh {
    let mut clusters = Vec::new();
    let cuts = ClusterLimits { limit_bytes, cluster_bytes, at_once: usize::MAX };
    let mut put = |cluster| clusters.push(Arc::new(cluster));
    let BuiltAsset { asset, dropped, notes } = build_mesh_into(desc, demand, key, cuts, (None, &mut put));
    BuiltMesh { asset: asset.map(Arc::new), clusters, dropped, notes }
}

/// Limits by which a large mesh is cut into clusters.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ClusterLimits {
    /// Bytes on the device above which, approximately, a mesh is cut.
    pub(crate) limit_bytes: u64,
    /// Most bytes of a cluster on the device.
    pub(crate) cluster_bytes: u64,
    /// Number of clusters that are made in parallel. It does not change the result.
    pub(crate) at_once: usize,
}

/// A [`BuiltMesh`] without its clusters.
#[derive(Debug, Default)]
pub(crate) struct BuiltAsset {
    pub(crate) asset: Option<MeshAsset>,
    pub(crate) dropped: DroppedData,
    pub(crate) notes: Vec<String>,
}

/// As [`build_mesh_with`], but gives each cluster to `put` as soon as it is made. `refit`: of a mesh that deforms.
pub(crate) fn build_mesh_into(
    desc: &MeshDesc,
    demand: &BuildDemand<'_>,
    key: u128,
    cuts: ClusterLimits,
    (refit, put): (Option<&mut MeshRefit>, &mut dyn FnMut(MeshAsset)),
) -> BuiltAsset {
    let wanted = demand.wanted;
    let mut built = BuiltAsset::default();
    let BuiltAsset { asset, dropped, notes } = &mut built;
    let poses = poses(desc).unwrap_or_else(|why| {
        notes.push(format!("{why}, so its points stay where they are at the frame's own time"));
        Vec::new()
    });
    let dicing = demand.dicing.cloned().unwrap_or_default();
    if let Some(items) = read_items(desc, wanted, &dicing, &poses, dropped) {
        let zero_area_triangles = dropped.zero_area_triangles;
        let LeafItems { topology, desc, kind, radii, poses: posed } = &items;
        let loose = UnsortedMesh { desc, wanted, key, topology, kind: *kind, radii, poses: posed };
        let loose = read_triangles(loose, dropped);
        // Ribbons may have no width somewhere.
        dropped.zero_area_triangles = zero_area_triangles;
        dropped.empty_items = std::mem::take(&mut dropped.empty_meshes);
        drop(items);
        *asset = loose.and_then(|loose| arrange_or_split(loose, None, cuts, put));
        return built;
    }
    let loose = read_faces((desc, &poses, None), demand, key, dropped, notes);
    drop(poses);
    *asset = loose.and_then(|loose| {
        match (refit, covered_boxes(&loose, demand)) {
            // Which parts of it cutouts keep may be anything.
            (Some(refit), None) => {
                refit.arrange(loose, cuts.cluster_bytes, put, |loose, put| arrange_or_split(loose, None, cuts, put))
            }
            (_, covered) => arrange_or_split(loose, covered, cuts, put),
        }
    });
    built
}

/// As [`build_mesh_into`], for a patch of a mesh. Its triangles have the authored numbers of their faces.
pub(crate) fn build_patch_into(
    (desc, patch): (&MeshDesc, &MeshPatch),
    demand: &BuildDemand<'_>,
    key: u128,
    cuts: ClusterLimits,
    put: &mut dyn FnMut(MeshAsset),
) -> BuiltAsset {
    let mut built = BuiltAsset::default();
    let BuiltAsset { asset, dropped, notes } = &mut built;
    let Some(PatchDesc { desc, faces, rings }) = patch.take(desc, demand) else {
        dropped.empty_meshes += 1;
        return built;
    };
    let loose = read_faces((&desc, &[], Some(TakenPatch { patch, rings: &rings })), demand, key, dropped, notes);
    *asset = loose.and_then(|loose| {
        // What the rings have more is no part of it.
        let mut points = loose.corner_indices.as_flattened().to_vec();
        points.sort_unstable();
        points.dedup();
        let order: Vec<u32> = (0..u32::try_from(loose.triangles.len()).unwrap_or(u32::MAX)).collect();
        let mut own = arrange(&loose, Bvh4::default(), &order, Some(&points));
        drop(loose);
        for triangle in &mut own.triangles {
            triangle.face = faces.get(triangle.face as usize).copied().unwrap_or(0);
        }
        let covered = covered_boxes(&own, demand);
        arrange_or_split(own, covered, cuts, put)
    });
    built
}

/// The triangles of a mesh, or of a patch of one, refined if that is asked for.
fn read_faces(
    (desc, poses, patch): (&MeshDesc, &[PointsPose], Option<TakenPatch<'_>>),
    demand: &BuildDemand<'_>,
    key: u128,
    dropped: &mut DroppedData,
    notes: &mut Vec<String>,
) -> Option<MeshAsset> {
    let (wanted, kind) = (demand.wanted, LeafKind::Triangles);
    let mut topology = read_topology(desc, dropped)?;
    let keep_own = |topology: &mut MeshTopology| patch.iter().for_each(|patch| patch.keep_own(topology));
    let Some(mut refined) = refine(ControlShape { desc, topology: &topology, poses, patch }, demand, dropped) else {
        keep_own(&mut topology);
        let loose = UnsortedMesh { desc, wanted, key, topology: &topology, kind, radii: &[], poses };
        return read_triangles(loose, dropped);
    };
    notes.extend_from_slice(&refined.notes);
    keep_own(&mut refined.topology);
    // A limit surface may close to a point, as at a pole, without bad data.
    let zero_area_triangles = dropped.zero_area_triangles;
    let RefinedMesh { topology, desc, poses, .. } = &refined;
    let loose = read_triangles(UnsortedMesh { desc, wanted, key, topology, kind, radii: &[], poses }, dropped);
    dropped.zero_area_triangles = zero_area_triangles;
    loose
}

/// Returns `loose` with its hierarchy, or `None` if it would exceed the limit: then its clusters go to `put`.
/// `covered`: result of [`covered_boxes`].
fn arrange_or_split(
    loose: MeshAsset,
    covered: Option<Vec<Aabb>>,
    cuts: ClusterLimits,
    put: &mut dyn FnMut(MeshAsset),
) -> Option<MeshAsset> {
    if expected_bytes(&loose) > cuts.limit_bytes {
        let source = Whole { mesh: &loose, covered: covered.as_deref() };
        split_ordered(source, cuts.cluster_bytes, TriangleOrder::Authored, cuts.at_once, put);
        return None;
    }
    let Some(covered) = covered else {
        let boxes: Vec<Aabb> = (0..loose.triangles.len()).map(|at| loose.item_bounds(at)).collect();
        let (bvh, order) = build_bvh4_over(&boxes, loose.kind);
        drop(boxes);
        return Some(arrange(&loose, bvh, &order, None));
    };
    let count = u32::try_from(covered.len()).unwrap_or(u32::MAX);
    let there: Vec<u32> = (0..count).zip(&covered).filter(|(_, bounds)| !bounds.is_empty()).map(|(at, _)| at).collect();
    let boxes: Vec<Aabb> = covered.into_iter().filter(|bounds| !bounds.is_empty()).collect();
    let bounds = boxes.iter().fold(Aabb::EMPTY, |all, bounds| all.union(bounds));
    let (bvh, order) = build_bvh4_over(&boxes, loose.kind);
    drop(boxes);
    let order: Vec<u32> = order.iter().filter_map(|&at| there.get(at as usize).copied()).collect();
    Some(MeshAsset { bounds, is_clipped: true, ..arrange(&loose, bvh, &order, None) })
}

/// The mesh in authored order, without a hierarchy.
fn read_triangles(loose: UnsortedMesh<'_>, dropped: &mut DroppedData) -> Option<MeshAsset> {
    let UnsortedMesh { desc, wanted, key, topology, kind, radii, poses } = loose;
    let mut numbers =
        wanted.iter().any(|w| w.id == NAME_PTEX).then(|| PtexNumbers::new(&desc.face_vertex_counts.view()));
    let AuthoredTriangles { mut triangles, sources, ptex } = match kind {
        LeafKind::Triangles => triangulate(topology, poses, numbers.as_mut(), dropped),
        _ => items(topology, kind, radii),
    };
    let centers = numbers.map(|numbers| numbers.centers).unwrap_or_default();
    if triangles.is_empty() {
        dropped.empty_meshes += 1;
        return None;
    }
    let layout = PrimvarLayout {
        face_count: topology.face_count,
        point_count: topology.points.len(),
        corner_count: topology.corners.len(),
        corners: &topology.corners,
        sources: &sources,
        centers: &centers,
    };
    let mut normals = match kind {
        LeafKind::Triangles => build_normals(desc, topology, layout, &triangles, dropped),
        _ => None,
    };
    let keys = read_keys(loose, layout, &mut triangles, &mut normals);
    let colors = desc.display_color.as_ref().and_then(|p| convert(p, layout, dropped, read_color, |_| Some([0.18; 3])));
    let opacities =
        desc.display_opacity.as_ref().and_then(|p| convert(p, layout, dropped, read_opacity, |_| Some(1.0)));
    let opacities = opacities.filter(|o| o.values.iter().any(|&v| v < 1.0));
    let primvars = convert_wanted(desc, wanted, layout, dropped);
    let subsets = subset_numbers(desc, layout, dropped);
    let rates = [rate(&normals), rate(&colors), rate(&opacities)];
    let corner_points = |s: &TriangleSource| s.corners.map(|c| layout.point(c));
    let by_point = rates.contains(&Some(AttributeRate::Vertex))
        || primvars.iter().any(|primvar| primvar.values.rate() == AttributeRate::Vertex);
    Some(MeshAsset {
        key,
        bounds: Aabb::EMPTY,
        whole: Aabb::EMPTY,
        is_clipped: false,
        bvh: Bvh4::default(),
        kind: compact(kind, &subsets),
        triangles,
        corner_indices: if by_point { sources.iter().map(corner_points).collect() } else { Vec::new() },
        normals,
        colors,
        opacities,
        primvars,
        subsets,
        ptex,
        keys,
        // Prims other than meshes are visible from all sides.
        double_sided: desc.double_sided || !matches!(desc.shape, PrimShape::Mesh),
        left_handed: desc.left_handed && matches!(desc.shape, PrimShape::Mesh),
    })
}

/// Drops the numbers of subsets of items that have no room for them, as points.
fn compact(kind: LeafKind, subsets: &[u16]) -> LeafKind {
    if kind == LeafKind::Points && !subsets.is_empty() { LeafKind::Rounds } else { kind }
}

/// The items of a kind other than triangles, one for each face.
fn items(topology: &MeshTopology, kind: LeafKind, radii: &[f32]) -> AuthoredTriangles {
    let mut faces = AuthoredTriangles::default();
    let point = |at: u32| topology.points.get(at as usize).copied();
    let radius = |at: u32| radii.get(at as usize).copied().unwrap_or(0.0);
    for face in &topology.faces {
        let &[a, b, c] = topology.face_corners(face) else { continue };
        if let [Some(first), Some(second), Some(third)] = [a, b, c].map(point) {
            let vertices = kind.vertices([first, second, third], [a, b, c].map(radius));
            faces.triangles.push(Triangle { vertices, face: face.index });
            faces
                .sources
                .push(TriangleSource { face: face.index, corners: [face.first, face.first + 1, face.first + 2] });
        }
    }
    faces
}

fn rate<T>(attribute: &Option<Attribute<T>>) -> Option<AttributeRate> {
    attribute.as_ref().map(|a| a.rate)
}

/// Triangles in authored order.
#[derive(Default)]
struct AuthoredTriangles {
    triangles: Vec<Triangle>,
    sources: Vec<TriangleSource>,
    /// Place of each triangle in a Ptex file, where a material asks for Ptex.
    ptex: Vec<PtexTriangle>,
}

/// All triangles with area, in authored order. Blocks of faces are processed in parallel, unless faces have Ptex
/// numbers, which continue from face to face.
fn triangulate(
    topology: &MeshTopology,
    poses: &[PointsPose],
    numbers: Option<&mut PtexNumbers>,
    dropped: &mut DroppedData,
) -> AuthoredTriangles {
    if numbers.is_some() || topology.faces.len() <= FACE_BLOCK {
        return triangulate_block((topology, poses), &topology.faces, numbers, dropped);
    }
    let block = |faces: &[MeshFace]| {
        let mut dropped = DroppedData::default();
        (triangulate_block((topology, poses), faces, None, &mut dropped), dropped)
    };
    let blocks: Vec<(AuthoredTriangles, DroppedData)> = topology.faces.par_chunks(FACE_BLOCK).map(block).collect();
    let mut all = AuthoredTriangles::default();
    let count = blocks.iter().map(|(faces, _)| faces.triangles.len()).sum();
    all.triangles.reserve_exact(count);
    all.sources.reserve_exact(count);
    for (faces, of_block) in blocks {
        all.triangles.extend(faces.triangles);
        all.sources.extend(faces.sources);
        dropped.add(&of_block);
    }
    all
}

/// The triangles of some faces. A face that keeps some area has lost nothing: quads that close to a point, as at the
/// tip of a cone, are no bad data. Only the triangles of faces without any area count as dropped. A moving face has an
/// area if it has one at some key.
fn triangulate_block(
    (topology, poses): (&MeshTopology, &[PointsPose]),
    faces: &[MeshFace],
    mut numbers: Option<&mut PtexNumbers>,
    dropped: &mut DroppedData,
) -> AuthoredTriangles {
    let mut triangulator = FaceTriangulator::default();
    let (mut points, mut ears) = (Vec::new(), Vec::new());
    let AuthoredTriangles { mut triangles, mut sources, mut ptex } = AuthoredTriangles::default();
    if numbers.is_none() {
        // A face has at least three corners.
        let most = faces.iter().filter(|face| !face.is_hole).map(|face| face.count as usize - 2).sum();
        triangles.reserve_exact(most);
        sources.reserve_exact(most);
    }
    for face in faces.iter().filter(|face| !face.is_hole) {
        let corners = topology.face_corners(face);
        points.clear();
        points.extend(corners.iter().map(|&c| topology.position(c)));
        triangulator.triangulate(&points, topology.face_normal(face), &mut ears);
        let kept = triangles.len();
        if let Some(numbers) = numbers.as_deref_mut()
            && let Some((center, at)) = numbers.center(topology, face, &ears)
        {
            for (k, next) in (0..face.count).zip((1..face.count).chain([0])) {
                let vertex = |k: u32| corners.get(k as usize).and_then(|&p| topology.points.get(p as usize));
                let [Some(&a), Some(&b)] = [k, next].map(vertex) else { continue };
                let triangle = Triangle { vertices: [a, b, at], face: face.index };
                if has_area(&triangle) {
                    triangles.push(triangle);
                    sources.push(TriangleSource {
                        face: face.index,
                        corners: [face.first + k, face.first + next, center],
                    });
                    ptex.push(numbers.wedge(face, k));
                }
            }
            ears.clear();
        }
        for ear in &ears {
            let vertex = |k: u32| corners.get(k as usize).and_then(|&p| topology.points.get(p as usize));
            let [Some(&a), Some(&b), Some(&c)] = ear.map(vertex) else {
                continue;
            };
            let triangle = Triangle { vertices: [a, b, c], face: face.index };
            let posed = |pose: &PointsPose| {
                let vertex = |k: u32| corners.get(k as usize).and_then(|&p| pose.points.get(p as usize));
                let [Some(&a), Some(&b), Some(&c)] = ear.map(vertex) else { return false };
                has_area(&Triangle { vertices: [a, b, c], face: face.index })
            };
            if has_area(&triangle) || poses.iter().any(posed) {
                triangles.push(triangle);
                sources.push(TriangleSource { face: face.index, corners: ear.map(|k| face.first + k) });
                ptex.extend(numbers.as_deref().map(|numbers| numbers.ear(face, *ear)));
            }
        }
        if triangles.len() == kept {
            dropped.zero_area_triangles += (corners.len() - 2) as u64;
        }
    }
    AuthoredTriangles { triangles, sources, ptex }
}

/// Returns true if the normal is meaningful in double precision and not zero in single precision.
fn has_area(triangle: &Triangle) -> bool {
    let [a, b, c] = triangle.vertices.map(|v| Vec3::from(v).as_dvec3());
    let (e, f) = (b - a, c - a);
    let longest = e.length_squared().max(f.length_squared()).max((c - b).length_squared());
    let double_area = e.cross(f).length();
    double_area >= MIN_DOUBLE_AREA.max(MIN_RELATIVE_DOUBLE_AREA * longest) && geometric_normal(triangle, 1.0).is_some()
}

fn read_color(values: &ArrayView<'_>, i: usize) -> Option<[f32; 3]> {
    let color = values.vec3(i)?.as_vec3();
    color.is_finite().then(|| color.max(Vec3::ZERO).to_array())
}

#[expect(clippy::cast_possible_truncation, reason = "rounding to single precision is what is wanted")]
fn read_opacity(values: &ArrayView<'_>, i: usize) -> Option<f32> {
    let opacity = values.scalar(i)?;
    opacity.is_finite().then(|| opacity.clamp(0.0, 1.0) as f32)
}
