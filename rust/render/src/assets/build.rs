// SPDX-License-Identifier: Apache-2.0
//! Builds the trees over instance records on the device, many at a time: steps of independent trees share a barrier
//! interval.

use crate::device::{Device, Specialisation};
use crate::error::RenderError;
use oocpt_core::residency::AssetId;
use oocpt_gpu::{Buffer, HeapRange, Submission, Usage};
use oocpt_shader_abi::{LbvhJob, LbvhStep, lbvh_steps};
use std::sync::Arc;
use std::time::Duration;

/// Most trees of one batch.
pub(crate) const MOST_BUILDS: usize = 256;
/// How long a batch may take before the device counts as lost.
const BUILD_TIMEOUT: Duration = Duration::from_secs(120);

/// One tree of a batch.
#[derive(Debug)]
pub(crate) struct Build {
    pub(crate) asset: AssetId,
    pub(crate) job: LbvhJob,
    pub(crate) memory: Arc<HeapRange>,
    /// Boxes and scratch memory.
    pub(crate) workspace: Arc<HeapRange>,
    /// Copies that bring the boxes.
    pub(crate) copies: Vec<Submission>,
}

/// A batch under way.
#[derive(Debug)]
pub(crate) struct Batch {
    submission: Submission,
    assets: Vec<AssetId>,
}

/// Where builds leave the depths of their trees.
#[derive(Debug)]
pub(crate) struct Builder {
    depths: Buffer,
    batch: Option<Batch>,
}

impl Builder {
    pub(crate) fn new(device: &Device) -> Result<Self, RenderError> {
        let bytes = 4 * MOST_BUILDS as u64;
        Ok(Self { depths: Buffer::new(&device.gpu, "instance tree depths", bytes, Usage::Readback)?, batch: None })
    }

    /// Where tree `index` of a batch leaves its depth.
    pub(crate) fn depth_address(&self, index: usize) -> u64 {
        self.depths.address() + 4 * index as u64
    }

    /// Whether a batch is under way.
    pub(crate) fn is_busy(&self) -> bool {
        self.batch.is_some()
    }

    /// Submits a batch; only when none is under way.
    pub(crate) fn submit(&mut self, device: &Device, builds: Vec<Build>) -> Result<(), RenderError> {
        let plain = Specialisation { max_levels: 1, stack_size: 1, ..Specialisation::default() };
        let mut commands = device.gpu.commands("build instance levels")?;
        let steps: Vec<Vec<LbvhStep>> = builds.iter().map(|build| lbvh_steps(&build.job)).collect();
        for build in &builds {
            for copy in &build.copies {
                commands.wait_for(copy);
            }
            commands.keep(&*build.memory);
            commands.keep(&*build.workspace);
        }
        let longest = steps.iter().map(Vec::len).max().unwrap_or(0);
        for at in 0..longest {
            let mut pipelines = Vec::with_capacity(steps.len());
            for step in steps.iter().filter_map(|steps| steps.get(at)) {
                pipelines.push((device.pipeline(step.module, plain)?, step));
            }
            commands.concurrent(|c| {
                for (pipeline, step) in &pipelines {
                    c.dispatch(pipeline, bytemuck::bytes_of(&step.push), step.groups);
                }
            });
        }
        let assets = builds.iter().map(|build| build.asset).collect();
        self.batch = Some(Batch { submission: commands.submit()?, assets });
        Ok(())
    }

    /// The depths of the trees of the batch that has ended; empty while it is under way. With `wait`, waits for it.
    pub(crate) fn finished(&mut self, wait: bool) -> Result<Vec<(AssetId, u32)>, RenderError> {
        let Some(batch) = &self.batch else { return Ok(Vec::new()) };
        if !wait && !batch.submission.is_done() {
            return Ok(Vec::new());
        }
        if !batch.submission.wait(BUILD_TIMEOUT)? {
            return Err(RenderError::Internal("building the instance levels did not finish".into()));
        }
        let mut finished = Vec::with_capacity(batch.assets.len());
        for (index, asset) in batch.assets.iter().enumerate() {
            let mut depth = [0_u8; 4];
            self.depths.read(4 * index as u64, &mut depth)?;
            finished.push((*asset, u32::from_ne_bytes(depth)));
        }
        self.batch = None;
        Ok(finished)
    }
}
