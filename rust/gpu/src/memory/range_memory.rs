// SPDX-License-Identifier: Apache-2.0
//! The memory of a heap's range, which command lists can keep alive: a place in an arena, or a block of its own. Any
//! thread.

use std::sync::{Arc, Mutex, PoisonError};

use crate::device::heap_counters::HeapCounters;
use crate::error::GpuError;
use crate::memory::arena::ArenaPlace;
use crate::memory::block::{MemoryBlock, RetirePoint};

/// The memory of a range, retired when the last holder drops it.
#[derive(Debug)]
pub(crate) struct RangeMemory {
    pub(crate) block: Arc<MemoryBlock>,
    pub(crate) offset: u64,
    pub(crate) size: u64,
    pub(crate) name: String,
    owner: RangeOwner,
    retire_after: RetirePoint,
    /// Where the range is counted, and as how many bytes.
    counters: Arc<HeapCounters>,
    counted: u64,
    /// Host threads take turns on the bytes.
    host: Mutex<()>,
}

#[derive(Debug)]
enum RangeOwner {
    Arena(ArenaPlace),
    /// The block is the range's own.
    Dedicated,
}

impl RangeMemory {
    /// A range in a place of an arena.
    pub(crate) fn in_arena(place: ArenaPlace, name: &str, size: u64, align: u64) -> Arc<Self> {
        let arena = Arc::clone(&place.arena);
        let base = arena.block.raw.address;
        let offset = (base + place.start()).next_multiple_of(align) - base;
        let (counters, counted) = (Arc::clone(&arena.counters), place.bytes());
        Self {
            block: Arc::clone(&arena.block),
            offset,
            size,
            name: name.to_owned(),
            owner: RangeOwner::Arena(place),
            retire_after: RetirePoint::default(),
            counters,
            counted,
            host: Mutex::new(()),
        }
        .made()
    }

    /// A range with a block of its own, whose `counted` bytes have room to move up to `align`.
    pub(crate) fn in_block(
        block: MemoryBlock,
        (name, size, align): (&str, u64, u64),
        (counters, counted): (&Arc<HeapCounters>, u64),
    ) -> Arc<Self> {
        let offset = block.raw.address.next_multiple_of(align) - block.raw.address;
        Self {
            block: Arc::new(block),
            offset,
            size,
            name: name.to_owned(),
            owner: RangeOwner::Dedicated,
            retire_after: RetirePoint::default(),
            counters: Arc::clone(counters),
            counted,
            host: Mutex::new(()),
        }
        .made()
    }

    /// See [`DeviceRange::fill`](crate::DeviceRange::fill).
    pub(crate) fn fill(&self, offset: u64, bytes: usize, fill: &mut dyn FnMut(&mut [u8])) -> Result<bool, GpuError> {
        let Some(mapped) = self.block.raw.mapped else { return Ok(false) };
        let fits = offset.checked_add(bytes as u64).is_some_and(|end| end <= self.size);
        let start = usize::try_from(self.offset.saturating_add(offset)).ok().filter(|_| fits);
        let Some(start) = start else {
            let message = format!("{bytes} bytes at {offset} do not fit in {} bytes", self.size);
            return Err(GpuError::Usage { name: self.name.clone(), message });
        };
        let _exclusive = self.host.lock().unwrap_or_else(PoisonError::into_inner);
        // SAFETY: the range is within its block, which is mapped as long as it lives, and `bytes` from `start` on are
        // within the range.
        let at = unsafe { mapped.as_ptr().add(start) };
        // SAFETY: as above; ranges do not overlap, and the lock makes this the only reference into this one.
        fill(unsafe { std::slice::from_raw_parts_mut(at, bytes) });
        Ok(true)
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
            RangeOwner::Arena(_) => self.retire_after.set(points),
            RangeOwner::Dedicated => self.block.retire_after.set(points),
        }
    }
}

impl Drop for RangeMemory {
    fn drop(&mut self) {
        // A block of its own retires by itself.
        if let RangeOwner::Arena(place) = &self.owner {
            place.clone().retire(self.retire_after.get(&self.block.device));
        }
    }
}
