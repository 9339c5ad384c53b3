// SPDX-License-Identifier: Apache-2.0
//! The part of a film that a render makes: exact sums of its samples, which merge with those of other renders.
//!
//! Beside the plain film the device keeps an `ExactPixel` for each pixel. Each octave of samples has sums of its own
//! (the error is measured at their ends): where one ends nothing is under way, its records are copied to the host, and
//! begin again from nothing; a thread adds them to the film while the next octave is rendered. The file is written when
//! the render ends, and where an octave does if that is later than the interval of checkpoints: a render that was
//! killed goes on from there. One that was given up has the octaves that are whole, and the last one if no pixel has
//! more samples of it than another. Render thread only.

use crate::error::RenderError;
use crate::film::Film;
use crate::frame::film_header::{device_text, film_header};
use crate::frame::film_transfer::FilmTransfer;
use crate::job::RenderJob;
use crate::job::request::Severity;
use crate::job::shared::SharedState;
use oocpt_abi::ExactPixel;
use oocpt_core::pixel_filter::PixelFilterKind;
use oocpt_film::{ExactFilm, FilmError, FilmHeader, FilmKind, FilmReader, SampleRange};
use oocpt_gpu::Gpu;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Temporary files of processes that were killed are removed after so long without a change.
pub(crate) const STALE: Duration = Duration::from_secs(600);

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
    } else if job.snapshot.surfaces.catches_shadows() {
        Some("the alpha of shadow catchers does not merge")
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
        // A live view renders anew with each edit.
        if !job.settings.interactive || !shared.told_of_live_views.swap(true, Ordering::Relaxed) {
            complain(shared, obstacle);
        }
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
    /// The film; none while a thread adds to it, or if that failed.
    film: Option<ExactFilm>,
    adding: Option<JoinHandle<Result<ExactFilm, FilmError>>>,
    transfer: FilmTransfer,
    gpu: Arc<Gpu>,
    /// Samples that are to be rendered, the first of the records on the device, and the first of the film.
    end: u32,
    begin: u32,
    first: u32,
    interval: Duration,
    next: Instant,
    /// Since when the file knows of no time.
    noted: Instant,
    /// Samples that are not finite, of which the file knows.
    nonfinite: u64,
}

impl FilmPart {
    /// The part of `job`: that of its file, if it was not finished, or one without samples.
    pub(crate) fn new(job: &RenderJob, gpu: &Arc<Gpu>) -> Result<Self, RenderError> {
        let settings = &job.settings;
        let path = PathBuf::from(&settings.film_part);
        oocpt_files::remove_stale(&path, STALE);
        let header = FilmHeader { kind: FilmKind::Exact, ..film_header(job, gpu.report()) };
        let (first, end) = (settings.span.begin, settings.samples_per_pixel);
        let film = match unfinished(&path, &header, first, end) {
            Some(film) => film,
            None => ExactFilm::new(header).map_err(internal)?,
        };
        let interval = Duration::try_from_secs_f32(settings.checkpoint_secs).unwrap_or(Duration::MAX);
        let now = Instant::now();
        Ok(Self {
            path,
            begin: film.header().samples().last().map_or(first, |range| range.end),
            film: Some(film),
            adding: None,
            transfer: FilmTransfer::new(gpu)?,
            gpu: Arc::clone(gpu),
            end,
            first,
            interval,
            next: now.checked_add(interval).unwrap_or(now),
            noted: now,
            nonfinite: 0,
        })
    }

    /// The first sample that the file does not have.
    pub(crate) fn begin(&self) -> u32 {
        self.begin
    }

    /// Whether the file is to be written at the end of an octave.
    pub(crate) fn is_due(&self) -> bool {
        self.begin < self.end && Instant::now() >= self.next
    }

    /// Takes the records of samples before `end`, which are those of whole samples of one octave, off the device.
    pub(crate) fn take(&mut self, film: &Film, end: u32) -> Result<(), RenderError> {
        if end <= self.begin {
            return Ok(());
        }
        let Some((records, at)) = film.exact_records() else { return Ok(()) };
        self.settle()?;
        let bytes = usize::try_from(records.size() - at).unwrap_or(usize::MAX);
        let mut plane: Vec<ExactPixel> = bytemuck::zeroed_vec(bytes / size_of::<ExactPixel>());
        self.transfer.take(records, at, bytemuck::cast_slice_mut(&mut plane))?;
        self.transfer.clear(records, at)?;
        // The film stays here until all records have come: a device that is lost leaves what is whole.
        let mut film = self.film.take().ok_or_else(lost)?;
        let range = SampleRange::new(self.begin, end);
        let add = move || film.add(range, plane).map(|()| film);
        let thread = std::thread::Builder::new().name("oocpt-film".into()).spawn(add);
        self.adding = Some(thread.map_err(|error| RenderError::Internal(error.to_string()))?);
        self.begin = end;
        Ok(())
    }

    /// Waits until nothing is being added to the film.
    fn settle(&mut self) -> Result<(), RenderError> {
        if let Some(adding) = self.adding.take() {
            self.film = Some(adding.join().map_err(|_panic| lost())?.map_err(internal)?);
        }
        Ok(())
    }

    /// Writes the file; `nonfinite` samples of this render were not finite.
    pub(crate) fn write(&mut self, shared: &SharedState, nonfinite: u64) {
        let began = Instant::now();
        let millis = u64::try_from(began.duration_since(self.noted).as_millis()).unwrap_or(u64::MAX);
        let since = nonfinite.saturating_sub(self.nonfinite);
        (self.noted, self.nonfinite) = (began, nonfinite);
        let settled = self.settle().and_then(|()| self.film.as_mut().ok_or_else(lost));
        let written = settled.map_err(|error| error.to_string()).and_then(|film| {
            film.note(since, millis, self.gpu.memory().peak, &device_text(self.gpu.report()));
            film.write(&self.path).map_err(|error| error.to_string())
        });
        if let Err(text) = written {
            complain(shared, &text);
        }
        let now = Instant::now();
        self.next = now.checked_add(self.interval).unwrap_or(now);
    }

    /// Tells if the file does not have all samples.
    pub(crate) fn tell(&self, shared: &SharedState) {
        if self.begin < self.end {
            let text = format!("it ended early: the film has samples {}..{} of each pixel", self.first, self.begin);
            shared.report(Severity::Warning, format!("oocpt:filmPart: {text}"));
        }
    }
}

/// The film of a file, if it is a part of the same one with the first of these samples, and not all.
fn unfinished(path: &Path, header: &FilmHeader, first: u32, end: u32) -> Option<ExactFilm> {
    let found = FilmReader::open(path).ok()?.header().clone();
    let [range] = *found.samples() else { return None };
    let serves = found.differences(header).is_empty() && range.begin == first && range.end < end;
    serves.then(|| ExactFilm::read(path, u64::MAX).ok()).flatten()
}

fn lost() -> RenderError {
    RenderError::Internal("the samples of a film part were lost".to_owned())
}

fn internal(error: FilmError) -> RenderError {
    RenderError::Internal(error.to_string())
}
