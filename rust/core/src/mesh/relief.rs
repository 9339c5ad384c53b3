// SPDX-License-Identifier: Apache-2.0
//! Computes displacements of the vertices of a mesh that was cut. Calls come in this order: measure all triangles
//! ([`MeshRelief::measure`], [`MeshRelief::settle`]), open the textures that faces look up, evaluate vertices. Pure but
//! for the textures that it reads.

use glam::DVec3;

use super::pattern_relief::{DicedSurface, PatternRelief};
use super::preview_relief::PreviewRelief;
use crate::desc::MeshDesc;
use crate::material::Displacement;
use crate::texture::HeightCache;

pub(super) use super::pattern_relief::UdimMembers;

/// A displacement over a mesh that was cut.
pub(super) enum MeshRelief<'a> {
    Preview(PreviewRelief<'a>),
    Pattern(Box<PatternRelief<'a>>),
}

impl<'a> MeshRelief<'a> {
    /// `by_face`: the level of a texture follows from each face alone, not from all.
    pub(super) fn new(
        displacement: &'a Displacement,
        desc: &'a MeshDesc,
        surface: DicedSurface<'a>,
        by_face: bool,
    ) -> Self {
        match displacement {
            Displacement::Preview(preview) => Self::Preview(PreviewRelief::new(preview, desc, by_face)),
            Displacement::Pattern(pattern) => Self::Pattern(Box::new(PatternRelief::new(pattern, desc, surface))),
        }
    }

    /// Returns true if it moves vertices other than along normals.
    pub(super) fn is_vector(&self) -> bool {
        matches!(self, Self::Pattern(pattern) if pattern.is_vector())
    }

    /// Measures the triangles of a face.
    pub(super) fn measure(&mut self, face: u32, triangles: &[[u32; 3]]) {
        match self {
            Self::Preview(preview) => preview.measure(face, triangles),
            Self::Pattern(pattern) => pattern.measure(face, triangles),
        }
    }

    /// Ends the measurement after all triangles were given.
    pub(super) fn settle(&mut self) {
        if let Self::Pattern(pattern) = self {
            pattern.settle();
        }
    }

    /// Members of sets of files that a face with these vertices looks up.
    pub(super) fn members(&self, face: u32, vertices: impl Iterator<Item = u32>) -> UdimMembers {
        match self {
            Self::Preview(preview) => {
                let mut members = UdimMembers::default();
                members[0] = preview.member(face, vertices);
                members
            }
            Self::Pattern(pattern) => pattern.members(face, vertices),
        }
    }

    /// Opens the texture levels of these members for a face.
    pub(super) fn open(&mut self, heights: &HeightCache, face: u32, members: &UdimMembers) {
        match self {
            Self::Preview(preview) => preview.open(heights, face, members[0]),
            Self::Pattern(pattern) => pattern.open(heights, members),
        }
    }

    /// Displacement of a vertex of a face along its normal.
    pub(super) fn height(&self, face: u32, vertex: u32, members: &UdimMembers) -> f64 {
        match self {
            Self::Preview(preview) => preview.height(face, vertex, members[0]),
            Self::Pattern(pattern) if pattern.is_vector() => 0.0,
            Self::Pattern(pattern) => pattern.height(face, vertex, members),
        }
    }

    /// Displacement of a vertex as a vector, added to [`Self::height`].
    pub(super) fn vector(&self, face: u32, vertex: u32, members: &UdimMembers) -> DVec3 {
        match self {
            Self::Pattern(pattern) if pattern.is_vector() => pattern.vector(face, vertex, members),
            _ => DVec3::ZERO,
        }
    }

    /// Messages for the user about textures that could not be read.
    pub(super) fn into_problems(self) -> Vec<String> {
        match self {
            Self::Preview(preview) => preview.into_problem().into_iter().collect(),
            Self::Pattern(pattern) => pattern.into_problems(),
        }
    }
}
