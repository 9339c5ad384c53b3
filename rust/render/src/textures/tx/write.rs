// SPDX-License-Identifier: Apache-2.0
//! Writes a file; see the module above.

use super::{
    ASCII, BITS_PER_SAMPLE, COMPRESSION, EXTRA_SAMPLES, IMAGE_DESCRIPTION, IMAGE_LENGTH, IMAGE_WIDTH, LONG, LONG8,
    NEW_SUBFILE_TYPE, ORIENTATION, PHOTOMETRIC, PLANAR_CONFIGURATION, SAMPLE_FORMAT, SAMPLES_PER_PIXEL, SHORT,
    SOFTWARE, TILE_BYTE_COUNTS, TILE_CHECKSUMS, TILE_LENGTH, TILE_OFFSETS, TILE_WIDTH, TxDescription, TxFormat,
    TxLevel,
};
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use xxhash_rust::xxh3::xxh3_64;

/// Bytes of the file's head: marks, and where the first directory is.
const HEAD: usize = 16;
const BUFFER_BYTES: usize = 1 << 20;

/// Where the tiles of a level lie.
#[derive(Debug)]
struct TileOffsets {
    level: TxLevel,
    /// 0: not there yet.
    offsets: Vec<u64>,
    checksums: Vec<u64>,
}

/// A file under way.
#[derive(Debug)]
pub(crate) struct TxWriter<W: Write + Seek> {
    out: BufWriter<W>,
    position: u64,
    description: TxDescription,
    tables: Vec<TileOffsets>,
    padded: Vec<u8>,
}

/// A field of a directory.
struct DirectoryField {
    tag: u16,
    kind: u16,
    count: u64,
    /// Its bytes.
    value: Vec<u8>,
}

impl<W: Write + Seek> TxWriter<W> {
    /// Begins a file.
    pub(crate) fn new(out: W, description: TxDescription) -> io::Result<Self> {
        let mut out = BufWriter::with_capacity(BUFFER_BYTES, out);
        out.write_all(&[0; HEAD])?;
        let table =
            |level: TxLevel| TileOffsets { level, offsets: vec![0; level.count()], checksums: vec![0; level.count()] };
        let tables = description.levels().into_iter().map(table).collect();
        Ok(Self { out, position: HEAD as u64, description, tables, padded: Vec::new() })
    }

    /// Appends the tile that begins at texel `at` of a level: `size` texels, rows from the bottom up. Levels before
    /// the first
    /// one of the file are left out.
    pub(crate) fn tile(&mut self, level: u32, at: [u32; 2], size: [u32; 2], texels: &[u8]) -> io::Result<()> {
        let Some(index) = level.checked_sub(self.description.first_level) else { return Ok(()) };
        let texel_bytes = self.description.texel_bytes();
        let Some(table) = self.tables.get_mut(index as usize) else { return Err(no_such_tile()) };
        let tile = table.level.tile;
        let number = table.level.number([at[0] / tile[0], at[1] / tile[1]]);
        let row = size[0] as usize * texel_bytes;
        let stride = tile[0] as usize * texel_bytes;
        let is_whole = at.iter().zip(tile).all(|(at, side)| at.is_multiple_of(side));
        if !is_whole || row == 0 || row > stride || size[1] > tile[1] || texels.len() != row * size[1] as usize {
            return Err(no_such_tile());
        }
        let (Some(offset), Some(checksum)) = (table.offsets.get_mut(number), table.checksums.get_mut(number)) else {
            return Err(no_such_tile());
        };
        self.padded.clear();
        self.padded.resize(stride * tile[1] as usize, 0);
        for (from, to) in texels.chunks_exact(row).zip(self.padded.chunks_exact_mut(stride)) {
            to[..row].copy_from_slice(from);
        }
        *offset = self.position;
        *checksum = xxh3_64(&self.padded);
        self.out.write_all(&self.padded)?;
        self.position += self.padded.len() as u64;
        Ok(())
    }

