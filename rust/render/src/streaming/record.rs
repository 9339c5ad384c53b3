// SPDX-License-Identifier: Apache-2.0
//! Records one step, in the order that `oocpt_shader_abi` documents ("One submission of streaming").

use super::Engine;
use super::buffers::verdict_table;
use super::segments::Segment;
use crate::error::RenderError;
use crate::measure::{LAST_SLOT, accumulate, measure};
use crate::wavefront::StreamPasses;
use oocpt_gpu::{Commands, Pipeline, Submission};
use oocpt_shader_abi::{
    AOV_ESCAPED, AOV_SURFACES, Counters, PREPARE_DEMAND, PREPARE_RESOLVE, PREPARE_SHADE, PREPARE_TRACE, Push,
    PushFlags, SCAN_BLOCKS, SCAN_SUMS, groups,
};

/// What the paths are for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// First hits through pixel centres; a path is a pixel.
    Aovs,
    /// Samples of the colour.
    Samples,
}

/// What a step is to do.
#[derive(Debug, Default)]
pub(super) struct StepPlan {
    /// The first round.
    pub(super) round: u32,
    /// Rounds to trace.
    pub(super) rounds: u32,
    /// Segments that are done and go into the film, oldest first.
    pub(super) finished: Vec<Segment>,
    /// Segments that begin.
    pub(super) started: Vec<Segment>,
    /// Whether rays may be waiting.
    pub(super) wakes: bool,
    /// Whether there are verdicts for rays that wait (roulette on loads).
    pub(super) plays: bool,
    /// Whether what rays that wait bring is looked at (roulette on loads).
    pub(super) weighs: bool,
    /// Whether an image is copied out at the end.
    pub(super) publishes: bool,
}

impl Engine<'_, '_> {
    fn commands(&self, label: &str) -> Result<Commands, RenderError> {
        let mut commands = self.setting.device.gpu.commands(label)?;
        commands.profile(self.setting.job.options.profile);
        Ok(commands)
    }

    /// Pixels of the image; the request was validated, at most 2^28.
    fn pixels(&self) -> u32 {
        u32::try_from(self.setting.job.request.pixels()).unwrap_or(u32::MAX)
    }

    /// The push constants of passes over all slots.
    fn push(&self, kind: Kind) -> Push {
        let push = Push::wave(self.frame.address(), 0, 0, self.pixels());
        if kind == Kind::Aovs { push.flagged(PushFlags::AOVS) } else { push }
    }

    /// The push constants of passes over a segment: `arg0` is its first place.
    fn push_of(&self, kind: Kind, segment: &Segment, round: u32) -> Push {
        let Segment { index, wave, .. } = *segment;
        let push = match kind {
            Kind::Aovs => {
                Push::wave(self.frame.address(), wave.first, wave.count, self.pixels()).flagged(PushFlags::AOVS)
            }
            Kind::Samples => self.setting.film.push(self.frame.address(), wave).0,
        };
        push.with(round, index * self.buffers.segment_size)
    }

    /// Forgets the samples and paths of the frame or stage before.
    pub(super) fn clear(&self, kind: Kind) -> Result<(), RenderError> {
        let mut commands = self.commands("clear")?;
        self.buffers.clear(&mut commands);
        if kind == Kind::Samples {
            self.setting.film.clear(&mut commands);
        }
        commands.submit()?;
        Ok(())
    }

    /// Records and submits a step; gives the octaves of samples that it completes.
    pub(super) fn step(
        &mut self,
        kind: Kind,
        number: u64,
        plan: &StepPlan,
    ) -> Result<(Submission, Vec<u32>), RenderError> {
        let mut commands = self.commands("step")?;
        self.residency.record(&mut commands);
        let passes = &self.passes;
        let Some(stream) = &passes.stream else {
            return Err(RenderError::Internal("the streaming passes were not made".into()));
        };
        let q = self.push(kind);
        let mut octaves = Vec::new();
        if kind == Kind::Samples {
            let film = (passes, self.setting.film, &self.buffers.paths.counters);
            for segment in &plan.finished {
                let push = self.push_of(kind, segment, 0);
                octaves.extend(accumulate(&mut commands, film, push, segment.wave, (self.pixels(), u64::MAX)));
            }
        }
        let mut round = plan.round;
        if let (true, Some(roulette)) = (plan.plays, &stream.roulette) {
            let push = q.with(plan.round, verdict_table(number));
            self.indirect(&mut commands, &roulette.roulette_play, push, Counters::DEFERRED_ARGS);
        }
        self.begin(&mut commands, stream, kind, plan)?;
        for _ in 0..plan.rounds {
            self.round(&mut commands, stream, kind, q, round);
            round = round.wrapping_add(1);
        }
        direct(&mut commands, &passes.prepare_dispatch, q.with(round, PREPARE_DEMAND), 1);
        self.buffers.clear_demand(&mut commands);
        self.indirect(&mut commands, &stream.count_demand, q.with(round, 0), Counters::DEFERRED_ARGS);
        if let (true, Some(roulette)) = (plan.weighs, &stream.roulette) {
            self.buffers.clear_worth(&mut commands);
            direct(&mut commands, &roulette.roulette_level, q.with(round, 0), 1);
            self.indirect(&mut commands, &roulette.roulette_worth, q.with(round, 0), Counters::DEFERRED_ARGS);
        }
        if plan.publishes {
            self.copy_images(&mut commands);
        }
        self.buffers.copy_out(&mut commands, number);
        Ok((commands.submit()?, octaves))
    }

