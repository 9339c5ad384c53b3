// SPDX-License-Identifier: Apache-2.0
//! Affine maps that placements may have, and their rounding to single precision. Pure.

use glam::{DAffine3, DMat3, DMat4, DVec4};

/// Columns are dependent if `det^2` is below this times the product of their squared lengths.
const SINGULAR: f64 = 1e-24;
/// Largest number of a record: its square is finite in single precision.
pub(crate) const MAX_MAGNITUDE: f32 = 1e18;
/// Rounding of the f32 matrix and of its evaluation, in units of the magnitudes involved: 4 x 2^-24.
pub(crate) const MATRIX_ERROR: f64 = 4.0 / 16_777_216.0;

/// An affine matrix with finite entries and independent columns, or `None`.
pub(crate) fn usable_affine(m: &DMat4) -> Option<DAffine3> {
    let affine = affine_of(m)?;
    (affine.is_finite() && is_regular(&affine.matrix3, affine.matrix3.determinant())).then_some(affine)
}

/// A matrix whose last row is that of an affine map, or `None`.
pub(super) fn affine_of(m: &DMat4) -> Option<DAffine3> {
    ((m.row(3) - DVec4::W).abs().max_element() <= 1e-9).then(|| DAffine3::from_mat4(*m))
}

/// Returns true if the columns, whose determinant is given, are independent.
pub(super) fn is_regular(m: &DMat3, determinant: f64) -> bool {
    let volume = m.x_axis.length_squared() * m.y_axis.length_squared() * m.z_axis.length_squared();
    determinant * determinant > SINGULAR * volume
}

/// The nearest f32.
#[inline]
#[expect(clippy::cast_possible_truncation, reason = "rounding to single precision is what is wanted")]
pub(crate) fn nearest(v: f64) -> f32 {
    v as f32
}

/// The largest f32 that is not above `v`.
#[inline]
pub(crate) fn round_down(v: f64) -> f32 {
    let f = nearest(v);
    if f64::from(f) > v { f.next_down() } else { f }
}

/// The smallest f32 that is not below `v`.
#[inline]
pub(crate) fn round_up(v: f64) -> f32 {
    let f = nearest(v);
    if f64::from(f) < v { f.next_up() } else { f }
}
