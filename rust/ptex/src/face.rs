// SPDX-License-Identifier: Apache-2.0
//! What the header of a file says: kinds of meshes, values and borders, and the faces.

/// What all faces of the mesh are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum MeshType {
    /// Triangles, each a square image cut into "even" and "odd" texels (see the [crate] documentation).
    Triangle,
    /// Quads, and other polygons as one quad per corner.
    Quad,
}

/// What each channel of a texel is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum DataType {
    /// Unsigned, 255 is one.
    U8,
    /// Unsigned, 65535 is one.
    U16,
    /// IEEE 754 half precision.
    F16,
    /// IEEE 754 single precision.
    F32,
}

impl DataType {
    /// Bytes of a value.
    pub fn bytes(self) -> usize {
        match self {
            Self::U8 => 1,
            Self::U16 | Self::F16 => 2,
            Self::F32 => 4,
        }
    }
}

/// What lies beyond an edge that has no neighbour, for filters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum BorderMode {
    /// The texels at the edge, on and on.
    Clamp,
    /// Zeros.
    Black,
    /// The texels of the opposite edge of the same face.
    Periodic,
}

/// One face: its size and its neighbours. Edges are 0 bottom (v = 0), 1 right (u = 1), 2 top (v = 1), 3 left (u = 0),
/// each walked counter-clockwise.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct PtexFace {
    /// Logarithms of base 2 of the texels along u and v.
    pub log2: [u8; 2],
    /// The face beyond each edge, and which edge of that face it is; `None` at the border of the mesh, and where the
    /// file names a face or an edge that is none.
    pub adjacent: [Option<(u32, u8)>; 4],
    /// Whether all texels are equal and only one is stored.
    pub is_constant: bool,
    /// Whether it is the quad at a corner of a polygon that is not a quad.
    pub is_subface: bool,
    /// Whether an edit block at the end of the file has replaced it.
    pub has_edits: bool,
}

impl PtexFace {
    /// A face without neighbours, of `1 << log2` texels along u and v.
    pub fn new(log2: [u8; 2]) -> Self {
        Self { log2, adjacent: [None; 4], is_constant: false, is_subface: false, has_edits: false }
    }

    /// Texels along u and v. `None` for a resolution that no face has (see [`crate::MAX_LOG2`]).
    pub fn size(&self) -> Option<[u32; 2]> {
        self.log2.iter().all(|log2| *log2 <= crate::MAX_LOG2).then(|| self.log2.map(|log2| 1 << log2))
    }
}
