// SPDX-License-Identifier: Apache-2.0
//! Submits the work of a frame and publishes what comes back.
//!
//! A wave is submitted in parts, each a few rounds. Two parts are under way at any time, so the device does not wait for the
//! host; the host asks the gate before each new one, and a wave that is given up in the middle leaves no trace in the film.
//! An image is published at growing intervals and at the end.

use crate::device::Device;
use crate::error::RenderError;
use crate::film::Film;
use crate::progress::Progress;
use crate::schedule::{Schedule, Wave, first_wave};
use crate::session::Job;
use crate::thread::Gate;
use crate::wavefront::{Passes, PathBuffers, Recorder};
use oocpt_core::scene::SceneFeatures;
use oocpt_gpu::{Buffer, Commands, Submission};
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
}

impl Frames<'_> {
    fn recorder(&self) -> Recorder<'_> {
        Recorder {
            passes: self.passes,
            buffers: self.buffers,
            film: self.film,
            frame: self.frame.address(),
            // The request was validated: at most 2^28 pixels.
            pixels: u32::try_from(self.job.request.pixels()).unwrap_or(u32::MAX),
            last_round: self.job.settings.max_bounces
                + u32::from(self.job.snapshot.features.contains(SceneFeatures::MATERIALS)),
        }
    }

    fn commands(&self, label: &str) -> Result<Commands, RenderError> {
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
struct Flight {
    submission: Submission,
    /// The wave, if this is its last part.
    ends: Option<Wave>,
    /// Octaves of samples that it completes.
    octaves: Vec<u32>,
    submitted: Instant,
    publishes: bool,
}

/// Forgets the samples and counters of the frame before.
pub(crate) fn clear(frames: &Frames<'_>) -> Result<(), RenderError> {
    let mut commands = frames.commands("clear")?;
    let counters = &frames.buffers.counters;
    commands.fill(counters, 0, counters.size(), 0);
    frames.film.clear(&mut commands);
    commands.submit()?;
    Ok(())
}

/// Traces the images that go through pixel centres and publishes them; false when the gate said no.
pub(crate) fn trace_planes(
    frames: &Frames<'_>,
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
        let mut commands = frames.commands("aovs")?;
        frames.recorder().aovs(&mut commands, aovs, slice);
        let last = slice.first + u64::from(slice.count) == u64::from(pixels);
        if last && !frames.film.has_color() {
            frames.copy_out(&mut commands);
        }
        let submission = commands.submit()?;
        finish(&submission, progress)?;
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
                let ends = parts.is_empty();
                flights.push_back(launch(frames, wave, rounds, ends, progress)?);
            }
        }
        let Some(flight) = flights.pop_front() else { break };
        finish(&flight.submission, progress)?;
        let begun = flight.submitted.max(last_end);
        last_end = Instant::now();
        wave_secs += last_end.duration_since(begun).as_secs_f64();
        if let Some(wave) = flight.ends {
            schedule.measured(wave.count, wave_secs);
            progress.wave_done(wave);
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

fn launch(
    frames: &Frames<'_>,
    wave: Wave,
    rounds: Range<u32>,
    ends: bool,
    progress: &mut Progress<'_>,
) -> Result<Flight, RenderError> {
    let mut commands = frames.commands("wave")?;
    let octaves = frames.recorder().part(&mut commands, wave, rounds);
    let publishes = ends && (progress.publish_due() || progress.compares(&octaves));
    if publishes {
        frames.copy_out(&mut commands);
    }
    let submission = commands.submit()?;
    Ok(Flight { submission, ends: ends.then_some(wave), octaves, submitted: Instant::now(), publishes })
}

/// Waits for a submission and notes the times of its passes.
fn finish(submission: &Submission, progress: &mut Progress<'_>) -> Result<(), RenderError> {
    if !submission.wait(WAVE_TIMEOUT)? {
        return Err(RenderError::Internal(format!("a wave did not finish within {} s", WAVE_TIMEOUT.as_secs())));
    }
    for (pass, secs) in submission.timings() {
        progress.timings.add_pass(&pass, secs);
    }
    Ok(())
}
