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
//!
//! Locks: the ring's own is held for bookkeeping only, never while anything is collected, dropped, waited for or
//! filled.

use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use crate::buffer::Buffer;
use crate::commands::{Commands, Kept};
use crate::device::Device;
use crate::error::GpuError;
use crate::gpu::Gpu;
use crate::lane::Lane;
use crate::memory::{Mapped, Usage};
use crate::range::DeviceRange;
use crate::range::sealed::{Parts, RangeParts};
use crate::staging_space::RingSpace;

/// Longest wait before everything is looked at anew.
const POLL: Duration = Duration::from_millis(2);
const POLL_NS: u64 = 2_000_000;

/// A ring of pinned memory. Any thread; put it in an [`Arc`] to share it.
#[derive(Debug)]
pub struct StagingRing {
    core: Arc<RingCore>,
}

#[derive(Debug)]
struct RingCore {
    device: Arc<Device>,
    buffer: Buffer,
    /// The buffer's first byte.
    mapped: Mapped,
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Debug)]
struct State {
    space: RingSpace,
    /// Threads that wait, in the order they asked.
    turns: VecDeque<u64>,
    next_turn: u64,
}

/// Space taken from the ring, given back by the last holder: the slice or a command list.
#[derive(Debug)]
pub(crate) struct StagingPart {
    core: Arc<RingCore>,
    number: u64,
    start: u64,
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
    /// As [`Buffer::new`]; [`GpuError::Usage`] for no bytes, or more than the host can address.
    pub fn new(gpu: &Arc<Gpu>, bytes: u64) -> Result<Self, GpuError> {
        let name = "staging ring";
        let misuse = |message: String| GpuError::Usage { name: name.to_owned(), message };
        if bytes == 0 || isize::try_from(bytes).is_err() {
            return Err(misuse(format!("a ring of {bytes} bytes")));
        }
        let buffer = Buffer::new(gpu, name, bytes, Usage::Upload)?;
        let mapped = buffer.mapped().ok_or_else(|| misuse("the driver did not map it".to_owned()))?;
        let state = State { space: RingSpace::new(bytes), turns: VecDeque::new(), next_turn: 0 };
        let device = Arc::clone(gpu.device());
        let core = RingCore { device, buffer, mapped, state: Mutex::new(state), changed: Condvar::new() };
        Ok(Self { core: Arc::new(core) })
    }

    /// Size of the ring in bytes.
    #[must_use]
    pub fn size(&self) -> u64 {
        self.core.buffer.size()
    }

    /// Bytes that cannot be reserved now, gaps included.
    #[must_use]
    pub fn used(&self) -> u64 {
        self.core.device.collect();
        self.core.lock().space.used()
    }

    /// Reserves `bytes` at an offset that is a multiple of `align` (a power of two), and waits until they are free. The
    /// bytes are arbitrary.
    ///
    /// # Errors [`GpuError::Usage`] for more bytes than the ring has or a bad alignment, [`GpuError::DeviceLost`], or a
    /// failed call.
    pub fn reserve(&self, bytes: u64, align: u64) -> Result<StagingSlice, GpuError> {
        let length = self.check(bytes, align)?;
        let turn = Turn::take(&self.core);
        loop {
            self.core.device.check_alive()?;
            self.core.device.collect();
            let state = self.core.lock();
            match self.core.take(state, Some(turn.number), (bytes, align)) {
                Ok((number, start)) => return Ok(self.slice(number, start, length)),
                Err(state) => self.core.wait(state, turn.number)?,
            }
        }
    }

    /// As [`StagingRing::reserve`], but None when the bytes are not free at once, or others wait already.
    ///
    /// # Errors
    /// As [`StagingRing::reserve`].
    pub fn try_reserve(&self, bytes: u64, align: u64) -> Result<Option<StagingSlice>, GpuError> {
        let length = self.check(bytes, align)?;
        self.core.device.check_alive()?;
        self.core.device.collect();
        let state = self.core.lock();
        match self.core.take(state, None, (bytes, align)) {
            Ok((number, start)) => Ok(Some(self.slice(number, start, length))),
            Err(_) => Ok(None),
        }
    }

