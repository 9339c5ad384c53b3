// SPDX-License-Identifier: Apache-2.0
//! Film files: a header, then named blocks, the last of which is empty and named `end`. All numbers are little-endian.
//!
//! - Header: `OOCPTFLM`, version (u32), bytes of the text (u32), xxh3-128 of these and the text, the text: JSON.
//! - Head of a block, 48 bytes: name (16 bytes, zeros behind), bytes that follow (u64), bytes unpacked (u64), stride
//!   (u32), 0 (u32), checksum (u64).
//! - A block is a sequence of chunks: bytes unpacked (u32), bytes packed (u32), checksum (u64), the packed bytes
//!   ([`packing`]).
//!
//! Checksums are xxh3-64 of what is before and behind them in their head and chunk. Their seed is made of the header's
//! hash and the place in the file: no part of another film is taken for one of this.

mod packing;
mod reader;
mod writer;

pub(crate) use reader::ChunkReader;
pub use reader::FilmReader;
pub(crate) use writer::packed;
pub use writer::{FilmWriter, write_film};

use xxhash_rust::xxh3::Xxh3;

/// First bytes of a file.
const MAGIC: [u8; 8] = *b"OOCPTFLM";
/// Version of the format.
const VERSION: u32 = 1;
/// Bytes of the header before its text.
const FIXED_HEADER: usize = 32;
/// Longest text of a header.
const LONGEST_HEADER: u32 = 16 << 20;
/// Most blocks of a file, with the last one.
const MAX_BLOCKS: usize = 64;
/// Bytes of a block's head.
const BLOCK_HEAD: usize = 48;
/// Bytes of a block's name.
const NAME: usize = 16;
/// Bytes of a chunk's head.
const CHUNK_HEAD: usize = 16;
/// Most bytes of a chunk, unpacked.
pub(crate) const MAX_CHUNK: usize = 1 << 20;
/// Name of the last block.
const END: &str = "end";
/// Largest stride of a block.
const MAX_STRIDE: u32 = 4096;

/// Head of a block.
#[derive(Clone, Copy, Debug)]
struct BlockHead {
    name: [u8; NAME],
    packed: u64,
    raw: u64,
    stride: u32,
}

impl BlockHead {
    fn encode(&self, seed: u64) -> [u8; BLOCK_HEAD] {
        let mut bytes = [0; BLOCK_HEAD];
        bytes[..16].copy_from_slice(&self.name);
        bytes[16..24].copy_from_slice(&self.packed.to_le_bytes());
        bytes[24..32].copy_from_slice(&self.raw.to_le_bytes());
        bytes[32..36].copy_from_slice(&self.stride.to_le_bytes());
        let sum = checksum(seed, &[&bytes[..40]]);
        bytes[40..].copy_from_slice(&sum.to_le_bytes());
        bytes
    }

    /// The head in these bytes, if its checksum is right.
    fn decode(bytes: &[u8; BLOCK_HEAD], seed: u64) -> Option<Self> {
        let mut name = [0; NAME];
        name.copy_from_slice(&bytes[..NAME]);
        let head = Self { name, packed: u64_at(bytes, 16), raw: u64_at(bytes, 24), stride: u32_at(bytes, 32) };
        (head.encode(seed) == *bytes).then_some(head)
    }
}

fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
}

fn u64_at(bytes: &[u8], at: usize) -> u64 {
    u64::from(u32_at(bytes, at)) | u64::from(u32_at(bytes, at + 4)) << 32
}

fn checksum(seed: u64, parts: &[&[u8]]) -> u64 {
    let mut hash = Xxh3::with_seed(seed);
    parts.iter().for_each(|part| hash.update(part));
    hash.digest()
}

/// The hash of a header: of its first 16 bytes and its text.
fn header_hash(begin: &[u8], text: &[u8]) -> u128 {
    let mut hash = Xxh3::new();
    hash.update(begin);
    hash.update(text);
    hash.digest128()
}

/// The seed of checksums at a place of the file with this hash.
#[expect(clippy::cast_possible_truncation, reason = "its lower half")]
fn seed(hash: u128, place: u64) -> u64 {
    (hash as u64).wrapping_add(place)
}

/// A name as bytes of a head; `None` if it does not fit.
fn name_bytes(name: &str) -> Option<[u8; NAME]> {
    let mut bytes = [0; NAME];
    bytes.get_mut(..name.len())?.copy_from_slice(name.as_bytes());
    (name.is_ascii() && !name.contains('\0')).then_some(bytes)
}
