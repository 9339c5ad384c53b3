// SPDX-License-Identifier: Apache-2.0
//! The paths of a scene that is resident as a whole: waves, one after the other.
//!
//! A wave of samples is submitted in parts, each a few rounds, so that the host is heard between them; one that is
//! given up in the middle leaves no trace in the film. A wave that lacks tiles of textures is completed before the next
//! one (`tiles`).

use super::{FrameTiles, InFlightSubmission, PathSource, SubmittedWork, WavefrontTracer, finish};
use crate::error::RenderError;
use crate::feedback::{FeedbackBuffers, FeedbackCopy};
use crate::frame::progress::FrameProgress;
use crate::frame::schedule::{WaveSchedule, first_wave};
use crate::job::publish::PictureExtent;
use crate::job::shared::FrameGate;
use crate::wave::Wave;
use crate::wavefront::{PathKind, TracedRays};
use oocpt_abi::{Features, PushConstants, PushFlags};
use oocpt_gpu::CommandList;
use std::collections::VecDeque;
use std::ops::Range;

/// What a wave should take, seconds; it is submitted in parts of about a third of that.
const WAVE_SECS: f64 = 0.2;
/// The same where images are shown on the way: the host moves on in the middle of it.
const WAVE_SECS_INTERACTIVE: f64 = 0.03;
/// Most pixels in the first wave of first hits, and what a wave of them should take, seconds.
const FIRST_PIXELS: u32 = 1 << 15;
const PIXELS_SECS: f64 = 0.05;

/// A part of a wave.
#[derive(Clone, Debug)]
pub(crate) struct WavePart {
    wave: Wave,
    rounds: Range<u32>,
    /// It is the last part of its wave.
    ends: bool,
    /// At the end of a wave: what it lacked.
    lacking: Option<FeedbackCopy>,
}

/// See the module.
#[derive(Debug)]
pub(crate) struct WaveSource<'e> {
    tracer: WavefrontTracer<'e>,
    tiles: FrameTiles<'e>,
    /// Only where something reads a texture.
    feedback: Option<&'e FeedbackBuffers>,
    kind: PathKind,
    schedule: WaveSchedule,
    /// Of the wave that is being submitted.
    parts: VecDeque<(Wave, Range<u32>)>,
    /// Of the wave that is ending.
    wave_secs: f64,
    /// Its last part has ended; none when it was only a part.
    ended: Option<Wave>,
    /// The film has the paths before it.
    first: Option<u64>,
}

impl<'e> WaveSource<'e> {
    /// Waves of all paths, or from path `first` on, where the film has those before it.
    pub(crate) fn new(
        tracer: WavefrontTracer<'e>,
        tiles: FrameTiles<'e>,
        feedback: Option<&'e FeedbackBuffers>,
        first: Option<u64>,
    ) -> Self {
        let (kind, schedule) = (PathKind::Samples, WaveSchedule::new(0, 1, 1, WAVE_SECS));
        Self { tracer, tiles, feedback, kind, schedule, parts: VecDeque::new(), wave_secs: 0.0, ended: None, first }
    }

    /// The last round of a wave: the one of `max_bounces`; with materials one more: rays that leave the last surface
    /// that is lit still look for lights.
    fn last_round(&self) -> u32 {
        let job = self.tracer.context.job;
        match self.kind {
            PathKind::Aovs => 0,
            PathKind::Samples if !self.tracer.context.film.has_light() => 0,
            PathKind::Samples => {
                let has_materials = job.snapshot.features.contains(Features::MATERIALS);
                job.settings.max_bounces + u32::from(has_materials)
            }
        }
    }

    /// Records some rounds of a wave: camera rays before the first round, the film after the last one. Gives the
    /// octaves of samples that end with it.
    fn record(&self, commands: &mut CommandList, wave: Wave, rounds: Range<u32>, q: PushConstants) -> Vec<u32> {
        let (recorder, last) = (self.tracer.recorder(), self.last_round());
        if rounds.start == 0 {
            if let Some(feedback) = self.feedback {
                feedback.empty_queue(commands, &self.tracer.paths.counters);
            }
            recorder.generate(commands, self.kind, q, wave.count);
            recorder.trace(commands, q, 0, TracedRays::Closest);
        }
        for round in rounds.clone() {
            recorder.shade(commands, self.kind, q, round);
            match self.kind {
                PathKind::Samples if !self.tracer.context.film.has_light() => {}
                PathKind::Samples if round < last => recorder.trace(commands, q, round + 1, TracedRays::All),
                PathKind::Samples => recorder.trace(commands, q, round + 1, TracedRays::Shadow),
                PathKind::Aovs => {}
            }
        }
        let ends = rounds.end > last && self.kind == PathKind::Samples;
        if ends { recorder.accumulate(commands, q, wave) } else { Vec::new() }
    }

