// SPDX-License-Identifier: Apache-2.0
//! Removes and adds a few records of a chunk. The result equals that of making the chunk anew from all its items, for
//! the cost of a copy and some measuring for each edited record; a whole block is measured only if its extreme records
//! were removed. Pure.

use std::ops::Range;

use rustc_hash::FxHashMap;

use super::blocks::{BLOCK, RecordBlock};
use super::cells::ChunkCutter;
use super::chunk::{Chunk, ChunkContent, MemberReaders};
use super::which::IndexSet;
use crate::instancing::item::PlacementItem;

/// Chunks with fewer records are made anew. It is large enough for patched chunks to have more than
/// [`super::chunk::SCATTERED`].
const FEW: usize = 80;
/// Chunks in which more than one in so many records is edited are made anew.
pub(super) const SHARE: usize = 12;
/// Chunks of more blocks than this, and four times as many as they need, are made anew.
const MANY_BLOCKS: usize = 8;
/// If more items than this lie between two chunks, they are not edits of either.
const GAP: usize = 256;

/// Edits of one chunk.
#[derive(Clone, Debug, Default)]
pub(crate) struct ChunkEdits {
    /// Range of its items in the list of lost items.
    pub(crate) lost: Range<usize>,
    /// Range of its items in the list of gained items.
    pub(crate) gained: Range<usize>,
}

impl ChunkEdits {
    /// Ranges of items, both sorted, that are edits of each chunk. Items between two chunks belong to the one with
    /// which they share more of their code. Chunks of equal codes may share items.
    pub(crate) fn of_chunks(
        chunks: &[std::sync::Arc<Chunk>],
        lost: &[PlacementItem],
        gained: &[PlacementItem],
    ) -> Vec<Self> {
        let range = |items: &[PlacementItem], codes: [u64; 2]| {
            items.partition_point(|i| i.code() < codes[0])..items.partition_point(|i| i.code() <= codes[1])
        };
        let mut edits: Vec<Self> = chunks
            .iter()
            .map(|chunk| Self { lost: range(lost, chunk.codes), gained: range(gained, chunk.codes) })
            .collect();
        for k in 0..=chunks.len() {
            let before = k.checked_sub(1).and_then(|k| edits.get(k)).map_or(0, |e| e.gained.end);
            let after = edits.get(k).map_or(gained.len(), |e| e.gained.start);
            let Some(gap) = gained.get(before..after).filter(|gap| !gap.is_empty() && gap.len() <= GAP) else {
                continue;
            };
            let shared = |code: u64, end: Option<u64>| end.map_or(0, |end| 1 + (code ^ end).leading_zeros());
            let left = k.checked_sub(1).and_then(|k| chunks.get(k)).map(|c| c.codes[1]);
            let right = chunks.get(k).map(|c| c.codes[0]);
            let cut = before + gap.partition_point(|i| shared(i.code(), left) > shared(i.code(), right));
            if let Some(edits) = k.checked_sub(1).and_then(|k| edits.get_mut(k)) {
                edits.gained.end = cut;
            }
            if let Some(edits) = edits.get_mut(k) {
                edits.gained.start = cut;
            }
        }
        edits
    }

    /// Number of items.
    pub(crate) fn len(&self) -> usize {
        self.lost.len() + self.gained.len()
    }

    /// Returns true if a chunk is better patched than made anew.
    pub(crate) fn are_few(&self, chunk: &Chunk) -> bool {
        chunk.len() >= FEW && self.len() * SHARE <= chunk.len()
    }
}

/// A chunk being patched.
struct ChunkPatch<'a> {
    cutter: &'a ChunkCutter<'a>,
    chunk: &'a Chunk,
    readers: MemberReaders<'a>,
    /// By member of the chunk: its present number, or that of the next one and false if it was removed.
    order: Vec<(u32, bool)>,
    /// First record of each block.
    starts: Vec<usize>,
    /// Positions of the lost records.
    lost: Vec<(usize, PlacementItem)>,
    /// Gained records: block, and the old record before which each is inserted.
    gained: Vec<(usize, usize, PlacementItem)>,
}

