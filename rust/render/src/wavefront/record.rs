// SPDX-License-Identifier: Apache-2.0
//! Records one wave: the ray's straight line from camera to film.

use super::{AovPasses, Passes, PathBuffers};
use crate::feedback::Feedback;
use crate::film::Film;
use crate::measure::{self, LAST_SLOT};
use crate::schedule::Wave;
use oocpt_gpu::{Commands, Pipeline};
use oocpt_shader_abi::{AOV_ESCAPED, AOV_SURFACES, Counters, PREPARE_SHADE, PREPARE_TRACE, Push, PushFlags, groups};
use std::ops::Range;

/// Records the passes of waves of one frame.
#[derive(Debug)]
pub(crate) struct Recorder<'a> {
    pub(crate) passes: &'a Passes,
    pub(crate) buffers: &'a PathBuffers,
    pub(crate) film: &'a Film,
    /// Only where texture tiles are loaded on demand.
    pub(crate) feedback: Option<&'a Feedback>,
    /// Device address of the frame block.
    pub(crate) frame: u64,
    pub(crate) pixels: u32,
    /// One more than `max_bounces` where there are materials: rays that leave the last surface that is lit still look for lights.
    pub(crate) last_round: u32,
}

impl Recorder<'_> {
    /// The parts that a wave is submitted in: rounds `0`, `1`, `2..4`, `4..8` and so on. Short enough each for the host to be
    /// heard between them, and later rounds have few rays left.
    pub(crate) fn parts(&self) -> Vec<Range<u32>> {
        let mut parts = Vec::new();
        let mut first = 0_u32;
        while first <= self.last_round {
            let end = first.saturating_mul(2).clamp(1, self.last_round + 1);
            parts.push(first..end);
            first = end;
        }
        parts
    }

    /// Records some rounds of a wave: camera rays before the first round, the film after the last one.
    /// Gives the octaves of samples that end with it. `flags`: `RETRACE` for the paths of the wave that lacked a tile.
    pub(crate) fn part(&self, commands: &mut Commands, wave: Wave, rounds: Range<u32>, flags: PushFlags) -> Vec<u32> {
        let (q, _) = self.film.push(self.frame, wave);
        let q = q.flagged(flags);
        if rounds.start == 0 {
            if let Some(feedback) = self.feedback {
                feedback.empty_queue(commands, &self.buffers.counters);
            }
            self.direct(commands, &self.passes.generate_camera_rays, q, wave.count);
            self.direct(commands, &self.passes.prepare_dispatch, q.with(0, PREPARE_TRACE), 1);
            self.indirect(commands, &self.passes.intersect_closest, q.with(0, 0), Counters::TRACE_ARGS);
        }
        for round in rounds.clone() {
            self.round(commands, q, round);
        }
        if rounds.end > self.last_round {
            let film = (self.passes, self.film, &self.buffers.counters);
            return measure::accumulate(commands, film, q, wave, (self.pixels, u64::MAX));
        }
        Vec::new()
    }

    /// Shades what the rays of a round met; traces the shadow rays beside the rays of the next round.
    fn round(&self, commands: &mut Commands, q: Push, round: u32) {
        self.direct(commands, &self.passes.prepare_dispatch, q.with(round, PREPARE_SHADE), 1);
        commands.concurrent(|c| {
            self.indirect(c, &self.passes.shade_background, q.with(round, 0), Counters::ESCAPED_ARGS);
            self.indirect(c, &self.passes.shade_surface, q.with(round, 0), Counters::SURFACE_ARGS);
        });
        self.direct(commands, &self.passes.prepare_dispatch, q.with(round + 1, PREPARE_TRACE), 1);
        commands.concurrent(|c| {
            self.indirect(c, &self.passes.intersect_shadow, q.with(round, 0), Counters::SHADOW_ARGS);
            if round < self.last_round {
                self.indirect(c, &self.passes.intersect_closest, q.with(round + 1, 0), Counters::TRACE_ARGS);
            }
        });
    }

    /// First hits through the pixel centres of `slice`, a wave of pixels.
    pub(crate) fn aovs(&self, commands: &mut Commands, passes: &AovPasses, slice: Wave) {
        let q = Push::wave(self.frame, slice.first, slice.count, self.pixels).flagged(PushFlags::AOVS);
        self.direct(commands, &passes.generate_aov_rays, q, slice.count);
        self.direct(commands, &self.passes.prepare_dispatch, q.with(0, PREPARE_TRACE), 1);
        self.indirect(commands, &self.passes.intersect_closest, q, Counters::TRACE_ARGS);
        self.direct(commands, &self.passes.prepare_dispatch, q.with(0, PREPARE_SHADE), 1);
        commands.concurrent(|c| {
            self.indirect(c, &passes.shade_aovs, q.with(0, AOV_SURFACES), Counters::SURFACE_ARGS);
            self.indirect(c, &passes.shade_aovs, q.with(0, AOV_ESCAPED), Counters::ESCAPED_ARGS);
        });
    }

    /// Asks the film for its error at the end.
    pub(crate) fn measure(&self, commands: &mut Commands) {
        let q = Push::wave(self.frame, 0, 0, self.pixels);
        measure::measure(commands, (self.passes, self.film, &self.buffers.counters), q, LAST_SLOT, self.pixels);
    }

    /// The picture of what the film holds.
    pub(crate) fn resolve(&self, commands: &mut Commands) {
        let q = Push::wave(self.frame, 0, 0, self.pixels);
        commands.concurrent(|c| {
            self.direct(c, &self.passes.resolve, q, self.pixels);
            if let Some(count_samples) = &self.passes.count_samples {
                self.direct(c, count_samples, q, self.pixels);
            }
        });
    }

    fn direct(&self, commands: &mut Commands, pipeline: &Pipeline, push: Push, threads: u32) {
        commands.dispatch(pipeline, bytemuck::bytes_of(&push), groups(u64::from(threads)));
    }

    fn indirect(&self, commands: &mut Commands, pipeline: &Pipeline, push: Push, arguments: u64) {
        commands.dispatch_indirect(pipeline, bytemuck::bytes_of(&push), &self.buffers.counters, arguments);
    }
}
