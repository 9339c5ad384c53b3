// SPDX-License-Identifier: Apache-2.0
//! Live views whose window has moved: pixels that both windows have keep their samples, and the new ones are brought to
//! as many before all go on together.
//!
//! A sample is a function of its pixel, so the picture has the bits of one that was in this window from the beginning.
//! Regions of new pixels are rendered as windows of their own, with a film of their own that is copied into that of the
//! picture: first one sample, after which the picture is shown, then four times as many, and so on. What a host that
//! drags the window interrupts is kept, too. Only the told error begins anew: its octaves are of all pixels. Render
//! thread only.

use super::Renderer;
use crate::device::{Device, WAVE_TIMEOUT};
use crate::error::RenderError;
use crate::film::{Film, FilmSums};
use crate::frame::film_regions::FilmRegion;
use crate::frame::kept_samples::KeptSamples;
use crate::frame::progress::FrameProgress;
use crate::job::RenderJob;
use crate::job::request::RenderRequest;
use crate::job::shared::{FrameGate, SharedState};
use crate::job::window::PixelWindow;
use crate::report::error_log::ErrorHistory;
use crate::sync::lock;
use oocpt_core::settings::Settings;
use oocpt_gpu::GpuError;
use std::sync::Arc;

/// By how much the samples of new pixels grow from one picture to the next.
const GROWTH: u32 = 4;

/// What the film of a window that has moved has.
struct MovedFilm {
    regions: Vec<FilmRegion>,
    /// Samples that all pixels are to have before they go on together.
    samples: u32,
    nonfinite: (u32, u32),
    /// True if the device had no memory for the film of a region.
    has_no_room: bool,
    /// Stats, messages and images of regions.
    apart: SharedState,
}

/// A job of the same samples, as many as `samples`, of which no file is written.
fn part_of(job: &RenderJob, samples: u32) -> RenderJob {
    let settings = Settings {
        samples_per_pixel: samples,
        time_limit_secs: 0.0,
        report: String::new(),
        reference: String::new(),
        chunk_report: String::new(),
        checkpoint: String::new(),
        film_part: String::new(),
        ..job.settings.clone()
    };
    let mut options = job.options;
    (options.progress_bar, options.closing_words) = (false, false);
    RenderJob { settings, options, goes_on: true, ..job.clone() }
}

/// The job of a region: nothing but its samples.
fn region_job(job: &RenderJob, pixels: PixelWindow, samples: u32) -> RenderJob {
    let part = part_of(job, samples);
    let filters = job.settings.filter_aovs;
    let aovs = job.request.aovs.iter().filter(|aov| aov.kind.is_of_light() || aov.kind.is_of_samples(filters));
    let request = RenderRequest { window: Some(pixels), aovs: aovs.copied().collect(), ..job.request.clone() };
    RenderJob { request, catches_up: true, ..part }
}

/// So many samples of the pixels of `job`.
fn kept(job: RenderJob, samples: u32, (nonfinite, is_told): ((u32, u32), bool)) -> KeptSamples {
    let paths = job.request.pixels() * u64::from(samples);
    let (history, lacks_planes) = (ErrorHistory::default(), true);
    KeptSamples { job, paths, nonfinite, history, is_told, lacks_planes, regions: Vec::new() }
}

/// A film for `job`; none where the device has no memory for another one.
fn film_of(device: &Device, job: &RenderJob) -> Result<Option<Film>, RenderError> {
    #[cfg(feature = "faults")]
    if job.options.faults.has_no_second_film && job.catches_up {
        return Ok(None);
    }
    match Film::new(&device.gpu, &job.request, FilmSums::of(job, false)) {
        Ok(film) => Ok(Some(film)),
        Err(error @ GpuError::DeviceLost { .. }) => Err(error.into()),
        Err(error) => {
            tracing::debug!(%error, "the samples of a moved window are not kept");
            Ok(None)
        }
    }
}

/// Copies the pixels of `shared` from one film to a new one or, if it `is_part`, to one that has others already; each
/// film has its window.
fn copy(
    device: &Device,
    (from, from_window): (&Film, PixelWindow),
    (into, into_window): (&Film, PixelWindow),
    (shared, is_part): (&[PixelWindow], bool),
) -> Result<(), RenderError> {
    let mut commands = device.gpu.commands("pixels of a moved window")?;
    if !is_part {
        into.clear(&mut commands);
    }
    commands.concurrent(|c| {
        shared.iter().for_each(|pixels| from.copy_pixels(c, from_window, (into, into_window), *pixels));
    });
    if commands.submit()?.wait(WAVE_TIMEOUT)? {
        return Ok(());
    }
    Err(RenderError::Internal("a film was not copied in time".into()))
}

impl Renderer {
    /// Renders `job` as a whole; with the samples of another window of its picture, if there are some.
    pub(super) fn render_moved(
        &mut self,
        device: &Arc<Device>,
        job: &RenderJob,
        gate: &FrameGate<'_>,
        progress: &mut FrameProgress<'_>,
    ) -> Result<(), RenderError> {
        let Some(mut moved) = self.take_moved(device, job)? else {
            return self.render_on(device, job, gate, progress);
        };
        self.catch_up(device, job, gate, progress, &mut moved)?;
        if moved.has_no_room {
            (self.film, self.kept) = (None, None);
            return self.render_on(device, job, gate, progress);
        }
        let (samples, nonfinite) = (moved.samples, moved.nonfinite);
        let behind = moved.regions.iter().any(|region| region.samples < samples);
        self.kept = Some(kept(job.clone(), samples, (nonfinite, false)));
        let is_whole = moved.regions.iter().all(|region| region.samples > 0);
        if is_whole && !gate.is_superseded() {
            self.render_on(device, job, gate, progress)?;
        }
        if behind && let Some(kept) = &mut self.kept {
            // It was given up meanwhile.
            kept.regions = moved.regions;
        }
        Ok(())
    }

