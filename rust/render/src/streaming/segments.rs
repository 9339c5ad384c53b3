// SPDX-License-Identifier: Apache-2.0
//! The paths under way: segments, each a contiguous range of paths with a place for the radiance of each. There are
//! more places than slots (paths in flight): a path that ends gives its slot to a new one and leaves only its radiance
//! behind.
//!
//! A segment is added to the film when all its paths are dead and every earlier segment has been added: samples of a
//! pixel are summed in ascending order whatever came back first.
//!
//! When all segments are in use, the paths that keep the oldest ones alive wait for chunks that few others want. If a
//! new segment began for each that ends, its camera rays would evict those chunks again; so no segment begins until all
//! are free: the chunks of the stragglers are loaded once for all paths that wait for them (measured: decisions/0002).
//! Pure.

use crate::wave::Wave;
use std::collections::VecDeque;

/// A segment under way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct LiveSegment {
    /// Its number; its places are `index * size ..`.
    pub(crate) index: u32,
    /// Slots that were taken before it.
    pub(crate) first_slot: u64,
    /// The paths of the segment.
    pub(crate) wave: Wave,
}

/// The segments under way and the paths that have not begun.
#[derive(Debug)]
pub(crate) struct SegmentQueue {
    size: u32,
    /// Paths that may be in flight.
    slots: u64,
    /// Number of segments.
    count: usize,
    free: VecDeque<u32>,
    /// True if all segments have been in use, and not all are free again.
    draining: bool,
    /// The segments under way, oldest first.
    alive: VecDeque<LiveSegment>,
    /// The film has the paths before it.
    base: u64,
    next: u64,
    total: u64,
    /// Paths from here on may not begin yet.
    open: u64,
    /// Paths that no segment may cross, ascending.
    cuts: Vec<u64>,
}

impl SegmentQueue {
    /// `count` segments of `size` places for `total` paths, of which `slots` may be in flight.
    pub(crate) fn new(count: u32, size: u32, slots: u32, total: u64) -> Self {
        let free: VecDeque<u32> = (0..count).collect();
        let (count, slots) = (free.len(), u64::from(slots));
        let (alive, cuts) = (VecDeque::new(), Vec::new());
        Self { size, slots, count, free, draining: false, alive, base: 0, next: 0, total, open: total, cuts }
    }

    /// Lets the first segment begin at this path.
    pub(crate) fn begin_at(self, path: u64) -> Self {
        Self { base: path, next: path, ..self }
    }

    /// Slots that were taken so far.
    fn taken(&self) -> u64 {
        self.next - self.base
    }

    /// Gives a free segment the next paths; returns `None` if there is no free segment, no path left, or no slot:
    /// `ended` paths have given theirs back so far.
    pub(crate) fn start(&mut self, ended: u64) -> Option<LiveSegment> {
        if !self.can_start(ended) {
            return None;
        }
        // Slots are taken in turns, and no segment has some of one turn and some of the next.
        let turn = self.slots - self.taken() % self.slots.max(1);
        let cut = self.cuts.iter().find(|cut| **cut > self.next).map_or(u64::MAX, |cut| cut - self.next);
        let left = self.end().saturating_sub(self.next).min(turn).min(cut);
        let count = u32::try_from(left.min(u64::from(self.size))).unwrap_or(self.size);
        if count == 0 {
            return None;
        }
        let index = self.free.pop_front()?;
        let segment = LiveSegment { index, first_slot: self.taken(), wave: Wave { first: self.next, count } };
        self.draining = self.free.is_empty();
        self.next += u64::from(count);
        self.alive.push_back(segment);
        Some(segment)
    }

    /// Takes the oldest segment if it is finished.
    pub(crate) fn take_finished(&mut self, is_finished: impl Fn(&LiveSegment) -> bool) -> Option<LiveSegment> {
        let oldest = *self.alive.front()?;
        if !is_finished(&oldest) {
            return None;
        }
        self.alive.pop_front();
        self.free.push_back(oldest.index);
        self.draining &= self.free.len() < self.count;
        Some(oldest)
    }

    /// Lets paths before `open` begin, except those beyond the total.
    pub(crate) fn open_to(&mut self, open: u64) {
        self.open = open;
    }

