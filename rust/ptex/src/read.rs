// SPDX-License-Identifier: Apache-2.0
//! Reading the texels of a face. Each call reads the file anew and keeps nothing.

use crate::file::PtexFile;
use crate::format::{BlockEncoding, FieldReader, parse_block};
use crate::inflate::{Inflater, StoredPart, check_ratio, resize};
use crate::tables::TexelBlock;
use crate::texels::{FaceRect, undo_differences};
use crate::{MAX_BYTES, PtexError, PtexFace};

const TEXELS: &str = "the face";
/// Logarithms of the resolution of tiles along u and v, then the length of their table.
const TILES_HEADER_BYTES: u32 = 2 + 4;

/// How a face is cut.
struct FaceTiles {
    log2: [u8; 2],
    /// One for each tile, rows of increasing v, u fastest.
    blocks: Vec<TexelBlock>,
}

impl PtexFile {
    /// The texel of a constant face, values in the byte order of this machine. `None` for other faces, and where there
    /// is no such face.
    ///
    /// Ask this first: a constant face may claim the largest resolution and be a few bytes in the file, and
    /// [`Self::read_face`] writes all of its texels.
    pub fn constant(&self, face: u32) -> Option<&[u8]> {
        let tables = &self.tables;
        tables.faces.get(face as usize).filter(|face| face.is_constant)?;
        tables.constants.chunks_exact(tables.texel.bytes()).nth(face as usize)
    }

    /// Bytes that [`Self::read_face`] will give.
    pub fn face_bytes(&self, face: u32) -> Result<u64, PtexError> {
        let log2 = self.face(face)?.log2;
        let bytes = (self.texel_bytes() as u64) << (u32::from(log2[0]) + u32::from(log2[1]));
        if bytes > MAX_BYTES {
            return Err(PtexError::TooLarge { part: TEXELS, bytes });
        }
        Ok(bytes)
    }

    /// Replaces `out` by the texels of a face at its full resolution: rows of increasing v, u fastest, the channels of
    /// a texel together, values in the byte order of this machine. After an error `out` may hold anything, but never
    /// more than [`Self::face_bytes`].
    ///
    /// A constant face has the resolution that the file says, with one texel everywhere. Faces of triangle meshes are
    /// given as squares (see the [crate] documentation).
    ///
    /// Nothing is allocated before the lengths in the file are known to be possible. A face in one piece needs as much
    /// memory once more while it is read; one in tiles needs that of a tile.
    pub fn read_face(&self, face: u32, out: &mut Vec<u8>) -> Result<(), PtexError> {
        out.clear();
        let bytes = self.face_bytes(face)?;
        let whole = whole(self.face(face)?);
        if let Some(texel) = self.constant(face) {
            resize(out, bytes)?;
            self.tables.texel.fill(texel, whole, out);
            return Ok(());
        }
        let block = *self.tables.blocks.get(face as usize).ok_or(PtexError::NoFace(face))?;
        let mut reading = FaceReader { file: self, inflater: Inflater::new(), planes: Vec::new() };
        if block.encoding != BlockEncoding::Tiled {
            reading.check(block, bytes)?;
            resize(out, bytes)?;
            return reading.block(block, whole, out);
        }
        let tiles = reading.tiles(block, self.face(face)?.log2)?;
        let size = tiles.log2.map(|log2| 1 << log2);
        let tile_bytes = (size[0] * size[1] * self.texel_bytes()) as u64;
        for tile in &tiles.blocks {
            reading.check(*tile, tile_bytes)?;
        }
        resize(out, bytes)?;
        let columns = whole.face_width >> tiles.log2[0];
        for (number, tile) in tiles.blocks.iter().enumerate() {
            let at = [number % columns.max(1) * size[0], number / columns.max(1) * size[1]];
            reading.block(*tile, FaceRect { at, size, ..whole }, out)?;
        }
        Ok(())
    }

    fn face(&self, face: u32) -> Result<&PtexFace, PtexError> {
        self.tables.faces.get(face as usize).ok_or(PtexError::NoFace(face))
    }
}

