// SPDX-License-Identifier: Apache-2.0
//! Which parts of a ring are taken. Pure bookkeeping, no Vulkan, no locks.
//!
//! Parts are taken in the order of the ring and may be given back in any order; space is free again when all older
//! parts are back, or all newer ones. Guarantee: parts that are taken do not overlap.

use std::collections::VecDeque;

use crate::instance::lane::QueueLane;

/// One part of the ring.
#[derive(Debug)]
struct RingPart {
    start: u64,
    end: u64,
    /// Given back, and waiting for older ones.
    returned: bool,
    /// The lane that used it last: whom to wait for.
    user: Option<QueueLane>,
}

/// A ring of bytes.
#[derive(Debug)]
pub(crate) struct RingSpace {
    bytes: u64,
    /// Oldest first. `end` of the newest is where the next one may begin.
    parts: VecDeque<RingPart>,
    /// Number of the oldest part; later ones count up from it.
    oldest: u64,
}

impl RingSpace {
    pub(crate) fn new(bytes: u64) -> Self {
        Self { bytes, parts: VecDeque::new(), oldest: 0 }
    }

    /// Takes `bytes` (not 0) at a multiple of `align`; gives the part's number and its start. None = not now. Numbers
    /// are used again once the part is back.
    pub(crate) fn take(&mut self, bytes: u64, align: u64) -> Option<(u64, u64)> {
        let start = self.place(bytes, align)?;
        self.parts.push_back(RingPart { start, end: start + bytes, returned: false, user: None });
        Some((self.oldest + self.parts.len() as u64 - 1, start))
    }

    /// Where the next part of this size can be.
    fn place(&self, bytes: u64, align: u64) -> Option<u64> {
        let ends_by = |start: u64, limit: u64| start.checked_add(bytes).is_some_and(|end| end <= limit);
        let (Some(oldest), Some(newest)) = (self.parts.front(), self.parts.back()) else {
            return ends_by(0, self.bytes).then_some(0);
        };
        let next = newest.end.checked_next_multiple_of(align)?;
        // Parts are not empty, so the newest begins before the oldest exactly when the ring has come round.
        let wrapped = newest.start < oldest.start;
        if wrapped {
            ends_by(next, oldest.start).then_some(next)
        } else if ends_by(next, self.bytes) {
            Some(next)
        } else {
            ends_by(0, oldest.start).then_some(0)
        }
    }

    /// Gives a part back, once. True when space became free by it.
    pub(crate) fn give_back(&mut self, number: u64) -> bool {
        if let Some(part) = self.part(number) {
            part.returned = true;
        }
        let before = self.parts.len();
        while self.parts.back().is_some_and(|part| part.returned) {
            self.parts.pop_back();
        }
        while self.parts.front().is_some_and(|part| part.returned) {
            self.parts.pop_front();
            self.oldest += 1;
        }
        self.parts.len() < before
    }

    fn part(&mut self, number: u64) -> Option<&mut RingPart> {
        let index = number.checked_sub(self.oldest).and_then(|i| usize::try_from(i).ok())?;
        self.parts.get_mut(index)
    }

    /// A list of `lane` uses a part.
    pub(crate) fn used_by(&mut self, number: u64, lane: QueueLane) {
        if let Some(part) = self.part(number) {
            part.user = Some(lane);
        }
    }

    /// The user of the part that must come back before anything becomes free, if it has one.
    pub(crate) fn oldest_user(&self) -> Option<QueueLane> {
        self.parts.front()?.user
    }

    /// Bytes that cannot be taken now, gaps included.
    pub(crate) fn used(&self) -> u64 {
        match (self.parts.front(), self.parts.back()) {
            (Some(oldest), Some(newest)) if newest.start < oldest.start => self.bytes - oldest.start + newest.end,
            (Some(oldest), Some(newest)) => newest.end - oldest.start,
            _ => 0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ring_comes_round_and_waits_for_the_oldest() {
        let mut ring = RingSpace::new(100);
        assert_eq!(ring.take(40, 1), Some((0, 0)), "at the start");
        assert_eq!(ring.take(20, 16), Some((1, 48)), "aligned");
        assert_eq!(ring.take(10, 1), Some((2, 68)), "behind it");
        assert_eq!(ring.take(30, 1), None, "neither behind the newest nor before the oldest");
        assert!(!ring.give_back(1), "in the middle: nothing is free yet");
        assert_eq!((ring.take(30, 1), ring.used()), (None, 78), "still");
        assert!(ring.give_back(2), "the newest: that and the one before it are free");
        assert_eq!(ring.used(), 40, "only the oldest is left");
        assert_eq!(ring.take(60, 1), Some((1, 40)), "up to the end");
        ring.used_by(1, QueueLane::Transfer);
        assert_eq!(ring.oldest_user(), None, "that is the newest");
        assert!(ring.give_back(0), "the oldest");
        assert_eq!((ring.oldest_user(), ring.used()), (Some(QueueLane::Transfer), 60), "now it is the oldest");
        assert_eq!((ring.take(40, 1), ring.take(1, 1)), (Some((2, 0)), None), "wrapped, exactly full");
        assert_eq!((ring.give_back(1), ring.used()), (true, 40), "the end");
        assert_eq!((ring.give_back(2), ring.used()), (true, 0), "empty");
        assert_eq!(ring.take(100, 64), Some((2, 0)), "exactly the whole ring");
        assert_eq!(ring.take(1, 1), None, "full");
        assert!(ring.give_back(2), "empty again");
        assert!(ring.take(50, 1).is_some(), "the first half");
        assert_eq!(ring.take(51, 1), None, "the first half is taken");
        assert_eq!(ring.take(u64::MAX, 1), None, "no overflow");
    }

    #[test]
    fn taken_parts_never_overlap() {
        let mut random = 1_u64;
        let mut next = |below: u64| {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (random >> 33) % below
        };
        let mut ring = RingSpace::new(1000);
        let mut held: Vec<(u64, u64, u64)> = Vec::new();
        let mut taken = 0;
        for _ in 0..20_000 {
            let (bytes, align) = (1 + next(300), 1 << next(7));
            match ring.take(bytes, align) {
                Some((number, start)) => {
                    assert!(start.is_multiple_of(align) && start + bytes <= 1000, "{bytes} at {start}, align {align}");
                    let apart = |&(_, from, to): &(u64, u64, u64)| start >= to || start + bytes <= from;
                    assert!(held.iter().all(apart), "{bytes} at {start} in {held:?}");
                    held.push((number, start, start + bytes));
                    taken += 1;
                }
                None => assert!(!held.is_empty(), "{bytes} bytes fit in an empty ring"),
            }
            if next(2) == 0 && !held.is_empty() {
                let length = held.len() as u64;
                let (number, ..) = held.swap_remove(usize::try_from(next(length)).expect("small"));
                ring.give_back(number);
            }
        }
        assert!(taken > 5000, "only {taken} of 20000 were served");
        for (number, ..) in held {
            ring.give_back(number);
        }
        assert_eq!(ring.used(), 0, "all came back");
    }
}
