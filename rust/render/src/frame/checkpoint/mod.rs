// SPDX-License-Identifier: Apache-2.0
//! Checkpoints: the film of a render on its way to a file, and back from it into the film of a later one.
//!
//! A film sums the samples of a pixel in ascending order ([`crate::frame::kept_samples`]), so its records after so many
//! paths are the whole state of a render: one that goes on from a file has the bits of one that was never stopped, at
//! any budget, streaming or not. With the records goes what is known of their error. A checkpoint is taken where
//! nothing is under way: the film then has all paths before some number, and none beyond.
//!
//! The file is that of `oocpt_film`: written beside and renamed, with checksums, by a thread of its own, never two at
//! once. It is gone on from if it is of the same film (scene, camera, size, settings, version) and has no more samples
//! than are wanted; every other file stays as it is, and the render that found it makes no checkpoints. Trouble with
//! files is one warning, and the render lives. Render thread only.

mod state;

use crate::error::RenderError;
use crate::film::Film;
use crate::film::filtered::sums_bytes;
use crate::frame::film_header::film_header;
use crate::frame::film_part::STALE;
use crate::frame::film_transfer::FilmTransfer;
use crate::frame::kept_samples::KeptSamples;
use crate::job::RenderJob;
use crate::job::aov::AovKind;
use crate::job::request::Severity;
use crate::job::shared::SharedState;
use oocpt_abi::{FilmPixel, WavefrontCounters};
use oocpt_film::{FilmError, FilmHeader, FilmKind, FilmReader, FilmView, write_film};
use oocpt_gpu::{Buffer, Gpu, GpuError};
use state::EngineState;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// The first checkpoint is made after so long, unless the interval is shorter.
const FIRST: Duration = Duration::from_secs(5);
/// Copying the film takes at most such a share of the time.
const COPYING_SHARE: u32 = 16;
/// Blocks of the file.
const STATE: &str = "state";
const FILM: &str = "film";
const PLANES: &str = "planes";
/// Most bytes of the block of the state.
const MAX_STATE_BYTES: u64 = 16 << 20;

/// What a thread that wrote a file gives back: the records of the film, to be used again, and how it went.
type WrittenFilm = (FilmRecords, Result<(), FilmError>);

/// The records of a film, and the sums of its filtered images.
#[derive(Debug, Default)]
struct FilmRecords {
    film: Vec<u8>,
    planes: Vec<u8>,
}

/// The checkpoints of a render.
#[derive(Debug)]
pub(crate) struct FilmCheckpoints {
    path: PathBuf,
    header: FilmHeader,
    interval: Duration,
    next: Instant,
    transfer: FilmTransfer,
    gpu: Arc<Gpu>,
    /// Records of the film; empty while a thread has them.
    records: FilmRecords,
    /// The filtered images of the film.
    images: Vec<AovKind>,
    writer: Option<JoinHandle<WrittenFilm>>,
    /// Paths of the film that the file has.
    paths: u64,
    /// Paths of the film that is being written.
    under_way: u64,
    /// The user was told of a file that could not be written.
    has_failed: bool,
    started: Instant,
}

/// What forbids checkpoints of a job that asks for them, in words.
fn obstacle(job: &RenderJob, film: &Film) -> Option<&'static str> {
    let settings = &job.settings;
    if settings.interactive {
        Some("a render that shows images on the way makes no checkpoints")
    } else if settings.adaptive_sampling {
        Some("with oocpt:adaptiveSampling there are no checkpoints")
    } else if settings.straggler_roulette {
        Some("with oocpt:stragglerRoulette there are no checkpoints")
    } else if film.has_exact_sums() || !settings.span.is_empty() {
        Some("with oocpt:filmPart or oocpt:sampleRange there are no checkpoints")
    } else if !film.has_color() {
        Some("a render without colour makes no checkpoints")
    } else {
        None
    }
}

fn complain(shared: &SharedState, text: &str) {
    shared.report(Severity::Warning, format!("oocpt:checkpoint: {text}"));
}

impl FilmCheckpoints {
    /// The checkpoints that a job asks for; none, and the user is told, where it can have none.
    pub(crate) fn of(shared: &SharedState, job: &RenderJob, gpu: &Arc<Gpu>, film: &Film) -> Option<Self> {
        if job.settings.checkpoint.is_empty() {
            return None;
        }
        if let Some(obstacle) = obstacle(job, film) {
            // A live view renders anew with each edit.
            if !job.settings.interactive || !shared.told_of_live_views.swap(true, Ordering::Relaxed) {
                complain(shared, obstacle);
            }
            return None;
        }
        let transfer = FilmTransfer::new(gpu).inspect_err(|error| complain(shared, &error.to_string())).ok()?;
        let path = PathBuf::from(&job.settings.checkpoint);
        oocpt_files::remove_stale(&path, STALE);
        let interval = Duration::try_from_secs_f32(job.settings.checkpoint_secs).unwrap_or(Duration::MAX);
        let now = Instant::now();
        Some(Self {
            path,
            header: FilmHeader { kind: FilmKind::Sums, ..film_header(job, gpu.report()) },
            interval,
            next: now.checked_add(interval.min(FIRST)).unwrap_or(now),
            transfer,
            gpu: Arc::clone(gpu),
            records: FilmRecords::default(),
            images: film.filtered().map_or_else(Vec::new, |filtered| filtered.kinds().to_vec()),
            writer: None,
            paths: 0,
            under_way: 0,
            has_failed: false,
            started: now,
        })
    }

