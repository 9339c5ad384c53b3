// SPDX-License-Identifier: Apache-2.0
//! The error over time while a frame renders: takes the measurements of the film, passes them to the stats and to the
//! report, compares with a reference picture, and decides when the error is small enough to stop.
//!
//! Stopping biases the picture by little (measured: decisions/0009), because it is decided for the whole picture by its
//! error at powers of two of the samples, which a single pixel hardly moves. Nothing is decided by time unless a time
//! limit is set, and no path beyond an octave begins before that octave is decided: the same scene gets the same
//! samples. Trouble with files is one warning. Render thread only.

use crate::film::measure::MeasuredError;
use crate::film::reference::ReferencePicture;
use crate::host_memory;
use crate::job::RenderJob;
use crate::job::aov::AovKind;
use crate::job::request::Severity;
use crate::job::shared::SharedState;
use crate::report::error_report::{ErrorReportHeader, InventoryLine, ReportWriter, UsageLine, VERSION};
use crate::sync::lock;
use crate::wave::{LAST_SLOT, next_boundary};
use oocpt_core::convergence::{ConvergenceEstimator, of_halves};
use oocpt_core::inventory::RenderInventory;
use oocpt_core::stats::{ErrorRow, RenderUsage, TrueError};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::path::Path;

/// Octave of the fewest samples after which the error may count as small enough: with fewer, its estimate is too
/// uncertain.
const MIN_SAMPLES_TO_STOP: u32 = 4;
/// These samples.
pub(crate) const FIRST_TO_STOP: u32 = 1 << MIN_SAMPLES_TO_STOP;

/// The clock and counters of a row.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct RowMoment {
    pub(crate) seconds: f64,
    pub(crate) seconds_tracing: f64,
    pub(crate) bytes_paged: u64,
    pub(crate) gpu_bytes: u64,
    /// Samples of each pixel, on average.
    pub(crate) samples: u32,
    /// The picture of these samples is published, if any is to be compared.
    pub(crate) has_picture: bool,
}

/// A measurement of a window of the picture.
#[derive(Clone, Debug, Default)]
pub(crate) struct MeasuredRow {
    /// None at an end between octaves.
    pub(crate) octave: Option<u32>,
    pub(crate) measured: MeasuredError,
    pub(crate) moment: RowMoment,
}

/// What is known of the error of the samples that a film has.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct ErrorHistory {
    convergence: ConvergenceEstimator,
    /// Octaves, and the upper ends of their errors if these are known.
    octaves: Vec<(u32, Option<f64>)>,
    /// The last row.
    last: Option<ErrorRow>,
}

impl ErrorHistory {
    /// Whether it may be that of a render: what is read from files may be anything.
    pub(crate) fn is_sound(&self) -> bool {
        let ascends = self.octaves.windows(2).all(|pair| pair[0].0 < pair[1].0);
        ascends && self.octaves.iter().all(|(octave, _)| *octave < LAST_SLOT)
    }

    /// Whether a render with this target error would have come to have so many paths.
    pub(crate) fn leads_to(&self, pixels: u64, paths: u64, target: f32) -> bool {
        let stops = |(octave, high): &(u32, Option<f64>)| is_good((*octave, *high), f64::from(target));
        self.octaves.iter().find(|octave| stops(octave)).is_none_or(|(octave, _)| pixels << octave >= paths)
    }
}

/// Whether the error of an octave is small enough to stop.
fn is_good((octave, high): (u32, Option<f64>), target: f64) -> bool {
    target > 0.0 && octave >= MIN_SAMPLES_TO_STOP && high.is_some_and(|high| high <= target)
}

/// Measures, reports and judges the error of one render.
#[derive(Debug)]
pub(crate) struct ErrorLog {
    history: ErrorHistory,
    pixels: u64,
    writer: Option<ReportWriter>,
    reference: Option<ReferencePicture>,
    target: f64,
    /// True if the target is reached.
    is_good: bool,
    /// True if the two halves of every pixel share no sample.
    has_halves: bool,
    /// Paths that may begin.
    open: u64,
    /// The last row, held back because it may turn out to be the final one.
    last: Option<ErrorRow>,
    /// All measurements, if the render is of a window of the picture.
    rows: Option<Vec<MeasuredRow>>,
    /// The log of the picture of which this render is a window wants octaves.
    serves_octaves: bool,
}

impl ErrorLog {
    /// Begins a render and reads the reference picture that the settings name.
    pub(crate) fn start(shared: &SharedState, job: &RenderJob) -> Self {
        let pixels = job.request.pixels();
        let target = f64::from(job.settings.target_error);
        let reference = match job.settings.reference.as_str() {
            "" => None,
            file => {
                ReferencePicture::read(Path::new(file), [job.request.width, job.request.height], job.request.part())
                    .inspect_err(|error| shared.report(Severity::Warning, format!("oocpt:reference: {error}")))
                    .ok()
            }
        };
        let open = if target > 0.0 { pixels << MIN_SAMPLES_TO_STOP } else { u64::MAX };
        let has_halves = job.settings.adaptive_sampling;
        Self {
            history: ErrorHistory::default(),
            pixels,
            writer: None,
            reference,
            target,
            is_good: false,
            has_halves,
            open,
            last: None,
            rows: job.film_window.map(|_| Vec::new()),
            serves_octaves: false,
        }
    }

