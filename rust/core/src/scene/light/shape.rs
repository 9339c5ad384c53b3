// SPDX-License-Identifier: Apache-2.0
//! Shapes of local lights under affine maps: their areas in the world. Pure.

use std::f64::consts::{PI, TAU};

use glam::DMat3;

/// A shape of unit size; a [`super::LocalLight`] says where it is and how large.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum LocalShape {
    /// The square `|x| <= 1, |y| <= 1` in the plane z = 0; shines to -z.
    Rect,
    /// The disk `x^2 + y^2 <= 1` in the plane z = 0; shines to -z.
    Disk,
    /// The unit sphere; shines outwards.
    Sphere,
    /// The cylinder `y^2 + z^2 = 1, |x| <= 1` without caps; shines outwards.
    Cylinder,
    /// The origin; shines the same in all directions.
    Point,
    /// The segment `|x| <= 1` of the x axis; shines with the sine of the angle to it.
    Line,
}

impl LocalShape {
    /// True for shapes that no ray can meet.
    #[must_use]
    pub fn is_thin(self) -> bool {
        matches!(self, Self::Point | Self::Line)
    }

    /// True for shapes that shine to one side of a plane.
    #[must_use]
    pub fn is_flat(self) -> bool {
        matches!(self, Self::Rect | Self::Disk)
    }

    /// Area of the shape after the linear map `m`; 0 for what has none. Exact for plane shapes; curved ones are summed
    /// over their surface (error below 1e-6 of the result unless one axis is some fifty times another).
    #[must_use]
    pub fn area(self, m: &DMat3) -> f64 {
        // The area element of a map: |cofactor(m) n| for the unit normal n.
        let (yz, zx, xy) = (m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis));
        match self {
            Self::Rect => 4.0 * xy.length(),
            Self::Disk => PI * xy.length(),
            Self::Cylinder => {
                // Trapezoids converge exponentially for a smooth periodic function.
                let element = |phi: f64| (zx * phi.cos() + xy * phi.sin()).length();
                2.0 * TAU * mean(CIRCLE, |k| element(TAU * f64::from(k) / f64::from(CIRCLE)))
            }
            Self::Sphere => {
                // Uniform in z is uniform on the sphere; Fejer's rule over z, trapezoids around.
                let ring = |z: f64| {
                    let radius = (1.0 - z * z).max(0.0).sqrt();
                    mean(CIRCLE, |k| {
                        let phi = TAU * f64::from(k) / f64::from(CIRCLE);
                        (yz * (radius * phi.cos()) + zx * (radius * phi.sin()) + xy * z).length()
                    })
                };
                TAU * fejer(RINGS, ring)
            }
            Self::Point | Self::Line => 0.0,
        }
    }
}

const CIRCLE: u32 = 64;
const RINGS: u32 = 48;

fn mean(count: u32, f: impl Fn(u32) -> f64) -> f64 {
    (0..count).map(f).sum::<f64>() / f64::from(count)
}

/// Integral over [-1, 1] by Fejer's first rule (Waldvogel 2006, BIT 46).
fn fejer(count: u32, f: impl Fn(f64) -> f64) -> f64 {
    let n = f64::from(count);
    let weight = |theta: f64| {
        let sum: f64 =
            (1..=count / 2).map(|j| (2.0 * f64::from(j) * theta).cos() / (4.0 * f64::from(j * j) - 1.0)).sum();
        2.0 / n * (1.0 - 2.0 * sum)
    };
    let node = |k: u32| (2.0 * f64::from(k) + 1.0) * PI / (2.0 * n);
    (0..count).map(|k| weight(node(k)) * f(node(k).cos())).sum()
}
