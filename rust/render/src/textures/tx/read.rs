// SPDX-License-Identifier: Apache-2.0
//! Reads a file that [`super::TxWriter`] wrote; any other, and a damaged one, is an error. Any thread.

use super::{
    COMPRESSION, IMAGE_DESCRIPTION, LONG8, MAX_DESCRIPTION_BYTES, TILE_CHECKSUMS, TILE_LENGTH, TILE_OFFSETS,
    TILE_WIDTH, TxDescription, TxLevel,
};
use std::fs::File;
use std::io;
use std::os::unix::fs::FileExt;
use std::sync::OnceLock;
use xxhash_rust::xxh3::xxh3_64;

/// Most fields of a directory that are read.
const MAX_FIELDS: u64 = 64;

/// The places of a level's tiles, as far as they have been read.
#[derive(Debug)]
struct TileTable {
    level: TxLevel,
    offsets_at: u64,
    checksums_at: u64,
    /// Offset and checksum of each tile.
    tiles: OnceLock<Vec<(u64, u64)>>,
}

/// An open file.
#[derive(Debug)]
pub(crate) struct TxFile {
    file: File,
    bytes: u64,
    description: TxDescription,
    tables: Vec<TileTable>,
}

impl TxFile {
    /// Opens a finished file.
    pub(crate) fn open(file: File) -> io::Result<Self> {
        let bytes = file.metadata()?.len();
        let head: [u8; 16] = read_at(&file, 0)?;
        if head[..8] != [b'I', b'I', 43, 0, 8, 0, 0, 0] {
            return Err(damaged());
        }
        let mut at = u64_of(&head, 8);
        let mut description: Option<TxDescription> = None;
        let mut levels: Vec<TxLevel> = Vec::new();
        let mut tables = Vec::new();
        while at != 0 && (description.is_none() || tables.len() < levels.len()) {
            let count = bounded(u64::from_le_bytes(read_at(&file, at)?), MAX_FIELDS)?;
            let mut fields = vec![0; 20 * count + 8];
            file.read_exact_at(&mut fields, at.checked_add(8).ok_or_else(damaged)?)?;
            let field = |tag: u16| {
                let found = fields.chunks_exact(20).find(|field| field[..2] == tag.to_le_bytes());
                found.map(|field| (u16::from_le_bytes([field[2], field[3]]), u64_of(field, 4), u64_of(field, 12)))
            };
            if description.is_none() {
                let (_, length, at) = field(IMAGE_DESCRIPTION).ok_or_else(damaged)?;
                let mut text = vec![0; bounded(length, MAX_DESCRIPTION_BYTES)?];
                file.read_exact_at(&mut text, at)?;
                text.pop();
                let said: TxDescription = serde_json::from_slice(&text).map_err(io::Error::other)?;
                if !said.is_possible() {
                    return Err(damaged());
                }
                levels = said.levels();
                description = Some(said);
            }
            let level = *levels.get(tables.len()).ok_or_else(damaged)?;
            let is = |tag, value: u64| field(tag).is_some_and(|(_, count, is)| count == 1 && is == value);
            // A single value is stored in the field itself.
            let place = |tag| match field(tag) {
                Some((LONG8, count, _)) if count != level.count() as u64 => Err(damaged()),
                Some((LONG8, 1, _)) => {
                    let index = fields.chunks_exact(20).position(|field| field[..2] == tag.to_le_bytes());
                    index.map(|index| at + 8 + 20 * index as u64 + 12).ok_or_else(damaged)
                }
                Some((LONG8, _, place)) => Ok(place),
                _ => Err(damaged()),
            };
            if !(is(COMPRESSION, 1) && is(TILE_WIDTH, level.tile[0].into()) && is(TILE_LENGTH, level.tile[1].into())) {
                return Err(damaged());
            }
            let (offsets_at, checksums_at) = (place(TILE_OFFSETS)?, place(TILE_CHECKSUMS)?);
            tables.push(TileTable { level, offsets_at, checksums_at, tiles: OnceLock::new() });
            at = u64_of(&fields, 20 * count);
        }
        match description {
            Some(description) if tables.len() == levels.len() => Ok(Self { file, bytes, description, tables }),
            _ => Err(damaged()),
        }
    }

    /// The description of the image.
    pub(crate) fn description(&self) -> &TxDescription {
        &self.description
    }

    /// Bytes of the file.
    pub(crate) fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Reads the tile that begins at texel `at` of a level, `size` texels of it, rows from the bottom up.
    pub(crate) fn tile(&self, level: u32, at: [u32; 2], size: [u32; 2], out: &mut [u8]) -> io::Result<()> {
        let index = level.checked_sub(self.description.first_level).ok_or_else(damaged)?;
        let table = self.tables.get(index as usize).ok_or_else(damaged)?;
        let texel_bytes = self.description.texel_bytes();
        let tile = table.level.tile;
        let number = table.level.number([at[0] / tile[0], at[1] / tile[1]]);
        let (row, stride) = (size[0] as usize * texel_bytes, tile[0] as usize * texel_bytes);
        if row == 0 || row > stride || size[1] > tile[1] || out.len() != row * size[1] as usize {
            return Err(io::Error::other("the file has no such tile"));
        }
        let &(offset, checksum) = self.tiles(table)?.get(number).ok_or_else(damaged)?;
        let mut padded = vec![0; table.level.tile_bytes(texel_bytes)];
        self.file.read_exact_at(&mut padded, offset)?;
        if xxh3_64(&padded) != checksum {
            return Err(damaged());
        }
        for (from, to) in padded.chunks_exact(stride).zip(out.chunks_exact_mut(row)) {
            to.copy_from_slice(&from[..row]);
        }
        Ok(())
    }

    fn tiles<'a>(&self, table: &'a TileTable) -> io::Result<&'a Vec<(u64, u64)>> {
        if let Some(tiles) = table.tiles.get() {
            return Ok(tiles);
        }
        // The file is at least as long as its tiles: this bounds the allocation.
        let length = bounded(table.level.count() as u64 * 8, self.bytes)?;
        let read = |at: u64| -> io::Result<Vec<u8>> {
            let mut values = vec![0; length];
            self.file.read_exact_at(&mut values, at)?;
            Ok(values)
        };
        let (offsets, checksums) = (read(table.offsets_at)?, read(table.checksums_at)?);
        let pairs = offsets.chunks_exact(8).zip(checksums.chunks_exact(8));
        let tiles = pairs.map(|(offset, checksum)| (u64_of(offset, 0), u64_of(checksum, 0))).collect();
        Ok(table.tiles.get_or_init(|| tiles))
    }
}

/// A count from the file, if it is not above `most`.
fn bounded(count: u64, most: u64) -> io::Result<usize> {
    usize::try_from(count).ok().filter(|_| count <= most).ok_or_else(damaged)
}

fn read_at<const N: usize>(file: &File, at: u64) -> io::Result<[u8; N]> {
    let mut bytes = [0; N];
    file.read_exact_at(&mut bytes, at)?;
    Ok(bytes)
}

/// The number at byte `at`, which must exist.
fn u64_of(bytes: &[u8], at: usize) -> u64 {
    let mut number = [0; 8];
    if let Some(from) = bytes.get(at..at + 8) {
        number.copy_from_slice(from);
    }
    u64::from_le_bytes(number)
}

fn damaged() -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, "damaged")
}
