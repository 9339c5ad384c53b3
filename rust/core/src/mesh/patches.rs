// SPDX-License-Identifier: Apache-2.0
//! The patches of a large control mesh: sets of neighbouring faces that are refined one by one, so that a step of the
//! camera refines what it comes near to and nothing else.
//!
//! A patch is refined together with the rings of faces around it, which are then thrown away: what a patch makes of its
//! border has the same bits as what its neighbour makes of it. Rates belong to edges, and an edge has the largest rate
//! that a face at it needs, whatever patches these faces are in. Patches depend on the mesh alone. Pure; work is spread
//! over the caller's rayon pool.

use glam::DVec3;
use rayon::prelude::*;
use rustc_hash::FxHashMap;

use super::Aabb;
use super::bvh::longest_axis;
use super::demand::BuildDemand;
use super::plain_values::has_plain_values;
use super::triangulate::MAX_FACE_CORNERS;
use crate::array::{ArrayView, ElementType};
use crate::desc::{MeshDesc, PrimShape, Subdivision};

/// Faces of a patch, at most. With more, a step refines more than what comes near; with fewer, the rings around them
/// cost more than the patches: of 32 x 32 faces they are a quarter.
const PATCH_FACES: usize = 1 << 10;
/// A mesh of fewer faces is refined as a whole.
pub(crate) const MIN_PATCHED_FACES: usize = 4 * PATCH_FACES;
/// Rings around a patch. The limit surface on a border needs one; the normals of a displaced border need the triangles
/// of the first ring, whose other vertices are moved by the faces of the second ring, whose surface needs the third.
pub(super) const RINGS: u8 = 3;
/// Largest number of faces around a point: the one that OpenSubdiv's evaluation accepts at each point.
const MAX_POINT_FACES: u32 = oocpt_subdiv::MAX_VALENCE as u32;

/// Some neighbouring faces, and the rings around them.
#[derive(Debug)]
pub(crate) struct FacePatch {
    /// Authored numbers of its own faces and of those in the rings, ascending.
    pub(super) faces: Vec<u32>,
    /// For each of these faces the ring that it is in; 0 for its own.
    pub(super) rings: Vec<u8>,
    /// Box of the control points of its own faces.
    pub(crate) bounds: Aabb,
}

impl FacePatch {
    /// Its faces up to a ring.
    pub(super) fn within(&self, ring: u8) -> impl Iterator<Item = u32> {
        self.faces.iter().zip(&self.rings).filter(move |(_, at)| **at <= ring).map(|(face, _)| *face)
    }
}

/// The patches of a control mesh.
#[derive(Debug)]
pub(crate) struct MeshPatches {
    pub(crate) patches: Vec<FacePatch>,
    /// First corner of each face, then the number of corners.
    firsts: Vec<u32>,
    /// Edge from each corner to the next one of its face.
    corner_edges: Vec<u32>,
    edge_count: usize,
}

impl MeshPatches {
    /// The patches of a mesh that is refined for `demand`; `None` where it is refined as a whole: if it has few faces,
    /// moves, has faces or values that cannot be used as they are, or is displaced by textures of a program, whose
    /// level depends on the whole mesh.
    pub(crate) fn of(desc: &MeshDesc, demand: &BuildDemand<'_>) -> Option<Self> {
        let count = desc.face_vertex_counts.len();
        if count < MIN_PATCHED_FACES { None } else { Self::in_parts(desc, demand, count.div_ceil(PATCH_FACES)) }
    }

