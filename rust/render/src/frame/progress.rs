// SPDX-License-Identifier: Apache-2.0
//! Keeps the session's stats, timings and published images up to date while a frame renders.

mod denoising;
mod errors;
mod files;
pub(crate) mod team;
mod windows;

use crate::assets::SceneAssets;
use crate::device::Device;
use crate::error::RenderError;
use crate::film::Film;
use crate::frame::checkpoint::FilmCheckpoints;
use crate::frame::context::is_cpu;
use crate::frame::film_part::FilmPart;
use crate::frame::kept_samples::KeptSamples;
use crate::frame::progress::denoising::DenoisingPlan;
use crate::host_memory;
use crate::job::RenderJob;
use crate::job::patience::LoadWait;
use crate::job::publish::PictureExtent;
use crate::job::request::Severity;
use crate::job::shared::SharedState;
use crate::job::timings::{LevelCounts, RenderTimings};
use crate::job::window::PictureLayout;
use crate::report::closing_words;
use crate::report::error_log::ErrorLog;
use crate::report::progress_bar::{BarState, ProgressBar};
use crate::sync::lock;
use crate::wave::Wave;
use oocpt_abi::WavefrontCounters;
use oocpt_core::inventory::RenderInventory;
use oocpt_core::stats::{RenderStats, RenderUsage, StreamingStats};
use oocpt_gpu::Gpu;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};
use team::TeamProgress;
use windows::WindowShare;

/// Interval between published images: with the wave that ends in it less than a tenth of a second.
const INTERVAL: Duration = Duration::from_millis(60);
/// Publishing an image takes at most such a share of the time.
const PUBLISHING_SHARE: u32 = 8;

/// The progress of one frame.
#[derive(Debug)]
pub(crate) struct FrameProgress<'a> {
    shared: &'a SharedState,
    started: Instant,
    trace_started: Instant,
    pixels: u64,
    samples: u32,
    generation: u64,
    limit: Option<Duration>,
    done: u64,
    next_publish: Instant,
    /// An image with a sample of each pixel was to be published.
    is_whole: bool,
    bar: Option<ProgressBar>,
    log: ErrorLog,
    layout: PictureLayout,
    /// Whether images are published before the last one.
    interactive: bool,
    /// Whether a batch render says how it ended.
    says_how_it_ended: bool,
    /// The render has ended as planned.
    is_finished: bool,
    /// Adaptive: paths that are decided.
    decided: Option<u64>,
    /// Paths that the film had before the render, and whether their error is known.
    kept: Option<u64>,
    knows_kept: bool,
    /// What was counted before another path source went on; of what the film had, samples that are not finite.
    before: WavefrontCounters,
    /// Another path source goes on.
    has_left_off: bool,
    /// The film has parts of waves that were cancelled.
    is_film_lost: bool,
    checkpoints: Option<FilmCheckpoints>,
    part: Option<FilmPart>,
    /// How the picture is denoised, if it is to be.
    denoising: Option<DenoisingPlan>,
    /// First sample that is rendered.
    first_sample: u32,
    /// The film goes on with samples of another process, or for other images, without those of pixel centres.
    lacks_planes: bool,
    /// `WavefrontCounters::nonfinite_pixel`.
    nonfinite_pixel: u32,
    /// Samples that are not finite of those that the film had.
    kept_nonfinite: u32,
    /// What is rendered is a window of the picture, with so much of its work.
    window: Option<WindowShare<'a>>,
    /// What is rendered are samples of a picture that several devices render: the number of this one.
    team: Option<(&'a TeamProgress<'a>, usize)>,
    pub(crate) timings: RenderTimings,
}