impl ChunkCutter<'_> {
    /// A chunk after edits, without key; `None` if it cannot be patched and must be made anew. `lost` have lasting ids
    /// in place of members, `gained` are in order; no other chunk has records of the same codes.
    pub(crate) fn patch(&self, chunk: &Chunk, lost: &[PlacementItem], gained: &[PlacementItem]) -> Option<Chunk> {
        let members = chunk.members();
        let starts = chunk.blocks.iter().scan(0, |at, block| Some(std::mem::replace(at, *at + block.len as usize)));
        let mut patch = ChunkPatch {
            cutter: self,
            chunk,
            readers: MemberReaders::new(&members, None),
            order: self.present_order(chunk),
            starts: starts.collect(),
            lost: Vec::with_capacity(lost.len()),
            gained: Vec::with_capacity(gained.len()),
        };
        patch.find_lost(lost)?;
        patch.find_gained(gained)?;
        let blocks = patch.blocks()?;
        let left = (chunk.len() + gained.len()).saturating_sub(lost.len());
        if blocks.len() > MANY_BLOCKS + 4 * left / BLOCK as usize {
            // Such blocks were emptied one by one over many edits.
            return None;
        }
        let codes = [blocks.first()?.first, patch.last_code()?];
        let content = patch.content(codes, blocks)?;
        Some(Chunk::of(content, self.roster, self.lattice))
    }

    /// A chunk of the same records with the values that the present members give them, without key.
    pub(crate) fn revalued(&self, chunk: &Chunk) -> Chunk {
        let content = ChunkContent {
            codes: chunk.codes,
            present: chunk.ids.iter().filter_map(|id| self.member_of.get(id).copied()).collect(),
            counts: chunk.counts.to_vec(),
            ranks: chunk.ranks.to_vec(),
            which: IndexSet::clone(&chunk.which),
            blocks: chunk.blocks.to_vec(),
        };
        Chunk::of(content, self.roster, self.lattice)
    }

    /// The order of the members present, as [`ChunkPatch::order`] needs it.
    fn present_order(&self, chunk: &Chunk) -> Vec<(u32, bool)> {
        let mut next = u32::MAX;
        let mut order: Vec<(u32, bool)> = Vec::with_capacity(chunk.ids.len());
        for id in chunk.ids.iter().rev() {
            let number = self.member_of.get(id);
            next = number.copied().unwrap_or(next);
            order.push((next, number.is_some()));
        }
        order.reverse();
        order
    }
}

