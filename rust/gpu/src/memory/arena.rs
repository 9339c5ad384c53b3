// SPDX-License-Identifier: Apache-2.0
//! The arenas of a heap: big buffers and the bookkeeping of their ranges, also of those that are retired.
//!
//! Knows no policy but that an empty arena is kept; [`Heap`](crate::Heap) decides when arenas are made. Any thread.
//!
//! Locks: the list of arenas before an arena's own; neither is held while anything is dropped.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};

use offset_allocator::{Allocation, Allocator};

use crate::device::heap_counters::HeapCounters;
use crate::device::logical::LogicalDevice;
use crate::device::retire::RetireQueue;
use crate::instance::lane::TimelinePoints;
use crate::memory::block::MemoryBlock;

/// Unit of the range allocator in bytes. Its 32-bit units then reach 1 TiB, far above any `maxMemoryAllocationSize`.
pub(crate) const GRANULE: u64 = 256;
/// Most ranges in one arena; bounds the allocator's own tables (about 4 MiB).
const MAX_RANGES: u32 = 128 << 10;

/// One big buffer and the allocator of its ranges.
#[derive(Debug)]
pub(crate) struct MemoryArena {
    pub(crate) block: Arc<MemoryBlock>,
    /// Bytes at the start left unused so that every unit's address is a multiple of [`GRANULE`].
    skew: u64,
    pub(crate) bytes: u64,
    space: Mutex<ArenaSpace>,
    /// Those of its heap, as long as that lives.
    siblings: Weak<HeapArenas>,
    pub(crate) counters: Arc<HeapCounters>,
}

struct ArenaSpace {
    allocator: Allocator<u32>,
    used_bytes: u64,
    ranges: u32,
}

/// A place in an arena.
#[derive(Clone)]
pub(crate) struct ArenaPlace {
    pub(crate) arena: Arc<MemoryArena>,
    allocation: Allocation<u32>,
    bytes: u64,
}

/// The arenas of one heap.
#[derive(Debug)]
pub(crate) struct HeapArenas {
    device: Arc<LogicalDevice>,
    list: Mutex<Vec<Arc<MemoryArena>>>,
    /// Ranges that nobody holds any more; freed when the GPU is done with them.
    retired: RetireQueue<ArenaPlace>,
    pub(crate) counters: Arc<HeapCounters>,
    /// Empty arenas stay.
    keeps: bool,
}

/// How full an arena is, in bytes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ArenaUsage {
    pub(crate) used_bytes: u64,
    pub(crate) free_bytes: u64,
    /// Largest hole, rounded down to the allocator's size classes.
    pub(crate) largest_free: u64,
}

/// The largest size up to `bytes` (a multiple of [`GRANULE`]) that an empty arena of this size can give away as a
/// whole.
///
/// The allocator looks among holes that are surely large enough: it rounds requests up, and holes down, to sizes of
/// four significant bits (Aaltonen's `SmallFloat`), in units of [`GRANULE`].
pub(crate) fn size_class_below(bytes: u64) -> u64 {
    let units = bytes / GRANULE;
    let cut = u64::BITS.saturating_sub(units.leading_zeros()).saturating_sub(4);
    (units >> cut << cut) * GRANULE
}

impl MemoryArena {
    fn new(block: MemoryBlock, bytes: u64, heap: &Arc<HeapArenas>) -> Arc<Self> {
        let skew = block.raw.address.next_multiple_of(GRANULE) - block.raw.address;
        let units = u32::try_from((bytes - skew) / GRANULE).unwrap_or(u32::MAX);
        let allocator = Allocator::with_max_allocs(units, units.clamp(16, MAX_RANGES));
        let space = Mutex::new(ArenaSpace { allocator, used_bytes: 0, ranges: 0 });
        let (siblings, counters) = (Arc::downgrade(heap), Arc::clone(&heap.counters));
        Arc::new(Self { block: Arc::new(block), skew, bytes, space, siblings, counters })
    }

    fn lock(&self) -> MutexGuard<'_, ArenaSpace> {
        self.space.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A place of `bytes`, a multiple of [`GRANULE`]; None when there is no hole of that size.
    pub(crate) fn take(self: &Arc<Self>, bytes: u64) -> Option<ArenaPlace> {
        let units = u32::try_from(bytes / GRANULE).ok()?;
        let mut space = self.lock();
        let allocation = space.allocator.allocate(units)?;
        space.used_bytes += bytes;
        space.ranges += 1;
        Some(ArenaPlace { arena: Arc::clone(self), allocation, bytes })
    }

    /// Whether any range, retired ones included, is in it.
    pub(crate) fn holds_ranges(&self) -> bool {
        self.lock().ranges > 0
    }

    /// How full it is.
    pub(crate) fn usage(&self) -> ArenaUsage {
        let space = self.lock();
        let report = space.allocator.storage_report();
        ArenaUsage {
            used_bytes: space.used_bytes,
            free_bytes: u64::from(report.total_free_space) * GRANULE,
            largest_free: u64::from(report.largest_free_region) * GRANULE,
        }
    }
}