    /// [`Self::of`] with a given number of patches.
    fn in_parts(desc: &MeshDesc, demand: &BuildDemand<'_>, parts: usize) -> Option<Self> {
        let count = desc.face_vertex_counts.len();
        let is_flat = matches!(desc.subdivision, Subdivision::None | Subdivision::Bilinear);
        let is_surface = matches!(desc.shape, PrimShape::Mesh) && demand.refines(desc) && !desc.point_motion.is_given();
        let is_local = demand.displacements.iter().flatten().all(|displacement| displacement.is_local());
        // Flat surfaces are cut by the refine level alone.
        let is_cut = is_surface && (demand.displaces(desc) || !is_flat);
        if !is_cut || !is_local || demand.reads_ptex() {
            return None;
        }
        let firsts = firsts(desc)?;
        let around = PointFaces::new(desc, &firsts)?;
        if !has_plain_values(desc, demand) {
            return None;
        }
        let (corner_edges, edge_count) = edges(desc, &firsts);
        let points = desc.points.view();
        let corner = |corner: usize| point_of(desc, corner).and_then(|at| points.vec3(at)).unwrap_or(DVec3::ZERO);
        let center = |face: usize| {
            let corners = firsts[face] as usize..firsts[face + 1] as usize;
            let of_face = corners.fold(Aabb::EMPTY, |bounds, at| bounds.with_point(corner(at).as_vec3().to_array()));
            FaceCenter { face: u32::try_from(face).unwrap_or(u32::MAX), bounds: of_face }
        };
        let mut centers: Vec<FaceCenter> = (0..count).into_par_iter().map(center).collect();
        let patch = |own: &&mut [FaceCenter]| around.patch(own, &firsts, desc);
        let patches = halves(&mut centers, parts).par_iter().map(patch).collect();
        Some(Self { patches, firsts, corner_edges, edge_count })
    }

    /// The corners of a face, with the edges from each to the next.
    pub(crate) fn corners(&self, face: u32) -> (std::ops::Range<usize>, &[u32]) {
        let at = |face: usize| self.firsts.get(face).map_or(0, |first| *first as usize);
        let corners = at(face as usize)..at(face as usize + 1);
        (corners.clone(), self.corner_edges.get(corners).unwrap_or_default())
    }

    /// What `number` gives for the edge from each corner of the own faces of a patch, face by face.
    pub(crate) fn own_edges(&self, desc: &MeshDesc, patch: usize, number: impl Fn(DVec3, DVec3) -> u16) -> Vec<u16> {
        let points = desc.points.view();
        let corner = |corner: usize| point_of(desc, corner).and_then(|at| points.vec3(at)).unwrap_or(DVec3::ZERO);
        let faces = self.patches.get(patch).into_iter().flat_map(|patch| patch.within(0));
        let of_face = |face: u32| {
            let ends: Vec<DVec3> = self.corners(face).0.map(corner).collect();
            let next = ends.iter().cycle().skip(1);
            ends.iter().zip(next).map(|(a, b)| number(*a, *b)).collect::<Vec<u16>>()
        };
        faces.flat_map(of_face).collect()
    }

    /// Approximate number of triangles of the own faces of a patch whose edges have these numbers of pieces.
    pub(crate) fn own_triangles(&self, patch: usize, mut pieces: &[u16]) -> u64 {
        let mut sum = 0_u64;
        for face in self.patches.get(patch).into_iter().flat_map(|patch| patch.within(0)) {
            let (of_face, rest) = pieces.split_at(self.corners(face).1.len().min(pieces.len()));
            pieces = rest;
            sum = sum.saturating_add(triangles_of(of_face));
        }
        sum
    }

    /// The number of pieces of each edge: the largest of what the patches at it want, each as [`Self::own_edges`].
    pub(crate) fn rates(&self, wanted: &[Vec<u16>]) -> Vec<u16> {
        let mut rates = vec![1_u16; self.edge_count];
        for (patch, wanted) in self.patches.iter().zip(wanted) {
            let edges = patch.within(0).flat_map(|face| self.corners(face).1);
            for (edge, wanted) in edges.zip(wanted) {
                rates.iter_mut().skip(*edge as usize).take(1).for_each(|rate| *rate = (*rate).max(*wanted));
            }
        }
        rates
    }

    /// Approximate number of triangles of the mesh with these rates.
    pub(crate) fn expected_triangles(&self, rates: &[u16]) -> u64 {
        let faces = u32::try_from(self.firsts.len().saturating_sub(1)).unwrap_or(u32::MAX);
        (0..faces).into_par_iter().map(|face| triangles_of(&self.rates_of(face, rates))).sum()
    }

