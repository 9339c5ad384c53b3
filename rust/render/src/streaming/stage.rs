// SPDX-License-Identifier: Apache-2.0
//! The loop of a stage: keeps the device busy with steps and the loader busy with loads until every path is done.
//!
//! Stop, pause and newer jobs take effect between steps, which are short. When the device has nothing to trace, the loop waits
//! for the loader; when there is nothing to wait for either and paths are left, that is a defect and reported as one.

use super::Engine;
use super::clock::Activity;
use super::observe::Observation;
use super::record::{Kind, StepPlan};
use super::rounds::{self, Done};
use super::segments::{Segment, Segments};
use super::stragglers::{Moment, Spent, Stragglers};
use crate::adaptive::Adaptive;
use crate::error::RenderError;
use crate::progress::Progress;
use crate::thread::Gate;
use crate::waves::WAVE_TIMEOUT;
use oocpt_core::residency::roulette::Prices;
use oocpt_core::residency::{Demand, Proposal, ResidencyStats};
use oocpt_gpu::Submission;
use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// Steps under way while there is work.
const IN_FLIGHT: usize = 2;
/// Rays that a step has at hand, about: a few for each thread of a large device.
const ACTIVE_RAYS: u64 = 1 << 22;
/// How long to wait for the loader at a time.
const LOAD_WAIT: Duration = Duration::from_millis(20);
/// How long nothing at all may happen.
const STALL_TIMEOUT: Duration = Duration::from_secs(120);

/// A step under way.
struct Flight {
    submission: Submission,
    number: u64,
    rounds: u32,
    submitted: Instant,
    publishes: bool,
    /// What rays bring was looked at.
    weighs: bool,
    /// Octaves of samples that it completes.
    octaves: Vec<u32>,
}

/// How a stage ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Outcome {
    /// Every path is in the film.
    Done,
    /// The gate or the clock said no; the film has the paths up to some point.
    GivenUp,
}

/// A stage under way.
pub(super) struct Stage<'e, 'a, 'r> {
    engine: &'e mut Engine<'a, 'r>,
    kind: Kind,
    segments: Segments,
    /// Paths that may be in flight.
    most_paths: u64,
    /// Paths that have ended.
    ended: u64,
    /// The step at which the segment of each index was last begun.
    begun: Vec<u64>,
    flights: VecDeque<Flight>,
    /// Number of the next step; the first is 1.
    next_step: u64,
    rounds: u32,
    seen: Observation,
    /// The next round.
    round: u32,
    started: Instant,
    last_end: Instant,
    last_event: Instant,
}

impl<'e, 'a, 'r> Stage<'e, 'a, 'r> {
    /// A stage of `total` paths.
    pub(super) fn new(engine: &'e mut Engine<'a, 'r>, kind: Kind, total: u64) -> Self {
        let buffers = engine.buffers;
        let segments = Segments::new(buffers.segment_count, buffers.segment_size, buffers.paths.capacity, total);
        let now = Instant::now();
        Self {
            most_paths: total.min(u64::from(buffers.paths.capacity)),
            ended: 0,
            begun: vec![0; buffers.segment_count as usize],
            seen: Observation::default(),
            engine,
            kind,
            segments,
            flights: VecDeque::with_capacity(IN_FLIGHT),
            next_step: 1,
            rounds: 1,
            round: 0,
            started: now,
            last_end: now,
            last_event: now,
        }
    }

    /// Runs to the end.
    pub(super) fn run(mut self, gate: &Gate<'_>, progress: &mut Progress<'_>) -> Result<Outcome, RenderError> {
        let outcome = self.turn_until_done(gate, progress)?;
        while !self.flights.is_empty() {
            self.land(progress)?;
        }
        self.tick();
        self.report(progress);
        if let (Kind::Samples, Some(stragglers)) = (self.kind, &self.engine.stragglers) {
            stragglers.log(&self.prices(progress).unwrap_or_default());
        }
        Ok(outcome)
    }

    fn turn_until_done(&mut self, gate: &Gate<'_>, progress: &mut Progress<'_>) -> Result<Outcome, RenderError> {
        self.open(progress);
        while !self.segments.is_done() || self.is_undecided() {
            if !gate.proceed() || (self.kind == Kind::Samples && progress.out_of_time()) {
                return Ok(Outcome::GivenUp);
            }
            while self.flights.front().is_some_and(|flight| flight.submission.is_done()) {
                self.land(progress)?;
            }
            self.engine.residency.advance(Duration::ZERO)?;
            self.engine.deepen(progress)?;
            self.tick();
            if self.flights.len() < IN_FLIGHT && self.has_work() {
                self.launch(progress)?;
            } else if !self.flights.is_empty() {
                self.land(progress)?;
            } else {
                self.wait_for_loads(progress)?;
            }
        }
        Ok(Outcome::Done)
    }

