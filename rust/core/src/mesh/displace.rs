// SPDX-License-Identifier: Apache-2.0
//! Displaced surfaces: the vertices of a mesh that was cut are moved along its normals.
//!
//! A position where faces meet is moved once: along the mean of their normals, by the mean of their heights, and by the
//! mean of their vectors where there are some. So faces stay together bit for bit, also where their textures do not
//! match and at sharp edges. The new normal at a vertex is the old one, turned as the mean of the triangles around it
//! was: it is exact where nothing is displaced, and continuous across faces that were smooth together. Pure.

use std::ops::Range;

use glam::{DVec3, Vec3};
use oocpt_subdiv::LimitFacets;
use rayon::prelude::*;
use rustc_hash::FxHashMap;

use super::cut_values::CutValues;
use super::demand::BuildDemand;
use super::pattern_relief::DicedSurface;
use super::primvar::subsets_of_faces;
use super::relief::{MeshRelief, UdimMembers};
use super::topology::MAX_COORDINATE;
use crate::desc::{DroppedData, MeshDesc};
use crate::texture::HeightCache;

/// Vertices at one position whose normals have a larger cosine than this are smooth together.
const SAME_NORMAL: f64 = 1.0 - 1e-4;

/// A mesh that was cut: authored numbers of faces, values at its vertices, normals on the outer side.
pub(super) struct DicedMesh<'a> {
    pub(super) facets: &'a LimitFacets,
    /// Authored number of each control face.
    pub(super) faces: &'a [u32],
    /// Description with the values at the vertices.
    pub(super) desc: &'a MeshDesc,
    pub(super) face_count: usize,
    /// Normals of the surface that was cut.
    pub(super) normals: Vec<[f32; 3]>,
    /// True if authored normals give the direction of displacement.
    pub(super) is_flat: bool,
    /// True for a patch of a mesh: nothing may depend on all of its faces.
    pub(super) is_patch: bool,
}

/// The triangles of a control face.
struct FaceRun<'a> {
    /// Authored number of the face.
    face: u32,
    triangles: &'a [[u32; 3]],
}

/// A face, with the relief that moves its vertices.
struct RequestedFace {
    face: u32,
    slot: usize,
    /// Range of its vertices in the list of all vertices.
    vertices: Range<usize>,
    /// Members of sets of files that the face looks up.
    members: UdimMembers,
}

/// A vertex of a face.
struct RequestedVertex {
    vertex: u32,
    /// Index of the face in the list of all faces.
    face: u32,
}

/// Sums of what faces give for one position.
#[derive(Clone, Copy, Default)]
struct VertexSum {
    normal: DVec3,
    height: f64,
    faces: f64,
}

/// Sums of what faces give for all positions.
struct VertexSums {
    sums: Vec<VertexSum>,
    /// Sums of vectors; empty if no face gives one.
    vectors: Vec<DVec3>,
}

/// Positions and normals, one for each vertex.
pub(super) struct DisplacedVertices {
    pub(super) positions: Vec<[f32; 3]>,
    pub(super) normals: Vec<[f32; 3]>,
    pub(super) notes: Vec<String>,
}

