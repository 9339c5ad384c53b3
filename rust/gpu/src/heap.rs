// SPDX-License-Identifier: Apache-2.0
//! Memory for many small and medium things: few big arenas, cut into ranges. It is the device's own memory, or memory
//! of the host that the device reaches across the bus.
//!
//! Ranges are found by `offset-allocator` in units of 256 bytes. Arenas are made when needed, smaller ones when the
//! budget is short, and go back when empty (one is kept until [`Heap::trim`], with [`HeapOptions::keeps_arenas`] all).
//! A request that would fill half an arena (a whole one, with [`HeapOptions::whole_arenas`]) gets memory of its own.
//! Any thread.

use std::sync::Arc;

use crate::device::heap_counters::HeapCounters;
use crate::error::GpuError;
use crate::gpu::Gpu;
use crate::heap_range::HeapRange;
use crate::instance::memory_type::BufferUsage;
use crate::memory::arena::{ArenaPlace, GRANULE, HeapArenas, size_class_below};
use crate::memory::block::MemoryBlock;
use crate::memory::range_memory::RangeMemory;
use crate::submit::open_device::{BudgetWait, OpenDevice};

/// Size of the smallest arena that is worth having if the budget is short.
const MIN_ARENA_BYTES: u64 = 64 << 10;

/// Device memory cut into ranges. Dropping it leaves its ranges valid.
#[derive(Debug)]
pub struct Heap {
    opened: Arc<OpenDevice>,
    name: String,
    usage: BufferUsage,
    arena_bytes: u64,
    /// Bytes above which a request gets memory of its own.
    largest_shared: u64,
    arenas: Arc<HeapArenas>,
}

/// Options of a heap.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HeapOptions {
    /// Size of an arena, limited to what the driver allows in one piece.
    pub arena_bytes: u64,
    /// True if requests of up to a whole arena are served from arenas, not only those of up to half of one. The size of
    /// arenas is rounded down by up to an eighth, so that the range allocator finds a whole one; see
    /// [`Heap::largest_shared`].
    pub whole_arenas: bool,
    /// Most bytes of memory that this heap may hold, besides the device's budget; `None` = no limit of its own.
    pub limit_bytes: Option<u64>,
    /// Kind of memory: [`BufferUsage::Device`], or another usage for memory of the host, which the device's budget does
    /// not count.
    pub usage: BufferUsage,
    /// True if empty arenas are kept until [`Heap::trim`]: for memory that is slow to allocate.
    pub keeps_arenas: bool,
}

impl Default for HeapOptions {
    fn default() -> Self {
        Self {
            arena_bytes: Heap::DEFAULT_ARENA_BYTES,
            whole_arenas: false,
            limit_bytes: None,
            usage: BufferUsage::Device,
            keeps_arenas: false,
        }
    }
}

/// Usage of a heap. Bytes of ranges include rounding to 256 bytes and retired ranges that the GPU still uses.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct HeapStats {
    /// Number of shared arenas.
    pub arenas: u32,
    /// Bytes of all shared arenas.
    pub arena_bytes: u64,
    /// Bytes of ranges in shared arenas.
    pub used_bytes: u64,
    /// Bytes of all ranges that have an owner.
    pub live_bytes: u64,
    /// Bytes of all ranges that were dropped, but that the GPU may still use.
    pub retired_bytes: u64,
    /// Bytes of ranges with memory of their own.
    pub dedicated_bytes: u64,
    /// Largest range (to the precision of the allocator's size classes) that fits without a new arena.
    pub largest_free: u64,
    /// 1 - largest free piece / all free bytes: 0 = all free space is in one piece.
    pub fragmentation: f64,
}

impl Heap {
    /// Default size of arenas.
    pub const DEFAULT_ARENA_BYTES: u64 = 256 << 20;

    /// Creates an empty heap; the first [`Heap::alloc`] allocates memory. `arena_bytes` is limited to what the driver
    /// allows in one piece.
    ///
    /// # Errors
    /// [`GpuError::DeviceLost`].
    pub fn new(gpu: &Arc<Gpu>, name: &str, arena_bytes: u64) -> Result<Self, GpuError> {
        Self::with_options(gpu, name, HeapOptions { arena_bytes, ..HeapOptions::default() })
    }

