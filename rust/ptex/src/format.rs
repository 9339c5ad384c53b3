// SPDX-License-Identifier: Apache-2.0
//! The fixed-size records of a file: headers, faces and the words that describe blocks of texels. All little-endian and
//! packed, as the Ptex file format has them. Parsing checks each field on its own; where parts lie is checked later.

use crate::{BorderMode, DataType, MAX_CHANNELS, MAX_FACES, MAX_LOG2, MeshType, PtexError, PtexFace};

pub(crate) const MAGIC: [u8; 4] = *b"Ptex";
pub(crate) const VERSION: u32 = 1;
/// The minor version that [`crate::PtexWriter`] says. Readers do not look at it.
const MINOR_VERSION: u32 = 4;
pub(crate) const HEADER_BYTES: u32 = 64;
pub(crate) const EXTENDED_BYTES: u32 = 40;
pub(crate) const LEVEL_BYTES: u32 = 16;
pub(crate) const FACE_BYTES: u32 = 20;
/// Bytes between metadata and what newer versions added, which old readers take for the end.
pub(crate) const BARRIER_BYTES: u32 = 8;

const IS_CONSTANT: u8 = 1;
const HAS_EDITS: u8 = 2;
const IS_SUBFACE: u8 = 8;
/// Bits of a block's word that are its length; the two above are its encoding.
const LENGTH_BITS: u32 = 30;

/// Fields one after the other. A field beyond the end is zero: extended headers of old files are shorter.
pub(crate) struct FieldReader<'a>(pub(crate) &'a [u8]);

impl FieldReader<'_> {
    fn take<const N: usize>(&mut self) -> [u8; N] {
        let (field, rest) = self.0.split_first_chunk().unwrap_or((&[0; N], &[]));
        self.0 = rest;
        *field
    }

    pub(crate) fn u8(&mut self) -> u8 {
        u8::from_le_bytes(self.take())
    }

    pub(crate) fn u16(&mut self) -> u16 {
        u16::from_le_bytes(self.take())
    }

    pub(crate) fn u32(&mut self) -> u32 {
        u32::from_le_bytes(self.take())
    }

    pub(crate) fn u64(&mut self) -> u64 {
        u64::from_le_bytes(self.take())
    }
}

/// What all files begin with. Lengths are of parts as they are stored, bytes.
#[derive(Clone, Debug)]
pub(crate) struct PtexHeader {
    pub(crate) mesh_type: MeshType,
    pub(crate) data_type: DataType,
    pub(crate) alpha_channel: Option<u32>,
    pub(crate) channels: u16,
    pub(crate) levels: u16,
    pub(crate) faces: u32,
    pub(crate) extended_bytes: u32,
    pub(crate) face_bytes: u32,
    pub(crate) constant_bytes: u32,
    pub(crate) level_info_bytes: u32,
    pub(crate) level_data_bytes: u64,
    pub(crate) metadata_bytes: u32,
}

impl PtexHeader {
    pub(crate) fn parse(bytes: &[u8; HEADER_BYTES as usize]) -> Result<Self, PtexError> {
        let mut fields = FieldReader(bytes);
        if fields.take() != MAGIC {
            return Err(PtexError::Magic);
        }
        let version = fields.u32();
        if version != VERSION {
            return Err(PtexError::Version(version));
        }
        let mesh_type = mesh_type(fields.u32())?;
        let data_type = data_type(fields.u32())?;
        let alpha = fields.u32();
        let channels = fields.u16();
        if channels == 0 || u32::from(channels) > MAX_CHANNELS {
            return Err(PtexError::Header { field: "number of channels", value: channels.into() });
        }
        let levels = fields.u16();
        if levels == 0 {
            return Err(PtexError::Header { field: "number of levels", value: 0 });
        }
        let faces = fields.u32();
        if faces == 0 || faces > MAX_FACES {
            return Err(PtexError::Header { field: "number of faces", value: faces.into() });
        }
        let extended_bytes = fields.u32();
        let face_bytes = fields.u32();
        let constant_bytes = fields.u32();
        let level_info_bytes = fields.u32();
        let _minor_version = fields.u32();
        let level_data_bytes = fields.u64();
        let metadata_bytes = fields.u32();
        Ok(Self {
            mesh_type,
            data_type,
            // -1 is none; so is what the texels do not have.
            alpha_channel: (alpha < u32::from(channels)).then_some(alpha),
            channels,
            levels,
            faces,
            extended_bytes,
            face_bytes,
            constant_bytes,
            level_info_bytes,
            level_data_bytes,
            metadata_bytes,
        })
    }

