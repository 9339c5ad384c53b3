// SPDX-License-Identifier: Apache-2.0
//! Accounts for the host memory of meshes: of assets that are kept and of builds under way. It only counts: a caller
//! that gets nothing splits, waits or writes to a file. Thread-safe.
//!
//! `held` <= `limit` bounds the kept assets, `taken` <= `room` the kept assets together with the builds under way.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// The limits of host memory for meshes, and its use. All numbers are bytes.
#[derive(Debug)]
pub struct HostMemory {
    /// Limit of `held`.
    limit: AtomicU64,
    /// Limit of `taken`.
    room: AtomicU64,
    /// Host memory that the whole renderer may take.
    budget: AtomicU64,
    /// Of assets that are kept.
    held: AtomicU64,
    /// `held`, and what is reserved for builds under way.
    taken: AtomicU64,
    /// Peak of `taken` since the room was set.
    most_taken: AtomicU64,
}

impl Default for HostMemory {
    fn default() -> Self {
        let [limit, room, budget] = [u64::MAX; 3].map(AtomicU64::new);
        let [held, taken, most_taken] = [0; 3].map(AtomicU64::new);
        Self { limit, room, budget, held, taken, most_taken }
    }
}

impl HostMemory {
    /// Sets the limit of kept assets. Assets that are kept already stay, even beyond it.
    pub fn set_limit(&self, bytes: u64) {
        self.limit.store(bytes, Ordering::Relaxed);
    }

    /// Sets the limit of kept assets and builds under way together, and resets the peak; called before a commit. A
    /// build that needs more runs alone.
    pub fn set_room(&self, bytes: u64) {
        self.room.store(bytes, Ordering::Relaxed);
        self.most_taken.store(self.taken.load(Ordering::Relaxed), Ordering::Relaxed);
    }

    /// Sets the budget of the whole renderer: a prim that needs more by itself is not built.
    pub(crate) fn set_budget(&self, bytes: u64) {
        self.budget.store(bytes, Ordering::Relaxed);
    }

    /// The budget of the whole renderer; none if it is unlimited.
    pub(crate) fn budget(&self) -> Option<u64> {
        Some(self.budget.load(Ordering::Relaxed)).filter(|budget| *budget < u64::MAX)
    }

    /// Whether kept assets take all that they may.
    pub(crate) fn is_full(&self) -> bool {
        self.held() >= self.limit.load(Ordering::Relaxed)
    }

    /// Bytes of assets that are kept.
    #[must_use]
    pub fn held(&self) -> u64 {
        self.held.load(Ordering::Relaxed)
    }

    /// Peak of kept assets and builds under way together since the room was set.
    #[must_use]
    pub fn most_taken(&self) -> u64 {
        self.most_taken.load(Ordering::Relaxed)
    }

    /// [`Self::most_taken`] if it exceeded the room, as a build that runs alone may.
    #[must_use]
    pub fn overrun(&self) -> Option<u64> {
        Some(self.most_taken()).filter(|most| *most > self.room.load(Ordering::Relaxed))
    }

    /// Bytes that a build may take now.
    pub(crate) fn left(&self) -> u64 {
        self.room.load(Ordering::Relaxed).saturating_sub(self.taken.load(Ordering::Relaxed))
    }

    /// Adds to `taken` unless that would exceed `limit` or overflow.
    fn try_take(&self, bytes: u64, limit: u64) -> bool {
        let sum = |taken: u64| taken.checked_add(bytes).filter(|taken| *taken <= limit);
        let before = self.taken.fetch_update(Ordering::Relaxed, Ordering::Relaxed, sum);
        if let Ok(before) = before {
            self.most_taken.fetch_max(before.saturating_add(bytes), Ordering::Relaxed);
        }
        before.is_ok()
    }

    fn give_back(&self, bytes: u64) {
        self.taken.fetch_sub(bytes, Ordering::Relaxed);
    }

    /// Reserves memory for a build if there is room.
    pub(crate) fn try_reserve(self: &Arc<Self>, bytes: u64) -> Option<ReservedMemory> {
        self.try_take(bytes, self.room.load(Ordering::Relaxed)).then(|| ReservedMemory { memory: self.clone(), bytes })
    }

    /// Reserves memory for a build beyond the room; nothing if the sum overflows.
    pub(crate) fn reserve(self: &Arc<Self>, bytes: u64) -> ReservedMemory {
        let bytes = if self.try_take(bytes, u64::MAX) { bytes } else { 0 };
        ReservedMemory { memory: self.clone(), bytes }
    }

    /// Accounts for a kept asset if there is room.
    pub(crate) fn try_hold(self: &Arc<Self>, bytes: u64) -> Option<HeldMemory> {
        if !self.try_take(bytes, self.room.load(Ordering::Relaxed)) {
            return None;
        }
        let held = self.try_hold_taken(bytes, self.limit.load(Ordering::Relaxed));
        if held.is_none() {
            self.give_back(bytes);
        }
        held
    }

