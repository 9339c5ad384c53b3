// SPDX-License-Identifier: Apache-2.0
//! Surface attributes in the order the GPU reads them.

/// How values are found from a hit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum AttributeRate {
    /// `values[0]`.
    Constant,
    /// `values[triangle]`, triangles in BVH order.
    Uniform,
    /// Interpolated `values[corner_indices[triangle][corner]]`.
    Vertex,
    /// Interpolated `values[triangle * 3 + corner]`, triangles in BVH order.
    FaceVarying,
}

/// Values and their rate; the length always fits the rate.
#[derive(Clone, Debug, PartialEq)]
pub struct Attribute<T> {
    /// How to index `values`.
    pub rate: AttributeRate,
    /// The values.
    pub values: Vec<T>,
}
