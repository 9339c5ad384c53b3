// SPDX-License-Identifier: Apache-2.0
//! Things nobody holds any more but the GPU may still use, each with the submissions after which it can go.
//!
//! Bookkeeping only: [`RetireQueue::take_ready`] hands out what is ready, the caller destroys it outside the lock
//! (destroying may retire more). Any thread.

use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::instance::lane::{QueueLane, TimelinePoints};

/// Items by the timeline values that must have passed.
#[derive(Debug)]
pub(crate) struct RetireQueue<T> {
    waiting: Mutex<BTreeMap<TimelinePoints, Vec<T>>>,
}

impl<T> RetireQueue<T> {
    pub(crate) fn new() -> Self {
        Self { waiting: Mutex::new(BTreeMap::new()) }
    }

    fn lock(&self) -> MutexGuard<'_, BTreeMap<TimelinePoints, Vec<T>>> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Keeps `item` until both timelines have reached `points`.
    pub(crate) fn push(&self, points: TimelinePoints, item: T) {
        self.lock().entry(points).or_default().push(item);
    }

    /// Everything whose points are at or below `completed` in both lanes, in the order of the main lane.
    pub(crate) fn take_ready(&self, completed: TimelinePoints) -> Vec<T> {
        let mut waiting = self.lock();
        // The map is sorted by the main lane first: what lies behind this range cannot be ready.
        let last = TimelinePoints([completed.of(QueueLane::Main), u64::MAX]);
        let keys = waiting.range(..=last).map(|(&points, _)| points);
        let ready: Vec<_> = keys.filter(|points| points.reached_by(completed)).collect();
        ready.iter().filter_map(|points| waiting.remove(points)).flatten().collect()
    }

    /// Whether nothing waits.
    pub(crate) fn is_empty(&self) -> bool {
        self.lock().is_empty()
    }

    /// The points after which everything waiting now can go; None when nothing waits.
    pub(crate) fn last_points(&self) -> Option<TimelinePoints> {
        self.lock().keys().copied().reduce(TimelinePoints::later)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn items_leave_in_order_of_their_points_and_not_before() {
        let queue = RetireQueue::new();
        for (point, item) in [(5, "e"), (2, "b"), (9, "i"), (2, "b2")] {
            queue.push(TimelinePoints([point, 0]), item);
        }
        assert_eq!(queue.take_ready(TimelinePoints([1, 9])), Vec::<&str>::new(), "nothing has passed");
        assert_eq!(queue.take_ready(TimelinePoints([5, 0])), ["b", "b2", "e"], "all at or below, oldest first");
        assert_eq!((queue.last_points(), queue.is_empty()), (Some(TimelinePoints([9, 0])), false), "one left");
        assert_eq!(queue.take_ready(TimelinePoints::END), ["i"], "everything, as after device loss");
        assert_eq!((queue.last_points(), queue.is_empty()), (None, true), "empty");
    }

    #[test]
    fn items_wait_for_both_lanes() {
        let queue = RetireQueue::new();
        // Points of two threads need not be ordered.
        for (points, item) in [([4, 4], "a"), ([5, 3], "b"), ([5, 9], "c")] {
            queue.push(TimelinePoints(points), item);
        }
        assert_eq!(queue.last_points(), Some(TimelinePoints([5, 9])), "the last of each lane");
        assert_eq!(queue.take_ready(TimelinePoints([9, 2])), Vec::<&str>::new(), "the transfer lane is behind");
        assert_eq!(queue.take_ready(TimelinePoints([4, 9])), ["a"], "the main lane is behind");
        assert_eq!(queue.take_ready(TimelinePoints([5, 3])), ["b"], "not the last one");
        assert_eq!(queue.take_ready(TimelinePoints([5, 9])), ["c"], "both there");
    }
}