    /// Begins the render of a window of a picture, for the log of the picture.
    pub(crate) fn serve(&mut self, picture: &Self) {
        self.serves_octaves = picture.wants_octaves();
    }

    /// The measurements of a window of the picture.
    pub(crate) fn take_rows(&mut self) -> Vec<MeasuredRow> {
        self.rows.take().unwrap_or_default()
    }

    /// Forgets the samples so far, which are taken anew; the report goes on.
    pub(crate) fn begin_again(&mut self) {
        self.history = ErrorHistory::default();
        self.is_good = false;
        self.open = if self.target > 0.0 { self.pixels << MIN_SAMPLES_TO_STOP } else { u64::MAX };
        self.last = None;
    }

    /// Goes on with what is known of the samples that the film has: their row is the first one, at no cost of this
    /// render. Gives that row.
    pub(crate) fn go_on(&mut self, history: ErrorHistory) -> Option<ErrorRow> {
        self.history = history;
        for (octave, high) in self.history.octaves.clone() {
            self.decide(octave, high);
        }
        let free = |row: &ErrorRow| ErrorRow {
            seconds: 0.0,
            seconds_tracing: 0.0,
            rays: 0,
            bytes_paged: 0,
            gpu_bytes: 0,
            host_peak_bytes: 0,
            truth: None,
            is_last: false,
            ..row.clone()
        };
        self.last = self.history.last.as_ref().map(free);
        self.last.clone()
    }

    /// Whether nothing was measured of the samples so far.
    pub(crate) fn knows_nothing(&self) -> bool {
        self.history.octaves.is_empty() && self.history.last.is_none()
    }

    /// What is known of the samples so far.
    pub(crate) fn history(&self) -> ErrorHistory {
        self.history.clone()
    }

    /// Begins the report that the settings name, once the device that it names is open.
    pub(crate) fn open_report(&mut self, shared: &SharedState, job: &RenderJob) {
        self.writer = match job.settings.report.as_str() {
            "" => None,
            file => begin(shared, job, file)
                .inspect_err(|error| shared.report(Severity::Warning, format!("oocpt:report: {file}: {error}")))
                .ok(),
        };
    }

    /// Returns true if waves are to end where octaves do, so that a row has the time of its own samples.
    pub(crate) fn wants_octaves(&self) -> bool {
        self.writer.is_some() || self.reference.is_some() || self.target > 0.0 || self.serves_octaves
    }

    /// Returns true if pictures are to be published with each octave.
    pub(crate) fn wants_pictures(&self) -> bool {
        self.reference.is_some()
    }

    /// The paths that may begin; the number grows when the error of an octave is too large.
    pub(crate) fn open_paths(&self) -> u64 {
        self.open
    }

    /// Returns true if the error is small enough to stop.
    pub(crate) fn is_good_enough(&self) -> bool {
        self.is_good
    }

    /// The share of `samples` per pixel that the target error is expected to take, if the error falls as the number of
    /// samples grows; 1 without a target or before there is an estimate.
    pub(crate) fn needed_share(&self, samples: u32, row: Option<&ErrorRow>) -> f64 {
        let estimate = row.and_then(|row| Some((row.samples, row.estimate?)));
        let Some((taken, estimate)) = estimate.filter(|_| self.target > 0.0) else { return 1.0 };
        needed_samples(taken, estimate.high / self.target) / f64::from(samples.max(1))
    }

    /// Takes the measurement of `octave`, or of the end.
    pub(crate) fn row(
        &mut self,
        shared: &SharedState,
        measured: MeasuredError,
        octave: Option<u32>,
        moment: RowMoment,
    ) {
        if let Some(rows) = &mut self.rows {
            rows.push(MeasuredRow { octave, measured: measured.clone(), moment });
        }
        let estimate = match octave {
            _ if self.has_halves => of_halves(&measured.sums),
            Some(octave) => self.history.convergence.octave(octave, &measured.sums),
            None => self.history.convergence.between(f64::from(measured.fewest), &measured.sums),
        };
        if let Some(octave) = octave {
            let high = estimate.map(|estimate| estimate.high);
            self.history.octaves.push((octave, high));
            self.decide(octave, high);
        }
        let MeasuredError { worst, rays, .. } = measured;
        let RowMoment { seconds, seconds_tracing, bytes_paged, gpu_bytes, samples, has_picture } = moment;
        let truth = if has_picture { self.compare(shared, AovKind::Color) } else { None };
        let host_peak_bytes = if self.writer.is_some() { host_memory::peak() } else { 0 };
        let memory = ErrorRow { bytes_paged, gpu_bytes, host_peak_bytes, ..ErrorRow::default() };
        let row = ErrorRow { samples, seconds, seconds_tracing, rays, estimate, worst, truth, ..memory };
        self.write(shared);
        lock(&shared.stats).error = Some(row.clone());
        self.history.last = Some(row.clone());
        self.last = Some(row);
    }

