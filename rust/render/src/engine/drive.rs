// SPDX-License-Identifier: Apache-2.0
//! The loop of a stage: keeps the device busy with what its feed gives until every path is done.
//!
//! Two submissions are under way at any time, so the device does not wait for the host. Stop, pause and newer jobs take
//! effect between submissions, which are short.

use super::{Tracer, finish};
use crate::error::RenderError;
use crate::progress::Progress;
use crate::publish::Extent;
use crate::setting::Setting;
use crate::shared::Gate;
use crate::wavefront::Kind;
use oocpt_abi::Counters;
use oocpt_gpu::Submission;
use std::collections::VecDeque;
use std::time::Instant;

/// Submissions under way at the same time.
pub(crate) const IN_FLIGHT: usize = 2;

/// How a stage ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Outcome {
    /// Every path is in the film.
    Done,
    /// The gate or the clock said no; the film has the paths up to some point.
    GivenUp,
}

/// Where a feed left off.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StreamingEnd {
    /// The first path that is not in the film.
    pub(crate) first: u64,
    pub(crate) counters: Counters,
}

/// What a feed handed to the device.
#[derive(Debug)]
pub(crate) struct Work<T> {
    pub(crate) submission: Submission,
    /// It ends with an image to be published, of which so much is there.
    pub(crate) publishes: Option<Extent>,
    /// Octaves of samples that it completes.
    pub(crate) octaves: Vec<u32>,
    /// What the feed remembers of it.
    pub(crate) of: T,
}

/// Work under way.
#[derive(Debug)]
pub(crate) struct InFlightSubmission<T> {
    pub(crate) work: Work<T>,
    submitted: Instant,
}

/// Where the paths of a frame come from.
pub(crate) trait PathSource {
    /// What is remembered of a submission.
    type StepData;

    fn tracer(&self) -> &Tracer<'_>;

    /// Begins a stage: forgets the samples and counters of the one before.
    fn begin(&mut self, kind: Kind, progress: &mut Progress<'_>) -> Result<(), RenderError>;

    /// The stage that has begun.
    fn kind(&self) -> Kind;

    /// Whether nothing is left to do, given what is under way.
    fn is_done(&self, flights: &VecDeque<InFlightSubmission<Self::StepData>>) -> bool;

    /// Advances work that runs beside the device, such as loads.
    fn advance(
        &mut self,
        _flights: &VecDeque<InFlightSubmission<Self::StepData>>,
        _progress: &mut Progress<'_>,
    ) -> Result<(), RenderError> {
        Ok(())
    }

    /// Hands the device its next submission; none when there is nothing to do before those under way have ended.
    fn launch(
        &mut self,
        flights: &VecDeque<InFlightSubmission<Self::StepData>>,
        progress: &mut Progress<'_>,
    ) -> Result<Option<Work<Self::StepData>>, RenderError>;

    /// Learns from the oldest submission, `secs` long, which has ended; may take back what was launched behind it, and
    /// do it over. None: the gate said no in the middle of it, and it left no trace.
    fn land(
        &mut self,
        work: Work<Self::StepData>,
        secs: f64,
        flights: &mut VecDeque<InFlightSubmission<Self::StepData>>,
        gate: &Gate<'_>,
        progress: &mut Progress<'_>,
    ) -> Result<Option<Work<Self::StepData>>, RenderError>;

    /// After the images and the error of a submission were taken.
    fn landed(&mut self, progress: &mut Progress<'_>) -> Result<(), RenderError>;

    /// Nothing is under way and there is nothing to launch: waits for something to change. False: nothing will.
    fn wait(&mut self, progress: &mut Progress<'_>) -> Result<bool, RenderError>;

    /// The stage has ended.
    fn ended(&mut self, _progress: &mut Progress<'_>) {}

    /// Where another feed goes on: the film has all paths before it, and this one gives no more.
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
    feed: &mut F,
    gate: &Gate<'_>,
    progress: &mut Progress<'_>,
) -> Result<Outcome, RenderError> {
    let mut flights = VecDeque::with_capacity(IN_FLIGHT);
    let mut last_end = Instant::now();
    let mut outcome = Outcome::Done;
    while !feed.is_done(&flights) {
        if !gate.proceed() || (feed.kind() == Kind::Samples && progress.out_of_time()) {
            outcome = Outcome::GivenUp;
            break;
        }
        while flights.front().is_some_and(|flight: &InFlightSubmission<F::StepData>| flight.work.submission.is_done()) {
            land(feed, &mut flights, &mut last_end, gate, progress)?;
        }
        feed.advance(&flights, progress)?;
        let launched = if flights.len() < IN_FLIGHT { feed.launch(&flights, progress)? } else { None };
        if let Some(work) = launched {
            flights.push_back(InFlightSubmission { work, submitted: Instant::now() });
        } else if !flights.is_empty() {
            land(feed, &mut flights, &mut last_end, gate, progress)?;
        } else if !feed.wait(progress)? {
            break;
        }
    }
    while !flights.is_empty() {
        land(feed, &mut flights, &mut last_end, gate, progress)?;
    }
    feed.advance(&flights, progress)?;
    feed.ended(progress);
    Ok(outcome)
}

/// Waits for the oldest submission and takes what it left.
fn land<F: PathSource>(
    feed: &mut F,
    flights: &mut VecDeque<InFlightSubmission<F::StepData>>,
    last_end: &mut Instant,
    gate: &Gate<'_>,
    progress: &mut Progress<'_>,
) -> Result<(), RenderError> {
    let Some(InFlightSubmission { work, submitted }) = flights.pop_front() else { return Ok(()) };
    finish(&work.submission, progress)?;
    let now = Instant::now();
    let secs = now.duration_since(submitted.max(*last_end)).as_secs_f64();
    *last_end = now;
    let before = flights.len();
    let work = feed.land(work, secs, flights, gate, progress)?;
    if flights.len() < before || work.is_none() {
        *last_end = Instant::now(); // What was done over says nothing about how long work takes.
    }
    let Some(work) = work else { return Ok(()) };
    let Setting { film, device, .. } = *feed.tracer().setting;
    progress.note_driver_usage(device);
    if let Some(extent) = work.publishes {
        progress.publish(film, extent)?;
    }
    progress.octaves(film, &work.octaves)?;
    feed.landed(progress)
}
