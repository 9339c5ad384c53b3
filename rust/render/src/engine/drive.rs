// SPDX-License-Identifier: Apache-2.0
//! The loop of a stage: keeps the device busy with what its path source gives until every path is done.
//!
//! Two submissions are under way at any time, so the device does not wait for the host. Stop, pause and newer jobs take
//! effect between submissions, which are short.

use super::{WavefrontTracer, finish};
use crate::device::WAVE_TIMEOUT;
use crate::error::RenderError;
use crate::frame::context::FrameContext;
use crate::frame::progress::FrameProgress;
use crate::job::publish::PictureExtent;
use crate::job::shared::FrameGate;
use crate::wavefront::PathKind;
use oocpt_abi::WavefrontCounters;
use oocpt_gpu::Submission;
use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// Submissions under way at the same time.
pub(crate) const IN_FLIGHT: usize = 2;

/// Time between two looks for a newer job while a submission is under way.
const HEARS_EVERY: Duration = Duration::from_millis(1);

/// How a stage ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum StageOutcome {
    /// Every path is in the film.
    Done,
    /// The gate or the clock said no; the film has the paths up to some point.
    GivenUp,
}

/// Where a path source left off.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StreamingEnd {
    /// The first path that is not in the film.
    pub(crate) first: u64,
    pub(crate) counters: WavefrontCounters,
}

/// What a path source handed to the device.
#[derive(Debug)]
pub(crate) struct SubmittedWork<T> {
    pub(crate) submission: Submission,
    /// It ends with an image to be published, of which so much is there.
    pub(crate) publishes: Option<PictureExtent>,
    /// Octaves of samples that it completes.
    pub(crate) octaves: Vec<u32>,
    /// What the path source remembers of it.
    pub(crate) of: T,
}

/// Work under way.
#[derive(Debug)]
pub(crate) struct InFlightSubmission<T> {
    pub(crate) work: SubmittedWork<T>,
    submitted: Instant,
}

/// Where the paths of a frame come from.
pub(crate) trait PathSource {
    /// What is remembered of a submission.
    type StepData;

    fn tracer(&self) -> &WavefrontTracer<'_>;

