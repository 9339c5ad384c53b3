// SPDX-License-Identifier: Apache-2.0
//! The accessors of typed arrays, without a virtual call per element. Bounds-checked; any alignment; any thread.

use bytemuck::Pod;
use glam::{DMat4, DQuat, DVec2, DVec3, DVec4};
use half::f16;

use super::{ComponentType, ElementType};

/// A borrowed [`super::TypedArray`]: the accessors without a virtual call.
#[derive(Clone, Copy, Debug)]
pub struct ArrayView<'a> {
    element: ElementType,
    component: ComponentType,
    components: usize,
    bytes: &'a [u8],
}

impl<'a> ArrayView<'a> {
    pub(super) fn new(element: ElementType, bytes: &'a [u8]) -> Self {
        let (component, components) = element.layout();
        Self { element, component, components, bytes }
    }

    /// Number of elements.
    #[must_use]
    #[inline]
    pub fn len(&self) -> usize {
        self.bytes.len() / (self.component.size() * self.components)
    }

    /// Returns true if there is no element.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.bytes.is_empty()
    }

    /// Type of one element.
    #[must_use]
    pub fn element(&self) -> ElementType {
        self.element
    }

    /// The bytes of all elements.
    #[must_use]
    pub fn bytes(&self) -> &'a [u8] {
        self.bytes
    }

    /// Reads a byte of element `i`, which loads the element into the cache. 0 past the end.
    #[must_use]
    #[inline]
    pub(crate) fn touch(&self, i: usize) -> u8 {
        let at = i.checked_mul(self.component.size() * self.components);
        at.and_then(|at| self.bytes.get(at)).copied().unwrap_or(0)
    }

    #[inline]
    fn read<T: Pod, const N: usize>(&self, i: usize) -> Option<[T; N]>
    where
        [T; N]: Pod,
    {
        let size = size_of::<[T; N]>();
        let start = i.checked_mul(size)?;
        self.bytes.get(start..start.checked_add(size)?).map(bytemuck::pod_read_unaligned)
    }

    #[inline]
    fn floats<const N: usize>(&self, i: usize) -> Option<[f64; N]>
    where
        [u8; N]: Pod,
        [i32; N]: Pod,
        [f16; N]: Pod,
        [f32; N]: Pod,
        [f64; N]: Pod,
    {
        if self.components != N {
            return None;
        }
        match self.component {
            ComponentType::F16 => self.read::<f16, N>(i).map(|v| v.map(f16::to_f64)),
            ComponentType::F32 => self.read::<f32, N>(i).map(|v| v.map(f64::from)),
            ComponentType::F64 => self.read::<f64, N>(i),
            ComponentType::I32 => self.read::<i32, N>(i).map(|v| v.map(f64::from)),
            ComponentType::U8 => self.read::<u8, N>(i).map(|v| v.map(|byte| f64::from(u8::from(byte != 0)))),
        }
    }

    /// Element `i` of an array of numbers; of bools 0 or 1.
    #[must_use]
    #[inline]
    pub fn scalar(&self, i: usize) -> Option<f64> {
        self.floats::<1>(i).map(|[v]| v)
    }

    /// Element `i` of a two-vector array.
    #[must_use]
    #[inline]
    pub fn vec2(&self, i: usize) -> Option<DVec2> {
        self.floats::<2>(i).map(DVec2::from_array)
    }

    /// Element `i` of a three-vector array.
    #[must_use]
    #[inline]
    pub fn vec3(&self, i: usize) -> Option<DVec3> {
        self.floats::<3>(i).map(DVec3::from_array)
    }

    /// Element `i` of a four-vector array (not of quaternions).
    #[must_use]
    #[inline]
    pub fn vec4(&self, i: usize) -> Option<DVec4> {
        if self.element.is_quat() { None } else { self.floats::<4>(i).map(DVec4::from_array) }
    }

    /// Element `i` of a quaternion array, as stored: not normalised.
    #[must_use]
    #[inline]
    pub fn quat(&self, i: usize) -> Option<DQuat> {
        if self.element.is_quat() { self.floats::<4>(i).map(DQuat::from_array) } else { None }
    }

    /// Element `i` of a matrix array as the column-vector matrix (the transpose of Gf's row-vector matrix).
    #[must_use]
    #[inline]
    pub fn matrix(&self, i: usize) -> Option<DMat4> {
        self.floats::<16>(i).map(|m| column_matrix(&m))
    }

    /// Element `i` of an integer array.
    #[must_use]
    #[inline]
    pub fn index(&self, i: usize) -> Option<i32> {
        if self.component == ComponentType::I32 { self.read::<i32, 1>(i).map(|[v]| v) } else { None }
    }

    /// Element `i` of a bool array.
    #[must_use]
    #[inline]
    pub fn boolean(&self, i: usize) -> Option<bool> {
        if self.component == ComponentType::U8 { self.bytes.get(i).map(|&b| b != 0) } else { None }
    }
}

/// Converts `GfMatrix4d` data, which are row by row for row vectors, to the matrix for column vectors. Read column by
/// column, the same sixteen numbers are the transpose, which is the one wanted. Points are homogeneous, so an affine
/// matrix may have another number than 1 in its corner, as a matrix that was scaled as a whole does; the matrix is
/// divided by it.
#[must_use]
pub fn column_matrix(gf_data: &[f64; 16]) -> DMat4 {
    let [x, y, z, w] = [3, 7, 11, 15].map(|at| gf_data[at]);
    let is_scaled = x == 0.0 && y == 0.0 && z == 0.0 && w != 0.0 && w != 1.0 && w.is_finite();
    if is_scaled { DMat4::from_cols_array(&gf_data.map(|v| v / w)) } else { DMat4::from_cols_array(gf_data) }
}
