// SPDX-License-Identifier: Apache-2.0
//! A picture that several devices render: what the render thread makes of what they tell.

use crate::error::RenderError;
use crate::frame::film_header::device_text;
use crate::frame::film_part::{MayLack, film_of};
use crate::frame::progress::FrameProgress;
use crate::job::RenderJob;
use crate::job::request::Severity;
use crate::job::shared::FrameGate;
use crate::sync::lock;
use crate::team::member::{BlockEnd, TeamMember};
use crate::team::plan::TeamPlan;
use oocpt_core::settings::Settings;
use oocpt_core::stats::DeviceUsage;
use oocpt_film::SampleRange;
use oocpt_gpu::DeviceReport;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::mpsc::channel;
use std::time::{Duration, Instant};

/// A picture on its way. Render thread only.
pub(super) struct TeamPicture<'a> {
    progress: FrameProgress<'a>,
    devices: Vec<DeviceReport>,
    span: SampleRange,
    /// Errors of the film that were told.
    told: usize,
    usage: Vec<DeviceUsage>,
    /// Bytes of device memory of each device: used now, at most, and its limit.
    memory: Vec<[u64; 3]>,
    failures: Vec<RenderError>,
    /// The part of the film that is to be written.
    part: Option<WrittenPart<'a>>,
}

/// The file of a film, if it is to be kept.
struct WrittenPart<'a> {
    path: &'a Path,
    interval: Duration,
    next: Option<Instant>,
    /// Samples that are not finite, and the time, of which the film knows.
    noted: (u64, Instant),
}

/// Renders `job` on these devices.
pub(super) fn render(job: &RenderJob, gate: &FrameGate<'_>, members: &mut [TeamMember]) -> Result<(), RenderError> {
    let devices: Vec<DeviceReport> = members.iter().map(|member| member.device.clone()).collect();
    let (plan, mut picture) = TeamPicture::begin(job, gate, devices)?;
    let result = picture.render(&plan, members).and_then(|()| picture.end(&plan));
    picture.progress.end_of_team(picture.memory.iter().copied().max_by_key(|[_, peak, _]| *peak).unwrap_or_default());
    result
}

impl<'a> TeamPicture<'a> {
    fn begin(
        job: &'a RenderJob,
        gate: &'a FrameGate<'a>,
        devices: Vec<DeviceReport>,
    ) -> Result<(TeamPlan<'a>, Self), RenderError> {
        let Some(first) = devices.first() else {
            return Err(RenderError::Internal("no device renders the picture".to_owned()));
        };
        let settings = &job.settings;
        let mut progress = FrameProgress::start(gate.shared(), job);
        *lock(&gate.shared().device) = Some(first.clone());
        progress.device_opened(job);
        progress.stage("opening the devices");
        let film = film_of(job, first, MayLack::Any)?;
        let span = SampleRange::new(settings.span.begin, settings.samples_per_pixel);
        let had = film.header().samples();
        let open = if span.begin == 0 { progress.open_samples() } else { u32::MAX };
        let team = progress.begin_team(devices.len(), span, had.iter().map(|range| range.samples()).sum());
        let plan = TeamPlan::new(job, gate, (film, span, open), (devices.len(), team));
        let usage = |device: &DeviceReport| DeviceUsage {
            name: device.name.clone(),
            index: u32::try_from(device.index).unwrap_or(u32::MAX),
            ..DeviceUsage::default()
        };
        let picture = Self {
            progress,
            span,
            told: 0,
            usage: devices.iter().map(usage).collect(),
            memory: vec![[0; 3]; devices.len()],
            failures: Vec::new(),
            part: (!settings.film_part.is_empty()).then(|| WrittenPart::new(settings)),
            devices,
        };
        Ok((plan, picture))
    }

    /// Has the devices render blocks until nothing is left.
    fn render(&mut self, plan: &TeamPlan<'_>, members: &mut [TeamMember]) -> Result<(), RenderError> {
        let (ends, blocks) = channel();
        std::thread::scope(|scope| {
            for (number, member) in members.iter_mut().enumerate() {
                let ends = ends.clone();
                let work = move || {
                    if catch_unwind(AssertUnwindSafe(|| member.work(number, plan, &ends))).is_err() {
                        plan.close();
                    }
                };
                let thread = std::thread::Builder::new().name(format!("oocpt-device-{number}"));
                thread.spawn_scoped(scope, work).map_err(|error| {
                    plan.close();
                    RenderError::Internal(format!("cannot start the thread of a device: {error}"))
                })?;
            }
            drop(ends);
            blocks.iter().for_each(|end| self.take(plan, end));
            Ok(())
        })
    }