impl<'a> FrameProgress<'a> {
    /// Starts the clock and resets the session's stats.
    pub(crate) fn start(shared: &'a SharedState, job: &RenderJob) -> Self {
        let now = Instant::now();
        let counts = &job.snapshot.counts;
        let small = |count: u128| u64::try_from(count).unwrap_or(u64::MAX);
        *lock(&shared.stats) = RenderStats {
            samples_target: job.settings.samples_per_pixel,
            dropped: job.snapshot.dropped,
            instances: small(counts.instances),
            unique_triangles: counts.unique_triangles,
            meshes_made: job.meshes.made,
            meshes_refitted: job.meshes.refitted,
            triangles: small(counts.instanced_triangles),
            meshes: counts.meshes,
            host_bytes: job.snapshot.meshes.iter().map(|mesh| mesh.host_bytes()).sum(),
            host_peak_bytes: host_memory::peak(),
            annotation: "opening the device".into(),
            ..RenderStats::default()
        };
        let limit = job.settings.time_limit_secs;
        Self {
            shared,
            started: now,
            trace_started: now,
            pixels: job.request.pixels(),
            samples: job.settings.samples_per_pixel,
            generation: job.generation,
            limit: (limit > 0.0).then(|| Duration::try_from_secs_f32(limit).unwrap_or(Duration::MAX)),
            done: 0,
            next_publish: now,
            is_whole: false,
            interactive: job.settings.interactive,
            says_how_it_ended: job.options.closing_words && !job.settings.interactive,
            is_finished: false,
            decided: None,
            kept: None,
            knows_kept: false,
            before: WavefrontCounters::default(),
            has_left_off: false,
            is_film_lost: false,
            checkpoints: None,
            part: None,
            denoising: DenoisingPlan::of(job),
            first_sample: 0,
            lacks_planes: false,
            nonfinite_pixel: 0,
            kept_nonfinite: 0,
            window: None,
            team: None,
            log: ErrorLog::start(shared, job),
            layout: job.layout(),
            bar: job.options.progress_bar.then(ProgressBar::new),
            timings: RenderTimings::default(),
        }
    }

    /// The device is open: a report names it.
    pub(crate) fn device_opened(&mut self, job: &RenderJob) {
        self.log.open_report(self.shared, job);
    }

    /// Another attempt at the whole render begins.
    pub(crate) fn begin_again(&mut self) {
        self.done = 0;
        self.decided = None;
        self.kept = None;
        self.before = WavefrontCounters::default();
        (self.has_left_off, self.is_film_lost, self.lacks_planes) = (false, false, false);
        *lock(&self.shared.reached) = (self.generation, 0);
        self.log.begin_again();
    }

    /// Goes on with samples that the film has, for images of `job`.
    pub(crate) fn go_on(&mut self, kept: KeptSamples, job: &RenderJob) {
        // A film of windows has those of the window before.
        self.lacks_planes |=
            kept.lacks_planes || kept.job.request.aovs != job.request.aovs || job.film_window.is_some();
        self.kept_nonfinite = kept.nonfinite.0;
        self.done = kept.paths;
        (self.kept, self.knows_kept) = (Some(kept.paths), kept.is_told);
        (self.before.nonfinite, self.nonfinite_pixel) = kept.nonfinite;
        let samples = self.samples_done();
        *lock(&self.shared.reached) = (self.generation, samples);
        let mut stats = lock(&self.shared.stats);
        (stats.samples_completed, stats.samples_kept) = (samples, samples);
        stats.nonfinite_samples = u64::from(kept.nonfinite.0);
        stats.error = self.log.go_on(kept.history);
        tracing::info!(samples, "going on with the samples that are there");
    }

    /// What the film of `job` has, if a later render can go on with it: a sample of each pixel at least, and the same
    /// number of all pixels but for those of one more.
    pub(crate) fn samples(&self, job: &RenderJob, film: &Film) -> Option<KeptSamples> {
        let is_whole = job.settings.span.is_empty() && !film.has_exact_sums();
        let is_plain = is_whole && film.has_color() && film.adaptive().is_none() && !job.settings.straggler_roulette;
        let nonfinite = u32::try_from(lock(&self.shared.stats).nonfinite_samples).unwrap_or(u32::MAX);
        (is_plain && self.done >= self.pixels && !self.is_film_lost).then(|| KeptSamples {
            job: job.clone(),
            paths: self.done,
            nonfinite: (nonfinite, self.nonfinite_pixel),
            history: self.log.history(),
            is_told: self.is_finished || self.is_told(),
            lacks_planes: false,
            regions: Vec::new(),
        })
    }

