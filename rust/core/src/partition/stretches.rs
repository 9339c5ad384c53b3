// SPDX-License-Identifier: Apache-2.0
//! Partitions more placements than may be items at once: the order of an assembly is processed in stretches, and items
//! exist only while their stretch is sorted and cut. Each placement is measured a second time for that.
//!
//! A stretch consists of whole cells of the cutter, chosen by the number of items in each bucket; so the chunks equal
//! those of cutting everything together.

use std::ops::Range;
use std::sync::Arc;

use rayon::prelude::*;

use super::buckets::{OrderBuckets, STRAY};
use super::cells::{ChunkCutter, OrderPiece};
use super::chunk::Chunk;
use crate::instancing::assembly::AssemblyMember;
use crate::instancing::item::PlacementItem;
use crate::instancing::run::RunReader;

/// Number of ranks read by one task.
const TASK: usize = 1 << 14;
/// Members with fewer placements become items at once.
const FEW: usize = 256;
/// Number of ranks that are tested together for being in a stretch.
const LANES: usize = 32;
/// Number of ranks that are measured together.
const BATCH: usize = 64;
/// Bytes of a placement that a chunk keeps, of the 24 of an item: as chunks are made, less memory remains for items.
const KEPT_SHARE: u64 = 6;

/// The inputs of a partition in stretches.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RankStretches<'a> {
    pub(crate) cutter: &'a ChunkCutter<'a>,
    pub(crate) buckets: &'a OrderBuckets,
    /// Largest number of items at once.
    pub(crate) most: u64,
}

/// Ranks of one member.
struct StretchTask<'a> {
    member: u32,
    reader: &'a RunReader<'a>,
    first: u32,
    /// Bucket of each rank.
    buckets: &'a [u8],
    /// Buckets in use, in order, with the number of ranks.
    counts: Vec<(u8, u16)>,
}

/// The place to which a task writes its items of one bucket.
type BucketSlot<'b> = (u8, std::slice::IterMut<'b, PlacementItem>);