    /// Lets no more paths begin, whatever is opened later; returns the first that has not begun.
    pub(crate) fn close(&mut self) -> u64 {
        self.total = self.next;
        self.next
    }

    /// Ends segments at these paths, ascending.
    pub(crate) fn cut_at(&mut self, cuts: Vec<u64>) {
        self.cuts = cuts;
    }

    fn end(&self) -> u64 {
        self.total.min(self.open)
    }

    /// Returns true if every path that may begin has been taken.
    pub(crate) fn is_done(&self) -> bool {
        self.alive.is_empty() && self.next >= self.end()
    }

    /// The oldest segment under way.
    pub(crate) fn oldest(&self) -> Option<LiveSegment> {
        self.alive.front().copied()
    }

    /// Paths of the segments that were begun after `step`; `begun` has the step of each segment.
    pub(crate) fn begun_after(&self, step: u64, begun: &[u64]) -> u64 {
        let after = |segment: &&LiveSegment| begun.get(segment.index as usize).is_some_and(|begun| *begun > step);
        self.alive.iter().filter(after).map(|segment| u64::from(segment.wave.count)).sum()
    }

    /// Paths that are not yet begun.
    pub(crate) fn unbegun(&self) -> u64 {
        self.end().saturating_sub(self.next)
    }

    /// Returns true if a segment could begin when `ended` paths have given their slots back; false while the last ones
    /// of a full set of segments end.
    pub(crate) fn can_start(&self, ended: u64) -> bool {
        !self.draining
            && !self.free.is_empty()
            && self.next < self.end()
            && self.taken() + u64::from(self.size) <= self.slots + ended
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_come_back_in_order_and_once() {
        let mut segments = SegmentQueue::new(3, 10, 30, 45);
        let begun: Vec<_> = std::iter::from_fn(|| segments.start(0)).collect();
        assert_eq!(begun.len(), 3, "as many as there are slots");
        assert!(segments.take_finished(|segment| segment.index != 0).is_none(), "the oldest has paths alive");
        let mut firsts = Vec::new();
        while !segments.is_done() {
            while let Some(segment) = segments.take_finished(|_| true) {
                firsts.push((segment.wave.first, segment.wave.count));
            }
            while segments.start(firsts.len() as u64 * 10).is_some() {}
        }
        assert_eq!(firsts, [(0, 10), (10, 10), (20, 10), (30, 10), (40, 5)], "ascending, without gaps");
    }

    #[test]
    fn a_full_set_of_segments_ends_before_the_next_begins() {
        let mut segments = SegmentQueue::new(3, 10, 1000, 60);
        for ended in [0, 0, 0] {
            assert!(segments.start(ended).is_some(), "free segments and slots");
        }
        for left in [2, 1] {
            assert!(segments.take_finished(|_| true).is_some(), "the oldest has ended");
            assert!(
                segments.start(30).is_none(),
                "{left} of the set are left: camera rays would take their chunks away"
            );
        }
        assert!(segments.take_finished(|_| true).is_some(), "the last of the set");
        assert_eq!(segments.start(30).map(|segment| segment.wave.first), Some(30), "the next set begins");
        assert!(segments.take_finished(|_| true).is_some(), "alone");
        assert!(segments.start(40).is_some(), "a set that was never full goes on");
    }

    #[test]
    fn segments_behind_a_film_take_slots_from_the_first_on() {
        let mut segments = SegmentQueue::new(2, 10, 20, 1045).begin_at(1000);
        let begun: Vec<_> = std::iter::from_fn(|| segments.start(0)).collect();
        let of = |segment: &LiveSegment| (segment.wave.first, segment.first_slot);
        assert_eq!(begun.iter().map(of).collect::<Vec<_>>(), [(1000, 0), (1010, 10)], "as many as there are slots");
        assert_eq!(segments.unbegun(), 25, "what the film has is not to begin");
    }

    #[test]
    fn segments_begin_only_when_enough_paths_have_ended() {
        let mut segments = SegmentQueue::new(8, 10, 20, 100);
        assert!(segments.start(0).is_some() && segments.start(0).is_some(), "twenty slots");
        assert!(segments.start(9).is_none(), "one slot too few");
        assert_eq!(segments.start(10).map(|segment| segment.first_slot), Some(20), "the slots of ended paths");
    }
}
