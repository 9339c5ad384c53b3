// SPDX-License-Identifier: Apache-2.0
//! The paths of a streamed scene: steps over segments of paths whose rays may wait for chunks, and the loads that go on
//! beside them.
//!
//! If the device has nothing to trace, the stage waits for the loader, however long that takes; if there is nothing to
//! wait for either and paths are left, that is a defect and reported as one.

use super::StreamingContext;
use super::clock::StageActivity;
use super::leave::LeaveDecision;
use super::observe::StepObservation;
use super::record::StepPlan;
use super::rounds::{self, StepResult};
use super::segments::SegmentQueue;
use super::stall::StallDetector;
use super::stragglers::{RenderCost, StragglerMoment, StragglerRoulette};
use crate::engine::{InFlightSubmission, PathSource, StreamingEnd, SubmittedWork, WavefrontTracer};
use crate::error::RenderError;
use crate::film::adaptive::AdaptiveBuffers;
use crate::frame::context::is_cpu;
use crate::frame::progress::FrameProgress;
use crate::job::patience::LoadWait;
use crate::job::publish::PictureExtent;
use crate::job::shared::FrameGate;
use crate::wavefront::PathKind;
use oocpt_abi::WavefrontCounters;
use oocpt_core::residency::roulette::LoadPrices;
use oocpt_core::residency::{LoadProposal, RayDemand, ResidencyStats, UnitId};
use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// Approximate number of rays that a step should have ready: a few for each thread of a large device.
const ACTIVE_RAYS: u64 = 1 << 22;
/// Rays that are worth a step while more chunks are in transit (decisions/0029).
const WORTHWHILE_RAYS: u64 = ACTIVE_RAYS / 16;
/// Share of the living paths whose rays are worth a step.
const WORTHWHILE_SHARE: u64 = 4;
/// Longest wait for such a step.
const HOLD: Duration = Duration::from_millis(50);
/// The time of one wait for the loader.
const LOAD_WAIT: Duration = Duration::from_millis(20);
/// The time after which a stage in which nothing happens is a defect.
const STALL_TIMEOUT: Duration = Duration::from_secs(120);

/// The record of a submitted step.
#[derive(Debug)]
pub(crate) struct StreamingStep {
    number: u64,
    rounds: u32,
    /// True if the step measures the contributions of waiting rays.
    weighs: bool,
}

/// The streaming of the paths of one frame, as a feed of the engine.
#[derive(Debug)]
pub(crate) struct StreamingStage<'a, 'r> {
    streamer: StreamingContext<'a, 'r>,
    is_cpu: bool,
    kind: PathKind,
    segments: SegmentQueue,
    /// Paths that may be in flight.
    most_paths: u64,
    /// Paths that have ended.
    ended: u64,
    /// The step at which the segment of each index was last begun.
    begun: Vec<u64>,
    /// Number of the next step; the first is 1.
    next_step: u64,
    rounds: u32,
    seen: StepObservation,
    /// The next round.
    round: u32,
    started: Instant,
    last_event: Instant,
    /// The time at which something was last in transit.
    last_waited: Instant,
    patience: LoadWait,
    leave: LeaveDecision,
    stall: StallDetector,
    /// The film has the paths before it.
    first: Option<u64>,
}

impl<'a, 'r> StreamingStage<'a, 'r> {
    /// A stage without work; the film may have the paths before `first`.
    pub(super) fn new(
        streamer: StreamingContext<'a, 'r>,
        leave: LeaveDecision,
        patience: LoadWait,
        first: Option<u64>,
    ) -> Self {
        let now = Instant::now();
        Self {
            most_paths: 0,
            ended: 0,
            begun: Vec::new(),
            seen: StepObservation::default(),
            is_cpu: is_cpu(streamer.tracer.context.device),
            stall: StallDetector::new(streamer.residency.planner.catalog().unit_count()),
            streamer,
            kind: PathKind::Samples,
            segments: SegmentQueue::new(0, 1, 1, 0),
            next_step: 1,
            rounds: 1,
            round: 0,
            started: now,
            last_event: now,
            last_waited: now,
            patience,
            leave,
            first,
        }
    }

