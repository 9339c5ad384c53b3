// SPDX-License-Identifier: Apache-2.0
//! Pictures whose film takes too much of the device's memory: rendered window by window, each with the bits of the
//! whole picture, and put together in host memory.
//!
//! Each window takes all its samples before the next one begins, so that nothing but its images leaves the device. Only
//! a target error makes rounds of it, since its decisions are by the error of all windows: the first round takes 16
//! samples, each further one as many as there are, and films wait in host memory in between. A time limit is divided
//! among the windows that are left. Windows have no stats of their own that anybody sees: what they measure is added
//! up. Batch renders only. Render thread only.

use super::Renderer;
use crate::device::Device;
use crate::error::RenderError;
use crate::film::filtered::sums_bytes;
use crate::film::{self, FilmBytes, FilmSums};
use crate::frame::film_transfer::FilmTransfer;
use crate::frame::kept_samples::KeptSamples;
use crate::frame::progress::FrameProgress;
use crate::host_memory;
use crate::job::RenderJob;
use crate::job::aov::AovKind;
use crate::job::request::{Message, RenderRequest, Severity};
use crate::job::shared::{FrameGate, SharedState};
use crate::job::window::{FilmWindow, PixelWindow};
use crate::report::error_log::FIRST_TO_STOP;
use crate::report::window_rows::WindowRows;
use crate::sync::lock;
use oocpt_abi::FilmPixel;
use oocpt_core::settings::Settings;
use oocpt_gpu::Gpu;
use std::sync::Arc;

/// Bytes of a film's buffers that are not of pixels, at most.
const BESIDE_PIXELS: u64 = 1 << 20;

/// How much of the device's memory budget films may take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum FilmShare {
    /// A film of more than three quarters of it is rendered in windows of a quarter: what it leaves is too little for
    /// the paths and the scene.
    Usual,
    /// A sixteenth: all else was tried.
    Least,
}

impl FilmShare {
    /// Bytes of a budget that a film may take as a whole, and in windows.
    const fn of(self, budget: u64) -> (u64, u64) {
        match self {
            Self::Usual => (budget - budget / 4, budget / 4),
            Self::Least => (budget / 16, budget / 16),
        }
    }
}

/// The film of a window between two rounds.
#[derive(Debug)]
struct KeptWindow {
    records: Vec<u8>,
    planes: Vec<u8>,
    samples: KeptSamples,
}

/// A picture on its way.
struct WindowedPicture<'a> {
    windows: &'a [FilmWindow],
    rows: WindowRows,
    /// By window, with a target error.
    kept: Vec<Option<KeptWindow>>,
    /// Samples that all pixels of each window have.
    samples: Vec<u32>,
    /// A window has been rendered.
    has_begun: bool,
    /// Stats, messages and images of windows.
    apart: &'a SharedState,
    told: Vec<Message>,
}

/// The windows in which the picture of `job` is rendered on a device: of so much memory, and no buffer larger than the
/// driver allows; one where it is rendered as a whole.
pub(super) fn windows(job: &RenderJob, gpu: &Gpu, share: FilmShare) -> Vec<FilmWindow> {
    let (settings, part) = (&job.settings, job.request.part());
    let whole = || FilmWindow::cut(part, u64::MAX);
    // The part of a film and the report of the chunks are files of the whole picture.
    let is_part = !settings.film_part.is_empty() || job.team.is_some();
    if settings.interactive || is_part || !settings.chunk_report.is_empty() {
        return whole();
    }
    #[cfg(feature = "faults")]
    if let Some(pixels) = job.options.faults.film_window {
        return FilmWindow::cut(part, pixels.into());
    }
    cut(part, film::bytes_a_pixel(job), (gpu.memory().budget, gpu.limits().max_allocation_bytes), share)
}

/// The windows of a picture whose film takes so many bytes a pixel, with a budget of so many bytes and no buffer of
/// more than `largest`.
fn cut(part: PixelWindow, bytes: FilmBytes, (budget, largest): (u64, u64), share: FilmShare) -> Vec<FilmWindow> {
    let (most, window) = share.of(budget);
    let of_buffer = largest.saturating_sub(BESIDE_PIXELS) / bytes.largest().max(1);
    if bytes.all().saturating_mul(part.pixels()) <= most && part.pixels() <= of_buffer {
        return FilmWindow::cut(part, u64::MAX);
    }
    FilmWindow::cut(part, of_buffer.min(window / bytes.all().max(1)))
}

/// Whether the picture of `job` is rendered in smaller windows with [`FilmShare::Least`].
pub(super) fn are_smaller(job: &RenderJob, gpu: &Gpu) -> bool {
    windows(job, gpu, FilmShare::Least).len() > windows(job, gpu, FilmShare::Usual).len()
}

