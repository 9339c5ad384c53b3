// SPDX-License-Identifier: Apache-2.0
//! Objects that live as long as the work that uses them. Any thread.

use std::sync::Arc;

use crate::device::compute_pipeline::ComputePipeline;
use crate::memory::block::MemoryBlock;
use crate::memory::range_memory::RangeMemory;
use crate::memory::staging_part::StagingPart;

/// An object that lives as long as the work that uses it. It is held, never read.
#[derive(Debug)]
pub(crate) enum HeldResource {
    Block(#[expect(dead_code, reason = "held to keep it alive")] Arc<MemoryBlock>),
    Range(#[expect(dead_code, reason = "held to keep it alive")] Arc<RangeMemory>),
    Staging(Arc<StagingPart>),
    Pipeline(#[expect(dead_code, reason = "held to keep it alive")] Arc<ComputePipeline>),
}
