// SPDX-License-Identifier: Apache-2.0
//! Typed views over arrays that the caller owns (a `VtArray` held by the bridge, or a `Vec`).
//!
//! Guarantees: nothing is copied; every access is bounds-checked and gives `None` past the end or when the element type
//! does not fit; any alignment is accepted. Any thread may read.

mod view;

use std::fmt;
use std::sync::Arc;

use bytemuck::Pod;
use glam::{DMat4, DQuat, DVec3, DVec4};
use half::f16;
use rayon::prelude::*;

pub use view::{ArrayView, column_matrix};

/// Bytes that are compared before threads share the rest: arrays that differ mostly do so early. And those that a
/// thread compares at a time.
const COMPARED: usize = 1 << 18;

/// Whether both are equal; large ones are compared by the caller's rayon pool.
fn are_same(a: &[u8], b: &[u8]) -> bool {
    let first = a.len().min(COMPARED);
    a.len() == b.len() && a[..first] == b[..first] && {
        let portions = a[first..].par_chunks(COMPARED).zip(b[first..].par_chunks(COMPARED));
        portions.all(|(a, b)| a == b)
    }
}

/// Bytes that do not move or change as long as the source lives.
pub trait ArraySource: Send + Sync + fmt::Debug {
    /// The whole array, tightly packed, in native byte order. Must give the same slice on every call.
    fn bytes(&self) -> &[u8];
}

/// The type of one element of a [`TypedArray`]. Names follow Gf (`h` = half, `f` = float, `d` = double).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ElementType {
    /// One byte, zero is false.
    Bool,
    /// 32-bit signed integer.
    I32,
    /// 16-bit float.
    F16,
    /// 32-bit float.
    F32,
    /// 64-bit float.
    F64,
    /// Two halves.
    Vec2h,
    /// Two floats.
    Vec2f,
    /// Two doubles.
    Vec2d,
    /// Three halves.
    Vec3h,
    /// Three floats.
    Vec3f,
    /// Three doubles.
    Vec3d,
    /// Four halves.
    Vec4h,
    /// Four floats.
    Vec4f,
    /// Four doubles.
    Vec4d,
    /// Quaternion of halves: imaginary x, y, z, then the real part, as Gf stores it.
    Quath,
    /// Quaternion of floats, imaginary part first.
    Quatf,
    /// Quaternion of doubles, imaginary part first.
    Quatd,
    /// 4x4 floats, row-major for row vectors (`GfMatrix4f`).
    Matrix4f,
    /// 4x4 doubles, row-major for row vectors (`GfMatrix4d`).
    Matrix4d,
}

/// The number type inside an element.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ComponentType {
    U8,
    I32,
    F16,
    F32,
    F64,
}

impl ComponentType {
    const fn size(self) -> usize {
        match self {
            Self::U8 => 1,
            Self::F16 => 2,
            Self::I32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }
}

impl ElementType {
    const fn layout(self) -> (ComponentType, usize) {
        match self {
            Self::Bool => (ComponentType::U8, 1),
            Self::I32 => (ComponentType::I32, 1),
            Self::F16 => (ComponentType::F16, 1),
            Self::F32 => (ComponentType::F32, 1),
            Self::F64 => (ComponentType::F64, 1),
            Self::Vec2h => (ComponentType::F16, 2),
            Self::Vec2f => (ComponentType::F32, 2),
            Self::Vec2d => (ComponentType::F64, 2),
            Self::Vec3h => (ComponentType::F16, 3),
            Self::Vec3f => (ComponentType::F32, 3),
            Self::Vec3d => (ComponentType::F64, 3),
            Self::Vec4h | Self::Quath => (ComponentType::F16, 4),
            Self::Vec4f | Self::Quatf => (ComponentType::F32, 4),
            Self::Vec4d | Self::Quatd => (ComponentType::F64, 4),
            Self::Matrix4f => (ComponentType::F32, 16),
            Self::Matrix4d => (ComponentType::F64, 16),
        }
    }

    /// Bytes of one element.
    #[must_use]
    pub const fn size(self) -> usize {
        let (component, count) = self.layout();
        component.size() * count
    }

    /// Numbers of one element.
    #[must_use]
    pub const fn components(self) -> usize {
        self.layout().1
    }

    /// Returns true for the three quaternion types.
    #[must_use]
    pub const fn is_quat(self) -> bool {
        matches!(self, Self::Quath | Self::Quatf | Self::Quatd)
    }
}

/// Rust types with a known [`ElementType`]. Quaternions share memory with four-vectors: use [`TypedArray::from_vec`]
/// for them.
pub trait ArrayElement: Pod + Send + Sync {
    /// The element type of a `Vec<Self>`.
    const TYPE: ElementType;
}

macro_rules! elements {
    ($($rust:ty => $element:ident),* $(,)?) => { $(impl ArrayElement for $rust { const TYPE: ElementType = ElementType::$element; })* };
}
elements! {
    i32 => I32, f16 => F16, f32 => F32, f64 => F64,
    [f16; 2] => Vec2h, [f32; 2] => Vec2f, [f64; 2] => Vec2d,
    [f16; 3] => Vec3h, [f32; 3] => Vec3f, [f64; 3] => Vec3d,
    [f16; 4] => Vec4h, [f32; 4] => Vec4f, [f64; 4] => Vec4d,
    [f32; 16] => Matrix4f, [f64; 16] => Matrix4d,
    [[f32; 4]; 4] => Matrix4f, [[f64; 4]; 4] => Matrix4d,
}

/// Reason why bytes are not an array of the wanted type.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ArrayError {
    /// The byte length is not a whole number of elements.
    #[error("{bytes} bytes are not a whole number of {element:?} elements of {size} bytes")]
    Length {
        /// Wanted element type.
        element: ElementType,
        /// Its size in bytes.
        size: usize,
        /// Length of the source in bytes.
        bytes: usize,
    },
}

