// SPDX-License-Identifier: Apache-2.0
//! A stretch of a heap's memory: a place in an arena, or memory of its own. Any thread.

use std::sync::Arc;

use crate::arena::{Place, RetiredRange};
use crate::commands::Kept;
use crate::device::Retired;
use crate::heap_counters::HeapCounters;
use crate::range::sealed::{Parts, RangeParts};
use crate::range::{Block, DeviceRange, RetirePoint};

/// A stretch of device memory. Dropping it does not wait; see [`Buffer`](crate::Buffer).
#[derive(Debug)]
pub struct HeapRange {
    inner: Arc<RangeInner>,
}

/// The range itself, kept alive by command lists too.
#[derive(Debug)]
pub(crate) struct RangeInner {
    block: Arc<Block>,
    offset: u64,
    size: u64,
    name: String,
    owner: Owner,
    retire_after: RetirePoint,
    /// Where the range is counted, and as how many bytes.
    counters: Arc<HeapCounters>,
    counted: u64,
}

#[derive(Debug)]
pub(crate) enum Owner {
    Arena(Place),
    /// The block is the range's own.
    Dedicated,
}

impl HeapRange {
    /// A range in a place of an arena.
    pub(crate) fn in_arena(place: Place, name: &str, size: u64, align: u64) -> Self {
        let arena = Arc::clone(&place.arena);
        let base = arena.block.raw.address;
        let offset = (base + place.start()).next_multiple_of(align) - base;
        let (counters, counted) = (Arc::clone(&arena.counters), place.bytes());
        Self::new(RangeInner {
            block: Arc::clone(&arena.block),
            offset,
            size,
            name: name.to_owned(),
            owner: Owner::Arena(place),
            retire_after: RetirePoint::default(),
            counters,
            counted,
        })
    }

    /// A range with a block of its own, whose `counted` bytes have room to move up to `align`.
    pub(crate) fn in_block(
        block: Block,
        (name, size, align): (&str, u64, u64),
        (counters, counted): (&Arc<HeapCounters>, u64),
    ) -> Self {
        let offset = block.raw.address.next_multiple_of(align) - block.raw.address;
        Self::new(RangeInner {
            block: Arc::new(block),
            offset,
            size,
            name: name.to_owned(),
            owner: Owner::Dedicated,
            retire_after: RetirePoint::default(),
            counters: Arc::clone(counters),
            counted,
        })
    }

    fn new(inner: RangeInner) -> Self {
        inner.counters.made(inner.counted);
        Self { inner: Arc::new(inner) }
    }

    /// Device address of the first byte.
    #[must_use]
    pub fn address(&self) -> u64 {
        self.inner.block.raw.address + self.inner.offset
    }

    /// Size in bytes, as asked for.
    #[must_use]
    pub fn size(&self) -> u64 {
        self.inner.size
    }

    /// The name it was made with.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.inner.name
    }
}

impl DeviceRange for HeapRange {
    fn address(&self) -> u64 {
        Self::address(self)
    }

    fn size(&self) -> u64 {
        self.inner.size
    }

    fn name(&self) -> &str {
        &self.inner.name
    }
}

impl Parts for HeapRange {
    fn parts(&self) -> RangeParts {
        RangeParts {
            buffer: self.inner.block.buffer(),
            offset: self.inner.offset,
            device: Arc::as_ptr(&self.inner.block.device),
            kept: Kept::Range(Arc::clone(&self.inner)),
        }
    }
}

impl Drop for HeapRange {
    fn drop(&mut self) {
        let inner = &self.inner;
        inner.counters.retire(inner.counted);
        let points = inner.block.device.submitted();
        match inner.owner {
            Owner::Arena(_) => inner.retire_after.set(points),
            Owner::Dedicated => inner.block.retire_after.set(points),
        }
    }
}

impl Drop for RangeInner {
    fn drop(&mut self) {
        let device = &self.block.device;
        // A block of its own retires by itself.
        if let Owner::Arena(place) = &self.owner {
            let retired = Retired::Range(RetiredRange(place.clone()));
            device.retire(self.retire_after.get(device), retired);
        }
    }
}
