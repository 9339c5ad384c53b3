// SPDX-License-Identifier: Apache-2.0
//! Buckets: intervals of an assembly's order that hold about as many items each, found from a sample before any item is
//! made, as samplesort does.
//!
//! The codes are divided into cells, which are Morton prefixes, finer where samples are dense. A cell with samples is a
//! bucket; items in cells without are strays, which are few. The choice of buckets affects only how much memory a
//! partition takes.

// Source: W. D. Frazer and A. C. McKellar, "Samplesort: a sampling approach to minimal storage tree sorting", Journal
// of the ACM 17, 1970.

use std::collections::BinaryHeap;
use std::ops::Range;

use super::lattice::MortonLattice;
use crate::instancing::item::PlacementItem;
use crate::instancing::run::{ItemBucketing, UNUSABLE};
use crate::mesh::Aabb;

/// Stands in place of a bucket for an item in a cell without samples.
pub(crate) const STRAY: u8 = UNUSABLE - 1;
/// Largest number of cells. Fits the 16 bits of [`OrderBuckets::first`].
const MAX_CELLS: usize = 4096;
/// Number of bits of a code that are looked up in tables.
const TABLE_BITS: u32 = 16;
/// At most one in so many samples at either end is outside the tables.
const FEW: usize = 64;
/// Number of samples that are wanted of an assembly.
const SAMPLES: u64 = 1 << 18;
/// Number of buckets that are partitioned at a time.
const BUCKETS_AT_ONCE: u64 = 8;

/// The buckets of an assembly's order.
#[derive(Debug)]
pub(crate) struct OrderBuckets {
    lattice: MortonLattice,
    cells: Vec<BucketCell>,
    /// The range of most codes: the smallest code, and the number of bits below those that the tables distinguish.
    dense: (u64, u32),
    /// Bucket by the upper bits of a code there, or [`UNUSABLE`] if cells begin among such codes.
    table: Vec<u8>,
    /// Cell of the smallest code by the upper bits; the last entry is that of the largest of all.
    first: Vec<u16>,
}

/// A Morton prefix.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct BucketCell {
    /// Its smallest code. It ends where the next one begins.
    pub(crate) start: u64,
    /// Its bucket, or [`STRAY`].
    pub(crate) bucket: u8,
}

/// A cell under construction; the fullest is the greatest.
#[derive(Debug, PartialEq, Eq, PartialOrd, Ord)]
struct OpenCell {
    samples: usize,
    start: u64,
    bits: u32,
    first: usize,
}

impl OrderBuckets {
    /// Distance between the samples of `records` placements.
    pub(crate) fn stride(records: u64) -> usize {
        usize::try_from(records / SAMPLES).unwrap_or(usize::MAX).max(1)
    }

    /// Buckets of an assembly of `records` placements, of which about `at_once` may become items at a time. The lattice
    /// is that of the samples, which most likely equals that of all members.
    pub(crate) fn of_samples(samples: &[(Aabb, PlacementItem)], records: u64, at_once: u64) -> Self {
        let bounds = samples.iter().fold(Aabb::EMPTY, |all, (bounds, _)| all.union(bounds));
        Self::on(MortonLattice::around(&bounds), samples, records, at_once)
    }

    /// As [`Self::of_samples`], on a given lattice.
    pub(crate) fn on(lattice: MortonLattice, samples: &[(Aabb, PlacementItem)], records: u64, at_once: u64) -> Self {
        let code = |(_, mut item): (Aabb, PlacementItem)| {
            lattice.place(&mut item, 0);
            item.code()
        };
        let mut codes: Vec<u64> = samples.iter().copied().map(code).collect();
        codes.sort_unstable();
        let full = (codes.len() as u64).saturating_mul(at_once) / records.max(1) / BUCKETS_AT_ONCE;
        Self::of_codes(lattice, &codes, usize::try_from(full).unwrap_or(usize::MAX).max(1))
    }