    /// Adds what came of a block, and decides what follows from it.
    fn take(&mut self, plan: &TeamPlan<'_>, end: BlockEnd) {
        let BlockEnd { number, samples, seconds, outcome, failure } = end;
        let stats = &outcome.stats;
        self.memory[number] = [stats.gpu_bytes, stats.gpu_peak_bytes, stats.gpu_budget_bytes];
        let usage = &mut self.usage[number];
        usage.samples += samples;
        usage.blocks += 1;
        usage.seconds += seconds;
        usage.gpu_peak_bytes = usage.gpu_peak_bytes.max(stats.gpu_peak_bytes);
        usage.gpu_budget_bytes = stats.gpu_budget_bytes;
        self.progress.add_block(outcome);
        if let Some(error) = failure {
            usage.failure = Some(error.to_string());
            if self.failures.len() + 1 < self.devices.len() {
                let DeviceUsage { index, name, .. } = usage;
                let text = format!("[{index}] {name} is left out: {error}; the others render its samples");
                plan.gate.shared().report(Severity::Warning, format!("oocpt:devices: {text}"));
            }
            self.failures.push(error);
        }
        let errors = lock(&plan.film).errors().get(self.told..).unwrap_or_default().to_vec();
        self.told += errors.len();
        self.progress.film_errors(&errors);
        if self.span.begin == 0 {
            plan.decide(self.progress.is_good_enough(), self.progress.open_samples());
        }
        if self.part.as_ref().is_some_and(WrittenPart::is_due) {
            self.write_part(plan);
        }
    }

    fn write_part(&mut self, plan: &TeamPlan<'_>) {
        let Some(part) = &mut self.part else { return };
        let mut film = lock(&plan.film);
        let (nonfinite, millis) = part.cost(lock(&plan.gate.shared().stats).nonfinite_samples);
        film.note(nonfinite, millis, 0, &device_text(&self.devices[0]));
        for (device, usage) in self.devices.iter().zip(&self.usage).filter(|(_, usage)| usage.samples > 0) {
            film.note(0, 0, usage.gpu_peak_bytes, &device_text(device));
        }
        if let Err(error) = film.write(part.path) {
            plan.gate.shared().report(Severity::Error, format!("oocpt:filmPart: {error}"));
        }
        part.next = Instant::now().checked_add(part.interval);
    }

    /// Publishes the picture; an error if samples are missing that nobody gave up.
    fn end(&mut self, plan: &TeamPlan<'_>) -> Result<(), RenderError> {
        self.progress.end_tracing();
        self.write_part(plan);
        let film = lock(&plan.film);
        let have: u32 = film.header().samples().iter().map(|range| range.samples()).sum();
        let is_enough = have >= self.span.samples() || self.progress.is_good_enough() || self.progress.is_late();
        if !is_enough && plan.gate.proceed() {
            let lost = || RenderError::Internal("samples of the picture were lost".to_owned());
            return Err(self.failures.pop().unwrap_or_else(lost));
        }
        if plan.gate.is_superseded() || have == 0 {
            return Ok(());
        }
        if self.part.is_some() && !is_enough {
            let text = format!("it ended early: the film has {have} of {} samples of each pixel", self.span.samples());
            plan.gate.shared().report(Severity::Warning, format!("oocpt:filmPart: {text}"));
        }
        let picture = film.picture();
        drop(film);
        let (kinds, planes) = (plan.job.request.kinds(), plan.take_planes());
        if kinds.len() > 1 && planes.is_none() {
            // The device that was to make them has failed when no samples were left for another one.
            let lost = || RenderError::Internal("images of the picture were lost".to_owned());
            return Err(self.failures.pop().unwrap_or_else(lost));
        }
        self.progress.publish_team(&picture, planes, &kinds);
        self.progress.film_errors(picture.errors.get(self.told..).unwrap_or_default());
        self.progress.end_team(self.span.begin + have, std::mem::take(&mut self.usage))
    }
}

impl<'a> WrittenPart<'a> {
    fn new(settings: &'a Settings) -> Self {
        let interval = Duration::try_from_secs_f32(settings.checkpoint_secs).unwrap_or(Duration::MAX);
        let now = Instant::now();
        Self { path: Path::new(&settings.film_part), interval, next: now.checked_add(interval), noted: (0, now) }
    }

    fn is_due(&self) -> bool {
        self.next.is_some_and(|next| Instant::now() >= next)
    }

    /// What came since the last call: samples that are not finite, of so many in all, and milliseconds.
    fn cost(&mut self, nonfinite: u64) -> (u64, u64) {
        let now = Instant::now();
        let (known, since) = std::mem::replace(&mut self.noted, (nonfinite, now));
        let millis = u64::try_from(now.duration_since(since).as_millis()).unwrap_or(u64::MAX);
        (nonfinite.saturating_sub(known), millis)
    }
}