fn whole(face: &PtexFace) -> FaceRect {
    let size = face.log2.map(|log2| 1_usize << log2);
    FaceRect { at: [0; 2], size, face_width: size[0] }
}

struct FaceReader<'a> {
    file: &'a PtexFile,
    inflater: Inflater,
    /// Texels of a block before their channels come together.
    planes: Vec<u8>,
}

impl FaceReader<'_> {
    /// Fails if a block cannot hold `bytes` bytes of texels.
    fn check(&self, block: TexelBlock, bytes: u64) -> Result<(), PtexError> {
        match block.encoding {
            BlockEncoding::Constant if (block.stored as usize) < self.file.texel_bytes() => {
                Err(PtexError::Truncated("a texel"))
            }
            BlockEncoding::Constant => Ok(()),
            BlockEncoding::Zipped | BlockEncoding::DiffZipped => check_ratio(part(block), bytes),
            // A tile is not cut into tiles.
            BlockEncoding::Tiled => Err(PtexError::Damaged("the table of tiles")),
        }
    }

    /// Reads a block that has been checked to a rectangle of `out`.
    fn block(&mut self, block: TexelBlock, rect: FaceRect, out: &mut [u8]) -> Result<(), PtexError> {
        let texel = self.file.tables.texel;
        let bytes = &self.file.bytes;
        if block.encoding == BlockEncoding::Constant {
            resize(&mut self.planes, texel.bytes() as u64)?;
            bytes.fill("a texel", block.at, &mut self.planes)?;
            texel.swap_bytes(&mut self.planes);
            texel.fill(&self.planes, rect, out);
            return Ok(());
        }
        resize(&mut self.planes, (rect.size[0] * rect.size[1] * texel.bytes()) as u64)?;
        self.inflater.fill(bytes, part(block), &mut self.planes)?;
        if block.encoding == BlockEncoding::DiffZipped {
            undo_differences(&mut self.planes, texel.data_type);
        }
        texel.place(&self.planes, rect, out);
        Ok(())
    }

    /// Reads where the tiles of a face of `log2` are.
    fn tiles(&mut self, block: TexelBlock, log2: [u8; 2]) -> Result<FaceTiles, PtexError> {
        let cut_short = PtexError::Truncated("the table of tiles");
        let Some(left) = block.stored.checked_sub(TILES_HEADER_BYTES) else { return Err(cut_short) };
        let bytes: [u8; TILES_HEADER_BYTES as usize] = self.file.bytes.array("the table of tiles", block.at)?;
        let mut fields = FieldReader(&bytes);
        let tile_log2 = [fields.u8(), fields.u8()];
        let table_bytes = fields.u32();
        let (Some(u), Some(v)) = (log2[0].checked_sub(tile_log2[0]), log2[1].checked_sub(tile_log2[1])) else {
            return Err(PtexError::Damaged("the table of tiles"));
        };
        // No tile is stored in less than a byte: this keeps a small table from asking for many of them.
        let count = 1_u32 << (u + v);
        if left.checked_sub(table_bytes).is_none_or(|left| left < count) {
            return Err(cut_short);
        }
        let at = block.at + u64::from(TILES_HEADER_BYTES);
        let table = StoredPart { name: "the table of tiles", at, stored: table_bytes.into() };
        let words = self.inflater.table(&self.file.bytes, table, u64::from(count) * 4)?;
        let mut at = table.at + table.stored;
        let end = block.at + u64::from(block.stored);
        let mut blocks = Vec::new();
        let needed = u64::from(count) * size_of::<TexelBlock>() as u64;
        blocks.try_reserve_exact(count as usize).map_err(|_no_memory| PtexError::OutOfMemory(needed))?;
        for word in words.as_chunks().0 {
            let (encoding, stored) = parse_block(u32::from_le_bytes(*word));
            blocks.push(TexelBlock { at, stored, encoding });
            at = at.checked_add(stored.into()).filter(|at| *at <= end).ok_or(PtexError::Truncated("a tile"))?;
        }
        Ok(FaceTiles { log2: tile_log2, blocks })
    }
}

fn part(block: TexelBlock) -> StoredPart {
    StoredPart { name: TEXELS, at: block.at, stored: block.stored.into() }
}