    /// Whether the images of pixel centres are not there yet, although samples are.
    pub(crate) fn lacks_planes(&self) -> bool {
        self.lacks_planes
    }

    /// The images of pixel centres are there.
    pub(crate) fn has_planes(&mut self) {
        self.lacks_planes = false;
    }

    /// Paths that the film had before the render, if it goes on with them.
    pub(crate) fn kept(&self) -> Option<u64> {
        self.kept
    }

    /// Whether nothing was added to what the film had, whose error is known.
    fn is_told(&self) -> bool {
        self.knows_kept && self.kept == Some(self.done)
    }

    /// Paths that this render is to trace.
    pub(crate) fn paths_to_trace(&self) -> u64 {
        self.total_paths().saturating_sub(self.kept.unwrap_or(0))
    }

    /// Paths that are done, or handed to the film.
    pub(crate) fn paths_done(&self) -> u64 {
        self.done
    }

    /// Paths of the whole render.
    pub(crate) fn total_paths(&self) -> u64 {
        self.pixels * u64::from(self.samples)
    }

    /// Says in the stats what the scene consists of on the device.
    pub(crate) fn scene(&self, assets: &SceneAssets) {
        let world = &assets.snapshot.world;
        let mut stats = lock(&self.shared.stats);
        stats.streaming.chunks = world.chunks.len() as u64;
        stats.streaming.chunk_instances = world.instances.len() as u64;
        stats.streaming.scene_bytes = assets.bytes;
        stats.streaming.texture_scene_bytes = assets.tile_bytes;
    }

    /// Changes what the stats say about streaming.
    pub(crate) fn streaming(&self, change: impl FnOnce(&mut StreamingStats)) {
        change(&mut lock(&self.shared.stats).streaming);
    }

    /// Adds trees over records of instances that were made.
    pub(crate) fn note_levels(&mut self, made: LevelCounts) {
        let levels = &mut self.timings.levels;
        levels.built += made.built;
        levels.refitted += made.refitted;
        levels.refitted_records += made.refitted_records;
        levels.placed_records += made.placed_records;
        levels.worn += made.worn;
        let levels = *levels;
        lock(&self.shared.timings).levels = levels;
        self.streaming(|stats| (stats.trees_built, stats.trees_refitted) = (levels.built, levels.refitted));
    }

    /// Asks the driver what this process uses now.
    pub(crate) fn note_driver_usage(&self, device: &Device) {
        // Mesa's software renderer tells of the whole machine.
        if !is_cpu(device) {
            let used = device.gpu.driver_usage().unwrap_or(0);
            self.streaming(|stats| stats.driver_peak_bytes = stats.driver_peak_bytes.max(used));
        }
    }

    /// Goes on with a wait for `count` of `what`, as [`SharedState::wait_for_loads`].
    pub(crate) fn wait_for_loads(
        &self,
        patience: &mut LoadWait,
        (what, count): (&str, usize),
        lives: bool,
    ) -> Result<(), RenderError> {
        self.shared.wait_for_loads(patience, what, count, lives)
    }

    /// Says in the stats what is going on.
    pub(crate) fn stage(&self, annotation: &str) {
        tracing::debug!(annotation, "stage");
        lock(&self.shared.stats).annotation = annotation.into();
    }

    /// Says in the stats and the report what this render was specialised to do without, and what it is made of.
    pub(crate) fn made_of(&mut self, left_out: Vec<String>, inventory: RenderInventory) {
        self.log.inventory(self.shared, &inventory);
        let mut stats = lock(&self.shared.stats);
        stats.features_left_out = left_out;
        stats.inventory = inventory;
    }

