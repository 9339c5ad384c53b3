// SPDX-License-Identifier: Apache-2.0
//! What lives as long as the work that uses it. Any thread.

use std::sync::Arc;

use crate::device::compute_pipeline::ComputePipeline;
use crate::memory::block::MemoryBlock;
use crate::memory::range_memory::RangeMemory;
use crate::memory::staging_part::StagingPart;

/// Something that lives as long as the work that uses it. Held, never read.
#[derive(Debug)]
pub(crate) enum HeldResource {
    Block(#[expect(dead_code, reason = "held to keep it alive")] Arc<MemoryBlock>),
    Range(#[expect(dead_code, reason = "held to keep it alive")] Arc<RangeMemory>),
    Staging(Arc<StagingPart>),
    Pipeline(#[expect(dead_code, reason = "held to keep it alive")] Arc<ComputePipeline>),
}