    /// Lets the paths begin that the target error asks for.
    fn open(&mut self, progress: &Progress<'_>) {
        if self.kind == Kind::Samples {
            self.segments.open_to(progress.open_paths());
            self.segments.cut_at(self.engine.setting.film.adaptive().map_or_else(Vec::new, Adaptive::cuts));
        }
    }

    /// Whether an octave is under way that may open more.
    fn is_undecided(&self) -> bool {
        self.flights.iter().any(|flight| !flight.octaves.is_empty())
    }

    /// Whether a step would do anything, as far as the host knows.
    fn has_work(&self) -> bool {
        let has_verdicts = self.engine.stragglers.as_ref().is_some_and(Stragglers::has_verdicts);
        self.seen.active() > 0 || self.engine.residency.has_changes() || has_verdicts || self.can_move_segments()
    }

    fn can_move_segments(&self) -> bool {
        self.segments.oldest().is_some_and(|oldest| is_finished(&self.seen, &self.begun, &oldest))
            || (self.segments.can_start(self.ended) && self.room_for_rays() > 0)
    }

    /// New rays that a step may add: enough to keep the device busy, few enough for the step to stay short, so that what
    /// arrives meanwhile is used soon.
    fn room_for_rays(&self) -> u64 {
        let unseen = self.segments.begun_after(self.seen.step, &self.begun);
        ACTIVE_RAYS.saturating_sub(self.seen.active()).saturating_sub(unseen)
    }

