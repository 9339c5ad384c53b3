// SPDX-License-Identifier: Apache-2.0
//! A stretch of a heap's memory: a place in an arena, or memory of its own. Any thread.

use std::sync::Arc;

use crate::error::GpuError;
use crate::memory::range_memory::RangeMemory;
use crate::range::DeviceRange;
use crate::range::sealed::{RangeParts, ToRangeParts};
use crate::submit::kept::HeldResource;

/// A stretch of device memory. Dropping it does not wait; see [`Buffer`](crate::Buffer).
#[derive(Debug)]
pub struct HeapRange {
    memory: Arc<RangeMemory>,
}

impl HeapRange {
    pub(crate) fn new(memory: Arc<RangeMemory>) -> Self {
        Self { memory }
    }

    /// Device address of the first byte.
    #[must_use]
    pub fn address(&self) -> u64 {
        self.memory.block.raw.address + self.memory.offset
    }

    /// Size in bytes, as asked for.
    #[must_use]
    pub fn size(&self) -> u64 {
        self.memory.size
    }

    /// The name it was made with.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.memory.name
    }
}

impl DeviceRange for HeapRange {
    fn address(&self) -> u64 {
        Self::address(self)
    }

    fn size(&self) -> u64 {
        self.memory.size
    }

    fn name(&self) -> &str {
        &self.memory.name
    }

    fn fill(&self, offset: u64, bytes: usize, fill: &mut dyn FnMut(&mut [u8])) -> Result<bool, GpuError> {
        self.memory.fill(offset, bytes, fill)
    }
}

impl ToRangeParts for HeapRange {
    fn parts(&self) -> RangeParts {
        RangeParts {
            buffer: self.memory.block.buffer(),
            offset: self.memory.offset,
            device: Arc::as_ptr(&self.memory.block.device),
            kept: HeldResource::Range(Arc::clone(&self.memory)),
        }
    }
}

impl Drop for HeapRange {
    fn drop(&mut self) {
        self.memory.released();
    }
}