impl RankStretches<'_> {
    /// Chunks of all placements of `members`, each with its number; `anew`: the scans kept the ranks of other buckets.
    pub(crate) fn cut(&self, members: &[(u32, &AssemblyMember)], anew: bool) -> Vec<Arc<Chunk>> {
        let (few, many): (Vec<_>, Vec<_>) = members.iter().partition(|(_, member)| member.run.len() < FEW);
        let memos: Vec<Vec<u8>> = many.iter().map(|(_, member)| member.run.take_buckets(self.buckets, anew)).collect();
        let readers: Vec<RunReader<'_>> = many.iter().map(|(_, member)| member.run.reader(None)).collect();
        let tasks: Vec<StretchTask<'_>> = many
            .par_iter()
            .zip(&readers)
            .zip(&memos)
            .flat_map(|(((member, _), reader), memo)| {
                memo.par_chunks(TASK)
                    .enumerate()
                    .map(move |(k, buckets)| StretchTask::new(*member, reader, k * TASK, buckets))
            })
            .collect();
        let loners = self.loners(&few, &tasks);
        let (mut counts, in_buckets) = (self.loner_counts(&loners), bucket_counts(&tasks));
        for (count, cell) in counts.iter_mut().zip(self.buckets.cells()) {
            *count += if cell.bucket == STRAY { 0 } else { in_buckets[usize::from(cell.bucket)] };
        }
        let mut left: u64 = counts.iter().sum();
        let most = |left: u64| self.most.saturating_add(left / KEPT_SHARE);
        // As stretches shrink, cells must not be larger than the last ones.
        let cuts = self.buckets.cuts(&counts, self.most);
        let (mut chunks, mut items): (Vec<Arc<Chunk>>, Vec<PlacementItem>) = (Vec::new(), Vec::new());
        let mut at = 0;
        while at < cuts.len() {
            let lens = cuts[at..].iter().map(|cells| counts[cells.clone()].iter().sum::<u64>());
            let sums = lens.scan(0, |sum, len| {
                *sum += len;
                Some(*sum)
            });
            let n = sums.take_while(|sum| *sum <= most(left)).count().max(1);
            let stretch = &cuts[at..at + n];
            left -= self.gather(stretch, &counts, (&tasks, &loners), &mut items);
            let mut rest = &items[..];
            let pieces: Vec<&[PlacementItem]> = stretch
                .iter()
                .map(|cells| {
                    let len = counts[cells.clone()].iter().sum::<u64>();
                    let (piece, after) = rest.split_at(usize::try_from(len).unwrap_or(0).min(rest.len()));
                    rest = after;
                    piece
                })
                .collect();
            chunks.par_extend(pieces.par_iter().flat_map_iter(|piece| self.cutter.cut(&[OrderPiece::Loose(piece)])));
            at += n;
        }
        chunks
    }

    /// Items that no bucket counts: those of small members, and strays; sorted.
    fn loners(&self, few: &[(u32, &AssemblyMember)], tasks: &[StretchTask<'_>]) -> Vec<PlacementItem> {
        let lattice = self.cutter.lattice;
        let of_few = few.par_iter().flat_map_iter(|(number, member)| {
            let reader = member.run.reader(None);
            let place = |mut item: PlacementItem| {
                lattice.place(&mut item, *number);
                item
            };
            (0..member.run.ranks()).filter_map(|rank| reader.item(rank)).map(place).collect::<Vec<_>>()
        });
        let strays = tasks.par_iter().filter(|task| task.counts.iter().any(|(bucket, _)| *bucket == STRAY));
        let strays = strays.flat_map_iter(|task| {
            let is_stray = |(_, bucket): &(u32, &u8)| **bucket == STRAY;
            let ranks = (task.first..).zip(task.buckets).filter(is_stray).map(|(rank, _)| rank);
            ranks.filter_map(|rank| self.item(task, rank)).collect::<Vec<_>>()
        });
        let mut loners: Vec<PlacementItem> = of_few.chain(strays).collect();
        loners.par_sort_unstable_by_key(PlacementItem::key);
        loners
    }

    fn loner_counts(&self, loners: &[PlacementItem]) -> Vec<u64> {
        let cells = self.buckets.cells();
        (0..cells.len()).map(|at| self.loners_of(at, loners).len() as u64).collect()
    }

    /// The loners that are in a cell.
    fn loners_of(&self, cell: usize, loners: &[PlacementItem]) -> Range<usize> {
        let start = |cell: usize| {
            let start = self.buckets.cells().get(cell).map(|cell| cell.start);
            start.map_or(loners.len(), |start| loners.partition_point(|item| item.code() < start))
        };
        start(cell)..start(cell + 1)
    }

    fn item(&self, task: &StretchTask<'_>, rank: u32) -> Option<PlacementItem> {
        let mut item = task.reader.usable_item(rank)?;
        self.cutter.lattice.place(&mut item, task.member);
        Some(item)
    }

    /// Fills `items` with those of a stretch, sorted; returns their number.
    fn gather(
        &self,
        stretch: &[Range<usize>],
        counts: &[u64],
        (tasks, loners): (&[StretchTask<'_>], &[PlacementItem]),
        items: &mut Vec<PlacementItem>,
    ) -> u64 {
        let cells: Vec<usize> = stretch.iter().cloned().flatten().collect();
        let len = |cell: usize| usize::try_from(counts[cell]).unwrap_or(0);
        let total = cells.iter().map(|&cell| len(cell)).sum();
        if items.len() < total {
            *items = Vec::new();
            *items = bytemuck::zeroed_vec(total);
        }
        // Stretches become shorter as chunks take memory.
        items.truncate(total);
        items.shrink_to_fit();
        let mut slots: Vec<Vec<BucketSlot<'_>>> = tasks.iter().map(|_| Vec::new()).collect();
        let mut rest = &mut items[..];
        let mut taken: Vec<usize> = vec![0; tasks.len()];
        for &cell in &cells {
            let (region, after) = std::mem::take(&mut rest).split_at_mut(len(cell));
            rest = after;
            let own = loners.get(self.loners_of(cell, loners)).unwrap_or_default();
            let (for_own, mut region) = region.split_at_mut(own.len());
            for_own.copy_from_slice(own);
            let bucket = self.buckets.cells()[cell].bucket;
            if bucket == STRAY {
                continue;
            }
            for ((task, slots), taken) in tasks.iter().zip(&mut slots).zip(&mut taken) {
                // Buckets come in order: the search for each begins at the last one.
                let counts = &task.counts[*taken..];
                *taken += counts.iter().take_while(|(b, _)| *b < bucket).count();
                if let Some((_, count)) = task.counts.get(*taken).filter(|(b, _)| *b == bucket) {
                    let (slot, after) = region.split_at_mut(usize::from(*count));
                    slots.push((bucket, slot.iter_mut()));
                    region = after;
                }
            }
        }
        tasks.par_iter().zip(&mut slots).for_each(|(task, slots)| self.fill(task, slots));
        drop(slots);
        let mut rest = &mut items[..];
        let mut regions = Vec::with_capacity(cells.len());
        for &cell in &cells {
            let (region, after) = std::mem::take(&mut rest).split_at_mut(len(cell));
            regions.push(region);
            rest = after;
        }
        regions.into_par_iter().with_max_len(1).for_each(|region| region.par_sort_unstable_by_key(PlacementItem::key));
        total as u64
    }

    /// Measures the ranks of a task that are of the slots' buckets, which are consecutive except for gaps.
    fn fill(&self, task: &StretchTask<'_>, slots: &mut [BucketSlot<'_>]) {
        let [Some(low), Some(high)] = [slots.first(), slots.last()].map(|slot| slot.map(|(bucket, _)| *bucket)) else {
            return;
        };
        let mut slot_of = [u8::MAX; 256];
        (0..).zip(slots.iter()).for_each(|(at, (bucket, _))| slot_of[usize::from(*bucket)] = at);
        let is_inside = |bucket: u8| bucket.wrapping_sub(low) <= high - low;
        let mut batch: Vec<(u32, u8)> = Vec::with_capacity(BATCH + LANES);
        let mut flush = |batch: &mut Vec<(u32, u8)>| {
            // The ranks are apart in memory: all are touched first, so that the waits for them overlap.
            std::hint::black_box(batch.iter().fold(0, |sum, (rank, _)| sum ^ task.reader.touch(*rank)));
            for (rank, bucket) in batch.drain(..) {
                let slot = slots.get_mut(usize::from(slot_of[usize::from(bucket)])).and_then(|(_, slot)| slot.next());
                if let (Some(slot), Some(item)) = (slot, self.item(task, rank)) {
                    *slot = item;
                }
            }
        };
        for (start, lanes) in (task.first..).step_by(LANES).zip(task.buckets.chunks(LANES)) {
            if lanes.iter().fold(false, |any, &bucket| any | is_inside(bucket)) {
                batch.extend((start..).zip(lanes.iter().copied()).filter(|(_, bucket)| is_inside(*bucket)));
                if batch.len() >= BATCH {
                    flush(&mut batch);
                }
            }
        }
        flush(&mut batch);
    }
}

impl<'a> StretchTask<'a> {
    fn new(member: u32, reader: &'a RunReader<'a>, first: usize, buckets: &'a [u8]) -> Self {
        let mut all = [0_u16; 256];
        buckets.iter().for_each(|&bucket| all[usize::from(bucket)] += 1);
        // The last bucket, of unusable ranks, is left out.
        let counts = (0..u8::MAX).zip(all).filter(|(_, count)| *count > 0).collect();
        Self { member, reader, first: u32::try_from(first).unwrap_or(u32::MAX), buckets, counts }
    }
}

/// Number of ranks of all tasks in each bucket.
fn bucket_counts(tasks: &[StretchTask<'_>]) -> [u64; 256] {
    let mut all = [0; 256];
    tasks
        .iter()
        .flat_map(|task| &task.counts)
        .for_each(|(bucket, count)| all[usize::from(*bucket)] += u64::from(*count));
    all
}
