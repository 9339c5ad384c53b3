// SPDX-License-Identifier: Apache-2.0
//! The progress of a picture whose film is rendered window by window: each window has a progress of its own, with stats
//! that nobody sees, which is added to that of the picture.

use super::FrameProgress;
use crate::job::RenderJob;
use crate::job::aov::AovKind;
use crate::job::publish::PublishedImages;
use crate::job::shared::SharedState;
use crate::report::error_log::{MeasuredRow, RowMoment};
use crate::report::progress_bar::{BarState, ProgressBar};
use crate::report::window_rows::WindowRows;
use crate::sync::lock;
use oocpt_core::adaptive::AdaptiveUsage;
use std::time::Instant;

/// Least time limit of a window, seconds: 0 is none.
const LEAST_SECS: f32 = 1e-3;

/// The part that a window has in the progress of its picture.
#[derive(Debug)]
pub(crate) struct WindowShare<'a> {
    shared: &'a SharedState,
    started: Instant,
    bar: Option<ProgressBar>,
    /// The picture at the beginning of the window, and the share of its paths that are the window's.
    state: BarState,
    share: f64,
    /// Which window of how many.
    number: [usize; 2],
}

impl WindowShare<'_> {
    /// Tells of the picture what a wave of the window has done.
    #[expect(clippy::cast_possible_truncation, reason = "progress is shown, not computed with")]
    pub(super) fn wave_done(&mut self, window: &BarState) {
        let done = self.state.done + self.share * window.done;
        let [number, windows] = self.number;
        let [sample, samples] = window.samples;
        let mut stats = lock(&self.shared.stats);
        stats.percent_done = (100.0 * done) as f32;
        stats.seconds_total = self.started.elapsed().as_secs_f64();
        stats.host_peak_bytes = crate::host_memory::peak();
        stats.annotation = format!("window {number} of {windows}, sample {sample} of {samples}");
        drop(stats);
        if let Some(bar) = &mut self.bar {
            bar.draw(&BarState { done, elapsed: self.started.elapsed(), ..self.state });
        }
    }
}

impl<'a> FrameProgress<'a> {
    /// Begins a picture of so many windows: nothing is counted yet.
    pub(crate) fn begin_windows(&mut self, windows: usize) {
        let mut stats = lock(&self.shared.stats);
        stats.film_windows = u32::try_from(windows).unwrap_or(u32::MAX);
        (stats.rays_traced, stats.nonfinite_samples, stats.adaptive, stats.error) = (0, 0, None, None);
        drop(stats);
        let timings = &mut self.timings;
        (timings.paths, timings.closest_rays, timings.shadow_rays) = (0, 0, 0);
    }

    /// Time limit of the first of so many windows that are left, seconds; 0 is none. Each gets the same part of what is
    /// left of that of the picture.
    pub(crate) fn window_secs(&self, left: usize) -> f32 {
        let Some(limit) = self.limit else { return 0.0 };
        let left = u32::try_from(left.max(1)).unwrap_or(u32::MAX);
        (limit.saturating_sub(self.started.elapsed()) / left).as_secs_f32().max(LEAST_SECS)
    }

    /// Whether the time limit of the picture has passed.
    pub(crate) fn is_late(&self) -> bool {
        self.limit.is_some_and(|limit| self.started.elapsed() >= limit)
    }

