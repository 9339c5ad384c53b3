// SPDX-License-Identifier: Apache-2.0
//! Host memory through which data goes to the device: one mapped buffer, used as a ring by several threads.
//!
//! A thread reserves a [`StagingSlice`], fills it with no lock held, and records copies from it; the space comes back
//! when the last submission that copies from it has finished, or when the slice is dropped unused. Space is free again
//! when all that was reserved before it (or all after it) is back too, so a slice that is held long holds up the ring.
//!
//! Waiting: threads are served in the order they asked. The first waits for the GPU when that holds the oldest part,
//! else for other threads; a wait never lasts longer than [`POLL`] before everything is looked at anew, so nothing
//! depends on being woken, and the loss of the device ends it. A thread that holds the rest of the ring itself, in
//! slices or unsubmitted lists, waits for ever.

use std::sync::{Arc, MutexGuard};
use std::time::Duration;

use crate::commands::CommandList;
use crate::error::GpuError;
use crate::gpu::Gpu;
use crate::instance::memory_type::BufferUsage;
use crate::memory::staging_part::{RingMemory, RingState, RingTurn, StagingPart};
use crate::range::DeviceRange;
use crate::range::sealed::{RangeParts, ToRangeParts};
use crate::submit::kept::HeldResource;
use crate::submit::open_device::OpenDevice;

/// The name of the memory of every ring.
const NAME: &str = "staging ring";
/// Longest wait before everything is looked at anew.
const POLL: Duration = Duration::from_millis(2);
const POLL_NS: u64 = 2_000_000;

/// A ring of pinned memory. Any thread; put it in an [`Arc`] to share it.
#[derive(Debug)]
pub struct StagingRing {
    opened: Arc<OpenDevice>,
    memory: Arc<RingMemory>,
}

/// Space in a [`StagingRing`], the caller's alone until it is dropped and what copies from it is done.
#[derive(Debug)]
pub struct StagingSlice {
    part: Arc<StagingPart>,
    length: usize,
}

impl StagingRing {
    /// Makes a ring of `bytes`.
    ///
    /// # Errors
    /// As [`Buffer::new`](crate::Buffer::new); [`GpuError::Usage`] for no bytes, or more than the host can address.
    pub fn new(gpu: &Arc<Gpu>, bytes: u64) -> Result<Self, GpuError> {
        if bytes == 0 || isize::try_from(bytes).is_err() {
            return Err(misuse(format!("a ring of {bytes} bytes")));
        }
        let block = gpu.opened().block(NAME, bytes, BufferUsage::Upload)?;
        let mapped = block.raw.mapped.ok_or_else(|| misuse("the driver did not map it".to_owned()))?;
        let memory = Arc::new(RingMemory::new(block, mapped, bytes));
        Ok(Self { opened: Arc::clone(gpu.opened()), memory })
    }

    /// Size of the ring in bytes.
    #[must_use]
    pub fn size(&self) -> u64 {
        self.memory.size
    }

    /// Bytes that cannot be reserved now, gaps included.
    #[must_use]
    pub fn used(&self) -> u64 {
        self.opened.collect();
        self.memory.lock().used()
    }

    /// Reserves `bytes` at an offset that is a multiple of `align` (a power of two), and waits until they are free. The
    /// bytes are arbitrary.
    ///
    /// # Errors [`GpuError::Usage`] for more bytes than the ring has or a bad alignment, [`GpuError::DeviceLost`], or a
    /// failed call.
    pub fn reserve(&self, bytes: u64, align: u64) -> Result<StagingSlice, GpuError> {
        let length = self.check(bytes, align)?;
        let turn = RingTurn::take(&self.memory);
        loop {
            self.opened.device.check_alive()?;
            self.opened.collect();
            let state = self.memory.lock();
            match self.memory.take(state, Some(turn.number), (bytes, align)) {
                Ok(part) => return Ok(self.slice(part, length)),
                Err(state) => self.wait(state, turn.number)?,
            }
        }
    }

    /// As [`StagingRing::reserve`], but None when the bytes are not free at once, or others wait already.
    ///
    /// # Errors
    /// As [`StagingRing::reserve`].
    pub fn try_reserve(&self, bytes: u64, align: u64) -> Result<Option<StagingSlice>, GpuError> {
        let length = self.check(bytes, align)?;
        self.opened.device.check_alive()?;
        self.opened.collect();
        let state = self.memory.lock();
        match self.memory.take(state, None, (bytes, align)) {
            Ok(part) => Ok(Some(self.slice(part, length))),
            Err(_) => Ok(None),
        }
    }

    fn check(&self, bytes: u64, align: u64) -> Result<usize, GpuError> {
        let size = self.size();
        if !align.is_power_of_two() {
            return Err(misuse(format!("alignment {align} is not a power of two")));
        }
        let length = usize::try_from(bytes).ok().filter(|_| bytes <= size);
        length.ok_or_else(|| misuse(format!("{bytes} bytes wanted of a ring of {size}")))
    }

    fn slice(&self, part: (u64, u64), length: usize) -> StagingSlice {
        StagingSlice { part: Arc::new(StagingPart::new(&self.memory, part)), length }
    }

    /// Waits, not longer than [`POLL`], for something to happen that may free space.
    fn wait(&self, state: MutexGuard<'_, RingState>, turn: u64) -> Result<(), GpuError> {
        let submitted =
            state.oldest_user(turn).and_then(|lane| Some((lane, self.opened.queue(lane).oldest_in_flight()?)));
        if let Some((lane, value)) = submitted {
            drop(state);
            self.opened.device.wait(lane, value, POLL_NS)?;
        } else {
            self.memory.wait_for_change(state, POLL);
        }
        Ok(())
    }
}

fn misuse(message: String) -> GpuError {
    GpuError::Usage { name: NAME.to_owned(), message }
}

impl StagingSlice {
    /// The bytes, to be filled. Do not read them (it may be very slow), and do not write them once copies from them are
    /// submitted: what the device sees then is unspecified.
    pub fn bytes_mut(&mut self) -> &mut [u8] {
        let mapped = self.part.ring.mapped.as_ptr();
        let start = usize::try_from(self.part.start).unwrap_or_default();
        // SAFETY: the part lies in the mapped buffer, whose size fits in a usize (`StagingRing::new`).
        let first = unsafe { mapped.add(start) };
        // SAFETY: `length` bytes from here are the part's, mapped as long as the part keeps the ring alive; parts do
        // not overlap, each has one slice, and `self` is borrowed mutably, so this is the only reference. Bytes of any
        // value are valid.
        unsafe { std::slice::from_raw_parts_mut(first, self.length) }
    }

    /// Records a copy of `bytes` from `source_offset` of this slice; as [`CommandList::copy`].
    pub fn copy_to(
        &self,
        commands: &mut CommandList,
        source_offset: u64,
        target: &dyn DeviceRange,
        target_offset: u64,
        bytes: u64,
    ) {
        commands.copy(self, source_offset, target, target_offset, bytes);
    }
}

impl DeviceRange for StagingSlice {
    fn address(&self) -> u64 {
        self.part.ring.block.raw.address + self.part.start
    }

    fn size(&self) -> u64 {
        self.length as u64
    }

    fn name(&self) -> &str {
        NAME
    }
}

impl ToRangeParts for StagingSlice {
    fn parts(&self) -> RangeParts {
        let block = &self.part.ring.block;
        RangeParts {
            buffer: block.buffer(),
            offset: self.part.start,
            device: Arc::as_ptr(&block.device),
            kept: HeldResource::Staging(Arc::clone(&self.part)),
        }
    }
}
