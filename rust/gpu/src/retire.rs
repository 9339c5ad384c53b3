// SPDX-License-Identifier: Apache-2.0
//! Things nobody holds any more but the GPU may still use, each with the submission after which it can go.
//!
//! Bookkeeping only: [`RetireQueue::take_ready`] hands out what is ready, the caller destroys it outside the lock (destroying may
//! retire more). Any thread.

use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Items by the timeline value that must have passed.
#[derive(Debug)]
pub(crate) struct RetireQueue<T> {
    waiting: Mutex<BTreeMap<u64, Vec<T>>>,
}

impl<T> RetireQueue<T> {
    pub(crate) fn new() -> Self {
        Self { waiting: Mutex::new(BTreeMap::new()) }
    }

    fn lock(&self) -> MutexGuard<'_, BTreeMap<u64, Vec<T>>> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Keeps `item` until the timeline has reached `point`.
    pub(crate) fn push(&self, point: u64, item: T) {
        self.lock().entry(point).or_default().push(item);
    }

    /// Everything whose point is at or below `completed`, oldest first.
    pub(crate) fn take_ready(&self, completed: u64) -> Vec<T> {
        let mut waiting = self.lock();
        if waiting.first_key_value().is_none_or(|(&point, _)| point > completed) {
            return Vec::new();
        }
        let later = match completed.checked_add(1) {
            Some(next) => waiting.split_off(&next),
            None => BTreeMap::new(),
        };
        let ready = std::mem::replace(&mut *waiting, later);
        ready.into_values().flatten().collect()
    }

    /// The point after which everything waiting now can go; None when nothing waits.
    pub(crate) fn last_point(&self) -> Option<u64> {
        self.lock().last_key_value().map(|(&point, _)| point)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn items_leave_in_order_of_their_points_and_not_before() {
        let queue = RetireQueue::new();
        for (point, item) in [(5, "e"), (2, "b"), (9, "i"), (2, "b2")] {
            queue.push(point, item);
        }
        assert_eq!(queue.take_ready(1), Vec::<&str>::new(), "nothing has passed");
        assert_eq!(queue.take_ready(5), ["b", "b2", "e"], "all at or below, oldest first");
        assert_eq!(queue.last_point(), Some(9), "one left");
        assert_eq!(queue.take_ready(u64::MAX), ["i"], "everything, as after device loss");
        assert_eq!(queue.last_point(), None, "empty");
    }
}
