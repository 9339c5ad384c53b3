// SPDX-License-Identifier: Apache-2.0
//! Files of deep scan lines ("`OpenEXR` File Layout", deep data): the header of the EXR library, which has no writer of
//! such pixels, then a table of the places of lines, then a chunk for each line: its y, three sizes, the numbers of
//! samples up to and with each pixel, and the samples, channel by channel. Lines are made by all threads, some at a
//! time, so that memory is bounded whatever the size of the picture.

use exr::compression::Compression;
use exr::meta::attribute::{AttributeValue, BlockType, Text, TextSlice};
use exr::meta::header::Header;
use exr::meta::{Requirements, attribute};
use flate2::Compression as Level;
use flate2::write::ZlibEncoder;
use rayon::prelude::*;
use std::fs::File;
use std::io::{BufWriter, Error, Result, Seek as _, SeekFrom, Write};

/// First bytes of a file.
const MAGIC: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];
/// Most characters of a name that need no flag.
const LONGEST_NAME: usize = 31;
/// Bytes of samples that are made at a time, about.
const BYTES_AT_ONCE: usize = 32 << 20;
/// The level that the EXR library has for other files.
const LEVEL: u32 = 4;

/// A line of a deep image.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct DeepLine {
    /// Samples of each pixel.
    pub(super) counts: Vec<usize>,
    /// The samples, little-endian: channel by channel in the order of their names, pixel by pixel.
    pub(super) data: Vec<u8>,
}

/// A line as it is in a file, without its y.
struct PackedLine {
    most: usize,
    sizes: [usize; 3],
    table: Vec<u8>,
    data: Vec<u8>,
}

/// Writes a file whose lines `line` makes, the upper one first, of about `line_bytes` each at most. The number of the
/// most samples is set in `header`.
pub(super) fn write(
    out: File,
    mut header: Header,
    line_bytes: usize,
    line: impl Fn(usize) -> DeepLine + Sync,
) -> Result<()> {
    let height = header.layer_size.y();
    let mut places = vec![0_u64; height];
    let mut out = BufWriter::new(out);
    let start = start_of(&header)?;
    out.write_all(&start)?;
    let table_bytes = 8 * places.len() as u64;
    out.write_all(bytemuck::cast_slice(&places))?;
    let mut at = start.len() as u64 + table_bytes;
    let mut most = 0;
    let at_once = (BYTES_AT_ONCE / line_bytes.max(1)).clamp(1, 256);
    for first in (0..height).step_by(at_once) {
        let lines = (first..height.min(first + at_once)).into_par_iter();
        let packed = lines.map(|y| pack(&line(y), header.compression)).collect::<Result<Vec<_>>>()?;
        for (packed, y) in packed.iter().zip(first..) {
            most = most.max(packed.most);
            places[y] = at;
            let y = header.own_attributes.layer_position.y() + i32::try_from(y).map_err(Error::other)?;
            out.write_all(&y.to_le_bytes())?;
            for size in packed.sizes {
                out.write_all(&(size as u64).to_le_bytes())?;
            }
            out.write_all(&packed.table)?;
            out.write_all(&packed.data)?;
            at += 4 + 3 * 8 + (packed.table.len() + packed.data.len()) as u64;
        }
    }
    // The header again, of the same length: now the most samples and the places are known.
    header.max_samples_per_pixel = Some(most);
    out.seek(SeekFrom::Start(0))?;
    out.write_all(&start_of(&header)?)?;
    for place in places {
        out.write_all(&place.to_le_bytes())?;
    }
    out.flush()
}

/// What is before the table of places.
fn start_of(header: &Header) -> Result<Vec<u8>> {
    let failed = |error: exr::error::Error| Error::other(error.to_string());
    let kind = Text::from("type");
    let is_long = |name: &TextSlice| name.len() > LONGEST_NAME;
    let has_long_names = header.all_named_attributes().any(|(name, _)| is_long(name))
        || header.channels.list.iter().any(|channel| is_long(channel.name.as_slice()));
    let requirements = Requirements {
        file_format_version: 2,
        is_single_layer_and_tiled: false,
        has_long_names,
        has_deep_data: true,
        has_multiple_layers: false,
    };
    let mut bytes = MAGIC.to_vec();
    requirements.write(&mut bytes).map_err(failed)?;
    for (name, value) in header.all_named_attributes() {
        // The library calls all lines flat.
        let is_kind = name == kind.as_slice();
        let value = if is_kind { AttributeValue::BlockType(BlockType::DeepScanLine) } else { value };
        attribute::write(name, &value, &mut bytes).map_err(failed)?;
    }
    bytes.push(0);
    Ok(bytes)
}

fn pack(line: &DeepLine, compression: Compression) -> Result<PackedLine> {
    let ends = line.counts.iter().scan(0_usize, |sum, count| {
        *sum += count;
        Some(i32::try_from(*sum))
    });
    let ends: Vec<i32> = ends.collect::<std::result::Result<_, _>>().map_err(Error::other)?;
    let table: Vec<u8> = ends.iter().flat_map(|end| end.to_le_bytes()).collect();
    let [table, data] = [&table, &line.data].map(|bytes| packed(bytes, compression));
    let (table, data) = (table?, data?);
    let most = line.counts.iter().copied().max().unwrap_or(0);
    Ok(PackedLine { most, sizes: [table.len(), data.len(), line.data.len()], table, data })
}

/// The bytes compressed; as they are where that would not be smaller, by which readers tell them.
fn packed(bytes: &[u8], compression: Compression) -> Result<Vec<u8>> {
    if compression == Compression::Uncompressed || bytes.is_empty() {
        return Ok(bytes.to_vec());
    }
    // Bytes at even places, then those at odd ones; each as its difference from the one before, with an offset of 128.
    let apart: Vec<u8> = bytes.iter().step_by(2).chain(bytes.iter().skip(1).step_by(2)).copied().collect();
    let before = apart.first().copied().into_iter().chain(apart.iter().copied());
    let differences = apart.iter().zip(before).enumerate();
    let differences: Vec<u8> = differences
        .map(|(at, (byte, before))| if at == 0 { *byte } else { byte.wrapping_sub(before).wrapping_add(128) })
        .collect();
    let mut encoder = ZlibEncoder::new(Vec::new(), Level::new(LEVEL));
    encoder.write_all(&differences)?;
    let compressed = encoder.finish()?;
    Ok(if compressed.len() < bytes.len() { compressed } else { bytes.to_vec() })
}
