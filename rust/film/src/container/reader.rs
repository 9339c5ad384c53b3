// SPDX-License-Identifier: Apache-2.0
//! Reads film files, which may come from strangers: no length is believed before it was compared with what is there.

use super::{
    BLOCK_HEAD, BlockHead, CHUNK_HEAD, END, FIXED_HEADER, LONGEST_HEADER, MAGIC, MAX_BLOCKS, MAX_CHUNK, MAX_STRIDE,
    VERSION, checksum, header_hash, name_bytes, packing, seed, u32_at, u64_at,
};
use crate::error::FilmError;
use crate::header::FilmHeader;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

/// The header of a film file, and the places of its blocks. The file is not kept open.
#[derive(Clone, Debug)]
pub struct FilmReader {
    path: PathBuf,
    header: FilmHeader,
    hash: u128,
    blocks: Vec<(BlockHead, u64)>,
    length: u64,
}

/// Reads the chunks of a block one after the other. It opens the file for each batch of them, so that many films can be
/// read in turn.
#[derive(Clone, Debug)]
pub(crate) struct ChunkReader {
    path: PathBuf,
    hash: u128,
    /// Place of the next chunk.
    position: u64,
    /// Bytes left, packed and unpacked.
    left: [u64; 2],
    stride: usize,
}

/// A chunk as it is in the file.
#[derive(Debug)]
pub(crate) struct PackedChunk {
    bytes: Vec<u8>,
    raw: usize,
    stride: usize,
    sum: u64,
    seed: u64,
}

impl PackedChunk {
    /// The chunk's bytes; `None` if they are not those that were written.
    pub(crate) fn unpack(&self) -> Option<Vec<u8>> {
        let (raw, packed) = (u32::try_from(self.raw).ok()?, u32::try_from(self.bytes.len()).ok()?);
        let sum = checksum(self.seed, &[&raw.to_le_bytes(), &packed.to_le_bytes(), &self.bytes]);
        if sum != self.sum {
            return None;
        }
        packing::unpack(&self.bytes, self.stride, self.raw)
    }
}

impl ChunkReader {
    /// The next `count` chunks.
    pub(crate) fn read(&mut self, count: usize) -> Result<Vec<PackedChunk>, FilmError> {
        let mut file = oocpt_files::open(&self.path).map_err(FilmError::file(&self.path))?;
        file.seek(SeekFrom::Start(self.position)).map_err(FilmError::file(&self.path))?;
        (0..count).map(|_| self.next(&mut file)).collect()
    }

    fn next(&mut self, file: &mut File) -> Result<PackedChunk, FilmError> {
        let mut head = [0; CHUNK_HEAD];
        self.fill(file, &mut head)?;
        let [raw, packed] = [0, 4].map(|at| u32_at(&head, at) as usize);
        let after = [packed as u64 + CHUNK_HEAD as u64, raw as u64];
        let left = [0, 1].map(|k| self.left[k].checked_sub(after[k]));
        let fits = raw > 0 && raw <= MAX_CHUNK && packed <= packing::most_packed(raw, self.stride);
        let (true, [Some(left), Some(raw_left)]) = (fits, left) else {
            return Err(FilmError::damaged(&self.path, "a chunk's length is wrong"));
        };
        let mut bytes = vec![0; packed];
        self.fill(file, &mut bytes)?;
        let seed = seed(self.hash, self.position);
        self.position += after[0];
        self.left = [left, raw_left];
        Ok(PackedChunk { bytes, raw, stride: self.stride, sum: u64_at(&head, 8), seed })
    }

    fn fill(&self, file: &mut File, bytes: &mut [u8]) -> Result<(), FilmError> {
        let cut = |error: std::io::Error| match error.kind() {
            std::io::ErrorKind::UnexpectedEof => FilmError::damaged(&self.path, "it ends too early"),
            _ => FilmError::File(self.path.clone(), error),
        };
        file.read_exact(bytes).map_err(cut)
    }

    /// The bytes of a chunk, or what is wrong with it.
    pub(crate) fn unpack(&self, chunk: &PackedChunk) -> Result<Vec<u8>, FilmError> {
        chunk.unpack().ok_or_else(|| FilmError::damaged(&self.path, "a chunk's checksum is wrong"))
    }

    /// Bytes of a record.
    pub(crate) fn stride(&self) -> usize {
        self.stride
    }

    /// Whether all chunks were read.
    pub(crate) fn is_at_end(&self) -> bool {
        self.left == [0; 2]
    }
}

