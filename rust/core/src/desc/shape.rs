// SPDX-License-Identifier: Apache-2.0
//! What the points of a prim are (`UsdGeomMesh`, `UsdGeomBasisCurves`, `UsdGeomPoints`).

use crate::array::TypedArray;

/// What the points of a prim are. Curves and points have widths ([`super::MeshDesc::widths`]); those of a mesh do not
/// count.
#[derive(Clone, Debug, Default)]
pub enum PrimShape {
    /// Corners of polygons, or of the control mesh of a subdivision surface.
    #[default]
    Mesh,
    /// Control points of curves: tubes, or ribbons where the prim has normals.
    Curves(CurvesDesc),
    /// Centres of balls.
    Points,
    /// Opposite corners of boxes along the axes of the prim's frame, two for each box. Tests alone have it.
    #[cfg(feature = "faults")]
    ToyBoxes,
}

impl PrimShape {
    /// Tells shapes apart in hashes of what is made of them; none for a mesh.
    pub(crate) fn number(&self) -> Option<u8> {
        match self {
            Self::Mesh => None,
            Self::Curves(_) => Some(0),
            Self::Points => Some(1),
            #[cfg(feature = "faults")]
            Self::ToyBoxes => Some(2),
        }
    }
}

/// `type` and `basis`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum CurveBasis {
    /// Straight from point to point.
    Linear,
    /// Cubic, four points a segment, each last one the first of the next.
    #[default]
    Bezier,
    /// Cubic, uniform.
    BSpline,
    /// Cubic, through the points.
    CatmullRom,
}

/// `wrap`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum CurveWrap {
    /// As the points say.
    #[default]
    Nonperiodic,
    /// Closed.
    Periodic,
    /// From the first point to the last one, also where the basis would stop short of them.
    Pinned,
    /// Each pair of points is a line of its own (Hydra's `segmented`, linear only).
    Segmented,
}

/// How points make curves.
#[derive(Clone, Debug)]
pub struct CurvesDesc {
    /// Basis.
    pub basis: CurveBasis,
    /// Ends.
    pub wrap: CurveWrap,
    /// Points of each curve (ints).
    pub counts: TypedArray,
    /// Point of each vertex of the curves (ints); none: the points in their order.
    pub indices: Option<TypedArray>,
}