    /// Writes the directories and, last of all, where they are: before that no reader takes the file for one.
    pub(crate) fn finish(mut self) -> io::Result<W> {
        if self.tables.iter().flat_map(|table| &table.offsets).any(|offset| *offset == 0) {
            return Err(io::Error::other("tiles are missing"));
        }
        let tables = std::mem::take(&mut self.tables);
        let mut directories = Vec::with_capacity(tables.len());
        for (index, table) in tables.iter().enumerate() {
            let fields = self.fields(index, table)?;
            directories.push(fields);
        }
        let first = self.align()?;
        let mut at = first;
        for (index, fields) in directories.iter().enumerate() {
            let bytes = 8 + 20 * fields.len() as u64 + 8;
            let next = if index + 1 < directories.len() { at + bytes } else { 0 };
            self.put(&(fields.len() as u64).to_le_bytes())?;
            for field in fields {
                self.put(&field.tag.to_le_bytes())?;
                self.put(&field.kind.to_le_bytes())?;
                self.put(&field.count.to_le_bytes())?;
                self.put(&field.value)?;
            }
            self.put(&next.to_le_bytes())?;
            at += bytes;
        }
        self.out.seek(SeekFrom::Start(0))?;
        let mut head = [0; HEAD];
        head[..8].copy_from_slice(&[b'I', b'I', 43, 0, 8, 0, 0, 0]);
        head[8..].copy_from_slice(&first.to_le_bytes());
        self.out.write_all(&head)?;
        self.out.into_inner().map_err(io::IntoInnerError::into_error)
    }

    /// The fields of a directory; values of more than 8 bytes are written at once, and the field says where.
    fn fields(&mut self, index: usize, table: &TileOffsets) -> io::Result<Vec<DirectoryField>> {
        let TxLevel { size, tile, .. } = table.level;
        let channels = self.description.channels;
        let (bits, format): (u16, u16) = match self.description.format {
            TxFormat::U8 => (8, 1),
            TxFormat::F16 => (16, 3),
            TxFormat::F32 => (32, 3),
        };
        let shorts = |value: u16| [value.to_le_bytes(); 4].concat()[..2 * channels as usize].to_vec();
        let numbers = |values: &[u64]| values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>();
        let tile_bytes = table.level.tile_bytes(self.description.texel_bytes()) as u64;
        let one = |tag, value: u16| (tag, SHORT, 1, value.to_le_bytes().to_vec());
        let long = |tag, value: u32| (tag, LONG, 1, value.to_le_bytes().to_vec());
        let count = table.level.count() as u64;
        let mut fields = vec![
            long(NEW_SUBFILE_TYPE, u32::from(index > 0)),
            long(IMAGE_WIDTH, size[0]),
            long(IMAGE_LENGTH, size[1]),
            (BITS_PER_SAMPLE, SHORT, u64::from(channels), shorts(bits)),
            one(COMPRESSION, 1),
            one(PHOTOMETRIC, if channels >= 3 { 2 } else { 1 }),
        ];
        if index == 0 {
            let mut text = serde_json::to_vec(&self.description).map_err(io::Error::other)?;
            text.push(0);
            fields.push((IMAGE_DESCRIPTION, ASCII, text.len() as u64, text));
        }
        fields.push(one(ORIENTATION, 4));
        fields.push(one(SAMPLES_PER_PIXEL, u16::try_from(channels).unwrap_or(4)));
        fields.push(one(PLANAR_CONFIGURATION, 1));
        if index == 0 {
            let name = b"OocPT\0".to_vec();
            fields.push((SOFTWARE, ASCII, name.len() as u64, name));
        }
        fields.push(long(TILE_WIDTH, tile[0]));
        fields.push(long(TILE_LENGTH, tile[1]));
        fields.push((TILE_OFFSETS, LONG8, count, numbers(&table.offsets)));
        fields.push((TILE_BYTE_COUNTS, LONG8, count, numbers(&vec![tile_bytes; table.level.count()])));
        if channels == 2 || channels == 4 {
            fields.push(one(EXTRA_SAMPLES, 2)); // alpha, not multiplied in
        }
        fields.push((SAMPLE_FORMAT, SHORT, u64::from(channels), shorts(format)));
        fields.push((TILE_CHECKSUMS, LONG8, count, numbers(&table.checksums)));
        let mut placed = Vec::with_capacity(fields.len());
        for (tag, kind, count, mut value) in fields {
            if value.len() > 8 {
                let at = self.align()?;
                self.put(&value)?;
                value = at.to_le_bytes().to_vec();
            }
            value.resize(8, 0);
            placed.push(DirectoryField { tag, kind, count, value });
        }
        Ok(placed)
    }

    fn put(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.out.write_all(bytes)?;
        self.position += bytes.len() as u64;
        Ok(())
    }

    /// Goes on at a multiple of 8 bytes; where that is.
    fn align(&mut self) -> io::Result<u64> {
        while !self.position.is_multiple_of(8) {
            self.put(&[0])?;
        }
        Ok(self.position)
    }
}

fn no_such_tile() -> io::Error {
    io::Error::other("the file has no such tile")
}
