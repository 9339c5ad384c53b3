// SPDX-License-Identifier: Apache-2.0
//! The part of a film that a render makes: exact sums of its samples, which merge with those of other renders.
//!
//! Beside the plain film the device keeps an `ExactPixel` for each pixel. Each octave of samples has sums of its own
//! (the error is measured at their ends): where one ends nothing is under way, its records are copied to the host, and
//! begin again from nothing; a thread adds them to the film while the next octave is rendered. The file is written when
//! the render ends, and where an octave does if that is later than the interval of checkpoints: a render that was
//! killed goes on from there. One that was given up has the octaves that are whole, and the last one if no pixel has
//! more samples of it than another. Where several devices render one picture, the film is theirs, and nothing is
//! written here. Render thread only.

use crate::error::RenderError;
use crate::film::Film;
use crate::frame::film_header::{device_text, film_header};
use crate::frame::film_transfer::FilmTransfer;
use crate::job::RenderJob;
use crate::job::request::Severity;
use crate::job::shared::SharedState;
use crate::sync::lock;
use oocpt_abi::ExactPixel;
use oocpt_core::pixel_filter::PixelFilterKind;
use oocpt_core::settings::Settings;
use oocpt_film::{ExactFilm, FilmError, FilmHeader, FilmKind, FilmReader, SampleRange};
use oocpt_gpu::{DeviceReport, Gpu};
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Temporary files of processes that were killed are removed after so long without a change.
pub(crate) const STALE: Duration = Duration::from_secs(600);

/// What forbids that samples of a job merge, in words.
pub(crate) fn obstacle(job: &RenderJob) -> Option<&'static str> {
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
        return job.team.is_some();
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
    film: Arc<Mutex<ExactFilm>>,
    adding: Option<JoinHandle<Result<(), FilmError>>>,
    transfer: FilmTransfer,
    gpu: Arc<Gpu>,
    /// Samples that are to be rendered, the first of the records on the device, and the first of the part.
    end: u32,
    begin: u32,
    first: u32,
    /// None: others write the film.
    file: Option<PartFile>,
}

/// The file of a part.
#[derive(Debug)]
struct PartFile {
    path: PathBuf,
    interval: Duration,
    next: Instant,
    /// Since when the file knows of no time.
    noted: Instant,
    /// Samples that are not finite, of which the file knows.
    nonfinite: u64,
}

impl FilmPart {
    /// The part of `job`: that of its file, if it was not finished, or one without samples; or the film of all devices.
    pub(crate) fn new(job: &RenderJob, gpu: &Arc<Gpu>) -> Result<Self, RenderError> {
        let settings = &job.settings;
        let (first, end) = (settings.span.begin, settings.samples_per_pixel);
        let (film, file) = match &job.team {
            Some(team) => (Arc::clone(&team.film), None),
            None => (Arc::new(Mutex::new(film_of(job, gpu.report(), MayLack::Last)?)), Some(PartFile::new(settings))),
        };
        let samples = lock(&film).header().samples();
        let whole = samples.iter().find(|range| range.begin <= first && first < range.end);
        Ok(Self {
            begin: whole.map_or(first, |range| range.end.min(end)),
            film,
            adding: None,
            transfer: FilmTransfer::new(gpu)?,
            gpu: Arc::clone(gpu),
            end,
            first,
            file,
        })
    }

    /// The first sample that the file does not have.
    pub(crate) fn begin(&self) -> u32 {
        self.begin
    }

    /// Whether the file is to be written at the end of an octave.
    pub(crate) fn is_due(&self) -> bool {
        self.begin < self.end && self.file.as_ref().is_some_and(|file| Instant::now() >= file.next)
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
        // All records have come: a device that is lost leaves what is whole.
        let film = Arc::clone(&self.film);
        let range = SampleRange::new(self.begin, end);
        let add = move || lock(&film).add(range, plane);
        let thread = std::thread::Builder::new().name("oocpt-film".into()).spawn(add);
        self.adding = Some(thread.map_err(|error| RenderError::Internal(error.to_string()))?);
        self.begin = end;
        Ok(())
    }

    /// Waits until nothing is being added to the film.
    fn settle(&mut self) -> Result<(), RenderError> {
        if let Some(adding) = self.adding.take() {
            adding.join().map_err(|_panic| lost())?.map_err(internal)?;
        }
        Ok(())
    }