    /// Puts the film of the file, if there is one and `film` is empty, into `film`, and gives what else is known of its
    /// samples. An error is one of the device: what is wrong with a file is told, and `None` then means that there are
    /// no checkpoints.
    pub(crate) fn restored(
        mut self,
        shared: &SharedState,
        job: &RenderJob,
        film: &Film,
        is_empty: bool,
    ) -> Result<Option<(Self, Option<KeptSamples>)>, GpuError> {
        let found = match self.find(job) {
            Ok(found) => found,
            Err(reason) => {
                complain(shared, &format!("{reason}; the file stays as it is, and this render makes no checkpoints"));
                return Ok(None);
            }
        };
        let Some((kept, records)) = found else { return Ok(Some((self, None))) };
        // Fewer samples never replace more of the same.
        self.paths = kept.paths;
        let goes_on = is_empty && job.goes_on; // a restart asks for the first sample again
        if let Some(target) = film.records().filter(|_| goes_on) {
            self.transfer.put(target, &records.film)?;
            if let Some(filtered) = film.filtered() {
                self.transfer.put(&filtered.sums, &records.planes)?;
            }
        }
        self.records = records;
        Ok(Some((self, goes_on.then_some(kept))))
    }

    /// The samples in the file, and the records of their film; `None` if there is no file. The reason why a file is not
    /// gone on from is for the user.
    fn find(&mut self, job: &RenderJob) -> Result<Option<(KeptSamples, FilmRecords)>, String> {
        let reader = match FilmReader::open(&self.path) {
            Ok(reader) => reader,
            Err(FilmError::File(_, error)) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(error.to_string()),
        };
        let file = self.path.display();
        if reader.header().kind != FilmKind::Sums {
            return Err(format!("{file}: is no checkpoint, but a film of sums that merge"));
        }
        // What is under the picture is no part of the film.
        let clear_color = reader.header().view.clear_color;
        let mine = FilmHeader { view: FilmView { clear_color, ..self.header.view }, ..self.header.clone() };
        let differences = reader.header().differences(&mine);
        if !differences.is_empty() {
            let what = differences.join("; ");
            return Err(format!("{file}: is of another film (the file's, then this render's) {what}"));
        }
        let text = reader.block(STATE, MAX_STATE_BYTES).map_err(|error| error.to_string())?;
        let state = EngineState::read(&text).map_err(|error| format!("{file}: damaged: {error}"))?;
        let pixels = job.request.pixels();
        let kept = state.kept(job, &self.images).map_err(|reason| format!("{file}: {reason}"))?;
        let bytes = pixels * size_of::<FilmPixel>() as u64;
        let film = reader.block(FILM, bytes).map_err(|error| error.to_string())?;
        if !has_samples(&film, pixels, kept.paths) {
            return Err(format!("{file}: damaged: its pixels have other numbers of samples"));
        }
        let bytes = sums_bytes(&self.images, pixels);
        let planes =
            if bytes > 0 { reader.block(PLANES, bytes).map_err(|error| error.to_string())? } else { Vec::new() };
        if planes.len() as u64 != bytes || !are_finite(&planes) {
            return Err(format!("{file}: damaged: its filtered images are not those of so many pixels"));
        }
        let header = reader.header();
        self.header.nonfinite = header.nonfinite;
        self.header.milliseconds = header.milliseconds;
        self.header.device_bytes = header.device_bytes;
        self.header.devices.extend(header.devices.iter().cloned());
        Ok(Some((kept, FilmRecords { film, planes })))
    }

    /// Whether a film of so many paths is to be kept now; `wanted`: somebody asks for it.
    pub(crate) fn is_due(&self, paths: u64, wanted: bool) -> bool {
        let is_idle = self.writer.as_ref().is_none_or(JoinHandle::is_finished);
        is_idle && (wanted || Instant::now() >= self.next) && paths > self.paths
    }

