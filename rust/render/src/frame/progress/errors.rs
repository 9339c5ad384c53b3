// SPDX-License-Identifier: Apache-2.0
//! The error of the picture: when it is measured, and what follows from it.

use super::FrameProgress;
use crate::error::RenderError;
use crate::film::Film;
use crate::film::adaptive::AdaptiveBuffers;
use crate::film::measure::{self, MeasuredError};
use crate::report::error_log::RowMoment;
use crate::sync::lock;
use crate::wave::{LAST_SLOT, next_boundary};
use oocpt_core::adaptive::AdaptiveUsage;
use oocpt_core::convergence::PictureErrorSums;
use std::time::Instant;

impl FrameProgress<'_> {
    /// Whether waves are to end where octaves of samples do.
    pub(crate) fn wants_octaves(&self) -> bool {
        self.log.wants_octaves()
    }

    /// Whether a submission that completes these octaves is to end with an image, to be compared.
    pub(crate) fn compares(&self, octaves: &[u32]) -> bool {
        !octaves.is_empty() && self.log.wants_pictures()
    }

    /// Paths that may begin, by the target error.
    pub(crate) fn open_paths(&self) -> u64 {
        self.log.open_paths().min(self.total_paths()).min(self.decided.unwrap_or(u64::MAX))
    }

    /// Learns which samples are decided, if they do not go everywhere alike; gives the paths that no wave may go
    /// across.
    pub(crate) fn begin_samples(&mut self, film: &Film) -> Vec<u64> {
        self.decided = film.adaptive().map(AdaptiveBuffers::end);
        film.adaptive().map_or_else(Vec::new, AdaptiveBuffers::cuts)
    }

    /// Relative variance that a path leaves in its pixel, by the picture's error as last estimated.
    pub(crate) fn variance_per_path(&self) -> Option<f64> {
        let stats = lock(&self.shared.stats);
        let row = stats.error.as_ref()?;
        Some(row.estimate?.rel_mse * f64::from(row.samples))
    }

    /// Whether the error of the samples done is not known from an octave that they are.
    pub(crate) fn ends_between_octaves(&self) -> bool {
        let boundary = || next_boundary(self.done - 1, self.pixels).1;
        let is_whole = self.first_sample == 0 && self.done >= self.pixels;
        let has_ended_one = self.done == self.decided.unwrap_or_else(boundary) && !self.log.knows_nothing();
        is_whole && !has_ended_one && !self.is_told()
    }

    /// Takes what the film measured of these octaves, once their submission is done.
    pub(crate) fn octaves(&mut self, film: &Film, octaves: &[u32]) -> Result<(), RenderError> {
        // The film of a later range has other samples than an octave.
        let rows = octaves.iter().filter(|_| self.first_sample == 0).copied().collect::<Vec<_>>();
        rows.into_iter().try_for_each(|octave| self.error_row(film, octave, Some(octave)))?;
        if let Some(adaptive) = film.adaptive().filter(|_| !octaves.is_empty() && !self.log.is_good_enough()) {
            adaptive.advance()?;
            self.decided = Some(adaptive.end());
        }
        Ok(())
    }

    /// As [`Self::octaves`], for the last picture; `measured` unless an octave was its end.
    pub(crate) fn error_at_end(&mut self, film: &Film, measured: bool) -> Result<(), RenderError> {
        if measured {
            self.error_row(film, LAST_SLOT, None)?;
        }
        self.log.finish(self.shared);
        Ok(())
    }

    /// Has the errors of the pixels add up to the told error of the picture, once the film was measured at the end.
    pub(crate) fn scale_errors(&self, film: &Film) -> Result<(), RenderError> {
        let measured = measure::read(film, LAST_SLOT, &self.layout)?;
        if let Some(MeasuredError { sums, .. }) = measured {
            self.scale_errors_by(film, &sums);
        }
        Ok(())
    }

    #[expect(clippy::cast_possible_truncation, reason = "a factor of an image of f32")]
    fn scale_errors_by(&self, film: &Film, sums: &PictureErrorSums) {
        let estimate = lock(&self.shared.stats).error.as_ref().and_then(|row| row.estimate);
        // Those of a window are scaled with the whole picture.
        let estimate = estimate.filter(|_| self.window.is_none());
        if let Some(estimate) = estimate.filter(|_| sums.s > 0.0) {
            film.scale_errors((estimate.rel_mse * sums.pixels / sums.s) as f32);
        }
    }

    fn error_row(&mut self, film: &Film, slot: u32, octave: Option<u32>) -> Result<(), RenderError> {
        let Some(measured) = measure::read(film, slot, &self.layout)? else { return Ok(()) };
        let streaming = lock(&self.shared.stats).streaming.clone();
        // Streaming knows when the device had something to do.
        let counts = !(streaming.in_core || streaming.is_split);
        let tracing = if counts { streaming.seconds_tracing } else { self.trace_started.elapsed().as_secs_f64() };
        let moment = RowMoment {
            seconds: self.started.elapsed().as_secs_f64(),
            seconds_tracing: tracing,
            bytes_paged: streaming.bytes_paged,
            gpu_bytes: film.device_bytes(),
            // Streaming counts what is handed to the device; an epoch is all there is then.
            samples: if self.decided.is_some() { self.samples_done() } else { measured.fewest },
            has_picture: true,
        };
        if let Some(usage) = film.adaptive().and_then(AdaptiveBuffers::usage) {
            let MeasuredError { fewest, most, .. } = measured;
            lock(&self.shared.stats).adaptive = Some(AdaptiveUsage { fewest, most, ..usage });
        }
        let (began, sums) = (Instant::now(), measured.sums);
        self.log.row(self.shared, measured, octave, moment);
        self.scale_errors_by(film, &sums);
        if self.log.wants_pictures() {
            // Comparing with a reference is no part of rendering.
            self.started += began.elapsed();
            self.trace_started += began.elapsed();
        }
        Ok(())
    }
}