    /// The film of `job` with the samples that it has in common with the one before; none where another film has to
    /// begin, or where new pixels take so long that a coarser picture is shown first.
    fn take_moved(&mut self, device: &Arc<Device>, job: &RenderJob) -> Result<Option<MovedFilm>, RenderError> {
        if self.kept.as_ref().is_none_or(|kept| kept.serve(job)) {
            return Ok(None);
        }
        let Some(regions) = self.kept.as_ref().and_then(|kept| kept.moved_to(job)) else { return Ok(None) };
        let samples = regions.iter().map(|region| region.samples).max().unwrap_or(0);
        let fresh = regions.iter().filter(|region| region.samples == 0).map(|region| region.pixels.pixels()).sum();
        let is_fast = !self.first_pictures.comes_first(device, job, fresh);
        if !is_fast || samples == 0 || samples > job.settings.samples_per_pixel {
            return Ok(None);
        }
        let (Some(old), Some(before)) = (self.film.take(), self.kept.take()) else { return Ok(None) };
        let Some(film) = film_of(device, job)? else { return Ok(None) };
        let shared: Vec<PixelWindow> =
            regions.iter().filter(|region| region.samples > 0).map(|region| region.pixels).collect();
        copy(device, (&old, before.job.request.part()), (&film, job.request.part()), (&shared, false))?;
        self.film = Some(film);
        let (nonfinite, apart) = (before.nonfinite, SharedState::default());
        Ok(Some(MovedFilm { regions, samples, nonfinite, has_no_room: false, apart }))
    }

    /// Brings all regions to the samples of the others, until `gate` closes; shows pictures on the way.
    fn catch_up(
        &mut self,
        device: &Arc<Device>,
        job: &RenderJob,
        gate: &FrameGate<'_>,
        progress: &mut FrameProgress<'_>,
        moved: &mut MovedFilm,
    ) -> Result<(), RenderError> {
        let mut level = 1;
        loop {
            for number in 0..moved.regions.len() {
                let region = moved.regions[number];
                if region.samples < level && !self.bring(device, (job, gate), progress, moved, (number, level))? {
                    return Ok(());
                }
            }
            if level == moved.samples {
                return Ok(());
            }
            let is_behind = moved.regions.iter().any(|region| region.samples < moved.samples);
            if is_behind && !self.show(device, (job, gate), moved)? {
                return Ok(());
            }
            level = level.saturating_mul(GROWTH).min(moved.samples);
        }
    }

    /// Brings a region to so many samples; false if `gate` closed meanwhile.
    fn bring(
        &mut self,
        device: &Arc<Device>,
        (job, gate): (&RenderJob, &FrameGate<'_>),
        progress: &mut FrameProgress<'_>,
        moved: &mut MovedFilm,
        (number, samples): (usize, u32),
    ) -> Result<bool, RenderError> {
        if !gate.proceed() {
            return Ok(false);
        }
        let region = moved.regions[number];
        let part = region_job(job, region.pixels, samples);
        let Some(film) = film_of(device, &part)? else {
            moved.has_no_room = true;
            return Ok(false);
        };
        let Some(whole) = self.film.replace(film) else { return Ok(false) };
        let window = job.request.part();
        if let Some(film) = self.film.as_ref().filter(|_| region.samples > 0) {
            copy(device, (&whole, window), (film, region.pixels), (&[region.pixels], false))?;
            self.kept = Some(kept(part.clone(), region.samples, ((0, 0), true)));
        }
        let mut inner = FrameProgress::start(&moved.apart, &part);
        self.render_on(device, &part, &gate.with_results(&moved.apart), &mut inner)?;
        let (film, done) = (self.film.replace(whole), self.kept.take());
        let is_done = |done: &KeptSamples| done.paths == part.request.pixels() * u64::from(samples);
        let Some(done) = done.filter(is_done) else { return Ok(false) };
        if let (Some(film), Some(whole)) = (film, &self.film) {
            copy(device, (&film, region.pixels), (whole, window), (&[region.pixels], true))?;
        }
        moved.nonfinite.0 = moved.nonfinite.0.saturating_add(done.nonfinite.0);
        moved.regions[number].samples = samples;
        progress.timings.caught_up_paths += part.request.pixels() * u64::from(samples - region.samples);
        Ok(true)
    }

    /// Shows what there is of the picture, each pixel with the samples that it has; false if `gate` closed meanwhile.
    fn show(
        &mut self,
        device: &Arc<Device>,
        (job, gate): (&RenderJob, &FrameGate<'_>),
        moved: &MovedFilm,
    ) -> Result<bool, RenderError> {
        if !gate.proceed() {
            return Ok(false);
        }
        let part = part_of(job, moved.samples);
        self.kept = Some(kept(part.clone(), moved.samples, (moved.nonfinite, true)));
        let stats = lock(&gate.shared().stats).clone();
        let mut inner = FrameProgress::start(gate.shared(), &part);
        self.render_on(device, &part, gate, &mut inner)?;
        self.kept = None;
        *lock(&gate.shared().stats) = stats;
        Ok(gate.proceed())
    }
}