    /// Lets the paths begin that the target error needs.
    fn open(&mut self, progress: &FrameProgress<'_>) {
        if self.kind == PathKind::Samples {
            self.segments.open_to(progress.open_paths());
            let film = self.streamer.tracer.context.film;
            self.segments.cut_at(film.adaptive().map_or_else(|| film.octave_cuts(), AdaptiveBuffers::cuts));
        }
    }

    /// Returns true if a step would do anything, as far as the host knows.
    fn has_work(&self) -> bool {
        let has_verdicts = self.streamer.stragglers.as_ref().is_some_and(StragglerRoulette::has_verdicts);
        self.seen.active() > 0 || self.streamer.residency.has_changes() || has_verdicts || self.can_move_segments()
    }

    fn can_move_segments(&self) -> bool {
        self.segments.oldest().is_some_and(|oldest| self.seen.is_finished(&self.begun, &oldest))
            || (self.segments.can_start(self.ended) && self.room_for_rays() > 0)
    }

    /// New rays that a step may add: enough to keep the device busy, few enough for the step to stay short, so that
    /// units which arrive meanwhile are used soon.
    fn room_for_rays(&self) -> u64 {
        let unseen = self.segments.begun_after(self.seen.step, &self.begun);
        ACTIVE_RAYS.saturating_sub(self.seen.active()).saturating_sub(unseen)
    }

    /// Whether a step is better submitted when more chunks have come: few rays are at hand now, and more are to be.
    fn holds_back(&self, in_flight: &VecDeque<InFlightSubmission<StreamingStep>>) -> bool {
        let is_loading = self.streamer.residency.is_loading();
        // On a processor short steps cost little, and loads wait for the same cores.
        if self.is_cpu || self.seen.step == 0 || !is_loading || self.last_event.elapsed() > HOLD {
            return false;
        }
        let worthwhile = WORTHWHILE_RAYS.min(self.seen.paths_alive() / WORTHWHILE_SHARE);
        let active = if in_flight.is_empty() { self.seen.active() } else { 0 };
        let waiting = |unit: &UnitId| self.seen.waiting.get(*unit as usize).map_or(0, |rays| u64::from(*rays));
        let woken: u64 = self.streamer.residency.arrived.iter().map(waiting).sum();
        let begun = if self.segments.can_start(self.ended) { self.room_for_rays() } else { 0 };
        active + woken + begun < worthwhile
    }

    fn report(&self, progress: &mut FrameProgress<'_>) {
        let stragglers = self.segments.oldest().and_then(|oldest| self.seen.alive(oldest.index)).map_or(0, u64::from);
        let left = self.segments.unbegun() + self.seen.paths_alive();
        self.streamer.report(progress, &self.seen, stragglers, left);
    }

    /// Asks the planner what to load when `active` rays can be traced.
    fn plan(&mut self, active: u64, progress: &FrameProgress<'_>) -> Result<(), RenderError> {
        let (are_few, prices) = (self.are_stragglers(), self.prices(progress).unwrap_or_default());
        let (seen, next_step) = (&self.seen, self.next_step);
        let (waiting, next, partners) = (&*seen.waiting, &*seen.next, &*seen.partners);
        let demand =
            RayDemand { waiting, next, partners, active, requested: Some(&seen.requested), ..RayDemand::default() };
        let StreamingContext { residency, stragglers, .. } = &mut self.streamer;
        match stragglers {
            Some(stragglers) if self.kind == PathKind::Samples => {
                let &ResidencyStats { loads, bytes_loaded, .. } = residency.planner.stats();
                let secs = self.started.elapsed().as_secs_f64();
                let waits = are_few && StragglerRoulette::is_idle(seen) && residency.is_loading();
                stragglers.note(StragglerMoment { secs, loads, bytes_loaded, waits });
                stragglers.observe(seen, |chunk| residency.planner.is_resident(chunk));
                residency.plan(&demand, &mut |proposal| {
                    let proposal = LoadProposal { is_idle: proposal.is_idle && are_few, ..*proposal };
                    stragglers.agrees(&proposal, seen, &prices, next_step)
                })
            }
            _ => residency.plan(&demand, &mut |_| true),
        }
    }

