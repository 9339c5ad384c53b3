// SPDX-License-Identifier: Apache-2.0
//! The leaf test of triangles: geometry/triangle.glsl, operation by operation. Pure, any thread.

use crate::simd::{EdgeFunctions, Simd};
use crate::vector::{V3, dot3, triangle_normal};
use oocpt_abi::GRAZING;

/// The plane across a ray (`make_shear`): along two axes, sheared along the third.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct RayShear {
    u: V3,
    v: V3,
}

impl RayShear {
    #[inline(always)]
    pub(crate) fn new(d: V3) -> Self {
        let [x, y, z] = d.0;
        let size = d.map(f32::abs);
        if size[0] >= size[1] && size[0] >= size[2] {
            Self { u: V3([-y / x, 1.0, 0.0]), v: V3([-z / x, 0.0, 1.0]) }
        } else if size[1] >= size[2] {
            Self { u: V3([0.0, -z / y, 1.0]), v: V3([1.0, -x / y, 0.0]) }
        } else {
            Self { u: V3([1.0, 0.0, -x / z]), v: V3([0.0, 1.0, -y / z]) }
        }
    }
}

/// Distance, in units of `d`, and barycentrics, where the ray meets the triangle in front of its origin. Each corner
/// has a fourth number, which is nothing.
#[inline(always)]
pub(crate) fn hit_triangle(
    simd: impl Simd,
    corners: &[[f32; 4]; 3],
    o: V3,
    d: V3,
    shear: &RayShear,
) -> Option<(f32, [f32; 2])> {
    let EdgeFunctions { w: [wa, wb, wc], is_outside } = simd.edges(corners, o, [shear.u, shear.v]);
    let sum = wa + wb + wc;
    if is_outside || sum == 0.0 {
        return None;
    }
    let corners = corners.map(|[x, y, z, _]| V3([x, y, z]));
    let [a, b, c] = corners.map(|corner| corner - o);
    let scale = 1.0 / sum;
    let uv = [wb * scale, wc * scale];
    let n = triangle_normal(corners[0], corners[1], corners[2]);
    let dd = dot3(d, d);
    let along = dot3(n, d);
    let mut t = dot3(n, a) / along;
    #[expect(clippy::neg_cmp_op_on_partial_ord, reason = "NaN is seen along the plane")]
    if !(along * along > GRAZING * dot3(n, n) * dd) {
        let [x, y, z] = [a, b, c].map(|corner| dot3(corner, d) / dd);
        let (low, high) = (x.min(y.min(z)), x.max(y.max(z)));
        let inside = if along == 0.0 { x * (wa * scale) + (y * uv[0] + z * uv[1]) } else { t };
        // Not `clamp`, which panics where the bounds are NaN.
        t = inside.max(low).min(high);
    }
    (t > 0.0).then_some((t, uv))
}