    /// What there is of the picture with the end of a wave.
    fn extent(&self, wave: Wave) -> PictureExtent {
        let end = wave.first + u64::from(wave.count);
        match self.kind {
            PathKind::Aovs => PictureExtent { planes: end, samples: 0 },
            PathKind::Samples => PictureExtent { planes: u64::MAX, samples: end },
        }
    }

    /// Hands a part of a wave to the device; `flags`: `RETRACE` for those paths of the wave that lacked a tile.
    fn submit(
        &self,
        (wave, rounds): (Wave, Range<u32>),
        ends: bool,
        flags: PushFlags,
        progress: &mut FrameProgress<'_>,
    ) -> Result<SubmittedWork<WavePart>, RenderError> {
        let mut commands = self.tracer.commands("wave")?;
        let q = self.tracer.recorder().push_of(self.kind, wave);
        let q = PushConstants { flags: q.flags | flags.bits(), ..q };
        let octaves = self.record(&mut commands, wave, rounds.clone(), q);
        let extent = self.extent(wave);
        let publishes = (ends && (progress.publish_due(extent) || progress.compares(&octaves))).then_some(extent);
        if publishes.is_some() {
            self.tracer.recorder().copy_out(&mut commands);
        }
        let lacking = self.feedback.filter(|_| ends).map(|feedback| feedback.copy_out(&mut commands));
        let submission = commands.submit()?;
        Ok(SubmittedWork { submission, publishes, octaves, of: WavePart { wave, rounds, ends, lacking } })
    }

    /// Traces those paths of a wave again that lacked tiles, until the film has it; first hits all of them: they write
    /// the same planes. Gives its last part; none when the gate said no: then the wave has left no trace.
    fn complete(
        &mut self,
        mut work: SubmittedWork<WavePart>,
        gate: &FrameGate<'_>,
        progress: &mut FrameProgress<'_>,
    ) -> Result<Option<SubmittedWork<WavePart>>, RenderError> {
        if self.kind == PathKind::Samples {
            progress.timings.retraced_waves += 1;
        }
        while let Some(tiles) = self.tiles.lacking(work.of.lacking)? {
            if !self.tiles.bring(&self.tracer, &tiles, gate, progress)? {
                return Ok(None);
            }
            let flags = if self.kind == PathKind::Samples { PushFlags::RETRACE } else { PushFlags::empty() };
            let parts = parts(self.last_round());
            let last = parts.len().saturating_sub(1);
            for (index, rounds) in parts.into_iter().enumerate() {
                if !gate.proceed() {
                    return Ok(None);
                }
                work = self.submit((work.of.wave, rounds), index == last, flags, progress)?;
                finish(&work.submission, progress)?;
            }
        }
        Ok(Some(work))
    }
}

