// SPDX-License-Identifier: Apache-2.0
//! The traversal stack of a ray: node references with the distance at which the ray enters them.

use crate::node::EnteredChildren;
use oocpt_abi::{DONE, RETURN};

/// A node reference in the low half, the entry distance in the high half. Bits of floats that are not negative have the
/// order of the floats, so keys sort by distance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct StackKey(u64);

impl StackKey {
    /// The end of the traversal.
    pub(super) const DONE: Self = Self::new(DONE, 0.0);
    /// The end of an instance: the ray goes back to the space that it came from.
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

/// A stack of fixed capacity.
#[derive(Debug)]
pub(super) struct TraversalStack {
    keys: Box<[StackKey]>,
    top: usize,
    /// The traversal since [`Self::reset`] has skipped something: the stack was full, or instances were nested too
    /// deeply, or it took too many steps.
    pub(super) overflowed: bool,
}

impl TraversalStack {
    pub(super) fn new(size: usize) -> Self {
        Self { keys: vec![StackKey::DONE; size].into_boxed_slice(), top: 0, overflowed: false }
    }

    /// Empties the stack but for [`StackKey::DONE`].
    #[inline(always)]
    pub(super) fn reset(&mut self) {
        (self.top, self.overflowed) = (0, false);
        self.push(StackKey::DONE);
    }

    /// False if there is no room.
    #[inline(always)]
    pub(super) fn push(&mut self, key: StackKey) -> bool {
        match self.keys.get_mut(self.top) {
            Some(slot) => {
                *slot = key;
                self.top += 1;
                true
            }
            None => {
                self.overflowed = true;
                false
            }
        }
    }

    /// The next node that the ray enters before `limit`, or an end.
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

    /// The nearest of the children that the ray enters; the others are pushed, the farthest first. Pops if there are
    /// none. `child` gives the reference of a lane.
    #[inline(always)]
    pub(super) fn push_entered(
        &mut self,
        entered: EnteredChildren,
        limit: f32,
        child: impl Fn(u32) -> u32,
    ) -> StackKey {
        let mut mask = entered.mask;
        let mut next = || {
            let lane = mask.trailing_zeros();
            mask &= mask.wrapping_sub(1);
            StackKey::new(child(lane), entered.entries[lane as usize & 3])
        };
        match entered.mask.count_ones() {
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