    /// Begins a stage: forgets the samples and counters of the one before.
    fn begin(&mut self, kind: PathKind, progress: &mut FrameProgress<'_>) -> Result<(), RenderError>;

    /// The stage that has begun.
    fn kind(&self) -> PathKind;

    /// Whether nothing is left to do, given what is under way.
    fn is_done(&self, in_flight: &VecDeque<InFlightSubmission<Self::StepData>>) -> bool;

    /// Advances work that runs beside the device, such as loads.
    fn advance(
        &mut self,
        _in_flight: &VecDeque<InFlightSubmission<Self::StepData>>,
        _progress: &mut FrameProgress<'_>,
    ) -> Result<(), RenderError> {
        Ok(())
    }

    /// Hands the device its next submission; none when there is nothing to do before those under way have ended.
    fn submit_next(
        &mut self,
        in_flight: &VecDeque<InFlightSubmission<Self::StepData>>,
        progress: &mut FrameProgress<'_>,
    ) -> Result<Option<SubmittedWork<Self::StepData>>, RenderError>;

    /// Learns from the oldest submission, `secs` long, which has ended; may take back what was submitted behind it, and
    /// do it over. None: the gate said no in the middle of it, and it left no trace.
    fn take_results(
        &mut self,
        work: SubmittedWork<Self::StepData>,
        secs: f64,
        in_flight: &mut VecDeque<InFlightSubmission<Self::StepData>>,
        gate: &FrameGate<'_>,
        progress: &mut FrameProgress<'_>,
    ) -> Result<Option<SubmittedWork<Self::StepData>>, RenderError>;

    /// Has the device leave out what it has not begun of the work under way, for a picture that is given up: none of it
    /// counts any more. False if it cannot.
    fn cancel(&self) -> Result<bool, RenderError> {
        Ok(false)
    }

    /// After the images and the error of a submission were taken.
    fn end_submission(&mut self, progress: &mut FrameProgress<'_>) -> Result<(), RenderError>;

    /// Nothing is under way and there is nothing to submit: waits for something to change. False: nothing will.
    fn wait(&mut self, progress: &mut FrameProgress<'_>) -> Result<bool, RenderError>;

    /// The stage has ended.
    fn ended(&mut self, _progress: &mut FrameProgress<'_>) {}

    /// Where another path source goes on: the film has all paths before it, and this one gives no more.
    fn left_off(&self) -> Option<StreamingEnd> {
        None
    }

    /// Whether it goes on where another one left off.
    fn goes_on(&self) -> bool {
        false
    }

    /// The frame has ended, its images are published.
    fn end(&mut self) -> Result<(), RenderError> {
        Ok(())
    }
}

/// Runs the stage that has begun.
pub(super) fn run<F: PathSource>(
    source: &mut F,
    gate: &FrameGate<'_>,
    progress: &mut FrameProgress<'_>,
) -> Result<StageOutcome, RenderError> {
    let mut in_flight = VecDeque::with_capacity(IN_FLIGHT);
    let mut last_end = Instant::now();
    let mut outcome = StageOutcome::Done;
    while !source.is_done(&in_flight) {
        if !gate.proceed() || (source.kind() == PathKind::Samples && progress.out_of_time()) {
            outcome = StageOutcome::GivenUp;
            break;
        }
        while in_flight.front().is_some_and(|oldest: &InFlightSubmission<F::StepData>| oldest.work.submission.is_done())
        {
            retire_oldest(source, &mut in_flight, &mut last_end, gate, progress)?;
        }
        if source.kind() == PathKind::Samples && progress.wants_checkpoint() {
            // The film then has all paths before some number, and none beyond.
            while !in_flight.is_empty() {
                retire_oldest(source, &mut in_flight, &mut last_end, gate, progress)?;
            }
            let tracer = source.tracer();
            progress.make_checkpoint(tracer.context.job, tracer.context.film, &tracer.paths.counters)?;
            last_end = Instant::now();
        }
        source.advance(&in_flight, progress)?;
        // Sums of the next octave begin when those of this one are taken.
        let ends_octave = |late: &InFlightSubmission<F::StepData>| !late.work.octaves.is_empty();
        let waits = source.tracer().context.film.has_exact_sums() && in_flight.iter().any(ends_octave);
        let next = if in_flight.len() < IN_FLIGHT && !waits { source.submit_next(&in_flight, progress)? } else { None };
        if let Some(work) = next {
            in_flight.push_back(InFlightSubmission { work, submitted: Instant::now() });
        } else if let Some(oldest) = in_flight.front() {
            if is_worth_waiting(&oldest.work.submission, gate)? {
                retire_oldest(source, &mut in_flight, &mut last_end, gate, progress)?;
            }
        } else if !source.wait(progress)? {
            break;
        }
    }
    let goes_on = gate.leads_on_from(source.tracer().context.job);
    if outcome == StageOutcome::GivenUp && gate.is_superseded() && !goes_on && source.cancel()? {
        progress.film_is_lost();
        return in_flight.iter().try_for_each(|late| finish(&late.work.submission, progress)).map(|()| outcome);
    }
    while !in_flight.is_empty() {
        retire_oldest(source, &mut in_flight, &mut last_end, gate, progress)?;
    }
    source.advance(&in_flight, progress)?;
    source.ended(progress);
    Ok(outcome)
}

/// Waits until a submission has ended; false as soon as a newer job counts instead.
fn is_worth_waiting(submission: &Submission, gate: &FrameGate<'_>) -> Result<bool, RenderError> {
    let end = Instant::now() + WAVE_TIMEOUT;
    while Instant::now() < end {
        if submission.wait(HEARS_EVERY)? {
            return Ok(true);
        }
        if gate.is_superseded() {
            return Ok(false);
        }
    }
    // It has taken too long, which is said where its end is taken.
    Ok(true)
}

/// Waits for the oldest submission and takes what it left.
fn retire_oldest<F: PathSource>(
    source: &mut F,
    in_flight: &mut VecDeque<InFlightSubmission<F::StepData>>,
    last_end: &mut Instant,
    gate: &FrameGate<'_>,
    progress: &mut FrameProgress<'_>,
) -> Result<(), RenderError> {
    let Some(InFlightSubmission { work, submitted }) = in_flight.pop_front() else { return Ok(()) };
    finish(&work.submission, progress)?;
    let now = Instant::now();
    let secs = now.duration_since(submitted.max(*last_end)).as_secs_f64();
    *last_end = now;
    let before = in_flight.len();
    let work = source.take_results(work, secs, in_flight, gate, progress)?;
    if in_flight.len() < before || work.is_none() {
        *last_end = Instant::now(); // What was done over says nothing about how long work takes.
    }
    let Some(work) = work else { return Ok(()) };
    let FrameContext { film, device, .. } = *source.tracer().context;
    progress.note_driver_usage(device);
    if let Some(extent) = work.publishes.filter(|_| !gate.is_superseded()) {
        progress.publish(film, extent)?;
    }
    progress.octaves(film, &work.octaves)?;
    if !work.octaves.is_empty() {
        progress.take_part(film)?;
    }
    source.end_submission(progress)
}