    /// The rates at the corners of the faces of a patch up to a ring, face by face.
    pub(crate) fn rates_at(&self, number: usize, ring: u8, rates: &[u16]) -> Vec<u16> {
        let faces = self.patches.get(number).into_iter().flat_map(|patch| patch.within(ring));
        faces.flat_map(|face| self.rates_of(face, rates)).collect()
    }

    fn rates_of(&self, face: u32, rates: &[u16]) -> Vec<u16> {
        self.corners(face).1.iter().map(|edge| rates.get(*edge as usize).copied().unwrap_or(1)).collect()
    }
}

/// Approximate number of triangles of a face whose edges have these numbers of pieces.
fn triangles_of(rates: &[u16]) -> u64 {
    if let [a, b, c, d] = rates.iter().map(|rate| u64::from(*rate)).collect::<Vec<u64>>()[..] {
        return 2 * a.max(c) * b.max(d);
    }
    let (count, most) = (rates.len() as u64, rates.iter().max().map_or(1, |most| u64::from(*most)));
    (most * most * count / 2).max(count.saturating_sub(2))
}

/// The point of a corner.
fn point_of(desc: &MeshDesc, corner: usize) -> Option<usize> {
    desc.face_vertex_indices.index(corner).and_then(|point| usize::try_from(point).ok())
}

/// The first corner of each face, then the number of corners; `None` if a face cannot be used as it is.
fn firsts(desc: &MeshDesc) -> Option<Vec<u32>> {
    let is_loop = desc.subdivision == Subdivision::Loop;
    let most = if is_loop { 3 } else { MAX_FACE_CORNERS.min(oocpt_subdiv::MAX_FACE_POINTS) };
    let counts = desc.face_vertex_counts.view();
    let mut firsts = Vec::with_capacity(counts.len() + 1);
    let mut first = 0_u32;
    for face in 0..counts.len() {
        firsts.push(first);
        let count = counts.index(face).and_then(|count| u32::try_from(count).ok())?;
        if !(3..=most).contains(&(count as usize)) {
            return None;
        }
        first = first.checked_add(count)?;
    }
    firsts.push(first);
    (first as usize == desc.face_vertex_indices.len()).then_some(firsts)
}

/// The edge of each corner, and the number of edges. Faces with the same two ends of an edge share it.
fn edges(desc: &MeshDesc, firsts: &[u32]) -> (Vec<u32>, usize) {
    let indices = desc.face_vertex_indices.view();
    let point = |corner: u32| indices.index(corner as usize).map_or(0, i32::cast_unsigned);
    let of_face = |face: &[u32]| {
        let &[first, end] = face else { return Vec::new() };
        let corner = |at: u32| {
            let (a, b) = (point(at), point(if at + 1 == end { first } else { at + 1 }));
            (u64::from(a.min(b)) << 32 | u64::from(a.max(b)), at)
        };
        (first..end).map(corner).collect()
    };
    let mut corners: Vec<(u64, u32)> = firsts.par_windows(2).flat_map_iter(of_face).collect();
    corners.par_sort_unstable();
    let mut edges = vec![0_u32; corners.len()];
    let (mut number, mut before) = (0_u32, None);
    for (ends, corner) in corners {
        number += u32::from(before.is_some_and(|before| before != ends));
        before = Some(ends);
        if let Some(edge) = edges.get_mut(corner as usize) {
            *edge = number;
        }
    }
    (edges, number as usize + 1)
}

/// A face while faces are sorted into patches.
#[derive(Clone, Copy)]
struct FaceCenter {
    face: u32,
    bounds: Aabb,
}

impl FaceCenter {
    /// Twice its middle.
    fn place(&self) -> [f32; 3] {
        [0, 1, 2].map(|k: usize| self.bounds.min[k] + self.bounds.max[k])
    }
}