impl ChunkPatch<'_> {
    /// The item of an old record.
    fn measure(&mut self, at: usize) -> Option<PlacementItem> {
        let (which, rank) = self.chunk.place(at)?;
        let number = self.order.get(which as usize)?.0;
        let mut item = self.readers.item(which, rank)?;
        self.cutter.lattice.place(&mut item, number);
        Some(item)
    }

    /// Returns true if an old record, whose code is given, comes before a gained one.
    fn is_before(&self, at: usize, code: u64, gained: &PlacementItem) -> bool {
        if code != gained.code() {
            return code < gained.code();
        }
        let place = self.chunk.place(at);
        let order = place.and_then(|(which, rank)| Some((rank, self.order.get(which as usize)?)));
        order.is_some_and(|(rank, &(number, is_there))| {
            // A removed record comes directly before the next member.
            if is_there { (number, rank) < (gained.member(), gained.rank()) } else { number <= gained.member() }
        })
    }

    fn end_of(&self, block: usize) -> usize {
        self.starts.get(block + 1).copied().unwrap_or(self.chunk.len())
    }

    fn find_lost(&mut self, lost: &[PlacementItem]) -> Option<()> {
        let chunk = self.chunk;
        let which_of: FxHashMap<u32, u32> = chunk.ids.iter().copied().zip(0..).collect();
        for item in lost {
            let wanted = (*which_of.get(&item.member())?, item.rank());
            // Its code may be that of the first records of several blocks, and of the last ones of the block before.
            let first = chunk.blocks.partition_point(|b| b.first < item.code()).saturating_sub(1);
            let last = chunk.blocks.partition_point(|b| b.first <= item.code());
            let range = *self.starts.get(first)?..self.end_of(last.checked_sub(1)?);
            let mut places = range.start..;
            let ranks = chunk.ranks.get(range)?.iter();
            let found = ranks
                .zip(&mut places)
                .find(|(rank, at)| **rank == wanted.1 && chunk.which.get(*at).is_none_or(|which| which == wanted.0));
            self.lost.push((found?.1, *item));
        }
        self.lost.sort_unstable_by_key(|(at, _)| *at);
        Some(())
    }

    fn find_gained(&mut self, gained: &[PlacementItem]) -> Option<()> {
        let chunk = self.chunk;
        // Codes of the records of the last block that was measured, as far as they are known.
        let mut known: (usize, Vec<Option<u64>>) = (usize::MAX, Vec::new());
        for item in gained {
            let is_before = |k: usize| self.is_before(self.starts[k], chunk.blocks[k].first, item);
            let (mut low, mut high) = (0, chunk.blocks.len());
            while low < high {
                let middle = usize::midpoint(low, high);
                if is_before(middle) { low = middle + 1 } else { high = middle }
            }
            let block = low.saturating_sub(1);
            let start = *self.starts.get(block)?;
            if known.0 != block {
                known.0 = block;
                known.1.clear();
                known.1.resize(chunk.blocks.get(block)?.len as usize, None);
                *known.1.first_mut()? = Some(chunk.blocks.get(block)?.first);
            }
            let (mut low, mut high) = (start, self.end_of(block));
            while low < high {
                let middle = usize::midpoint(low, high);
                let code = match *known.1.get(middle - start)? {
                    Some(code) => code,
                    None => self.measure(middle)?.code(),
                };
                *known.1.get_mut(middle - start)? = Some(code);
                if self.is_before(middle, code, item) { low = middle + 1 } else { high = middle }
            }
            self.gained.push((block, low, *item));
        }
        Some(())
    }

    /// The blocks after the edits.
    fn blocks(&mut self) -> Option<Vec<RecordBlock>> {
        let (lost, gained) = (std::mem::take(&mut self.lost), std::mem::take(&mut self.gained));
        let mut blocks = Vec::with_capacity(self.chunk.blocks.len());
        let (mut lost_left, mut gained_left) = (&lost[..], &gained[..]);
        for (k, old) in self.chunk.blocks.iter().enumerate() {
            let range = *self.starts.get(k)?..self.end_of(k);
            let (lost, rest) = lost_left.split_at(lost_left.partition_point(|(at, _)| *at < range.end));
            lost_left = rest;
            let (gained, rest) = gained_left.split_at(gained_left.partition_point(|(block, ..)| *block <= k));
            gained_left = rest;
            if lost.is_empty() && gained.is_empty() {
                blocks.push(*old);
                continue;
            }
            let mut block = *old;
            let mut known = block.len as usize + gained.len() <= 2 * BLOCK as usize;
            for (_, item) in lost {
                known &= block.remove(self.cutter.lattice.peaks(item));
            }
            if known {
                gained.iter().for_each(|(.., item)| block.add(self.cutter.lattice.peaks(item)));
                let is_lost = |at: usize| lost.binary_search_by_key(&at, |(at, _)| *at).is_ok();
                let first = range.clone().find(|at| !is_lost(*at)).unwrap_or(range.end);
                block.first = match gained.first() {
                    Some((_, at, item)) if *at <= first => item.code(),
                    _ if first == range.start => old.first,
                    _ => self.measure(first)?.code(),
                };
                blocks.push(block);
            } else {
                blocks.extend(RecordBlock::of(self.merged(range, lost, gained)?.iter(), self.cutter.lattice));
            }
        }
        (self.lost, self.gained) = (lost, gained);
        Some(blocks)
    }

    /// The items of a block after the edits, all measured.
    fn merged(
        &mut self,
        range: Range<usize>,
        lost: &[(usize, PlacementItem)],
        gained: &[(usize, usize, PlacementItem)],
    ) -> Option<Vec<PlacementItem>> {
        let mut items = Vec::with_capacity(range.len() + gained.len());
        let mut gained = gained.iter().peekable();
        let mut lost = lost.iter().peekable();
        for at in range.clone() {
            while let Some((.., item)) = gained.next_if(|(_, before, _)| *before <= at) {
                items.push(*item);
            }
            if lost.next_if(|(gone, _)| *gone == at).is_none() {
                items.push(self.measure(at)?);
            }
        }
        items.extend(gained.map(|(.., item)| *item));
        Some(items)
    }

    /// The code of the last record after the edits.
    fn last_code(&mut self) -> Option<u64> {
        let old = self.chunk.len();
        let gone = self.lost.iter().rev().zip(1..).take_while(|((at, _), back)| at + back == old).count();
        let left = old - gone;
        match self.gained.last() {
            Some((_, before, item)) if *before >= left => Some(item.code()),
            _ if gone == 0 => Some(self.chunk.codes[1]),
            _ => Some(self.measure(left.checked_sub(1)?)?.code()),
        }
    }

    /// The content of the patched chunk.
    fn content(&self, codes: [u64; 2], blocks: Vec<RecordBlock>) -> Option<ChunkContent> {
        let chunk = self.chunk;
        let mut left = chunk.counts.to_vec();
        for (at, _) in &self.lost {
            *left.get_mut(chunk.place(*at)?.0 as usize)? -= 1;
        }
        let old = || self.order.iter().zip(&left).filter(|(_, left)| **left > 0);
        if old().any(|((_, is_there), _)| !is_there) {
            return None;
        }
        let mut present: Vec<u32> = old().map(|((number, _), _)| *number).collect();
        present.extend(self.gained.iter().map(|(.., item)| item.member()));
        present.sort_unstable();
        present.dedup();
        let local = |number: u32| u32::try_from(present.binary_search(&number).ok()?).ok();
        let moved: Vec<u32> = self.order.iter().map(|(number, _)| local(*number).unwrap_or(u32::MAX)).collect();
        let mut counts = vec![0_u32; present.len()];
        for (to, left) in moved.iter().zip(&left).filter(|(_, left)| **left > 0) {
            *counts.get_mut(*to as usize)? += left;
        }
        let len = (chunk.len() + self.gained.len()).checked_sub(self.lost.len())?;
        let many = present.len() > 1;
        let (mut ranks, mut which) = (Vec::with_capacity(len), Vec::with_capacity(if many { len } else { 0 }));
        let copy = |ranks: &mut Vec<u32>, which: &mut Vec<u32>, range: Range<usize>| {
            ranks.extend_from_slice(chunk.ranks.get(range.clone()).unwrap_or_default());
            if many && chunk.which.is_empty() {
                which.resize(which.len() + range.len(), moved.first().copied().unwrap_or(0));
            } else if many {
                which.extend(chunk.which.range(range).map(|w| moved.get(w as usize).copied().unwrap_or(u32::MAX)));
            }
        };
        let (mut at, mut lost) = (0, self.lost.iter().map(|(at, _)| *at).peekable());
        for (_, before, item) in &self.gained {
            while let Some(gone) = lost.next_if(|gone| gone < before) {
                copy(&mut ranks, &mut which, at..gone);
                at = gone + 1;
            }
            copy(&mut ranks, &mut which, at..*before);
            at = *before;
            let member = local(item.member())?;
            *counts.get_mut(member as usize)? += 1;
            ranks.push(item.rank());
            if many {
                which.push(member);
            }
        }
        for gone in lost {
            copy(&mut ranks, &mut which, at..gone);
            at = gone + 1;
        }
        copy(&mut ranks, &mut which, at..chunk.len());
        let which = IndexSet::of(which.into_iter(), present.len());
        (ranks.len() == len).then_some(ChunkContent { codes, present, counts, ranks, which, blocks })
    }
}
