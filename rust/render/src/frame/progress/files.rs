// SPDX-License-Identifier: Apache-2.0
//! Samples that leave the render by files: checkpoints, and parts of films that merge.

use super::FrameProgress;
use crate::error::RenderError;
use crate::film::Film;
use crate::frame::checkpoint::FilmCheckpoints;
use crate::frame::film_part::FilmPart;
use crate::frame::film_transfer::FilmTransfer;
use crate::frame::kept_samples::KeptSamples;
use crate::job::RenderJob;
use crate::sync::lock;
use oocpt_gpu::{Buffer, Gpu};
use std::sync::Arc;
use std::sync::atomic::Ordering;

impl FrameProgress<'_> {
    /// Has the checkpoints made that `job` asks for. With `is_empty` the film has no samples: it gets those of the
    /// file, which the render goes on with.
    pub(crate) fn begin_checkpoints(
        &mut self,
        job: &RenderJob,
        gpu: &Arc<Gpu>,
        film: &Film,
        is_empty: bool,
    ) -> Result<(), RenderError> {
        self.checkpoints = None; // of an attempt before this one: its last file is finished
        let Some(checkpoints) = FilmCheckpoints::of(self.shared, job, gpu, film) else { return Ok(()) };
        let restored = checkpoints.restored(self.shared, job, film, is_empty)?;
        if let Some((checkpoints, kept)) = restored {
            self.checkpoints = Some(checkpoints);
            if let Some(kept) = kept {
                self.lacks_planes = true;
                self.go_on(kept, job);
            }
        }
        Ok(())
    }

    /// Whether a checkpoint is to be made as soon as nothing is under way.
    pub(crate) fn wants_checkpoint(&self) -> bool {
        let is_whole = self.done >= self.pixels;
        let is_due = |checkpoints: &FilmCheckpoints| {
            let wanted = self.shared.wants_checkpoint.load(Ordering::Relaxed);
            checkpoints.is_due(self.done, wanted)
        };
        is_whole && self.checkpoints.as_ref().is_some_and(is_due)
    }

    /// Makes a checkpoint of what the film has; nothing is under way. `counters` are those of the stage.
    pub(crate) fn make_checkpoint(
        &mut self,
        job: &RenderJob,
        film: &Film,
        counters: &Buffer,
    ) -> Result<(), RenderError> {
        let Some(kept) = self.samples(job, film) else { return Ok(()) };
        let kept = KeptSamples { nonfinite: (self.before.nonfinite, kept.nonfinite.1), ..kept };
        self.shared.wants_checkpoint.store(false, Ordering::Relaxed);
        match &mut self.checkpoints {
            Some(checkpoints) => checkpoints.make(self.shared, film, kept, Some(counters)),
            None => Ok(()),
        }
    }

    /// Makes the last checkpoint of the render, and waits until it is written.
    pub(crate) fn end_checkpoints(&mut self, job: &RenderJob, film: &Film) -> Result<(), RenderError> {
        let Some(mut checkpoints) = self.checkpoints.take() else { return Ok(()) };
        checkpoints.end(self.shared, film, self.samples(job, film))
    }

    /// Begins with the first sample of the span that `job` asks for, and a part of a film if the film has sums for it.
    pub(crate) fn begin_part(&mut self, job: &RenderJob, gpu: &Arc<Gpu>, film: &Film) -> Result<(), RenderError> {
        let Some(records) = film.records() else { return Ok(()) };
        self.part = None; // of an attempt before this one: its last samples are in the film
        self.part = film.has_exact_sums().then(|| FilmPart::new(job, gpu)).transpose()?;
        self.first_sample = self.part.as_ref().map_or(job.settings.span.begin, FilmPart::begin);
        if self.first_sample > 0 {
            FilmTransfer::new(gpu)?.clear(records, 0)?;
            self.done = self.pixels * u64::from(self.first_sample);
            (self.kept, self.lacks_planes) = (Some(self.done), true);
        }
        Ok(())
    }

    /// Takes the sums of the octave that is done; nothing is under way.
    pub(crate) fn take_part(&mut self, film: &Film) -> Result<(), RenderError> {
        let end = self.samples_done();
        let Some(part) = &mut self.part else { return Ok(()) };
        part.take(film, end)?;
        if part.is_due() {
            // What is not finite is counted at the end of this process: a few more or less change no sample.
            part.write(self.shared, 0)?;
        }
        Ok(())
    }

    /// Writes the part of the film.
    pub(crate) fn end_part(&mut self, film: &Film) -> Result<(), RenderError> {
        let Some(mut part) = self.part.take() else { return Ok(()) };
        if self.done.is_multiple_of(self.pixels.max(1)) {
            part.take(film, self.samples_done())?;
        }
        let nonfinite = lock(&self.shared.stats).nonfinite_samples;
        part.write(self.shared, nonfinite)?;
        part.tell(self.shared);
        Ok(())
    }
}
