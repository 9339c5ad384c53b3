// SPDX-License-Identifier: Apache-2.0
//! Records one step: table entries, finished segments into the film, new paths and woken rays, rounds, demand.

use super::StreamingContext;
use super::buffers::verdict_table;
use super::segments::LiveSegment;
use crate::error::RenderError;
use crate::job::publish::PictureExtent;
use crate::wavefront::{PathKind, TracedRays};
use oocpt_abi::{PREPARE_DEMAND, PushConstants, SCAN_BLOCKS, SCAN_SUMS};
use oocpt_gpu::{CommandList, Submission};
use oocpt_shaders::Pass;

/// The work of a step.
#[derive(Debug, Default)]
pub(super) struct StepPlan {
    /// The first round.
    pub(super) round: u32,
    /// Rounds to trace.
    pub(super) rounds: u32,
    /// Finished segments that are added to the film, oldest first.
    pub(super) finished: Vec<LiveSegment>,
    /// Segments that begin.
    pub(super) started: Vec<LiveSegment>,
    /// True if rays may be waiting.
    pub(super) wakes: bool,
    /// True if there are verdicts for rays that wait (roulette on loads).
    pub(super) plays: bool,
    /// True if the contributions of waiting rays are measured (roulette on loads).
    pub(super) weighs: bool,
    /// An image is copied out at the end, of which so much is there.
    pub(super) publishes: Option<PictureExtent>,
}

impl StreamingContext<'_, '_> {
    /// The push constants of passes over a segment: `arg0` is its first place.
    fn push_of(&self, kind: PathKind, segment: &LiveSegment, round: u32) -> PushConstants {
        let push = self.tracer.recorder().push_of(kind, segment.wave);
        push.with(round, segment.index * self.buffers.ended.segment_size)
    }

    /// Clears the samples and paths of the previous frame or stage.
    pub(super) fn clear(&self, clears_film: bool) -> Result<(), RenderError> {
        let mut commands = self.tracer.commands("clear")?;
        self.buffers.clear(&mut commands);
        if clears_film {
            self.tracer.context.film.clear(&mut commands);
        }
        commands.submit()?;
        Ok(())
    }

    /// Records and submits a step; returns the octaves of samples that it completes.
    pub(super) fn step(
        &mut self,
        kind: PathKind,
        number: u64,
        plan: &StepPlan,
    ) -> Result<(Submission, Vec<u32>), RenderError> {
        let mut commands = self.tracer.commands("step")?;
        self.residency.record(&mut commands);
        let recorder = self.tracer.recorder();
        let q = recorder.push(kind);
        let mut octaves = Vec::new();
        if kind == PathKind::Samples {
            for segment in &plan.finished {
                let push = self.push_of(kind, segment, 0);
                octaves.extend(recorder.accumulate(&mut commands, push, segment.wave));
            }
        }
        if plan.plays {
            recorder.indirect(&mut commands, Pass::RoulettePlay, q.with(plan.round, verdict_table(number)));
        }
        self.begin(&mut commands, kind, plan);
        let traced = if kind == PathKind::Samples { TracedRays::All } else { TracedRays::Closest };
        let mut round = plan.round;
        for _ in 0..plan.rounds {
            recorder.trace(&mut commands, q, round, traced);
            recorder.shade(&mut commands, kind, q, round);
            round = round.wrapping_add(1);
        }
        recorder.direct(&mut commands, Pass::PrepareDispatch, q.with(round, PREPARE_DEMAND), 1);
        self.buffers.clear_demand(&mut commands);
        commands.concurrent(|c| {
            recorder.indirect(c, Pass::CountDemand, q.with(round, 0));
            if kind == PathKind::Samples {
                recorder.indirect(c, Pass::RetirePaths, q.with(round, 0));
            }
        });
        let groups = [self.buffers.demand_groups(), 1, 1];
        recorder.workgroups(&mut commands, Pass::ListDemand, q.with(round, 0), groups);
        if plan.weighs {
            self.buffers.clear_worth(&mut commands);
            recorder.direct(&mut commands, Pass::RouletteLevel, q.with(round, 0), 1);
            recorder.indirect(&mut commands, Pass::RouletteWorth, q.with(round, 0));
        }
        if plan.publishes.is_some() {
            recorder.copy_out(&mut commands);
        }
        self.buffers.copy_out(&mut commands, number);
        Ok((commands.submit()?, octaves))
    }

    /// Starts new paths, and wakes the rays whose chunk is resident, sorted by chunk.
    fn begin(&self, commands: &mut CommandList, kind: PathKind, plan: &StepPlan) {
        let recorder = self.tracer.recorder();
        let q = recorder.push(kind).with(plan.round, 0);
        if plan.wakes {
            recorder.indirect(commands, Pass::ResolveCutouts, q);
            self.buffers.clear_sort(commands);
        }
        commands.concurrent(|c| {
            if plan.wakes {
                recorder.indirect(c, Pass::SortDeferredCount, q);
            }
            for segment in &plan.started {
                let push = self.push_of(kind, segment, plan.round);
                let push = push.into_slots(segment.index, segment.first_slot, self.buffers.paths.capacity);
                recorder.generate(c, kind, push, segment.wave.count);
            }
        });
        if plan.wakes {
            let blocks = [self.buffers.sort_blocks(), 1, 1];
            recorder.workgroups(commands, Pass::SortDeferredScan, q.with(plan.round, SCAN_BLOCKS), blocks);
            recorder.direct(commands, Pass::SortDeferredScan, q.with(plan.round, SCAN_SUMS), 1);
            recorder.indirect(commands, Pass::SortDeferredScatter, q);
        }
    }
}
