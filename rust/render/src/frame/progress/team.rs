// SPDX-License-Identifier: Apache-2.0
//! The progress of a picture that several devices render: each device has a progress of its own for each of its blocks
//! of samples, with stats that nobody sees, which is added to that of the picture.

use super::FrameProgress;
use crate::error::RenderError;
use crate::film::measure::MeasuredError;
use crate::host_memory;
use crate::job::RenderJob;
use crate::job::aov::AovKind;
use crate::job::publish::{PictureExtent, PublishedImages};
use crate::job::shared::SharedState;
use crate::job::timings::RenderTimings;
use crate::report::error_log::RowMoment;
use crate::report::progress_bar::{BarState, ProgressBar};
use crate::sync::lock;
use oocpt_core::stats::{DeviceUsage, RenderStats};
use oocpt_film::{FilmPicture, OctaveError, SampleRange};
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// What all devices count together. Any thread.
#[derive(Debug)]
pub(crate) struct TeamProgress<'a> {
    shared: &'a SharedState,
    generation: u64,
    started: Instant,
    limit: Option<Duration>,
    pixels: u64,
    span: SampleRange,
    paths: Mutex<TeamPaths>,
}

/// Paths that are done.
#[derive(Debug)]
struct TeamPaths {
    /// Of blocks that have ended.
    whole: u64,
    /// Of the block of each device.
    under_way: Vec<u64>,
    bar: Option<ProgressBar>,
}

impl TeamProgress<'_> {
    /// So many paths of its block are done on a device.
    pub(super) fn wave_done(&self, device: usize, paths: u64) {
        let mut counts = lock(&self.paths);
        if let Some(count) = counts.under_way.get_mut(device) {
            *count = paths;
        }
        self.tell(&mut counts);
    }

    /// The block of a device has ended; the film has so many of its samples.
    pub(crate) fn block_done(&self, device: usize, samples: u32) {
        let mut counts = lock(&self.paths);
        counts.whole += self.pixels * u64::from(samples);
        if let Some(count) = counts.under_way.get_mut(device) {
            *count = 0;
        }
        self.tell(&mut counts);
    }

    #[expect(
        clippy::cast_precision_loss,
        clippy::cast_possible_truncation,
        reason = "progress is shown, not computed with"
    )]
    fn tell(&self, counts: &mut TeamPaths) {
        let SampleRange { begin, end } = self.span;
        let paths = counts.whole + counts.under_way.iter().sum::<u64>();
        let samples = u32::try_from(paths / self.pixels.max(1)).unwrap_or(u32::MAX).saturating_add(begin).min(end);
        let all = self.pixels.max(1) as f64 * f64::from(end.max(1));
        let done = (self.pixels as f64 * f64::from(begin) + paths as f64) / all;
        let mut stats = lock(&self.shared.stats);
        stats.percent_done = (100.0 * done) as f32;
        stats.samples_completed = samples;
        stats.seconds_total = self.started.elapsed().as_secs_f64();
        stats.host_peak_bytes = host_memory::peak();
        stats.annotation = format!("sample {samples} of {end}, {} devices", counts.under_way.len());
        let rel_mse = stats.error.as_ref().and_then(|row| row.estimate).map(|estimate| estimate.rel_mse);
        drop(stats);
        *lock(&self.shared.reached) = (self.generation, samples);
        let (elapsed, limit) = (self.started.elapsed(), self.limit);
        if let Some(bar) = &mut counts.bar {
            bar.draw(&BarState { done, needed: 1.0, elapsed, limit, samples: [samples, end], rel_mse });
        }
    }

    /// Seconds since the picture was begun.
    pub(crate) fn seconds(&self) -> f64 {
        self.started.elapsed().as_secs_f64()
    }

    /// Seconds until the time limit of the picture, if there is one.
    pub(crate) fn secs_left(&self) -> Option<f64> {
        self.limit.map(|limit| limit.saturating_sub(self.started.elapsed()).as_secs_f64())
    }
}

/// What came of a block of samples.
#[derive(Debug)]
pub(crate) struct BlockOutcome {
    pub(crate) stats: RenderStats,
    pub(crate) timings: RenderTimings,
    /// When the device began to trace.
    pub(crate) traced_from: Instant,
    nonfinite_pixel: u32,
}

