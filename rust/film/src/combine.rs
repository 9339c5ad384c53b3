// SPDX-License-Identifier: Apache-2.0
//! Merges films: sums of the same octave are added, and octaves that follow each other from sample 0 on become one
//! plane, with the error measured at each.
//!
//! Guarantees: all files are read tile by tile, side by side, so memory does not grow with their number or size: some
//! tiles (below 64 MiB), and three rows for each octave that is measured. Blocking; any thread.

use crate::container::{FilmReader, write_film};
use crate::error::FilmError;
use crate::exact::ExactSums as _;
use crate::header::FilmHeader;
use crate::measure::{ErrorMeasurer, OctaveError, PixelState};
use crate::ranges::{SampleRange, joined, overlap};
use crate::tiles::{self, PIXEL, PlaneReader, TILE};
use oocpt_abi::ExactPixel;
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// Octaves, with one for the samples from 0 on that are whole.
const SLOTS: usize = 33;
/// Memory for tiles, bytes.
const TILE_MEMORY: usize = 40 << 20;
/// Most tiles at a time.
const MAX_TILES: usize = 16;

/// Merges film files into one: `parts` may come in any order.
///
/// # Errors
/// [`FilmError`], which names the part: it is damaged, was made of something else, or has samples that another has too.
pub fn merge(parts: &[PathBuf], film: &Path) -> Result<FilmHeader, FilmError> {
    let mut combination = FilmCombination::new(parts)?;
    let header = combination.header().clone();
    write_film(film, &header, |writer| {
        tiles::begin(writer)?;
        let errors = combination.run(|tiles| {
            let planes: Vec<&[ExactPixel]> = tiles.planes().collect();
            tiles::write(writer, &planes)
        })?;
        tiles::finish(writer, &errors)
    })?;
    Ok(header)
}

/// Some tiles of a merged film.
#[derive(Debug)]
pub(crate) struct FilmTiles {
    /// By slot; empty where the film has no samples. Slot 0 is what is whole from sample 0 on.
    slots: Vec<Vec<ExactPixel>>,
}

impl FilmTiles {
    /// The pixels of each plane, in the order of the header's.
    pub(crate) fn planes(&self) -> impl Iterator<Item = &[ExactPixel]> {
        self.slots.iter().filter(|slot| !slot.is_empty()).map(Vec::as_slice)
    }

    /// The pixels of the first plane, if it begins at sample 0.
    pub(crate) fn whole(&self) -> &[ExactPixel] {
        &self.slots[0]
    }
}

/// Film files that merge.
#[derive(Debug)]
pub(crate) struct FilmCombination {
    header: FilmHeader,
    parts: Vec<(PlaneReader, Vec<usize>)>,
    /// Errors that the part with sample 0 brings.
    errors: Vec<OctaveError>,
    /// Octaves that follow what is whole in that part, ascending: they are added to it.
    folded: Vec<usize>,
}

/// The slot of a plane.
pub(crate) fn slot(plane: &[SampleRange]) -> usize {
    plane.first().filter(|range| range.begin > 0).map_or(0, |range| range.octave() as usize)
}

impl FilmCombination {
    /// Opens files and finds out whether they merge.
    pub(crate) fn new(files: &[PathBuf]) -> Result<Self, FilmError> {
        let mut parts: Vec<(PlaneReader, Vec<usize>)> = Vec::new();
        for file in files {
            let reader = PlaneReader::new(FilmReader::open(file)?)?;
            check_together(&parts, &reader)?;
            let slots = reader.file().header().planes.iter().map(|plane| slot(plane)).collect();
            parts.push((reader, slots));
        }
        let Some((first, _)) = parts.first() else { return Err(FilmError::unfit("no file to merge")) };
        let mut header = FilmHeader { planes: Vec::new(), ..first.file().header().clone() };
        for (part, _) in &parts[1..] {
            note(&mut header, part.file().header());
        }
        let mut ranges: Vec<Vec<SampleRange>> = vec![Vec::new(); SLOTS];
        let mut errors = Vec::new();
        for (part, slots) in &parts {
            for (slot, plane) in slots.iter().zip(&part.file().header().planes) {
                ranges[*slot].extend(plane);
                if *slot == 0 {
                    errors = part.file().errors()?;
                }
            }
        }
        let folded = fold(&mut ranges);
        header.planes = ranges.into_iter().filter(|plane| !plane.is_empty()).collect();
        Ok(Self { header, parts, errors, folded })
    }

    /// What the merged film says of itself.
    pub(crate) fn header(&self) -> &FilmHeader {
        &self.header
    }

