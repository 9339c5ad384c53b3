// SPDX-License-Identifier: Apache-2.0
//! Bounds the bytes of meshes from files that are in host memory at a time on their way to the device. Any thread.

use crate::sync::lock;
use std::sync::{Condvar, Mutex, PoisonError};

/// The limit on mesh bytes in transit, and the bytes taken of it.
#[derive(Debug)]
pub(crate) struct ReadingLimit {
    state: Mutex<ReadingState>,
    /// Signalled when a read ends or the limit changes.
    changed: Condvar,
}

#[derive(Debug)]
struct ReadingState {
    /// Most bytes, unless one mesh alone has more.
    limit: u64,
    bytes: u64,
}

impl Default for ReadingLimit {
    fn default() -> Self {
        Self { state: Mutex::new(ReadingState { limit: u64::MAX, bytes: 0 }), changed: Condvar::new() }
    }
}

impl ReadingLimit {
    /// Sets the limit; reads that are under way go on.
    pub(crate) fn set_limit(&self, bytes: u64) {
        lock(&self.state).limit = bytes;
        self.changed.notify_all();
    }

    /// Waits until there is room for `bytes` or nothing else is under way. A caller that has to wait calls `before`
    /// first, to release what others may wait for.
    pub(crate) fn begin<E>(&self, bytes: u64, before: impl FnOnce() -> Result<(), E>) -> Result<ReadingPermit<'_>, E> {
        let mut state = lock(&self.state);
        if !state.has_room(bytes) {
            drop(state);
            before()?;
            state = lock(&self.state);
        }
        while !state.has_room(bytes) {
            state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
        state.bytes = state.bytes.saturating_add(bytes);
        Ok(ReadingPermit { reading: self, bytes })
    }
}

impl ReadingState {
    fn has_room(&self, bytes: u64) -> bool {
        self.bytes == 0 || self.bytes.checked_add(bytes).is_some_and(|all| all <= self.limit)
    }
}

/// A mesh that is in host memory until this is dropped.
#[derive(Debug)]
pub(crate) struct ReadingPermit<'a> {
    reading: &'a ReadingLimit,
    bytes: u64,
}

impl Drop for ReadingPermit<'_> {
    fn drop(&mut self) {
        let mut state = lock(&self.reading.state);
        state.bytes = state.bytes.saturating_sub(self.bytes);
        drop(state);
        self.reading.changed.notify_all();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::convert::Infallible;
    use std::sync::atomic::{AtomicU64, Ordering};

    fn go_on() -> Result<(), Infallible> {
        Ok(())
    }

    #[test]
    fn meshes_wait_for_room_and_one_alone_always_has_some() {
        let reading = ReadingLimit::default();
        reading.set_limit(100);
        let (now, most, waited) = (AtomicU64::new(0), AtomicU64::new(0), AtomicU64::new(0));
        std::thread::scope(|scope| {
            for thread in 0..8_u64 {
                let (reading, now, most, waited) = (&reading, &now, &most, &waited);
                scope.spawn(move || {
                    for round in 0..200 {
                        let bytes = 1 + (thread * 31 + round * 17) % 60;
                        let wait = || {
                            waited.fetch_add(1, Ordering::Relaxed);
                            go_on()
                        };
                        let Ok(under) = reading.begin(bytes, wait);
                        most.fetch_max(now.fetch_add(bytes, Ordering::Relaxed) + bytes, Ordering::Relaxed);
                        std::thread::yield_now();
                        now.fetch_sub(bytes, Ordering::Relaxed);
                        drop(under);
                    }
                });
            }
        });
        assert!(most.into_inner() <= 100 && waited.into_inner() > 0, "some had to wait");
        let Ok(alone) = reading.begin(u64::MAX, go_on);
        assert!(!lock(&reading.state).has_room(1), "no overflow");
        drop(alone);
        assert_eq!(lock(&reading.state).bytes, 0);
        assert!(reading.begin(101, go_on).is_ok(), "more than the limit, alone");
    }

    #[test]
    fn who_cannot_let_go_does_not_wait() {
        let reading = ReadingLimit::default();
        reading.set_limit(1);
        let Ok(_first) = reading.begin(1, go_on);
        assert_eq!(reading.begin(1, || Err("lost")).map(drop), Err("lost"));
    }
}