impl<'a> FrameProgress<'a> {
    /// Begins a picture of so many devices, with the samples of the span but for those that a film has.
    pub(crate) fn begin_team(&mut self, devices: usize, span: SampleRange, had: u32) -> TeamProgress<'a> {
        let mut stats = lock(&self.shared.stats);
        (stats.rays_traced, stats.nonfinite_samples, stats.error) = (0, 0, None);
        stats.samples_kept = had;
        drop(stats);
        let whole = self.pixels * u64::from(had);
        TeamProgress {
            shared: self.shared,
            generation: self.generation,
            started: self.started,
            limit: self.limit,
            pixels: self.pixels,
            span,
            paths: Mutex::new(TeamPaths { whole, under_way: vec![0; devices], bar: self.bar.take() }),
        }
    }

    /// Begins the block that `job` is on a device, whose stats and messages go to `apart`.
    pub(crate) fn of_block<'b>(
        apart: &'b SharedState,
        job: &RenderJob,
        team: &'b TeamProgress<'b>,
        device: usize,
    ) -> FrameProgress<'b> {
        FrameProgress { team: Some((team, device)), ..FrameProgress::start(apart, job) }
    }

    /// Ends the progress of a block.
    pub(crate) fn end_block(self) -> BlockOutcome {
        BlockOutcome {
            stats: lock(&self.shared.stats).clone(),
            timings: self.timings.clone(),
            traced_from: self.trace_started,
            nonfinite_pixel: self.nonfinite_pixel,
        }
    }

    /// Adds what came of a block.
    pub(crate) fn add_block(&mut self, block: BlockOutcome) {
        let BlockOutcome { stats: of, timings, traced_from, nonfinite_pixel } = block;
        self.nonfinite_pixel = self.nonfinite_pixel.max(nonfinite_pixel);
        let is_first = self.timings.paths == 0;
        if is_first {
            self.log.inventory(self.shared, &of.inventory);
            self.trace_started = traced_from;
        }
        self.trace_started = self.trace_started.min(traced_from);
        self.timings.go_on(timings);
        let mut stats = lock(&self.shared.stats);
        stats.rays_traced += of.rays_traced;
        stats.nonfinite_samples += of.nonfinite_samples;
        if is_first {
            stats.streaming = of.streaming;
        } else {
            stats.streaming.go_on(&of.streaming);
        }
        if !of.inventory.passes.is_empty() {
            (stats.features_left_out, stats.inventory) = (of.features_left_out, of.inventory);
        }
    }

    /// Tells errors that the film has measured.
    pub(crate) fn film_errors(&mut self, errors: &[OctaveError]) {
        for error in errors {
            let stats = lock(&self.shared.stats).clone();
            let moment = RowMoment {
                seconds: self.started.elapsed().as_secs_f64(),
                seconds_tracing: self.trace_started.elapsed().as_secs_f64(),
                bytes_paged: stats.streaming.bytes_paged,
                gpu_bytes: stats.gpu_bytes,
                samples: error.samples,
                has_picture: false,
            };
            let measured = MeasuredError {
                sums: error.sums,
                worst: error.worst.clone(),
                fewest: error.samples,
                most: error.samples,
                rays: stats.rays_traced,
            };
            let octave = error.samples.is_power_of_two().then(|| error.samples.ilog2());
            self.log.row(self.shared, measured, octave, moment);
        }
    }

    /// Samples that may begin, by the target error.
    pub(crate) fn open_samples(&self) -> u32 {
        u32::try_from(self.log.open_paths() / self.pixels.max(1)).unwrap_or(u32::MAX)
    }

    /// No device has work any more.
    pub(crate) fn end_tracing(&mut self) {
        self.trace_ended();
    }

    /// Publishes the picture of the film, with the images through pixel centres that one device made.
    pub(crate) fn publish_team(&mut self, picture: &FilmPicture, planes: Option<PublishedImages>, kinds: &[AovKind]) {
        let mut published = lock(&self.shared.published);
        if let Some(mut planes) = planes {
            published.take_over(&mut planes, self.generation, &self.layout);
        }
        published.show_denoised(false);
        if published.begin(self.generation, kinds, &self.layout, PictureExtent::WHOLE) {
            published.put(AovKind::Color, bytemuck::cast_slice(&picture.rgba), u64::MAX);
        }
    }

    /// Ends a picture whose film has samples before `end`, of each pixel.
    #[expect(clippy::cast_precision_loss, reason = "rates are shown, not computed with")]
    pub(crate) fn end_team(&mut self, end: u32, devices: Vec<DeviceUsage>) -> Result<(), RenderError> {
        self.done = self.pixels * u64::from(end);
        *lock(&self.shared.reached) = (self.generation, end);
        let mut stats = lock(&self.shared.stats);
        stats.samples_completed = end;
        stats.rays_per_second = stats.rays_traced as f64 / self.trace_started.elapsed().as_secs_f64().max(1e-9);
        stats.devices = devices;
        drop(stats);
        self.log.finish(self.shared);
        self.finish()
    }

    /// The picture is over, as planned or not; bytes of device memory used now, at most, and that may be, of the device
    /// that held most.
    pub(crate) fn end_of_team(&mut self, memory: [u64; 3]) {
        self.tell_end(memory);
    }
}
