// SPDX-License-Identifier: Apache-2.0
//! `shaders/texture/footprint.glsl` in f64, by the singular values of the map from a cone's cross section to texels,
//! for tests.
//!
//! Vectors are in one frame, of any lengths; widths in texels of level 0.

use glam::{DMat2, DVec2, DVec3};

/// [`oocpt_abi::MAX_ANISOTROPY`] in f64.
pub const MAX_ANISOTROPY: f64 = oocpt_abi::MAX_ANISOTROPY as f64;

/// The longer and the shorter axis of the ellipse that a cone of width 1 covers: a cone along `direction` that cuts a
/// plane with normal `normal`, on which the texture's coordinates have the `gradients`; `map` (by columns) maps these
/// to the unit square of an image of `size` texels. The cosine must not be 0.
#[must_use]
pub fn ellipse(gradients: [DVec3; 2], normal: DVec3, direction: DVec3, map: DMat2, size: [u32; 2]) -> [f64; 2] {
    let (x, y) = direction.normalize().any_orthonormal_pair();
    // The position of a point of the section on the plane.
    let landed = |p: DVec3| p - direction * (normal.dot(p) / normal.dot(direction));
    let coordinates = |p: DVec3| DVec2::new(gradients[0].dot(p), gradients[1].dot(p));
    let texels = DMat2::from_diagonal(DVec2::new(f64::from(size[0]), f64::from(size[1])));
    let [a, b] = [x, y].map(|axis| texels * map * coordinates(landed(axis)));
    // One-sided Jacobi: the rotation after which both columns are orthogonal.
    let angle = 0.5 * (2.0 * a.dot(b)).atan2(a.length_squared() - b.length_squared());
    let (sin, cos) = angle.sin_cos();
    let longer = (a * cos + b * sin).length();
    let area = a.perp_dot(b).abs();
    [longer, if longer > 0.0 { area / longer } else { 0.0 }]
}

/// Width of the filter for such an ellipse, texels of level 0.
#[must_use]
pub fn filter_width([longer, shorter]: [f64; 2]) -> f64 {
    shorter.max(longer / MAX_ANISOTROPY)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn along(normal: DVec3, map: DMat2, size: [u32; 2]) -> [f64; 2] {
        ellipse([DVec3::X, DVec3::Y], normal, DVec3::NEG_Z, map, size)
    }

    fn near(a: [f64; 2], b: [f64; 2]) {
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() <= 1e-12 * b), "{a:?}, not {b:?}");
    }

    #[test]
    fn known_footprint_ellipses() {
        near(along(DVec3::Z, DMat2::IDENTITY, [64, 64]), [64.0, 64.0]);
        near(along(DVec3::Z, DMat2::IDENTITY, [16, 64]), [64.0, 16.0]);
        near(along(DVec3::Z, DMat2::from_diagonal(DVec2::new(-8.0, 1.0)), [16, 64]), [128.0, 64.0]);
        // A plane that leans by 60 degrees: twice as long; with a shear by 1 the golden ratio and its inverse.
        let leaning = DVec3::new(0.0, 3.0_f64.sqrt(), 1.0);
        let gradients = [DVec3::X, DVec3::new(0.0, 0.5, -(0.75_f64.sqrt()))];
        near(ellipse(gradients, leaning, DVec3::NEG_Z, DMat2::IDENTITY, [10, 10]), [20.0, 10.0]);
        let shear = DMat2::from_cols(DVec2::X, DVec2::ONE);
        let golden = f64::midpoint(1.0, 5.0_f64.sqrt());
        near(along(DVec3::Z, shear, [1, 1]), [golden, 1.0 / golden]);
        near(along(DVec3::Z, DMat2::from_cols(DVec2::ONE, DVec2::ZERO), [5, 12]), [13.0, 0.0]);
        near(along(DVec3::Z, DMat2::ZERO, [5, 12]), [0.0, 0.0]);
    }

    #[test]
    fn filter_width_is_the_minor_axis_up_to_the_anisotropy_limit() {
        for (axes, width) in
            [([3.0, 3.0], 3.0), ([16.0, 1.0], 1.0), ([64.0, 1.0], 4.0), ([8.0, 0.0], 0.5), ([0.0; 2], 0.0)]
        {
            near([filter_width(axes), 1.0], [width, 1.0]);
        }
    }
}