    fn check(&self, bytes: u64, align: u64) -> Result<usize, GpuError> {
        let size = self.size();
        let misuse = |message: String| GpuError::Usage { name: self.core.buffer.name().to_owned(), message };
        if !align.is_power_of_two() {
            return Err(misuse(format!("alignment {align} is not a power of two")));
        }
        let length = usize::try_from(bytes).ok().filter(|_| bytes <= size);
        length.ok_or_else(|| misuse(format!("{bytes} bytes wanted of a ring of {size}")))
    }

    fn slice(&self, number: u64, start: u64, length: usize) -> StagingSlice {
        StagingSlice { part: Arc::new(StagingPart { core: Arc::clone(&self.core), number, start }), length }
    }
}

impl RingCore {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes space if it is free and nobody asked before: the number and the start of the part, or the lock again.
    fn take<'a>(
        &self,
        mut state: MutexGuard<'a, State>,
        turn: Option<u64>,
        (bytes, align): (u64, u64),
    ) -> Result<(u64, u64), MutexGuard<'a, State>> {
        if state.turns.front().copied() != turn {
            return Err(state);
        }
        state.space.take(bytes.max(1), align).ok_or(state)
    }

    /// Waits, not longer than [`POLL`], for something to happen that may free space.
    fn wait(&self, state: MutexGuard<'_, State>, turn: u64) -> Result<(), GpuError> {
        let is_first = state.turns.front() == Some(&turn);
        let user = state.space.oldest_user().filter(|_| is_first);
        let submitted = user.and_then(|lane| Some((lane, self.device.queue(lane).oldest_in_flight()?)));
        if let Some((lane, value)) = submitted {
            drop(state);
            self.device.queue(lane).wait(&self.device, value, POLL_NS)?;
        } else {
            drop(self.changed.wait_timeout(state, POLL).unwrap_or_else(PoisonError::into_inner));
        }
        Ok(())
    }
}

/// A place in the queue of those who wait.
struct Turn<'a> {
    core: &'a RingCore,
    number: u64,
}

impl<'a> Turn<'a> {
    fn take(core: &'a RingCore) -> Self {
        let mut state = core.lock();
        let number = state.next_turn;
        state.next_turn += 1;
        state.turns.push_back(number);
        Self { core, number }
    }
}

impl Drop for Turn<'_> {
    fn drop(&mut self) {
        self.core.lock().turns.retain(|&turn| turn != self.number);
        self.core.changed.notify_all();
    }
}

impl StagingPart {
    /// A list of `lane` keeps it.
    pub(crate) fn used_on(&self, lane: Lane) {
        self.core.lock().space.used_by(self.number, lane);
    }
}

impl Drop for StagingPart {
    fn drop(&mut self) {
        let mut state = self.core.lock();
        let freed = state.space.give_back(self.number);
        drop(state);
        if freed {
            self.core.changed.notify_all();
        }
    }
}

impl StagingSlice {
    /// The bytes, to be filled. Do not read them (it may be very slow), and do not write them once copies from them are
    /// submitted: what the device sees then is unspecified.
    pub fn bytes_mut(&mut self) -> &mut [u8] {
        let mapped = self.part.core.mapped.as_ptr();
        let start = usize::try_from(self.part.start).unwrap_or_default();
        // SAFETY: the part lies in the mapped buffer, whose size fits in a usize (`StagingRing::new`).
        let first = unsafe { mapped.add(start) };
        // SAFETY: `length` bytes from here are the part's, mapped as long as the part keeps the ring alive; parts do
        // not overlap, each has one slice, and `self` is borrowed mutably, so this is the only reference. Bytes of any
        // value are valid.
        unsafe { std::slice::from_raw_parts_mut(first, self.length) }
    }

    /// Records a copy of `bytes` from `source_offset` of this slice; as [`Commands::copy`].
    pub fn copy_to(
        &self,
        commands: &mut Commands,
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
        self.part.core.buffer.address() + self.part.start
    }

    fn size(&self) -> u64 {
        self.length as u64
    }

    fn name(&self) -> &str {
        self.part.core.buffer.name()
    }
}

impl Parts for StagingSlice {
    fn parts(&self) -> RangeParts {
        let whole = self.part.core.buffer.parts();
        RangeParts { offset: self.part.start, kept: Kept::Staging(Arc::clone(&self.part)), ..whole }
    }
}
