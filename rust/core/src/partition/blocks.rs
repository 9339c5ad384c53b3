// SPDX-License-Identifier: Apache-2.0
//! Boxes of stretches of a chunk's records, so that an edit of a few records needs not measure all others again.
//!
//! A block knows the outermost numbers of its records and how many records reach each: as long as one that does stays,
//! taking records out changes nothing. How a chunk is divided into blocks depends on its past, what all blocks together
//! say does not: maxima of numbers that follow from each record alone.

use super::lattice::MortonLattice;
use crate::instancing::item::PlacementItem;

/// Records of a new block.
pub(crate) const BLOCK: u32 = 256;

/// Outermost numbers of some records: lower corner (negative), upper corner, largest spread, 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RecordPeaks(pub(crate) [f32; 8]);

/// Consecutive records of a chunk.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RecordBlock {
    /// Morton code of the first one.
    pub(crate) first: u64,
    peaks: [f32; 7],
    /// Number of records.
    pub(crate) len: u32,
    /// Records that reach each peak.
    ties: [u16; 7],
}

impl RecordPeaks {
    /// Of no record.
    pub(crate) const NONE: Self = Self([f32::NEG_INFINITY; 8]);

    /// Of both.
    #[inline]
    pub(crate) fn max(self, other: Self) -> Self {
        Self(std::array::from_fn(|k| if other.0[k] > self.0[k] { other.0[k] } else { self.0[k] }))
    }
}

impl RecordBlock {
    /// The blocks of sorted items.
    pub(crate) fn of<'a>(items: impl Iterator<Item = &'a PlacementItem>, lattice: &MortonLattice) -> Vec<Self> {
        let mut blocks = Vec::new();
        let mut open = OpenBlock::new(0);
        for item in items {
            if open.len == 0 {
                open = OpenBlock::new(item.code());
            }
            open.add(lattice.peaks(item));
            if open.len == BLOCK {
                blocks.push(open.close());
                open.len = 0;
            }
        }
        if open.len > 0 {
            blocks.push(open.close());
        }
        blocks
    }

    /// True when the block is one of these items, whatever it was before.
    pub(crate) fn is_of(&self, items: &[PlacementItem], lattice: &MortonLattice) -> bool {
        let mut block = Self { len: 0, peaks: [f32::NEG_INFINITY; 7], ..*self };
        items.iter().for_each(|item| block.add(lattice.peaks(item)));
        *self == block && items.first().is_some_and(|item| item.code() == self.first)
    }

    /// The outermost numbers.
    pub(crate) fn peaks(&self) -> RecordPeaks {
        let [a, b, c, d, e, f, g] = self.peaks;
        RecordPeaks([a, b, c, d, e, f, g, 0.0])
    }

    /// Puts records in.
    pub(crate) fn add(&mut self, item: RecordPeaks) {
        for ((peak, ties), v) in self.peaks.iter_mut().zip(&mut self.ties).zip(item.0) {
            if v > *peak {
                (*peak, *ties) = (v, 1);
            } else if v == *peak {
                *ties = ties.saturating_add(1);
            }
        }
        self.len += 1;
    }

    /// Takes a record out; false when what is left must be measured.
    #[must_use]
    pub(crate) fn remove(&mut self, item: RecordPeaks) -> bool {
        let mut known = true;
        for ((peak, ties), v) in self.peaks.iter().zip(&mut self.ties).zip(item.0) {
            if v >= *peak {
                *ties = ties.saturating_sub(1);
                known &= *ties > 0;
            }
        }
        self.len = self.len.saturating_sub(1);
        known
    }
}

/// A block in the making.
struct OpenBlock {
    first: u64,
    len: u32,
    peaks: [f32; 8],
    ties: [u32; 8],
}

impl OpenBlock {
    fn new(first: u64) -> Self {
        Self { first, len: 0, peaks: RecordPeaks::NONE.0, ties: [0; 8] }
    }

    #[inline]
    fn add(&mut self, item: RecordPeaks) {
        for k in 0..8 {
            let (v, peak) = (item.0[k], self.peaks[k]);
            let kept = if v > peak { 0 } else { self.ties[k] };
            self.ties[k] = kept + u32::from(v >= peak);
            self.peaks[k] = if v > peak { v } else { peak };
        }
        self.len += 1;
    }

    fn close(&self) -> RecordBlock {
        let [a, b, c, d, e, f, g, _] = self.peaks;
        let mut ties = [0; 7];
        for (to, from) in ties.iter_mut().zip(self.ties) {
            // At most BLOCK.
            *to = u16::try_from(from).unwrap_or(u16::MAX);
        }
        RecordBlock { first: self.first, peaks: [a, b, c, d, e, f, g], len: self.len, ties }
    }
}