/// Numbers of samples after which all windows are to have the same ones.
fn rounds(job: &RenderJob) -> Vec<u32> {
    let (settings, all) = (&job.settings, job.settings.samples_per_pixel);
    // With adaptive sampling a film depends on the number of all samples.
    let decides = settings.target_error > 0.0 && !settings.adaptive_sampling && settings.span.is_empty();
    let first = if decides { FIRST_TO_STOP } else { all };
    let doubled = std::iter::successors(Some(first), |samples| samples.checked_mul(2));
    doubled.take_while(|samples| *samples < all).chain([all]).collect()
}

/// The job of a window: nothing but its samples, up to a number of them, in so many seconds.
fn window_job(job: &RenderJob, window: FilmWindow, samples: u32, seconds: f32, host_bytes: u64) -> RenderJob {
    let settings = Settings {
        samples_per_pixel: samples,
        target_error: 0.0,
        time_limit_secs: seconds,
        report: String::new(),
        reference: String::new(),
        checkpoint: String::new(),
        ..job.settings.clone()
    };
    let mut options = job.options;
    (options.progress_bar, options.closing_words) = (false, false);
    RenderJob {
        request: RenderRequest { window: Some(window.traced), ..job.request.clone() },
        settings,
        options,
        fixed_host_bytes: job.fixed_host_bytes.saturating_add(host_bytes),
        goes_on: true,
        film_window: Some(window),
        ..job.clone()
    }
}

/// Bytes of host memory of the picture's images and, between rounds, of its film; 0 if there is no budget of it.
fn host_bytes(job: &RenderJob, rounds: usize, shared: &SharedState) -> u64 {
    let Some(budget) = host_memory::budget(&job.settings) else { return 0 };
    let kinds = job.request.kinds();
    let images = job.request.image_pixels() * kinds.iter().map(|kind| kind.pixel_bytes() as u64).sum::<u64>();
    let films = if rounds > 1 { film::bytes_a_pixel(job).kept() * job.request.pixels() } else { 0 };
    let bytes = images + films;
    if bytes.saturating_add(job.fixed_host_bytes) > budget {
        let [budget, images, films] = [budget, images, films].map(|bytes| bytes.div_ceil(1 << 20));
        let films = if films > 0 { format!(" and its film {films} MiB") } else { String::new() };
        let text = format!(
            "oocpt:hostMemoryBudget of {budget} MiB is exceeded: images of the picture take {images} MiB{films}; the \
             device has no memory for them"
        );
        shared.report(Severity::Warning, text);
    }
    bytes
}

/// Tells what a picture in windows has not.
fn warn(job: &RenderJob, windows: usize, shared: &SharedState) {
    let settings = &job.settings;
    let beside = format!("the film takes too much of the device's memory, and is rendered in {windows} windows");
    if !settings.checkpoint.is_empty() {
        shared.report(Severity::Warning, format!("oocpt:checkpoint: {beside}: there are no checkpoints"));
    }
    if settings.adaptive_sampling {
        let target = if settings.target_error > 0.0 { " and the target error is not asked" } else { "" };
        let text = "each decides on samples of its own, so the picture depends on the budget";
        shared.report(Severity::Warning, format!("oocpt:adaptiveSampling: {beside}: {text}{target}"));
    }
}

impl Renderer {
    /// Renders `job` as a whole or, if its film takes more than `share` says, window by window.
    pub(super) fn render_picture(
        &mut self,
        device: &Arc<Device>,
        job: &RenderJob,
        gate: &FrameGate<'_>,
        progress: &mut FrameProgress<'_>,
        share: FilmShare,
    ) -> Result<(), RenderError> {
        let windows = windows(job, &device.gpu, share);
        if windows.len() < 2 {
            return self.render_moved(device, job, gate, progress);
        }
        warn(job, windows.len(), gate.shared());
        tracing::info!(windows = windows.len(), "rendering the film window by window");
        self.kept = None;
        progress.begin_windows(windows.len());
        let apart = SharedState::default();
        let mut picture = WindowedPicture {
            windows: &windows,
            rows: WindowRows::new(windows.len()),
            kept: windows.iter().map(|_| None).collect(),
            samples: vec![0; windows.len()],
            has_begun: false,
            apart: &apart,
            told: Vec::new(),
        };
        let rounds = rounds(job);
        let host_bytes = host_bytes(job, rounds.len(), gate.shared());
        for samples in &rounds {
            let is_done = self.render_round(device, (job, *samples, host_bytes), gate, progress, &mut picture)?;
            let fewest = picture.samples.iter().copied().min().unwrap_or(0);
            if !is_done || Some(samples) == rounds.last() || progress.is_late() {
                break;
            }
            progress.end_windows(&mut picture.rows, fewest, false);
            if progress.is_good_enough() {
                break;
            }
        }
        self.kept = None;
        if gate.is_superseded() {
            return Ok(());
        }
        let fewest = picture.samples.iter().copied().min().unwrap_or(0);
        progress.publish_windows(&mut lock(&apart.published));
        progress.denoise_windows();
        progress.end_windows(&mut picture.rows, fewest, true);
        if job.request.kinds().contains(&AovKind::Error) {
            progress.scale_error_image(&picture.rows);
        }
        progress.finish()
    }