    /// The error of a published image of colour against the reference, if there is one.
    fn compare(&self, shared: &SharedState, kind: AovKind) -> Option<TrueError> {
        self.reference.as_ref().and_then(|reference| reference.compare(&lock(&shared.published), kind))
    }

    fn decide(&mut self, octave: u32, high: Option<f64>) {
        let (_, next) = next_boundary(self.pixels << octave, self.pixels);
        self.is_good = is_good((octave, high), self.target);
        if self.target > 0.0 && octave >= MIN_SAMPLES_TO_STOP && !self.is_good && self.open < next {
            self.open = next;
        }
    }

    /// Ends the render: the samples of the last row are the picture's.
    pub(crate) fn finish(&mut self, shared: &SharedState) {
        if let Some(row) = &mut self.last {
            row.is_last = true;
            let compare = |reference: &ReferencePicture| reference.compare(&lock(&shared.published), AovKind::Color);
            row.truth = row.truth.or_else(|| self.reference.as_ref().and_then(compare));
            lock(&shared.stats).error = Some(row.clone());
        }
        self.write(shared);
        let is_denoised = lock(&shared.stats).denoised.is_some();
        let truth = is_denoised.then(|| self.compare(shared, AovKind::Denoised)).flatten();
        if let Some(usage) = &mut lock(&shared.stats).denoised {
            usage.truth = truth;
        }
    }

    /// Writes the line that lists what the render is made of.
    pub(crate) fn inventory(&mut self, shared: &SharedState, inventory: &RenderInventory) {
        self.line(shared, &InventoryLine { inventory: Cow::Borrowed(inventory) });
    }

    /// Writes the last line: the memory and time that the render has used.
    pub(crate) fn usage(&mut self, shared: &SharedState, usage: RenderUsage) {
        self.line(shared, &UsageLine { usage });
    }

    fn line(&mut self, shared: &SharedState, line: &impl Serialize) {
        if let Some(writer) = &mut self.writer
            && let Err(error) = writer.line(line)
        {
            self.give_up(shared, &error);
        }
    }

    fn give_up(&mut self, shared: &SharedState, error: &std::io::Error) {
        shared.report(Severity::Warning, format!("oocpt:report: {error}; no more is written"));
        self.writer = None;
    }

    fn write(&mut self, shared: &SharedState) {
        if let Some(row) = self.last.take() {
            self.line(shared, &row);
        }
    }
}

/// Samples after which a render stops whose error after `taken` of them is so many times the target: a power of two.
fn needed_samples(taken: u32, excess: f64) -> f64 {
    let fewest = f64::from(1_u32 << MIN_SAMPLES_TO_STOP);
    (f64::from(taken) * excess.max(0.0)).max(fewest).log2().ceil().exp2()
}

fn begin(shared: &SharedState, job: &RenderJob, file: &str) -> std::io::Result<ReportWriter> {
    let settings = &job.settings;
    let header = ErrorReportHeader {
        oocpt_error_report: VERSION,
        renderer: format!("OocPT {}", env!("CARGO_PKG_VERSION")),
        device: lock(&shared.device).as_ref().map(|device| device.name.clone()).unwrap_or_default(),
        width: job.request.width,
        height: job.request.height,
        window: job.request.window.map(|_| job.request.part().corners(job.request.height)),
        samples_target: settings.samples_per_pixel,
        max_bounces: settings.max_bounces,
        seed: settings.seed,
        geometry_budget_kib: settings.geometry_budget_kib,
        reference: settings.reference.clone(),
    };
    let mut reports = lock(&shared.reports);
    let is_first = !reports.iter().any(|have| have == file);
    let writer = ReportWriter::begin(Path::new(file), is_first, &header)?;
    if is_first {
        reports.push(file.to_owned());
    }
    Ok(writer)
}

#[cfg(test)]
mod tests {
    use super::needed_samples;

    #[test]
    fn a_target_takes_a_power_of_two_of_samples() {
        let told = |taken, excess| needed_samples(taken, excess);
        assert!((told(64, 3.0) - 256.0).abs() < 1e-9, "192 are not enough to stop");
        assert!((told(64, 0.9) - 64.0).abs() < 1e-9, "it is reached");
        assert!((told(2, 0.1) - 16.0).abs() < 1e-9, "no render stops before");
    }
}