    /// Writes the file, if it has one; `nonfinite` samples of this render were not finite.
    pub(crate) fn write(&mut self, shared: &SharedState, nonfinite: u64) -> Result<(), RenderError> {
        let settled = self.settle();
        let Some(file) = &mut self.file else { return settled };
        let written = settled.map_err(|error| error.to_string()).and_then(|()| {
            let (since, millis) = file.cost(nonfinite);
            let mut film = lock(&self.film);
            film.note(since, millis, self.gpu.memory().peak, &device_text(self.gpu.report()));
            film.write(&file.path).map_err(|error| error.to_string())
        });
        if let Err(text) = written {
            complain(shared, &text);
        }
        file.wait();
        Ok(())
    }

    /// Tells if the file does not have all samples.
    pub(crate) fn tell(&self, shared: &SharedState) {
        if self.begin < self.end && self.file.is_some() {
            let text = format!("it ended early: the film has samples {}..{} of each pixel", self.first, self.begin);
            shared.report(Severity::Warning, format!("oocpt:filmPart: {text}"));
        }
    }
}

impl Drop for FilmPart {
    /// Once it is gone, nothing is added to the film any more: what that has not is rendered by others.
    fn drop(&mut self) {
        if let Err(error) = self.settle() {
            tracing::debug!(%error, "the last samples are not in the film");
        }
    }
}

impl PartFile {
    fn new(settings: &Settings) -> Self {
        let interval = Duration::try_from_secs_f32(settings.checkpoint_secs).unwrap_or(Duration::MAX);
        let now = Instant::now();
        let next = now.checked_add(interval).unwrap_or(now);
        Self { path: PathBuf::from(&settings.film_part), interval, next, noted: now, nonfinite: 0 }
    }

    /// What came since the last call: samples that are not finite, of so many in all, and milliseconds.
    fn cost(&mut self, nonfinite: u64) -> (u64, u64) {
        let began = Instant::now();
        let millis = u64::try_from(began.duration_since(self.noted).as_millis()).unwrap_or(u64::MAX);
        let since = nonfinite.saturating_sub(self.nonfinite);
        (self.noted, self.nonfinite) = (began, nonfinite);
        (since, millis)
    }

    /// The next time to write comes an interval from now.
    fn wait(&mut self) {
        let now = Instant::now();
        self.next = now.checked_add(self.interval).unwrap_or(now);
    }
}

/// The samples that a film may lack if a render is to go on with it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum MayLack {
    /// Those from one on: they are rendered in their order.
    Last,
    /// Some anywhere.
    Any,
}

/// The film of `job`: that of its file, if it is a part of the same picture and lacks some of the samples, or one
/// without samples.
pub(crate) fn film_of(job: &RenderJob, device: &DeviceReport, lacks: MayLack) -> Result<ExactFilm, RenderError> {
    let settings = &job.settings;
    let path = Path::new(&settings.film_part);
    let header = FilmHeader { kind: FilmKind::Exact, ..film_header(job, device) };
    let span = SampleRange::new(settings.span.begin, settings.samples_per_pixel);
    if !settings.film_part.is_empty() {
        oocpt_files::remove_stale(path, STALE);
        if let Some(film) = unfinished(path, &header, span, lacks) {
            return Ok(film);
        }
    }
    ExactFilm::new(header).map_err(internal)
}

/// The film of a file, if it is a part of the same one with samples of the span alone, and not all.
fn unfinished(path: &Path, header: &FilmHeader, span: SampleRange, lacks: MayLack) -> Option<ExactFilm> {
    let found = FilmReader::open(path).ok()?.header().clone();
    let serves = match (&*found.samples(), lacks) {
        ([range], _) if range.begin == span.begin => range.end < span.end,
        ([first, .., last], MayLack::Any) => first.begin >= span.begin && last.end <= span.end,
        ([range], MayLack::Any) => range.begin > span.begin && range.end <= span.end,
        _ => false,
    };
    let serves = serves && found.differences(header).is_empty();
    serves.then(|| ExactFilm::read(path, u64::MAX).ok()).flatten()
}

fn lost() -> RenderError {
    RenderError::Internal("the samples of a film part were lost".to_owned())
}

fn internal(error: FilmError) -> RenderError {
    RenderError::Internal(error.to_string())
}