impl FilmReader {
    /// Opens a film file, reads its header and finds its blocks; a file that is cut is refused here.
    ///
    /// # Errors
    /// [`FilmError::File`], [`FilmError::Foreign`], [`FilmError::Damaged`].
    pub fn open(path: &Path) -> Result<Self, FilmError> {
        let io = |error| FilmError::File(path.to_owned(), error);
        let mut file = oocpt_files::open(path).map_err(io)?;
        let length = file.metadata().map_err(io)?.len();
        let mut fixed = Vec::new();
        (&mut file).take(FIXED_HEADER as u64).read_to_end(&mut fixed).map_err(io)?;
        let foreign = |what: String| FilmError::Foreign(path.to_owned(), what);
        if !fixed.starts_with(&MAGIC) {
            return Err(foreign("no film file".to_owned()));
        }
        if fixed.len() < FIXED_HEADER {
            return Err(FilmError::damaged(path, "it ends in its header"));
        }
        let (version, bytes) = (u32_at(&fixed, 8), u32_at(&fixed, 12));
        if version != VERSION {
            return Err(foreign(format!("version {version} of the format, this program reads {VERSION}")));
        }
        if bytes > LONGEST_HEADER || u64::from(bytes) > length {
            return Err(FilmError::damaged(path, "the length of its header is wrong"));
        }
        let mut text = vec![0; bytes as usize];
        file.read_exact(&mut text).map_err(io)?;
        let hash = header_hash(&fixed[..16], &text);
        if hash.to_le_bytes() != fixed[16..] {
            return Err(FilmError::damaged(path, "the checksum of its header is wrong"));
        }
        let header: FilmHeader =
            serde_json::from_slice(&text).map_err(|error| FilmError::damaged(path, error.to_string()))?;
        header.check().map_err(|what| FilmError::damaged(path, what))?;
        let mut reader = Self { path: path.to_owned(), header, hash, blocks: Vec::new(), length };
        reader.find_blocks(&mut file, (FIXED_HEADER + text.len()) as u64)?;
        Ok(reader)
    }

    fn find_blocks(&mut self, file: &mut File, mut position: u64) -> Result<(), FilmError> {
        let damaged = |what: &str| FilmError::damaged(&self.path, what);
        let end = name_bytes(END);
        for _ in 0..MAX_BLOCKS {
            let mut bytes = [0; BLOCK_HEAD];
            file.seek(SeekFrom::Start(position)).map_err(FilmError::file(&self.path))?;
            let read = file.read_exact(&mut bytes);
            read.map_err(|_too_short| damaged("it is cut"))?;
            let head = BlockHead::decode(&bytes, seed(self.hash, position));
            let head = head.ok_or_else(|| damaged("the checksum of a block is wrong"))?;
            position += BLOCK_HEAD as u64;
            let next = position.checked_add(head.packed).filter(|next| *next <= self.length);
            let next = next.ok_or_else(|| damaged("it is cut"))?;
            if head.stride == 0 || head.stride > MAX_STRIDE {
                return Err(damaged("the stride of a block is wrong"));
            }
            if Some(head.name) == end {
                return if next == self.length { Ok(()) } else { Err(damaged("bytes are behind its end")) };
            }
            if self.blocks.iter().any(|(block, _)| block.name == head.name) {
                return Err(damaged("two blocks of one name"));
            }
            self.blocks.push((head, position));
            position = next;
        }
        Err(damaged("it has too many blocks"))
    }

    /// The file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What the file says of itself.
    #[must_use]
    pub fn header(&self) -> &FilmHeader {
        &self.header
    }

    /// Bytes of the file.
    #[must_use]
    pub fn file_bytes(&self) -> u64 {
        self.length
    }

    /// Bytes of a block as it is read; `None` without such a block.
    #[must_use]
    pub fn block_bytes(&self, name: &str) -> Option<u64> {
        self.find(name).map(|(head, _)| head.raw)
    }

    fn find(&self, name: &str) -> Option<(BlockHead, u64)> {
        let name = name_bytes(name)?;
        self.blocks.iter().find(|(head, _)| head.name == name).copied()
    }

    /// The chunks of a block.
    pub(crate) fn chunks(&self, name: &str) -> Result<ChunkReader, FilmError> {
        let found = self.find(name);
        let (head, position) =
            found.ok_or_else(|| FilmError::Missing(self.path.clone(), format!("no block {name}")))?;
        Ok(self.chunks_of(&head, position))
    }

    fn chunks_of(&self, head: &BlockHead, position: u64) -> ChunkReader {
        ChunkReader {
            path: self.path.clone(),
            hash: self.hash,
            position,
            left: [head.packed, head.raw],
            stride: head.stride as usize,
        }
    }

    /// Reads all of the file and compares its checksums.
    ///
    /// # Errors
    /// [`FilmError::Damaged`], [`FilmError::File`].
    pub fn verify(&self) -> Result<(), FilmError> {
        for (head, position) in &self.blocks {
            let mut chunks = self.chunks_of(head, *position);
            while !chunks.is_at_end() {
                for chunk in chunks.read(1)? {
                    chunks.unpack(&chunk)?;
                }
            }
        }
        Ok(())
    }

    /// The bytes of a block, which are those that were written.
    ///
    /// # Errors
    /// [`FilmError::Missing`] if there is no such block or it has more than `most_bytes`, [`FilmError::Damaged`],
    /// [`FilmError::File`].
    pub fn block(&self, name: &str, most_bytes: u64) -> Result<Vec<u8>, FilmError> {
        let mut chunks = self.chunks(name)?;
        let bytes = chunks.left[1];
        if bytes > most_bytes {
            let what = format!("block {name} has {bytes} bytes, more than {most_bytes}");
            return Err(FilmError::Missing(self.path.clone(), what));
        }
        let mut all = Vec::new();
        while !chunks.is_at_end() {
            for chunk in chunks.read(1)? {
                all.extend_from_slice(&chunks.unpack(&chunk)?);
            }
        }
        Ok(all)
    }
}
