// SPDX-License-Identifier: Apache-2.0
//! The memory of a staging ring and the parts of it that are taken, which command lists can keep alive. Any thread.
//!
//! Locks: the ring's own is held for bookkeeping only, never while anything is dropped, waited for or filled.

use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use crate::device::mapped::MappedPointer;
use crate::instance::lane::QueueLane;
use crate::memory::block::MemoryBlock;
use crate::memory::staging_space::RingSpace;

/// The bytes of a ring, and who has which.
#[derive(Debug)]
pub(crate) struct RingMemory {
    pub(crate) block: Arc<MemoryBlock>,
    /// The buffer's first byte.
    pub(crate) mapped: MappedPointer,
    /// Bytes of the ring.
    pub(crate) size: u64,
    state: Mutex<RingState>,
    changed: Condvar,
}

#[derive(Debug)]
pub(crate) struct RingState {
    space: RingSpace,
    /// Threads that wait, in the order they asked.
    turns: VecDeque<u64>,
    next_turn: u64,
}

impl RingMemory {
    /// All of a mapped block is free.
    pub(crate) fn new(block: MemoryBlock, mapped: MappedPointer, size: u64) -> Self {
        let state = RingState { space: RingSpace::new(size), turns: VecDeque::new(), next_turn: 0 };
        Self { block: Arc::new(block), mapped, size, state: Mutex::new(state), changed: Condvar::new() }
    }

    pub(crate) fn lock(&self) -> MutexGuard<'_, RingState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes space if it is free and nobody asked before: the number and the start of the part, or the lock again.
    pub(crate) fn take<'a>(
        &self,
        mut state: MutexGuard<'a, RingState>,
        turn: Option<u64>,
        (bytes, align): (u64, u64),
    ) -> Result<(u64, u64), MutexGuard<'a, RingState>> {
        if state.turns.front().copied() != turn {
            return Err(state);
        }
        state.space.take(bytes.max(1), align).ok_or(state)
    }

    /// Waits for something to happen that may free space, not longer than this.
    pub(crate) fn wait_for_change(&self, state: MutexGuard<'_, RingState>, most: Duration) {
        drop(self.changed.wait_timeout(state, most).unwrap_or_else(PoisonError::into_inner));
    }
}

impl RingState {
    /// Bytes that are not free, gaps included.
    pub(crate) fn used(&self) -> u64 {
        self.space.used()
    }

    /// The lane that holds the oldest part, if it is for `turn` to wait for it: for the first in the queue.
    pub(crate) fn oldest_user(&self, turn: u64) -> Option<QueueLane> {
        self.space.oldest_user().filter(|_| self.turns.front() == Some(&turn))
    }
}

/// A place in the queue of those who wait.
pub(crate) struct RingTurn<'a> {
    ring: &'a RingMemory,
    pub(crate) number: u64,
}

impl<'a> RingTurn<'a> {
    pub(crate) fn take(ring: &'a RingMemory) -> Self {
        let mut state = ring.lock();
        let number = state.next_turn;
        state.next_turn += 1;
        state.turns.push_back(number);
        Self { ring, number }
    }
}

impl Drop for RingTurn<'_> {
    fn drop(&mut self) {
        self.ring.lock().turns.retain(|&turn| turn != self.number);
        self.ring.changed.notify_all();
    }
}

/// Space taken from the ring, given back by the last holder: the slice or a command list.
#[derive(Debug)]
pub(crate) struct StagingPart {
    pub(crate) ring: Arc<RingMemory>,
    number: u64,
    pub(crate) start: u64,
}

impl StagingPart {
    /// The part that [`RingMemory::take`] gave.
    pub(crate) fn new(ring: &Arc<RingMemory>, (number, start): (u64, u64)) -> Self {
        Self { ring: Arc::clone(ring), number, start }
    }

    /// A list of `lane` keeps it.
    pub(crate) fn used_on(&self, lane: QueueLane) {
        self.ring.lock().space.used_by(self.number, lane);
    }
}

impl Drop for StagingPart {
    fn drop(&mut self) {
        let mut state = self.ring.lock();
        let freed = state.space.give_back(self.number);
        drop(state);
        if freed {
            self.ring.changed.notify_all();
        }
    }
}
