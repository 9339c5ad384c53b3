// SPDX-License-Identifier: Apache-2.0
//! An open file: its header, its tables with the edits applied.

use crate::edits;
use crate::format::{EXTENDED_BYTES, ExtendedHeader, HEADER_BYTES, PtexHeader};
use crate::inflate::FileBytes;
use crate::tables::{FaceTables, FileParts};
use crate::{BorderMode, DataType, MeshType, PtexError, PtexFace, ReadAt};

/// An open Ptex file. Immutable; any number of threads may use it at once. It keeps the table of faces and one texel
/// for each, about 80 bytes a face, and no others.
pub struct PtexFile {
    pub(crate) bytes: FileBytes,
    mesh_type: MeshType,
    channels: u32,
    alpha_channel: Option<u32>,
    border_modes: [BorderMode; 2],
    pub(crate) tables: FaceTables,
}

impl std::fmt::Debug for PtexFile {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { mesh_type, channels, tables, .. } = self;
        let mut shown = f.debug_struct("PtexFile");
        shown.field("mesh_type", mesh_type).field("data_type", &tables.texel.data_type).field("channels", channels);
        shown.field("faces", &tables.faces.len()).finish_non_exhaustive()
    }
}

impl PtexFile {
    /// Reads the header and the tables of faces, applies the edits, and checks that all of it lies inside the file.
    /// Texels are not inflated, so their damage shows only in [`Self::read_face`].
    pub fn open(source: Box<dyn ReadAt>) -> Result<Self, PtexError> {
        let bytes = FileBytes::new(source);
        let header = PtexHeader::parse(&bytes.array("the header", 0)?)?;
        let mut extended = [0; EXTENDED_BYTES as usize];
        let stored = extended.len().min(header.extended_bytes as usize);
        bytes.fill("the extended header", HEADER_BYTES.into(), extended.get_mut(..stored).unwrap_or_default())?;
        let extended = ExtendedHeader::parse(&extended)?;
        let parts = FileParts::new(&bytes, &header, &extended)?;
        let mut tables = FaceTables::read(&bytes, &header, &parts)?;
        edits::apply(&bytes, &header, &extended, parts.end, &mut tables)?;
        Ok(Self {
            bytes,
            mesh_type: header.mesh_type,
            channels: header.channels.into(),
            alpha_channel: header.alpha_channel,
            border_modes: extended.border_modes,
            tables,
        })
    }

    /// What the faces are.
    pub fn mesh_type(&self) -> MeshType {
        self.mesh_type
    }

    /// What the channels are.
    pub fn data_type(&self) -> DataType {
        self.tables.texel.data_type
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

    /// All faces, in the order of the mesh (see the [crate] documentation).
    pub fn faces(&self) -> &[PtexFace] {
        &self.tables.faces
    }

    /// Bytes of a texel.
    pub fn texel_bytes(&self) -> usize {
        self.tables.texel.bytes()
    }
}