impl PathSource for WaveSource<'_> {
    type StepData = WavePart;

    fn tracer(&self) -> &WavefrontTracer<'_> {
        &self.tracer
    }

    fn kind(&self) -> PathKind {
        self.kind
    }

    fn begin(&mut self, kind: PathKind, progress: &mut FrameProgress<'_>) -> Result<(), RenderError> {
        let (context, paths) = (self.tracer.context, self.tracer.paths);
        let mut commands = self.tracer.commands("clear")?;
        commands.fill(&paths.counters, 0, paths.counters.size(), 0);
        if self.first.is_none() {
            context.film.clear(&mut commands);
        }
        if let Some(feedback) = self.feedback {
            feedback.reset(&mut commands);
        }
        commands.submit()?;
        let interactive = context.job.settings.interactive;
        let wave_secs = if interactive { WAVE_SECS_INTERACTIVE } else { WAVE_SECS };
        let first =
            context.pace.map_or_else(|| first_wave(context.device.gpu.report().kind), |pace| wave(pace, wave_secs));
        self.kind = kind;
        self.schedule = match kind {
            PathKind::Aovs => {
                // A first hit takes less than a path.
                let first = if context.pace.is_some() { first } else { first.min(FIRST_PIXELS) };
                WaveSchedule::new(context.job.request.pixels(), first, paths.capacity, PIXELS_SECS)
            }
            PathKind::Samples => WaveSchedule::new(progress.total_paths(), first, paths.capacity, wave_secs),
        };
        if kind == PathKind::Samples {
            self.schedule.begin_at(self.first.unwrap_or(0));
            let ends_octaves = progress.wants_octaves() || context.film.has_exact_sums();
            if ends_octaves && context.film.adaptive().is_none() {
                self.schedule = self.schedule.clone().with_octaves(context.job.request.pixels());
            }
            let cuts = progress.begin_samples(context.film);
            // The first image is shown as soon as it is whole.
            let is_whole = (interactive && cuts.is_empty()).then(|| context.job.request.pixels());
            self.schedule.cut_at(cuts.into_iter().chain(is_whole).collect());
        }
        Ok(())
    }

    fn goes_on(&self) -> bool {
        self.first.is_some()
    }

    fn is_done(&self, _in_flight: &VecDeque<InFlightSubmission<WavePart>>) -> bool {
        false // The schedule knows when it is asked.
    }

    fn submit_next(
        &mut self,
        _in_flight: &VecDeque<InFlightSubmission<WavePart>>,
        progress: &mut FrameProgress<'_>,
    ) -> Result<Option<SubmittedWork<WavePart>>, RenderError> {
        if self.parts.is_empty() {
            let open = if self.kind == PathKind::Samples { progress.open_paths() } else { u64::MAX };
            let Some(wave) = self.schedule.next(open) else { return Ok(None) };
            self.parts.extend(parts(self.last_round()).into_iter().map(|rounds| (wave, rounds)));
        }
        let Some((wave, rounds)) = self.parts.pop_front() else { return Ok(None) };
        let ends = self.parts.front().is_none_or(|(next, _)| *next != wave);
        self.submit((wave, rounds), ends, PushFlags::empty(), progress).map(Some)
    }

    fn take_results(
        &mut self,
        mut work: SubmittedWork<WavePart>,
        secs: f64,
        in_flight: &mut VecDeque<InFlightSubmission<WavePart>>,
        gate: &FrameGate<'_>,
        progress: &mut FrameProgress<'_>,
    ) -> Result<Option<SubmittedWork<WavePart>>, RenderError> {
        self.wave_secs += secs;
        if self.tiles.lacking(work.of.lacking)?.is_some() {
            // The passes of the waves behind it did nothing.
            for later in in_flight.drain(..).rev().collect::<Vec<_>>() {
                finish(&later.work.submission, progress)?;
                let WavePart { wave, rounds, .. } = later.work.of;
                self.parts.push_front((wave, rounds));
            }
            let Some(completed) = self.complete(work, gate, progress)? else { return Ok(None) };
            work = completed;
        }
        if work.of.ends {
            self.schedule.measured(work.of.wave.count, std::mem::take(&mut self.wave_secs));
            if self.kind == PathKind::Samples {
                progress.wave_done(work.of.wave);
            }
        }
        self.ended = (!work.octaves.is_empty()).then_some(work.of.wave);
        Ok(Some(work))
    }

    fn cancel(&self) -> Result<bool, RenderError> {
        self.tracer.cancel()
    }

    fn end_submission(&mut self, progress: &mut FrameProgress<'_>) -> Result<(), RenderError> {
        if self.ended.take().is_some() {
            self.schedule.cut_at(progress.begin_samples(self.tracer.context.film));
        }
        Ok(())
    }

    fn wait(&mut self, _progress: &mut FrameProgress<'_>) -> Result<bool, RenderError> {
        Ok(false)
    }
}

/// Paths of a wave of `secs` on a device of so many paths a second.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
fn wave(pace: f64, secs: f64) -> u32 {
    (pace * secs) as u32
}

/// The parts that a wave is submitted in: rounds `0`, `1`, `2..4`, `4..8` and so on. Short enough each for the host to
/// be heard between them, and later rounds have few rays left.
fn parts(last_round: u32) -> Vec<Range<u32>> {
    let mut parts = Vec::new();
    let mut first = 0_u32;
    while first <= last_round {
        let end = first.saturating_mul(2).clamp(1, last_round + 1);
        parts.push(first..end);
        first = end;
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn submission_parts_cover_every_round_once() {
        for last in 0..40 {
            let parts = parts(last);
            let rounds: Vec<u32> = parts.iter().cloned().flatten().collect();
            assert_eq!(rounds, (0..=last).collect::<Vec<_>>(), "{parts:?}");
        }
        assert_eq!(parts(5), [0..1, 1..2, 2..4, 4..6]);
    }
}
