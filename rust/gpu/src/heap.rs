// SPDX-License-Identifier: Apache-2.0
//! Device memory for many small and middling things: few big arenas, cut into ranges.
//!
//! Ranges are found by `offset-allocator` in units of 256 bytes. Arenas are made when needed, smaller ones when the budget
//! is short, and go back when empty (one is kept until [`Heap::trim`]). A request that would fill half an arena gets memory of its
//! own. Any thread.
//!
//! Locks: the list of arenas before an arena's own; neither is held while memory is allocated or anything is dropped.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::arena::{Arena, GRANULE, Place, RetiredRange};
use crate::commands::Kept;
use crate::device::{Device, Retired};
use crate::error::GpuError;
use crate::gpu::Gpu;
use crate::lane::Points;
use crate::memory::{Patience, Usage};
use crate::range::sealed::{Parts, RangeParts};
use crate::range::{Block, DeviceRange, RetirePoint};

/// Smallest arena that is worth having when the budget is short.
const SMALLEST_ARENA: u64 = 64 << 10;
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
    Dedicated {
        counter: Arc<AtomicU64>,
        bytes: u64,
    },
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
            let part = arena.usage();
            stats.arenas += 1;
            stats.arena_bytes += arena.bytes;
            stats.used_bytes += part.used_bytes;
            stats.largest_free = stats.largest_free.max(part.largest_free);
            free += part.free_bytes;
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
            arena.block.retire_after.set(Points::START);
        }
    }
}

impl HeapRange {
    fn new(block: Arc<Block>, owner: Owner, offset: u64, (name, size): (&str, u64)) -> Self {
        let name = name.to_owned();
        Self { inner: Arc::new(RangeInner { block, offset, size, name, owner, retire_after: RetirePoint::default() }) }
    }

    fn in_arena(place: Place, name: &str, size: u64, align: u64) -> Self {
        let arena = Arc::clone(&place.arena);
        let base = arena.block.raw.address;
        let offset = (base + place.start()).next_multiple_of(align) - base;
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
        let point = self.inner.block.device.submitted();
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