    /// Creates an empty heap; the first [`Heap::alloc`] allocates memory.
    ///
    /// # Errors
    /// [`GpuError::DeviceLost`].
    pub fn with_options(gpu: &Arc<Gpu>, name: &str, options: HeapOptions) -> Result<Self, GpuError> {
        let (opened, device) = (gpu.opened(), gpu.device());
        device.check_alive()?;
        let most = device.limits.max_allocation_bytes.max(MIN_ARENA_BYTES) / GRANULE * GRANULE;
        let mut arena_bytes = (options.arena_bytes / GRANULE * GRANULE).clamp(MIN_ARENA_BYTES, most);
        let mut largest_shared = arena_bytes / 2;
        if options.whole_arenas {
            arena_bytes = size_class_below(arena_bytes);
            largest_shared = arena_bytes;
        }
        let arenas = HeapArenas::new(device, HeapCounters::new(options.limit_bytes), options.keeps_arenas);
        opened.add_heap(&arenas);
        let (opened, name) = (Arc::clone(opened), name.to_owned());
        Ok(Self { opened, name, usage: options.usage, arena_bytes, largest_shared, arenas })
    }

    /// Takes `bytes` at an address that is a multiple of `align` (a power of two). The bytes are arbitrary.
    ///
    /// # Errors
    /// [`GpuError::OutOfMemory`] when neither the arenas nor the budget (or the heap's own limit) have room even after
    /// waiting for retired memory, [`GpuError::TooLarge`], [`GpuError::Usage`] for a bad alignment,
    /// [`GpuError::DeviceLost`].
    pub fn alloc(&self, name: &str, bytes: u64, align: u64) -> Result<HeapRange, GpuError> {
        self.alloc_with(name, bytes, align, BudgetWait::WaitForRetired)
    }

