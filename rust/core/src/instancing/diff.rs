// SPDX-License-Identifier: Apache-2.0
//! Finds the instances of an instancer that differ between two sets of arrays, at the speed of memory: blocks are
//! compared as bytes, and groups of elements where a block differs, elements only where a group does. Pure; work is
//! spread over the caller's rayon pool.

use rayon::prelude::*;

use crate::array::TypedArray;

/// Largest number of changed instances that are looked up one by one.
const FEW: usize = 1 << 10;
/// Number of elements compared at a time.
const BLOCK: usize = 1 << 12;
/// The same where a block differs: of instances that are spread evenly, few differ in a group.
const GROUP: usize = 8;

/// Bits of those of at most 64 elements that differ.
fn differing(a: &[u8], b: &[u8], size: usize) -> u64 {
    // Those of translations, rotations, scales and matrices: a comparison of a known length is a few instructions.
    match size {
        6 => of_size::<6>(a, b),
        8 => of_size::<8>(a, b),
        12 => of_size::<12>(a, b),
        16 => of_size::<16>(a, b),
        24 => of_size::<24>(a, b),
        32 => of_size::<32>(a, b),
        64 => of_size::<64>(a, b),
        128 => of_size::<128>(a, b),
        _ => by_group(a, b, size, |a, b| bits(a.chunks(size).zip(b.chunks(size)))),
    }
}

fn of_size<const SIZE: usize>(a: &[u8], b: &[u8]) -> u64 {
    by_group(a, b, SIZE, |a, b| bits(a.as_chunks::<SIZE>().0.iter().zip(b.as_chunks::<SIZE>().0)))
}

fn by_group(a: &[u8], b: &[u8], size: usize, differing: impl Fn(&[u8], &[u8]) -> u64) -> u64 {
    let groups = a.chunks(GROUP * size).zip(b.chunks(GROUP * size)).enumerate();
    groups.fold(0, |word, (at, (a, b))| if a == b { word } else { word | (differing(a, b) << (GROUP * at)) })
}

fn bits<T: PartialEq>(pairs: impl Iterator<Item = (T, T)>) -> u64 {
    pairs.enumerate().fold(0, |word, (at, (a, b))| word | (u64::from(a != b) << at))
}

/// A set of instance numbers.
#[derive(Debug)]
pub(crate) struct ChangedNumbers {
    /// One bit for each number.
    bits: Vec<u64>,
    /// First number from which all are in the set, because one side does not have them.
    tail: usize,
    /// Number of instances in the set, after [`Self::counted`].
    len: usize,
}

impl ChangedNumbers {
    /// The instances that only one of two instancers with so many has.
    pub(super) fn of_lengths(old: usize, new: usize) -> Self {
        let [shorter, longer] = [old.min(new), old.max(new)];
        let tail = if shorter == longer { usize::MAX } else { shorter };
        Self { bits: Vec::new(), tail, len: longer - shorter }
    }

    /// Adds the instances whose elements differ bit for bit; returns false if the types do.
    pub(super) fn add(&mut self, old: &TypedArray, new: &TypedArray) -> bool {
        let is_comparable = old.element() == new.element();
        if is_comparable && old.identity() != new.identity() {
            self.add_bytes(old.view().bytes(), new.view().bytes(), old.element().size());
        }
        is_comparable
    }

    /// The same set, with the number of instances in it.
    pub(super) fn counted(mut self) -> Self {
        self.len += self.bits.par_iter().map(|word| word.count_ones() as usize).sum::<usize>();
        self
    }

    fn add_bytes(&mut self, old: &[u8], new: &[u8], size: usize) {
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
                *word |= differing(a, b, size);
            }
        });
    }

    /// Number of instances in the set.
    pub(crate) fn len(&self) -> usize {
        self.len
    }

    /// The instances, in order, if they are few and both sides have them.
    pub(crate) fn few(&self) -> Option<Vec<usize>> {
        self.listed(FEW)
    }

    /// The instances, in order, if they are no more than `most` and both sides have them.
    pub(crate) fn listed(&self, most: usize) -> Option<Vec<usize>> {
        if self.len > most || self.tail != usize::MAX {
            return None;
        }
        let words = self.bits.iter().enumerate().filter(|(_, word)| **word != 0);
        let mut numbers = Vec::with_capacity(self.len);
        for (at, word) in words {
            let mut left = *word;
            while left != 0 {
                numbers.push(64 * at + left.trailing_zeros() as usize);
                left &= left - 1;
            }
        }
        Some(numbers)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_elements_that_differ_are_found_whatever_their_size() {
        for size in [1, 2, 4, 6, 8, 12, 16, 24, 32, 64, 128] {
            for (count, other) in [(2 * BLOCK + 77, 2 * BLOCK + 77), (9000, 4000), (65, 63), (3, 3)] {
                let bytes = |length: usize| (0..=250_u8).cycle().take(length).collect::<Vec<_>>();
                let (old, mut new) = (bytes(count * size), bytes(other * size));
                let changed: Vec<usize> =
                    [0, 2, 62, 63, 64, 71, 4095, 4096, 8200].into_iter().filter(|at| *at < other).collect();
                // In the first byte of an element, the last one and one between.
                changed.iter().for_each(|at| new[at * size + at % size] ^= 1);
                let mut numbers = ChangedNumbers::of_lengths(count, other);
                numbers.add_bytes(&old, &new, size);
                let numbers = numbers.counted();
                let found: Vec<usize> = (0..count.min(other)).filter(|at| numbers.contains(*at)).collect();
                let expected: Vec<usize> = changed.iter().copied().filter(|at| *at < count).collect();
                assert_eq!(found, expected, "{count} and {other} elements of {size} bytes");
                assert_eq!(numbers.len(), expected.len() + count.abs_diff(other), "and counted");
            }
        }
    }
}
