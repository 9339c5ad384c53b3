// SPDX-License-Identifier: Apache-2.0
//! Shapes of local lights: their choice from descriptions, and their areas and sizes under affine maps. Pure.
//!
//! This is the only Rust code that depends on a shape; `shaders/light/shapes` has a file of the same name for each.

use std::f64::consts::{PI, TAU};

use glam::{DMat3, DVec3};

use crate::desc::{AssetRef, LightKind};

/// A shape of unit size; a [`super::LocalLight`] has its position and its size.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum LocalShape {
    /// The square `|x| <= 1, |y| <= 1` in the plane z = 0; it emits to -z.
    Rect,
    /// The disk `x^2 + y^2 <= 1` in the plane z = 0; it emits to -z.
    Disk,
    /// The unit sphere; it emits outwards.
    Sphere,
    /// The cylinder `y^2 + z^2 = 1, |x| <= 1` without caps; it emits outwards.
    Cylinder,
    /// The origin; it emits the same in all directions.
    Point,
    /// The segment `|x| <= 1` of the x axis; it emits with the sine of the angle to it.
    Line,
    /// The triangle `x >= -1, y >= -1, x + y <= 0` in the plane z = 0; it emits to -z. Only tests have it.
    #[cfg(feature = "faults")]
    ToyLight,
}

impl LocalShape {
    /// Name of its file in `shaders/light/shapes`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Rect => "rect",
            Self::Disk => "disk",
            Self::Sphere => "sphere",
            Self::Cylinder => "cylinder",
            Self::Point => "point",
            Self::Line => "line",
            #[cfg(feature = "faults")]
            Self::ToyLight => "toy_light",
        }
    }

    /// Returns true for shapes that no ray can meet.
    #[must_use]
    pub fn is_thin(self) -> bool {
        matches!(self, Self::Point | Self::Line)
    }

    /// Returns true for shapes that emit to one side of a plane.
    #[must_use]
    pub fn is_flat(self) -> bool {
        self.half_box()[2] <= 0.0 && !self.is_thin()
    }

    /// Half the sizes of its box in its own frame.
    #[must_use]
    pub fn half_box(self) -> [f64; 3] {
        match self {
            Self::Rect | Self::Disk => [1.0, 1.0, 0.0],
            Self::Sphere | Self::Cylinder => [1.0; 3],
            Self::Line => [1.0, 0.0, 0.0],
            Self::Point => [0.0; 3],
            #[cfg(feature = "faults")]
            Self::ToyLight => [1.0, 1.0, 0.0],
        }
    }

    /// Half the size of its box along an axis of the world, after a linear map with this row of absolute values: for
    /// round shapes norms, for the rest sums.
    #[must_use]
    pub fn half_extent(self, [x, y, z]: [f64; 3]) -> f64 {
        match self {
            Self::Rect => x + y,
            Self::Disk => x.hypot(y),
            Self::Sphere => x.hypot(y).hypot(z),
            Self::Cylinder => x + y.hypot(z),
            Self::Line => x,
            Self::Point => 0.0,
            #[cfg(feature = "faults")]
            Self::ToyLight => x + y,
        }
    }

    /// Area of the shape after the linear map `m`; 0 for points and lines. Exact for plane shapes; curved ones are
    /// summed over their surface (error below 1e-6 of the result unless one axis is some fifty times another).
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
            #[cfg(feature = "faults")]
            Self::ToyLight => 2.0 * xy.length(),
        }
    }
}

/// The shape, and the sizes of the unit shape's axes.
pub(super) fn shape_of(kind: &LightKind) -> Option<(LocalShape, DVec3, Option<AssetRef>)> {
    let wide = f64::from;
    match kind {
        LightKind::Rect { width, height, texture } => {
            let texture = texture.clone().filter(|asset| !asset.authored.is_empty() || !asset.resolved.is_empty());
            Some((LocalShape::Rect, DVec3::new(0.5 * wide(*width), 0.5 * wide(*height), 1.0), texture))
        }
        LightKind::Disk { radius } => Some((LocalShape::Disk, DVec3::new(wide(*radius), wide(*radius), 1.0), None)),
        LightKind::Sphere { radius, treat_as_point } => {
            let shape = if *treat_as_point || *radius <= 0.0 { LocalShape::Point } else { LocalShape::Sphere };
            Some((shape, DVec3::splat(wide(*radius)), None))
        }
        LightKind::Cylinder { length, radius, treat_as_line } => {
            let shape = if *treat_as_line || *radius <= 0.0 { LocalShape::Line } else { LocalShape::Cylinder };
            Some((shape, DVec3::new(0.5 * wide(*length), wide(*radius), wide(*radius)), None))
        }
        #[cfg(feature = "faults")]
        LightKind::ToyLight { side } => {
            Some((LocalShape::ToyLight, DVec3::new(0.5 * wide(*side), 0.5 * wide(*side), 1.0), None))
        }
        LightKind::Dome { .. } | LightKind::Distant { .. } | LightKind::Mesh { .. } => None,
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
