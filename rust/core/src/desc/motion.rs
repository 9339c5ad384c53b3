// SPDX-License-Identifier: Apache-2.0
//! What moves while the shutter is open, as Hydra gives it, unchecked. Times are parts of the shutter: it opens at 0
//! and closes at 1; samples may lie before and after.

use glam::DMat4;

use crate::array::TypedArray;

/// A transform at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TransformSample {
    /// Part of the shutter.
    pub time: f64,
    /// As [`super::PrimDesc::transform`].
    pub transform: DMat4,
}

/// The points of a mesh, of curves or of points at a time.
#[derive(Clone, Debug)]
pub struct PointsSample {
    /// Part of the shutter.
    pub time: f64,
    /// As [`super::MeshDesc::points`].
    pub points: TypedArray,
    /// Values of [`super::MeshDesc::normals`]; none: those that the frame has.
    pub normals: Option<TypedArray>,
    /// Values of [`super::MeshDesc::widths`]; none: those that the frame has.
    pub widths: Option<TypedArray>,
}

/// How points move within the prim's frame, and normals and widths with them. Velocities win over samples, as
/// `UsdGeomPointBased` has it.
#[derive(Clone, Debug, Default)]
pub struct PointsMotion {
    /// In the order of time; fewer than two where nothing is sampled.
    pub samples: Vec<PointsSample>,
    /// Three-vectors, units per second.
    pub velocities: Option<TypedArray>,
    /// Three-vectors, units per second squared; count with velocities only.
    pub accelerations: Option<TypedArray>,
    /// When the shutter opens and closes, seconds from the time of the points themselves.
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
    /// Part of the shutter.
    pub time: f64,
    /// As [`super::InstancerDesc::translations`].
    pub translations: Option<TypedArray>,
    /// As [`super::InstancerDesc::rotations`].
    pub rotations: Option<TypedArray>,
    /// As [`super::InstancerDesc::scales`].
    pub scales: Option<TypedArray>,
    /// As [`super::InstancerDesc::transforms`].
    pub transforms: Option<TypedArray>,
}

/// How the instances of an instancer move. Velocities win over samples, as `UsdGeomPointInstancer` has it.
#[derive(Clone, Debug, Default)]
pub struct InstancerMotion {
    /// In any order of time; empty where nothing is sampled.
    pub samples: Vec<InstancerSample>,
    /// Three-vectors, units per second.
    pub velocities: Option<TypedArray>,
    /// Three-vectors, units per second squared; count with velocities only.
    pub accelerations: Option<TypedArray>,
    /// Three-vectors along the axes of rotation, degrees per second.
    pub angular_velocities: Option<TypedArray>,
    /// When the shutter opens and closes, seconds from the time of the arrays themselves.
    pub seconds: [f64; 2],
}
