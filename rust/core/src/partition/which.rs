// SPDX-License-Identifier: Apache-2.0
//! Stores small numbers, one for each record of a chunk, in as few bytes as the largest of them needs: most chunks have
//! records of fewer than 256 members.

use std::ops::Range;

/// Numbers below a limit that is known beforehand.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum IndexSet {
    Bytes(Vec<u8>),
    Shorts(Vec<u16>),
    Words(Vec<u32>),
}

impl IndexSet {
    /// A set without numbers.
    pub(crate) const NONE: Self = Self::Bytes(Vec::new());

    /// A set of all `numbers`, which are below `limit`.
    pub(crate) fn of(numbers: impl Iterator<Item = u32>, limit: usize) -> Self {
        if limit <= 1 << 8 {
            Self::Bytes(numbers.map(|n| u8::try_from(n).unwrap_or(u8::MAX)).collect())
        } else if limit <= 1 << 16 {
            Self::Shorts(numbers.map(|n| u16::try_from(n).unwrap_or(u16::MAX)).collect())
        } else {
            Self::Words(numbers.collect())
        }
    }

    /// Number `at`.
    #[inline]
    pub(crate) fn get(&self, at: usize) -> Option<u32> {
        match self {
            Self::Bytes(numbers) => numbers.get(at).copied().map(u32::from),
            Self::Shorts(numbers) => numbers.get(at).copied().map(u32::from),
            Self::Words(numbers) => numbers.get(at).copied(),
        }
    }

    /// The numbers of a range, as far as there are.
    pub(crate) fn range(&self, range: Range<usize>) -> impl Iterator<Item = u32> {
        range.map_while(|at| self.get(at))
    }

    /// Returns true if there is no number.
    pub(crate) fn is_empty(&self) -> bool {
        self.get(0).is_none()
    }

    /// Bytes of host memory held.
    pub(crate) fn host_bytes(&self) -> usize {
        match self {
            Self::Bytes(numbers) => numbers.capacity(),
            Self::Shorts(numbers) => numbers.capacity() * size_of::<u16>(),
            Self::Words(numbers) => numbers.capacity() * size_of::<u32>(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packed_numbers_round_trip_at_every_width() {
        for (limit, bytes) in [(256_u32, 1), (257, 2), (65_536, 2), (65_537, 4)] {
            let which = IndexSet::of(0..limit, limit as usize);
            assert!(which.range(0..limit as usize + 1).eq(0..limit), "numbers below {limit}");
            let held = which.host_bytes();
            assert!((bytes * limit as usize..2 * bytes * limit as usize).contains(&held), "{held} for {limit}");
        }
        assert!(IndexSet::NONE.is_empty() && !IndexSet::of([0].into_iter(), 2).is_empty(), "none is empty");
    }
}
