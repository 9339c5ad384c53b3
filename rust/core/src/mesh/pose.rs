// SPDX-License-Identifier: Apache-2.0
//! The points of a prim at a time. Plain data.

use crate::array::TypedArray;

/// The points of a prim at a time.
#[derive(Clone, Debug)]
pub(crate) struct PointsPose {
    /// Part of the shutter.
    pub(crate) time: f32,
    /// Positions; NaN where they are not usable.
    pub(crate) points: Vec<[f32; 3]>,
    /// Values of authored normals, where they change.
    pub(crate) normals: Option<TypedArray>,
    /// Values of authored widths, where they change.
    pub(crate) widths: Option<TypedArray>,
    /// By point, where points have some; none: those of the frame.
    pub(crate) radii: Option<Vec<f32>>,
}