    fn launch(&mut self, progress: &mut Progress<'_>) -> Result<(), RenderError> {
        let number = self.next_step;
        let publishes = self.kind == Kind::Samples && progress.publish_due();
        let mut plan = StepPlan { round: self.round, rounds: self.rounds, publishes, ..StepPlan::default() };
        // Rays of steps that are still under way may be waiting by now.
        plan.wakes = self.seen.waiting() > 0 || !self.flights.is_empty();
        let (seen, begun) = (&self.seen, &self.begun);
        let film = self.engine.setting.film;
        while let Some(segment) = self.segments.take_finished(|segment| is_finished(seen, begun, segment)) {
            plan.finished.push(segment);
            // A step shows one octave at most.
            if self.kind == Kind::Samples && film.pieces(segment.wave, u64::MAX).iter().any(|p| p.completes.is_some()) {
                plan.publishes |= progress.compares(&[0]);
                break;
            }
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
        if let Some(verdicts) = self.engine.stragglers.as_mut().and_then(Stragglers::take_verdicts) {
            self.engine.buffers.write_verdicts(number, &verdicts)?;
            plan.plays = true;
            plan.wakes = true;
        }
        plan.weighs = self.are_stragglers();
        let (submission, octaves) = self.engine.step(self.kind, number, &plan)?;
        if self.kind == Kind::Samples {
            for segment in &plan.finished {
                progress.wave_done(segment.wave);
            }
        }
        self.round = self.round.wrapping_add(plan.rounds);
        self.next_step += 1;
        self.flights.push_back(Flight {
            submission,
            number,
            rounds: plan.rounds,
            submitted: Instant::now(),
            publishes: plan.publishes,
            weighs: plan.weighs,
            octaves,
        });
        self.tick();
        Ok(())
    }

    /// Waits for the oldest step, learns from it, asks the planner.
    fn land(&mut self, progress: &mut Progress<'_>) -> Result<(), RenderError> {
        let Some(flight) = self.flights.pop_front() else { return Ok(()) };
        if !flight.submission.wait(WAVE_TIMEOUT)? {
            return Err(RenderError::Internal(format!("a step did not finish within {} s", WAVE_TIMEOUT.as_secs())));
        }
        for (pass, secs) in flight.submission.timings() {
            progress.timings.add_pass(&pass, secs);
        }
        let now = Instant::now();
        let secs = now.duration_since(flight.submitted.max(self.last_end)).as_secs_f64();
        self.last_end = now;
        let before = self.seen.counters;
        self.seen = self.engine.buffers.observe(flight.number)?;
        let busy = self.seen.counters.busy_rounds.wrapping_sub(before.busy_rounds);
        self.rounds = rounds::next(self.rounds, Done { rounds: flight.rounds, busy, secs });
        if !flight.weighs {
            self.seen.worth.clear();
        }
        self.ended += u64::from(self.seen.counters.freed.wrapping_sub(before.freed));
        self.last_event = now;
        self.plan(self.seen.active(), progress)?;
        self.engine.note_driver_usage();
        if self.kind == Kind::Samples {
            let left = self.segments.unbegun() + self.seen.paths_alive();
            self.engine.note_left(self.started.elapsed().as_secs_f64(), left);
        }
        self.report(progress);
        if flight.publishes {
            progress.publish(self.engine.setting.film)?;
        }
        progress.octaves(self.engine.setting.film, &flight.octaves)?;
        self.open(progress);
        match self.seen.counters.stack_overflows {
            0 => Ok(()),
            count => Err(RenderError::StackOverflow { count: u64::from(count) }),
        }
    }

    fn report(&self, progress: &mut Progress<'_>) {
        let stragglers = self.segments.oldest().and_then(|oldest| self.seen.alive(oldest.index)).map_or(0, u64::from);
        let left = self.segments.unbegun() + self.seen.paths_alive();
        self.engine.report(progress, &self.seen, stragglers, left);
    }

    /// Asks the planner what to load when `active` rays can be traced.
    fn plan(&mut self, active: u64, progress: &Progress<'_>) -> Result<(), RenderError> {
        let (are_few, prices) = (self.are_stragglers(), self.prices(progress).unwrap_or_default());
        let (seen, next_step) = (&self.seen, self.next_step);
        let demand = Demand { waiting: &seen.waiting, next: &seen.next, visits: &[], active };
        let Engine { residency, stragglers, .. } = &mut *self.engine;
        match stragglers {
            Some(stragglers) if self.kind == Kind::Samples => {
                let &ResidencyStats { loads, bytes_loaded, .. } = residency.planner.stats();
                let secs = self.started.elapsed().as_secs_f64();
                let waits = are_few && Stragglers::is_idle(seen) && residency.is_loading();
                stragglers.note(Moment { secs, loads, bytes_loaded, waits });
                stragglers.observe(seen, |chunk| residency.planner.is_resident(chunk));
                residency.plan(&demand, &mut |proposal| {
                    let proposal = Proposal { is_idle: proposal.is_idle && are_few, ..*proposal };
                    stragglers.agrees(&proposal, seen, &prices, next_step)
                })
            }
            _ => residency.plan(&demand, &mut |_| true),
        }
    }

    /// What loads and paths cost, for roulette on loads.
    fn prices(&self, progress: &Progress<'_>) -> Option<Prices> {
        let stragglers = self.engine.stragglers.as_ref()?;
        let spent = Spent {
            secs: self.started.elapsed().as_secs_f64(),
            paths: self.ended,
            all_paths: self.ended + self.segments.unbegun() + self.seen.paths_alive(),
            variance: progress.variance_per_path(),
        };
        Some(stragglers.prices(&spent, &self.seen))
    }

    /// Whether only so few paths are left that roulette is played for their loads, and none can begin or be decided about.
    fn are_stragglers(&self) -> bool {
        let setting = self.engine.setting;
        let adaptive = setting.film.adaptive().filter(|_| !setting.job.options.plant_early_roulette);
        let are_few = |stragglers: &Stragglers| stragglers.are_few(self.seen.paths_alive(), self.most_paths);
        self.kind == Kind::Samples
            && !self.segments.can_start(self.ended)
            && !adaptive.is_some_and(Adaptive::decides_more)
            && self.engine.stragglers.as_ref().is_some_and(are_few)
    }

    fn wait_for_loads(&mut self, progress: &Progress<'_>) -> Result<(), RenderError> {
        let copied = self.engine.residency.bytes_copied;
        self.engine.residency.advance(LOAD_WAIT)?;
        // Time passes for the planner too: what it refused for lack of memory is tried again.
        self.plan(0, progress)?;
        if self.engine.residency.bytes_copied != copied || self.engine.residency.has_changes() {
            self.last_event = Instant::now();
        }
        if self.last_event.elapsed() > STALL_TIMEOUT {
            let left = self.seen.paths_alive();
            return Err(RenderError::Internal(format!("{left} paths wait for chunks that do not come")));
        }
        Ok(())
    }

    fn tick(&mut self) {
        let tracing = !self.flights.is_empty();
        let loading = self.engine.residency.is_loading();
        self.engine.clock.change(Instant::now(), Activity { tracing, loading });
    }
}

/// Whether all paths of a segment are known to be dead.
fn is_finished(seen: &Observation, begun: &[u64], segment: &Segment) -> bool {
    let since = begun.get(segment.index as usize).copied().unwrap_or(u64::MAX);
    since <= seen.step && seen.alive(segment.index) == Some(0)
}