#[derive(Debug)]
struct OwnedVec<T>(Vec<T>);

impl<T: Pod + Send + Sync + fmt::Debug> ArraySource for OwnedVec<T> {
    fn bytes(&self) -> &[u8] {
        bytemuck::cast_slice(&self.0)
    }
}

#[derive(Debug)]
struct OwnedBools(Vec<u8>);

impl ArraySource for OwnedBools {
    fn bytes(&self) -> &[u8] {
        &self.0
    }
}

/// An array of known element type, kept alive by a shared pointer to its owner. Cloning is cheap.
#[derive(Clone)]
pub struct TypedArray {
    element: ElementType,
    source: Arc<dyn ArraySource>,
}

impl fmt::Debug for TypedArray {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "TypedArray({:?} x {})", self.element, self.len())
    }
}

impl TypedArray {
    /// Wraps `source` without copying.
    ///
    /// # Errors
    /// [`ArrayError::Length`] when the byte length is not a multiple of the element size.
    pub fn new(element: ElementType, source: Arc<dyn ArraySource>) -> Result<Self, ArrayError> {
        let bytes = source.bytes().len();
        let size = element.size();
        if bytes.is_multiple_of(size) {
            Ok(Self { element, source })
        } else {
            Err(ArrayError::Length { element, size, bytes })
        }
    }

    /// Takes over a vector as an array of `element`, e.g. `[f32; 4]` as `Quatf`.
    ///
    /// # Errors
    /// As [`TypedArray::new`].
    pub fn from_vec<T: Pod + Send + Sync + fmt::Debug>(
        element: ElementType,
        values: Vec<T>,
    ) -> Result<Self, ArrayError> {
        Self::new(element, Arc::new(OwnedVec(values)))
    }

    /// Takes over a vector whose Rust type says the element type.
    #[must_use]
    pub fn of<T: ArrayElement + fmt::Debug>(values: Vec<T>) -> Self {
        Self { element: T::TYPE, source: Arc::new(OwnedVec(values)) }
    }

    /// An array of booleans (copied into bytes).
    #[must_use]
    pub fn from_bools(values: &[bool]) -> Self {
        Self { element: ElementType::Bool, source: Arc::new(OwnedBools(values.iter().map(|&b| u8::from(b)).collect())) }
    }

    /// Type of one element.
    #[must_use]
    pub fn element(&self) -> ElementType {
        self.element
    }

    /// Number of elements.
    #[must_use]
    pub fn len(&self) -> usize {
        self.source.bytes().len() / self.element.size()
    }

    /// Returns true if there is no element.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.source.bytes().is_empty()
    }

    /// Address and length in bytes. Two arrays that are both alive and have the same identity hold the same data.
    #[must_use]
    pub fn identity(&self) -> (usize, usize) {
        let bytes = self.source.bytes();
        (bytes.as_ptr() as usize, bytes.len())
    }

    /// Returns true if both have the same element type and the same bytes; O(1) if the identity is the same.
    #[must_use]
    pub fn same_contents(&self, other: &Self) -> bool {
        self.element == other.element
            && (self.identity() == other.identity() || are_same(self.source.bytes(), other.source.bytes()))
    }

    /// As [`Self::same_contents`], of arrays that may be absent.
    pub(crate) fn same_optional(a: Option<&Self>, b: Option<&Self>) -> bool {
        match (a, b) {
            (None, None) => true,
            (Some(a), Some(b)) => a.same_contents(b),
            _ => false,
        }
    }

    /// The bytes and the element type, for loops that read many elements.
    #[must_use]
    pub fn view(&self) -> ArrayView<'_> {
        ArrayView::new(self.element, self.source.bytes())
    }

    /// Element `i` as [`ArrayView::scalar`] reads it.
    #[must_use]
    pub fn scalar(&self, i: usize) -> Option<f64> {
        self.view().scalar(i)
    }

    /// Element `i` as [`ArrayView::vec3`] reads it.
    #[must_use]
    pub fn vec3(&self, i: usize) -> Option<DVec3> {
        self.view().vec3(i)
    }

    /// Element `i` as [`ArrayView::vec4`] reads it.
    #[must_use]
    pub fn vec4(&self, i: usize) -> Option<DVec4> {
        self.view().vec4(i)
    }

    /// Element `i` as [`ArrayView::quat`] reads it.
    #[must_use]
    pub fn quat(&self, i: usize) -> Option<DQuat> {
        self.view().quat(i)
    }

    /// Element `i` as [`ArrayView::matrix`] reads it.
    #[must_use]
    pub fn matrix(&self, i: usize) -> Option<DMat4> {
        self.view().matrix(i)
    }

    /// Element `i` as [`ArrayView::index`] reads it.
    #[must_use]
    pub fn index(&self, i: usize) -> Option<i32> {
        self.view().index(i)
    }

    /// Element `i` as [`ArrayView::boolean`] reads it.
    #[must_use]
    pub fn boolean(&self, i: usize) -> Option<bool> {
        self.view().boolean(i)
    }
}
