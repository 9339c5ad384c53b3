// SPDX-License-Identifier: Apache-2.0
//! What a file says of each face, and where its texels are.

use crate::format::{
    BARRIER_BYTES, BlockEncoding, ExtendedHeader, FACE_BYTES, FieldReader, HEADER_BYTES, LEVEL_BYTES, PtexHeader,
    parse_block, parse_face,
};
use crate::inflate::{FileBytes, Inflater, StoredPart, check_table};
use crate::texels::TexelLayout;
use crate::{PtexError, PtexFace};

/// What the file says of each face.
pub(crate) struct FaceTables {
    pub(crate) texel: TexelLayout,
    pub(crate) faces: Vec<PtexFace>,
    /// For each face, where its texels are.
    pub(crate) blocks: Vec<TexelBlock>,
    /// For each face, its only texel, or (of those that are not constant) the average.
    pub(crate) constants: Vec<u8>,
}

/// Texels in the file.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TexelBlock {
    pub(crate) at: u64,
    pub(crate) stored: u32,
    pub(crate) encoding: BlockEncoding,
}

impl FaceTables {
    /// Reads them as the file was first written: without edits.
    pub(crate) fn read(bytes: &FileBytes, header: &PtexHeader, parts: &FileParts) -> Result<Self, PtexError> {
        let texel = TexelLayout { data_type: header.data_type, channels: header.channels.into() };
        let count = u64::from(header.faces);
        let [face_bytes, constant_bytes] = [count * u64::from(FACE_BYTES), count * texel.bytes() as u64];
        // Before anything is inflated, so that a file that lies of the number of its faces costs nothing.
        check_table(parts.faces, face_bytes)?;
        check_table(parts.constants, constant_bytes)?;
        let mut inflater = Inflater::new();
        let blocks = read_blocks(bytes, header, parts, &mut inflater)?;
        let faces = read_faces(&inflater.table(bytes, parts.faces, face_bytes)?, header)?;
        let mut constants = inflater.table(bytes, parts.constants, constant_bytes)?;
        texel.swap_bytes(&mut constants);
        Ok(Self { texel, faces, blocks, constants })
    }

    /// A face, its block and its texel.
    pub(crate) fn face_mut(&mut self, face: u32) -> Option<(&mut PtexFace, &mut TexelBlock, &mut [u8])> {
        let face = face as usize;
        let constant = self.constants.chunks_exact_mut(self.texel.bytes()).nth(face)?;
        Some((self.faces.get_mut(face)?, self.blocks.get_mut(face)?, constant))
    }
}

/// Where the parts are.
pub(crate) struct FileParts {
    faces: StoredPart,
    constants: StoredPart,
    level_info: StoredPart,
    level_data: StoredPart,
    /// The end of all that is not edits.
    pub(crate) end: u64,
}

impl FileParts {
    pub(crate) fn new(bytes: &FileBytes, header: &PtexHeader, extended: &ExtendedHeader) -> Result<Self, PtexError> {
        let mut at = u64::from(HEADER_BYTES);
        let mut next = |name, stored| {
            let part = StoredPart { name, at, stored };
            at = at.checked_add(stored).ok_or(PtexError::Truncated(name))?;
            Ok::<_, PtexError>(part)
        };
        next("the extended header", header.extended_bytes.into())?;
        let faces = next("the table of faces", header.face_bytes.into())?;
        let constants = next("the table of constants", header.constant_bytes.into())?;
        let level_info = next("the table of levels", header.level_info_bytes.into())?;
        let level_data = next("the texels", header.level_data_bytes)?;
        for part in [faces, constants, level_info, level_data] {
            bytes.check(part)?;
        }
        next("the metadata", header.metadata_bytes.into())?;
        next("the barrier", BARRIER_BYTES.into())?;
        next("the metadata", extended.large_metadata_header_bytes.into())?;
        next("the metadata", extended.large_metadata_bytes)?;
        Ok(Self { faces, constants, level_info, level_data, end: at })
    }
}

fn read_faces(table: &[u8], header: &PtexHeader) -> Result<Vec<PtexFace>, PtexError> {
    let mut faces = reserved(header.faces)?;
    for (face, record) in (0..).zip(table.as_chunks().0) {
        faces.push(parse_face(*record, face, header)?);
    }
    Ok(faces)
}

/// Where the texels of the finest level are; the other levels are not read.
fn read_blocks(
    bytes: &FileBytes,
    header: &PtexHeader,
    parts: &FileParts,
    inflater: &mut Inflater,
) -> Result<Vec<TexelBlock>, PtexError> {
    if parts.level_info.stored < LEVEL_BYTES.into() {
        return Err(PtexError::Truncated(parts.level_info.name));
    }
    let level: [u8; LEVEL_BYTES as usize] = bytes.array(parts.level_info.name, parts.level_info.at)?;
    let mut fields = FieldReader(&level);
    let level_bytes = fields.u64();
    let words_bytes = u64::from(fields.u32());
    let faces = fields.u32();
    if faces != header.faces {
        return Err(PtexError::Header { field: "number of faces in level 0", value: faces.into() });
    }
    if level_bytes > parts.level_data.stored || words_bytes > level_bytes {
        return Err(PtexError::Truncated("level 0"));
    }
    let words = StoredPart { name: "the table of blocks", at: parts.level_data.at, stored: words_bytes };
    let table = inflater.table(bytes, words, u64::from(faces) * 4)?;
    let mut at = words.at + words_bytes;
    let end = words.at + level_bytes;
    let mut blocks = reserved(faces)?;
    for word in table.as_chunks().0 {
        let (encoding, stored) = parse_block(u32::from_le_bytes(*word));
        blocks.push(TexelBlock { at, stored, encoding });
        at = at.checked_add(stored.into()).filter(|at| *at <= end).ok_or(PtexError::Truncated("level 0"))?;
    }
    Ok(blocks)
}

/// An empty vector with space for one value a face.
fn reserved<T>(faces: u32) -> Result<Vec<T>, PtexError> {
    let mut values = Vec::new();
    let reserved = values.try_reserve_exact(faces as usize);
    reserved.map_err(|_no_memory| PtexError::OutOfMemory(u64::from(faces) * size_of::<T>() as u64))?;
    Ok(values)
}