    /// Accounts for a kept asset beyond the limits; nothing if the sum overflows.
    pub(crate) fn hold(self: &Arc<Self>, bytes: u64) -> HeldMemory {
        let bytes = if self.try_take(bytes, u64::MAX) { bytes } else { 0 };
        self.held.fetch_add(bytes, Ordering::Relaxed);
        HeldMemory { memory: self.clone(), bytes }
    }

    /// Moves bytes that are taken already to `held`, unless that would exceed `limit`.
    fn try_hold_taken(self: &Arc<Self>, bytes: u64, limit: u64) -> Option<HeldMemory> {
        let sum = |held: u64| held.checked_add(bytes).filter(|held| *held <= limit);
        self.held.fetch_update(Ordering::Relaxed, Ordering::Relaxed, sum).ok()?;
        Some(HeldMemory { memory: self.clone(), bytes })
    }
}

/// The message for a prim whose build needs more bytes than the budget.
pub(crate) fn too_large(needed: u64, budget: u64) -> String {
    let [needed, budget] = [needed, budget].map(|bytes| bytes.div_ceil(1 << 20));
    format!(
        "needs {needed} MiB of host memory to be built, more than the {budget} MiB of oocpt:hostMemoryBudget; it is \
         left out"
    )
}

/// Memory reserved for a build; given back when this is dropped.
#[derive(Debug)]
pub(crate) struct ReservedMemory {
    memory: Arc<HostMemory>,
    bytes: u64,
}

impl ReservedMemory {
    /// Turns a part of the reservation into memory of a kept asset, if the limit allows it.
    pub(crate) fn keep(&mut self, bytes: u64) -> Option<HeldMemory> {
        if bytes > self.bytes {
            return self.memory.try_hold(bytes);
        }
        let held = self.memory.try_hold_taken(bytes, self.memory.limit.load(Ordering::Relaxed))?;
        self.bytes -= bytes;
        Some(held)
    }
}

impl Drop for ReservedMemory {
    fn drop(&mut self) {
        self.memory.give_back(self.bytes);
    }
}

/// Memory of a kept asset; given back when this is dropped.
#[derive(Debug)]
pub(crate) struct HeldMemory {
    memory: Arc<HostMemory>,
    bytes: u64,
}

impl Drop for HeldMemory {
    fn drop(&mut self) {
        self.memory.held.fetch_sub(self.bytes, Ordering::Relaxed);
        self.memory.give_back(self.bytes);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_prim_that_is_too_large_is_told_with_both_sizes() {
        let note = too_large((8 << 20) + 1, 8 << 20);
        assert!(note.contains("needs 9 MiB") && note.contains("8 MiB of oocpt:hostMemoryBudget"), "{note}");
        assert!(too_large(u64::MAX, 1).contains("needs 17592186044416 MiB"), "no overflow");
    }

    #[test]
    fn memory_is_held_up_to_the_limit_and_given_back() {
        let memory = Arc::new(HostMemory::default());
        memory.set_limit(100);
        let first = memory.try_hold(60).expect("there is room");
        assert!(memory.try_hold(41).is_none(), "no room");
        assert!(memory.try_hold(u64::MAX).is_none(), "no overflow");
        let rest = memory.try_hold(40).expect("just fits");
        let beyond = memory.hold(7);
        assert_eq!(memory.held(), 107);
        drop((first, beyond));
        assert_eq!(memory.held(), 40);
        drop(rest);
        assert_eq!((memory.held(), memory.left(), memory.most_taken()), (0, u64::MAX, 107));
    }

    #[test]
    fn builds_and_what_is_kept_share_the_room() {
        let memory = Arc::new(HostMemory::default());
        memory.set_limit(50);
        memory.set_room(100);
        let mut build = memory.try_reserve(70).expect("there is room");
        assert!(memory.try_reserve(31).is_none() && memory.try_hold(31).is_none(), "no room for more");
        assert!(memory.try_reserve(u64::MAX).is_none(), "no overflow");
        assert_eq!(memory.left(), 30);
        let kept = build.keep(40).expect("a part of it");
        assert_eq!((memory.held(), memory.left()), (40, 30), "nothing is counted twice");
        assert!(build.keep(11).is_none(), "beyond the limit");
        drop(build);
        assert_eq!((memory.held(), memory.left(), memory.most_taken()), (40, 60, 70));
        let alone = memory.reserve(1000);
        assert_eq!((memory.left(), memory.most_taken()), (0, 1040), "a build that is alone");
        assert!(memory.try_reserve(1).is_none());
        drop((kept, alone));
        assert_eq!((memory.held(), memory.left()), (0, 100));
    }
}
