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

#[cfg(test)]
mod tests {
    use super::*;
    use exr::meta::BlockDescription;
    use exr::meta::attribute::{ChannelDescription, ChannelList, IntegerBounds, LineOrder, SampleType};
    use exr::prelude::{ImageAttributes, LayerAttributes, Vec2};
    use std::fs::OpenOptions;

    fn header(compression: Compression, height: usize) -> Header {
        let channel = ChannelDescription {
            name: Text::from("Z"),
            sample_type: SampleType::F32,
            quantize_linearly: false,
            sampling: Vec2(1, 1),
        };
        Header {
            channels: ChannelList::new([channel].into_iter().collect()),
            compression,
            blocks: BlockDescription::ScanLines,
            line_order: LineOrder::Increasing,
            layer_size: Vec2(3, height),
            chunk_count: height,
            deep: true,
            deep_data_version: Some(1),
            max_samples_per_pixel: Some(0),
            shared_attributes: ImageAttributes::new(IntegerBounds::new(Vec2(0, 0), Vec2(3, height))),
            own_attributes: LayerAttributes::default(),
        }
    }

    /// A line of three pixels with y, 0 and 300 samples.
    fn line(y: usize) -> DeepLine {
        DeepLine { counts: vec![y, 0, 300], data: vec![7; 4 * (y + 300)] }
    }

    #[test]
    fn bytes_that_do_not_become_fewer_stay_as_they_are() {
        let noise =
            std::iter::successors(Some(1_u32), |k| Some(k.wrapping_mul(747_796_405).wrapping_add(2_891_336_453)));
        let noise: Vec<u8> = noise.map(|k| k.to_le_bytes()[3]).take(97).collect();
        assert_eq!(packed(&noise, Compression::ZIP1).expect("bytes"), noise);
        assert!(packed(&[5; 1000], Compression::ZIP1).expect("bytes").len() < 100);
        assert_eq!(packed(&[5; 1000], Compression::Uncompressed).expect("bytes"), [5; 1000]);
        assert!(packed(&[], Compression::ZIP1).expect("bytes").is_empty());
    }

    #[test]
    fn the_table_has_the_places_of_lines() {
        for compression in [Compression::Uncompressed, Compression::ZIP1] {
            let path = std::env::temp_dir().join(format!("oocpt-deep-lines-{}.exr", std::process::id()));
            // Lines of a size that are made one by one.
            for line_bytes in [1, BYTES_AT_ONCE] {
                oocpt_files::replace_by(&path, |out| write(out, header(compression, 5), line_bytes, line))
                    .expect("a file");
                let bytes = std::fs::read(&path).expect("the file");
                let with_most = Header { max_samples_per_pixel: Some(300), ..header(compression, 5) };
                let start = start_of(&with_most).expect("a header");
                assert!(bytes.starts_with(&start), "with the most samples");
                let word = |at: usize| u64::from_le_bytes(bytes[at..at + 8].try_into().expect("8 bytes"));
                let mut at = start.len() + 5 * 8;
                for y in 0..5 {
                    assert_eq!(word(start.len() + 8 * y), at as u64, "line {y}");
                    assert_eq!(bytes[at..at + 4], u32::try_from(y).expect("small").to_le_bytes());
                    assert_eq!(word(at + 20), 4 * (y as u64 + 300), "bytes that are not packed");
                    at += 28 + usize::try_from(word(at + 4) + word(at + 12)).expect("small");
                }
                assert_eq!(at, bytes.len());
            }
            std::fs::remove_file(path).expect("it is there");
        }
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn a_full_disk_is_an_error() {
        let full = || OpenOptions::new().write(true).open("/dev/full").expect("a device that is always full");
        let error = write(full(), header(Compression::ZIP1, 5), 1, line).expect_err("nothing fits");
        assert_eq!(error.kind(), std::io::ErrorKind::StorageFull, "{error}");
    }
}
