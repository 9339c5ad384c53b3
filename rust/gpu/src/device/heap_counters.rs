// SPDX-License-Identifier: Apache-2.0
//! Counts the bytes that a heap holds against its own limit. Pure bookkeeping, no Vulkan. Any thread.
//!
//! Guarantee: memory that is held never exceeds the limit that was set when it was taken.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::error::GpuError;

/// Counters shared by a heap, its arenas and its ranges.
#[derive(Debug)]
pub(crate) struct HeapCounters {
    /// Most bytes of memory; `u64::MAX` = no limit.
    limit: AtomicU64,
    /// Bytes of arenas and of ranges with memory of their own, until they are freed.
    held: AtomicU64,
    /// Bytes of ranges with memory of their own, until they are freed.
    dedicated: AtomicU64,
    /// Bytes of ranges that have an owner.
    live: AtomicU64,
    /// Bytes of ranges without an owner that the GPU may still use.
    retired: AtomicU64,
}

/// Memory that counts as held until this is dropped.
#[derive(Debug)]
pub(crate) struct HeldBytes {
    counters: Arc<HeapCounters>,
    bytes: u64,
    /// True if it is the memory of one range, which is retired by now.
    dedicated: bool,
}

impl HeapCounters {
    pub(crate) fn new(limit: Option<u64>) -> Arc<Self> {
        let counters = Self {
            limit: AtomicU64::new(u64::MAX),
            held: AtomicU64::new(0),
            dedicated: AtomicU64::new(0),
            live: AtomicU64::new(0),
            retired: AtomicU64::new(0),
        };
        counters.set_limit(limit);
        Arc::new(counters)
    }

    pub(crate) fn set_limit(&self, limit: Option<u64>) {
        self.limit.store(limit.unwrap_or(u64::MAX), Ordering::Release);
    }

    /// The limit; `None` if there is none.
    pub(crate) fn limit(&self) -> Option<u64> {
        Some(self.limit.load(Ordering::Acquire)).filter(|limit| *limit != u64::MAX)
    }

    /// Counts `bytes` of memory as held, or refuses and changes nothing.
    pub(crate) fn hold(self: &Arc<Self>, name: &str, bytes: u64) -> Result<HeldBytes, GpuError> {
        let limit = self.limit.load(Ordering::Acquire);
        let more = |held: u64| held.checked_add(bytes).filter(|&total| total <= limit);
        match self.held.fetch_update(Ordering::AcqRel, Ordering::Acquire, more) {
            Ok(_) => Ok(HeldBytes { counters: Arc::clone(self), bytes, dedicated: false }),
            Err(used) => Err(GpuError::OutOfMemory { name: name.to_owned(), bytes, used, budget: limit }),
        }
    }

    /// Counts a new range.
    pub(crate) fn made(&self, bytes: u64) {
        self.live.fetch_add(bytes, Ordering::Relaxed);
    }

    /// Counts a range as retired: it has no owner any more.
    pub(crate) fn retire(&self, bytes: u64) {
        self.retired.fetch_add(bytes, Ordering::Relaxed);
        self.live.fetch_sub(bytes, Ordering::Relaxed);
    }

    /// Counts a retired range as freed: the GPU does not use it any more.
    pub(crate) fn freed(&self, bytes: u64) {
        self.retired.fetch_sub(bytes, Ordering::Relaxed);
    }

    pub(crate) fn live(&self) -> u64 {
        self.live.load(Ordering::Relaxed)
    }

    pub(crate) fn retired(&self) -> u64 {
        self.retired.load(Ordering::Relaxed)
    }

    pub(crate) fn dedicated(&self) -> u64 {
        self.dedicated.load(Ordering::Relaxed)
    }
}

impl HeldBytes {
    /// Marks it as the memory of one range.
    pub(crate) fn dedicate(&mut self) {
        self.dedicated = true;
        self.counters.dedicated.fetch_add(self.bytes, Ordering::Relaxed);
    }
}

impl Drop for HeldBytes {
    fn drop(&mut self) {
        let counters = &self.counters;
        counters.held.fetch_sub(self.bytes, Ordering::AcqRel);
        if self.dedicated {
            counters.dedicated.fetch_sub(self.bytes, Ordering::Relaxed);
            counters.freed(self.bytes);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn never_above_the_limit() {
        let counters = HeapCounters::new(Some(100));
        let mut first = counters.hold("a", 60).expect("fits");
        let expected = GpuError::OutOfMemory { name: "b".into(), bytes: 41, used: 60, budget: 100 };
        assert_eq!(counters.hold("b", 41).expect_err("one byte too many"), expected, "with the limit");
        let second = counters.hold("c", 40).expect("exactly full");
        assert!(counters.hold("d", u64::MAX).is_err(), "no overflow");
        first.dedicate();
        counters.made(60);
        assert_eq!((counters.dedicated(), counters.live(), counters.retired()), (60, 60, 0), "a range of its own");
        counters.retire(60);
        assert_eq!((counters.dedicated(), counters.live(), counters.retired()), (60, 0, 60), "held by the GPU");
        drop(first);
        assert_eq!((counters.dedicated(), counters.live(), counters.retired()), (0, 0, 0), "freed");
        counters.set_limit(Some(50));
        assert!(counters.hold("e", 11).is_err() && counters.hold("f", 10).is_ok(), "40 are held");
        counters.set_limit(None);
        assert!(counters.hold("g", 1 << 40).is_ok(), "no limit");
        drop(second);
    }
}
