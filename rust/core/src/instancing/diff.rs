// SPDX-License-Identifier: Apache-2.0
//! Finds the instances of an instancer that differ between two sets of arrays, at the speed of memory: blocks are
//! compared as bytes, elements only where a block differs. Pure; work is spread over the caller's rayon pool.

use rayon::prelude::*;

use super::instance_primvars::MemberPrimvar;
use super::placement::InstanceArrays;
use crate::array::TypedArray;

/// Number of elements compared at a time.
const BLOCK: usize = 1 << 12;

/// A set of instance numbers.
#[derive(Debug)]
pub(crate) struct ChangedNumbers {
    /// One bit for each number.
    bits: Vec<u64>,
    /// First number from which all are in the set, because one side does not have them.
    tail: usize,
    len: usize,
}

impl ChangedNumbers {
    /// The instances whose elements differ bit for bit, or that only one side has; `None` unless both have the same
    /// arrays, of the same types, and equal masks.
    pub(crate) fn between(old: &InstanceArrays, new: &InstanceArrays) -> Option<Self> {
        let [old_mask, old_arrays @ ..] = old.all();
        let [new_mask, new_arrays @ ..] = new.all();
        let same_mask = match (old_mask, new_mask) {
            (None, None) => true,
            (Some(a), Some(b)) => a.same_contents(b),
            _ => false,
        };
        let [shorter, longer] = [old.len().min(new.len()), old.len().max(new.len())];
        let tail = if shorter == longer { usize::MAX } else { shorter };
        let mut numbers = Self { bits: Vec::new(), tail, len: longer - shorter };
        for pair in old_arrays.into_iter().zip(new_arrays) {
            match pair {
                (None, None) => {}
                (Some(a), Some(b)) if same_mask && a.element() == b.element() => {
                    if a.identity() != b.identity() {
                        numbers.add(a.view().bytes(), b.view().bytes(), a.element().size());
                    }
                }
                _ => return None,
            }
        }
        numbers.len += numbers.bits.par_iter().map(|word| word.count_ones() as usize).sum::<usize>();
        same_mask.then_some(numbers)
    }

    /// The instances that have another value in one of these lists; `None` unless both have the same primvars, of the
    /// same types.
    pub(crate) fn of_values(old: &[MemberPrimvar], new: &[MemberPrimvar]) -> Option<Self> {
        let mut numbers = Self { bits: Vec::new(), tail: usize::MAX, len: 0 };
        let mut add = |a: &TypedArray, b: &TypedArray| {
            let comparable = a.element() == b.element() && a.len() == b.len();
            if comparable && a.identity() != b.identity() {
                numbers.add(a.view().bytes(), b.view().bytes(), a.element().size());
            }
            comparable
        };
        for (old, new) in old.iter().zip(new) {
            let comparable = match (old.primvar.arrays(), new.primvar.arrays()) {
                ((a, None), (b, None)) => add(a, b),
                ((a, Some(i)), (b, Some(j))) => a.same_contents(b) && add(i, j),
                _ => false,
            };
            if old.id != new.id || !comparable {
                return None;
            }
        }
        (old.len() == new.len()).then_some(numbers)
    }

    fn add(&mut self, old: &[u8], new: &[u8], size: usize) {
        let words = old.len().max(new.len()).div_ceil(size).div_ceil(64);
        if self.bits.len() < words {
            // The system usually zeroes this memory.
            let known = std::mem::replace(&mut self.bits, vec![0; words]);
            self.bits.iter_mut().zip(known).for_each(|(word, known)| *word = known);
        }
        let blocks = old.par_chunks(BLOCK * size).zip(new.par_chunks(BLOCK * size));
        blocks.zip(self.bits.par_chunks_mut(BLOCK / 64)).filter(|((a, b), _)| a != b).for_each(|((a, b), words)| {
            let elements = a.chunks(64 * size).zip(b.chunks(64 * size));
            for ((a, b), word) in elements.zip(words) {
                for (at, (a, b)) in a.chunks(size).zip(b.chunks(size)).enumerate() {
                    *word |= u64::from(a != b) << at;
                }
            }
        });
    }

    /// Returns true if so many changed that a run of `ranks` instances is better scanned anew.
    pub(crate) fn is_most_of(&self, ranks: u32) -> bool {
        self.len > 8 + ranks as usize / 4
    }

    /// Returns true if `number` is one of them.
    #[inline]
    pub(crate) fn contains(&self, number: usize) -> bool {
        number >= self.tail || self.bits.get(number / 64).is_some_and(|word| word >> (number % 64) & 1 == 1)
    }
}