    /// Buckets of at most `full` of the sorted codes, if that is possible.
    fn of_codes(lattice: MortonLattice, codes: &[u64], full: usize) -> Self {
        let mut open = BinaryHeap::from([OpenCell { samples: codes.len(), start: 0, bits: 0, first: 0 }]);
        let mut done: Vec<OpenCell> = Vec::new();
        let mut buckets = usize::from(!codes.is_empty());
        while let Some(cell) = open.pop() {
            let range = codes.get(cell.first..cell.first + cell.samples).unwrap_or_default();
            let is_one = range.first() == range.last();
            if cell.samples <= full || is_one || buckets >= usize::from(STRAY) || done.len() + open.len() >= MAX_CELLS {
                let is_last = cell.samples <= full;
                done.push(cell);
                if is_last {
                    break;
                }
                continue;
            }
            let middle = cell.start | 1 << (63 - cell.bits);
            let below = range.partition_point(|&code| code < middle);
            buckets += usize::from(below > 0 && below < range.len());
            let (bits, first) = (cell.bits + 1, cell.first);
            open.push(OpenCell { samples: below, start: cell.start, bits, first });
            open.push(OpenCell { samples: range.len() - below, start: middle, bits, first: first + below });
        }
        done.extend(open);
        done.sort_unstable_by_key(|cell| cell.start);
        let mut next = 0;
        let mut number = |cell: OpenCell| {
            let bucket = if cell.samples == 0 { STRAY } else { next };
            next += u8::from(cell.samples > 0);
            BucketCell { start: cell.start, bucket }
        };
        let cells: Vec<BucketCell> = done.into_iter().map(&mut number).collect();
        // A few members far from the others do not make the tables coarse.
        let few = codes.len() / FEW;
        let [low, high] = [codes.get(few), codes.iter().rev().nth(few)].map(|code| code.copied().unwrap_or(0));
        let lower_bits = (u64::BITS - (low ^ high).leading_zeros()).saturating_sub(TABLE_BITS);
        let range_bits = lower_bits + TABLE_BITS;
        let start = if range_bits < u64::BITS { low >> range_bits << range_bits } else { 0 };
        let cell_of = |code| cells.partition_point(|cell: &BucketCell| cell.start <= code).saturating_sub(1);
        let lowest = |upper: u64| start | upper << lower_bits;
        let highest = |upper: u64| lowest(upper) | ((1 << lower_bits) - 1);
        let bucket = |upper: u64| {
            let [low, high] = [lowest(upper), highest(upper)].map(cell_of);
            cells.get(low).filter(|_| low == high).map_or(UNUSABLE, |cell| cell.bucket)
        };
        let last = (1 << TABLE_BITS) - 1;
        let table = (0..=last).map(bucket).collect();
        let firsts = (0..=last).map(|upper| cell_of(lowest(upper))).chain([cell_of(highest(last))]);
        let first = firsts.map(|cell| u16::try_from(cell).unwrap_or(u16::MAX)).collect();
        Self { lattice, cells, dense: (start, lower_bits), table, first }
    }

    /// The lattice of the codes.
    pub(crate) fn lattice(&self) -> MortonLattice {
        self.lattice
    }

    /// All cells, in order.
    pub(crate) fn cells(&self) -> &[BucketCell] {
        &self.cells
    }

    /// The bucket of a code.
    #[inline]
    fn of_code(&self, code: u64) -> u8 {
        let (start, lower_bits) = self.dense;
        let upper = usize::try_from(code.wrapping_sub(start) >> lower_bits).unwrap_or(usize::MAX);
        match self.table.get(upper) {
            Some(&bucket) if bucket != UNUSABLE => bucket,
            known => {
                let range = known.and_then(|_| self.first.get(upper..=upper + 1));
                let cells = match range {
                    Some(&[low, high]) => self.cells.get(usize::from(low)..=usize::from(high)).unwrap_or_default(),
                    _ => &self.cells[..],
                };
                let at = cells.partition_point(|cell| cell.start <= code).checked_sub(1);
                at.and_then(|at| cells.get(at)).map_or(STRAY, |cell| cell.bucket)
            }
        }
    }

    /// Ranges of cells into which cutting would divide all items: it cuts every range with more than `most` items. Each
    /// range has at most `most` items, by the number in each cell in `counts`, or is one cell. None is empty.
    pub(crate) fn cuts(&self, counts: &[u64], most: u64) -> Vec<Range<usize>> {
        let mut cuts = Vec::new();
        let all = 0..self.cells.len().min(counts.len());
        let mut open = vec![all];
        while let Some(range) = open.pop() {
            let is_full = |at: &usize| counts[*at] > 0;
            let (Some(first), Some(last)) = (range.clone().find(is_full), range.rev().find(is_full)) else { continue };
            let differing = self.cells[first].start ^ self.cells[last].start;
            if differing == 0 || counts[first..=last].iter().sum::<u64>() <= most {
                cuts.push(first..last + 1);
                continue;
            }
            // Cells are prefixes, and none contains another: the first bit in which two of them differ is that of their
            // members.
            let bit = 1_u64 << differing.ilog2();
            let at = first + self.cells[first..=last].partition_point(|cell| cell.start & bit == 0);
            open.extend([at..last + 1, first..at]);
        }
        cuts
    }
}