    /// Starts new paths, and wakes the rays whose chunk is there, sorted by chunk.
    fn begin(
        &self,
        commands: &mut Commands,
        stream: &StreamPasses,
        kind: Kind,
        plan: &StepPlan,
    ) -> Result<(), RenderError> {
        let generate = match (kind, &self.passes.aovs) {
            (Kind::Samples, _) => &self.passes.generate_camera_rays,
            (Kind::Aovs, Some(aovs)) => &aovs.generate_aov_rays,
            (Kind::Aovs, None) => {
                let what = "the passes of the images through pixel centres were not made";
                return Err(RenderError::Internal(what.into()));
            }
        };
        let q = self.push(kind);
        if plan.wakes {
            if let Some(resolve_cutouts) = &stream.resolve_cutouts {
                self.indirect(commands, resolve_cutouts, q.with(plan.round, 0), Counters::DEFERRED_ARGS);
            }
            self.buffers.clear_sort(commands);
        }
        commands.concurrent(|c| {
            if plan.wakes {
                self.indirect(c, &stream.sort_deferred_count, q.with(plan.round, 0), Counters::DEFERRED_ARGS);
            }
            for segment in &plan.started {
                let push = self.push_of(kind, segment, plan.round);
                let push = push.into_slots(segment.index, segment.first_slot, self.buffers.paths.capacity);
                direct(c, generate, push, segment.wave.count);
            }
        });
        if plan.wakes {
            let blocks = [self.buffers.sort_blocks(), 1, 1];
            let scan = q.with(plan.round, SCAN_BLOCKS);
            commands.dispatch(&stream.sort_deferred_scan, bytemuck::bytes_of(&scan), blocks);
            direct(commands, &stream.sort_deferred_scan, q.with(plan.round, SCAN_SUMS), 1);
            self.indirect(commands, &stream.sort_deferred_scatter, q.with(plan.round, 0), Counters::DEFERRED_ARGS);
        }
        Ok(())
    }

    /// Traces every ray that can be traced, and shades what is finished.
    fn round(&self, commands: &mut Commands, stream: &StreamPasses, kind: Kind, q: Push, round: u32) {
        let passes = &self.passes;
        direct(commands, &passes.prepare_dispatch, q.with(round, PREPARE_TRACE), 1);
        commands.concurrent(|c| {
            self.indirect(c, &passes.intersect_closest, q.with(round, 0), Counters::TRACE_ARGS);
            if kind == Kind::Samples {
                self.indirect(c, &passes.intersect_shadow, q.with(round, 0), Counters::SHADOW_ARGS);
            }
        });
        let prepare = if stream.resolve_materials.is_some() { PREPARE_RESOLVE } else { PREPARE_SHADE };
        commands.concurrent(|c| {
            direct(c, &passes.prepare_dispatch, q.with(round, prepare), 1);
            self.indirect(c, &stream.record_surfaces, q.with(round, 0), Counters::RAY_ARGS);
        });
        if let Some(resolve_materials) = &stream.resolve_materials {
            self.indirect(commands, resolve_materials, q.with(round, 0), Counters::RESOLVE_ARGS);
            direct(commands, &passes.prepare_dispatch, q.with(round, PREPARE_SHADE), 1);
        }
        commands.concurrent(|c| match (kind, &passes.aovs) {
            (Kind::Aovs, Some(aovs)) => {
                self.indirect(c, &aovs.shade_aovs, q.with(round, AOV_SURFACES), Counters::SURFACE_ARGS);
                self.indirect(c, &aovs.shade_aovs, q.with(round, AOV_ESCAPED), Counters::ESCAPED_ARGS);
            }
            // `begin` has refused AOVs without their passes.
            _ => {
                self.indirect(c, &passes.shade_background, q.with(round, 0), Counters::ESCAPED_ARGS);
                self.indirect(c, &passes.shade_surface, q.with(round, 0), Counters::SURFACE_ARGS);
            }
        });
    }

    /// Copies the images out as the film has them now.
    pub(super) fn copy_images(&self, commands: &mut Commands) {
        if self.setting.film.has_color() {
            let (q, pixels) = (self.push(Kind::Samples), self.pixels());
            commands.concurrent(|c| {
                direct(c, &self.passes.resolve, q, pixels);
                if let Some(count_samples) = &self.passes.count_samples {
                    direct(c, count_samples, q, pixels);
                }
            });
        }
        self.setting.film.copy_out(commands, &self.buffers.paths.counters);
    }

    fn indirect(&self, commands: &mut Commands, pipeline: &Pipeline, push: Push, arguments: u64) {
        commands.dispatch_indirect(pipeline, bytemuck::bytes_of(&push), &self.buffers.paths.counters, arguments);
    }

    /// Submits the last copy of the images.
    pub(super) fn submit_images(&self, measures: bool) -> Result<Submission, RenderError> {
        let mut commands = self.commands("resolve")?;
        self.copy_images(&mut commands);
        if measures {
            let film = (&self.passes, self.setting.film, &self.buffers.paths.counters);
            measure(&mut commands, film, self.push(Kind::Samples), LAST_SLOT, self.pixels());
        }
        Ok(commands.submit()?)
    }
}

fn direct(commands: &mut Commands, pipeline: &Pipeline, push: Push, threads: u32) {
    commands.dispatch(pipeline, bytemuck::bytes_of(&push), groups(u64::from(threads)));
}