impl HeapArenas {
    /// None yet.
    pub(crate) fn new(device: &Arc<LogicalDevice>, counters: Arc<HeapCounters>, keeps: bool) -> Arc<Self> {
        let (device, list) = (Arc::clone(device), Mutex::new(Vec::new()));
        Arc::new(Self { device, list, retired: RetireQueue::new(), counters, keeps })
    }

    pub(crate) fn lock(&self) -> MutexGuard<'_, Vec<Arc<MemoryArena>>> {
        self.list.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A place in one of the arenas there are.
    pub(crate) fn take(&self, bytes: u64) -> Option<ArenaPlace> {
        self.lock().iter().find_map(|arena| arena.take(bytes))
    }

    /// Adds an arena of `bytes`, to be asked after the others, and gives a place in it before anybody else can.
    pub(crate) fn grow(self: &Arc<Self>, block: MemoryBlock, bytes: u64, place: u64) -> Option<ArenaPlace> {
        let arena = MemoryArena::new(block, bytes, self);
        let place = arena.take(place);
        self.lock().push(arena);
        place
    }

    /// Adds an arena of `bytes`, to be asked before the others.
    pub(crate) fn add_first(self: &Arc<Self>, block: MemoryBlock, bytes: u64) {
        let arena = MemoryArena::new(block, bytes, self);
        self.lock().insert(0, arena);
    }

    /// Frees a place after these submissions: at once if they have passed.
    fn retire(&self, points: TimelinePoints, place: ArenaPlace) {
        self.retired.push(points, place);
        self.release(self.device.completed());
    }

    /// Frees what is retired and waits for nothing after `completed`: nothing while the host looks at memory.
    pub(crate) fn release(&self, completed: TimelinePoints) {
        if self.retired.is_empty() || self.device.host_memory.has_views() {
            return;
        }
        let emptied: Vec<_> = self.retired.take_ready(completed).into_iter().filter_map(ArenaPlace::free).collect();
        if !emptied.is_empty() {
            drop(emptied);
            if !self.keeps {
                self.trim(1);
            }
        }
    }

    /// The points after which all that is retired now can go; None when nothing is.
    pub(crate) fn last_retired(&self) -> Option<TimelinePoints> {
        self.retired.last_points()
    }

    /// Lets go of arenas that hold nothing, all but `keep` of them.
    pub(crate) fn trim(&self, keep: usize) {
        let mut empty = Vec::new();
        let mut arenas = self.lock();
        arenas.retain(|arena| {
            let holds = arena.holds_ranges();
            if !holds {
                empty.push(Arc::clone(arena));
            }
            holds
        });
        let kept = keep.min(empty.len());
        arenas.extend(empty.drain(..kept));
        drop(arenas);
        for arena in &empty {
            // Every range in it has already waited for the GPU.
            arena.block.retire_after.set(TimelinePoints::START);
        }
    }
}

impl ArenaPlace {
    /// Its size in the arena.
    pub(crate) fn bytes(&self) -> u64 {
        self.bytes
    }

    /// First byte in the arena's buffer; its address is a multiple of [`GRANULE`].
    pub(crate) fn start(&self) -> u64 {
        self.arena.skew + u64::from(self.allocation.offset) * GRANULE
    }

    /// Gives the place back after these submissions. Each is retired once, by the drop of what is in it.
    pub(crate) fn retire(self, points: TimelinePoints) {
        match self.arena.siblings.upgrade() {
            Some(arenas) => arenas.retire(points, self),
            // Nothing is taken from it any more; its memory waits for the GPU by itself.
            None => drop(self.free()),
        }
    }

    /// Gives the place back, which the GPU no longer uses; the arena if it is empty now.
    fn free(self) -> Option<Arc<MemoryArena>> {
        let Self { arena, allocation, bytes } = self;
        let mut space = arena.lock();
        space.allocator.free(allocation);
        space.used_bytes -= bytes;
        space.ranges -= 1;
        let emptied = space.ranges == 0;
        drop(space);
        arena.counters.freed(bytes);
        emptied.then_some(arena)
    }
}

impl std::fmt::Debug for ArenaPlace {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Place")
            .field("unit", &self.allocation.offset)
            .field("bytes", &self.bytes)
            .finish_non_exhaustive()
    }
}

impl std::fmt::Debug for ArenaSpace {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Space")
            .field("used_bytes", &self.used_bytes)
            .field("ranges", &self.ranges)
            .finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_whole_arena_of_a_size_class_can_be_given_away() {
        for units in (1..3000).chain([4096, 100_003, 409_600, 1 << 20, (1 << 24) - 1]) {
            let class = size_class_below(units * GRANULE) / GRANULE;
            assert!(class <= units && class * 9 >= units * 8, "{units} units: {class}");
            let class = u32::try_from(class).expect("small");
            for request in [class, class - class / 20, 1] {
                let mut allocator: Allocator<u32> = Allocator::with_max_allocs(class, 16);
                assert!(allocator.allocate(request).is_some(), "{request} of {class} units");
            }
        }
    }
}
