// SPDX-License-Identifier: Apache-2.0
//! The kinds of primitive that the points of a prim make (`UsdGeomMesh`, `UsdGeomBasisCurves`, `UsdGeomPoints`).

use crate::array::TypedArray;

/// The kind of primitive that the points of a prim make. Curves and points have widths ([`super::MeshDesc::widths`]);
/// those of a mesh are ignored.
#[derive(Clone, Debug, Default)]
pub enum PrimShape {
    /// Corners of polygons, or of the control mesh of a subdivision surface.
    #[default]
    Mesh,
    /// Control points of curves: tubes, or ribbons if the prim has normals.
    Curves(CurvesDesc),
    /// The points are centres of balls.
    Points,
    /// Opposite corners of axis-aligned boxes in the prim's frame, two for each box. Only tests have it.
    #[cfg(feature = "faults")]
    ToyBoxes,
}

impl PrimShape {
    /// Number that distinguishes shapes in hashes; `None` for a mesh.
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

/// Values of `type` and `basis`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum CurveBasis {
    /// Straight lines from point to point.
    Linear,
    /// Cubic Bezier curve with four points per segment; the last is the first of the next segment.
    #[default]
    Bezier,
    /// Uniform cubic B-spline.
    BSpline,
    /// Cubic curve through its points.
    CatmullRom,
}

/// Values of `wrap`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum CurveWrap {
    /// The curve begins and ends where its points say.
    #[default]
    Nonperiodic,
    /// The curve is closed.
    Periodic,
    /// The curve runs from the first point to the last one, also if the basis would stop short of them.
    Pinned,
    /// Each pair of points is a line of its own (Hydra's `segmented`, linear only).
    Segmented,
}

/// The way in which points make curves.
#[derive(Clone, Debug)]
pub struct CurvesDesc {
    /// Basis of the segments.
    pub basis: CurveBasis,
    /// Treatment of the ends.
    pub wrap: CurveWrap,
    /// Number of points of each curve (ints).
    pub counts: TypedArray,
    /// Point of each vertex of the curves (ints); `None`: the points in their order.
    pub indices: Option<TypedArray>,
}
