// SPDX-License-Identifier: Apache-2.0
//! Submits the work of a frame and publishes what comes back.
//!
//! A wave is submitted in parts, each a few rounds. Two parts are under way at any time, so the device does not wait for the
//! host; the host asks the gate before each new one, and a wave that is given up in the middle leaves no trace in the film.
//! An image is published at growing intervals and at the end. A wave that lacks tiles of textures is completed before
//! the next one
//! (`tile_waves`).

use crate::device::Device;
use crate::error::RenderError;
use crate::feedback::{Copy, Feedback};
use crate::film::Film;
use crate::progress::Progress;
use crate::schedule::{Schedule, Wave, first_wave};
use crate::session::Job;
use crate::thread::Gate;
use crate::tile_waves::{Completed, Tiles};
use crate::wavefront::{Passes, PathBuffers, Recorder};
use oocpt_core::scene::SceneFeatures;
use oocpt_gpu::{Buffer, Commands, Submission};
use oocpt_shader_abi::PushFlags;
use std::collections::VecDeque;
use std::ops::Range;
use std::time::{Duration, Instant};

/// Submissions under way at the same time.
const IN_FLIGHT: usize = 2;
/// How long one submission may take before the device counts as lost.
pub(crate) const WAVE_TIMEOUT: Duration = Duration::from_secs(120);

/// Everything the submissions of one frame refer to.
#[derive(Debug)]
pub(crate) struct Frames<'a> {
    pub(crate) device: &'a Device,
    pub(crate) film: &'a Film,
    pub(crate) buffers: &'a PathBuffers,
    pub(crate) passes: &'a Passes,
    pub(crate) frame: &'a Buffer,
    pub(crate) job: &'a Job,
    /// Only where something reads a texture.
    pub(crate) feedback: Option<&'a Feedback>,
}

impl Flight {
    pub(crate) fn submission(&self) -> &Submission {
        &self.submission
    }

    pub(crate) fn wave(&self) -> Wave {
        self.wave
    }
}

impl Frames<'_> {
    pub(crate) fn recorder(&self) -> Recorder<'_> {
        Recorder {
            passes: self.passes,
            buffers: self.buffers,
            film: self.film,
            feedback: self.feedback,
            frame: self.frame.address(),
            // The request was validated: at most 2^28 pixels.
            pixels: u32::try_from(self.job.request.pixels()).unwrap_or(u32::MAX),
            last_round: self.job.settings.max_bounces
                + u32::from(self.job.snapshot.features.contains(SceneFeatures::MATERIALS)),
        }
    }

    pub(crate) fn commands(&self, label: &str) -> Result<Commands, RenderError> {
        let mut commands = self.device.gpu.commands(label)?;
        commands.profile(self.job.options.profile);
        Ok(commands)
    }

    /// Ends `commands` with what publishing the film as it then is needs.
    fn copy_out(&self, commands: &mut Commands) {
        if self.film.has_color() {
            self.recorder().resolve(commands);
        }
        self.film.copy_out(commands, &self.buffers.counters);
    }
}

/// A part of a wave under way.
pub(crate) struct Flight {
    submission: Submission,
    wave: Wave,
    rounds: Range<u32>,
    /// It is the last part of its wave.
    ends: bool,
    /// Octaves of samples that it completes.
    pub(crate) octaves: Vec<u32>,
    submitted: Instant,
    pub(crate) publishes: bool,
    /// At the end of a wave: what it lacked.
    pub(crate) lacking: Option<Copy>,
}

/// What is handed to the device.
pub(crate) struct Part {
    pub(crate) wave: Wave,
    pub(crate) rounds: Range<u32>,
    pub(crate) ends: bool,
    pub(crate) flags: PushFlags,
}

/// Forgets the samples and counters of the frame before.
pub(crate) fn clear(frames: &Frames<'_>) -> Result<(), RenderError> {
    let mut commands = frames.commands("clear")?;
    let counters = &frames.buffers.counters;
    commands.fill(counters, 0, counters.size(), 0);
    frames.film.clear(&mut commands);
    if let Some(feedback) = frames.feedback {
        feedback.reset(&mut commands);
    }
    commands.submit()?;
    Ok(())
}

/// Traces the images that go through pixel centres and publishes them; false when the gate said no.
pub(crate) fn trace_planes(
    frames: &Frames<'_>,
    tiles: &mut Tiles<'_>,
    gate: &Gate<'_>,
    progress: &mut Progress<'_>,
) -> Result<bool, RenderError> {
    let Some(aovs) = &frames.passes.aovs else { return Ok(true) };
    let pixels = frames.recorder().pixels;
    let start = first_wave(frames.device.gpu.report().kind).min(1 << 15);
    let mut schedule = Schedule::new(u64::from(pixels), start, frames.buffers.capacity, 0.05);
    while let Some(slice) = schedule.next(u64::MAX) {
        if !gate.proceed() {
            return Ok(false);
        }
        let started = Instant::now();
        let last = slice.first + u64::from(slice.count) == u64::from(pixels);
        loop {
            let mut commands = frames.commands("aovs")?;
            frames.recorder().aovs(&mut commands, aovs, slice);
            if last && !frames.film.has_color() {
                frames.copy_out(&mut commands);
            }
            let lacking = frames.feedback.map(|feedback| feedback.copy_out(&mut commands));
            finish(&commands.submit()?, progress)?;
            // A slice that lacks tiles is traced again as a whole: it writes the same planes.
            match tiles.bring(frames, lacking, gate, progress)? {
                Completed::Whole => break,
                Completed::Again => {}
                Completed::GivenUp => return Ok(false),
            }
        }
        schedule.measured(slice.count, started.elapsed().as_secs_f64());
        if last && !frames.film.has_color() {
            progress.publish(frames.film)?;
        }
    }
    Ok(true)
}

