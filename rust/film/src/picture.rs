// SPDX-License-Identifier: Apache-2.0
//! The picture of a film, and what is known of its error.

use crate::combine::FilmCombination;
use crate::error::FilmError;
use crate::exact::ExactSums as _;
use crate::film::ExactFilm;
use crate::header::{FilmHeader, FilmView};
use crate::measure::{ErrorMeasurer, OctaveError, PixelState, estimates};
use crate::ranges::{self, SampleRange, missing};
use crate::tiles::{self, TILE};
use oocpt_abi::ExactPixel;
use oocpt_core::convergence::ErrorEstimate;
use rayon::prelude::*;
use std::path::PathBuf;

/// Pixels of a film in memory that are shown at a time.
const AT_ONCE: usize = 16 * TILE;

/// The picture of a film.
#[derive(Clone, Debug)]
pub struct FilmPicture {
    /// What the film says of itself; its window is what the picture shows.
    pub header: FilmHeader,
    /// Four floats a pixel, bottom row first: linear colour, premultiplied, and alpha.
    pub rgba: Vec<f32>,
    /// Samples of each pixel.
    pub samples: u32,
    /// Samples that are missing before the last one; without them nothing is known of the error of the whole.
    pub missing: Vec<SampleRange>,
    /// The errors at powers of two, and at the end.
    pub errors: Vec<OctaveError>,
}

impl FilmPicture {
    /// The estimated error of this picture.
    #[must_use]
    pub fn error(&self) -> Option<ErrorEstimate> {
        let last = self.errors.last().filter(|last| last.samples == self.samples)?;
        estimates(&self.errors).last().copied().flatten().filter(|_| last.samples > 1)
    }
}

/// Makes the picture of film files that merge. Only with `partial` may samples be missing.
///
/// # Errors
/// [`FilmError`], as [`crate::merge`]; [`FilmError::Missing`]: samples are missing.
pub fn picture(films: &[PathBuf], partial: bool) -> Result<FilmPicture, FilmError> {
    let mut combination = FilmCombination::new(films)?;
    let header = combination.header().clone();
    let all = header.samples();
    let samples = ranges::samples(&all);
    let missing = missing(&all, all.last().map_or(0, |range| range.end));
    let name = || films.first().cloned().unwrap_or_default();
    if samples == 0 {
        return Err(FilmError::Missing(name(), "it has no samples".to_owned()));
    }
    if !missing.is_empty() && !partial {
        let holes: Vec<String> = missing.iter().map(ToString::to_string).collect();
        return Err(FilmError::Missing(name(), format!("samples {} are missing", holes.join(", "))));
    }
    let mut rgba: Vec<f32> = Vec::new();
    let mut last = (missing.is_empty() && samples != header.whole()).then(|| ErrorMeasurer::new(&header, samples));
    let mut errors = combination.run(|tiles| {
        show(&mut rgba, (tiles.planes(), tiles.whole()), &mut last, &header.view);
        Ok(())
    })?;
    errors.extend(last.map(ErrorMeasurer::finish));
    Ok(FilmPicture { header, rgba, samples, missing, errors })
}

impl ExactFilm {
    /// The picture of the samples that it has, some of which may be missing: the bits and the errors that [`picture`]
    /// gives of its file. Without samples it has no pixels.
    #[must_use]
    pub fn picture(&self) -> FilmPicture {
        let header = self.header().clone();
        let all = header.samples();
        let samples = ranges::samples(&all);
        let missing = missing(&all, all.last().map_or(0, |range| range.end));
        let is_between = missing.is_empty() && samples != header.whole();
        let mut last = is_between.then(|| ErrorMeasurer::new(&header, samples));
        let mut rgba: Vec<f32> = Vec::new();
        let pixels = tiles::pixels(&header);
        for first in (0..pixels).step_by(AT_ONCE) {
            let end = pixels.min(first + AT_ONCE);
            let planes = self.planes().map(|plane| &plane[first..end]);
            show(&mut rgba, (planes, self.whole().get(first..end).unwrap_or_default()), &mut last, &header.view);
        }
        let errors = self.errors().iter().cloned().chain(last.map(ErrorMeasurer::finish)).collect();
        FilmPicture { header, rgba, samples, missing, errors }
    }
}

/// Adds the colours of some pixels, which have these planes, of which one may be `whole` from sample 0 on; measures
/// their error if that is not known.
fn show<'a>(
    rgba: &mut Vec<f32>,
    (mut planes, whole): (impl Iterator<Item = &'a [ExactPixel]>, &[ExactPixel]),
    last: &mut Option<ErrorMeasurer>,
    view: &FilmView,
) {
    let mut total = planes.next().unwrap_or_default().to_vec();
    planes.for_each(|plane| total.par_iter_mut().zip(plane).for_each(|(sum, pixel)| sum.merge(pixel)));
    if let Some(measurer) = last {
        let state = |(sum, whole): (&ExactPixel, &ExactPixel)| PixelState::new(sum, whole.mean());
        measurer.take(total.par_iter().zip(whole).map(state));
    }
    rgba.par_extend(total.par_iter().flat_map_iter(|pixel| color(pixel, view)));
}

/// The colour of a pixel, as `resolve.comp` makes it.
#[expect(clippy::cast_possible_truncation, reason = "rounds to the nearest")]
fn color(pixel: &ExactPixel, view: &FilmView) -> [f32; 4] {
    let ([r, g, b], alpha) = (pixel.mean(), pixel.alpha_mean() as f32);
    let mean = [r as f32 * view.exposure, g as f32 * view.exposure, b as f32 * view.exposure, alpha];
    let mut color = view.clear_color.map(|clear| clear * (1.0 - alpha));
    color.iter_mut().zip(mean).for_each(|(color, mean)| *color += mean);
    color
}
