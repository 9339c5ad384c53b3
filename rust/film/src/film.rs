// SPDX-License-Identifier: Apache-2.0
//! A film in host memory: a render adds planes of samples to it, and writes it.

use crate::combine::{FilmCombination, fold, fold_octave, slot};
use crate::container::write_film;
use crate::error::FilmError;
use crate::exact::ExactSums as _;
use crate::header::{FilmHeader, FilmKind};
use crate::measure::{ErrorMeasurer, OctaveError};
use crate::ranges::{SampleRange, overlap};
use crate::tiles::{self, TILE};
use oocpt_abi::ExactPixel;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::Path;

/// Exact sums in host memory. Planes of octaves that follow each other from sample 0 on are one, and the error is
/// measured as each octave becomes whole.
#[derive(Clone, Debug)]
pub struct ExactFilm {
    header: FilmHeader,
    /// Samples and pixels by slot: 0 is what is whole from sample 0 on, others are octaves.
    planes: BTreeMap<usize, (Vec<SampleRange>, Vec<ExactPixel>)>,
    errors: Vec<OctaveError>,
}

impl ExactFilm {
    /// A film without samples: `header` tells what they will depend on; its planes are taken for none.
    ///
    /// # Errors
    /// [`FilmError::Unfit`]: it is the header of a checkpoint, or its window is no part of a picture.
    pub fn new(header: FilmHeader) -> Result<Self, FilmError> {
        let header = FilmHeader { planes: Vec::new(), ..header };
        if header.kind != FilmKind::Exact {
            return Err(FilmError::unfit("it is for exact sums"));
        }
        header.check().map_err(FilmError::unfit)?;
        Ok(Self { header, planes: BTreeMap::new(), errors: Vec::new() })
    }

    /// What it says of itself.
    #[must_use]
    pub fn header(&self) -> &FilmHeader {
        &self.header
    }

    /// The errors at the octaves that are whole from sample 0 on.
    #[must_use]
    pub fn errors(&self) -> &[OctaveError] {
        &self.errors
    }

    /// The pixels of each plane, in the order of the header's.
    pub(crate) fn planes(&self) -> impl Iterator<Item = &[ExactPixel]> {
        self.planes.values().map(|(_, pixels)| pixels.as_slice())
    }

    /// The pixels of the first plane, if it begins at sample 0.
    pub(crate) fn whole(&self) -> &[ExactPixel] {
        self.planes.get(&0).map_or(&[], |(_, pixels)| pixels)
    }

    /// Adds what it cost to render so far: samples that were not finite, time, memory, the device.
    pub fn note(&mut self, nonfinite: u64, milliseconds: u64, device_bytes: u64, device: &str) {
        let header = &mut self.header;
        header.nonfinite = header.nonfinite.saturating_add(nonfinite);
        header.milliseconds = header.milliseconds.saturating_add(milliseconds);
        header.device_bytes = header.device_bytes.max(device_bytes);
        header.devices.insert(device.to_owned());
    }

    /// Adds the sums over samples of one octave ([`SampleRange::pieces`]): a record for each pixel `y * width + x`.
    ///
    /// # Errors
    /// [`FilmError::Unfit`]: a range of two octaves, samples that the film has, another number of pixels, or records of
    /// other numbers of samples.
    pub fn add(&mut self, range: SampleRange, plane: Vec<ExactPixel>) -> Result<(), FilmError> {
        if !range.is_in_octave() {
            return Err(FilmError::unfit(format!("samples {range} are not of one octave")));
        }
        if overlap(&self.header.samples(), &[range]).is_some() {
            return Err(FilmError::unfit(format!("it has some of samples {range}")));
        }
        let is_wrong = |pixel: &ExactPixel| pixel.samples != range.samples() || !pixel.is_sound();
        if plane.len() as u64 != self.header.pixels() || plane.par_iter().any(is_wrong) {
            return Err(FilmError::unfit(format!("no plane of samples {range}")));
        }
        let (ranges, sums) = self.planes.entry(range.octave() as usize).or_default();
        ranges.push(range);
        if sums.is_empty() {
            *sums = plane;
        } else {
            sums.par_iter_mut().zip(&plane).for_each(|(sum, pixel)| sum.merge(pixel));
        }
        self.fold();
        Ok(())
    }

    /// Makes one plane of octaves that follow each other from sample 0 on.
    fn fold(&mut self) {
        let end = self.planes.keys().last().map_or(1, |slot| slot + 1);
        let mut ranges: Vec<Vec<SampleRange>> = vec![Vec::new(); end];
        for (slot, (plane, _)) in &self.planes {
            ranges[*slot].clone_from(plane);
        }
        for octave in fold(&mut ranges) {
            let (Some((_, pixels)), Some((_, whole))) = (self.planes.remove(&octave), self.planes.get_mut(&0)) else {
                continue;
            };
            let mut measurer = ErrorMeasurer::new(&self.header, 1 << octave);
            fold_octave(whole, &pixels, &mut measurer);
            self.errors.push(measurer.finish());
        }
        for (slot, (plane, _)) in &mut self.planes {
            plane.clone_from(&ranges[*slot]);
        }
        self.header.planes = self.planes.values().map(|(plane, _)| plane.clone()).collect();
    }

    /// Writes it.
    ///
    /// # Errors
    /// [`FilmError::File`].
    pub fn write(&self, path: &Path) -> Result<(), FilmError> {
        write_film(path, &self.header, |writer| {
            tiles::begin(writer)?;
            let pixels = tiles::pixels(&self.header);
            for first in (0..pixels).step_by(16 * TILE) {
                let end = pixels.min(first + 16 * TILE);
                let planes: Vec<_> = self.planes.values().map(|(_, pixels)| &pixels[first..end]).collect();
                tiles::write(writer, &planes)?;
            }
            tiles::finish(writer, &self.errors)
        })
    }

    /// Reads a film that takes at most `most_bytes` of memory.
    ///
    /// # Errors
    /// [`FilmError`]; [`FilmError::Missing`]: it takes more.
    pub fn read(path: &Path, most_bytes: u64) -> Result<Self, FilmError> {
        let mut file = FilmCombination::new(&[path.to_owned()])?;
        let header = file.header().clone();
        let bytes = header.pixels() * header.planes.len() as u64 * size_of::<ExactPixel>() as u64;
        if bytes > most_bytes {
            return Err(FilmError::Missing(path.to_owned(), format!("it takes {bytes} bytes, more than {most_bytes}")));
        }
        let mut all: Vec<Vec<ExactPixel>> = vec![Vec::new(); header.planes.len()];
        let errors = file.run(|tiles| {
            all.iter_mut().zip(tiles.planes()).for_each(|(plane, pixels)| plane.extend_from_slice(pixels));
            Ok(())
        })?;
        let planes =
            header.planes.iter().map(|plane| slot(plane)).zip(header.planes.iter().cloned().zip(all)).collect();
        Ok(Self { header, planes, errors })
    }
}