    /// The costs of loads and paths, for roulette on loads.
    fn prices(&self, progress: &FrameProgress<'_>) -> Option<LoadPrices> {
        let stragglers = self.streamer.stragglers.as_ref()?;
        let spent = RenderCost {
            secs: self.started.elapsed().as_secs_f64(),
            paths: self.ended,
            all_paths: self.ended + self.segments.unbegun() + self.seen.paths_alive(),
            variance: progress.variance_per_path(),
        };
        Some(stragglers.prices(&spent, &self.seen))
    }

    /// Returns true if the number of living paths is below the threshold for roulette on loads, and none can begin or
    /// be decided about.
    fn are_stragglers(&self) -> bool {
        let context = self.streamer.tracer.context;
        let adaptive = context.film.adaptive();
        #[cfg(feature = "faults")]
        let adaptive = adaptive.filter(|_| !context.job.options.faults.early_roulette);
        let are_few = |stragglers: &StragglerRoulette| stragglers.are_few(self.seen.paths_alive(), self.most_paths);
        self.kind == PathKind::Samples
            && !self.segments.can_start(self.ended)
            && !adaptive.is_some_and(AdaptiveBuffers::decides_more)
            && self.streamer.stragglers.as_ref().is_some_and(are_few)
    }

    /// Logs the step, for those who ask where the time goes.
    fn log(&self, step: &StreamingStep, secs: f64, before: &WavefrontCounters) {
        if !tracing::enabled!(tracing::Level::TRACE) {
            return;
        }
        let (now, planner) = (&self.seen.counters, self.streamer.residency.planner.stats());
        let rays = now.closest_rays - before.closest_rays + now.shadow_rays - before.shadow_rays;
        let (at, rounds, mapped) = (self.started.elapsed().as_secs_f64(), step.rounds, self.streamer.mapped_bytes());
        let (active, waiting, alive) = (self.seen.active(), self.seen.waiting(), self.seen.paths_alive());
        let ResidencyStats { loads, evictions, bytes_held, bytes_in_flight, .. } = *planner;
        tracing::trace!(at, step = step.number, rounds, secs, rays, "step");
        tracing::trace!(active, waiting, alive, loads, evictions, bytes_held, bytes_in_flight, mapped, "state");
    }

    fn tick(&mut self, in_flight: &VecDeque<InFlightSubmission<StreamingStep>>) {
        let tracing = !in_flight.is_empty();
        let loading = self.streamer.residency.is_loading();
        self.streamer.clock.change(Instant::now(), StageActivity { tracing, loading });
    }
}

impl PathSource for StreamingStage<'_, '_> {
    type StepData = StreamingStep;

