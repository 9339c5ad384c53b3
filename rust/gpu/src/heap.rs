// SPDX-License-Identifier: Apache-2.0
//! Device memory for many small and middling things: few big arenas, cut into ranges.
//!
//! Ranges are found by `offset-allocator` in units of [`GRANULE`] bytes. Arenas are made when needed, smaller ones when the budget
//! is short, and go back when empty (one is kept until [`Heap::trim`]). A request that would fill half an arena gets memory of its
//! own. Any thread.
//!
//! Locks: `HeapCore::arenas` before `Arena::space`; neither is held while memory is allocated or anything is dropped.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};

use offset_allocator::{Allocation, Allocator};

use crate::commands::Kept;
use crate::device::{Device, Retired};
use crate::error::GpuError;
use crate::gpu::Gpu;
use crate::memory::{Patience, Usage};
use crate::range::sealed::{Parts, RangeParts};
use crate::range::{Block, DeviceRange, RetirePoint};

/// Unit of the range allocator in bytes. Its 32-bit units then reach 1 TiB, far above any `maxMemoryAllocationSize`.
const GRANULE: u64 = 256;
/// Smallest arena that is worth having when the budget is short.
const SMALLEST_ARENA: u64 = 64 << 10;
/// Most ranges in one arena; bounds the allocator's own tables (about 4 MiB).
const MAX_RANGES: u32 = 128 << 10;

/// Device memory cut into ranges. Dropping it leaves its ranges valid.
#[derive(Debug)]
pub struct Heap {
    core: Arc<HeapCore>,
}

/// How full a heap is. Bytes of ranges include rounding to 256 bytes and what is retired but still in use by the GPU.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct HeapStats {
    /// Number of shared arenas.
    pub arenas: u32,
    /// Bytes of all shared arenas.
    pub arena_bytes: u64,
    /// Bytes of ranges in shared arenas.
    pub used_bytes: u64,
    /// Bytes of ranges with memory of their own.
    pub dedicated_bytes: u64,
    /// Largest range (to the precision of the allocator's size classes) that fits without a new arena.
    pub largest_free: u64,
    /// 1 - largest free stretch / all free bytes: 0 = all free space is in one piece.
    pub fragmentation: f64,
}

/// What ranges and the device need of a heap.
#[derive(Debug)]
pub(crate) struct HeapCore {
    device: Arc<Device>,
    name: String,
    arena_bytes: u64,
    arenas: Mutex<Vec<Arc<Arena>>>,
    dedicated_bytes: Arc<AtomicU64>,
}

/// One big buffer and the allocator of its ranges.
#[derive(Debug)]
struct Arena {
    block: Arc<Block>,
    /// Bytes at the start left unused so that every unit's address is a multiple of [`GRANULE`].
    skew: u64,
    bytes: u64,
    space: Mutex<Space>,
    heap: Weak<HeapCore>,
}

struct Space {
    allocator: Allocator<u32>,
    used_bytes: u64,
    ranges: u32,
}

/// A place in an arena.
#[derive(Clone)]
struct Place {
    arena: Arc<Arena>,
    allocation: Allocation<u32>,
    bytes: u64,
}

/// A range that nobody holds any more; freed when the GPU is done with it.
#[derive(Debug)]
pub(crate) struct RetiredRange(Place);

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
}

#[derive(Debug)]
enum Owner {
    Arena(Place),
    /// The block is the range's own; its bytes are counted here.
    Dedicated { counter: Arc<AtomicU64>, bytes: u64 },
}

impl Heap {
    /// A usual size of arenas.
    pub const DEFAULT_ARENA_BYTES: u64 = 256 << 20;

    /// Makes an empty heap; memory is taken by the first [`Heap::alloc`]. `arena_bytes` is bounded to what the driver allows in one
    /// piece.
    ///
    /// # Errors
    /// [`GpuError::DeviceLost`].
    pub fn new(gpu: &Arc<Gpu>, name: &str, arena_bytes: u64) -> Result<Self, GpuError> {
        let device = gpu.device();
        device.check_alive()?;
        let most = device.limits.max_allocation_bytes.max(SMALLEST_ARENA) / GRANULE * GRANULE;
        let core = Arc::new(HeapCore {
            device: Arc::clone(device),
            name: name.to_owned(),
            arena_bytes: (arena_bytes / GRANULE * GRANULE).clamp(SMALLEST_ARENA, most),
            arenas: Mutex::new(Vec::new()),
            dedicated_bytes: Arc::new(AtomicU64::new(0)),
        });
        device.heaps.lock().unwrap_or_else(PoisonError::into_inner).push(Arc::downgrade(&core));
        Ok(Self { core })
    }