    /// The first wave is about to be submitted.
    pub(crate) fn trace_started(&mut self) {
        self.trace_started = Instant::now();
    }

    /// Another path source goes on; so much was counted until now.
    pub(crate) fn left_off(&mut self, counters: &WavefrontCounters) {
        let kept = std::mem::take(&mut self.before.nonfinite);
        self.before = WavefrontCounters { nonfinite: counters.nonfinite.saturating_add(kept), ..*counters };
        self.has_left_off = true;
    }

    /// Work under way was cancelled, and the film has parts of it.
    pub(crate) fn film_is_lost(&mut self) {
        self.is_film_lost = true;
    }

    /// Whether another path source goes on.
    pub(crate) fn has_left_off(&self) -> bool {
        self.has_left_off
    }

    /// The last wave is done.
    pub(crate) fn trace_ended(&mut self) {
        self.timings.trace_secs = self.trace_started.elapsed().as_secs_f64();
    }

    /// Whether the time limit has passed; every pixel gets its first sample all the same.
    pub(crate) fn out_of_time(&self) -> bool {
        self.done >= self.pixels && self.limit.is_some_and(|limit| self.started.elapsed() >= limit)
    }

    /// Whether the wave about to be submitted, with which the film has `extent`, should end with an image: when it is
    /// whole for the first time, and from time to time.
    pub(crate) fn publish_due(&mut self, extent: PictureExtent) -> bool {
        let now = Instant::now();
        let is_last = extent.samples != u64::MAX && extent.samples >= self.total_paths();
        let is_whole = extent.covers(self.pixels);
        let is_first = is_whole && !self.is_whole;
        // The end of the render publishes the last one.
        if !self.interactive || is_last || (now < self.next_publish && !is_first) {
            return false;
        }
        if !is_whole && (self.decided.is_some() || self.shown_extent(extent).is_none()) {
            return false;
        }
        self.is_whole |= is_whole;
        self.next_publish = now + INTERVAL;
        true
    }

    /// What of `extent` can be shown: a part of the picture only over a whole one of this job.
    fn shown_extent(&self, extent: PictureExtent) -> Option<PictureExtent> {
        if extent.covers(self.pixels) {
            return Some(PictureExtent::WHOLE);
        }
        // Adaptive samples are not in the order of the pixels.
        let samples = if self.decided.is_some() { 0 } else { extent.samples };
        let part = PictureExtent { samples, ..extent }.whole_strips(self.layout.window.width);
        lock(&self.shared.published).shows(self.generation).then_some(part)
    }

    /// What of the picture is shown at the end of a render, given up or not: as much as there is, but over the first
    /// picture of the job what has a sample.
    fn last_extent(&self) -> PictureExtent {
        let extent = PictureExtent { planes: u64::MAX, samples: self.done };
        let part = if self.interactive { self.shown_extent(extent) } else { None };
        part.unwrap_or(PictureExtent::WHOLE)
    }

