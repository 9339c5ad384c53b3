// SPDX-License-Identifier: Apache-2.0
//! Writes film files.

use super::{
    BLOCK_HEAD, BlockHead, CHUNK_HEAD, END, FIXED_HEADER, LONGEST_HEADER, MAGIC, MAX_BLOCKS, MAX_CHUNK, VERSION,
    checksum, header_hash, name_bytes, packing, seed,
};
use crate::error::FilmError;
use crate::header::FilmHeader;
use std::fs::File;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// Writes the blocks of a film file ([`write_film`]).
#[derive(Debug)]
pub struct FilmWriter {
    path: PathBuf,
    file: BufWriter<File>,
    hash: u128,
    /// Bytes written.
    position: u64,
    blocks: usize,
    /// The block that is being written, and the place of its head.
    open: Option<(BlockHead, u64)>,
}

/// A chunk ready to be written.
#[derive(Debug)]
pub(crate) struct WrittenChunk {
    raw: u32,
    bytes: Vec<u8>,
}

/// Packs a chunk of at most [`MAX_CHUNK`] bytes for a block of this stride.
pub(crate) fn packed(raw: &[u8], stride: usize) -> WrittenChunk {
    WrittenChunk { raw: u32::try_from(raw.len()).unwrap_or(u32::MAX), bytes: packing::pack(raw, stride) }
}

/// Writes a whole film file: `blocks` puts its blocks. Readers see the old file or the new one, which is on the disk by
/// then.
///
/// # Errors
/// [`FilmError::File`], or what `blocks` returns.
pub fn write_film(
    path: &Path,
    header: &FilmHeader,
    blocks: impl FnOnce(&mut FilmWriter) -> Result<(), FilmError>,
) -> Result<(), FilmError> {
    let mut done = Ok(());
    let written = oocpt_files::replace_by(path, |file| {
        done = FilmWriter::begin(path, file, header).and_then(|mut writer| {
            blocks(&mut writer)?;
            writer.finish()
        });
        // The error itself is in `done`.
        done.as_ref().map_err(|error| io::Error::other(error.to_string())).copied()
    });
    done?;
    written.map_err(FilmError::file(path))
}

impl FilmWriter {
    fn begin(path: &Path, file: File, header: &FilmHeader) -> Result<Self, FilmError> {
        let text = serde_json::to_vec(header).map_err(|error| FilmError::unfit(error.to_string()))?;
        let length = u32::try_from(text.len()).ok().filter(|length| *length <= LONGEST_HEADER);
        let length = length.ok_or_else(|| FilmError::unfit("its header is too long"))?;
        let mut fixed = [0; FIXED_HEADER];
        fixed[..8].copy_from_slice(&MAGIC);
        fixed[8..12].copy_from_slice(&VERSION.to_le_bytes());
        fixed[12..16].copy_from_slice(&length.to_le_bytes());
        let hash = header_hash(&fixed[..16], &text);
        fixed[16..].copy_from_slice(&hash.to_le_bytes());
        let file = BufWriter::new(file);
        let mut writer = Self { path: path.to_owned(), file, hash, position: 0, blocks: 0, open: None };
        writer.put(&fixed)?;
        writer.put(&text)?;
        Ok(writer)
    }

    fn put(&mut self, bytes: &[u8]) -> Result<(), FilmError> {
        self.file.write_all(bytes).map_err(FilmError::file(&self.path))?;
        self.position += bytes.len() as u64;
        Ok(())
    }

    /// Puts a block of bytes with a name of at most 16 ASCII letters, which no other block has.
    ///
    /// # Errors
    /// [`FilmError::File`]; [`FilmError::Unfit`]: the name is too long, or there are too many blocks.
    pub fn block(&mut self, name: &str, bytes: &[u8]) -> Result<(), FilmError> {
        self.begin_block(name, 1)?;
        bytes.chunks(MAX_CHUNK).try_for_each(|chunk| self.chunk(&packed(chunk, 1)))?;
        self.end_block()
    }

    /// Begins a block of chunks, packed with this stride.
    pub(crate) fn begin_block(&mut self, name: &str, stride: u32) -> Result<(), FilmError> {
        let name = name_bytes(name).filter(|_| self.blocks < MAX_BLOCKS);
        let name = name.ok_or_else(|| FilmError::unfit("a block too much, or a name too long"))?;
        self.blocks += 1;
        self.open = Some((BlockHead { name, packed: 0, raw: 0, stride }, self.position));
        self.put(&[0; BLOCK_HEAD])
    }

    /// Puts a chunk into the block that was begun.
    pub(crate) fn chunk(&mut self, chunk: &WrittenChunk) -> Result<(), FilmError> {
        let WrittenChunk { raw, bytes } = chunk;
        let packed = u32::try_from(bytes.len()).map_err(|_too_long| FilmError::unfit("a chunk is too long"))?;
        let mut head = [0; CHUNK_HEAD];
        head[..4].copy_from_slice(&raw.to_le_bytes());
        head[4..8].copy_from_slice(&packed.to_le_bytes());
        let sum = checksum(seed(self.hash, self.position), &[&head[..8], bytes]);
        head[8..].copy_from_slice(&sum.to_le_bytes());
        if let Some((block, _)) = &mut self.open {
            block.raw += u64::from(*raw);
            block.packed += u64::from(packed) + CHUNK_HEAD as u64;
        }
        self.put(&head)?;
        self.put(bytes)
    }

    /// Ends the block: its head is written now that its length is known.
    pub(crate) fn end_block(&mut self) -> Result<(), FilmError> {
        let Some((head, place)) = self.open.take() else { return Ok(()) };
        let bytes = head.encode(seed(self.hash, place));
        let end = self.position;
        let mut patch = || {
            self.file.seek(SeekFrom::Start(place))?;
            self.file.write_all(&bytes)?;
            self.file.seek(SeekFrom::Start(end))
        };
        patch().map(|_end| ()).map_err(FilmError::file(&self.path))
    }

    fn finish(mut self) -> Result<(), FilmError> {
        self.begin_block(END, 1)?;
        self.end_block()?;
        // On the disk before it takes the place of an older file: a machine that goes away then loses neither.
        self.file.flush().and_then(|()| self.file.get_ref().sync_all()).map_err(FilmError::file(&self.path))
    }
}