impl DicedMesh<'_> {
    /// Moves the vertices as `demand` says.
    pub(super) fn displace(mut self, demand: &BuildDemand<'_>, dropped: &mut DroppedData) -> DisplacedVertices {
        let (positions, _) = self.facets.positions.as_chunks::<3>();
        if self.is_flat {
            self.take_authored_normals();
        }
        let (sums, notes) = self.sums(demand);
        let moves = self.moves(&sums, dropped);
        let normals = self.turned(&moves);
        let moved = |(at, by): (&[f32; 3], &DVec3)| (Vec3::from(*at).as_dvec3() + *by).as_vec3().to_array();
        DisplacedVertices { positions: positions.iter().zip(&moves).map(moved).collect(), normals, notes }
    }

    fn runs(&self) -> impl Iterator<Item = FaceRun<'_>> {
        let (triangles, _) = self.facets.triangles.as_chunks::<3>();
        let mut first = 0;
        self.facets.faces.chunk_by(|a, b| a == b).filter_map(move |run| {
            let range = first..first + run.len();
            first = range.end;
            let face = run.first().and_then(|face| self.faces.get(*face as usize))?;
            Some(FaceRun { face: *face, triangles: triangles.get(range)? })
        })
    }

    /// Takes normals from a polygon mesh, which may have its own; values by corner became values by vertex.
    fn take_authored_normals(&mut self) {
        let Some(authored) = CutValues::of(self.desc, "normals") else { return };
        let mut normals = std::mem::take(&mut self.normals);
        for run in self.runs() {
            for &vertex in run.triangles.as_flattened() {
                let normal = authored.vector(run.face, vertex).and_then(DVec3::try_normalize);
                if let (Some(normal), Some(slot)) = (normal, normals.get_mut(vertex as usize)) {
                    *slot = normal.as_vec3().to_array();
                }
            }
        }
        self.normals = normals;
    }

    fn normal(&self, vertex: u32) -> DVec3 {
        self.normals.get(vertex as usize).map_or(DVec3::ZERO, |normal| Vec3::from(*normal).as_dvec3())
    }

    fn place(&self, vertex: u32) -> usize {
        self.facets.places.get(vertex as usize).map_or(usize::MAX, |place| *place as usize)
    }

    /// The sums of all positions, and messages about textures that could not be read.
    fn sums(&self, demand: &BuildDemand<'_>) -> (VertexSums, Vec<String>) {
        // Unusable subsets are counted where their materials are resolved.
        let subsets = subsets_of_faces(self.desc, self.face_count, &mut DroppedData::default());
        let slot = |face: u32| subsets.get(face as usize).map_or(0, |subset| usize::from(*subset));
        let surface = DicedSurface { positions: self.facets.positions.as_chunks::<3>().0, normals: &self.normals };
        let relief = |displacement| MeshRelief::new(displacement, self.desc, surface, self.is_patch);
        let mut reliefs: Vec<Option<MeshRelief<'_>>> =
            demand.displacements.iter().map(|slot| slot.as_deref().map(relief)).collect();
        for run in self.runs() {
            if let Some(Some(relief)) = reliefs.get_mut(slot(run.face)) {
                relief.measure(run.face, run.triangles);
            }
        }
        reliefs.iter_mut().flatten().for_each(MeshRelief::settle);
        let (mut faces, vertices) = self.requested(slot);
        faces.par_iter_mut().for_each(|requested| {
            if let Some(Some(relief)) = reliefs.get(requested.slot) {
                let own = vertices.get(requested.vertices.clone()).unwrap_or_default();
                requested.members = relief.members(requested.face, own.iter().map(|requested| requested.vertex));
            }
        });
        let none = HeightCache::default();
        let heights = demand.heights.unwrap_or(&none);
        for requested in &faces {
            if let Some(Some(relief)) = reliefs.get_mut(requested.slot) {
                relief.open(heights, requested.face, &requested.members);
            }
        }
        let relief_of = |requested: &RequestedVertex| {
            let face = faces.get(requested.face as usize)?;
            Some((reliefs.get(face.slot)?.as_ref()?, face))
        };
        let height = |requested: &RequestedVertex| {
            relief_of(requested).map_or(0.0, |(relief, face)| relief.height(face.face, requested.vertex, &face.members))
        };
        let vector = |requested: &RequestedVertex| {
            let found = relief_of(requested);
            found.map_or(DVec3::ZERO, |(relief, face)| relief.vector(face.face, requested.vertex, &face.members))
        };
        let heights: Vec<f64> = vertices.par_iter().map(height).collect();
        let has_vectors = reliefs.iter().flatten().any(MeshRelief::is_vector);
        let vectors: Vec<DVec3> = if has_vectors { vertices.par_iter().map(vector).collect() } else { Vec::new() };
        // The faces are visited in order, because sums of floats depend on it.
        let places = self.facets.places.len();
        let mut sums = vec![VertexSum::default(); places];
        for (requested, height) in vertices.iter().zip(heights) {
            if let Some(sum) = sums.get_mut(self.place(requested.vertex)) {
                sum.normal += self.normal(requested.vertex);
                sum.height += height;
                sum.faces += 1.0;
            }
        }
        let mut vector_sums = vec![DVec3::ZERO; if has_vectors { places } else { 0 }];
        for (requested, vector) in vertices.iter().zip(vectors) {
            if let Some(sum) = vector_sums.get_mut(self.place(requested.vertex)) {
                *sum += vector;
            }
        }
        let problems = reliefs.into_iter().flatten().flat_map(MeshRelief::into_problems).collect();
        (VertexSums { sums, vectors: vector_sums }, problems)
    }

    /// All faces, each with its vertices; `slot` gives the relief of a face.
    fn requested(&self, slot: impl Fn(u32) -> usize) -> (Vec<RequestedFace>, Vec<RequestedVertex>) {
        let mut seen = vec![u32::MAX; self.facets.places.len()];
        let (mut faces, mut vertices) = (Vec::new(), Vec::new());
        for (number, run) in (0..).zip(self.runs()) {
            let first = vertices.len();
            for &vertex in run.triangles.as_flattened() {
                if let Some(seen) = seen.get_mut(vertex as usize).filter(|seen| **seen != number) {
                    *seen = number;
                    vertices.push(RequestedVertex { vertex, face: number });
                }
            }
            let (face, slot) = (run.face, slot(run.face));
            faces.push(RequestedFace { face, slot, vertices: first..vertices.len(), members: UdimMembers::default() });
        }
        (faces, vertices)
    }

    /// The displacement of each vertex.
    fn moves(&self, VertexSums { sums, vectors }: &VertexSums, dropped: &mut DroppedData) -> Vec<DVec3> {
        let (positions, _) = self.facets.positions.as_chunks::<3>();
        let mut by_place = vec![DVec3::ZERO; sums.len()];
        for (number, ((by, sum), at)) in by_place.iter_mut().zip(sums).zip(positions).enumerate() {
            // A position whose normals cancel out has no outside.
            let along = sum.normal.try_normalize().map(|normal| normal * (sum.height / sum.faces));
            let beside = vectors.get(number).filter(|_| sum.faces > 0.0).map(|vector| *vector / sum.faces);
            let wanted = match (along, beside) {
                (Some(along), Some(beside)) => along + beside,
                (Some(one), None) | (None, Some(one)) => one,
                (None, None) => continue,
            };
            let is_usable = (Vec3::from(*at).as_dvec3() + wanted).abs().max_element() <= MAX_COORDINATE;
            if is_usable && wanted.is_finite() {
                *by = wanted;
            } else {
                dropped.displacements += 1;
            }
        }
        let by = |vertex: &u32| by_place.get(*vertex as usize).copied().unwrap_or_default();
        self.facets.places.iter().map(by).collect()
    }

    /// The normals of the displaced surface.
    fn turned(&self, moves: &[DVec3]) -> Vec<[f32; 3]> {
        let (positions, _) = self.facets.positions.as_chunks::<3>();
        let (triangles, _) = self.facets.triangles.as_chunks::<3>();
        let side = if self.desc.left_handed { -1.0 } else { 1.0 };
        // Twice the areas of the triangles around each vertex, before and after the displacement, both from the same
        // rounded positions, whose errors cancel out.
        let mut sums = vec![[DVec3::ZERO; 2]; positions.len()];
        for triangle in triangles {
            let corner = |k: usize| {
                let vertex = triangle[k] as usize;
                let at = positions.get(vertex).map_or(DVec3::ZERO, |at| Vec3::from(*at).as_dvec3());
                [at, at + moves.get(vertex).copied().unwrap_or_default()]
            };
            let [a, b, c] = [corner(0), corner(1), corner(2)];
            for &vertex in triangle {
                let Some(sum) = sums.get_mut(vertex as usize) else { continue };
                for k in 0..2 {
                    sum[k] += (b[k] - a[k]).cross(c[k] - a[k]) * side;
                }
            }
        }
        let shared = self.shared_places();
        let turned = |vertex: u32| {
            let own = self.normal(vertex);
            let at = |vertex: u32| sums.get(vertex as usize).copied().unwrap_or_default();
            let [before, after] = match shared.get(&self.place(vertex)) {
                None => at(vertex),
                Some(others) => {
                    let alike = others.iter().filter(|other| self.normal(**other).dot(own) > SAME_NORMAL);
                    alike.fold([DVec3::ZERO; 2], |[before, after], other| {
                        let [more_before, more_after] = at(*other);
                        [before + more_before, after + more_after]
                    })
                }
            };
            let turn = match (before.try_normalize(), after.try_normalize()) {
                (Some(before), Some(after)) => after - before,
                _ => DVec3::ZERO,
            };
            (own + turn).try_normalize().unwrap_or(own).as_vec3().to_array()
        };
        (0..u32::try_from(positions.len()).unwrap_or(u32::MAX)).into_par_iter().map(turned).collect()
    }

    /// The vertices of each position that several vertices share.
    fn shared_places(&self) -> FxHashMap<usize, Vec<u32>> {
        let mut shared: FxHashMap<usize, Vec<u32>> = FxHashMap::default();
        for (vertex, &place) in (0..).zip(&self.facets.places) {
            if vertex != place {
                shared.entry(place as usize).or_insert_with(|| vec![place]).push(vertex);
            }
        }
        shared
    }
}
