// SPDX-License-Identifier: Apache-2.0
//! What a ray comes back to: references with the distance at which the ray enters them. Pure, any thread.

use crate::node::EnteredChildren;
use oocpt_abi::{DONE, RETURN};

/// A reference, and above it where the ray enters it: bits of distances that are not negative are in their order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct StackKey(u64);

impl StackKey {
    pub(super) const DONE: Self = Self::new(DONE, 0.0);
    pub(super) const RETURN: Self = Self::new(RETURN, 0.0);

    #[inline(always)]
    pub(super) const fn new(reference: u32, entry: f32) -> Self {
        Self((entry.to_bits() as u64) << 32 | reference as u64)
    }

    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "the lower half")]
    pub(super) fn reference(self) -> u32 {
        self.0 as u32
    }

    #[inline(always)]
    pub(super) fn entry(self) -> f32 {
        f32::from_bits((self.0 >> 32) as u32)
    }
}

/// See the module.
#[derive(Debug)]
pub(super) struct TraversalStack {
    keys: Box<[StackKey]>,
    top: usize,
    pub(super) overflowed: bool,
}

impl TraversalStack {
    pub(super) fn new(size: usize) -> Self {
        Self { keys: vec![StackKey::DONE; size].into_boxed_slice(), top: 0, overflowed: false }
    }

    /// Nothing is left but the end of the walk.
    #[inline(always)]
    pub(super) fn reset(&mut self) {
        (self.top, self.overflowed) = (0, false);
        self.push(StackKey::DONE);
    }

    /// False where there is no room.
    #[inline(always)]
    pub(super) fn push(&mut self, key: StackKey) -> bool {
        match self.keys.get_mut(self.top) {
            Some(place) => {
                *place = key;
                self.top += 1;
                true
            }
            None => {
                self.overflowed = true;
                false
            }
        }
    }

    /// The next one that is entered before `limit`, or an end.
    #[inline(always)]
    pub(super) fn pop(&mut self, limit: f32) -> StackKey {
        while let Some(top) = self.top.checked_sub(1) {
            self.top = top;
            let Some(&key) = self.keys.get(top) else { break };
            if key.entry() <= limit || key.reference() >= RETURN {
                return key;
            }
        }
        StackKey::DONE
    }

    /// Of the children that are met the nearest; the others are pushed, the farthest first. Without any, the next one
    /// of the stack.
    #[inline(always)]
    pub(super) fn choose(&mut self, met: EnteredChildren, limit: f32, child: impl Fn(u32) -> u32) -> StackKey {
        let mut mask = met.mask;
        let mut next = || {
            let lane = mask.trailing_zeros();
            mask &= mask.wrapping_sub(1);
            StackKey::new(child(lane), met.entries[lane as usize & 3])
        };
        match met.mask.count_ones() {
            0 => self.pop(limit),
            1 => next(),
            2 => {
                let [near, far] = sorted(next(), next());
                self.push(far);
                near
            }
            count => {
                let [near, far] = sorted(next(), next());
                let third = next();
                let [near, third] = sorted(near, third);
                let [middle, far] = sorted(far, third);
                if count == 3 {
                    self.push(far);
                    self.push(middle);
                    return near;
                }
                let [near, fourth] = sorted(near, next());
                let [middle, fourth] = sorted(middle, fourth);
                let [far, farthest] = sorted(far, fourth);
                self.push(farthest);
                self.push(far);
                self.push(middle);
                near
            }
        }
    }
}

#[inline(always)]
fn sorted(a: StackKey, b: StackKey) -> [StackKey; 2] {
    [a.min(b), a.max(b)]
}