    fn tracer(&self) -> &WavefrontTracer<'_> {
        &self.streamer.tracer
    }

    fn kind(&self) -> PathKind {
        self.kind
    }

    fn begin(&mut self, kind: PathKind, progress: &mut FrameProgress<'_>) -> Result<(), RenderError> {
        self.streamer.clear(kind == PathKind::Samples && self.first.is_none())?;
        let context = self.streamer.tracer.context;
        let total = match kind {
            PathKind::Aovs => context.job.request.pixels(),
            PathKind::Samples => {
                progress.begin_samples(context.film);
                progress.total_paths()
            }
        };
        let buffers = self.streamer.buffers;
        let slots = buffers.paths.capacity;
        self.kind = kind;
        let first = self.first.filter(|_| kind == PathKind::Samples).unwrap_or(0);
        self.segments = SegmentQueue::new(buffers.ended.segment_count, buffers.ended.segment_size, slots, total)
            .begin_at(first.min(total));
        self.most_paths = (total - first.min(total)).min(u64::from(slots));
        self.begun = vec![0; buffers.ended.segment_count as usize];
        self.seen = StepObservation::default();
        if let Some(reach) = &mut self.streamer.residency.reach {
            reach.begin();
        }
        (self.ended, self.next_step, self.rounds, self.round) = (0, 1, 1, 0);
        self.started = Instant::now();
        self.last_event = self.started;
        self.open(progress);
        Ok(())
    }

    fn is_done(&self, in_flight: &VecDeque<InFlightSubmission<StreamingStep>>) -> bool {
        // An octave that is under way may open more.
        self.segments.is_done() && in_flight.iter().all(|other| other.work.octaves.is_empty())
    }

    fn advance(
        &mut self,
        in_flight: &VecDeque<InFlightSubmission<StreamingStep>>,
        progress: &mut FrameProgress<'_>,
    ) -> Result<(), RenderError> {
        self.streamer.residency.advance(Duration::ZERO)?;
        self.streamer.deepen(progress)?;
        self.tick(in_flight);
        Ok(())
    }

    fn submit_next(
        &mut self,
        in_flight: &VecDeque<InFlightSubmission<StreamingStep>>,
        progress: &mut FrameProgress<'_>,
    ) -> Result<Option<SubmittedWork<StreamingStep>>, RenderError> {
        if !self.has_work() || self.holds_back(in_flight) {
            return Ok(None);
        }
        let number = self.next_step;
        let mut plan = StepPlan { round: self.round, rounds: self.rounds, ..StepPlan::default() };
        // Rays of steps that are still under way may be waiting by now.
        plan.wakes = self.seen.waiting() > 0 || !in_flight.is_empty();
        let (seen, begun) = (&self.seen, &self.begun);
        let film = self.streamer.tracer.context.film;
        let mut compares = false;
        while let Some(segment) = self.segments.take_finished(|segment| seen.is_finished(begun, segment)) {
            plan.finished.push(segment);
            // A step shows one octave at most.
            if self.kind == PathKind::Samples
                && film.pieces(segment.wave, u64::MAX).iter().any(|p| p.completes.is_some())
            {
                compares = progress.compares(&[0]);
                break;
            }
        }
        if self.kind == PathKind::Samples {
            let finished: u64 = plan.finished.iter().map(|segment| u64::from(segment.wave.count)).sum();
            let extent = PictureExtent { planes: u64::MAX, samples: progress.paths_done() + finished };
            plan.publishes = (progress.publish_due(extent) || compares).then_some(extent);
        }
        let mut room = self.room_for_rays();
        while room > 0
            && let Some(segment) = self.segments.start(self.ended)
        {
            room = room.saturating_sub(u64::from(segment.wave.count));
            if let Some(begun) = self.begun.get_mut(segment.index as usize) {
                *begun = number;
            }
            plan.started.push(segment);
        }
        if let Some(verdicts) = self.streamer.stragglers.as_mut().and_then(StragglerRoulette::take_verdicts) {
            self.streamer.buffers.write_verdicts(number, &verdicts)?;
            plan.plays = true;
            plan.wakes = true;
        }
        plan.weighs = self.are_stragglers();
        let (submission, octaves) = self.streamer.step(self.kind, number, &plan)?;
        if self.kind == PathKind::Samples {
            for segment in &plan.finished {
                progress.wave_done(segment.wave);
            }
        }
        self.round = self.round.wrapping_add(plan.rounds);
        self.next_step += 1;
        let of = StreamingStep { number, rounds: plan.rounds, weighs: plan.weighs };
        Ok(Some(SubmittedWork { submission, publishes: plan.publishes, octaves, of }))
    }

    /// Learns from the step, asks the planner.
    fn take_results(
        &mut self,
        work: SubmittedWork<StreamingStep>,
        secs: f64,
        _in_flight: &mut VecDeque<InFlightSubmission<StreamingStep>>,
        _gate: &FrameGate<'_>,
        progress: &mut FrameProgress<'_>,
    ) -> Result<Option<SubmittedWork<StreamingStep>>, RenderError> {
        let before = self.seen.counters;
        self.streamer.buffers.observe(work.of.number, &mut self.seen)?;
        let busy = self.seen.counters.busy_rounds.wrapping_sub(before.busy_rounds);
        self.rounds = rounds::next(self.rounds, StepResult { rounds: work.of.rounds, busy, secs });
        let waits = self.seen.waiting() > 0 && self.streamer.residency.is_loading();
        let more_join = self.segments.unbegun() > 0 || (waits && self.seen.active() < WORTHWHILE_RAYS);
        self.rounds = self.rounds.min(rounds::most(self.is_cpu, more_join));
        if let Some(reach) = &mut self.streamer.residency.reach {
            reach.count(&self.seen.visited);
        }
        if !work.of.weighs {
            self.seen.worth.clear();
        }
        self.ended += u64::from(self.seen.counters.freed.wrapping_sub(before.freed));
        self.log(&work.of, secs, &before);
        if let Some(loads) = self.stall.note(self.ended, self.streamer.residency.planner.stats().loads) {
            return Err(RenderError::NoProgress { loads, left: self.seen.paths_alive() });
        }
        self.last_event = Instant::now();
        self.plan(self.seen.active(), progress)?;
        if self.kind == PathKind::Samples {
            let left = self.segments.unbegun() + self.seen.paths_alive();
            self.streamer.note_left(self.started.elapsed().as_secs_f64(), left);
            let residency = &mut self.streamer.residency;
            let paths = (self.segments.unbegun(), residency.store.paths_streamed + self.ended);
            let WavefrontCounters { closest_rays, shadow_rays, .. } = self.seen.counters;
            if self.leave.step(residency, closest_rays + shadow_rays, paths) {
                let first = self.segments.close();
                self.leave.left_off = Some(StreamingEnd { first, counters: self.seen.counters });
            }
        }
        self.report(progress);
        Ok(Some(work))
    }

    fn end_submission(&mut self, progress: &mut FrameProgress<'_>) -> Result<(), RenderError> {
        self.open(progress);
        match self.seen.counters.stack_overflows {
            0 => Ok(()),
            count => Err(RenderError::StackOverflow { count: u64::from(count) }),
        }
    }

    /// Waits for the loader.
    fn wait(&mut self, progress: &mut FrameProgress<'_>) -> Result<bool, RenderError> {
        let copied = self.streamer.residency.bytes_copied;
        self.streamer.residency.advance(LOAD_WAIT)?;
        // Time passes for the planner too: loads that it refused for lack of memory are tried again. If it waits for
        // more, the ready rays keep it from counting as idle.
        self.plan(self.seen.active(), progress)?;
        if self.streamer.residency.bytes_copied != copied || self.streamer.residency.has_changes() {
            self.last_event = Instant::now();
        }
        let coming = self.streamer.residency.coming();
        if coming == 0 {
            self.patience.came(Instant::now());
        } else {
            // Slow files are not a fault.
            self.patience.came_at(self.last_event);
            self.last_waited = Instant::now();
            let lives = self.streamer.residency.device.loader()?.lives();
            progress.wait_for_loads(&mut self.patience, ("part of the scene", coming), lives)?;
        }
        if self.last_event.max(self.last_waited).elapsed() > STALL_TIMEOUT {
            let left = self.seen.paths_alive();
            return Err(RenderError::Internal(format!("{left} paths wait for chunks that do not come")));
        }
        Ok(true)
    }

    fn goes_on(&self) -> bool {
        self.first.is_some()
    }

    fn left_off(&self) -> Option<StreamingEnd> {
        self.leave.left_off.map(|left| StreamingEnd { counters: self.seen.counters, ..left })
    }

    fn ended(&mut self, progress: &mut FrameProgress<'_>) {
        self.streamer.residency.store.paths_streamed += self.ended;
        self.report(progress);
        progress.timings.left.clone_from(&self.streamer.left.moments);
        if let (PathKind::Samples, Some(stragglers)) = (self.kind, &self.streamer.stragglers) {
            stragglers.log(&self.prices(progress).unwrap_or_default());
        }
    }

    fn end(&mut self) -> Result<(), RenderError> {
        self.streamer.write_report()
    }
}
