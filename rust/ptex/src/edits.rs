// SPDX-License-Identifier: Apache-2.0
//! Edits: blocks appended to a file that replace faces (or metadata, which this crate does not read). A later edit of a
//! face replaces an earlier one.

use crate::format::{BlockEncoding, ExtendedHeader, FACE_BYTES, FieldReader, PtexHeader, parse_block, parse_face};
use crate::inflate::FileBytes;
use crate::tables::{FaceTables, TexelBlock};
use crate::{MAX_EDITS, PtexError};

/// Bytes of an edit's header: kind (1 byte) and length of the rest (4 bytes).
const EDIT_HEADER_BYTES: u32 = 5;
const FACE_EDIT: u8 = 0;
/// Bytes of a face edit: number of the face, its record, and the word of its block.
const FACE_EDIT_BYTES: u32 = 4 + FACE_BYTES + 4;

/// Applies all edits. They begin where the extended header says or, in older files, at `start`.
///
/// The writer of Ptex 2.4.3 leaves out the barrier (8 bytes) when there is no metadata, but its reader skips it all the
/// same, and so misses the edits that the writer appends there. The value in the header is right.
pub(crate) fn apply(
    file: &FileBytes,
    header: &PtexHeader,
    extended: &ExtendedHeader,
    start: u64,
    tables: &mut FaceTables,
) -> Result<(), PtexError> {
    let (mut at, end) = match (extended.edits_at, extended.edit_bytes) {
        // Up to the end, or to the first edit without a length.
        (0, _) => (start, Some(file.size())),
        (_, 0) => return Ok(()),
        (at, bytes) => (at, at.checked_add(bytes)),
    };
    let end = end.filter(|end| *end <= file.size()).ok_or(PtexError::Truncated("the edits"))?;
    let mut edits = 0;
    while end.saturating_sub(at) >= EDIT_HEADER_BYTES.into() {
        let edit: [u8; EDIT_HEADER_BYTES as usize] = file.array("an edit", at)?;
        let mut fields = FieldReader(&edit);
        let kind = fields.u8();
        let bytes = u64::from(fields.u32());
        if bytes == 0 {
            return Ok(());
        }
        if edits == MAX_EDITS {
            return Err(PtexError::DamagedEdit(at));
        }
        edits += 1;
        let data_at = at + u64::from(EDIT_HEADER_BYTES);
        let next = data_at.checked_add(bytes).filter(|next| *next <= end).ok_or(PtexError::DamagedEdit(at))?;
        if kind == FACE_EDIT {
            replace_face(file, header, data_at..next, tables)?.ok_or(PtexError::DamagedEdit(at))?;
        }
        at = next;
    }
    Ok(())
}

/// Replaces one face. `None` if its edit is too short or there is no such face.
fn replace_face(
    file: &FileBytes,
    header: &PtexHeader,
    edit: std::ops::Range<u64>,
    tables: &mut FaceTables,
) -> Result<Option<()>, PtexError> {
    let mut texel = vec![0; tables.texel.bytes()];
    let texel_at = edit.start + u64::from(FACE_EDIT_BYTES);
    let texels_at = texel_at + texel.len() as u64;
    let Some(left) = edit.end.checked_sub(texels_at) else { return Ok(None) };
    let [n0, n1, n2, n3, record_and_word @ ..]: [u8; FACE_EDIT_BYTES as usize] = file.array("an edit", edit.start)?;
    let number = u32::from_le_bytes([n0, n1, n2, n3]);
    let (Some(record), Some(word)) = (record_and_word.first_chunk(), record_and_word.last_chunk()) else {
        return Ok(None);
    };
    let (encoding, bytes) = parse_block(u32::from_le_bytes(*word));
    file.fill("an edit", texel_at, &mut texel)?;
    tables.texel.swap_bytes(&mut texel);
    let Some((face, block, constant)) = tables.face_mut(number) else { return Ok(None) };
    *face = parse_face(*record, number, header)?;
    face.has_edits = true;
    // The words of constant faces have no meaning.
    let stored = if face.is_constant { 0 } else { bytes };
    if u64::from(stored) > left {
        return Ok(None);
    }
    *block = TexelBlock {
        at: texels_at,
        stored,
        encoding: if face.is_constant { BlockEncoding::Constant } else { encoding },
    };
    constant.copy_from_slice(&texel);
    Ok(Some(()))
}