/// Traces every wave of `schedule`, or as many as gate and time limit allow, and publishes the result.
pub(crate) fn trace(
    frames: &Frames<'_>,
    tiles: &mut Tiles<'_>,
    mut schedule: Schedule,
    gate: &Gate<'_>,
    progress: &mut Progress<'_>,
) -> Result<(), RenderError> {
    if !frames.film.has_color() {
        return progress.finish();
    }
    let mut flights: VecDeque<Flight> = VecDeque::with_capacity(IN_FLIGHT);
    let mut parts: VecDeque<(Wave, Range<u32>)> = VecDeque::new();
    let mut last_end = Instant::now();
    let mut wave_secs = 0.0;
    let mut more = true;
    progress.trace_started();
    schedule.cut_at(progress.begin_samples(frames.film));
    loop {
        while more && flights.len() < IN_FLIGHT {
            more = gate.proceed() && !progress.out_of_time();
            if more && parts.is_empty() {
                let wave = schedule.next(progress.open_paths());
                if wave.is_none() && !flights.is_empty() {
                    break; // What is under way may open more.
                }
                more = wave.is_some();
                let rounds = frames.recorder().parts();
                parts.extend(wave.into_iter().flat_map(|wave| rounds.clone().into_iter().map(move |r| (wave, r))));
            }
            if let Some((wave, rounds)) = parts.pop_front().filter(|_| more) {
                let ends = parts.front().is_none_or(|(next, _)| *next != wave);
                let part = Part { wave, rounds, ends, flags: PushFlags::empty() };
                flights.push_back(launch(frames, part, progress)?);
            }
        }
        let Some(mut flight) = flights.pop_front() else { break };
        finish(&flight.submission, progress)?;
        let begun = flight.submitted.max(last_end);
        last_end = Instant::now();
        wave_secs += last_end.duration_since(begun).as_secs_f64();
        if tiles.is_incomplete(flight.lacking)? {
            // The passes of the waves behind it did nothing.
            for later in flights.drain(..).rev().collect::<Vec<_>>() {
                finish(&later.submission, progress)?;
                parts.push_front((later.wave, later.rounds));
            }
            match tiles.complete(frames, flight, gate, progress)? {
                Some(completed) => flight = completed,
                None => break,
            }
            last_end = Instant::now(); // Waiting for tiles says nothing about waves.
        }
        if flight.ends {
            schedule.measured(flight.wave.count, wave_secs);
            progress.wave_done(flight.wave);
            wave_secs = 0.0;
        }
        if flight.publishes {
            progress.publish(frames.film)?;
        }
        if !flight.octaves.is_empty() {
            progress.octaves(frames.film, &flight.octaves)?;
            schedule.cut_at(progress.begin_samples(frames.film));
        }
    }
    end(frames, progress)
}

/// Publishes the film as it is, and what it says of its error.
fn end(frames: &Frames<'_>, progress: &mut Progress<'_>) -> Result<(), RenderError> {
    progress.trace_ended();
    let mut commands = frames.commands("resolve")?;
    frames.copy_out(&mut commands);
    let measures = progress.ends_between_octaves();
    if measures {
        frames.recorder().measure(&mut commands);
    }
    finish(&commands.submit()?, progress)?;
    progress.publish(frames.film)?;
    progress.error_at_end(frames.film, measures)?;
    progress.finish()
}

/// Hands a part of a wave to the device.
pub(crate) fn launch(frames: &Frames<'_>, part: Part, progress: &mut Progress<'_>) -> Result<Flight, RenderError> {
    let Part { wave, rounds, ends, flags } = part;
    let mut commands = frames.commands("wave")?;
    let octaves = frames.recorder().part(&mut commands, wave, rounds.clone(), flags);
    let publishes = ends && (progress.publish_due() || progress.compares(&octaves));
    if publishes {
        frames.copy_out(&mut commands);
    }
    let lacking = frames.feedback.filter(|_| ends).map(|feedback| feedback.copy_out(&mut commands));
    let submission = commands.submit()?;
    Ok(Flight { submission, wave, rounds, ends, octaves, submitted: Instant::now(), publishes, lacking })
}

/// Waits for a submission and notes the times of its passes.
pub(crate) fn finish(submission: &Submission, progress: &mut Progress<'_>) -> Result<(), RenderError> {
    if !submission.wait(WAVE_TIMEOUT)? {
        return Err(RenderError::Internal(format!("a wave did not finish within {} s", WAVE_TIMEOUT.as_secs())));
    }
    for (pass, secs) in submission.timings() {
        progress.timings.add_pass(&pass, secs);
    }
    Ok(())
}
