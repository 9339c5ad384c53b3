// SPDX-License-Identifier: Apache-2.0
//! The memory of a heap's range, which command lists can keep alive: a place in an arena, or a block of its own. Any
//! thread.

use std::sync::Arc;

use crate::arena::Place;
use crate::block::{Block, RetirePoint};
use crate::heap_counters::HeapCounters;

/// The memory of a range, retired when the last holder drops it.
#[derive(Debug)]
pub(crate) struct RangeMemory {
    pub(crate) block: Arc<Block>,
    pub(crate) offset: u64,
    pub(crate) size: u64,
    pub(crate) name: String,
    owner: Owner,
    retire_after: RetirePoint,
    /// Where the range is counted, and as how many bytes.
    counters: Arc<HeapCounters>,
    counted: u64,
}

#[derive(Debug)]
enum Owner {
    Arena(Place),
    /// The block is the range's own.
    Dedicated,
}

impl RangeMemory {
    /// A range in a place of an arena.
    pub(crate) fn in_arena(place: Place, name: &str, size: u64, align: u64) -> Arc<Self> {
        let arena = Arc::clone(&place.arena);
        let base = arena.block.raw.address;
        let offset = (base + place.start()).next_multiple_of(align) - base;
        let (counters, counted) = (Arc::clone(&arena.counters), place.bytes());
        Self {
            block: Arc::clone(&arena.block),
            offset,
            size,
            name: name.to_owned(),
            owner: Owner::Arena(place),
            retire_after: RetirePoint::default(),
            counters,
            counted,
        }
        .made()
    }

    /// A range with a block of its own, whose `counted` bytes have room to move up to `align`.
    pub(crate) fn in_block(
        block: Block,
        (name, size, align): (&str, u64, u64),
        (counters, counted): (&Arc<HeapCounters>, u64),
    ) -> Arc<Self> {
        let offset = block.raw.address.next_multiple_of(align) - block.raw.address;
        Self {
            block: Arc::new(block),
            offset,
            size,
            name: name.to_owned(),
            owner: Owner::Dedicated,
            retire_after: RetirePoint::default(),
            counters: Arc::clone(counters),
            counted,
        }
        .made()
    }

    fn made(self) -> Arc<Self> {
        self.counters.made(self.counted);
        Arc::new(self)
    }

    /// Says that nothing submitted from now on uses it by its address.
    pub(crate) fn released(&self) {
        self.counters.retire(self.counted);
        let points = self.block.device.submitted();
        match self.owner {
            Owner::Arena(_) => self.retire_after.set(points),
            Owner::Dedicated => self.block.retire_after.set(points),
        }
    }
}

impl Drop for RangeMemory {
    fn drop(&mut self) {
        // A block of its own retires by itself.
        if let Owner::Arena(place) = &self.owner {
            place.clone().retire(self.retire_after.get(&self.block.device));
        }
    }
}