    /// Brings each window to so many samples; false if `gate` has closed meanwhile.
    fn render_round(
        &mut self,
        device: &Arc<Device>,
        (job, samples, host_bytes): (&RenderJob, u32, u64),
        gate: &FrameGate<'_>,
        progress: &mut FrameProgress<'_>,
        picture: &mut WindowedPicture<'_>,
    ) -> Result<bool, RenderError> {
        let (windows, apart) = (picture.windows, picture.apart);
        let goes_on = samples < job.settings.samples_per_pixel;
        for (number, window) in windows.iter().enumerate() {
            if !gate.proceed() {
                return Ok(false);
            }
            let seconds = progress.window_secs(windows.len() - number);
            let job = window_job(job, *window, samples, seconds, host_bytes);
            self.kept = self.put_back(device, picture.kept[number].take())?;
            let from = picture.samples[number];
            let mut inner = progress.begin_window(apart, &job, [number, windows.len()], [from, samples]);
            let result = self.render_on(device, &job, &gate.with_results(apart), &mut inner);
            let is_first = !std::mem::replace(&mut picture.has_begun, true);
            let (rows, done) = progress.end_window(inner, is_first);
            picture.rows.add(number, rows);
            picture.samples[number] = done;
            picture.tell(gate.shared());
            result?;
            if goes_on && let Some(samples) = self.kept.take() {
                picture.kept[number] = self.take_film(device, samples)?;
            }
        }
        Ok(true)
    }

    /// Puts the film of a window back on the device, and gives its samples.
    fn put_back(&self, device: &Device, kept: Option<KeptWindow>) -> Result<Option<KeptSamples>, RenderError> {
        let (Some(kept), Some(film)) = (kept, &self.film) else { return Ok(None) };
        let job = &kept.samples.job;
        // The job of a round before had the same images, and the film is that of the last window.
        if !film.fits(&job.request, FilmSums::of(job, false)) {
            return Ok(None);
        }
        let transfer = FilmTransfer::new(&device.gpu)?;
        if let Some(records) = film.records() {
            transfer.put(records, &kept.records)?;
        }
        if let Some(filtered) = film.filtered() {
            transfer.put(&filtered.sums, &kept.planes)?;
        }
        Ok(Some(kept.samples))
    }

    /// Takes the film of a window off the device.
    fn take_film(&self, device: &Device, samples: KeptSamples) -> Result<Option<KeptWindow>, RenderError> {
        let Some(film) = &self.film else { return Ok(None) };
        let Some(source) = film.records() else { return Ok(None) };
        let pixels = samples.job.request.pixels();
        let (mut records, mut planes) = (Vec::new(), Vec::new());
        let transfer = FilmTransfer::new(&device.gpu)?;
        transfer.take_all(source, pixels * size_of::<FilmPixel>() as u64, &mut records)?;
        if let Some(filtered) = film.filtered() {
            transfer.take_all(&filtered.sums, sums_bytes(filtered.kinds(), pixels), &mut planes)?;
        }
        Ok(Some(KeptWindow { records, planes, samples }))
    }
}

impl WindowedPicture<'_> {
    /// Tells the messages of a window that no other one had.
    fn tell(&mut self, shared: &SharedState) {
        for message in std::mem::take(&mut *lock(&self.apart.messages)) {
            if !self.told.contains(&message) {
                self.told.push(message.clone());
                shared.report(message.severity, message.text);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_fit_the_budget_and_the_largest_buffer() {
        const GIB: u64 = 1 << 30;
        let picture = PixelWindow::whole([3840, 2160]);
        // Twenty expressions: 720 bytes of sums a pixel are 6 GB in one buffer.
        let bytes = FilmBytes { records: 80, sums: 720, copied: 256, rest: 256 };
        let of = |budget: u64, largest: u64| cut(picture, bytes, (budget, largest), FilmShare::Usual);
        assert_eq!(of(140 * GIB, 16 * GIB).len(), 1, "all of it");
        let windows = of(140 * GIB, 4 * GIB);
        assert_eq!(windows.len(), 2, "as few as buffers allow");
        assert!(windows.iter().all(|window| window.traced.pixels() * 720 + BESIDE_PIXELS <= 4 * GIB));
        let windows = of(8 * GIB, 16 * GIB);
        assert!(windows.iter().all(|window| window.traced.pixels() * 1056 <= 2 * GIB), "a quarter of the budget");
        assert!(windows.len() > 3);
    }
}
