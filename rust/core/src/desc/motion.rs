// SPDX-License-Identifier: Apache-2.0
//! Motion while the shutter is open, as Hydra gives it, unchecked. Times are parts of the shutter: it opens at 0 and
//! closes at 1; samples may lie before and after.

use glam::DMat4;

use crate::array::TypedArray;

/// A transform at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TransformSample {
    /// Time as a part of the shutter.
    pub time: f64,
    /// Transform, as [`super::PrimDesc::transform`].
    pub transform: DMat4,
}

/// The points of a mesh, of curves or of points at a time.
#[derive(Clone, Debug)]
pub struct PointsSample {
    /// Time as a part of the shutter.
    pub time: f64,
    /// Points, as [`super::MeshDesc::points`].
    pub points: TypedArray,
    /// Values of [`super::MeshDesc::normals`]; `None`: those of the frame.
    pub normals: Option<TypedArray>,
    /// Values of [`super::MeshDesc::widths`]; `None`: those of the frame.
    pub widths: Option<TypedArray>,
}

/// Motion of points within the prim's frame, with their normals and widths. Velocities win over samples, as
/// `UsdGeomPointBased` has it.
#[derive(Clone, Debug, Default)]
pub struct PointsMotion {
    /// Samples in the order of time; fewer than two if nothing is sampled.
    pub samples: Vec<PointsSample>,
    /// Velocities (three-vectors), units per second.
    pub velocities: Option<TypedArray>,
    /// Accelerations (three-vectors), units per second squared; used with velocities only.
    pub accelerations: Option<TypedArray>,
    /// Opening and closing of the shutter, seconds from the time of the points themselves.
    pub seconds: [f64; 2],
}

impl PointsMotion {
    /// Returns true if there is anything that may move the points.
    #[must_use]
    pub fn is_given(&self) -> bool {
        self.samples.len() > 1 || self.velocities.as_ref().is_some_and(|velocities| !velocities.is_empty())
    }
}

/// The arrays of an instancer at a time.
#[derive(Clone, Debug, Default)]
pub struct InstancerSample {
    /// Time as a part of the shutter.
    pub time: f64,
    /// Translations, as [`super::InstancerDesc::translations`].
    pub translations: Option<TypedArray>,
    /// Rotations, as [`super::InstancerDesc::rotations`].
    pub rotations: Option<TypedArray>,
    /// Scales, as [`super::InstancerDesc::scales`].
    pub scales: Option<TypedArray>,
    /// Transforms, as [`super::InstancerDesc::transforms`].
    pub transforms: Option<TypedArray>,
}

/// Motion of the instances of an instancer. Velocities win over samples, as `UsdGeomPointInstancer` has it.
#[derive(Clone, Debug, Default)]
pub struct InstancerMotion {
    /// Samples in any order of time; empty if nothing is sampled.
    pub samples: Vec<InstancerSample>,
    /// Velocities (three-vectors), units per second.
    pub velocities: Option<TypedArray>,
    /// Accelerations (three-vectors), units per second squared; used with velocities only.
    pub accelerations: Option<TypedArray>,
    /// Angular velocities: three-vectors along the axes of rotation, degrees per second.
    pub angular_velocities: Option<TypedArray>,
    /// Opening and closing of the shutter, seconds from the time of the arrays themselves.
    pub seconds: [f64; 2],
}
