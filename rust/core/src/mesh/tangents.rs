// SPDX-License-Identifier: Apache-2.0
//! Frames at the vertices of a mesh that was cut, for displacements along tangents. Pure.

use glam::{DVec2, DVec3, Vec3};

/// Tangent, bitangent and normal: unit vectors at right angles to each other.
pub(super) type TangentFrame = [DVec3; 3];

/// Where u and v grow around each vertex.
#[derive(Clone, Copy, Default)]
struct UvGradients {
    u: DVec3,
    v: DVec3,
}

/// See the module.
#[derive(Default)]
pub(super) struct TangentField {
    around: Vec<UvGradients>,
}

impl TangentField {
    pub(super) fn new(vertices: usize) -> Self {
        Self { around: vec![UvGradients::default(); vertices] }
    }

    /// Adds a triangle: its vertices, where they are, their texture coordinates. It counts by its area.
    pub(super) fn add(&mut self, triangle: &[u32; 3], corners: [DVec3; 3], st: [DVec2; 3]) {
        let [e, f] = [corners[1] - corners[0], corners[2] - corners[0]];
        let [x, y] = [st[1] - st[0], st[2] - st[0]];
        let side = x.perp_dot(y).signum();
        let area = e.cross(f).length();
        let unit = |along: DVec3| (along * side).try_normalize();
        // Both over the same determinant, which decides the side.
        let (Some(u), Some(v)) = (unit(e * y.y - f * x.y), unit(f * x.x - e * y.x)) else { return };
        if x.perp_dot(y) == 0.0 || !area.is_finite() {
            return;
        }
        for &vertex in triangle {
            if let Some(around) = self.around.get_mut(vertex as usize) {
                around.u += u * area;
                around.v += v * area;
            }
        }
    }

    /// The frame of a vertex whose unit normal is known: the tangent is where u grows, less what it has of the normal,
    /// or anywhere at right angles to it where u grows nowhere; the bitangent is on the side where v grows.
    pub(super) fn frame(&self, vertex: u32, normal: DVec3) -> TangentFrame {
        let UvGradients { u, v } = self.around.get(vertex as usize).copied().unwrap_or_default();
        // What is left of two that are nearly parallel is rounding.
        let lies = u.try_normalize().map(|u| u - normal * normal.dot(u)).filter(|t| t.length_squared() > 1e-12);
        let Some(tangent) = lies.and_then(DVec3::try_normalize) else {
            let (tangent, bitangent) = normal.any_orthonormal_pair();
            return [tangent, bitangent, normal];
        };
        let bitangent = normal.cross(tangent);
        [tangent, if bitangent.dot(v) < 0.0 { -bitangent } else { bitangent }, normal]
    }
}

/// A point or vector of a mesh.
pub(super) fn at(values: &[[f32; 3]], vertex: u32) -> DVec3 {
    values.get(vertex as usize).map_or(DVec3::ZERO, |value| Vec3::from(*value).as_dvec3())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(st: [[f64; 2]; 3], normal: DVec3) -> TangentFrame {
        let mut tangents = TangentField::new(3);
        tangents.add(&[0, 1, 2], [DVec3::ZERO, DVec3::X * 3.0, DVec3::Y * 0.5], st.map(DVec2::from));
        tangents.frame(1, normal)
    }

    fn near(found: TangentFrame, known: TangentFrame) {
        for (found, known) in found.into_iter().zip(known) {
            assert!((found - known).length() < 1e-12, "{found}, not {known}");
        }
    }

    #[test]
    fn tangents_follow_the_gradient_of_st() {
        let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
        near(frame([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], z), [x, y, z]);
        near(frame([[0.0, 0.0], [-1.0, 0.0], [0.0, 1.0]], z), [-x, y, z]);
        near(frame([[5.0, 5.0], [5.0, 4.0], [7.0, 5.0]], z), [y, -x, z]);
        // Sheared: at right angles to the tangent, on the side of v.
        near(frame([[0.0, 0.0], [3.0, 0.0], [0.5, -0.5]], z), [x, -y, z]);
        let normal = DVec3::new(0.6, 0.0, 0.8);
        let tangent = DVec3::new(0.8, 0.0, -0.6);
        near(frame([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], normal), [tangent, y, normal]);
    }

    #[test]
    fn degenerate_texture_coordinates_give_an_orthonormal_frame() {
        for st in [[[0.0; 2]; 3], [[1.0, 2.0], [2.0, 4.0], [3.0, 6.0]], [[f64::NAN; 2]; 3], [[f64::MAX; 2]; 3]] {
            let [t, b, n] = frame(st, DVec3::Z);
            assert!(t.is_normalized() && b.is_normalized() && n == DVec3::Z, "{t} {b}");
            assert!(t.dot(b).abs() < 1e-12 && t.dot(n).abs() < 1e-12, "{t} {b}");
        }
        let [t, ..] = frame([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], DVec3::X);
        assert!(t.dot(DVec3::X).abs() < 1e-12, "u grows along the normal: {t}");
    }
}
