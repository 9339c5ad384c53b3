// SPDX-License-Identifier: Apache-2.0
//! Reads primvars at the vertices of a mesh that was cut. Pure.

use crate::array::{ArrayView, ElementType, TypedArray};
use crate::desc::{Interpolation, MeshDesc};

/// Values of a primvar of a mesh that was cut.
#[derive(Clone, Copy)]
pub(super) struct CutValues<'a> {
    interpolation: Interpolation,
    values: ArrayView<'a>,
    indices: Option<ArrayView<'a>>,
}

impl<'a> CutValues<'a> {
    /// The primvar `name`, if it can be read.
    pub(super) fn of(desc: &'a MeshDesc, name: &str) -> Option<Self> {
        let primvar = desc.authored_primvar(name)?;
        let indices = primvar.indices.as_ref().map(TypedArray::view);
        let is_usable = indices.is_none_or(|indices| indices.is_empty() || indices.element() == ElementType::I32);
        let values = primvar.values.view();
        is_usable.then_some(Self { interpolation: primvar.interpolation, values, indices })
    }

    fn position(&self, face: u32, vertex: u32) -> Option<usize> {
        let at = match self.interpolation {
            Interpolation::Constant => 0,
            Interpolation::Uniform => face as usize,
            Interpolation::Varying | Interpolation::Vertex => vertex as usize,
            Interpolation::FaceVarying | Interpolation::Instance => return None,
        };
        match self.indices {
            Some(indices) => usize::try_from(indices.index(at)?).ok(),
            None => Some(at),
        }
    }

    /// A value of two components, as texture coordinates.
    pub(super) fn pair(&self, face: u32, vertex: u32) -> Option<[f64; 2]> {
        let at = self.position(face, vertex)?;
        let three = || self.values.vec3(at).map(|v| [v.x, v.y]);
        self.values.vec2(at).map(|v| v.to_array()).or_else(three)
    }

    /// A scalar value.
    pub(super) fn number(&self, face: u32, vertex: u32) -> Option<f64> {
        self.values.scalar(self.position(face, vertex)?)
    }

    /// A value of three components.
    pub(super) fn vector(&self, face: u32, vertex: u32) -> Option<glam::DVec3> {
        self.values.vec3(self.position(face, vertex)?)
    }

    /// A value of any width, as programs read it: a scalar is in all components, else missing components are 0, and the
    /// last one is 1.
    pub(super) fn four(&self, face: u32, vertex: u32) -> Option<[f64; 4]> {
        let at = self.position(face, vertex)?;
        let values = &self.values;
        let three = || values.vec3(at).map(|v| [v.x, v.y, v.z, 1.0]);
        let two = || values.vec2(at).map(|v| [v.x, v.y, 0.0, 1.0]);
        let one = || values.scalar(at).map(|v| [v; 4]);
        values.vec4(at).map(|v| v.to_array()).or_else(three).or_else(two).or_else(one)
    }
}