    /// The header without metadata and edits.
    pub(crate) fn to_bytes(&self) -> Vec<u8> {
        let mesh_type: u32 = match self.mesh_type {
            MeshType::Triangle => 0,
            MeshType::Quad => 1,
        };
        let data_type: u32 = match self.data_type {
            DataType::U8 => 0,
            DataType::U16 => 1,
            DataType::F16 => 2,
            DataType::F32 => 3,
        };
        let mut bytes = MAGIC.to_vec();
        for field in [VERSION, mesh_type, data_type, self.alpha_channel.unwrap_or(u32::MAX)] {
            bytes.extend(field.to_le_bytes());
        }
        bytes.extend(self.channels.to_le_bytes());
        bytes.extend(self.levels.to_le_bytes());
        let lengths = [self.extended_bytes, self.face_bytes, self.constant_bytes, self.level_info_bytes];
        for field in [self.faces].into_iter().chain(lengths).chain([MINOR_VERSION]) {
            bytes.extend(field.to_le_bytes());
        }
        bytes.extend(self.level_data_bytes.to_le_bytes());
        bytes.resize(HEADER_BYTES as usize, 0);
        bytes
    }
}

fn mesh_type(value: u32) -> Result<MeshType, PtexError> {
    match value {
        0 => Ok(MeshType::Triangle),
        1 => Ok(MeshType::Quad),
        _ => Err(PtexError::Header { field: "type of mesh", value: value.into() }),
    }
}

fn data_type(value: u32) -> Result<DataType, PtexError> {
    match value {
        0 => Ok(DataType::U8),
        1 => Ok(DataType::U16),
        2 => Ok(DataType::F16),
        3 => Ok(DataType::F32),
        _ => Err(PtexError::Header { field: "type of data", value: value.into() }),
    }
}

/// What follows the header, in all but the oldest files.
#[derive(Clone, Debug)]
pub(crate) struct ExtendedHeader {
    pub(crate) border_modes: [BorderMode; 2],
    pub(crate) large_metadata_header_bytes: u32,
    pub(crate) large_metadata_bytes: u64,
    pub(crate) edit_bytes: u64,
    /// Where edits begin; 0 in files of before this was said.
    pub(crate) edits_at: u64,
}

impl ExtendedHeader {
    pub(crate) fn parse(bytes: &[u8]) -> Result<Self, PtexError> {
        let mut fields = FieldReader(bytes);
        let border_u = border_mode(fields.u16())?;
        let _padding = fields.u16();
        let border_v = border_mode(fields.u16())?;
        let _edge_filter_mode = fields.u16();
        let large_metadata_header_bytes = fields.u32();
        let _large_metadata_header_inflated = fields.u32();
        let large_metadata_bytes = fields.u64();
        let edit_bytes = fields.u64();
        let edits_at = fields.u64();
        let border_modes = [border_u, border_v];
        Ok(Self { border_modes, large_metadata_header_bytes, large_metadata_bytes, edit_bytes, edits_at })
    }

    /// The extended header of a file without metadata and edits, of `edits_at` bytes.
    pub(crate) fn new_bytes(border_modes: [BorderMode; 2], edits_at: u64) -> Vec<u8> {
        let [border_u, border_v] = border_modes.map(|mode| match mode {
            BorderMode::Clamp => 0_u16,
            BorderMode::Black => 1,
            BorderMode::Periodic => 2,
        });
        let mut bytes: Vec<u8> = [border_u, 0, border_v, 0].into_iter().flat_map(u16::to_le_bytes).collect();
        bytes.resize(EXTENDED_BYTES as usize - size_of::<u64>(), 0);
        bytes.extend(edits_at.to_le_bytes());
        bytes
    }
}

