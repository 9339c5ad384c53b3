// SPDX-License-Identifier: Apache-2.0
//! Where triangles lie in the faces of a Ptex file (Burley and Lacewell 2008, "Ptex: Per-Face Texture Mapping for
//! Production Rendering"). Pure.
//!
//! Ptex numbers the faces of the authored mesh in their order: a quad has one Ptex face, any other n-gon has n, one at
//! each corner. In a quad u grows from corner 0 to corner 1 and v from corner 0 to corner 3. The face at corner i of an
//! n-gon begins there; u grows towards the middle of the edge to corner i + 1, v towards the middle of the edge from
//! corner i - 1, and the mean of all corners is at (1, 1). Holes and faces that cannot be drawn are numbered too.
//!
//! An n-gon is drawn as n triangles around the mean of its corners, so no edge gets a vertex that its neighbour lacks.
//! Each triangle has half of two Ptex faces; the shader tells which from the weights of the corners
//! (`shaders/texture/ptex.glsl`).

use glam::{DVec3, Vec3};

use super::topology::{MeshFace, MeshTopology};
use super::triangulate::EarTriangles;
use crate::array::ArrayView;

/// Ptex faces of a mesh; more have no texture.
pub const MAX_PTEX_FACES: u32 = 1 << 26;

/// How a triangle lies in its face.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum PtexPart {
    /// Corners 0, 1, 2 of a quad.
    Quad012 = 0,
    /// Corners 0, 2, 3 of a quad.
    Quad023 = 1,
    /// Corners 0, 1, 3 of a quad.
    Quad013 = 2,
    /// Corners 1, 2, 3 of a quad.
    Quad123 = 3,
    /// Corners i and i + 1 of an n-gon and the mean of all; the face is that of corner i, the other one comes next.
    Wedge = 4,
    /// The same where corner i + 1 is corner 0: the other face comes n - 1 before.
    LastWedge = 5,
    /// All of it is the place (0, 0): an n-gon that does not lie around the mean of its corners.
    Corner = 6,
    /// No face.
    Nowhere = 7,
}

/// The place of a triangle in a Ptex file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PtexTriangle {
    /// Number of the Ptex face.
    pub face: u32,
    /// What of it.
    pub part: PtexPart,
    /// Corners of the authored face; 0 for quads.
    pub sides: u16,
}

impl PtexTriangle {
    /// A triangle of no Ptex face.
    pub const NOWHERE: Self = Self { face: 0, part: PtexPart::Nowhere, sides: 0 };

    /// Face and part in a word, as the shaders read them.
    #[must_use]
    pub fn word(&self) -> u32 {
        self.face << 3 | self.part as u32
    }

    /// The place with a [`Self::word`].
    #[must_use]
    pub fn from_word(word: u32, sides: u16) -> Self {
        let part = match word & 7 {
            0 => PtexPart::Quad012,
            1 => PtexPart::Quad023,
            2 => PtexPart::Quad013,
            3 => PtexPart::Quad123,
            4 => PtexPart::Wedge,
            5 => PtexPart::LastWedge,
            6 => PtexPart::Corner,
            _ => PtexPart::Nowhere,
        };
        Self { face: word >> 3, part, sides }
    }
}

/// A point that is added in the middle of an n-gon.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct FaceCenter {
    /// First corner of its face.
    pub(super) first: u32,
    /// Corners of its face.
    pub(super) count: u32,
}

/// Numbers of Ptex faces by authored face, while a mesh is built.
#[derive(Debug)]
pub(super) struct PtexNumbers {
    first: Vec<u32>,
    /// The points added so far; they come behind the authored points, and as corners behind the authored corners.
    pub(super) centers: Vec<FaceCenter>,
}

impl PtexNumbers {
    pub(super) fn new(counts: &ArrayView<'_>) -> Self {
        let mut next = 0_u32;
        let first = (0..counts.len()).map(|face| {
            let own = match counts.index(face) {
                Some(4) => 1,
                Some(count) => u32::try_from(count).unwrap_or(0),
                None => 0,
            };
            let first = next;
            next = next.saturating_add(own).min(MAX_PTEX_FACES);
            if next < MAX_PTEX_FACES { first } else { MAX_PTEX_FACES }
        });
        Self { first: first.collect(), centers: Vec::new() }
    }

    /// The place of a triangle of a quad or of an n-gon that is no fan of wedges.
    pub(super) fn ear(&self, face: &MeshFace, ear: [u32; 3]) -> PtexTriangle {
        let part = match (face.count, ear) {
            (4, [0, 1, 2]) => PtexPart::Quad012,
            (4, [0, 2, 3]) => PtexPart::Quad023,
            (4, [0, 1, 3]) => PtexPart::Quad013,
            (4, [1, 2, 3]) => PtexPart::Quad123,
            _ => PtexPart::Corner,
        };
        let at = if part == PtexPart::Corner { ear[0] } else { 0 };
        self.place(face, at, part)
    }

    /// The place of the wedge at corner `at` of an n-gon.
    pub(super) fn wedge(&self, face: &MeshFace, at: u32) -> PtexTriangle {
        self.place(face, at, if at + 1 < face.count { PtexPart::Wedge } else { PtexPart::LastWedge })
    }

    fn place(&self, face: &MeshFace, at: u32, part: PtexPart) -> PtexTriangle {
        let first = self.first.get(face.index as usize).copied().unwrap_or(MAX_PTEX_FACES);
        let sides = if face.count == 4 { Some(0) } else { u16::try_from(face.count).ok() };
        match sides {
            Some(sides) if first < MAX_PTEX_FACES => PtexTriangle { face: first + at, part, sides },
            _ => PtexTriangle::NOWHERE,
        }
    }

    /// Adds the mean of the corners of an n-gon; its number as a corner, and where it is. `None` where the triangles
    /// around it would overlap: `ears` are then the triangles.
    pub(super) fn center(
        &mut self,
        topology: &MeshTopology,
        face: &MeshFace,
        ears: &EarTriangles,
    ) -> Option<(u32, [f32; 3])> {
        let corners = topology.face_corners(face);
        if corners.len() == 4 || corners.len() != face.count as usize || ears.len() + 2 != corners.len() {
            return None;
        }
        let points: Vec<DVec3> = corners.iter().map(|&corner| topology.position(corner)).collect();
        let middle = (points.iter().sum::<DVec3>() / points.len() as f64).as_vec3();
        let at = middle.as_dvec3();
        let normal = topology.face_normal(face);
        let next = points.iter().cycle().skip(1);
        let is_around = points.iter().zip(next).all(|(&p, &q)| (p - at).cross(q - at).dot(normal) > 0.0);
        let number = topology.corners.len() + self.centers.len();
        let number = u32::try_from(number).ok().filter(|_| is_around)?;
        self.centers.push(FaceCenter { first: face.first, count: face.count });
        Some((number, Vec3::to_array(&middle)))
    }
}
