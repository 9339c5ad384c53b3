// SPDX-License-Identifier: Apache-2.0
//! Where a displacement moves the vertices of a mesh that was cut: first it is shown all triangles
//! ([`MeshRelief::measure`], [`MeshRelief::settle`]), then what faces look at is opened, then vertices are asked for.
//! Pure but for the textures that it reads.

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
    pub(super) fn new(displacement: &'a Displacement, desc: &'a MeshDesc, surface: DicedSurface<'a>) -> Self {
        match displacement {
            Displacement::Preview(preview) => Self::Preview(PreviewRelief::new(preview, desc)),
            Displacement::Pattern(pattern) => Self::Pattern(Box::new(PatternRelief::new(pattern, desc, surface))),
        }
    }

    /// Whether it moves vertices other than along normals.
    pub(super) fn is_vector(&self) -> bool {
        matches!(self, Self::Pattern(pattern) if pattern.is_vector())
    }

    /// Shows it the triangles of a face.
    pub(super) fn measure(&mut self, face: u32, triangles: &[[u32; 3]]) {
        match self {
            Self::Preview(preview) => preview.measure(face, triangles),
            Self::Pattern(pattern) => pattern.measure(face, triangles),
        }
    }

    /// Those were all.
    pub(super) fn settle(&mut self) {
        if let Self::Pattern(pattern) = self {
            pattern.settle();
        }
    }

    /// Members of sets of files that a face with these vertices looks at.
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

    /// Opens them.
    pub(super) fn open(&mut self, heights: &HeightCache, members: &UdimMembers) {
        match self {
            Self::Preview(preview) => preview.open(heights, members[0]),
            Self::Pattern(pattern) => pattern.open(heights, members),
        }
    }

    /// How far a vertex of a face is moved along normals.
    pub(super) fn height(&self, face: u32, vertex: u32, members: &UdimMembers) -> f64 {
        match self {
            Self::Preview(preview) => preview.height(face, vertex, members[0]),
            Self::Pattern(pattern) if pattern.is_vector() => 0.0,
            Self::Pattern(pattern) => pattern.height(face, vertex, members),
        }
    }

    /// Where it is moved to besides.
    pub(super) fn vector(&self, face: u32, vertex: u32, members: &UdimMembers) -> DVec3 {
        match self {
            Self::Pattern(pattern) if pattern.is_vector() => pattern.vector(face, vertex, members),
            _ => DVec3::ZERO,
        }
    }

    /// What could not be read, for the user.
    pub(super) fn into_problems(self) -> Vec<String> {
        match self {
            Self::Preview(preview) => preview.into_problem().into_iter().collect(),
            Self::Pattern(pattern) => pattern.into_problems(),
        }
    }
}
