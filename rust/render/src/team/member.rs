// SPDX-License-Identifier: Apache-2.0
//! A device of a team: renders blocks on a thread of its own until none is left, or until it fails.

use crate::error::{RenderError, panic_text};
use crate::frame::progress::FrameProgress;
use crate::frame::progress::team::BlockOutcome;
use crate::job::RenderJob;
use crate::job::shared::SharedState;
use crate::renderer::Renderer;
use crate::sync::lock;
use crate::team::plan::TeamPlan;
use oocpt_film::SampleRange;
use oocpt_gpu::DeviceReport;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::Sender;
use std::time::Instant;

/// A device of a team, and what it keeps from picture to picture.
#[derive(Debug)]
pub(super) struct TeamMember {
    pub(super) device: DeviceReport,
    /// Members before it that are the same physical device.
    twin: u32,
    renderer: Renderer,
}

/// What a device tells the render thread at the end of a block.
#[derive(Debug)]
pub(super) struct BlockEnd {
    pub(super) number: usize,
    /// Samples of it that the film has got.
    pub(super) samples: u32,
    pub(super) seconds: f64,
    pub(super) outcome: BlockOutcome,
    /// Why the device takes no more.
    pub(super) failure: Option<RenderError>,
}

impl TeamMember {
    /// A member for each of these devices.
    pub(super) fn of(devices: Vec<DeviceReport>) -> Vec<Self> {
        let mut members: Vec<Self> = Vec::new();
        for device in devices {
            let twins = members.iter().filter(|member| member.device.index == device.index).count();
            let twin = u32::try_from(twins).unwrap_or(u32::MAX);
            members.push(Self { device, twin, renderer: Renderer::default() });
        }
        members
    }

    /// Renders blocks of the picture, as device `number`, and tells `ends` of each.
    pub(super) fn work(&mut self, number: usize, plan: &TeamPlan<'_>, ends: &Sender<BlockEnd>) {
        let apart = SharedState::default();
        let mut blocks = 0;
        while let Some(block) = plan.next(number) {
            let (job, has_planes) = plan.block_job((number, blocks), block, (&self.device, self.twin));
            let end = self.render(number, plan, (&job, block, has_planes), &apart);
            blocks += 1;
            // The render thread is gone only if it has failed; then nothing is left here.
            let fails = end.failure.is_some();
            if ends.send(end).is_err() || fails {
                break;
            }
        }
    }

    fn render(
        &mut self,
        number: usize,
        plan: &TeamPlan<'_>,
        (job, block, has_planes): (&RenderJob, SampleRange, bool),
        apart: &SharedState,
    ) -> BlockEnd {
        let began = Instant::now();
        let mut progress = FrameProgress::of_block(apart, job, plan.progress(), number);
        let gate = plan.gate.with_results(apart);
        let result = catch_unwind(AssertUnwindSafe(|| self.renderer.render_team_block(job, &gate, &mut progress)));
        let result = result.unwrap_or_else(|panic| Err(RenderError::Internal(panic_text(panic.as_ref()))));
        // The film has all that comes of the block from here on.
        let outcome = progress.end_block();
        let seconds = began.elapsed().as_secs_f64();
        let tracing = outcome.timings.trace_secs;
        plan.tell(apart);
        if has_planes {
            plan.keep_planes(result.is_ok().then(|| std::mem::take(&mut *lock(&apart.published))));
        }
        let (samples, result) = plan.end(number, block, if tracing > 0.0 { tracing } else { seconds }, result);
        if result.is_err() {
            // Everything that was made on the device is dropped.
            self.renderer = Renderer::default();
        }
        BlockEnd { number, samples, seconds, outcome, failure: result.err() }
    }
}