fn border_mode(value: u16) -> Result<BorderMode, PtexError> {
    match value {
        0 => Ok(BorderMode::Clamp),
        1 => Ok(BorderMode::Black),
        2 => Ok(BorderMode::Periodic),
        _ => Err(PtexError::Header { field: "border mode", value: value.into() }),
    }
}

/// Face number `face` of a mesh of `faces`.
pub(crate) fn parse_face(
    record: [u8; FACE_BYTES as usize],
    face: u32,
    header: &PtexHeader,
) -> Result<PtexFace, PtexError> {
    let mut fields = FieldReader(&record);
    let log2 = [fields.u8(), fields.u8()];
    if log2.iter().any(|log2| *log2 > MAX_LOG2) {
        return Err(PtexError::Resolution { face, log2: log2.map(u8::cast_signed) });
    }
    let edges = fields.u8();
    let flags = fields.u8();
    let sides = match header.mesh_type {
        MeshType::Triangle => 3,
        MeshType::Quad => 4,
    };
    let mut adjacent = [None; 4];
    for (side, adjacent) in adjacent.iter_mut().enumerate().take(sides) {
        // -1 is none; so is what the mesh does not have.
        let face = fields.u32();
        let edge = (edges >> (2 * side)) & 3;
        *adjacent = (face < header.faces && usize::from(edge) < sides).then_some((face, edge));
    }
    Ok(PtexFace {
        log2,
        adjacent,
        // Readers take the one texel of a face from the same table as those of constant faces.
        is_constant: flags & IS_CONSTANT != 0 || log2 == [0, 0],
        is_subface: flags & IS_SUBFACE != 0,
        has_edits: flags & HAS_EDITS != 0,
    })
}

/// The record of a face that has no edits.
pub(crate) fn face_record(face: &PtexFace) -> [u8; FACE_BYTES as usize] {
    let mut edges = 0;
    let mut faces = [u32::MAX; 4];
    for (side, (adjacent, number)) in face.adjacent.iter().zip(&mut faces).enumerate() {
        if let Some((face, edge)) = adjacent {
            edges |= (edge & 3) << (2 * side);
            *number = *face;
        }
    }
    let flags = [(face.is_constant, IS_CONSTANT), (face.is_subface, IS_SUBFACE)];
    let flags = flags.iter().filter(|(is_set, _)| *is_set).fold(0, |flags, (_, flag)| flags | flag);
    let mut record = [0; FACE_BYTES as usize];
    let bytes = face.log2.into_iter().chain([edges, flags]).chain(faces.into_iter().flat_map(u32::to_le_bytes));
    record.iter_mut().zip(bytes).for_each(|(to, from)| *to = from);
    record
}

/// How a block holds its texels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum BlockEncoding {
    /// One texel for all.
    Constant,
    /// Planes of channels, compressed.
    Zipped,
    /// The same, each value less the one before it.
    DiffZipped,
    /// Blocks of rectangles.
    Tiled,
}

/// Splits a block's word into how it is encoded and its length in the file, bytes.
pub(crate) fn parse_block(word: u32) -> (BlockEncoding, u32) {
    let encoding = match word >> LENGTH_BITS {
        0 => BlockEncoding::Constant,
        1 => BlockEncoding::Zipped,
        2 => BlockEncoding::DiffZipped,
        _ => BlockEncoding::Tiled,
    };
    (encoding, word & ((1 << LENGTH_BITS) - 1))
}

/// The word of a block of less than 1 GiB.
pub(crate) fn block_word(encoding: BlockEncoding, bytes: usize) -> Result<u32, PtexError> {
    let number = match encoding {
        BlockEncoding::Constant => 0,
        BlockEncoding::Zipped => 1,
        BlockEncoding::DiffZipped => 2,
        BlockEncoding::Tiled => 3,
    };
    let bytes = u32::try_from(bytes).ok().filter(|bytes| bytes >> LENGTH_BITS == 0);
    bytes.map(|bytes| bytes | number << LENGTH_BITS).ok_or(PtexError::Caller("a face of 1 GiB once compressed"))
}
