// SPDX-License-Identifier: Apache-2.0
//! Vectors with the arithmetic of `shaders/math/affine.glsl` and `double.glsl`, as a device computes it that has no
//! fused multiply-add: `fma(a, b, c)` rounds its product. Pure, any thread.

use std::ops::{Add, Index, Mul, Sub};

/// Three floats.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct V3(pub(crate) [f32; 3]);

impl V3 {
    #[inline(always)]
    pub(crate) fn map(self, f: impl Fn(f32) -> f32) -> Self {
        Self([f(self[0]), f(self[1]), f(self[2])])
    }

    /// The largest absolute component; NaN counts as nothing.
    #[inline(always)]
    pub(crate) fn largest(self) -> f32 {
        // Not `f32::max`, which asks which one is NaN.
        self.0.into_iter().fold(0.0, |most, x| if x.abs() > most { x.abs() } else { most })
    }
}

impl Index<usize> for V3 {
    type Output = f32;

    #[inline(always)]
    fn index(&self, axis: usize) -> &f32 {
        &self.0[axis]
    }
}

impl Add for V3 {
    type Output = Self;

    #[inline(always)]
    fn add(self, b: Self) -> Self {
        Self([self[0] + b[0], self[1] + b[1], self[2] + b[2]])
    }
}

impl Sub for V3 {
    type Output = Self;

    #[inline(always)]
    fn sub(self, b: Self) -> Self {
        Self([self[0] - b[0], self[1] - b[1], self[2] - b[2]])
    }
}

impl Mul for V3 {
    type Output = Self;

    #[inline(always)]
    fn mul(self, b: Self) -> Self {
        Self([self[0] * b[0], self[1] * b[1], self[2] * b[2]])
    }
}

impl Mul<V3> for f32 {
    type Output = V3;

    #[inline(always)]
    fn mul(self, v: V3) -> V3 {
        v.map(|x| self * x)
    }
}

#[inline(always)]
pub(crate) fn dot3(a: V3, b: V3) -> f32 {
    a[0] * b[0] + (a[1] * b[1] + a[2] * b[2])
}

/// `combine_rows` of affine.glsl: the columns of a matrix times a vector.
#[inline(always)]
pub(crate) fn apply_columns([x, y, z]: [V3; 3], v: V3) -> V3 {
    v[0] * x + (v[1] * y + v[2] * z)
}

#[inline(always)]
pub(crate) fn cross3(a: V3, b: V3) -> V3 {
    V3([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
}

/// A normal of a triangle, not unit, from its two shorter edges.
#[inline(always)]
pub(crate) fn triangle_normal(v0: V3, v1: V3, v2: V3) -> V3 {
    let (a, b, c) = (v1 - v0, v2 - v0, v2 - v1);
    let (aa, bb, cc) = (dot3(a, a), dot3(b, b), dot3(c, c));
    let without_a = aa > bb && aa > cc;
    let without_c = !without_a && cc > bb;
    cross3(if without_a { b } else { a }, if without_c { b } else { c })
}

/// Rows of an affine map, as they lie in memory.
pub(crate) type AffineRows = [[f32; 4]; 3];

#[inline(always)]
pub(crate) fn apply_point(m: &AffineRows, p: V3) -> V3 {
    let row = |r: [f32; 4]| r[0] * p[0] + (r[1] * p[1] + (r[2] * p[2] + r[3]));
    V3([row(m[0]), row(m[1]), row(m[2])])
}

#[inline(always)]
pub(crate) fn apply_vector(m: &AffineRows, v: V3) -> V3 {
    let row = |r: [f32; 4]| r[0] * v[0] + (r[1] * v[1] + r[2] * v[2]);
    V3([row(m[0]), row(m[1]), row(m[2])])
}

/// The difference of two sums of two floats, rounded to one (`difference` of double.glsl).
#[inline(always)]
pub(crate) fn difference(a: (V3, V3), b: (V3, V3)) -> V3 {
    let minus = b.0.map(|x| -x);
    let s = a.0 + minus;
    let bb = s - a.0;
    let e = (a.0 - (s - bb)) + (minus - bb);
    s + (e + (a.1 - b.1))
}

/// What no component of `d` counts as smaller than.
#[inline(always)]
pub(crate) fn tiny_component(d: V3) -> f32 {
    let tiny = d.largest() * 8.673_617e-19;
    if tiny > 1.0e-37 { tiny } else { 1.0e-37 }
}

/// `safe_reciprocal` of traversal/box.glsl: no component counts as smaller than 2^-60 of the largest one.
#[inline(always)]
pub(crate) fn safe_reciprocal(d: V3) -> V3 {
    let tiny = tiny_component(d);
    d.map(|x| 1.0 / if x.abs() < tiny { tiny.copysign(x) } else { x })
}