    /// As [`Heap::alloc`], but never waits for the GPU: `None` if there is no room now (budget, limit, fragmentation,
    /// or the driver refuses). Retired memory that the GPU has finished with is taken back first.
    ///
    /// # Errors
    /// As [`Heap::alloc`], without [`GpuError::OutOfMemory`].
    pub fn try_alloc(&self, name: &str, bytes: u64, align: u64) -> Result<Option<HeapRange>, GpuError> {
        match self.alloc_with(name, bytes, align, BudgetWait::Now) {
            Ok(range) => Ok(Some(range)),
            Err(GpuError::OutOfMemory { .. }) => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// Largest request in bytes that is served from an arena, if its alignment is at most 256 bytes. An empty arena of
    /// full size has room for it.
    #[must_use]
    pub fn largest_shared(&self) -> u64 {
        self.largest_shared
    }

    /// Changes the heap's own limit ([`HeapOptions::limit_bytes`]). Memory that is held stays held: below it, requests
    /// for more memory fail until enough was dropped.
    pub fn set_limit(&self, limit_bytes: Option<u64>) {
        self.arenas.counters.set_limit(limit_bytes);
    }

    /// The heap's own limit, if there is one.
    #[must_use]
    pub fn limit(&self) -> Option<u64> {
        self.arenas.counters.limit()
    }

    /// Usage of the heap now.
    #[must_use]
    pub fn stats(&self) -> HeapStats {
        self.opened.collect();
        let counters = &self.arenas.counters;
        let mut stats = HeapStats {
            dedicated_bytes: counters.dedicated(),
            live_bytes: counters.live(),
            retired_bytes: counters.retired(),
            ..HeapStats::default()
        };
        let mut free = 0;
        for arena in self.arenas.lock().iter() {
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

    /// Makes one arena of `bytes`, or of as much as the budget, the heap's own limit and the driver give in one piece,
    /// for later requests: ranges of very different sizes lose less in few large arenas than in many small ones. It is
    /// freed as any other. Returns its size; 0 if there is no memory.
    ///
    /// # Errors
    /// [`GpuError::DeviceLost`].
    pub fn reserve(&self, bytes: u64) -> Result<u64, GpuError> {
        self.opened.device.check_alive()?;
        let mut size = bytes.min(self.opened.device.limits.max_allocation_bytes) / GRANULE * GRANULE;
        while size >= MIN_ARENA_BYTES {
            match self.block(&self.name, size, BudgetWait::Now) {
                Ok(block) => {
                    self.arenas.add_first(block, size);
                    return Ok(size);
                }
                Err(GpuError::OutOfMemory { .. }) => size = size / 8 * 7 / GRANULE * GRANULE,
                Err(error) => return Err(error),
            }
        }
        Ok(0)
    }

    /// Gives empty arenas back to the budget.
    pub fn trim(&self) {
        self.opened.collect();
        self.arenas.trim(0);
    }

    fn alloc_with(&self, name: &str, bytes: u64, align: u64, patience: BudgetWait) -> Result<HeapRange, GpuError> {
        self.opened.device.check_alive()?;
        #[cfg(feature = "faults")]
        self.opened.device.planted(crate::device::watch::DriverCall::Range, name, bytes)?;
        if !align.is_power_of_two() {
            let message = format!("alignment {align} is not a power of two");
            return Err(GpuError::Usage { name: name.to_owned(), message });
        }
        // Units are aligned already within an arena; for a larger alignment the range begins later inside a longer
        // place.
        let padding = if align > GRANULE { align } else { 0 };
        let needed = bytes.max(1).checked_add(padding).and_then(|n| n.checked_next_multiple_of(GRANULE));
        let fits_shared = |needed: &u64| *needed <= self.largest_shared.max(self.largest_reserved());
        if let Some(needed) = needed.filter(fits_shared)
            && let Some(place) = self.share(needed, patience)?
        {
            return Ok(HeapRange::new(RangeMemory::in_arena(place, name, bytes, align)));
        }
        self.dedicated(name, bytes, align, patience)
    }

    /// A place in an existing or a new arena.
    fn share(&self, needed: u64, patience: BudgetWait) -> Result<Option<ArenaPlace>, GpuError> {
        if let Some(place) = self.arenas.take(needed) {
            return Ok(Some(place));
        }
        // Finished ranges are free before a new arena is considered.
        self.opened.collect();
        if let Some(place) = self.arenas.take(needed) {
            return Ok(Some(place));
        }
        let place = self.grow(needed)?;
        if place.is_some() || patience == BudgetWait::Now {
            return Ok(place);
        }
        self.opened.reclaim(patience)?;
        match self.arenas.take(needed) {
            Some(place) => Ok(Some(place)),
            None => self.grow(needed),
        }
    }

    /// Half of the largest arena: [`Self::reserve`] makes larger ones than usual.
    fn largest_reserved(&self) -> u64 {
        self.arenas.lock().iter().map(|arena| arena.bytes / 2).max().unwrap_or(0)
    }

    /// A place in a new arena, a smaller one if the budget is short; `None` if even a small one does not fit now.
    fn grow(&self, bytes: u64) -> Result<Option<ArenaPlace>, GpuError> {
        let mut size = self.arena_bytes;
        // In a smaller arena the same share of the size is usable as in a full one.
        let share = self.arena_bytes / self.largest_shared;
        while size / share >= bytes && size >= MIN_ARENA_BYTES {
            match self.block(&self.name, size, BudgetWait::Now) {
                Ok(block) => return Ok(self.arenas.grow(block, size, bytes)),
                Err(GpuError::OutOfMemory { .. }) => size = size / 2 / GRANULE * GRANULE,
                Err(error) => return Err(error),
            }
        }
        Ok(None)
    }

    /// A range with memory of its own.
    fn dedicated(&self, name: &str, bytes: u64, align: u64, patience: BudgetWait) -> Result<HeapRange, GpuError> {
        // Drivers align memory generously, but Vulkan guarantees nothing about addresses: leave room to move up.
        let room = if align > 1 { align } else { 0 };
        let padded = bytes.checked_add(room).ok_or_else(|| GpuError::TooLarge {
            name: name.to_owned(),
            bytes,
            limit: self.opened.device.limits.max_allocation_bytes,
        })?;
        let mut block = self.block(name, padded, patience)?;
        block.dedicate();
        let memory = RangeMemory::in_block(block, (name, bytes, align), (&self.arenas.counters, padded));
        Ok(HeapRange::new(memory))
    }

    /// Memory within the heap's own limit and the device's budget.
    fn block(&self, name: &str, bytes: u64, patience: BudgetWait) -> Result<MemoryBlock, GpuError> {
        let held = match self.arenas.counters.hold(name, bytes) {
            Ok(held) => held,
            Err(_) => {
                self.opened.reclaim(patience)?;
                self.arenas.counters.hold(name, bytes)?
            }
        };
        let raw = self.opened.allocate(name, bytes, self.usage, patience)?;
        Ok(MemoryBlock::of_heap(&self.opened.device, raw, held))
    }
}