/// `faces` cut across their longest axis, again and again, into so many parts of nearly equal size.
fn halves(faces: &mut [FaceCenter], parts: usize) -> Vec<&mut [FaceCenter]> {
    if parts < 2 {
        return vec![faces];
    }
    let bounds = faces.iter().fold(Aabb::EMPTY, |bounds, face| bounds.with_point(face.place()));
    let axis = longest_axis(&bounds);
    let left = parts / 2;
    let middle = faces.len() * left / parts;
    faces.select_nth_unstable_by(middle, |a, b| a.place()[axis].total_cmp(&b.place()[axis]).then(a.face.cmp(&b.face)));
    let (low, high) = faces.split_at_mut(middle);
    let (mut all, more) = rayon::join(|| halves(low, left), || halves(high, parts - left));
    all.extend(more);
    all
}

/// The faces around each point.
struct PointFaces {
    /// First face of each point in `faces`, then the number of them.
    firsts: Vec<u32>,
    faces: Vec<u32>,
}

impl PointFaces {
    /// `None` if a corner names no usable point, a face has a point twice, or a point has too many faces.
    fn new(desc: &MeshDesc, corners: &[u32]) -> Option<Self> {
        let (indices, points) = (desc.face_vertex_indices.view(), desc.points.view());
        let is_int = |view: &ArrayView<'_>| view.element() == ElementType::I32;
        if !is_int(&indices) || points.len() >= u32::MAX as usize {
            return None;
        }
        let mut counts = vec![0_u32; points.len() + 1];
        for at in 0..indices.len() {
            let point = usize::try_from(indices.index(at)?).ok()?;
            if super::topology::read_point(points.vec3(point))[0].is_nan() {
                return None;
            }
            *counts.get_mut(point)? += 1;
        }
        if counts.iter().any(|count| *count > MAX_POINT_FACES) {
            return None;
        }
        let mut sum = 0;
        for count in &mut counts {
            (*count, sum) = (sum, sum + *count);
        }
        let firsts = counts.clone();
        let mut faces = vec![u32::MAX; indices.len()];
        for (face, ends) in (0_u32..).zip(corners.windows(2)) {
            for at in ends[0]..ends[1] {
                let point = usize::try_from(indices.index(at as usize)?).ok()?;
                let slot = counts.get_mut(point)?;
                // Faces come in order, so a second corner of a face at a point follows the first.
                if *slot > firsts[point] && faces.get(*slot as usize - 1) == Some(&face) {
                    return None;
                }
                *faces.get_mut(*slot as usize)? = face;
                *slot += 1;
            }
        }
        Some(Self { firsts, faces })
    }

    fn at(&self, point: usize) -> &[u32] {
        let (first, end) = (self.firsts.get(point), self.firsts.get(point + 1));
        let range = first.zip(end).map(|(first, end)| *first as usize..*end as usize);
        range.and_then(|range| self.faces.get(range)).unwrap_or_default()
    }

    /// The patch of some faces.
    fn patch(&self, own: &[FaceCenter], firsts: &[u32], desc: &MeshDesc) -> FacePatch {
        let bounds = own.iter().fold(Aabb::EMPTY, |bounds, face| bounds.union(&face.bounds));
        let mut found: FxHashMap<u32, u8> = own.iter().map(|face| (face.face, 0)).collect();
        let mut last: Vec<u32> = own.iter().map(|face| face.face).collect();
        for ring in 1..=RINGS {
            let mut next = Vec::new();
            for face in last {
                let corners = firsts[face as usize] as usize..firsts[face as usize + 1] as usize;
                for &near in corners.filter_map(|corner| point_of(desc, corner)).flat_map(|point| self.at(point)) {
                    found.entry(near).or_insert_with(|| {
                        next.push(near);
                        ring
                    });
                }
            }
            last = next;
        }
        let mut all: Vec<(u32, u8)> = found.into_iter().collect();
        all.sort_unstable();
        let (faces, rings) = all.into_iter().unzip();
        FacePatch { faces, rings, bounds }
    }
}

#[cfg(test)]
mod tests;
