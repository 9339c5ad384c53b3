// SPDX-License-Identifier: Apache-2.0
//! Planes of exact sums in a film file: block `planes`, tile after tile, and in each tile plane after plane. A tile is
//! [`TILE`] pixels in their order, the last one what is left. So films of any size are read and written by tiles.

use crate::container::{ChunkReader, FilmReader, FilmWriter, packed};
use crate::error::FilmError;
use crate::exact::ExactSums as _;
use crate::header::{FilmHeader, FilmKind};
use crate::measure::OctaveError;
use crate::ranges;
use oocpt_abi::ExactPixel;
use rayon::prelude::*;

/// Pixels of a tile.
pub(crate) const TILE: usize = 4096;
/// Name of the block of planes, and of that of the errors at the octaves of the first one.
const PLANES: &str = "planes";
const ERRORS: &str = "errors";
/// Bytes of a pixel in a plane.
pub(crate) const PIXEL: usize = size_of::<ExactPixel>();
/// Longest block of errors: 31 rows.
const LONGEST_ERRORS: u64 = 1 << 20;

/// Pixels as a number of things in memory.
pub(crate) fn pixels(header: &FilmHeader) -> usize {
    usize::try_from(header.pixels()).unwrap_or(usize::MAX)
}

/// Reads the planes of a file, some tiles at a time.
#[derive(Debug)]
pub(crate) struct PlaneReader {
    reader: FilmReader,
    chunks: ChunkReader,
    /// Samples of each plane.
    samples: Vec<u32>,
    /// Pixels that were not read yet.
    left: usize,
}

impl PlaneReader {
    /// Checks what a file says of itself.
    pub(crate) fn new(reader: FilmReader) -> Result<Self, FilmError> {
        let header = reader.header();
        if header.kind != FilmKind::Exact {
            let what = "it is a checkpoint, from which only its own render goes on".to_owned();
            return Err(FilmError::Foreign(reader.path().to_owned(), what));
        }
        let wrong = |what: &str| FilmError::damaged(reader.path(), what);
        let expected = header.pixels() * header.planes.len() as u64 * PIXEL as u64;
        let chunks = reader.chunks(PLANES)?;
        if reader.block_bytes(PLANES) != Some(expected) || chunks.stride() != PIXEL {
            return Err(wrong("its planes have another size than it says"));
        }
        let samples = header.planes.iter().map(|plane| ranges::samples(plane)).collect();
        let left = pixels(header);
        Ok(Self { chunks, samples, left, reader })
    }

    pub(crate) fn file(&self) -> &FilmReader {
        &self.reader
    }

    /// Reads the next tiles: of each plane, the pixels.
    pub(crate) fn read(&mut self, tiles: usize) -> Result<Vec<Vec<ExactPixel>>, FilmError> {
        let planes = self.samples.len();
        let count = tiles.min(self.left.div_ceil(TILE));
        let chunks = self.chunks.read(count * planes)?;
        let damaged = |what: &str| FilmError::damaged(self.reader.path(), what);
        let unpacked = chunks.par_iter().enumerate().map(|(index, chunk)| {
            let tile: Vec<ExactPixel> = bytemuck::pod_collect_to_vec(&self.chunks.unpack(chunk)?);
            let pixels = TILE.min(self.left - index / planes * TILE);
            let samples = self.samples[index % planes];
            if tile.len() != pixels || tile.iter().any(|pixel| pixel.samples != samples || !pixel.is_sound()) {
                return Err(damaged("pixels are not what its samples give"));
            }
            Ok(tile)
        });
        let unpacked: Vec<_> = unpacked.collect::<Result<_, FilmError>>()?;
        self.left -= (count * TILE).min(self.left);
        if self.left == 0 && planes > 0 && !self.chunks.is_at_end() {
            return Err(damaged("its planes are too long"));
        }
        let mut all: Vec<Vec<ExactPixel>> = vec![Vec::new(); planes];
        for (index, tile) in unpacked.into_iter().enumerate() {
            all[index % planes].extend_from_slice(&tile);
        }
        Ok(all)
    }
}

impl FilmReader {
    /// The errors at powers of two of the samples, as far as the film has all from sample 0 on; empty for checkpoints.
    ///
    /// # Errors
    /// [`FilmError`].
    pub fn errors(&self) -> Result<Vec<OctaveError>, FilmError> {
        if self.header().whole() == 0 {
            return Ok(Vec::new());
        }
        let wrong = |what: &str| FilmError::damaged(self.path(), what);
        let bytes = self.block(ERRORS, LONGEST_ERRORS)?;
        let errors: Vec<OctaveError> =
            serde_json::from_slice(&bytes).map_err(|_wrong| wrong("its errors cannot be read"))?;
        let octaves = (1..32).map(|octave| 1_u32 << octave).take_while(|samples| *samples <= self.header().whole());
        if octaves.eq(errors.iter().map(|error| error.samples)) {
            Ok(errors)
        } else {
            Err(wrong("its errors are not those of its octaves"))
        }
    }
}

/// Begins the block of planes.
pub(crate) fn begin(writer: &mut FilmWriter) -> Result<(), FilmError> {
    writer.begin_block(PLANES, u32::try_from(PIXEL).unwrap_or(u32::MAX))
}

/// Writes some tiles: of each plane, the pixels; only the last ones of the film are not whole tiles.
pub(crate) fn write(writer: &mut FilmWriter, planes: &[&[ExactPixel]]) -> Result<(), FilmError> {
    let tiles = planes.first().map_or(0, |plane| plane.len().div_ceil(TILE));
    let places: Vec<(usize, usize)> = (0..tiles).flat_map(|tile| (0..planes.len()).map(move |p| (tile, p))).collect();
    let pack = |(tile, plane): &(usize, usize)| {
        let pixels = planes[*plane];
        packed(bytemuck::cast_slice(&pixels[tile * TILE..pixels.len().min((tile + 1) * TILE)]), PIXEL)
    };
    let chunks: Vec<_> = places.par_iter().map(pack).collect();
    chunks.iter().try_for_each(|chunk| writer.chunk(chunk))
}

/// Ends the block of planes, and puts the errors.
pub(crate) fn finish(writer: &mut FilmWriter, errors: &[OctaveError]) -> Result<(), FilmError> {
    writer.end_block()?;
    let text = serde_json::to_vec(errors).map_err(|error| FilmError::unfit(error.to_string()))?;
    writer.block(ERRORS, &text)
}