    /// Takes `bytes` at an address that is a multiple of `align` (a power of two). The bytes are arbitrary.
    ///
    /// # Errors
    /// [`GpuError::OutOfMemory`] when neither the arenas nor the budget have room even after waiting for what is retired,
    /// [`GpuError::TooLarge`], [`GpuError::Usage`] for a bad alignment, [`GpuError::DeviceLost`].
    pub fn alloc(&self, name: &str, bytes: u64, align: u64) -> Result<HeapRange, GpuError> {
        let core = &self.core;
        core.device.check_alive()?;
        core.device.budget.injected_failure(name, bytes)?;
        if !align.is_power_of_two() {
            let message = format!("alignment {align} is not a power of two");
            return Err(GpuError::Usage { name: name.to_owned(), message });
        }
        // Within an arena units are aligned already; a larger alignment is met by moving up inside a longer place.
        let padding = if align > GRANULE { align } else { 0 };
        let needed = bytes.max(1).checked_add(padding).and_then(|n| n.checked_next_multiple_of(GRANULE));
        if let Some(needed) = needed.filter(|&needed| needed <= core.arena_bytes / 2) {
            if let Some(place) = core.take(needed) {
                return Ok(HeapRange::in_arena(place, name, bytes, align));
            }
            if let Some(place) = core.grow(needed)? {
                return Ok(HeapRange::in_arena(place, name, bytes, align));
            }
            core.device.reclaim(Patience::WaitForRetired)?;
            if let Some(place) = core.take(needed) {
                return Ok(HeapRange::in_arena(place, name, bytes, align));
            }
            if let Some(place) = core.grow(needed)? {
                return Ok(HeapRange::in_arena(place, name, bytes, align));
            }
        }
        core.dedicated(name, bytes, align)
    }

    /// How full the heap is now.
    #[must_use]
    pub fn stats(&self) -> HeapStats {
        self.core.device.collect();
        let mut stats =
            HeapStats { dedicated_bytes: self.core.dedicated_bytes.load(Ordering::Relaxed), ..HeapStats::default() };
        let mut free = 0;
        for arena in self.core.lock().iter() {
            let space = arena.lock();
            let report = space.allocator.storage_report();
            stats.arenas += 1;
            stats.arena_bytes += arena.bytes;
            stats.used_bytes += space.used_bytes;
            stats.largest_free = stats.largest_free.max(u64::from(report.largest_free_region) * GRANULE);
            free += u64::from(report.total_free_space) * GRANULE;
        }
        if free > 0 {
            stats.fragmentation = 1.0 - stats.largest_free as f64 / free as f64;
        }
        stats
    }

    /// Gives arenas that hold nothing back to the budget.
    pub fn trim(&self) {
        self.core.device.collect();
        self.core.trim(0);
    }
}

impl HeapCore {
    fn lock(&self) -> MutexGuard<'_, Vec<Arc<Arena>>> {
        self.arenas.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A place in one of the arenas there are.
    fn take(&self, bytes: u64) -> Option<Place> {
        self.lock().iter().find_map(|arena| arena.take(bytes))
    }

    /// A place in a new arena, a smaller one if the budget is short; None when even a small one does not fit now.
    fn grow(self: &Arc<Self>, bytes: u64) -> Result<Option<Place>, GpuError> {
        let mut size = self.arena_bytes;
        while size / 2 >= bytes && size >= SMALLEST_ARENA {
            match self.device.allocate(&self.name, size, Usage::Device, Patience::Now) {
                Ok(raw) => {
                    let arena = Arena::new(Block::new(&self.device, raw), size, Arc::downgrade(self));
                    let place = arena.take(bytes);
                    self.lock().push(arena);
                    return Ok(place);
                }
                Err(GpuError::OutOfMemory { .. }) => size = size / 2 / GRANULE * GRANULE,
                Err(error) => return Err(error),
            }
        }
        Ok(None)
    }