    /// Copies the film to the host and has it written. Nothing is under way on the device. With `counters` the samples
    /// that are not finite are those of `kept` and those that were counted there since.
    pub(crate) fn make(
        &mut self,
        shared: &SharedState,
        film: &Film,
        mut kept: KeptSamples,
        counters: Option<&Buffer>,
    ) -> Result<(), RenderError> {
        self.take_written(shared);
        let began = Instant::now();
        let bytes = kept.job.request.pixels() * size_of::<FilmPixel>() as u64;
        let Some(source) = film.records() else { return Ok(()) };
        self.transfer.take_all(source, bytes, &mut self.records.film)?;
        if let Some(filtered) = film.filtered() {
            self.transfer.take_all(&filtered.sums, filtered.sums.size(), &mut self.records.planes)?;
        }
        if let Some(counters) = counters {
            let mut seen = WavefrontCounters::default();
            self.transfer.take(counters, 0, bytemuck::bytes_of_mut(&mut seen))?;
            let WavefrontCounters { nonfinite, nonfinite_pixel, .. } = seen;
            kept.nonfinite = (kept.nonfinite.0.saturating_add(nonfinite), kept.nonfinite.1.max(nonfinite_pixel));
        }
        let copied = began.elapsed();
        self.next = began + self.interval.max(copied * COPYING_SHARE);
        tracing::debug!(paths = kept.paths, seconds = copied.as_secs_f64(), "checkpoint");
        let header = self.header_of(&kept);
        self.under_way = kept.paths;
        self.write(shared, header, EngineState::of(&kept, &self.images));
        Ok(())
    }

    fn header_of(&self, kept: &KeptSamples) -> FilmHeader {
        let millis = u64::try_from(self.started.elapsed().as_millis()).unwrap_or(u64::MAX);
        FilmHeader {
            nonfinite: kept.nonfinite.0.into(),
            milliseconds: self.header.milliseconds.saturating_add(millis),
            device_bytes: self.header.device_bytes.max(self.gpu.memory().peak),
            ..self.header.clone()
        }
    }

    fn write(&mut self, shared: &SharedState, header: FilmHeader, state: EngineState) {
        let (path, records) = (self.path.clone(), std::mem::take(&mut self.records));
        let work = move || {
            let done = write_file(&path, &header, &state, &records);
            (records, done)
        };
        match std::thread::Builder::new().name("oocpt-checkpoint".to_owned()).spawn(work) {
            Ok(writer) => self.writer = Some(writer),
            Err(error) => complain(shared, &format!("cannot start its thread: {error}")),
        }
    }

    /// Waits for the file that is being written.
    fn take_written(&mut self, shared: &SharedState) {
        let Some(writer) = self.writer.take() else { return };
        let Ok((records, done)) = writer.join() else {
            complain(shared, "internal error: its thread has panicked");
            return;
        };
        self.records = records;
        match done {
            Ok(()) => self.paths = self.under_way,
            Err(error) if !self.has_failed => {
                self.has_failed = true;
                complain(shared, &format!("{error}; the render goes on, and tries again with the next checkpoint"));
            }
            Err(error) => tracing::debug!(%error, "no checkpoint"),
        }
    }

    /// Keeps the film as the render leaves it, and waits until it is written; none if there is nothing to go on with.
    pub(crate) fn end(
        &mut self,
        shared: &SharedState,
        film: &Film,
        kept: Option<KeptSamples>,
    ) -> Result<(), RenderError> {
        self.take_written(shared);
        if let Some(kept) = kept.filter(|kept| kept.paths > self.paths) {
            self.make(shared, film, kept, None)?;
            self.take_written(shared);
        }
        Ok(())
    }
}

/// Whether these are records of so many pixels with the samples of so many paths, in whatever order paths take pixels.
fn has_samples(records: &[u8], pixels: u64, paths: u64) -> bool {
    let (each, more) = (paths / pixels.max(1), paths % pixels.max(1));
    let records = records.chunks_exact(size_of::<FilmPixel>());
    let count = records.len() as u64;
    let beyond = records.map(|record| {
        let samples = u64::from(bytemuck::pod_read_unaligned::<FilmPixel>(record).samples);
        samples.checked_sub(each).filter(|beyond| *beyond < 2)
    });
    // None where a pixel has fewer samples than all, or two more.
    count == pixels && beyond.sum::<Option<u64>>() == Some(more)
}

impl Drop for FilmCheckpoints {
    /// A file that is being written is finished, also after an error.
    fn drop(&mut self) {
        if self.writer.take().is_some_and(|writer| writer.join().is_err()) {
            tracing::error!("the thread of a checkpoint has panicked");
        }
    }
}

/// Whether these are numbers of the device: the sums of filtered images have no others.
fn are_finite(planes: &[u8]) -> bool {
    planes.chunks_exact(4).all(|word| bytemuck::pod_read_unaligned::<f32>(word).is_finite())
}

fn write_file(path: &Path, header: &FilmHeader, state: &EngineState, records: &FilmRecords) -> Result<(), FilmError> {
    let text = state.text().map_err(|error| FilmError::File(path.to_owned(), error))?;
    write_film(path, header, |writer| {
        writer.block(STATE, &text)?;
        writer.block(FILM, &records.film)?;
        if records.planes.is_empty() { Ok(()) } else { writer.block(PLANES, &records.planes) }
    })
}