    /// Counts a finished wave.
    #[expect(
        clippy::cast_precision_loss,
        clippy::cast_possible_truncation,
        reason = "progress is shown, not computed with"
    )]
    pub(crate) fn wave_done(&mut self, wave: Wave) {
        self.done += u64::from(wave.count);
        self.timings.paths = self.done - self.kept.unwrap_or(0);
        self.timings.waves += 1;
        let mut stats = lock(&self.shared.stats);
        stats.percent_done = (100.0 * self.done as f64 / self.total_paths().max(1) as f64) as f32;
        stats.samples_completed = self.samples_done();
        stats.seconds_total = self.started.elapsed().as_secs_f64();
        stats.host_peak_bytes = host_memory::peak();
        stats.annotation = format!("sample {} of {}", stats.samples_completed, self.samples);
        let samples = stats.samples_completed;
        let state = BarState {
            done: self.done as f64 / self.total_paths().max(1) as f64,
            needed: self.log.needed_share(self.samples, stats.error.as_ref()),
            elapsed: self.started.elapsed(),
            limit: self.limit,
            samples: [samples, self.samples],
            rel_mse: stats.error.as_ref().and_then(|row| row.estimate).map(|estimate| estimate.rel_mse),
        };
        drop(stats);
        *lock(&self.shared.reached) = (self.generation, samples);
        if let Some(window) = &mut self.window {
            window.wave_done(&state);
        }
        if let Some((team, device)) = self.team {
            team.wave_done(device, self.timings.paths);
        }
        if let Some(bar) = &mut self.bar {
            bar.draw(&state);
        }
    }

    /// Samples of each pixel; adaptive: their mean, to the next whole number, for an epoch ends when what is left is
    /// too little.
    fn samples_done(&self) -> u32 {
        let pixels = self.pixels.max(1);
        let samples = if self.decided.is_some() { self.done.div_ceil(pixels) } else { self.done / pixels };
        u32::try_from(samples).unwrap_or(u32::MAX)
    }

    /// Publishes the images as they are at the end.
    pub(crate) fn publish_last(&mut self, film: &Film) -> Result<(), RenderError> {
        let extent = self.last_extent();
        self.publish_images(film, extent, true)
    }

    /// Publishes the images that the last finished submission copied out, of which there is `extent`.
    pub(crate) fn publish(&mut self, film: &Film, extent: PictureExtent) -> Result<(), RenderError> {
        self.publish_images(film, extent, false)
    }

    #[expect(clippy::cast_precision_loss, reason = "rates are shown, not computed with")]
    fn publish_images(&mut self, film: &Film, extent: PictureExtent, is_last: bool) -> Result<(), RenderError> {
        let began = Instant::now();
        let extent = self.shown_extent(extent).unwrap_or(extent);
        let denoised = self.denoise(film, extent, is_last)?;
        lock(&self.shared.published).show_denoised(self.denoising.as_ref().is_some_and(DenoisingPlan::replaces_color));
        let WavefrontCounters { closest_rays, shadow_rays, nonfinite, nonfinite_pixel, stack_overflows, .. } =
            film.publish(&self.shared.published, (self.generation, &self.layout), extent, denoised.as_ref())?;
        self.next_publish = self.next_publish.max(Instant::now() + PUBLISHING_SHARE * began.elapsed());
        self.nonfinite_pixel = self.nonfinite_pixel.max(nonfinite_pixel);
        let before = self.before;
        let (closest_rays, shadow_rays) = (closest_rays + before.closest_rays, shadow_rays + before.shadow_rays);
        let nonfinite = nonfinite.saturating_add(before.nonfinite);
        self.timings.closest_rays = closest_rays;
        self.timings.shadow_rays = shadow_rays;
        let mut stats = lock(&self.shared.stats);
        stats.rays_traced = closest_rays + shadow_rays;
        stats.nonfinite_samples = u64::from(nonfinite);
        stats.rays_per_second = stats.rays_traced as f64 / self.trace_started.elapsed().as_secs_f64().max(1e-9);
        drop(stats);
        if stack_overflows > 0 {
            return Err(RenderError::StackOverflow { count: u64::from(stack_overflows) });
        }
        Ok(())
    }

    /// Ends the render of a window that has no pixels: images have their clear values everywhere.
    pub(crate) fn show_nothing(&mut self, job: &RenderJob) -> Result<(), RenderError> {
        let [width, height] = self.layout.size;
        self.shared.report(
            Severity::Warning,
            format!("the window that is to be rendered has no pixel in the picture of {width} x {height}"),
        );
        let kinds = job.request.kinds();
        let mut published = lock(&self.shared.published);
        if published.begin(self.generation, &kinds, &self.layout, PictureExtent::WHOLE) {
            kinds.iter().for_each(|kind| published.put(*kind, &[], 0));
        }
        drop(published);
        self.finish()
    }

    /// Whether the render has ended as planned.
    pub(crate) fn is_finished(&self) -> bool {
        self.is_finished
    }

    /// The render has ended as planned.
    pub(crate) fn finish(&mut self) -> Result<(), RenderError> {
        self.is_finished = true;
        let mut stats = lock(&self.shared.stats);
        stats.seconds_total = self.started.elapsed().as_secs_f64();
        if self.done >= self.open_paths() {
            stats.percent_done = 100.0;
        }
        stats.annotation = "done".into();
        stats.passes = self.timings.passes.iter().map(|pass| (pass.name.clone(), pass.secs, pass.runs)).collect();
        drop(stats);
        *lock(&self.shared.timings) = self.timings.clone();
        Ok(())
    }

    /// One warning for each row of renders that have such samples: hosts begin anew at each edit.
    fn tell_nonfinite(&self, count: u64) {
        if count == 0 {
            if self.done >= self.total_paths() {
                self.shared.nonfinite_reported.store(false, Ordering::Relaxed);
            }
        } else if !self.shared.nonfinite_reported.swap(true, Ordering::Relaxed) {
            self.shared.report(Severity::Warning, nonfinite_text(count, self.nonfinite_pixel, self.layout.size[0]));
        }
    }

    /// The render is over, as planned or not: notes memory use, tells the report, and turns what the validation layer
    /// said into errors: it is only on in tests.
    pub(crate) fn end(&mut self, gpu: &Gpu) {
        let memory = gpu.memory();
        self.tell_end([memory.used, memory.peak, memory.budget]);
        for message in gpu.take_validation_messages() {
            self.shared.report(Severity::Error, format!("Vulkan validation: {message}"));
        }
    }

    /// As [`Self::end`]; bytes of device memory that are used now, at most, and that may be.
    fn tell_end(&mut self, memory: [u64; 3]) {
        let mut stats = lock(&self.shared.stats);
        [stats.gpu_bytes, stats.gpu_peak_bytes, stats.gpu_budget_bytes] = memory;
        stats.host_peak_bytes = host_memory::peak();
        let usage = self.timings.add_to(RenderUsage::of(&stats));
        let nonfinite = stats.nonfinite_samples;
        if self.is_finished && self.says_how_it_ended {
            self.shared.report(Severity::Status, closing_words::line(&stats));
            let row = stats.error.as_ref().filter(|_| nonfinite == 0);
            if let Some(warning) = row.and_then(|row| closing_words::fireflies(row, self.pixels)) {
                self.shared.report(Severity::Warning, warning);
            }
        }
        drop(stats);
        if self.team.is_none() {
            self.tell_nonfinite(nonfinite);
        }
        self.log.usage(self.shared, usage);
    }
}

/// What is said of samples that are not finite; `pixel` is `WavefrontCounters::nonfinite_pixel`.
fn nonfinite_text(count: u64, pixel: u32, width: u32) -> String {
    let samples = if count == 1 { "1 sample is".to_owned() } else { format!("{count} samples are") };
    let place = (pixel != 0 && width != 0).then(|| (!pixel % width, !pixel / width));
    let place = place
        .map_or_else(String::new, |(x, y)| format!("; the lowest pixel that sees one is {x}, {y} from the lower left"));
    format!("{samples} not finite (a light or material without bounds) and left out{place}")
}

#[cfg(test)]
mod tests {
    use super::nonfinite_text;

    #[test]
    fn non_finite_samples_are_reported_with_their_pixel() {
        let said = nonfinite_text(7, !(3 * 64 + 5), 64);
        assert!(said.starts_with("7 samples are not finite") && said.contains("is 5, 3 from the lower left"), "{said}");
        let said = nonfinite_text(1, u32::MAX, 64);
        assert!(said.starts_with("1 sample is not") && said.contains("is 0, 0 from"), "{said}");
        assert!(nonfinite_text(2, 0, 64).ends_with("left out"), "no place");
    }
}