    /// A range with memory of its own.
    fn dedicated(&self, name: &str, bytes: u64, align: u64) -> Result<HeapRange, GpuError> {
        // Drivers align memory generously, but Vulkan promises nothing about addresses: leave room to move up.
        let room = if align > 1 { align } else { 0 };
        let padded = bytes.checked_add(room).ok_or_else(|| GpuError::TooLarge {
            name: name.to_owned(),
            bytes,
            limit: self.device.limits.max_allocation_bytes,
        })?;
        let raw = self.device.allocate(name, padded, Usage::Device, Patience::WaitForRetired)?;
        self.dedicated_bytes.fetch_add(padded, Ordering::Relaxed);
        let owner = Owner::Dedicated { counter: Arc::clone(&self.dedicated_bytes), bytes: padded };
        let offset = raw.address.next_multiple_of(align) - raw.address;
        Ok(HeapRange::new(Arc::new(Block::new(&self.device, raw)), owner, offset, (name, bytes)))
    }

    /// Lets go of arenas that hold nothing, all but `keep` of them.
    pub(crate) fn trim(&self, keep: usize) {
        let mut empty = Vec::new();
        let mut arenas = self.lock();
        arenas.retain(|arena| {
            let holds = arena.lock().ranges > 0;
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
            arena.block.retire_after.set(0);
        }
    }
}

impl Arena {
    fn new(block: Block, bytes: u64, heap: Weak<HeapCore>) -> Arc<Self> {
        let skew = block.raw.address.next_multiple_of(GRANULE) - block.raw.address;
        let units = u32::try_from((bytes - skew) / GRANULE).unwrap_or(u32::MAX);
        let allocator = Allocator::with_max_allocs(units, units.clamp(16, MAX_RANGES));
        let space = Mutex::new(Space { allocator, used_bytes: 0, ranges: 0 });
        Arc::new(Self { block: Arc::new(block), skew, bytes, space, heap })
    }

    fn lock(&self) -> MutexGuard<'_, Space> {
        self.space.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn take(self: &Arc<Self>, bytes: u64) -> Option<Place> {
        let units = u32::try_from(bytes / GRANULE).ok()?;
        let mut space = self.lock();
        let allocation = space.allocator.allocate(units)?;
        space.used_bytes += bytes;
        space.ranges += 1;
        Some(Place { arena: Arc::clone(self), allocation, bytes })
    }
}

impl RetiredRange {
    /// Gives the range back to its arena. Each range is retired once, by the drop of its `RangeInner`.
    pub(crate) fn free(self) {
        let Place { arena, allocation, bytes } = self.0;
        let mut space = arena.lock();
        space.allocator.free(allocation);
        space.used_bytes -= bytes;
        space.ranges -= 1;
        let emptied = space.ranges == 0;
        drop(space);
        if emptied && let Some(heap) = arena.heap.upgrade() {
            heap.trim(1);
        }
    }
}

impl HeapRange {
    fn new(block: Arc<Block>, owner: Owner, offset: u64, (name, size): (&str, u64)) -> Self {
        let name = name.to_owned();
        Self { inner: Arc::new(RangeInner { block, offset, size, name, owner, retire_after: RetirePoint::new() }) }
    }

    fn in_arena(place: Place, name: &str, size: u64, align: u64) -> Self {
        let arena = Arc::clone(&place.arena);
        let base = arena.block.raw.address;
        let start = arena.skew + u64::from(place.allocation.offset) * GRANULE;
        let offset = (base + start).next_multiple_of(align) - base;
        Self::new(Arc::clone(&arena.block), Owner::Arena(place), offset, (name, size))
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
        let point = self.inner.block.device.queue.last_submitted();
        match self.inner.owner {
            Owner::Arena(_) => self.inner.retire_after.set(point),
            Owner::Dedicated { .. } => self.inner.block.retire_after.set(point),
        }
    }
}

impl Drop for RangeInner {
    fn drop(&mut self) {
        let device = &self.block.device;
        match &self.owner {
            Owner::Arena(place) => {
                let retired = Retired::Range(RetiredRange(place.clone()));
                device.retire(self.retire_after.get(device), retired);
            }
            Owner::Dedicated { counter, bytes } => {
                counter.fetch_sub(*bytes, Ordering::Relaxed);
            }
        }
    }
}

impl std::fmt::Debug for Place {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Place").field("unit", &self.allocation.offset).field("bytes", &self.bytes).finish_non_exhaustive()
    }
}

impl std::fmt::Debug for Space {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Space").field("used_bytes", &self.used_bytes).field("ranges", &self.ranges).finish_non_exhaustive()
    }
}