impl ItemBucketing for OrderBuckets {
    #[inline]
    fn bucket(&self, mut item: PlacementItem) -> u8 {
        self.lattice.place(&mut item, 0);
        self.of_code(item.code())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A mixed order of bits (G. Steele et al., "Fast splittable pseudorandom number generators", 2014).
    fn mixed(n: u64) -> u64 {
        let n = n.wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let n = (n ^ n >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let n = (n ^ n >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        n ^ n >> 31
    }

    /// Codes in clusters of several sizes, one deep in the order, and some of equal code.
    fn codes(count: u64) -> Vec<u64> {
        let code = |n: u64| match n % 4 {
            0 => mixed(n) >> 1,
            1 => 0x1234 << 48 | mixed(n) >> 34,
            2 => 0x1234_5678 << 32 | mixed(n) >> 55,
            _ => 0x7000 << 48 | u64::from(mixed(n) >> 63 == 0),
        };
        let mut codes: Vec<u64> = (0..count).map(code).collect();
        codes.sort_unstable();
        codes
    }

    #[test]
    fn cells_cover_all_codes_and_balance_samples() {
        let codes = codes(4000);
        let buckets = OrderBuckets::of_codes(MortonLattice::around(&Aabb::EMPTY), &codes, 50);
        let cells = buckets.cells();
        assert_eq!(cells[0].start, 0, "the first one");
        assert!(cells.is_sorted_by(|a, b| a.start < b.start), "in order");
        let mut counts = vec![0; usize::from(STRAY)];
        for (k, code) in codes.iter().chain(&[0, u64::MAX, 1 << 63, 0x1234 << 48]).enumerate() {
            let at = cells.iter().rposition(|cell| cell.start <= *code).expect("a cell begins at 0");
            assert_eq!(buckets.of_code(*code), cells[at].bucket, "bucket of {code:x}");
            if k < codes.len() {
                counts[usize::from(cells[at].bucket)] += 1;
            }
        }
        // Two codes a thousand times.
        assert_eq!(counts.iter().filter(|count| **count > 50).count(), 2, "{counts:?}");
        assert!(counts.iter().filter(|count| **count > 0).count() > 3000 / 50, "{counts:?}");
    }

    #[test]
    fn bucket_tables_resolve_dense_cells_beside_outliers() {
        let mut codes: Vec<u64> = (0..4000).map(|n| 0x0123_4567 << 32 | mixed(n) >> 34).chain([5, 1 << 62]).collect();
        codes.sort_unstable();
        let buckets = OrderBuckets::of_codes(MortonLattice::around(&Aabb::EMPTY), &codes, 50);
        let (start, lower_bits) = buckets.dense;
        let entry =
            |code: u64| buckets.table.get(usize::try_from(code.wrapping_sub(start) >> lower_bits).ok()?).copied();
        let found = codes.iter().filter(|code| entry(**code).is_some_and(|bucket| bucket != UNUSABLE)).count();
        assert!(found > 3800, "{found} of {} in the tables", codes.len());
        let outside = [0, 6, u64::MAX, 0x0123_4567 << 32, (0x0123_4567 << 32) - 1, 0x0123_4568 << 32, 1 << 62];
        for code in codes.iter().copied().chain(outside) {
            let cell = buckets.cells().iter().rfind(|cell| cell.start <= code).expect("a cell begins at 0");
            assert_eq!(buckets.of_code(code), cell.bucket, "bucket of {code:x}");
        }
    }

    /// The result of cutting more than `most` sorted codes in halves by their highest differing bit.
    fn cut(codes: &[u64], most: usize, out: &mut Vec<usize>) {
        let differing = codes.first().zip(codes.last()).map_or(0, |(first, last)| first ^ last);
        if codes.len() <= most || differing == 0 {
            out.push(codes.len());
            return;
        }
        let bit = 1_u64 << differing.ilog2();
        let (left, right) = codes.split_at(codes.partition_point(|code| code & bit == 0));
        cut(left, most, out);
        cut(right, most, out);
    }

    #[test]
    fn cuts_follow_the_morton_codes() {
        let codes = codes(40_000);
        // Samples miss the sparse cluster.
        let samples: Vec<u64> = codes.iter().copied().filter(|code| code >> 32 != 0x1234_5678).step_by(10).collect();
        let buckets = OrderBuckets::of_codes(MortonLattice::around(&Aabb::EMPTY), &samples, 20);
        let starts =
            |at: usize| buckets.cells().get(at).map_or(codes.len(), |cell| codes.partition_point(|c| *c < cell.start));
        let counts: Vec<u64> = (0..buckets.cells().len()).map(|at| (starts(at + 1) - starts(at)) as u64).collect();
        for most in [12_000, 6_000, 2_000] {
            let cuts = buckets.cuts(&counts, most);
            let lens = cuts.into_iter().map(|cells| usize::try_from(counts[cells].iter().sum::<u64>()).expect("small"));
            let mut expected = Vec::new();
            cut(&codes, usize::try_from(most).expect("small"), &mut expected);
            let is_one_cell = |len: usize| len as u64 > most;
            let mut expected = expected.into_iter();
            for len in lens {
                // A cell that is too large stays one.
                let mut sum = 0;
                while sum < len {
                    sum += expected.next().expect("no more than the codes");
                    assert!(sum == len || is_one_cell(len), "{sum} of {len}");
                }
            }
            assert_eq!(expected.next(), None, "all of them");
        }
    }
}