    /// Reads all files, and gives the merged film tile by tile. Returns the errors at all octaves that are whole.
    pub(crate) fn run(
        &mut self,
        mut sink: impl FnMut(&FilmTiles) -> Result<(), FilmError>,
    ) -> Result<Vec<OctaveError>, FilmError> {
        let mut left = tiles::pixels(&self.header);
        let mut measurers: Vec<ErrorMeasurer> =
            self.folded.iter().map(|k| ErrorMeasurer::new(&self.header, 1 << k)).collect();
        let slots = self.parts.iter().flat_map(|(_, slots)| slots).collect::<std::collections::BTreeSet<_>>().len();
        // The sums, and the planes of one part, packed and unpacked.
        let count = (TILE_MEMORY / (3 * slots.max(1) * TILE * PIXEL)).clamp(1, MAX_TILES);
        while left > 0 {
            let pixels = left.min(count * TILE);
            let mut tiles = self.read(count, pixels)?;
            for (k, measurer) in self.folded.iter().zip(&mut measurers) {
                let octave = std::mem::take(&mut tiles.slots[*k]);
                fold_octave(&mut tiles.slots[0], &octave, measurer);
            }
            sink(&tiles)?;
            left -= pixels;
        }
        let measured = measurers.into_iter().map(ErrorMeasurer::finish);
        Ok(self.errors.iter().cloned().chain(measured).collect())
    }

    /// The sums of all parts over some tiles.
    fn read(&mut self, count: usize, pixels: usize) -> Result<FilmTiles, FilmError> {
        let mut sums: Vec<Vec<ExactPixel>> = vec![Vec::new(); SLOTS];
        for (part, slots) in &mut self.parts {
            for (slot, plane) in slots.iter().zip(part.read(count)?) {
                let sum = &mut sums[*slot];
                if sum.is_empty() {
                    *sum = plane;
                } else {
                    sum.par_iter_mut().zip(&plane).for_each(|(sum, pixel)| sum.merge(pixel));
                }
            }
        }
        debug_assert!(sums.iter().all(|sum| sum.is_empty() || sum.len() == pixels), "films of one size");
        Ok(FilmTiles { slots: sums })
    }
}

/// Adds an octave to what is whole before it, and measures the error.
pub(crate) fn fold_octave(whole: &mut [ExactPixel], octave: &[ExactPixel], measurer: &mut ErrorMeasurer) {
    let state = |(sum, pixel): (&mut ExactPixel, &ExactPixel)| {
        let earlier = sum.mean();
        sum.merge(pixel);
        PixelState::new(sum, earlier)
    };
    measurer.take(whole.par_iter_mut().zip(octave).map(state));
}

/// Moves octaves that follow what is whole into slot 0, and returns their slots.
pub(crate) fn fold(ranges: &mut [Vec<SampleRange>]) -> Vec<usize> {
    let mut folded = Vec::new();
    for plane in ranges.iter_mut() {
        *plane = joined(plane.drain(..));
    }
    while let Some(SampleRange { end, .. }) = ranges[0].first().copied() {
        let next = SampleRange::new(end, end).octave() as usize;
        if ranges.get(next).is_none_or(|plane| *plane != [SampleRange::of_octave(end.ilog2() + 1)]) {
            break;
        }
        ranges[next].clear();
        ranges[0] = vec![SampleRange::new(0, 2 * end)];
        folded.push(next);
    }
    folded
}

/// Fails unless a part merges with those before.
fn check_together(parts: &[(PlaneReader, Vec<usize>)], part: &PlaneReader) -> Result<(), FilmError> {
    let refuse = |with: &PlaneReader, what: String| {
        let [path, with] = [part.file().path(), with.file().path()].map(Path::to_owned);
        Err(FilmError::Apart { path, with, what })
    };
    if let Some((first, _)) = parts.first() {
        let differences = part.file().header().differences(first.file().header());
        if !differences.is_empty() {
            return refuse(first, differences.join("; "));
        }
    }
    let samples = part.file().header().samples();
    for (before, _) in parts {
        if let Some(both) = overlap(&samples, &before.file().header().samples()) {
            return refuse(before, format!("both have samples {both}"));
        }
    }
    Ok(())
}

/// Adds what a film says of its making.
fn note(header: &mut FilmHeader, other: &FilmHeader) {
    header.nonfinite = header.nonfinite.saturating_add(other.nonfinite);
    header.milliseconds = header.milliseconds.saturating_add(other.milliseconds);
    header.device_bytes = header.device_bytes.max(other.device_bytes);
    header.devices.extend(other.devices.iter().cloned());
}
