// SPDX-License-Identifier: Apache-2.0
//! The part of a film that a render makes: exact sums of its samples, which merge with those of other renders.
//!
//! Beside the plain film the device keeps an `ExactPixel` for each pixel. Each octave of samples has sums of its own
//! (the error is measured at their ends): where one ends nothing is under way, its records are copied to the host, and
//! begin again from nothing. The file is written when the render ends; one that was given up has the octaves that are
//! whole, and the last one if no pixel has more samples of it than another. Render thread only.

use crate::error::RenderError;
use crate::film::Film;
use crate::frame::film_header::film_header;
use crate::frame::film_transfer::FilmTransfer;
use crate::job::RenderJob;
use crate::job::request::Severity;
use crate::job::shared::SharedState;
use oocpt_abi::ExactPixel;
use oocpt_core::pixel_filter::PixelFilterKind;
use oocpt_film::{FilmError, FilmHeader, FilmKind, SampleRange};
use oocpt_gpu::Gpu;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

/// What forbids a film part of a job that asks for one, in words.
fn obstacle(job: &RenderJob) -> Option<&'static str> {
    let settings = &job.settings;
    if settings.interactive {
        Some("a render that shows images on the way makes no part of a film")
    } else if settings.adaptive_sampling {
        Some("samples of oocpt:adaptiveSampling do not merge")
    } else if settings.straggler_roulette {
        Some("samples of oocpt:stragglerRoulette do not merge")
    } else if settings.pixel_filter == PixelFilterKind::Mitchell {
        Some("samples of a filter that is negative in part (oocpt:pixelFilter mitchell) do not merge")
    } else {
        None
    }
}

/// Whether a job makes a part of a film; the user is told if it asks for one and cannot.
pub(crate) fn makes_part(shared: &SharedState, job: &RenderJob) -> bool {
    if job.settings.film_part.is_empty() {
        return false;
    }
    let obstacle = obstacle(job);
    if let Some(obstacle) = obstacle {
        complain(shared, obstacle);
    }
    obstacle.is_none()
}

fn complain(shared: &SharedState, text: &str) {
    shared.report(Severity::Error, format!("oocpt:filmPart: {text}"));
}

/// See the module.
#[derive(Debug)]
pub(crate) struct FilmPart {
    path: PathBuf,
    film: oocpt_film::Film,
    transfer: FilmTransfer,
    gpu: Arc<Gpu>,
    /// First sample of the records on the device.
    begin: u32,
    started: Instant,
}

impl FilmPart {
    /// A part of `job` without samples, whose first is to be `begin`.
    pub(crate) fn new(job: &RenderJob, gpu: &Arc<Gpu>, begin: u32) -> Result<Self, RenderError> {
        let header = FilmHeader { kind: FilmKind::Exact, ..film_header(job, gpu.report()) };
        Ok(Self {
            path: PathBuf::from(&job.settings.film_part),
            film: oocpt_film::Film::new(header).map_err(internal)?,
            transfer: FilmTransfer::new(gpu)?,
            gpu: Arc::clone(gpu),
            begin,
            started: Instant::now(),
        })
    }

    /// Takes the records of samples before `end`, which are those of whole samples of one octave, off the device.
    pub(crate) fn take(&mut self, film: &Film, end: u32) -> Result<(), RenderError> {
        if end <= self.begin {
            return Ok(());
        }
        let Some((records, at)) = film.exact_records() else { return Ok(()) };
        let mut bytes = Vec::new();
        self.transfer.take(records, at..records.size(), &mut bytes)?;
        self.transfer.clear(records, at..records.size())?;
        let plane: Vec<ExactPixel> = bytemuck::pod_collect_to_vec(&bytes);
        drop(bytes);
        self.film.add(SampleRange::new(self.begin, end), plane).map_err(internal)?;
        self.begin = end;
        Ok(())
    }

    /// Writes the file.
    pub(crate) fn write(&mut self, shared: &SharedState, nonfinite: u64) {
        let millis = u64::try_from(self.started.elapsed().as_millis()).unwrap_or(u64::MAX);
        let peak = self.gpu.memory().peak;
        self.film.note(|header| {
            header.nonfinite = nonfinite;
            header.milliseconds = millis;
            header.device_bytes = peak;
        });
        if let Err(error) = self.film.write(&self.path) {
            complain(shared, &error.to_string());
        }
    }

    /// What of the samples before `end`, in words, is not in the file.
    pub(crate) fn lacks(&self, end: u32) -> Option<String> {
        (self.begin < end).then(|| {
            let first = self.film.header().samples().first().map_or(self.begin, |range| range.begin);
            format!("it ended early: the film has samples {first}..{} of each pixel", self.begin)
        })
    }

    /// Tells that the file does not have all samples.
    pub(crate) fn tell(&self, shared: &SharedState, end: u32) {
        if let Some(text) = self.lacks(end) {
            shared.report(Severity::Warning, format!("oocpt:filmPart: {text}"));
        }
    }
}

fn internal(error: FilmError) -> RenderError {
    RenderError::Internal(error.to_string())
}