    /// Begins window `number` (from 0) of `windows`, whose `job` is to bring its pixels from `samples[0]` to
    /// `samples[1]` samples; its stats and messages go to `apart`.
    pub(crate) fn begin_window<'b>(
        &mut self,
        apart: &'b SharedState,
        job: &RenderJob,
        [number, windows]: [usize; 2],
        [from, to]: [u32; 2],
    ) -> FrameProgress<'b>
    where
        'a: 'b,
    {
        let error = lock(&self.shared.stats).error.clone();
        #[expect(clippy::cast_precision_loss, reason = "progress is shown, not computed with")]
        let (at, of) = (number as f64, windows.max(1) as f64);
        let [done, all, share] = [from, self.samples.max(1), to.saturating_sub(from)].map(f64::from);
        let state = BarState {
            done: (done + share * at / of) / all,
            needed: self.log.needed_share(self.samples, error.as_ref()),
            limit: self.limit,
            samples: [from, self.samples],
            rel_mse: error.and_then(|row| row.estimate).map(|estimate| estimate.rel_mse),
            ..BarState::default()
        };
        let share = WindowShare {
            shared: self.shared,
            started: self.started,
            bar: self.bar.take(),
            state,
            share: share / of / all,
            number: [number + 1, windows],
        };
        let mut window = FrameProgress { window: Some(share), ..FrameProgress::start(apart, job) };
        window.log.serve(&self.log);
        window
    }

    /// Adds what a window gave, and gives its measurements and its samples.
    pub(crate) fn end_window(&mut self, mut window: FrameProgress<'_>, is_first: bool) -> (Vec<MeasuredRow>, u32) {
        self.bar = window.window.take().and_then(|share| share.bar);
        self.nonfinite_pixel = self.nonfinite_pixel.max(window.nonfinite_pixel);
        let of = lock(&window.shared.stats).clone();
        if is_first {
            self.log.inventory(self.shared, &of.inventory);
        }
        let mut stats = lock(&self.shared.stats);
        stats.rays_traced += of.rays_traced;
        stats.nonfinite_samples += of.nonfinite_samples.saturating_sub(window.kept_nonfinite.into());
        if is_first {
            stats.streaming = of.streaming;
        } else {
            stats.streaming.go_on(&of.streaming);
        }
        (stats.features_left_out, stats.inventory) = (of.features_left_out, of.inventory);
        stats.adaptive = match (stats.adaptive, of.adaptive) {
            (Some(a), Some(b)) => Some(AdaptiveUsage { fewest: a.fewest.min(b.fewest), most: a.most.max(b.most), ..b }),
            (a, b) => b.or(a),
        };
        drop(stats);
        self.timings.go_on(std::mem::take(&mut window.timings));
        let samples = window.samples_done();
        (window.log.take_rows(), samples)
    }

    /// All windows have at least so many samples: tells the errors of the picture that follow. `is_last`: there will be
    /// no more, and the picture is published.
    #[expect(clippy::cast_precision_loss, reason = "rates are shown, not computed with")]
    pub(crate) fn end_windows(&mut self, rows: &mut WindowRows, samples: u32, is_last: bool) {
        self.done = self.pixels * u64::from(samples);
        *lock(&self.shared.reached) = (self.generation, samples);
        let mut stats = lock(&self.shared.stats);
        stats.samples_completed = samples;
        stats.rays_per_second = stats.rays_traced as f64 / self.started.elapsed().as_secs_f64().max(1e-9);
        let base = RowMoment {
            seconds: self.started.elapsed().as_secs_f64(),
            seconds_tracing: self.timings.trace_secs,
            bytes_paged: stats.streaming.bytes_paged,
            ..RowMoment::default()
        };
        let rays = stats.rays_traced;
        drop(stats);
        let fed = rows.take(is_last, (base, rays));
        for MeasuredRow { octave, measured, moment } in fed {
            self.log.row(self.shared, measured, octave, moment);
        }
        if is_last {
            self.log.finish(self.shared);
        }
    }

    /// Whether the error of the picture is small enough to stop.
    pub(crate) fn is_good_enough(&self) -> bool {
        self.log.is_good_enough()
    }

    /// Publishes the images of all windows as those of the picture.
    pub(crate) fn publish_windows(&mut self, from: &mut PublishedImages) {
        lock(&self.shared.published).take_over(from, self.generation, &self.layout);
    }

    /// Has the errors of the pixels add up to the told error of the picture, of which `rows` were measured.
    #[expect(clippy::cast_possible_truncation, reason = "a factor of an image of f32")]
    pub(crate) fn scale_error_image(&self, rows: &WindowRows) {
        let estimate = lock(&self.shared.stats).error.as_ref().and_then(|row| row.estimate);
        let (Some(estimate), Some(sums)) = (estimate, rows.last_sums().filter(|sums| sums.s > 0.0)) else { return };
        let factor = (estimate.rel_mse * sums.pixels / sums.s).sqrt() as f32;
        lock(&self.shared.published).change(AovKind::Error, |image, layout| {
            for row in layout.rows(AovKind::Error) {
                for pixel in image[row].chunks_exact_mut(size_of::<f32>()) {
                    let error: f32 = bytemuck::pod_read_unaligned(pixel);
                    pixel.copy_from_slice(&(error * factor).to_ne_bytes());
                }
            }
        });
    }
}
