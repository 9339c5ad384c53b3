// SPDX-License-Identifier: Apache-2.0
//! What a mesh says of its limit surface (`UsdGeomMesh`, Hydra's `subdivisionTags` and refine level).

pub use oocpt_subdiv::{BoundaryRule, CreaseRule, FaceVaryingLinear, TriangleRule};

use crate::array::TypedArray;

/// Subdivision scheme. Where a mesh is not refined, the scheme decides the normals: `CatmullClark` and `Loop` without
/// authored normals get smooth area-weighted vertex normals, the others are flat.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Subdivision {
    /// A polygon mesh.
    None,
    /// Refined without smoothing.
    Bilinear,
    /// Catmull-Clark.
    CatmullClark,
    /// Loop.
    Loop,
}

/// Rules, creases and corners of a subdivision surface. Arrays are unchecked; absent ones are empty.
#[derive(Clone, Debug, Default)]
pub struct SubdivisionTags {
    /// `interpolateBoundary`.
    pub boundary: BoundaryRule,
    /// `faceVaryingLinearInterpolation`.
    pub face_varying: FaceVaryingLinear,
    /// `triangleSubdivisionRule`.
    pub triangles: TriangleRule,
    /// How sharpness goes down from level to level. USD has no attribute for it: uniform.
    pub creasing: CreaseRule,
    /// Points along creases, crease after crease (ints).
    pub crease_indices: Option<TypedArray>,
    /// Points of each crease (ints).
    pub crease_lengths: Option<TypedArray>,
    /// Sharpness of each crease, or of each of their edges (floats).
    pub crease_sharpnesses: Option<TypedArray>,
    /// Sharp points (ints).
    pub corner_indices: Option<TypedArray>,
    /// Their sharpness (floats).
    pub corner_sharpnesses: Option<TypedArray>,
}

impl SubdivisionTags {
    /// The arrays, in a fixed order.
    pub(crate) fn arrays(&self) -> [Option<&TypedArray>; 5] {
        [
            self.crease_indices.as_ref(),
            self.crease_lengths.as_ref(),
            self.crease_sharpnesses.as_ref(),
            self.corner_indices.as_ref(),
            self.corner_sharpnesses.as_ref(),
        ]
    }

    /// The rules as bytes, to compare and to hash.
    pub(crate) fn rules(&self) -> [u8; 4] {
        [self.boundary as u8, self.face_varying as u8, self.triangles as u8, self.creasing as u8]
    }
}
